// The words and sliders beside the picture.
const NAMES = ['x', 'y', 'z', 'α', 'β', 'γ'], ABOUT = ['along x', 'along y', 'along z', 'about x', 'about y', 'about z']
const LEGEND = {
  limbs: 'Grey: the base and the limbs; blue-green: the platform. base1 and platform1 are the joints at the ends of limb 1.',
  chains: 'Grey: the base and the limbs; blue-green: the platform and the joints that are driven. 2.3 U is joint 3 of limb 2; R turns, P slides, U is universal, S spherical, C cylindrical.',
  arm: 'Blue-green: the tool.',
}
const DIGITS = 3
const fixed = x => (Math.round(x * 10 ** DIGITS) / 10 ** DIGITS || 0).toFixed(DIGITS) // no -0

function made(tag, parent, settings = {}, ...children) {
  const element = document.createElement(tag)
  const { className, text, ...others } = settings
  if (className) element.className = className
  if (text !== undefined) element.textContent = text
  for (const [name, value] of Object.entries(others)) name.startsWith('on') ? (element[name] = value) : element.setAttribute(name, value)
  element.append(...children)
  parent?.append(element)
  return element
}

// A slider with a number beside it, in mm, degrees or counts of a motor; `allowed` is drawn under it.
function slider(parent, { name, title, unit, range, allowed, disabled, moved }) {
  const by = unit === 'rad' ? 1 / DEGREE : 1, shown = range.map(x => x * by)
  const label = made('label', parent, { className: 'row', title })
  made('span', label, { text: name })
  const settings = { min: shown[0], max: shown[1], step: 'any', 'aria-label': title }
  const track = made('span', label, { className: 'track' })
  const input = made('input', track, { type: 'range', ...settings })
  const number = made('input', label, { type: 'number', step: unit === 'rad' ? 1 : 5, 'aria-label': title })
  made('span', label, { className: 'unit', text: unit === 'rad' ? '°' : unit })
  if (allowed) {
    const [low, high] = allowed.map(x => (100 * (x * by - shown[0])) / (shown[1] - shown[0]))
    const shaded = made('i', track)
    shaded.style.left = `${low}%`
    shaded.style.width = `${high - low}%`
  }
  input.disabled = number.disabled = Boolean(disabled)
  input.oninput = () => moved(+input.value / by)
  number.onchange = () => { if (number.value !== '' && Number.isFinite(+number.value)) moved(+number.value / by) }
  return value => {
    input.value = value * by
    if (document.activeElement !== number) number.value = fixed(value * by)
  }
}

class Panel {
  constructor(side, mover, changed, show) {
    const { data } = mover
    Object.assign(this, { mover, changed })
    made('h2', side, { text: data.name })
    made('p', side, { text: data.what, className: 'what' })
    this.state = made('p', side, { className: 'state', role: 'status' })
    this.meter = made('div', side, { className: 'meter', title: 'σmin/σmax of the closures: 0 is a singularity, where the machine cannot hold or cannot move' })
    this.bar = made('i', made('span', this.meter))
    this.condition = made('p', side, { className: 'hint' })
    this.platform(side, data)
    this.actuators(side, data)
    if (data.stiffness) showStiffness(side, data.stiffness)
    const buttons = made('div', side, { className: 'buttons' })
    made('button', buttons, { type: 'button', text: 'Home', onclick: () => { mover.home(); changed(true) } })
    if (data.places) this.places(side, data.places)
    if (data.modes?.poses.length > 1) this.modes(side, data)
    this.toggles(side, show)
    made('p', side, { className: 'hint', text: LEGEND[data.kind] })
    made('p', side, { className: 'hint', text: 'Drag the picture to turn it; the wheel or two fingers zoom.' })
  }

  platform(side, { kind, moved, poses, reach }) {
    made('h3', side, { text: kind === 'arm' ? 'Move the tool' : 'Move the platform' })
    made('p', side, { className: 'hint', text: kind === 'arm' ? 'The joints follow.' : 'The actuators follow; shaded: as far as it goes from home.' })
    this.poses = moved.map((k, j) => slider(side, {
      name: NAMES[k], title: `${kind === 'arm' ? 'tool' : 'platform'} ${ABOUT[k]}`, unit: k < 3 ? 'mm' : 'rad', range: poses[j], allowed: kind === 'arm' ? null : reach[j],
      moved: value => { this.mover.movePose(j, value); this.changed() },
    }))
    this.others = [0, 1, 2, 3, 4, 5].filter(k => !moved.includes(k))
    if (this.others.length) this.follows = made('p', side, { className: 'follows' })
  }

  actuators(side, { kind, actuators, joints, moved }) {
    const arm = kind === 'arm', surplus = !arm && actuators.length > moved.length, stated = actuators.some(({ stroke }) => stroke)
    const slides = arm && joints.some(joint => joint.kind === 'P')
    made('h3', side, { text: arm ? (slides ? 'Move the joints' : 'Turn the joints') : surplus ? 'Actuators' : 'Move the actuators' })
    const what = arm ? 'The tool follows' : surplus ? 'There are more of them than ways to move: none moves alone, all follow' : 'The platform follows'
    made('p', side, { className: 'hint', text: `${what}${stated ? `; shaded: ${arm ? 'within its limits' : 'the stroke'}` : ''}.` })
    this.q = actuators.map(({ name, unit, reading, range, stroke }, a) => slider(side, {
      name: `q${a + 1}`, title: name ?? `actuator ${a + 1}`, unit: reading ?? unit, range, allowed: stroke, disabled: surplus,
      moved: value => { this.mover.moveActuator(a, value); this.changed() },
    }))
  }

  modes(side, { modes }) {
    made('h3', side, { text: 'Assembly modes' })
    const known = modes.complete ? 'That there are no others is proven.' : 'There may be others.'
    made('p', side, { className: 'hint', text: `With the actuators as at home the limbs fit together in ${modes.poses.length} ways. ${known}` })
    const buttons = made('div', side, { className: 'buttons' })
    const step = by => () => {
      const count = modes.poses.length, now = this.mover.mode
      this.mover.takeMode(now < 0 ? 0 : (now + by + count) % count)
      this.changed()
    }
    made('button', buttons, { type: 'button', text: '‹', title: 'previous assembly mode', onclick: step(-1) })
    this.mode = made('span', buttons)
    made('button', buttons, { type: 'button', text: '›', title: 'next assembly mode', onclick: step(1) })
  }

  // poses to visit one by one: measured ones, or planned ones
  places(side, { name, poses, q }) {
    made('h3', side, { text: name[0].toUpperCase() + name.slice(1) })
    const buttons = made('div', side, { className: 'buttons' })
    let now = -1
    const step = by => () => {
      now = now < 0 ? (by > 0 ? 0 : poses.length - 1) : (now + by + poses.length) % poses.length
      this.mover.visit(poses[now], q?.[now])
      shown.textContent = `${now + 1} of ${poses.length}`
      this.changed()
    }
    made('button', buttons, { type: 'button', text: '‹', title: 'go to the pose before', onclick: step(-1) })
    const shown = made('span', buttons, { text: `${poses.length}` })
    made('button', buttons, { type: 'button', text: '›', title: 'go to the next pose', onclick: step(1) })
  }

  toggles(side, show) {
    const box = made('div', side, { className: 'toggles' })
    for (const [name, text] of Object.entries(show.names)) {
      const label = made('label', box)
      made('input', label, { type: 'checkbox', onchange: e => { show[name] = e.target.checked; this.changed() } }).checked = show[name]
      label.append(text)
    }
  }

  update(limits) {
    const { mover } = this, { data } = mover
    data.moved.forEach((k, j) => this.poses[j](mover.pose[k]))
    mover.q.forEach((x, a) => this.q[a](x))
    if (this.follows) {
      const unit = k => (k < 3 ? ' mm' : '°'), value = k => (k < 3 ? mover.pose[k] : mover.pose[k] / DEGREE)
      this.follows.textContent = 'These follow: ' + this.others.map(k => `${NAMES[k]} ${fixed(value(k))}${unit(k)}`).join(', ')
    }
    const found = limits ? broken(limits) : [], conditioning = mover.conditioning()
    const near = data.conditioning ? conditioning / data.conditioning : conditioning / 0.3
    const singular = !(near > 0.1)
    const over = limits ? mover.pastDeadPoint() : []
    if (over.length) found.push(`${counted('actuator', over)}: the limb has passed a dead point (another working mode)`)
    const stated = !limits && data.actuators.some(({ stroke }) => stroke)
    const beyond = limits ? [] : data.actuators.flatMap(({ stroke }, a) => (stroke && !(Math.min(mover.q[a] - stroke[0], stroke[1] - mover.q[a]) >= INSIDE) ? [a + 1] : []))
    if (beyond.length) found.push(`${counted('joint', beyond)}: limits exceeded`)
    const good = !limits ? (stated ? 'within all limits' : 'in reach') : hasLimits(data) ? 'within all limits' : 'in reach; no limits are stated'
    this.state.textContent = mover.stopped || found.join('; ') || (singular ? 'near a singularity' : good)
    this.state.classList.toggle('bad', Boolean(mover.stopped || found.length || singular))
    this.bar.style.width = `${Math.max(1.5, Math.min(100, 60 * near)) || 1.5}%`
    this.meter.classList.toggle('bad', singular)
    const said = x => (Number.isFinite(x) ? x.toPrecision(3) : '–')
    this.condition.textContent = `conditioning ${said(conditioning)} (${data.conditioning ? `home ${said(data.conditioning)}, ` : ''}singular at 0)`
    if (this.mode) this.mode.textContent = mover.mode < 0 ? `– of ${data.modes.poses.length}` : `${mover.mode + 1} of ${data.modes.poses.length}`
  }
}
