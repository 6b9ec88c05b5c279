// Where to measure, so that a calibration knows best where the machine goes.
import { change } from './app.js'
import { again, app, attempt, button, choice, field, made, refresh } from './frame.js'
import { draw } from './picture.js'
import { save } from './transport.js'

const KINDS = [['probe', 'its own probe, on the bed'], ['position', 'positions'], ['pose', 'poses'], ['height', 'heights'], ['distance', 'distances']]
const REST = 300 // ms without a change, after which the plan is made again
const FIELDS = [ // key of the project's table, words, what stands there without
  ['count', 'poses', '20'], ['accuracy', 'or as many as reach, mm', ''], ['noise', 'its noise, mm', '0.02'],
  ['actuator-noise', 'noise of the actuators, mm or rad', '0'], ['within', 'within, such as z=0:300', ''],
  ['dwell', 'it waits at each, s', '5'], ['safe-height', 'between poses it rises to z, mm', ''],
]
const NUMBERS = ['count', 'accuracy', 'actuator-noise', 'dwell', 'safe-height']

export async function plan(main) {
  made('h1', main, { text: 'Where to measure' })
  const form = made('form', main, { className: 'settings' }), answer = made('section', main, { 'aria-live': 'polite' })
  const now = () => app.project.state.plan ?? {}
  const kinds = KINDS.some(([key]) => key === now().kind) || !now().kind ? KINDS : [...KINDS, [now().kind, now().kind]]
  let rest = 0
  const soon = () => { answer.inert = true; clearTimeout(rest); rest = setTimeout(() => attempt(choose), REST) }
  const kind = choice(form, 'what the instrument reads', kinds, now().kind ?? (app.project.state.import ? 'probe' : 'position'), soon)
  const fields = FIELDS.map(([key, words, placeholder]) => {
    const input = made('input', null, { inputmode: key === 'within' ? 'text' : 'decimal', size: 10, placeholder, oninput: soon })
    return [key, field(form, words, input)]
  })
  const gcode = choice(form, 'a program, too', [['', 'none'], ...app.project.gcode.map(one => [one, `G-code of ${one}`])], now().gcode ?? '', soon)
  const ofProgram = fields.slice(-2).map(([, input]) => input.parentElement)
  form.append(...ofProgram)
  const fill = () => fields.forEach(([key, input]) => { if (input !== document.activeElement) input.value = [now()[key] ?? ''].flat().join(',') })
  fill()
  const programmed = () => ofProgram.forEach(one => { one.hidden = !gcode.value })
  programmed()
  gcode.addEventListener('change', programmed)
  made('button', form, { className: 'first', text: 'Choose poses' })
  form.onsubmit = event => {
    event.preventDefault()
    clearTimeout(rest)
    attempt(choose)
  }

  const choose = async () => {
    const asked = { ...now(), kind: kind.value }
    for (const [key, input] of fields) {
      const text = input.value.trim()
      if (!text) delete asked[key]
      else asked[key] = key === 'within' ? text.split(',').map(part => part.trim()) : NUMBERS.includes(key) ? number(text) : text
    }
    if (gcode.value) asked.gcode = gcode.value
    else for (const key of ['gcode', 'dwell', 'safe-height']) delete asked[key]
    if (asked.count === undefined && asked.accuracy === undefined) asked.count = 20
    if (asked.accuracy !== undefined && asked.count !== undefined) delete asked[document.activeElement === fields[0][1] ? 'accuracy' : 'count']
    if (await change(table => { table.plan = asked })) await refresh()
  }

  const show = async ask => {
    fill()
    if (gcode !== document.activeElement) gcode.value = now().gcode ?? ''
    programmed()
    if (!Object.keys(now()).length) return
    answer.inert = true // what stands there is of other fields
    const found = await ask('plan', 'choosing poses').catch(error => {
      if (!error.stopped && !error.left) answer.replaceChildren()
      throw error
    })
    answer.inert = false
    const split = made('div', null, { className: 'split' })
    again(answer, () => {
      for (const text of found.said) made('p', answer, { className: 'warn', text })
      const takes = made('div', answer, { className: 'choices' })
      for (const file of found.files) button(takes, `Save ${file}`, () => save(file), { className: 'first' })
      button(takes, 'Print a sheet to fill in', () => print())
      answer.append(split)
      const words = made('div', split)
      for (const [k, text] of found.words.entries()) made('p', words, { className: k ? 'note' : 'lead', text })
      made('pre', words, { text: found.table, tabindex: 0 })
      sheet(answer, found.sheet)
    })
    await draw(made('div', split, { className: 'picture' }), found.view)
  }
  return show
}

const number = text => (Number.isNaN(+text.replace(',', '.')) ? text : +text.replace(',', '.')) // refused by name

// The poses one after the other, with a box to write each reading into; shown on paper alone.
function sheet(parent, { title, head, rows, read }) {
  const table = made('table', made('section', parent, { className: 'sheet' }))
  made('caption', table, { text: title })
  made('tr', table, {}, ...[...head, ...read].map(text => made('th', null, { text, scope: 'col' })))
  for (const cells of rows) made('tr', table, {}, ...cells.map(text => made('td', null, { text })), ...read.map(() => made('td', null, { className: 'box' })))
}
