// Bodies seen in perspective on a plain canvas: what is farther is drawn first.
const COLOURS = {
  light: {
    paper: '#f6f7f5', ink: '#1d2a33', dim: '#56656e', label: '#0b5c70', base: '#5b6770', baseface: '#5b677018',
    platform: '#0b7285', platformface: '#0b728530', joint: '#37424a', tube: '#b9c0c4', rod: '#8a959c', rail: '#a9b1b6',
    track: '#a9b1b6', cable: '#56656e', bad: '#d6303a', badface: '#d6303a22', cone: '#8a6d00', coneface: '#c9a2271c',
    x: '#c0392b', y: '#2e8b3d', z: '#2a5bd7', cloud: '#0b728599', grid: '#d8dedd', shadow: '#1d2a3314',
    before: '#d55e00', after: '#0072b2', ghost: '#d55e0099', planned: '#7b4ab5',
    camera: '#7a5c00', seen: '#2e8b3d', seenface: '#2e8b3d33',
  },
  dark: {
    paper: '#12191d', ink: '#e6ecec', dim: '#9fb0b8', label: '#7fe0f0', base: '#71808a', baseface: '#71808a22',
    platform: '#1fa6bd', platformface: '#3bc9db2c', joint: '#97a5ad', tube: '#8d989f', rod: '#66737b', rail: '#56636b',
    track: '#56636b', cable: '#9fb0b8', bad: '#ff5a63', badface: '#ff5a6328', cone: '#d8b84a', coneface: '#d8b84a1c',
    x: '#ff7b6b', y: '#63cf74', z: '#7ea4ff', cloud: '#3bc9dbaa', grid: '#26323a', shadow: '#00000040',
    before: '#ff9d4d', after: '#5db4ea', ghost: '#ff9d4d99', planned: '#b892ea',
    camera: '#d8b84a', seen: '#63cf74', seenface: '#63cf7433',
  },
}
const FOCAL = 2.6, PIECE = 0.09 // of the size: long rods are sorted in pieces
const ASIDE = 26, SIDES = 12 // pixels around the machine, where labels stand; from how many sides it is fitted

const shades = {}
function shade(colour, by) { // towards black or, above 1, white
  return (shades[colour + by] ??= '#' + [1, 3, 5].map(k => {
    const x = parseInt(colour.slice(k, k + 2), 16)
    return Math.round(by < 1 ? x * by : 255 - (255 - x) / by).toString(16).padStart(2, '0')
  }).join('') + colour.slice(7))
}

class Scene {
  constructor(canvas, redraw) {
    Object.assign(this, { canvas, redraw, turn: -0.9, tilt: 0.32, zoom: 1, room: 1, centre: [0, 0, 0], radius: 1, points: [] })
    this.context = canvas.getContext('2d')
    this.dark = matchMedia('(prefers-color-scheme: dark)')
    this.dark.addEventListener('change', redraw)
    this.observer = new ResizeObserver(redraw)
    this.observer.observe(canvas)
    this.listen()
  }

  // these points in the middle of the picture, as large as they can be turned around there
  fit(points) {
    const low = [0, 1, 2].map(k => Math.min(...points.map(p => p[k])))
    const high = [0, 1, 2].map(k => Math.max(...points.map(p => p[k])))
    this.centre = mix(low, high, 0.5)
    this.radius = Math.max(norm(sub(high, low)) / 2, 1e-3)
    this.floor = low[2]
    this.points = points
    this.tilted = this.tilt
    this.fitted = ''
  }

  // and these too: a machine that moves stays in the picture
  include(points) {
    const { wide, high } = this.size(), eye = this.eyeFrom(wide, high, this.turn, this.tilt, this.room)
    const outside = points.filter(p => !this.inside(eye, p))
    if (!outside.length) return
    this.points = [...this.points, ...outside]
    this.fitted = ''
  }

  inside(eye, p) {
    const [x, y] = this.seen(eye, p)
    return Math.abs(x - eye.wide / 2) < eye.wide / 2 - ASIDE && Math.abs(y - eye.high / 2) < eye.high / 2 - ASIDE
  }

  // how far away, in radii, one has to be to see all points from every side
  roomFor(wide, high) {
    let near = 0.3, far = 64
    const all = room => Array.from({ length: SIDES }, (_, k) => this.eyeFrom(wide, high, (2 * Math.PI * k) / SIDES, this.tilted, room))
      .every(eye => this.points.every(p => this.inside(eye, p)))
    for (let k = 0; k < 12; k++) {
      const middle = Math.sqrt(near * far)
      if (all(middle)) far = middle
      else near = middle
    }
    return far
  }

  size() { return { wide: Math.max(this.canvas.clientWidth, 1), high: Math.max(this.canvas.clientHeight, 1) } }

  eyeFrom(wide, high, turn, tilt, room) {
    const [ct, st, ce, se] = [Math.cos(turn), Math.sin(turn), Math.cos(tilt), Math.sin(tilt)]
    return {
      wide, high, away: FOCAL * this.radius * room, scale: (FOCAL * Math.min(wide, high)) / 2,
      right: [-st, ct, 0], up: [-ct * se, -st * se, ce], back: [ct * ce, st * ce, se],
    }
  }

  look() {
    const { canvas, context } = this, ratio = devicePixelRatio || 1, { wide, high } = this.size()
    if (canvas.width !== Math.round(wide * ratio)) canvas.width = Math.round(wide * ratio)
    if (canvas.height !== Math.round(high * ratio)) canvas.height = Math.round(high * ratio)
    context.setTransform(ratio, 0, 0, ratio, 0, 0)
    if (this.fitted !== `${wide} ${high}`) {
      this.fitted = `${wide} ${high}`
      this.room = this.roomFor(wide, high)
    }
    return this.eyeFrom(wide, high, this.turn, this.tilt, this.room / this.zoom)
  }

  // x and y on the canvas, the distance, and how many pixels a mm is there
  seen(eye, p) {
    const v = sub(p, this.centre), distance = eye.away - dot(v, eye.back), f = eye.scale / Math.max(distance, 0.05 * eye.away)
    return [eye.wide / 2 + f * dot(v, eye.right), eye.high / 2 - f * dot(v, eye.up), distance, f]
  }

  draw(bodies, extra = {}) {
    const eye = this.look(), { context } = this, colours = COLOURS[this.dark.matches ? 'dark' : 'light']
    this.eye = eye
    context.fillStyle = colours.paper
    context.fillRect(0, 0, eye.wide, eye.high)
    this.ground(eye, colours, bodies)
    if (extra.cloud) this.dots(eye, extra.cloud, extra.stiffness ? tinted(extra.stiffness, colours.bad) : colours.cloud, extra.stiffness ? 4 : 2)
    const tasks = []
    for (const body of bodies.list) this.plan(eye, body, colours, tasks)
    tasks.sort((a, b) => b.far - a.far)
    for (const task of tasks) task.draw()
    if (extra.key) this.scaleOf(eye, colours, extra.key)
    this.texts(eye, bodies.list.filter(body => body.text), colours)
  }

  plan(eye, body, colours, tasks) {
    const colour = colours[body.colour] ?? body.colour
    if (body.rod) {
      const [a, b] = body.rod, count = Math.min(40, Math.max(1, Math.ceil(norm(sub(b, a)) / (PIECE * this.radius))))
      for (let k = 0; k < count; k++) {
        const one = this.seen(eye, mix(a, b, k / count)), other = this.seen(eye, mix(a, b, (k + 1) / count))
        tasks.push({ far: (one[2] + other[2]) / 2, draw: () => this.piece(one, other, body.r, colour) })
      }
    } else if (body.ball) {
      const at = this.seen(eye, body.ball)
      tasks.push({ far: at[2] - body.r, draw: () => this.sphere(at, body.r, colour) })
    } else if (body.face || body.line) {
      const points = (body.face ?? body.line).map(p => this.seen(eye, p))
      const far = body.over ? -1 : points.reduce((sum, p) => sum + p[2], 0) / points.length
      tasks.push({ far, draw: () => this.path(points, colour, body) })
    } else if (body.arrow) {
      const [a, b] = body.arrow.map(p => this.seen(eye, p))
      tasks.push({ far: (a[2] + b[2]) / 2, draw: () => this.arrow(a, b, colour) })
    } else if (body.dots) {
      for (const p of body.dots) {
        const at = this.seen(eye, p)
        tasks.push({ far: at[2], draw: () => this.dot(at, colour, body.wide ?? 3) })
      }
    }
  }

  // a round bar: dark at its edges, light along its upper side
  piece(a, b, r, colour) {
    const { context } = this, wide = Math.max(1, r * (a[3] + b[3])), v = [b[0] - a[0], b[1] - a[1]]
    const long = Math.hypot(...v) || 1, over = [v[0] / long * 0.6, v[1] / long * 0.6]
    let side = [-v[1] / long, v[0] / long]
    if (side[0] * 0.5 + side[1] > 0) side = [-side[0], -side[1]]
    for (const [part, by, aside] of wide < 3 ? [[1, 1, 0]] : [[1, 0.62, 0], [0.74, 1, 0.06], [0.3, 1.7, 0.18]]) {
      context.strokeStyle = by === 1 ? colour : shade(colour, by)
      context.lineWidth = part * wide
      context.beginPath()
      context.moveTo(a[0] - over[0] + side[0] * aside * wide, a[1] - over[1] + side[1] * aside * wide)
      context.lineTo(b[0] + over[0] + side[0] * aside * wide, b[1] + over[1] + side[1] * aside * wide)
      context.stroke()
    }
  }

  sphere([x, y, , f], r, colour) {
    const { context } = this, size = Math.max(1.2, r * f)
    const fill = context.createRadialGradient(x - size * 0.3, y - size * 0.4, size * 0.1, x, y, size)
    fill.addColorStop(0, shade(colour, 2)), fill.addColorStop(0.5, colour), fill.addColorStop(1, shade(colour, 0.55))
    context.fillStyle = fill
    context.beginPath()
    context.arc(x, y, size, 0, 2 * Math.PI)
    context.fill()
  }

  path(points, colour, { face, wide = 1, dashed }) {
    const { context } = this
    context.beginPath()
    points.forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)))
    if (face) {
      context.closePath()
      context.fillStyle = colour
      context.fill()
      return
    }
    context.setLineDash(dashed ? [4, 4] : [])
    context.strokeStyle = colour
    context.lineWidth = wide
    context.stroke()
    context.setLineDash([])
  }

  arrow(a, b, colour) {
    const v = [b[0] - a[0], b[1] - a[1]], long = Math.hypot(...v), head = Math.min(7, long)
    this.dot(a, colour, 5)
    if (long < 1) return
    const [x, y] = [v[0] / long * head, v[1] / long * head]
    this.path([a, b], colour, { wide: 1.8 })
    this.path([[b[0] - x - y * 0.5, b[1] - y + x * 0.5], b, [b[0] - x + y * 0.5, b[1] - y - x * 0.5]], colour, { wide: 1.8 })
  }

  // how long a residual is in the middle of the picture
  scaleOf(eye, colours, { long, text }) {
    const wide = (long * eye.scale) / eye.away, x = 16, y = eye.high - 18
    this.path([[x, y - 4], [x, y + 4], [x, y], [x + wide, y], [x + wide, y - 4], [x + wide, y + 4]], colours.ink, { wide: 1.6 })
    this.context.font = '12px system-ui, sans-serif'
    this.context.textAlign = 'left'
    this.context.fillStyle = colours.ink
    this.context.fillText(`residual of ${text}`, x, y - 12)
  }

  dot([x, y], colour, wide) {
    this.context.fillStyle = colour
    this.context.fillRect(x - wide / 2, y - wide / 2, wide, wide)
  }

  dots(eye, points, colour, wide) {
    points.forEach((p, k) => this.dot(this.seen(eye, p), Array.isArray(colour) ? colour[k] : colour, wide))
  }

  // Numbers first, then the nearer ones; what would cover another moves a line up or down, or goes.
  texts(eye, bodies, colours) {
    const taken = [], { context } = this
    const planned = bodies.map(body => ({ ...body, seen: this.seen(eye, body.at) }))
    planned.sort((a, b) => (b.colour === 'label') - (a.colour === 'label') || a.seen[2] - b.seen[2])
    for (const { text, colour, seen: [middle, y] } of planned) {
      context.font = `${colour === 'label' ? '600 14px' : '12px'} system-ui, sans-serif`
      const half = context.measureText(text).width / 2 + 2
      if (middle < 0 || middle > eye.wide) continue
      const x = Math.max(half, Math.min(eye.wide - half, middle))
      const free = at => taken.every(([l, r, t]) => x + half < l || x - half > r || Math.abs(at - t) > 13)
      const at = [y, y - 14, y + 14].find(free)
      if (at === undefined) continue
      taken.push([x - half, x + half, at])
      context.textAlign = 'center'
      context.textBaseline = 'middle'
      context.lineWidth = 3.5
      context.lineJoin = 'round'
      context.strokeStyle = colours.paper
      context.strokeText(text, x, at)
      context.fillStyle = colours[colour] ?? colour
      context.fillText(text, x, at)
    }
  }

  // a floor with squares of a round size, and the platform's shadow on it
  ground(eye, colours, { top }) {
    const { centre, radius, floor } = this, power = 10 ** Math.floor(Math.log10(radius / 2))
    const step = power * (radius / power > 10 ? 5 : radius / power > 5 ? 2 : 1), count = Math.ceil(radius / step) + 1
    const middle = centre.map(x => Math.round(x / step) * step), far = count * step
    this.step = step
    for (let k = -count; k <= count; k++)
      for (const line of [[[k * step, -far], [k * step, far]], [[-far, k * step], [far, k * step]]])
        this.path(line.map(([x, y]) => this.seen(eye, [middle[0] + x, middle[1] + y, floor])), colours.grid, {})
    if (top.length > 2) this.path(outline(top).map(p => this.seen(eye, [p[0], p[1], floor])), colours.shadow, { face: true })
  }

  // drag turns, two fingers and the wheel zoom, keys do both
  listen() {
    const { canvas } = this, held = new Map()
    const moved = (turn, tilt, zoom = 1) => {
      this.turn -= turn
      this.tilt = Math.min(1.55, Math.max(-1.55, this.tilt + tilt))
      this.zoom = Math.min(12, Math.max(0.3, this.zoom * zoom))
      this.redraw()
    }
    const apart = () => { const [a, b] = [...held.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]) }
    canvas.addEventListener('pointerdown', e => {
      this.pointed?.(e.offsetX, e.offsetY, 1)
      held.set(e.pointerId, [e.clientX, e.clientY])
      canvas.setPointerCapture(e.pointerId)
    })
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, e => held.delete(e.pointerId))
    canvas.addEventListener('pointermove', e => {
      const from = held.get(e.pointerId)
      if (!from) return this.pointed?.(e.offsetX, e.offsetY)
      const before = held.size === 2 ? apart() : 0
      held.set(e.pointerId, [e.clientX, e.clientY])
      if (before) moved(0, 0, apart() / before)
      else moved((e.clientX - from[0]) * 0.008, (e.clientY - from[1]) * 0.008)
    })
    canvas.addEventListener('wheel', e => { e.preventDefault(); moved(0, 0, Math.exp(-e.deltaY * 0.001)) }, { passive: false })
    canvas.addEventListener('dblclick', () => { this.zoom = 1; this.redraw() })
    canvas.addEventListener('keydown', e => {
      const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1], '+': [0, 0, 1.1], '-': [0, 0, 1 / 1.1] }[e.key]
      if (by) e.preventDefault(), moved(...by)
    })
  }
}
