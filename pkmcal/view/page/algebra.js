// Vectors of three, rotations row by row, and least squares of small matrices.
const DEGREE = Math.PI / 180
const dot = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0)
const add = (a, b, t = 1) => a.map((x, k) => x + t * b[k])
const sub = (a, b) => add(a, b, -1)
const scaled = (a, t) => a.map(x => x * t)
const mix = (a, b, t) => a.map((x, k) => x + t * (b[k] - x))
const norm = a => Math.hypot(...a)
const unit = a => scaled(a, 1 / (norm(a) || 1))
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
const angleBetween = (a, b) => Math.atan2(norm(cross(a, b)), dot(a, b))
const wrapped = x => x - 2 * Math.PI * Math.round(x / (2 * Math.PI))
const finite = a => a.every(Number.isFinite)

// Rz(γ) Ry(β) Rx(α); for drawing: what is computed comes from the core
function rotation([, , , a, b, g]) {
  const [sa, ca, sb, cb, sg, cg] = [a, b, g].flatMap(t => [Math.sin(t), Math.cos(t)])
  return [cb * cg, sa * sb * cg - ca * sg, ca * sb * cg + sa * sg,
    cb * sg, sa * sb * sg + ca * cg, ca * sb * sg - sa * cg, -sb, sa * cb, ca * cb]
}
const turned = (R, v) => [0, 3, 6].map(k => R[k] * v[0] + R[k + 1] * v[1] + R[k + 2] * v[2])
const column = (R, k) => [R[k], R[3 + k], R[6 + k]]
const placed = (R, p, v) => add(turned(R, v), p)

// two unit vectors at right angles to one, and to each other
function across(direction) {
  const least = Math.abs(direction[0]) < 0.6 ? [1, 0, 0] : [0, 1, 0]
  const one = unit(cross(direction, least))
  return [one, cross(direction, one)]
}

const rowsOf = (flat, count, width) => Array.from({ length: count }, (_, k) => Array.from(flat.subarray(k * width, (k + 1) * width)))
const columnsOf = rows => rows[0].map((_, k) => rows.map(row => row[k]))

// Singular values by one-sided Jacobi: the columns U (each σ times a unit vector), σ, and V.
function singular(rows) {
  const U = columnsOf(rows), n = U.length
  const V = U.map((_, k) => U.map((_, j) => (j === k ? 1 : 0)))
  for (let sweep = 0, turning = true; turning && sweep < 60; sweep++) {
    turning = false
    for (let p = 0; p < n; p++)
      for (let q = p + 1; q < n; q++) {
        const a = dot(U[p], U[p]), b = dot(U[q], U[q]), c = dot(U[p], U[q])
        if (Math.abs(c) <= 1e-16 * Math.sqrt(a * b) || c === 0) continue
        turning = true
        const z = (b - a) / (2 * c), t = (z < 0 ? -1 : 1) / (Math.abs(z) + Math.hypot(1, z))
        const cos = 1 / Math.hypot(1, t), sin = cos * t
        for (const W of [U, V]) {
          const one = W[p], other = W[q]
          W[p] = one.map((x, k) => cos * x - sin * other[k])
          W[q] = one.map((x, k) => sin * x + cos * other[k])
        }
      }
  }
  return { U, sigma: U.map(norm), V }
}

// the shortest x with |rows x - right| least
function leastSquares(rows, right) {
  const { U, sigma, V } = singular(rows), least = 1e-13 * Math.max(...sigma)
  let x = V[0].map(() => 0)
  sigma.forEach((s, k) => { if (s > least) x = add(x, V[k], dot(U[k], right) / (s * s)) })
  return x
}

// rows without what some columns span: passive joints that chains share
function withoutColumns(rows, columns) {
  const basis = []
  for (const given of columns) {
    let left = given
    for (const e of basis) left = add(left, e, -dot(e, left))
    basis.push(unit(left))
  }
  const parts = columnsOf(rows).map(c => basis.reduce((left, e) => add(left, e, -dot(e, left)), c))
  return columnsOf(parts)
}
