// One machine in an element; its `machine` property is what tests ask.
async function start(root, data) {
  const core = await loadedCore(data)
  const mover = data.kind === 'arm' ? new Arm(core, data) : new Mover(core, data)
  const cloud = data.cloud ? await cloudOf(data.cloud) : null
  const show = { numbers: !data.calibration, frames: true, limits: true, cloud: Boolean(data.stiffness), places: true, names: { numbers: 'numbers', frames: 'frames' } }
  if (hasCones(data)) show.names.limits = 'joint cones'
  if (cloud) show.names.cloud = data.stiffness ? 'workspace, by stiffness' : 'workspace'
  if (data.places) show.names.places = data.places.name
  if (data.cameras) show.cameras = true, show.names.cameras = 'cameras and boards'
  const assumed = data.calibration ? await loadedCore(data) : null
  root.replaceChildren()
  const canvas = made('canvas', root, { tabindex: 0, role: 'img', 'aria-label': `${data.name} in three dimensions: drag to turn it` })
  const side = made('aside', root)
  const parts = {}
  const looks = () => {
    const limits = data.kind === 'arm' ? null : limitsOf(mover)
    const bodies = data.kind === 'arm' ? drawArm(mover, show) : drawParallel(mover, limits, show)
    if (data.places && show.places) bodies.list.push({ dots: data.places.poses.map(pose => pose.slice(0, 3)), colour: 'planned', wide: 4 })
    if (data.cameras && show.cameras) root.seen = drawCameras(bodies, data.cameras, ...(data.kind === 'arm' ? [mover.frames.at(-1).slice(0, 9), mover.frames.at(-1).slice(9)] : [rotation(mover.pose), mover.pose.slice(0, 3)]))
    parts.calibration?.add(bodies)
    return [limits, bodies]
  }
  const draw = ([, bodies]) => scene.draw(bodies, { cloud: show.cloud ? cloud : null, stiffness: data.stiffness?.cloud, key: parts.calibration?.key })
  const redraw = () => { if (parts.panel) draw(looks()) }
  const scene = new Scene(canvas, redraw)
  if (data.map === 'planar' || data.map === 'xy') scene.tilt = 1.1
  const places = ({ list }) => list.flatMap(b => b.rod ?? (b.dashed ? [] : b.line) ?? (b.ball ? [b.ball] : []))
  const changed = anew => {
    const found = looks()
    parts.panel.update(found[0])
    if (anew) scene.fit(places(found[1]))
    else scene.include(places(found[1]))
    draw(found)
  }
  parts.panel = new Panel(side, mover, changed, show)
  if (assumed) {
    const first = made('div')
    parts.calibration = new Calibration(assumed, data, mover, first, redraw)
    parts.panel.condition.after(first)
    scene.pointed = (x, y) => parts.calibration.point(x, y, scene)
  }
  changed(true)
  root.classList.add('moves')
  root.machine = { mover, scene, show, changed, calibration: parts.calibration, limits: () => looks()[0] }
}

async function cloudOf({ low, step, points }) {
  const whole = new Uint16Array(await unpacked(points))
  return Array.from({ length: whole.length / 3 }, (_, k) => low.map((x, j) => x + step[j] * whole[3 * k + j]))
}
