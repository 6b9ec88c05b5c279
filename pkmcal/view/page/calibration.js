// A calibration in the picture: residuals where they were measured, and the machine as it was assumed.
const NEAR = 14 // pixels within which a point is named
const SEEN = 0.09, LARGEST = 1e6 // of the machine's size: how long the longer arrows are at first

class Calibration {
  constructor(core, data, mover, side, redraw) {
    const { points, change } = data.calibration
    Object.assign(this, { core, data, mover, points, change, when: 'before', named: null, redraw })
    this.fitted = points.filter(p => !p.aside) // others are left out or held out
    const long = this.fitted.map(p => norm(p.before)).sort((a, b) => a - b)[Math.floor(0.9 * this.fitted.length)] || 1
    this.times = this.rounded(Math.min(LARGEST, (SEEN * data.size) / long))
    this.exaggeration = 0
    if (points.length) this.arrows(side)
    if (change.places.length) this.overlay(side)
  }

  // 1, 2, 5, 10, 20 …
  rounded(x) {
    const power = 10 ** Math.floor(Math.log10(x)), left = x / power
    return power * (left < 2 ? 1 : left < 5 ? 2 : 5)
  }

  arrows(side) {
    const { points } = this, what = points.some(p => p.outlier) ? '; outliers are red' : ''
    made('h3', side, { text: 'Residuals' })
    made('p', side, { className: 'hint', text: `Measured minus predicted, at the places measured${what}. Point at one and it is named.` })
    const buttons = made('div', side, { className: 'buttons' })
    this.switches = ['before', 'after'].map(when => made('button', buttons, { type: 'button', text: when, onclick: () => { this.when = when; this.update() } }))
    const label = made('label', side, { className: 'row wide' })
    made('span', label, { text: 'scale' })
    const input = made('input', label, { type: 'range', min: 0, max: 6, step: 0.01, 'aria-label': 'how much larger than true the arrows are' })
    input.value = Math.log10(Math.max(1, this.times))
    this.shown = made('span', label)
    input.oninput = () => { this.times = this.rounded(10 ** +input.value * 1.0001); this.update() }
    this.found = made('p', side, { className: 'hint', role: 'status' })
    this.update(false)
  }

  overlay(side) {
    made('h3', side, { text: 'What was identified' })
    made('p', side, { className: 'hint', text: 'Solid: the identified machine. Orange: the machine as assumed before, at the same actuator coordinates, its difference multiplied.' })
    const label = made('label', side, { className: 'row wide' })
    made('span', label, { text: 'change' })
    const input = made('input', label, { type: 'range', min: 0, max: Math.log10(this.change.most), step: 0.01, 'aria-label': 'how much larger than true the change is' })
    input.value = Math.log10(this.change.times)
    const shown = made('span', label)
    const moved = () => {
      this.exaggeration = +input.value < 0.005 ? 1 : this.rounded(10 ** +input.value * 1.0001)
      shown.textContent = `× ${this.exaggeration}`
      this.redraw()
    }
    input.oninput = moved
    this.exaggeration = this.change.times
    shown.textContent = `× ${this.exaggeration}`
    this.lost = made('p', side, { className: 'hint' })
  }

  update(redraw = true) {
    this.switches.forEach(button => button.setAttribute('aria-pressed', button.textContent === this.when))
    this.shown.textContent = `× ${this.times}`
    const off = this.fitted.map(p => norm(p[this.when])), rms = Math.sqrt(off.reduce((sum, x) => sum + x * x, 0) / off.length)
    this.found.textContent = `${off.length} points: ${short(rms)} mm rms, longest ${short(Math.max(...off))} mm`
    if (redraw) this.redraw()
  }

  // what is drawn with the machine
  add(bodies) {
    for (const p of this.points) bodies.list.push({ arrow: [p.at, add(p.at, p[this.when], this.times)], colour: p.outlier ? 'bad' : p.aside ? 'dim' : this.when })
    if (this.points.length) {
      const one = this.rounded((0.12 * this.data.size) / this.times)
      this.key = { long: one * this.times, text: `${Number(one.toPrecision(3))} mm` }
    }
    if (this.exaggeration) this.ghost(bodies)
    if (this.named) bodies.text(this.named.at, this.wordsOf(this.named), this.named.outlier ? 'bad' : 'label')
  }

  wordsOf(point) {
    return `${point.name}: ${short(norm(point.before))} → ${short(norm(point.after))} mm${point.outlier ? ', outlier' : ''}${point.aside ? `, ${point.aside}` : ''}`
  }

  // the machine with its change the other way, so many times
  ghost(bodies) {
    const { core, data, mover, change } = this, numbers = core.numbers
    change.places.forEach((k, j) => { numbers[k] = change.after[j] + this.exaggeration * (change.before[j] - change.after[j]) })
    const other = { core, data, q: mover.q }
    if (data.kind === 'arm') {
      core.wasm.begin(core.bytes)
      core.q.set(mover.q)
      core.wasm.forward()
      other.frames = rowsOf(core.frames, data.actuators.length + 1, 12)
    } else {
      core.q.set(mover.q), core.pose.set(mover.own)
      const status = core.wasm.forward()
      this.lost.textContent = status ? `× ${this.exaggeration}: as assumed, the machine has no pose at these actuator coordinates` : ''
      if (status) return
      other.own = Array.from(core.found.subarray(0, 6))
      other.pose = other.own
    }
    const nothing = { numbers: false, frames: false, limits: false }
    const drawn = data.kind === 'arm' ? drawArm(other, nothing) : drawParallel(other, limitsOf(other), nothing)
    this.assumed = other.own
    for (const { rod } of drawn.list) if (rod) bodies.list.push({ line: rod, colour: 'ghost', wide: 1.8, over: true })
  }

  // the point next to a place on the canvas
  point(x, y, scene) {
    let best = null, least = NEAR
    for (const p of this.points) {
      const [a, b] = scene.seen(scene.eye, p.at), off = Math.hypot(a - x, b - y)
      if (off < least) best = p, least = off
    }
    if (best === this.named) return
    this.named = best
    this.redraw()
  }
}

const short = x => (x >= 1000 || x < 1e-3 ? x.toExponential(2) : Number(x.toPrecision(3)).toString())
