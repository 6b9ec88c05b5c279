// What is drawn of a machine at its pose: bodies in the user's base frame, mm.
// {rod: [a, b], r} {ball: p, r} {face: points} {line: points} {dots: points} {text, at}; `colour` is
// the name of one of scene.js.

class Bodies {
  constructor(size) {
    this.size = size
    this.list = []
    this.thick = 0.011 * size
  }
  rod(a, b, r, colour) { this.list.push({ rod: [a, b], r: r * this.thick, colour }) }
  ball(p, r, colour) { this.list.push({ ball: p, r: r * this.thick, colour }) }
  face(points, colour) { this.list.push({ face: points, colour }) }
  line(points, colour, wide = 1, dashed = false) { this.list.push({ line: points, colour, wide, dashed }) }
  text(at, text, colour = 'ink') { this.list.push({ at, text, colour }) }

  // a joint's name; of joints in one place one text
  name(p, aside, word, entry) {
    const there = this.list.find(body => body.word === word && norm(sub(body.of, p)) < this.thick)
    if (there) there.text += `, ${entry}`
    else this.list.push({ at: add(p, aside), text: word + entry, colour: 'dim', of: p, word })
  }

  triad(p, R, length, name) {
    ;['x', 'y', 'z'].forEach((axis, k) => {
      const tip = add(p, column(R, k), length)
      this.rod(p, tip, 0.35, axis)
      this.text(add(p, column(R, k), 1.15 * length), axis, axis)
    })
    if (name) this.text(add(p, [0, 0, -0.3 * length]), name, 'dim')
  }

  // the circle that the limb's direction may not leave, and lines to it
  cone(p, axis, angle, length, colour) {
    const [one, other] = across(axis), sine = Math.sin(angle) * length, cosine = Math.cos(angle) * length
    const circle = Array.from({ length: 25 }, (_, k) => {
      const t = (k / 24) * 2 * Math.PI
      return add(add(add(p, axis, cosine), one, sine * Math.cos(t)), other, sine * Math.sin(t))
    })
    this.face(circle, colour === 'bad' ? 'badface' : 'coneface')
    this.line(circle, colour)
    for (const k of [0, 6, 12, 18]) this.line([p, circle[k]], colour)
  }
}

// The edges of the convex hull: those of a plate where all points lie in a plane, more or less, those
// of a frame where they do not. An edge is in a plane that all points are on one side of, and in that
// plane all are on one side of it.
function hullEdges(given) {
  const size = Math.max(...given.map(p => norm(sub(p, given[0]))), 1e-9), least = 0.02 * size
  const points = given.filter((p, k) => given.findIndex(other => norm(sub(p, other)) < least) === k), edges = []
  const oneSide = values => values.every(x => x > -least) || values.every(x => x < least)
  points.forEach((a, i) => points.slice(0, i).forEach(b => {
    const along = unit(sub(b, a)), others = points.filter(p => p !== a && p !== b)
    const edge = others.some(c => {
      const aside = add(sub(c, a), along, -dot(along, sub(c, a)))
      if (norm(aside) < least) return false
      const across = unit(aside), normal = cross(along, across), far = points.map(p => dot(normal, sub(p, a)))
      return oneSide(far) && oneSide(points.filter((_, k) => Math.abs(far[k]) < least).map(p => dot(across, sub(p, a))))
    })
    if (edge) edges.push([a, b])
  }))
  return edges.length ? edges : inLine(points)
}

// the two ends of points in a line
function inLine(points) {
  const from = points[0], far = points.map(p => norm(sub(p, from))), end = points[far.indexOf(Math.max(...far))]
  const along = points.map(p => dot(sub(p, from), sub(end, from))), start = points[along.indexOf(Math.min(...along))]
  return start === end ? [] : [[start, end]]
}

// points in the order in which they stand around their middle
function outline(points) {
  const middle = scaled(points.reduce((a, b) => add(a, b)), 1 / points.length)
  const apart = points.map(p => sub(p, middle)), first = unit(apart.find(v => norm(v) > 1e-6) ?? [1, 0, 0])
  const other = apart.reduce((sum, v) => { const n = cross(first, v); return add(sum, n, dot(n, sum) < 0 ? -1 : 1) }, [0, 0, 0])
  const second = cross(unit(norm(other) > 1e-9 ? other : [0, 0, 1]), first)
  const angle = v => Math.atan2(dot(v, second), dot(v, first))
  return points.map((p, k) => [angle(apart[k]), p]).sort((a, b) => a[0] - b[0]).map(([, p]) => p)
}

function drawParallel(mover, limits, show) {
  const { data, core } = mover, B = data.frames?.matrix
  const out = new Bodies(data.size), R = rotation(mover.own), p = mover.own.slice(0, 3)
  const base = [], top = []
  data.limbs.forEach((limb, i) => {
    if (data.kind === 'chains') chain(out, mover, limb, i, limits[i], show, base, top, R, p)
    else closedLimb(out, core, limb, i, limits[i], show, base, top, R, p)
  })
  const frame = (points, r, colour, face) => {
    const edges = hullEdges(points), corners = [...new Set(edges.flat())]
    if (edges.length > 2 && edges.length === corners.length) out.face(outline(corners), face) // a plate
    edges.forEach(([a, b]) => out.rod(a, b, r, colour))
  }
  frame(base, 0.9, 'base', 'baseface')
  frame(top, 0.9, 'platform', 'platformface')
  const middle = scaled(top.reduce((a, b) => add(a, b)), 1 / top.length)
  if (norm(sub(middle, p)) > 0.02 * data.size) out.rod(middle, p, 0.5, 'platform')
  out.base = base, out.top = top
  if (B) inBase(out, B)
  if (show.frames) {
    const length = 0.14 * data.size
    out.triad([0, 0, 0], [1, 0, 0, 0, 1, 0, 0, 0, 1], length, 'base')
    out.triad(mover.pose.slice(0, 3), rotation(mover.pose), length, 'tool')
  }
  return out
}

function inBase(out, B) {
  const R = [0, 1, 2, 4, 5, 6, 8, 9, 10].map(k => B[k]), p = [B[3], B[7], B[11]], to = v => placed(R, p, v)
  for (const body of out.list) {
    for (const key of ['rod', 'face', 'line']) if (body[key]) body[key] = body[key].map(to)
    for (const key of ['ball', 'at']) if (body[key]) body[key] = to(body[key])
  }
  out.base = out.base.map(to), out.top = out.top.map(to)
}

function closedLimb(out, core, limb, i, limit, show, base, top, R, p) {
  const at = i * SPHERE, number = k => Array.from(core.sphere.subarray(at + k, at + k + 3))
  const b = placed(R, p, number(0)), c = number(3)
  const bad = Object.keys(WHAT).some(name => !(limit[name] >= INSIDE)), stuck = !(limit.stroke >= INSIDE)
  base.push(limb.base), top.push(b)
  out.ball(b, 1.5, 'joint')
  if (!limb.carries) {
    out.ball(c, 1.7, 'joint')
    if (limb.kind === 'cable') out.rod(c, b, 0.25, stuck ? 'bad' : 'cable')
    else {
      const longest = limb.stroke ? limb.stroke[0] * 0.93 : 0.55 * norm(sub(b, c))
      const end = mix(c, b, Math.min(0.9, longest / norm(sub(b, c))))
      out.rod(c, end, 1.5, stuck ? 'bad' : 'tube')
      out.rod(end, b, 0.75, stuck ? 'bad' : 'rod')
    }
  } else {
    out.line(limb.track, stuck ? 'bad' : 'track', limb.carries === 'along' ? 3 : 1, limb.carries === 'about')
    if (limb.carries === 'along') {
      out.rod(limb.track[0], limb.track[1], 0.55, stuck ? 'bad' : 'rail')
      const way = unit(sub(limb.track[1], limb.track[0])), half = 2.4 * out.thick
      out.rod(add(c, way, -half), add(c, way, half), 2, stuck ? 'bad' : 'tube')
    } else {
      out.rod(add(limb.base, limb.axis, -3 * out.thick), add(limb.base, limb.axis, 3 * out.thick), 1.5, 'joint')
      out.rod(limb.base, c, 1.3, stuck ? 'bad' : 'tube')
    }
    out.ball(c, 1.5, 'joint')
    out.rod(c, b, 0.7, bad ? 'bad' : 'rod')
  }
  if (show.limits) {
    const length = 0.16 * out.size
    if (limb.base_cone) out.cone(c, limb.base_cone.axis, limb.base_cone.angle, length, limit.base >= INSIDE ? 'cone' : 'bad')
    if (limb.platform_cone) {
      const axis = scaled(turned(R, limb.platform_cone.axis), -1)
      out.cone(b, axis, limb.platform_cone.angle, length, limit.platform >= INSIDE ? 'cone' : 'bad')
    }
  }
  if (show.numbers) {
    out.text(mix(c, b, 0.5), `${i + 1}`, 'label')
    out.name(limb.base, [0, 0, -4 * out.thick], 'base', i + 1)
    out.name(b, [0, 0, 4 * out.thick], 'platform', i + 1)
  }
}

// Of spherical machines every axis goes through one point: joints stand where their points are, or,
// where that is the centre, somewhere on their axis; links are arcs around the centre.
function sphericalChain(out, frame, limb, i, limit, show, base, top, centre) {
  const count = limb.joints.length, tips = limb.joints.map((joint, k) => {
    const { R, p } = frame(joint.frame), axis = turned(R, joint.axis ?? [0, 0, 1]), way = sub(p, centre)
    return { axis, way: norm(way) > 1e-6 * out.size ? way : scaled(axis, out.size * (0.55 - (0.25 * k) / count)) }
  })
  const between = (a, b, t) => add(centre, unit(mix(unit(a), unit(b), t)), norm(a) + t * (norm(b) - norm(a)))
  for (let k = 0; k + 1 < count; k++) {
    const colour = !(limit.joints[k] >= INSIDE) ? 'bad' : 'actuator' in limb.joints[k] ? 'tube' : 'rod'
    for (let j = 0; j < 8; j++) out.rod(between(tips[k].way, tips[k + 1].way, j / 8), between(tips[k].way, tips[k + 1].way, (j + 1) / 8), 1.1, colour)
    if (show.numbers && k === 0) out.text(between(tips[0].way, tips[1].way, 0.5), `${i + 1}`, 'label')
  }
  tips.forEach(({ axis, way }, k) => {
    const colour = !(limit.joints[k] >= INSIDE) ? 'bad' : 'actuator' in limb.joints[k] ? 'platform' : 'joint', at = add(centre, way)
    out.rod(add(at, axis, -2 * out.thick), add(at, axis, 2 * out.thick), 1.8, colour)
    if (show.numbers) out.text(add(at, unit(way), 4 * out.thick), `${i + 1}.${k + 1} ${limb.joints[k].kind}`, 'dim')
  })
  base.push(add(centre, tips[0].way)), top.push(add(centre, tips[count - 1].way))
}

function chain(out, mover, limb, i, limit, show, base, top, R, p) {
  const { core } = mover
  const frame = k => ({ R: core.frames.subarray(12 * k, 12 * k + 9), p: Array.from(core.frames.subarray(12 * k + 9, 12 * k + 12)) })
  if (mover.data.map === 'spherical') return sphericalChain(out, frame, limb, i, limit, show, base, top, p)
  const points = limb.joints.map(joint => frame(joint.frame).p), end = placed(R, p, limb.end)
  const last = norm(sub(points.at(-1), end)) > 2 * out.thick ? [...points, end] : points
  base.push(limb.base), top.push(end)
  for (let k = 0; k + 1 < last.length; k++) {
    const joint = limb.joints[k], bad = joint && !(limit.joints[k] >= INSIDE)
    const moved = joint?.kind === 'P' || (joint?.kind === 'C')
    if (norm(sub(last[k], last[k + 1])) < 1e-9) continue
    if (moved) {
      const end = mix(last[k], last[k + 1], 0.6)
      out.rod(last[k], end, 1.4, bad ? 'bad' : 'tube')
      out.rod(end, last[k + 1], 0.75, bad ? 'bad' : 'rod')
    } else out.rod(last[k], last[k + 1], joint && 'actuator' in joint ? 1.3 : 0.8, bad ? 'bad' : joint && 'actuator' in joint ? 'tube' : 'rod')
  }
  limb.joints.forEach((joint, k) => {
    const at = points[k], colour = limit.joints[k] >= INSIDE ? ('actuator' in joint ? 'platform' : 'joint') : 'bad'
    if (joint.track) out.rod(joint.track[0], joint.track[1], 0.5, colour === 'bad' ? 'bad' : 'rail')
    if (joint.axis && joint.kind !== 'P') {
      const axis = turned(frame(joint.frame).R, joint.axis)
      out.rod(add(at, axis, -2.6 * out.thick), add(at, axis, 2.6 * out.thick), 1.5, colour)
    } else if (joint.kind !== 'P') out.ball(at, 1.7, colour)
    if (show.limits && joint.cone) {
      const axis = turned(frame(joint.frame).R, joint.cone.from)
      out.cone(at, axis, joint.cone.angle, 0.13 * out.size, limit.joints[k] >= INSIDE ? 'cone' : 'bad')
    }
    if (show.numbers) out.name(at, [0, 0, 3.4 * out.thick * (k ? 1 : -1)], '', `${i + 1}.${k + 1} ${joint.kind}`)
  })
  const lengths = last.slice(1).map((b, k) => norm(sub(b, last[k]))), longest = lengths.indexOf(Math.max(...lengths))
  if (show.numbers) out.text(mix(last[longest], last[longest + 1] ?? end, 0.5), `${i + 1}`, 'label')
}

function drawArm(arm, show) {
  const { data, frames } = arm, out = new Bodies(data.size)
  const at = frames.map(f => f.slice(9)), points = [[0, 0, 0], ...at]
  for (let k = 0; k + 1 < points.length; k++) if (norm(sub(points[k], points[k + 1])) > 1e-6) out.rod(points[k], points[k + 1], 1.2, 'rod')
  data.joints.forEach((joint, k) => {
    const axis = column(frames[k], 2), half = 3 * out.thick
    out.rod(add(at[k], axis, -half), add(at[k], axis, half), 2.2, joint.kind === 'P' ? 'rail' : 'tube')
    // aside, each on another side: neighbours may stand in one point
    const [one, other] = across(axis)
    if (show.numbers) out.text(add(add(at[k], one, 4.5 * out.thick), other, (k % 2 ? 4.5 : -4.5) * out.thick), joint.name ?? `joint ${k + 1}`, 'label')
  })
  out.ball(at.at(-1), 1.8, 'platform')
  out.base = [[0, 0, 0]], out.top = [at.at(-1)]
  if (show.frames) {
    out.triad([0, 0, 0], [1, 0, 0, 0, 1, 0, 0, 0, 1], 0.14 * data.size, 'base')
    out.triad(at.at(-1), frames.at(-1).slice(0, 9), 0.14 * data.size, 'tool')
  }
  return out
}
