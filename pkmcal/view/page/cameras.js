// A camera, its board, and whether it sees the board at this pose: one stands in the base, the other
// is carried. Places are rotations row by row and points, mm.
const SIGHT = 0.35 // of the machine's size: how long the lines of sight are drawn

// pixels of a point in axes of a camera
function pixel([fx, fy, cx, cy, k1, k2, p1, p2, k3], v) {
  const x = v[0] / v[2], y = v[1] / v[2], r = x * x + y * y, radial = 1 + r * (k1 + r * (k2 + r * k3))
  return [fx * (x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)) + cx, fy * (y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y) + cy]
}

const undone = (R, p, v) => [0, 1, 2].map(k => dot(column(R, k), sub(v, p)))

// corners of the board in the picture, none of it behind the camera or from behind
function seesBoard({ lens, size }, corners, facing) {
  if (corners.some(v => !(v[2] > 0)) || !(facing > 0)) return false
  return corners.map(v => pixel(lens, v)).every(([u, v]) => u >= 0 && v >= 0 && u <= size[0] - 1 && v <= size[1] - 1)
}

function drawCameras(out, cameras, R, p) {
  const found = []
  for (const each of cameras) {
    const { rides, camera, board, corners, lens, size } = each
    const carried = v => placed(R, p, v), inBase = (own, moves) => v => { const at = placed(own.R, own.p, v); return moves ? carried(at) : at }
    const ofCamera = inBase(camera, rides), ofBoard = inBase(board, !rides)
    const seenFrom = v => undone(camera.R, camera.p, rides ? undone(R, p, v) : v)
    const outline = corners.map(ofBoard), own = outline.map(seenFrom), middle = scaled(own.reduce((a, b) => add(a, b)), 0.25)
    const normal = sub(seenFrom(ofBoard([0, 0, 1])), seenFrom(ofBoard([0, 0, 0])))
    const sees = seesBoard(each, own, dot(normal, middle)), colour = sees ? 'seen' : 'bad'
    const eye = ofCamera([0, 0, 0]), far = Math.min(SIGHT * out.size, middle[2] > 0 ? middle[2] : Infinity)
    const edge = [[0, 0], [size[0], 0], size, [0, size[1]]].map(([u, v]) => ofCamera([((u - lens[2]) / lens[0]) * far, ((v - lens[3]) / lens[1]) * far, far]))
    out.face(outline, sees ? 'seenface' : 'badface')
    out.line([...outline, outline[0]], colour, 2)
    out.ball(eye, 1.3, 'camera')
    for (const at of edge) out.line([eye, at], 'camera')
    out.line([...edge, edge[0]], 'camera')
    if (sees) out.line([eye, ofCamera(middle)], 'seen', 1, true)
    out.text(add(eye, [0, 0, 3 * out.thick]), each.name, 'label')
    found.push(sees)
  }
  return found
}
