// What is around the screens: the steps, what is wrong, what is running, the lines for a terminal.
import * as server from './transport.js'

export const STEPS = [['machine', 'Machine'], ['plan', 'Plan'], ['measure', 'Measure'], ['result', 'Result'], ['out', 'Take away']]
export const app = { step: 'machine', project: null, screens: {}, picture: null, times: {} }
const $ = id => document.getElementById(id)

export function made(tag, parent, settings = {}, ...children) {
  const element = document.createElement(tag)
  const { className, text, ...others } = settings
  if (className) element.className = className
  if (text !== undefined) element.textContent = text
  for (const [name, value] of Object.entries(others)) {
    if (name.startsWith('on')) element[name] = value
    else if (value === true) element.setAttribute(name, '')
    else if (value !== false && value !== undefined) element.setAttribute(name, value)
  }
  element.append(...children)
  parent?.append(element)
  return element
}

export function button(parent, text, pressed, settings = {}) {
  return made('button', parent, { type: 'button', text, onclick: () => attempt(pressed), ...settings })
}

export function field(parent, text, control) {
  made('label', parent, { className: 'field' }, made('span', null, { text }), control)
  return control
}

export function choice(parent, text, options, value, changed) {
  const select = made('select', null, { onchange: () => attempt(() => changed(select.value)) })
  for (const [key, words] of options) made('option', select, { value: key, text: words })
  select.value = value
  return field(parent, text, select)
}

export function tick(parent, text, checked, changed) {
  const box = made('input', null, { type: 'checkbox', onchange: () => attempt(() => changed(box.checked)) })
  box.checked = checked
  made('label', parent, { className: 'tick' }, box, made('span', null, { text }))
  return box
}

export function trouble(text) {
  $('trouble').hidden = !text
  $('trouble').textContent = text ?? ''
}

// Whatever fails says why, and everything else stays as it was.
export async function attempt(what) {
  trouble()
  try {
    return await what()
  } catch (error) {
    if (!error.stopped) trouble(error.message)
    return undefined
  }
}

// Work that may take long: words and a bar after a quarter of a second, and a button that ends it.
export async function work(operation, words, given) {
  const bar = $('busy'), began = performance.now()
  let job = null
  bar.firstElementChild.textContent = words
  bar.querySelector('progress').removeAttribute('value')
  const shown = setTimeout(() => { bar.hidden = false }, 250)
  bar.querySelector('button').onclick = () => job && server.cancel(job)
  try {
    for await (const message of await server.run(operation, given)) {
      job ??= message.job
      if (message.progress) bar.firstElementChild.textContent = `${words}: ${message.progress}`
      if (typeof message.share === 'number') bar.querySelector('progress').value = message.share
      if (message.error) throw Object.assign(Error(message.error.message), message.error)
      if (message.result) {
        app.times[operation] = performance.now() - began
        return message.result
      }
    }
    throw Error('the server ended')
  } finally {
    clearTimeout(shown)
    bar.hidden = true
  }
}

let last = Promise.resolve()

// Change the project by a function of a copy of its table, one change after the other; false if
// another tab was first.
export function change(edit) {
  const changed = last.then(() => changing(edit))
  last = changed.catch(() => {})
  return changed
}

async function changing(edit) {
  const table = structuredClone(app.project.state)
  edit(table)
  for (const [name, part] of Object.entries(table)) if (part && typeof part === 'object' && !Object.keys(part).length) delete table[name]
  return taken(await server.change(table, app.project.version))
}

export async function undo() {
  if (await taken(await server.undo(app.project.version))) await go(app.step)
}

async function taken(answer) {
  app.project = answer
  frame()
  if (!answer.late) return true
  await go(app.step)
  trouble('Another tab changed the project. This one now shows it as it is: do it again if you still want to.')
  return false
}

const ready = { machine: () => true, plan: p => p.commands.plan.length, measure: p => p.commands.machine.length, result: p => p.commands.result.length, out: p => p.commands.result.length }

export function frame() {
  const { project } = app
  $('steps').replaceChildren(...STEPS.map(([step, text], k) => {
    const one = button(null, `${k + 1} ${text}`, () => go(step))
    if (step === app.step) one.setAttribute('aria-current', 'step')
    one.disabled = !ready[step](project)
    return made('li', null, {}, one)
  }))
  $('undo').hidden = !project.undo
  $('undo').onclick = () => attempt(undo)
  const lines = project.commands[app.step] ?? []
  $('terminal').hidden = !lines.length
  $('terminal').querySelector('pre').textContent = [project.enter, ...lines].join('\n')
  $('terminal').querySelector('button').onclick = () => attempt(() => navigator.clipboard.writeText($('terminal').querySelector('pre').textContent))
}

export async function go(step, focus = true) {
  if (!ready[step](app.project)) step = 'machine' // as after undo
  app.step = step
  app.picture?.machine?.dispose?.()
  app.picture = null
  frame()
  const main = $('main')
  const screen = made('div', null) // what a screen before still adds is not seen
  main.replaceChildren(screen)
  main.className = step
  if (focus) main.focus({ preventScroll: true })
  await attempt(() => app.screens[step](screen))
}

// A place to drop files, and a button for those who do not drag.
export function dropping(parent, words, taken) {
  const zone = made('div', parent, { className: 'drop' })
  const input = made('input', zone, { type: 'file', id: `files-of-${app.step}`, multiple: true })
  made('label', zone, { for: input.id, className: 'button first', text: 'Choose files' })
  made('p', zone, { text: words })
  const take = files => attempt(async () => {
    const names = []
    for (const file of files) names.push(await server.send(file))
    await taken(names)
  })
  input.onchange = () => take([...input.files])
  zone.ondragover = event => { event.preventDefault(); zone.classList.add('over') }
  zone.ondragleave = () => zone.classList.remove('over')
  zone.ondrop = event => { event.preventDefault(); zone.classList.remove('over'); take([...event.dataTransfer.files]) }
}
