// What is around the screens: the steps, what is wrong, what is running, the lines for a terminal.
import * as server from './transport.js'

export const STEPS = [...document.querySelectorAll('#steps button')] // painted before anything is asked
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
  control.dataset.key ??= text
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
// Of one operation only what was asked last goes on.
export async function work(operation, words, given) {
  const bar = $('busy'), began = performance.now(), own = {}
  if (running[operation]?.job) server.cancel(running[operation].job)
  running[operation] = own
  bar.firstElementChild.textContent = words
  bar.querySelector('progress').removeAttribute('value')
  const shown = setTimeout(() => { bar.hidden = false }, 250)
  bar.querySelector('button').onclick = () => own.job && server.cancel(own.job)
  try {
    for await (const message of await server.run(operation, given)) {
      own.job ??= message.job
      if (own.job && running[operation] !== own) server.cancel(own.job)
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
    if (running[operation] === own) {
      delete running[operation]
      bar.hidden = !Object.keys(running).length
    }
  }
}

const running = {}
const keyOf = one => `${one.tagName} ${one.id || one.dataset.key || one.getAttribute('aria-label') || one.textContent}`

// Draw again what stands in an element: who is in one of its fields or has scrolled stays there.
export function again(parent, draw) {
  const at = parent.contains(document.activeElement) ? document.activeElement : null
  const of = key => [...parent.querySelectorAll('button, input, select, summary, [tabindex]')].filter(one => keyOf(one) === key)
  const key = at && keyOf(at), place = at && of(key).indexOf(at)
  const typed = at?.tagName === 'INPUT' && at.type !== 'checkbox' && at.value !== at.defaultValue ? at.value : null
  const tops = [...parent.querySelectorAll('.wide')].map(one => one.scrollTop)
  parent.replaceChildren()
  draw()
  parent.querySelectorAll('.wide').forEach((one, k) => { one.scrollTop = tops[k] ?? 0 })
  if (!at) return
  const now = of(key)[place] ?? of(key)[0] ?? parent.querySelector('button, input, select') ?? $('main')
  if (typed !== null && keyOf(now) === key) now.value = typed
  now.focus({ preventScroll: true })
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
  const back = async error => { await refresh(); throw error } // what was ticked or typed is not so
  return taken(await server.change(table, app.project.version).catch(back))
}

async function taken(answer) {
  app.project = answer
  frame()
  if (!answer.late) return true
  await refresh()
  trouble('Another tab changed the project. This one now shows it as it is: do it again if you still want to.')
  return false
}

const ready = {
  machine: () => true, plan: p => p.commands.plan.length, measure: p => p.commands.machine.length,
  result: p => p.commands.result.length, out: p => p.commands.result.length,
}

export function frame() {
  const { project } = app
  document.title = `${project.folder.split(/[\\/]/).pop()} – pkmcal`
  for (const one of STEPS) {
    const { step } = one.dataset
    one.onclick = () => attempt(() => go(step))
    if (step === app.step) one.setAttribute('aria-current', 'step')
    else one.removeAttribute('aria-current')
    one.disabled = !ready[step](project)
  }
  $('undo').hidden = !project.undo
  $('undo').onclick = () => attempt(async () => {
    said([])
    if (await taken(await server.undo(app.project.version))) await refresh()
  })
  const lines = project.commands[app.step] ?? []
  $('terminal').hidden = !lines.length
  $('terminal').querySelector('pre').textContent = [project.enter, ...lines].join('\n')
  $('terminal').querySelector('button').onclick = () => attempt(() => navigator.clipboard.writeText($('terminal').querySelector('pre').textContent))
}

// Show a screen; the browser's way back leads to the one before, and a reload shows it again.
export async function go(step, focus = true, keep = false) {
  if (!ready[step](app.project)) step = 'machine' // as after undo
  if (step !== app.step) said([])
  if (!keep && `#${step}` !== location.hash) history.pushState(null, '', `#${step}`)
  app.step = step
  app.refresh = null
  app.picture?.machine?.dispose?.()
  app.picture = null
  frame()
  const main = $('main')
  const screen = made('div', null) // what a screen before still adds is not seen
  main.replaceChildren(screen)
  main.className = step
  if (focus) main.focus({ preventScroll: true })
  await attempt(async () => {
    const show = await app.screens[step](screen)
    if (app.step === step && screen.isConnected) app.refresh = show
  })
}

// Show the project as it is now; the screen stays, unless it has nothing to do any more.
export async function refresh() {
  frame()
  if (app.refresh && ready[app.step](app.project)) await attempt(app.refresh)
  else await go(app.step, false)
}

// What is said of files that were given.
export function said(lines) {
  $('said').replaceChildren(...lines.filter(Boolean).map(text => made('p', null, { text })))
  $('said').hidden = !$('said').children.length
}
