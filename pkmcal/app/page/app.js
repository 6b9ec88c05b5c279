// The window: five screens over one project that the server keeps, and files that are given to it.
import * as server from './transport.js'
import { $, STEPS, app, attempt, frame, go, made, refresh, trouble, work } from './frame.js'

// each screen is fetched when it is first shown
for (const { dataset: { step } } of STEPS) app.screens[step] = async main => (await import(`./${step}.js`))[step](main)
window.workbench = app // what tests ask
addEventListener('unhandledrejection', event => trouble(event.reason?.message ?? String(event.reason)))

const HALTED = 'The server of this window does not answer. If it was halted in its terminal, as by Ctrl-Z, it goes on there by fg; nothing is lost.'
addEventListener('silent', ({ detail }) => {
  if (detail) trouble(HALTED)
  else if ($('trouble').textContent === HALTED) trouble()
})

const stepOf = hash => STEPS.find(one => `#${one.dataset.step}` === hash)?.dataset.step
addEventListener('popstate', () => app.project && go(stepOf(location.hash) ?? 'machine', true, true))

// a file that misses its place must not take the page's
addEventListener('dragover', event => { event.preventDefault(); document.body.classList.add('over') })
addEventListener('dragleave', event => { if (!event.relatedTarget) document.body.classList.remove('over') })
addEventListener('drop', event => {
  event.preventDefault()
  document.body.classList.remove('over')
  take([...event.dataTransfer.files])
})

attempt(async () => {
  app.project = await server.state()
  frame()
  $('undo').onclick = () => attempt(async () => {
    said([])
    if (await settled(inTurn(() => taken(server.undo(app.project.version))))) await refresh()
  })
  const first = stepOf(location.hash) ?? (app.project.commands.result.length ? 'result' : 'machine')
  history.replaceState(null, '', `#${first}`)
  const told = attempt(follow) // also while the first screen is begun
  await go(first, false)
  if (app.project.trouble) trouble(app.project.trouble)
  document.body.dataset.ready = ''
  await told
})

// Show what other tabs change.
async function follow() {
  for await (const version of server.changes()) {
    if (version > app.project.version) await look()
  }
  throw server.ended()
}

// Who comes back from an editor sees what was written there.
addEventListener('focus', () => app.project && look().catch(() => {})) // a server that ended has said so

async function look() {
  const { version } = app.project
  newest(await server.state())
  if (version < app.project.version) refresh()
}

// Answers may come late: none takes the place of a newer one.
function newest(answer) {
  if (answer.version >= app.project.version) app.project = answer
}

let last = Promise.resolve()

function inTurn(what) {
  const done = last.then(what)
  last = done.catch(() => {})
  return done
}

// Change the project by a function of a copy of its table, one change after the other, each of what
// the one before has left; false if another tab was first.
export function change(edit) {
  return settled(inTurn(async () => {
    const { state, version } = app.project, table = structuredClone(state)
    await edit(table)
    for (const [name, part] of Object.entries(table)) if (part && typeof part === 'object' && !Object.keys(part).length) delete table[name]
    return taken(server.change(table, version))
  }))
}

async function taken(asked) {
  const answer = await asked.catch(failed => ({ failed }))
  if (!answer.failed) newest(answer)
  return answer
}

async function settled(changed) {
  const { failed, late } = await changed
  if (failed || late) await refresh() // what was ticked or typed is not so
  else frame()
  if (failed) throw failed
  if (late) trouble('The project was changed elsewhere, in another tab or in its file. This window now shows it as it is: do it again if you still want to.')
  return !late
}

// What is said of files that were given.
export function said(lines) {
  $('said').replaceChildren(...lines.filter(Boolean).map(text => made('p', null, { text })))
  $('said').hidden = !$('said').children.length
}

// Take files into the project, whatever they are and wherever they were dropped.
export const take = files => attempt(async () => {
  if (!files.length) return
  const names = [], kept = []
  for (const file of files) {
    const sent = await server.send(file)
    names.push(sent.name)
    kept.push(sent.said)
  }
  await given({ files: names }, kept)
})

export async function given(what, kept = []) {
  let told = []
  const done = await change(async table => {
    const found = await work('take', 'looking at what it is', what)
    for (const part of Object.keys(table)) delete table[part]
    Object.assign(table, found.state)
    told = found.said
  })
  if (!done) return
  said([...kept, ...told])
  await refresh()
}

// A button for those who do not drag; files may be dropped anywhere in the window.
export function dropping(parent, words) {
  const zone = made('div', parent, { className: 'drop' })
  const input = made('input', zone, { type: 'file', id: `files-of-${app.step}`, multiple: true })
  made('label', zone, { for: input.id, className: 'button first', text: 'Choose files' })
  made('p', zone, { text: words })
  input.onchange = () => { const files = [...input.files]; input.value = ''; return take(files) }
}
