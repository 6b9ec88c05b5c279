// What was measured: files as they lie there, and as they are understood.
import { change, dropping } from './app.js'
import { live } from './live.js'
import { again, app, button, choice, field, go, made, refresh, tick } from './frame.js'

export async function measure(main) {
  made('h1', main, { text: 'What was measured' })
  const split = made('div', main, { className: 'split' })
  const side = made('div', split), seen = made('div', split)
  const understood = made('div', seen), read = made('div', seen), raw = made('div', seen)
  dropping(side, 'or drop anywhere here what the instrument wrote, and the log of the controller')
  const list = made('ul', side, { className: 'files' }), asked = made('div', side), joins = made('div', side), next = made('div', side)
  let heads = null

  const show = async ask => {
    const { measured = {} } = app.project.state, files = measured.files ?? []
    again(list, () => listed(list, measured))
    again(asked, () => { if (files.length) how(asked) })
    if (!files.length) {
      for (const part of [understood, read, raw, joins, next]) part.replaceChildren()
      heads = null
      return
    }
    const found = await ask('look', 'reading the files')
    const these = found.columns.map(({ file, heading }) => `${file} ${heading}`).sort().join('\n')
    if (heads?.of !== these) { // else they stay as they are, with whoever is in one of them
      understood.replaceChildren()
      heads = { of: these, ...columns(understood, found) }
    }
    heads.update(found)
    again(joins, () => joined(joins, found.joins, measured))
    again(next, () => {
      button(next, 'Calibrate', () => go('result'), { className: 'first' }).disabled = Boolean(found.error)
    })
    again(read, () => {
      if (found.error) made('p', read, { className: 'warn', role: 'alert', text: found.error.message })
      for (const text of found.text ?? []) made('pre', read, { text, tabindex: 0 })
      for (const note of found.notes ?? []) made('p', read, { className: 'note', text: note })
    })
    again(raw, () => {
      for (const [name, lines] of Object.entries(found.files)) {
        made('h2', raw, { text: `${name}, as it is` })
        const marked = name === found.error?.file?.split('/').pop() ? found.error.line : 0
        const text = made('pre', raw, { tabindex: 0, 'aria-label': name })
        for (const [number, line] of lines) made(number === marked ? 'mark' : 'span', text, { text: `${line}\n` })
      }
    })
  }
  live(made('section', main))
  return show
}

const edit = async what => {
  if (await change(table => { table.measured ??= {}; what(table.measured, table) })) await refresh()
}

const without = (measured, file) => { measured.files = (measured.files ?? []).filter(one => one !== file) }

function listed(list, { files = [], controller = '' }) {
  for (const file of files) {
    const item = made('li', list, {}, made('span', null, { text: file }))
    button(item, 'is the controller’s log', () => edit(m => { without(m, file); m.controller = file }), { 'data-key': `log ${file}` })
    button(item, `remove ${file}`, () => edit(m => without(m, file)))
  }
  if (!controller) return
  const item = made('li', list, {}, made('span', null, { text: `${controller}: the controller’s log` }))
  button(item, 'is measurements', () => edit(m => { m.files = [...m.files ?? [], controller]; delete m.controller }), { 'data-key': `log ${controller}` })
  button(item, `remove ${controller}`, () => edit(m => { delete m.controller }))
}

function how(parent) {
  const { measured = {}, fit = {} } = app.project.state
  const asked = made('fieldset', parent, {}, made('legend', null, { text: 'How it was measured' }))
  const known = (name, value) => edit((_, table) => {
    table.fit ??= {}
    if (value) table.fit[name] = 'unknown'
    else delete table.fit[name]
    if (table.fit.frame || table.fit.target) table.fit.datum = 'auto'
    else delete table.fit.datum
  })
  tick(asked, 'the instrument stands anywhere', fit.frame === 'unknown', on => known('frame', on))
  tick(asked, 'nobody knows where the reflectors sit', fit.target === 'unknown', on => known('target', on))
  const units = made('input', null, { value: measured.units ?? '', placeholder: 'mm,deg', size: 10 })
  units.onchange = () => edit(m => { if (units.value) m.units = units.value; else delete m.units })
  field(asked, 'units of columns that state none', units)
}

// Which row of the log belongs to which point: what each way gives, and its first rows.
function joined(parent, ways, { join = 'auto' }) {
  if (!ways.length) return
  const box = made('fieldset', parent, {}, made('legend', null, { text: 'Rows of the log are found by' }))
  for (const { way, said, text } of ways) {
    const radio = made('input', null, { type: 'radio', name: 'join', 'data-key': way, onchange: () => edit(m => { if (way === 'auto') delete m.join; else m.join = way }) })
    radio.checked = way === join
    made('label', box, { className: 'tick' }, radio, made('span', null, { text: `${way}${said ? `: ${said}` : ''}` }))
    if (text) made('details', box, { 'data-key': way }, made('summary', null, { text: `the first rows by ${way}` }), made('pre', null, { text, tabindex: 0 }))
  }
}

// What each heading is: as it says, another one, or nothing.
function columns(parent, { columns, meanings, units }) {
  const cells = {}
  for (const name of new Set(columns.map(({ file }) => file))) {
    const mine = columns.filter(({ file }) => file === name)
    const box = made('details', parent, { open: mine.length < 12 }, made('summary', null, { text: `What the ${mine.length} columns of ${name} are` }))
    const table = made('table', made('div', box, { className: 'wide' }), { className: 'columns' })
    made('tr', table, {}, ...['heading', 'is', 'unit', 'as it was read'].map(text => made('th', null, { text, scope: 'col' })))
    for (const { heading } of mine) {
      const line = made('tr', table), cell = cells[`${name} ${heading}`] = {}
      const onchange = () => {
        const is = cell.is.value.trim(), unit = cell.unit.value // an answer that comes before its turn may change the fields
        return edit(m => means(m, heading, is, unit))
      }
      made('td', line, { text: heading })
      cell.is = made('input', made('td', line), { list: 'meanings', size: 12, placeholder: 'as it says', 'aria-label': `${heading} is`, onchange })
      cell.unit = made('select', made('td', line), { 'aria-label': `unit of ${heading}`, onchange })
      for (const unit of ['', ...units]) made('option', cell.unit, { value: unit, text: unit || 'as stated' })
      cell.said = made('td', line, { className: 'note' })
    }
  }
  const known = made('datalist', parent, { id: 'meanings' })
  for (const value of [LEFT_OUT, ...meanings]) made('option', known, { value })
  const update = found => {
    const { rename = {}, ignore = [] } = app.project.state.measured ?? {}
    for (const { file, heading, said } of found.columns) {
      const { is, unit, said: told } = cells[`${file} ${heading}`]
      const [, name, stated] = /^(.*?)(?: \[(.*)\])?$/.exec(rename[heading] ?? '')
      told.textContent = said
      if (is !== document.activeElement) is.value = ignore.includes(heading) ? LEFT_OUT : name === heading ? '' : name
      if (unit !== document.activeElement) unit.value = stated ?? ''
    }
  }
  return { update }
}

const LEFT_OUT = 'leave out'

function means(measured, heading, named, unit) {
  measured.ignore = (measured.ignore ?? []).filter(one => one !== heading)
  measured.rename = { ...measured.rename }
  delete measured.rename[heading]
  if (named === LEFT_OUT) measured.ignore.push(heading)
  else if (named || unit) measured.rename[heading] = (named || heading) + (unit ? ` [${unit}]` : '')
  if (!measured.ignore.length) delete measured.ignore
  if (!Object.keys(measured.rename).length) delete measured.rename
}
