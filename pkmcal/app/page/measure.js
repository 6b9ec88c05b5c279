// What was measured: files as they lie there, and as they are understood.
import { app, button, change, dropping, field, go, made, tick, work } from './frame.js'

const MEANINGS = ['q1', 'q2', 'q3', 'q4', 'q5', 'q6', 'x', 'y', 'z', 'alpha', 'beta', 'gamma', 'distance', 'sigma', 'time', 'name', 'group', 'session', 'temperature']

export async function measure(main) {
  made('h1', main, { text: 'What was measured' })
  const split = made('div', main, { className: 'split' })
  const seen = made('div', split), side = made('div', split)
  const { measured = {}, fit = {} } = app.project.state
  const files = measured.files ?? [], controller = measured.controller ?? ''
  const edit = async what => { if (await change(table => { table.measured ??= {}; what(table.measured, table) })) await go('measure') }

  dropping(side, 'or drop here what the instrument wrote, and the log of the controller', names =>
    edit(m => { m.files = [...new Set([...files, ...names])] }))
  const list = made('ul', side, { className: 'files' })
  for (const file of files) {
    const item = made('li', list, {}, made('span', null, { text: file }))
    button(item, 'is the controller’s log', () => edit(m => { m.files = files.filter(f => f !== file); m.controller = file }))
    button(item, `remove ${file}`, () => edit(m => { m.files = files.filter(f => f !== file) }))
  }
  if (controller) {
    const item = made('li', list, {}, made('span', null, { text: `${controller}: the controller’s log` }))
    button(item, 'is measurements', () => edit(m => { m.files = [...files, controller]; delete m.controller }))
    button(item, `remove ${controller}`, () => edit(m => { delete m.controller }))
  }
  if (!files.length) return

  const asked = made('fieldset', side, {}, made('legend', null, { text: 'How it was measured' }))
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
  if (controller) {
    const join = made('input', null, { value: measured.join ?? '', placeholder: 'auto', size: 10 })
    join.onchange = () => edit(m => { if (join.value) m.join = join.value; else delete m.join })
    field(asked, 'rows of the log by: row, row+1, time, a column', join)
  }

  const found = await work('look', 'reading the files')
  const next = button(side, 'Calibrate', () => go('result'), { className: 'first' })
  next.disabled = Boolean(found.error)
  if (found.error) made('p', seen, { className: 'warn', role: 'alert', text: found.error.message })
  for (const text of found.text ?? []) made('pre', seen, { text, tabindex: 0 })
  for (const note of found.notes ?? []) made('p', seen, { className: 'note', text: note })
  for (const [name, lines] of Object.entries(found.files)) {
    made('h2', seen, { text: `${name}, as it is` })
    const marked = name === found.error?.file?.split('/').pop() ? found.error.line : 0
    const text = made('pre', seen, { tabindex: 0 })
    lines.forEach((line, k) => made(k + 1 === marked ? 'mark' : 'span', text, { text: `${line}\n` }))
    columns(seen, name, lines, measured, edit)
  }
}

// What each heading is: as it says, another one, or nothing.
function columns(parent, name, lines, measured, edit) {
  const head = lines.find(line => line && !line.startsWith('#')) ?? ''
  const split = head.includes('\t') ? '\t' : head.includes(';') ? ';' : ','
  const titles = head.split(split).map(title => title.trim()).filter(Boolean)
  if (titles.length < 2) return
  const box = made('details', parent, {}, made('summary', null, { text: `What the columns of ${name} are` }))
  const renamed = measured.rename ?? {}, ignored = measured.ignore ?? []
  for (const title of titles) {
    const now = ignored.includes(title) ? 'leave out' : renamed[title] ?? ''
    const input = made('input', null, { value: now, placeholder: 'as it says', list: 'meanings', size: 12 })
    input.onchange = () => edit(m => {
      m.ignore = ignored.filter(one => one !== title)
      m.rename = { ...renamed }
      delete m.rename[title]
      if (input.value === 'leave out') m.ignore.push(title)
      else if (input.value) m.rename[title] = input.value
      if (!m.ignore.length) delete m.ignore
      if (!Object.keys(m.rename).length) delete m.rename
    })
    field(box, title, input)
  }
  const known = made('datalist', box, { id: 'meanings' })
  for (const value of ['leave out', ...MEANINGS, 'q1 [mm]', 'x [mm]']) made('option', known, { value })
}
