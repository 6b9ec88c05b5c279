// What is around the screens: the steps, what is wrong, what is running, the lines for a terminal.
import * as server from './transport.js'

export const STEPS = [...document.querySelectorAll('#steps button')] // painted before anything is asked
export const app = { step: 'machine', project: null, screens: {}, show: null, picture: null }
export const $ = id => document.getElementById(id)
const main = $('main')

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

export const trouble = text => Object.assign($('trouble'), { hidden: !text, textContent: text ?? '' })

// Whatever fails says why, and everything else stays as it was.
export async function attempt(what) {
  trouble()
  try {
    return await what()
  } catch (error) {
    if (!error.left) trouble(error.stopped ? STOPPED : error.message)
  }
}

const STOPPED = 'Stopped: what stands here is as it was before. Press the step again to go on.'
const running = new Set() // works under way; the bar is of the last of them

// Work that may take long: words and a bar after a quarter of a second, and a button that ends it.
export async function work(operation, words, given, own = {}) {
  const request = new AbortController()
  const end = how => {
    own.ended ??= Object.assign(Error('stopped'), how)
    if (own.job) server.cancel(own.job)
    request.abort()
  }
  Object.assign(own, { words, end })
  running.add(own)
  const shown = setTimeout(() => { own.long = true; busy() }, 250)
  try {
    for await (const message of await server.run(operation, given, request.signal)) {
      if (own.ended) break
      own.job ??= message.job
      if (message.progress) Object.assign(own, { words: `${words}: ${message.progress}`, share: message.share })
      busy()
      if (message.error) throw Object.assign(Error(message.error.message), message.error)
      if (message.result) return message.result
    }
    throw server.ended()
  } catch (error) {
    throw own.ended ?? error
  } finally {
    clearTimeout(shown)
    running.delete(own)
    busy()
  }
}

function busy() {
  const bar = $('busy'), own = [...running].filter(one => one.long).pop()
  bar.hidden = !own
  if (!own) return
  const [text, progress, stop] = bar.children
  text.textContent = own.words
  if (typeof own.share === 'number') progress.value = own.share
  else progress.removeAttribute('value')
  stop.onclick = () => running.forEach(one => one.end({ stopped: true })) // they wait for each other
}

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
  const now = of(key)[place] ?? of(key)[0] ?? parent.querySelector('button, input, select') ?? main
  if (typed !== null && keyOf(now) === key) now.value = typed
  now.focus({ preventScroll: true })
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
  const lines = project.commands[app.step] ?? []
  $('terminal').hidden = !lines.length
  $('terminal').querySelector('pre').textContent = [project.enter, ...lines].join('\n')
  $('terminal').querySelector('button').onclick = () => attempt(() => navigator.clipboard.writeText($('terminal').querySelector('pre').textContent))
}

let turn = 0, shown = Promise.resolve(), asked = null, building = null

// Show a screen; the browser's way back leads to the one before, and a reload shows it again.
export async function go(step, focus = true, keep = false) {
  if (!ready[step](app.project)) step = 'machine' // as after undo
  if (step !== app.step) $('said').hidden = true
  if (!keep && `#${step}` !== location.hash) history.pushState(null, '', `#${step}`)
  leave()
  Object.assign(app, { step, show: null })
  app.picture?.machine?.dispose?.()
  app.picture = null
  frame()
  const screen = made('div', null)
  main.replaceChildren(screen)
  main.className = step
  if (focus) main.focus({ preventScroll: true })
  const mine = building = attempt(async () => {
    const show = await app.screens[step](screen) // what stands there whatever the project is
    if (!screen.isConnected) return
    app.show = show
    await showing()
  })
  await mine
  if (building !== mine) return
  building = null
  if (!app.show) main.ariaBusy = false // it could not be fetched
}

// Show the project as it is now; the screen stays, unless it has nothing to do any more.
export async function refresh() {
  frame()
  if (!ready[app.step](app.project)) await go('machine', false)
  else if (app.show) await showing()
  else if (building) await building // it shows what is there by then
  else await go(app.step, false)
}

// A screen is drawn once at a time, and last of what was asked last: what is under way is left.
function showing() {
  const mine = leave()
  shown = shown.then(async () => {
    if (mine !== turn) return
    const ask = (operation, words, given) => work(operation, words, given, asked = {})
    const done = await attempt(() => app.show(ask).then(() => true))
    if (mine !== turn) return
    main.toggleAttribute('data-before', !done) // what stands there is older
    main.ariaBusy = false
  })
  return shown
}

function leave() {
  if (running.has(asked)) asked.end({ left: true })
  main.ariaBusy = true
  return ++turn
}
