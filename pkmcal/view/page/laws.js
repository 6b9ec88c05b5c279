// Laws of drives (docs/drive-laws.md): how far each drive goes at the readings of the actuators, and
// the readings at which drives have gone so far. Without laws both are the same numbers.
function waysOf({ laws }, q) {
  return laws ? laws.map(law => wayAt(law, q[law.actuator])) : q
}

function readingsOf({ laws, actuators }, ways) {
  if (!laws) return ways
  const each = laws.map((law, d) => readingAt(law, ways[d]))
  return actuators.map((_, a) => {
    const own = each.filter((_, d) => laws[d].actuator === a)
    return own.reduce((sum, x) => sum + x, 0) / own.length
  })
}

function wayAt(law, q) {
  const w = law.gain * q + law.quadratic * q * q
  return law.offset + law.spool * w + law.buildup * 0.25 * w * w + correctionAt(law, q)
}

function correctionAt({ harmonics, table }, q) {
  const waves = harmonics.reduce((sum, [k, a, b]) => sum + a * Math.cos(k * q) + b * Math.sin(k * q), 0)
  if (!table) return waves
  const x = Math.min(Math.max(q, table[0][0]), table.at(-1)[0]) // beyond its ends it stays
  const k = Math.max(1, table.findIndex(([at]) => at >= x)), [[a, low], [b, high]] = [table[k - 1], table[k]]
  return waves + low + ((x - a) / (b - a)) * (high - low)
}

// in closed form; with corrections between the readings that their largest sum leaves
function readingAt(law, way) {
  const { harmonics, table } = law, rest = way - law.offset
  const most = harmonics.reduce((sum, [, a, b]) => sum + Math.abs(a) + Math.abs(b), 0) + Math.max(0, ...(table ?? []).map(([, c]) => Math.abs(c)))
  if (!most) return plainReading(law, rest)
  let [low, high] = [plainReading(law, rest - most), plainReading(law, rest + most)]
  for (let k = 0; k < 100 && Number.isFinite(low + high); k++) {
    const middle = (low + high) / 2
    if (wayAt(law, middle) < way) low = middle
    else high = middle
  }
  return (low + high) / 2
}

function plainReading({ gain, quadratic, spool, buildup }, t) {
  const w = (2 * t) / ((1 + Math.sqrt(1 + (t * buildup) / (spool * spool))) * spool)
  return (2 * w) / (gain * (1 + Math.sqrt(1 + (4 * quadratic * w) / (gain * gain))))
}
