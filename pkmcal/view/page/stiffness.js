// How stiff a machine is: only in pages of those that yield.
const SCALE = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]] // dark is little

// the least and the largest of numbers, of which some may be null
function spread(values) {
  const known = values.filter(x => x !== null)
  return known.length ? [Math.min(...known), Math.max(...known)] : null
}

// a colour for each number, from the least to the largest; the one for what is bad where there is none
function tinted(values, bad) {
  const [low, high] = spread(values) ?? [0, 0]
  return values.map(x => {
    if (x === null) return bad
    const at = ((SCALE.length - 1) * (x - low)) / (high - low || 1), k = Math.min(SCALE.length - 2, Math.floor(at))
    return `rgb(${mix(SCALE[k], SCALE[k + 1], at - k).map(Math.round)})`
  })
}

// N/mm at home and over the workspace, and the colours that the workspace has by it
function showStiffness(side, { rows, cloud }) {
  made('h3', side, { text: 'Stiffness' })
  made('p', side, { className: 'hint', text: 'N/mm, of a force at the tool: at home, and the least and the median over the workspace.' })
  const table = made('table', side, { className: 'stiff' }), said = x => (x === null ? '–' : `${x}`)
  const line = (cells, tag) => made('tr', table, {}, ...cells.map(text => made(tag, null, { text })))
  line(['', 'home', 'least', 'median'], 'th')
  for (const [name, ...values] of rows) line([name, ...values.map(said)], 'td')
  const ends = spread(cloud)
  if (!ends) return
  const bar = made('p', side, { className: 'hint' }, `${ends[0]} `)
  const colours = `linear-gradient(90deg, ${SCALE.map(colour => `rgb(${colour})`)})`
  Object.assign(made('i', bar).style, { display: 'inline-block', width: '80px', height: '8px', background: colours })
  bar.append(` ${ends[1]} N/mm, softest: the colours of the workspace`)
}
