// How good it is: the verdict first, then rows, numbers and the picture, each of which refits.
import { app, attempt, button, change, choice, field, made, work } from './frame.js'
import { draw, selected } from './picture.js'

const LEAST = 400 // rows that are listed at first: the worst
let order = null

export async function result(main) {
  made('h1', main, { text: 'How good is it?' })
  const verdict = made('section', main, { className: 'verdict', 'aria-live': 'polite' })
  const split = made('div', main, { className: 'split' })
  const left = made('div', split), picture = made('div', left, { className: 'picture' })
  const lists = made('div', split)
  const tabs = made('div', lists, { className: 'tabs' })
  const parts = { rows: made('div', lists), numbers: made('div', lists), table: made('div', lists) }
  const shown = { rows: 'Rows', numbers: 'Numbers', table: 'All it says' }
  const pick = name => {
    for (const [key, part] of Object.entries(parts)) part.hidden = key !== name
    for (const one of tabs.children) one.setAttribute('aria-pressed', one.dataset.part === name)
    app.part = name
  }
  for (const [key, text] of Object.entries(shown)) button(tabs, text, () => pick(key), { 'data-part': key })
  const settings = made('div', lists, { className: 'settings' })
  const before = {}

  const refit = async edit => {
    if (edit && !await change(table => { table.fit ??= {}; edit(table.fit) })) return
    const found = await work('fit', 'calibrating')
    app.found = found
    say(verdict, found, refit)
    held(settings, refit)
    rows(parts.rows, found, refit)
    numbers(parts.numbers, found, before, refit)
    parts.table.replaceChildren()
    made('pre', parts.table, { text: found.summary, tabindex: 0 })
    for (const each of found.numbers) before[each.name] = each.stderr
    if (found.view) await draw(picture, found.view, row => mark(row, true))
    const counter = document.getElementById('main').dataset
    counter.fits = +counter.fits + 1
  }
  pick(app.part ?? 'rows')
  await refit()
}

function say(section, { verdict }, refit) {
  section.replaceChildren()
  section.dataset.state = verdict.state
  const sentence = verdict.text.split('\n').map(line => line.trim())
  made('p', section, { className: 'state', text: sentence.join(' ').split(/ (?=also: |note: )/)[0] })
  const others = verdict.said
  for (const { level, text, remedies, check } of others) {
    const item = made('div', section, { className: 'said', 'data-check': check })
    made('p', item, {}, made('b', null, { text: `${level}: ` }), text)
    for (const { option, fit } of remedies)
      button(item, option, () => refit(table => { for (const key of Object.keys(table)) delete table[key]; Object.assign(table, fit) }))
  }
}

function held(parent, refit) {
  parent.replaceChildren()
  const { fit = {}, measured = {} } = app.project.state, used = [...(measured.files ?? []), measured.controller]
  const files = app.project.files.filter(name => /\.(csv|tsv|txt|xlsx)$/i.test(name) && !used.includes(name))
  const set = (name, value) => refit(table => { if (value) table[name] = value; else delete table[name] })
  choice(parent, 'hold out', [['', 'nothing'], ['0.2', 'a fifth of the poses'], ['0.5', 'half of the poses'], ...files.map(f => [f, f])], fit.holdout ?? '', value => set('holdout', value))
  choice(parent, 'outliers', [['', 'count in full'], ['huber', 'count less'], ['cauchy', 'hardly count']], fit.loss ?? '', value => set('loss', value))
}

function mark(row, scroll) {
  for (const one of document.querySelectorAll('tr.named')) one.classList.remove('named')
  const line = document.getElementById(`row-${row}`)
  line?.classList.add('named')
  if (scroll) line?.scrollIntoView({ block: 'nearest' })
}

const short = x => (x === null || x === undefined ? '–' : Math.abs(x) >= 1000 ? x.toFixed(0) : Number(x.toPrecision(3)).toString())
const placeOf = ({ file, line, row }) => (line > 0 ? `${file}:${line}` : `row ${row}`)

function rows(parent, found, refit) {
  parent.replaceChildren()
  const wide = made('div', parent, { className: 'wide', tabindex: 0, role: 'region', 'aria-label': 'measured rows' })
  const table = made('table', wide)
  made('caption', table, { text: 'Measured rows, worst first: the distance from where the machine is, mm' })
  made('tr', table, {}, ...['use', 'row', 'line', 'before', 'after'].map(text => made('th', null, { text, scope: 'col' })))
  const use = (line, each, kept) => {
    const number = String(each.row)
    const box = made('input', made('td', line), { type: 'checkbox', 'aria-label': `use row ${each.row}` })
    box.checked = kept
    box.onclick = event => event.stopPropagation()
    box.onchange = () => attempt(() => refit(fit => { // by number: a line may have several rows
      const out = new Set((fit.drop ?? []).flatMap(one => one.split(',').map(part => part.trim())))
      if (fit['drop-outliers']) for (const one of found.dropped) out.add(String(one.row))
      delete fit['drop-outliers']
      if (box.checked) for (const one of [number, `${each.file}:${each.line}`]) out.delete(one)
      else out.add(number)
      fit.drop = [...out]
      if (!fit.drop.length) delete fit.drop
    }))
  }
  for (const each of found.dropped) {
    const line = made('tr', table, { className: 'out', id: `row-${each.row}` })
    use(line, each, false)
    for (const text of [each.row, placeOf(each), short(each.before), `${short(each.after)} left out`]) made('td', line, { text })
  }
  const worst = [...found.rows].sort((a, b) => (b.after ?? 0) - (a.after ?? 0)).slice(0, app.all ? Infinity : LEAST)
  for (const each of worst) {
    const line = made('tr', table, { id: `row-${each.row}`, className: each.outlier ? 'odd' : '' })
    use(line, each, true)
    const name = button(made('td', line), String(each.row), () => { mark(each.row); selected(each.row) }, { className: 'plain', 'aria-label': `show row ${each.row}` })
    line.onclick = event => { if (event.target !== name) { mark(each.row); selected(each.row) } }
    for (const text of [each.line > 0 ? placeOf(each) : '', short(each.before), `${short(each.after)}${each.outlier ? ' outlier' : ''}`]) made('td', line, { text })
  }
  if (worst.length < found.rows.length) button(parent, `show all ${found.rows.length} rows`, () => { app.all = true; rows(parent, found, refit) })
}

function numbers(parent, found, before, refit) {
  parent.replaceChildren()
  const wide = made('div', parent, { className: 'wide', tabindex: 0, role: 'region', 'aria-label': 'numbers' })
  const table = made('table', wide)
  made('caption', table, { text: 'Numbers that are found; ± is one standard deviation' })
  made('tr', table, {}, ...['find', 'number', 'value', '±', 'change', 'unit', 'knowledge'].map(text => made('th', null, { text, scope: 'col' })))
  const free = () => app.project.state.fit?.free ?? ['default']
  const fix = () => app.project.state.fit?.fix ?? []
  for (const each of found.numbers) {
    const line = made('tr', table), cell = made('td', line)
    if (found.machine.includes(each.name)) {
      const box = made('input', cell, { type: 'checkbox', 'aria-label': `find ${each.name}` })
      box.checked = true
      box.onchange = () => refit(fit => {
        if (free().includes(each.name)) fit.free = free().filter(name => name !== each.name)
        else fit.fix = [...fix(), each.name]
        if (fit.free?.length === 1 && fit.free[0] === 'default') delete fit.free
      })
    }
    const was = before[each.name], now = each.stderr
    const trend = was && now ? (now < 0.98 * was ? 'better' : now > 1.02 * was ? 'worse' : '') : ''
    const digits = now ? Math.max(0, Math.min(8, 1 - Math.floor(Math.log10(now)))) : 3
    const texts = [each.name, each.after?.toFixed(digits) ?? '–', now === null ? '∞' : short(now), (each.after - each.before).toFixed(digits), each.unit, each.knowledge]
    texts.forEach((text, k) => made('td', line, { text, className: k === 2 ? trend : '' }))
  }
  for (const name of fix()) {
    const line = made('tr', table), box = made('input', made('td', line), { type: 'checkbox', 'aria-label': `find ${name}` })
    box.onchange = () => refit(fit => { fit.fix = fix().filter(one => one !== name); if (!fit.fix.length) delete fit.fix })
    for (const text of [name, 'held', '', '', '', '']) made('td', line, { text })
  }
  const more = made('select', null, { onchange: () => more.value && refit(fit => { fit.free = [...new Set([...free(), more.value])] }) })
  made('option', more, { value: '', text: '…' })
  for (const name of found.others) made('option', more, { value: name, text: name })
  field(parent, 'find another number, too', more)
}
