// A parallel machine: its pose, its actuators, and how either follows the other.
// Poses are x y z [mm] α β γ [rad] in the user's frames; `own` is the same in the machine's own.
const STATUS = ['', 'beyond it no pose was found', 'a singularity is in the way', 'a limb has no length', 'no numbers',
  'the limbs do not meet']
const SETTLED = 1e-12, KEPT = 1e-9, ON_THE_MANIFOLD = 1e-10, ITERATIONS = 30
const FOLDED = 0.02 // of the size, or rad: limbs with errors miss each other by much less
const PARTS = 12 // of a way on which poses are completed one after the other

class Mover {
  constructor(core, data) {
    Object.assign(this, { core, data, m: data.free.length, n: (data.laws ?? data.actuators).length, mode: 0, stopped: '' })
    this.fixed = [0, 1, 2, 3, 4, 5].filter(k => !data.free.includes(k))
    this.home()
  }

  home() {
    const own = this.inward(this.data.home)
    this.arrived(own, this.inverse(own))
    const found = this.complete(this.data.home) // of a calibrated machine the other coordinates follow
    if (found) this.arrived(found.own, found.q)
    this.homeQ = this.q
    this.mode = 0
  }

  arrived(own, q, stopped = '') {
    Object.assign(this, { own, q, pose: this.outward(own), stopped, mode: -1 })
  }

  // frames ---------------------------------------------------------------------------------------
  inward(pose) {
    const f = this.data.frames
    return f ? this.core.compose(this.core.compose(f.base_inverse, pose), f.tool_inverse) : [...pose]
  }

  outward(own) {
    const f = this.data.frames
    return f ? this.core.compose(this.core.compose(f.base, own), f.tool) : [...own]
  }

  // kinematics of the core -----------------------------------------------------------------------
  inverse(own) { return readingsOf(this.data, this.ways(own)) }

  // of the drives
  ways(own) {
    this.core.pose.set(own)
    this.core.wasm.inverse()
    const ways = Array.from(this.core.q.subarray(0, this.n))
    return this.data.kind === 'chains' ? this.nearestTurns(ways) : ways
  }

  nearestTurns(ways) {
    const { turns, near } = this.data, even = 6755399441055744
    return ways.map((x, a) => (turns[a] === null ? x : x - turns[a] * ((x - near[a]) / turns[a] + even - even)))
  }

  forward(q, guess) { return this.solved(waysOf(this.data, q), guess) }

  solved(ways, guess) {
    this.core.q.set(ways), this.core.pose.set(guess)
    const status = this.core.wasm.forward()
    return { status, own: Array.from(this.core.found.subarray(0, 6)) }
  }

  closure(own, ways) {
    const { core, m, n } = this, { rows, shared } = this.data, wide = m + shared
    core.pose.set(own), core.q.set(ways)
    core.wasm.closure()
    let step = rowsOf(core.byStep, rows, wide)
    let all = rowsOf(core.byFree, rows, m)
    const byQ = rowsOf(core.byQ, rows, n)
    all = all.map((row, r) => [...row, ...byQ[r], core.phi[r]])
    if (shared) {
      const columns = columnsOf(step).slice(m)
      all = withoutColumns(all, columns)
      step = withoutColumns(step.map(row => row.slice(0, m)), columns)
    }
    return {
      byStep: step, by: all.map(row => row.slice(0, m + n)), phi: all.map(row => row[m + n]),
      onMap: Array.from(core.onMap.subarray(0, 6)), poseByFree: rowsOf(core.poseByFree, 6, m),
    }
  }

  // σ_min/σ_max of the closures by a twist: 0 is a singularity
  conditioning() {
    const { byStep } = this.closure(this.own, waysOf(this.data, this.q))
    if (!byStep.every(finite)) return NaN
    const sigma = singular(byStep).sigma
    return Math.min(...sigma) / Math.max(...sigma)
  }

  // poses from some of their coordinates: pkmcal/kinematics/complete.py --------------------------
  off(pose, wanted) {
    return this.data.moved.map((k, j) => (k < 3 ? pose[k] - wanted[j] : wrapped(pose[k] - wanted[j])))
  }

  seen(own, wanted) {
    const pose = this.outward(own)
    const other = [...pose.slice(0, 3), wrapped(pose[3] + Math.PI), wrapped(Math.PI - pose[4]), wrapped(pose[5] + Math.PI)]
    const far = p => this.off(p, wanted).reduce((sum, x, j) => sum + (this.data.moved[j] < 3 ? 0 : Math.abs(x)), 0)
    return far(other) < far(pose) ? other : pose
  }

  // matched coordinates by the free ones
  kept(closure, own, seen, wanted) {
    const { moved, free, frames } = this.data
    const by = closure.poseByFree.map((row, k) => (free.includes(k) ? row.map((_, j) => (free[j] === k ? 1 : 0)) : row))
    if (!frames) return moved.map(k => by[k])
    const h = 1e-5, base = this.seen(own, wanted)
    const columns = free.map((k, j) => {
      const t = k < 3 ? h * this.data.size : h
      const there = this.seen(own.map((x, i) => x + t * by[i][j]), wanted)
      return moved.map(i => (i < 3 ? there[i] - base[i] : wrapped(there[i] - base[i])) / t)
    })
    return columnsOf(columns)
  }

  // q of a pose that the machine can take as it is, or null
  takes(own) {
    const ways = this.ways(own), q = readingsOf(this.data, ways)
    if (!finite(q)) return null
    const { phi, onMap } = this.closure(own, ways), least = ON_THE_MANIFOLD * this.data.size
    const away = this.data.map === 'spatial' ? 0 : Math.max(...this.fixed.map(k => Math.abs(own[k] - onMap[k])), 0)
    return Math.max(...phi.map(Math.abs)) <= least && away <= KEPT ? q : null
  }

  complete(pose) {
    const { moved, size, map } = this.data, wanted = moved.map(k => pose[k])
    let own = this.inward(pose), q = this.takes(own)
    if (q) return { own, q }
    if (map !== 'spatial') this.toMap(own, wanted)
    let ways = this.ways(own), done = false
    for (let k = 0; k < ITERATIONS && finite(ways) && !done; k++) {
      const closure = this.closure(own, ways)
      for (const i of this.fixed) own[i] = closure.onMap[i]
      const seen = this.seen(own, wanted)
      const left = [...closure.by, ...this.kept(closure, own, seen, wanted).map(row => [...row, ...ways.map(() => 0)])]
      const right = [...closure.phi, ...this.off(seen, wanted)]
      if (!left.every(finite) || !finite(right)) return null
      const step = leastSquares(left, right)
      this.data.free.forEach((i, j) => { own[i] -= step[j] })
      ways = add(ways, step.slice(this.m), -1)
      done = Math.max(...step.map(Math.abs)) <= SETTLED * size
    }
    if (!done) return null
    const found = this.solved(this.data.kind === 'chains' ? this.nearestTurns(ways) : ways, own)
    if (found.status) return null
    const off = this.off(this.seen(found.own, wanted), wanted)
    if (off.some((x, j) => Math.abs(x) > KEPT * (moved[j] < 3 ? size : 1))) return null
    q = this.inverse(found.own)
    return finite(q) ? { own: found.own, q } : null
  }

  // onto what the map moves, where the frames make that something else than zeros
  toMap(own, wanted) {
    const none = Array(this.n).fill(0)
    for (let k = 0; k < ITERATIONS; k++) {
      const closure = this.closure(own, none)
      for (const i of this.fixed) own[i] = closure.onMap[i]
      const seen = this.seen(own, wanted), off = this.off(seen, wanted)
      if (!(Math.max(...off.map(Math.abs)) > SETTLED * this.data.size)) return
      const step = leastSquares(this.kept(closure, own, seen, wanted), off)
      this.data.free.forEach((i, j) => { own[i] -= step[j] })
    }
  }

  // actuators that lead to this pose otherwise than the inverse kinematics does, counted from 1
  pastDeadPoint() {
    const { size, actuators } = this.data, q = this.inverse(this.own)
    const far = q.map((x, a) => (actuators[a].unit === 'rad' ? Math.abs(wrapped(x - this.q[a])) : Math.abs(x - this.q[a]) / size))
    return far.flatMap((x, a) => (x > FOLDED ? [a + 1] : []))
  }

  // what the sliders ask for ---------------------------------------------------------------------
  movePose(k, value) {
    const target = [...this.pose]
    target[this.data.moved[k]] = value
    this.moveTo(target)
  }

  moveTo(target) {
    const found = this.complete(target) ?? this.alongTo(target)
    if (found) this.arrived(found.own, found.q)
    else this.stopped = `the machine does not get there: ${this.unreached(target)}`
  }

  alongTo(target) {
    const start = this.pose
    let found = null
    for (let part = 1; part <= PARTS; part++) {
      const pose = mix(found ? this.outward(found.own) : start, start, 0)
      for (const k of this.data.moved) pose[k] = start[k] + (part / PARTS) * (target[k] - start[k])
      found = this.complete(pose)
      if (!found) return null
    }
    return found
  }

  unreached(target) {
    if (this.data.kind === 'chains') return 'a chain does not reach'
    this.core.pose.set(this.inward(target)), this.core.q.set(waysOf(this.data, this.q))
    this.core.wasm.places()
    const missing = this.data.limbs.flatMap((_, i) => (Number.isFinite(this.core.drive[i]) ? [] : [i + 1]))
    return missing.length ? `${counted('limb', missing)} ${missing.length > 1 ? 'do' : 'does'} not reach` : 'its limbs do not allow it'
  }

  moveActuator(a, value) {
    const begin = this.q, end = [...begin]
    end[a] = value
    const longest = this.data.actuators[a].unit === 'rad' ? 0.05 : 0.02 * this.data.size
    const count = Math.min(80, Math.max(1, Math.ceil(Math.abs(value - begin[a]) / longest)))
    let { own } = this, q = begin
    for (let part = 1; part <= count; part++) {
      const next = part === count ? end : mix(begin, end, part / count), found = this.forward(next, own)
      if (found.status) return this.arrived(own, q, `actuator ${a + 1} stops here: ${STATUS[found.status]}`)
      own = found.own, q = next
    }
    this.arrived(own, q)
  }

  // a pose, with coordinates that lead to it where they are known
  visit(pose, q) {
    if (q) this.arrived(this.inward(pose), q)
    else this.moveTo(pose)
  }

  // the k-th pose with the actuators as at home
  takeMode(k) {
    const pose = this.data.modes.poses[k]
    if (!pose) return
    this.arrived(this.inward(pose), this.homeQ)
    this.mode = k
  }
}
