// The machine in three dimensions, by the scripts that draw it everywhere.
import { core } from './transport.js'
import { app, made } from './frame.js'

const cores = {}

// Draw a machine; where it was drawn before, the look at it and what is shown stay.
export async function draw(parent, data, picked) {
  const { start } = await import('/view.js')
  cores[data.kind] ??= await core(data.kind)
  if (!parent.isConnected) return // another screen is shown by now
  const last = app.picture, old = last?.isConnected && last.parentElement === parent ? last : null
  const root = made('div', null, { className: 'pkmcal-view' })
  if (old) old.replaceWith(root)
  else parent.replaceChildren(root)
  app.picture = root
  const same = old?.machine?.name === data.name
  await start(root, { ...data, wasm: cores[data.kind] })
  const { scene, calibration } = root.machine
  root.machine.name = data.name
  root.machine.dispose = () => {
    scene.dark.removeEventListener('change', scene.redraw)
    scene.observer.disconnect()
  }
  if (calibration?.points.length) {
    if (same && old.machine.calibration?.points.length) {
      const { when, times } = old.machine.calibration
      Object.assign(calibration, { when, times })
    } else {
      const long = calibration.fitted.map(p => Math.hypot(...p.after)).sort((a, b) => a - b)
      calibration.when = 'after' // what is left, not what was
      calibration.times = calibration.rounded(Math.min(1e6, (0.09 * data.size) / (long[Math.floor(0.9 * long.length)] || 1)))
    }
    calibration.update(false)
  }
  if (same) {
    const { turn, tilt, zoom, room, centre, radius, floor, points, fitted, tilted } = old.machine.scene
    Object.assign(scene, { turn, tilt, zoom, room, centre, radius, floor, points, fitted, tilted })
  }
  last?.machine?.dispose?.()
  if (!root.isConnected) return root.machine.dispose()
  root.machine.changed(false)
  const pointed = scene.pointed
  if (pointed) {
    scene.pointed = (x, y, pressed) => {
      pointed(x, y)
      if (pressed && calibration.named) picked?.(calibration.named.key)
    }
  }
}

// Name the residual of a row in the picture, as if it were pointed at.
export function selected(key) {
  const calibration = app.picture?.machine?.calibration
  if (!calibration) return
  calibration.named = calibration.points.find(p => p.key === key) ?? null
  calibration.redraw()
}
