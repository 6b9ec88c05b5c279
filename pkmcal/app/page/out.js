// What is taken away: the changed configuration, the calibrated machine, the report.
import { change, said } from './app.js'
import { again, app, attempt, button, choice, field, frame, made, refresh, work } from './frame.js'
import { save } from './transport.js'

export async function out(main) {
  made('h1', main, { text: 'Take it away' })
  const lines = made('section', main), list = made('ul', main, { className: 'files' }), more = made('div', main, { className: 'settings' })
  made('h2', main, { text: 'A report' })
  const form = made('form', main, { className: 'settings' }), reports = made('ul', main, { className: 'files' })
  let fields = null

  const certificate = statements => {
    fields = Object.fromEntries(Object.entries(statements).map(([name, value]) => [name, field(form, name, made('input', null, { size: 18, value }))]))
    made('p', form, { className: 'note', text: 'Leave these empty for a report without a certificate.' })
    made('button', form, { text: 'Write the report' })
    form.onsubmit = event => {
      event.preventDefault()
      attempt(async () => {
        const stated = Object.fromEntries(Object.entries(fields).map(([name, input]) => [name, input.value]).filter(([, value]) => value))
        const found = await work('report', 'writing the report', { certificate: stated })
        again(reports, () => found.files.forEach(one => offer(reports, one)))
      })
    }
  }

  const show = async ask => {
    const found = await ask('out', 'writing')
    app.project.commands.out = found.commands
    frame()
    again(lines, () => changes(lines, found.changed))
    const set = async edit => {
      await change(table => {
        const targets = edit(table.export?.as ?? [])
        table.export = targets.length ? { as: targets } : {}
      }) && await refresh()
    }
    said(found.said)
    again(list, () => found.files.forEach(one => {
      const item = offer(list, one)
      if (one.target) button(item, `remove ${one.target}`, () => set(now => now.filter(name => name !== one.target)))
    }))
    again(more, () => choice(more, 'for another controller', [['', '…'], ...found.targets], '', target => target && set(now => [...now, target])))
    if (!fields) certificate(found.certificate)
  }
  return show
}

function changes(section, changed) {
  if (!changed.length) return
  made('h2', section, { text: 'What changes in your configuration' })
  const text = made('pre', section, { className: 'diff', tabindex: 0 })
  for (const line of changed) made('span', text, { className: line[0] === '+' ? 'new' : line[0] === '-' ? 'old' : '', text: `${line}\n` })
}

function offer(list, { file, what }) {
  const item = made('li', list)
  if (file) button(item, `Save ${file}`, () => save(file), { className: 'first', 'data-file': file })
  made('span', item, { text: what })
  return item
}
