// Which machine: a file that is dropped, or one that is built in.
import { app, button, change, dropping, go, made, work } from './frame.js'
import { draw } from './picture.js'

const FIRMWARES = /\.(cfg|g|gcode|ya?ml)$/i
const anew = table => { for (const part of ['measured', 'fit', 'plan', 'export', 'import']) delete table[part] }

export async function machine(main) {
  made('h1', main, { text: 'Which machine?' })
  const split = made('div', main, { className: 'split' })
  const picture = made('div', split, { className: 'picture' }), side = made('div', split)
  const said = made('section', side, { 'aria-live': 'polite' })
  dropping(side, 'or drop it here: printer.cfg, config.g, maslow.yaml, robot.toml, URDF', async ([name]) => {
    await change(table => {
      anew(table)
      if (FIRMWARES.test(name)) {
        table.import = { file: name, out: 'machine' }
        table.machine = { file: 'machine/robot.toml' }
      } else table.machine = { file: name }
    }) && await show()
  })
  made('h2', side, { text: 'or one of these' })
  const built = made('div', side, { className: 'choices' })
  for (const name of app.project.machines)
    button(built, name, async () => { await change(table => { anew(table); table.machine = { builtin: name } }) && await show() })

  const show = async () => {
    if (!app.project.commands.machine.length) return
    const found = await work('machine', 'reading the machine')
    said.replaceChildren()
    made('h2', said, { text: found.name })
    for (const note of found.notes) made('p', said, { className: 'note', text: note })
    for (const { what, suggestion } of found.findings) made('p', said, { className: 'warn', text: `${what}: ${suggestion}` })
    if (found.stored.length)
      button(said, 'Calibrate with what it has stored', async () => {
        await change(table => { table.measured = { files: found.stored } }) && await go('result')
      }, { className: 'first' })
    button(said, 'Plan a measurement', () => go('plan'))
    button(said, 'I have measurements', () => go('measure'))
    await draw(picture, found.view)
  }
  await show()
}
