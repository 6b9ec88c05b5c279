// Which machine: a file that is dropped, or one that is built in.
import { change, dropping, given } from './app.js'
import { again, app, button, choice, go, made, refresh } from './frame.js'

export async function machine(main) {
  made('h1', main, { text: 'Which machine?' })
  const split = made('div', main, { className: 'split' })
  const picture = made('div', split, { className: 'picture' }), side = made('div', split)
  const about = made('section', side, { 'aria-live': 'polite' })
  dropping(side, 'or drop it anywhere here: printer.cfg, config.g, maslow.yaml, robot.toml, URDF')
  const others = made('div', side)
  made('h2', side, { text: 'or one of these' })
  const built = made('div', side, { className: 'choices' })
  for (const name of app.project.machines) button(built, name, () => given({ builtin: name }))

  const show = async ask => {
    if (!app.project.commands.machine.length) {
      about.replaceChildren()
      picture.replaceChildren()
      return
    }
    const found = await ask('machine', 'reading the machine')
    again(about, () => describe(about, found))
    again(others, () => {
      if (found.machines.length) made('h2', others, { text: 'or of a file of this project' })
      const list = made('div', others, { className: 'choices' })
      for (const name of found.machines) button(list, name, () => given({ files: [name] }))
    })
    if (found.view) await (await import('./picture.js')).draw(picture, found.view)
    else picture.replaceChildren()
  }
  return show
}

function describe(about, found) {
  if (found.name) made('h2', about, { text: found.name })
  if (found.error) made('p', about, { className: 'warn', role: 'alert', text: found.error.message })
  for (const note of found.notes) made('p', about, { className: 'note', text: note })
  const { import: importing } = app.project.state
  if (importing)
    choice(made('div', about), `${importing.file} is of`, [['', 'the firmware that stands in it'], ...found.firmwares.map(one => [one, one])], importing.from ?? '', async firmware => {
      await change(({ import: asked }) => { if (firmware) asked.from = firmware; else delete asked.from }) && await refresh()
    })
  for (const { what, suggestion } of found.findings) made('p', about, { className: 'warn', text: `${what}: ${suggestion}` })
  if (found.error) return
  const next = made('div', about, { className: 'choices' })
  if (found.stored.length)
    button(next, 'Calibrate with what it has stored', async () => {
      await change(table => { table.measured = { files: found.stored } }) && await go('result')
    }, { className: 'first' })
  button(next, 'Plan a measurement', () => go('plan'))
  button(next, 'I have measurements', () => go('measure'))
}
