// Where to measure, so that a calibration knows best where the machine goes.
import { app, attempt, button, change, choice, field, made, work } from './frame.js'
import { draw } from './picture.js'
import { save } from './transport.js'

const KINDS = [['probe', 'its own probe, on the bed'], ['position', 'positions'], ['pose', 'poses'], ['height', 'heights'], ['distance', 'distances']]

export async function plan(main) {
  made('h1', main, { text: 'Where to measure' })
  const now = app.project.state.plan ?? {}, form = made('form', main, { className: 'settings' })
  const number = (value, settings) => made('input', null, { type: 'number', step: 'any', min: 0, value: value ?? '', ...settings })
  const kind = choice(form, 'what the instrument reads', KINDS, now.kind ?? (app.project.state.import ? 'probe' : 'position'), () => {})
  const count = field(form, 'poses', number(now.count ?? 20, { step: 1, min: 1 }))
  const noise = field(form, 'its noise, mm', number(now.noise ?? '', { placeholder: '0.02' }))
  const accuracy = field(form, 'or as many as reach, mm', number(now.accuracy))
  const answer = made('section', main, { 'aria-live': 'polite' })
  made('button', form, { className: 'first', text: 'Choose poses' })
  form.onsubmit = event => {
    event.preventDefault()
    attempt(choose)
  }
  const choose = async () => {
    const asked = { kind: kind.value }
    if (accuracy.value) asked.accuracy = +accuracy.value
    else asked.count = +count.value || 20
    if (noise.value) asked.noise = noise.value
    if (!await change(table => { table.plan = asked })) return
    const found = await work('plan', 'choosing poses')
    answer.replaceChildren()
    for (const file of found.files) button(answer, `Save ${file}`, () => save(file), { className: 'first' })
    const split = made('div', answer, { className: 'split' })
    made('pre', split, { text: found.text, tabindex: 0 })
    await draw(made('div', split, { className: 'picture' }), found.view)
  }
}
