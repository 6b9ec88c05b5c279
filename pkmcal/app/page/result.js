// How good it is: the verdict first, then rows, numbers and the picture, each of which refits.
import { change } from './app.js'
import { again, app, attempt, button, choice, made, refresh } from './frame.js'
import { grid } from './grid.js'
import { numbers } from './numbers.js'
import { draw, selected } from './picture.js'

const LEAST = 400 // rows that are listed at first: the worst

export async function result(main) {
  made('h1', main, { text: 'How good is it?' })
  const verdict = made('section', main, { className: 'verdict', 'aria-live': 'polite' })
  const split = made('div', main, { className: 'split' })
  const left = made('div', split), picture = made('div', left, { className: 'picture' }), picked = made('div', left, { className: 'picked' })
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
  const list = { order: [], named: null, all: false }

  const refit = async edit => {
    if (await change(table => { table.fit ??= {}; edit(table.fit) })) await refresh()
  }
  // one row, from the list or from the picture: named in both, and with its box
  const name = (key, from) => {
    list.named = key
    for (const one of parts.rows.querySelectorAll('tr.named')) one.classList.remove('named')
    const line = document.getElementById(`row ${key}`)
    line?.classList.add('named')
    if (from === 'picture') line?.scrollIntoView({ block: 'nearest' })
    else selected(key)
    again(picked, () => {
      const row = app.found.rows.find(one => one.key === key)
      if (row) made('label', picked, { className: 'tick' }, use(row, refit, 'picked'), made('span', null, { text: `use ${row.name}: ${row.off.join(' → ')} mm ${row.said}` }))
    })
  }

  const show = async ask => {
    const found = await ask('fit', 'calibrating')
    for (const row of found.rows) Object.assign(row, { use: row.use ?? '', said: row.said ?? '', drop: row.drop === undefined ? row.key : row.drop })
    app.found = found
    again(verdict, () => say(verdict, found, refit))
    again(settings, () => held(settings, refit))
    again(parts.rows, () => rows(parts.rows, found, list, refit, name))
    again(parts.numbers, () => numbers(parts.numbers, found, before, refit))
    again(parts.table, () => made('pre', parts.table, { text: found.summary, tabindex: 0 }))
    for (const each of found.numbers) before[each.name] = each.stderr
    if (found.view) await draw(picture, found.view, key => name(key, 'picture'))
    if (list.named) name(list.named, 'list')
    if (main.isConnected) main.parentElement.dataset.fits = +main.parentElement.dataset.fits + 1
  }
  pick(app.part ?? 'rows')
  return show
}

function say(section, { verdict }, refit) {
  section.dataset.state = verdict.state
  made('p', section, { className: 'state', text: verdict.head })
  for (const { level, text, remedies, check } of verdict.said) {
    const item = made('div', section, { className: 'said', 'data-check': check })
    made('p', item, {}, made('b', null, { text: `${level}: ` }), text)
    for (const { option, fit } of remedies)
      button(item, option, () => refit(table => { for (const key of Object.keys(table)) delete table[key]; Object.assign(table, fit) }))
  }
}

function held(parent, refit) {
  const { fit = {}, measured = {} } = app.project.state, used = [...(measured.files ?? []), measured.controller]
  const files = app.project.files.filter(name => /\.(csv|tsv|txt|xlsx)$/i.test(name) && !used.includes(name))
  const shares = [['', 'nothing'], ['0.2', 'a fifth of the poses'], ['0.5', 'half of the poses'], ...files.map(f => [f, f])]
  const now = fit.holdout ?? ''
  if (!shares.some(([key]) => key === now)) shares.push([now, now])
  const set = (name, value) => refit(table => { if (value) table[name] = value; else delete table[name] })
  choice(parent, 'hold out', shares, now, value => set('holdout', value))
  choice(parent, 'outliers', [['', 'count in full'], ['huber', 'count less'], ['cauchy', 'hardly count']], fit.loss ?? '', value => set('loss', value))
}

// A box that leaves a row out, or takes it back, by its number: a line may have several.
function use(each, refit, where = '') {
  const box = made('input', null, { type: 'checkbox', 'aria-label': `use ${each.name}`, 'data-key': `${where}use ${each.key}` })
  box.checked = each.use !== 'left out'
  box.disabled = each.drop === null
  box.onclick = event => event.stopPropagation()
  box.onchange = () => attempt(() => {
    const { checked } = box
    return refit(fit => {
      const out = new Set((fit.drop ?? []).flatMap(one => one.split(',').map(part => part.trim())))
      if (fit['drop-outliers']) for (const one of app.found.rows) if (one.use === 'left out') out.add(one.drop)
      delete fit['drop-outliers']
      if (checked) for (const one of [each.drop, each.line]) out.delete(one)
      else out.add(each.drop)
      fit.drop = [...out]
      if (!fit.drop.length) delete fit.drop
    })
  })
  return box
}

// Worst first when they are first shown; then each row keeps its place until it is asked otherwise.
function rows(parent, found, list, refit, name) {
  const place = new Map(list.order.map((key, k) => [key, k]))
  const sorted = [...found.rows].sort((a, b) => (place.get(a.key) ?? Infinity) - (place.get(b.key) ?? Infinity) || 0)
  const shown = sorted.slice(0, list.all ? Infinity : LEAST)
  const moved = sorted.some((row, k) => row !== found.rows[k])
  list.order = sorted.map(({ key }) => key)
  const wide = made('div', parent, { className: 'wide', tabindex: 0, role: 'region', 'aria-label': 'measured rows' })
  const table = made('table', wide)
  made('caption', table, { text: found.of_rows.caption })
  made('tr', table, {}, ...found.of_rows.heads.map(text => made('th', null, { text, scope: 'col' })))
  for (const each of shown) {
    const line = made('tr', table, { className: each.use ? 'out' : each.said ? 'odd' : '', id: `row ${each.key}` })
    if (list.named === each.key) line.classList.add('named')
    made('td', line, {}, use(each, refit))
    const show = button(made('td', line), each.name, () => name(each.key, 'list'), { className: 'plain', 'aria-label': `show ${each.name}` })
    line.onclick = event => { if (event.target !== show) name(each.key, 'list') }
    for (const text of [...each.off, each.said]) made('td', line, { text })
  }
  grid(table)
  if (moved) button(parent, 'sort, worst first', () => { list.order = []; again(parent, () => rows(parent, found, list, refit, name)) })
  if (shown.length < sorted.length) button(parent, `show all ${sorted.length} rows`, () => { list.all = true; again(parent, () => rows(parent, found, list, refit, name)) })
}
