// A measurement with a machine: connected, started and stopped by who looks at it, a row after the other.
import { change } from './app.js'
import { app, attempt, button, choice, field, go, made, refresh, work } from './frame.js'
import * as server from './transport.js'

const KINDS = [['height', 'heights'], ['position', 'positions'], ['pose', 'poses'], ['distance', 'distances'], ['closure', 'nothing but its actuators']]
const TEXTS = [ // of the plan: key, words, what stands there without
  ['noise', 'its noise, mm, or unknown', '0.02'], ['within', 'within, such as z=0:300', ''], ['direction', 'direction that counts', 'all'],
]
const NUMBERS = [['accuracy', 'until an error is predicted, mm', ''], ['count', 'or poses', '']]
const RULES = [['feed', 'feed, mm/min'], ['safe_height', 'safe height z, mm'], ['dwell', 'rest before it is read, s'], ['repeats', 'readings at each pose']]
let running = null // the name of the measurement of this tab

// The form; what happens is shown above every screen, with Stop, until it has ended.
export async function live(parent) {
  const box = made('details', parent, {}, made('summary', null, { text: 'Measure with a machine now' }))
  made('p', box, { className: 'note', text: 'It names the pose that tells most, and stops when it is good enough. Nothing moves before you press Start, and every way stays within its limits: see that nothing is in it.' })
  const form = made('form', box, { className: 'settings' })
  let known = null
  box.ontoggle = () => attempt(async () => {
    if (!box.open || known) return
    known = await work('devices', 'looking what can be driven')
    fill(form, known)
  })
}

function fill(form, { machines, instruments, rules }) {
  const plan = app.project.state.plan ?? {}
  const device = (words, kinds) => {
    const address = made('input', null, { size: 24, disabled: true, 'aria-label': `address of the ${words}` })
    const picked = choice(form, words, kinds.map(([word]) => [word, word]), 'person', word => {
      const wanted = Object.fromEntries(kinds)[word]
      Object.assign(address, { disabled: !wanted, placeholder: wanted, value: '' }) // it is always typed
    })
    field(form, `address of the ${words}`, address)
    return () => address.disabled ? picked.value : `${picked.value}:${address.value.trim()}`
  }
  const input = (key, words, placeholder, value = '') => [key, field(form, words, made('input', null, { size: 10, placeholder, value }))]
  const machine = device('machine', machines), instrument = device('instrument', instruments)
  const kind = choice(form, 'what it reads', KINDS, plan.kind === 'probe' ? 'height' : plan.kind ?? 'height', () => {})
  const texts = TEXTS.map(([key, words, placeholder]) => input(key, words, placeholder, [plan[key] ?? ''].flat().join(',')))
  const numbers = NUMBERS.map(([key, words, placeholder]) => input(key, words, placeholder, plan[key] ?? ''))
  const own = RULES.map(([key, words]) => input(key, words, rules[key] ?? 'none'))
  const [, out] = input('out', 'rows go to', '', 'measured.csv')
  made('button', form, { className: 'first', text: 'Connect' })
  const number = (text, words) => {
    const found = +text.trim().replace(',', '.')
    if (!Number.isFinite(found)) throw Error(`${words}: no number: ${text}`)
    return found
  }
  form.onsubmit = event => {
    event.preventDefault()
    attempt(async () => {
      const asked = { machine: machine(), out: out.value.trim(), plan: { ...plan, kind: kind.value } }
      if (kind.value !== 'closure') asked.instrument = instrument()
      for (const [key] of [...TEXTS, ...NUMBERS]) delete asked.plan[key]
      for (const [key, { value }] of texts) if (value.trim()) asked.plan[key] = key === 'within' ? value.split(',').map(part => part.trim()) : value.trim()
      for (const [key, one] of numbers) if (one.value.trim()) asked.plan[key] = number(one.value, key)
      for (const [key, one] of own) if (one.value.trim()) asked[key] = number(one.value, key)
      await measured(asked)
    })
  }
}

// One measurement, from its connection to its end.
async function measured(asked) {
  const lines = await server.measuring(asked)
  document.getElementById('measuring')?.remove()
  const panel = made('section', null, { id: 'measuring', 'aria-label': 'Measurement with a machine' })
  document.getElementById('main').before(panel)
  const head = made('div', panel, { className: 'choices' }), words = made('pre', panel, { tabindex: 0, hidden: true })
  const question = made('form', panel, { className: 'settings', hidden: true }), bar = made('meter', panel, { hidden: true, 'aria-label': 'predicted error, mm', min: 0 })
  const told = made('p', panel, { role: 'status' }), warned = made('p', panel, { className: 'warn', role: 'alert' })
  const wide = made('div', panel, { className: 'wide', tabindex: 0, 'aria-label': 'rows' }), table = made('table', wide, { hidden: true })
  made('tr', table, {}, ...['row', 'at', 'read', 'the rows tell'].map(text => made('th', null, { text, scope: 'col' })))
  const stop = button(head, 'Stop', () => server.stop(), { className: 'stop' })
  const start = button(head, 'Start', async () => { start.remove(); await server.start(running) }, { className: 'first', hidden: true })
  const answer = made('input', null, { size: 12, 'data-key': 'reading', autocomplete: 'off' })
  const label = field(question, '', answer).previousElementSibling
  made('button', question, { text: 'Enter' })
  let number = 0, over = false
  question.onsubmit = event => {
    event.preventDefault()
    question.hidden = true // until the next question
    attempt(() => server.typed(running, number, answer.value))
  }
  const shown = ({ line, predicted, wanted, next, warnings }) => {
    told.textContent = next ? `${line}. Next: ${next}` : line
    warned.textContent = warnings.join('\n')
    if (predicted === null) return
    if (bar.hidden) bar.max = predicted
    Object.assign(bar, { hidden: false, value: predicted, title: line })
    if (wanted) bar.low = wanted
  }
  told.textContent = 'connecting'
  try {
    for await (const message of lines) {
      if (message.run) {
        running = message.run
        addEventListener('beforeunload', leaving)
      }
      if (message.ready) {
        words.textContent = `${message.ready}\n\n${message.command}`
        words.hidden = false
        shown(message.course)
        start.hidden = message.over
        if (!message.over) start.focus()
      }
      if (message.started) stop.focus()
      if (message.said) told.textContent = message.said
      if (message.asked) {
        number = message.number
        label.textContent = message.asked
        answer.value = ''
        question.hidden = false
        answer.focus()
      }
      if (message.row) {
        table.hidden = false
        shown(message.row)
        const { number: row, at, read, line, warnings } = message.row
        const cells = [row, at, read, line].map(text => made('td', null, { text }))
        table.firstElementChild.after(made('tr', null, { className: warnings.length ? 'odd' : '' }, ...cells))
      }
      over ||= Boolean(message.result || message.error)
      if (message.result) ended(head, message.result, told)
      if (message.error?.stopped) told.textContent = message.error.message
      else if (message.error) throw Error(message.error.message)
    }
    if (!over) throw server.ended()
  } finally {
    running = null
    removeEventListener('beforeunload', leaving)
    question.remove()
    start.remove()
    stop.remove()
    button(head, 'Close', () => panel.remove())
  }
}

function ended(head, { file, said }, told) {
  told.textContent = said.join('. ')
  button(head, 'Calibrate with these rows', async () => {
    const done = await change(table => {
      table.measured ??= {}
      table.measured.files = [...new Set([...table.measured.files ?? [], file])]
    })
    if (!done) return
    if (app.step === 'result') await refresh()
    else await go('result')
  }, { className: 'first' })
}

// Who leaves stops the machine, and is asked first.
function leaving(event) {
  event.preventDefault()
}
