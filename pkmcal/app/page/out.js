// What is taken away: the changed configuration, the calibrated machine, the report.
import { app, attempt, button, change, choice, field, frame, made, work } from './frame.js'
import { save } from './transport.js'

const STATEMENTS = ['machine', 'serial', 'customer', 'operator', 'date', 'instrument', 'temperature', 'method']

export async function out(main) {
  made('h1', main, { text: 'Take it away' })
  const found = await work('out', 'writing')
  app.project.commands.out = found.commands
  frame()
  const lines = made('section', main)
  if (found.changed.length) {
    made('h2', lines, { text: 'What changes in your configuration' })
    const text = made('pre', lines, { className: 'diff', tabindex: 0 })
    for (const line of found.changed) made('span', text, { className: line[0] === '+' ? 'new' : line[0] === '-' ? 'old' : '', text: `${line}\n` })
  }
  const list = made('ul', main, { className: 'files' })
  const offer = ({ file, what }) => {
    const item = made('li', list)
    if (file) button(item, `Save ${file}`, () => save(file), { className: 'first', 'data-file': file })
    made('span', item, { text: what })
  }
  found.files.forEach(offer)

  made('h2', main, { text: 'A report' })
  const form = made('form', main, { className: 'settings' })
  const fields = Object.fromEntries(STATEMENTS.map(name => [name, field(form, name, made('input', null, { size: 18 }))]))
  made('p', form, { className: 'note', text: 'Leave these empty for a report without a certificate.' })
  made('button', form, { text: 'Write the report' })
  form.onsubmit = event => {
    event.preventDefault()
    attempt(write)
  }
  const write = async () => {
    const stated = Object.fromEntries(STATEMENTS.filter(name => fields[name].value).map(name => [name, fields[name].value]))
    const made_ = await work('report', 'writing the report', { certificate: stated })
    made_.files.forEach(offer)
  }
  const extra = made('div', main, { className: 'settings' })
  const there = new Set(app.project.state.export?.as ?? [])
  choice(extra, 'for another controller', [['', '…'], ...found.targets.filter(([key]) => !there.has(key))], '', async target => {
    if (target && await change(table => { table.export = { as: [...there, target] } })) await app.screens.out((main.replaceChildren(), main))
  })
}
