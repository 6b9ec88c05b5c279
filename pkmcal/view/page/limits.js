// Strokes and joint cones of a parallel machine at its pose, limb by limb: how far inside each is
// (below 0: broken), as pkmcal/kinematics/limits.py and chain_limits.py.
const INSIDE = -1e-12

function limitsOf(mover) {
  const { core, data } = mover
  core.pose.set(mover.own), core.q.set(waysOf(data, mover.q))
  core.wasm.places()
  return data.kind === 'chains' ? chainLimits(mover) : limbLimits(mover)
}

function limbLimits({ core, data }) {
  return data.limbs.map((limb, i) => {
    const drive = core.drive[i], at = 3 * i
    const cone = (c, v) => (c ? c.angle - angleBetween(c.axis, Array.from(v.subarray(at, at + 3))) : Infinity)
    return {
      drive,
      stroke: limb.stroke ? Math.min(drive - limb.stroke[0], limb.stroke[1] - drive) : Infinity,
      base: cone(limb.base_cone, core.onBase),
      platform: cone(limb.platform_cone, core.onPlatform),
    }
  })
}

function chainLimits({ core, data, own, q }) {
  const R = rotation(own), frame = k => core.frames.subarray(12 * k, 12 * k + 9)
  const drive = waysOf(data, q).map((x, a) => data.drive.gain[a] * x + data.drive.offset[a])
  return data.limbs.map(limb => {
    const found = { stroke: Infinity, base: Infinity, platform: Infinity, joints: [] }
    limb.joints.forEach((joint, k) => {
      let worst = Infinity
      if (joint.stroke) {
        const value = 'actuator' in joint ? drive[joint.actuator] : core.passive[joint.passive]
        worst = Math.min(value - joint.stroke[0], joint.stroke[1] - value)
        found.stroke = Math.min(found.stroke, worst)
      }
      if (joint.cone) {
        const { angle, after, from, to } = joint.cone
        const margin = angle - angleBetween(turned(frame(joint.frame), from), turned(after === null ? R : frame(after), to))
        const where = k === limb.joints.length - 1 ? 'platform' : 'base'
        found[where] = Math.min(found[where], margin)
        worst = Math.min(worst, margin)
      }
      found.joints.push(worst)
    })
    return found
  })
}

const WHAT = { stroke: 'stroke', base: 'cone of the base joint', platform: 'cone of the platform joint' }

// in words, one for each kind of limit that is broken
function broken(limits) {
  return Object.keys(WHAT).flatMap(name => {
    const over = limits.flatMap((limit, i) => (limit[name] >= INSIDE ? [] : [i + 1]))
    return over.length ? [`${counted('limb', over)}: ${WHAT[name]} exceeded`] : []
  })
}

const counted = (what, numbers) => `${what}${numbers.length > 1 ? 's' : ''} ${numbers.join(', ')}`

const hasCones = ({ limbs = [] }) => limbs.some(limb => limb.base_cone || limb.platform_cone || limb.joints?.some(joint => joint.cone))
const hasLimits = data => hasCones(data) || data.limbs.some(limb => limb.stroke || limb.joints?.some(joint => joint.stroke))
