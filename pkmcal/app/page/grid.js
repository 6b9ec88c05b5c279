// A table whose boxes and buttons are one stop of the Tab key; arrows lead from one to the next, as
// in the grid of w3.org/WAI/ARIA/apg/patterns/grid.
const STEPS = {
  ArrowDown: [1, 0], ArrowUp: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1], PageDown: [10, 0], PageUp: [-10, 0],
}
const FAR = { Home: [-Infinity, 0], End: [Infinity, 0] } // with Ctrl

export function grid(table) {
  const lines = [...table.rows].map(row => [...row.querySelectorAll('input:enabled, button')]).filter(line => line.length)
  const stop = one => { for (const each of lines.flat()) each.tabIndex = each === one ? 0 : -1 }
  const at = (list, k) => list[Math.min(Math.max(k, 0), list.length - 1)]
  table.setAttribute('role', 'grid')
  stop(table.querySelector('tr.named :is(input:enabled, button)') ?? lines[0]?.[0])
  table.addEventListener('focusin', event => stop(event.target))
  table.addEventListener('keydown', event => {
    const row = lines.findIndex(line => line.includes(event.target)), place = lines[row]?.indexOf(event.target)
    const [down, right] = (event.ctrlKey ? FAR : STEPS)[event.key] ?? []
    if (row < 0 || down === undefined) return
    event.preventDefault()
    at(at(lines, row + down), place + right).focus()
  })
}
