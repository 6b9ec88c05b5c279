// One machine in an element; its `machine` property is what tests ask.
async function start(root, data) {
  const core = await loadedCore(data)
  const mover = data.kind === 'arm' ? new Arm(core, data) : new Mover(core, data)
  const cloud = data.cloud ? await cloudOf(data.cloud) : null
  const show = { numbers: true, frames: true, limits: true, cloud: false, names: { numbers: 'numbers', frames: 'frames' } }
  if (data.kind !== 'arm') show.names.limits = 'joint cones'
  if (cloud) show.names.cloud = 'where it gets to'
  root.replaceChildren()
  const canvas = made('canvas', root, { tabindex: 0, role: 'img', 'aria-label': `${data.name} in three dimensions: drag to turn it` })
  const side = made('aside', root)
  const looks = () => {
    const limits = data.kind === 'arm' ? null : limitsOf(mover)
    return [limits, data.kind === 'arm' ? drawArm(mover, show) : drawParallel(mover, limits, show)]
  }
  let panel = null
  const redraw = () => {
    if (!panel) return
    const [, bodies] = looks()
    scene.draw(bodies, { cloud: show.cloud ? cloud : null })
  }
  const scene = new Scene(canvas, redraw)
  if (data.map === 'planar' || data.map === 'xy') scene.tilt = 1.1
  const changed = () => {
    const [limits, bodies] = looks()
    panel.update(limits)
    scene.draw(bodies, { cloud: show.cloud ? cloud : null })
  }
  panel = new Panel(side, mover, changed, show)
  const [, bodies] = looks()
  scene.fit(bodies.list.flatMap(b => b.rod ?? b.line ?? (b.ball ? [b.ball] : [])))
  changed()
  root.machine = { mover, scene, show, changed, limits: () => looks()[0] }
}

async function cloudOf({ low, step, points }) {
  const whole = new Uint16Array(await unpacked(points))
  return Array.from({ length: whole.length / 3 }, (_, k) => low.map((x, j) => x + step[j] * whole[3 * k + j]))
}
