// A serial arm: its joints, and where they take the tool. Joints that follow others move by `shares` of the actuators.
class Arm {
  constructor(core, data) {
    Object.assign(this, { core, data, n: data.actuators.length, mode: 0, stopped: '' })
    this.home()
  }

  home() { this.arrived([...this.data.start]) }

  arrived(q, stopped = '') {
    this.q = q
    this.pose = this.forward(q)
    this.tool = Array.from(this.core.tool.subarray(0, 16))
    this.frames = rowsOf(this.core.frames, this.data.joints.length + 1, 12)
    this.own = this.pose
    this.stopped = stopped
  }

  forward(q) {
    const { shares } = this.data
    this.core.q.set(shares ? shares.map(row => dot(row, q)) : q)
    this.core.wasm.forward()
    return Array.from(this.core.pose.subarray(0, 6))
  }

  // the tool's twist by the joints: rotation as its arc, then velocity, both in base axes
  jacobian() {
    const { length, moved, joints, shares } = this.data, byJoints = rowsOf(this.core.jacobian, 6, joints.length)
    const rows = shares ? byJoints.map(row => columnsOf(shares).map(own => dot(row, own))) : byJoints
    const turns = rows.slice(0, 3).map(row => scaled(row, length))
    return moved.length === 6 ? [...turns, ...rows.slice(3)] : rows.slice(3)
  }

  conditioning() {
    this.forward(this.q)
    const travel = this.data.actuators.map(a => (a.unit === 'rad' ? this.data.length : 1))
    const rows = this.jacobian().map(row => row.map((x, k) => x / travel[k]))
    const count = Math.min(rows.length, this.n), sigma = singular(rows).sigma.sort((a, b) => b - a)
    return sigma[count - 1] / sigma[0]
  }

  movePose(k, value) {
    const target = [...this.pose]
    target[this.data.moved[k]] = value
    const q = this.inverse(target)
    if (q) this.arrived(q)
    else {
      this.arrived(this.q, 'the arm does not get there')
    }
  }

  // Damped least squares; what it finds is what forward() says to 1e-10 of the arm's size.
  inverse(target) {
    const { length, size } = this.data, goal = rotation(target)
    let q = [...this.q], damping = 1e-3, off = this.missing(q, goal, target)
    for (let k = 0; k < 200; k++) {
      if (norm(off) <= 1e-11 * size) return q
      const rows = this.jacobian(), n = q.length
      const damped = [...rows, ...q.map((_, j) => q.map((_, i) => (i === j ? Math.sqrt(damping) * length : 0)))]
      const step = leastSquares(damped, [...off, ...q.map(() => 0)]).slice(0, n)
      const trial = add(q, step), left = this.missing(trial, goal, target)
      if (norm(left) < norm(off)) q = trial, off = left, damping = Math.max(damping / 10, 1e-16)
      else damping *= 5, this.forward(q)
      if (damping > 1e9) return null
    }
    return null
  }

  missing(q, goal, target) {
    const at = this.forward(q), p = sub(target.slice(0, 3), at.slice(0, 3))
    if (this.data.moved.length < 6) return p
    const tool = this.core.tool, now = [0, 1, 2, 4, 5, 6, 8, 9, 10].map(k => tool[k])
    // the sum of the three axes' cross products is 2 sin(angle) times the axis; beyond a quarter turn its length is that of the angle
    const turn = [0, 1, 2].reduce((sum, k) => add(sum, cross(column(now, k), column(goal, k)), 0.5), [0, 0, 0])
    const cosine = ([0, 1, 2].reduce((sum, k) => sum + dot(column(now, k), column(goal, k)), 0) - 1) / 2
    const sine = norm(turn), angle = Math.atan2(sine, cosine)
    return [...scaled(turn, (sine > 1e-12 ? angle / sine : 1) * this.data.length), ...p]
  }

  visit(pose, q) { this.arrived(q) }

  moveActuator(a, value) {
    const q = [...this.q]
    q[a] = value
    this.arrived(q)
  }
}
