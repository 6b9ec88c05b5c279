// The numbers of a machine: found or held, each with a box that refits.
import { app, field, made, attempt } from './frame.js'
import { grid } from './grid.js'

export function numbers(parent, found, before, refit) {
  const wide = made('div', parent, { className: 'wide', tabindex: 0, role: 'region', 'aria-label': 'numbers' })
  const table = made('table', wide)
  made('caption', table, { text: found.of_numbers.caption })
  made('tr', table, {}, ...found.of_numbers.heads.map(text => made('th', null, { text, scope: 'col' })))
  const free = () => app.project.state.fit?.free ?? ['default']
  const fix = () => app.project.state.fit?.fix ?? []
  const box = (cell, name, checked, changed) => {
    const one = made('input', cell, { type: 'checkbox', 'aria-label': `find ${name}` })
    one.checked = checked
    one.onchange = () => attempt(() => refit(changed))
  }
  for (const each of found.numbers) {
    const line = made('tr', table), cell = made('td', line)
    if (found.machine.includes(each.name))
      box(cell, each.name, true, fit => {
        if (free().includes(each.name)) fit.free = free().filter(name => name !== each.name)
        else fit.fix = [...fix(), each.name]
        if (fit.free?.length === 1 && fit.free[0] === 'default') delete fit.free
      })
    const was = before[each.name], now = each.stderr
    const trend = was && now ? (now < 0.98 * was ? 'better' : now > 1.02 * was ? 'worse' : '') : ''
    for (const [k, text] of [each.name, ...each.shown, each.unit, each.knowledge].entries()) made('td', line, { text, className: k === 2 ? trend : '' })
  }
  for (const [name, said] of found.held) {
    const line = made('tr', table)
    box(made('td', line), name, false, fit => { fit.fix = fix().filter(one => one !== name); if (!fit.fix.length) delete fit.fix })
    for (const text of [name, said, '', '', '', '']) made('td', line, { text })
  }
  grid(table)
  const more = made('select', null, { onchange: () => more.value && attempt(() => refit(fit => { fit.free = [...new Set([...free(), more.value])] })) })
  made('option', more, { value: '', text: '…' })
  for (const name of found.others) made('option', more, { value: name, text: name })
  field(parent, 'find another number, too', more)
}
