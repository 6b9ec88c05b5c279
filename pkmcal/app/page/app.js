// The window: five screens over one project that the server keeps, and files that are given to it.
import * as server from './transport.js'
import { STEPS, app, attempt, change, frame, go, made, refresh, said, trouble, work } from './frame.js'

// each screen is fetched when it is first shown
for (const { dataset: { step } } of STEPS) app.screens[step] = async main => (await import(`./${step}.js`))[step](main)
window.workbench = app // what tests ask
addEventListener('unhandledrejection', event => trouble(event.reason?.message ?? String(event.reason)))

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
  if (app.project.trouble) trouble(app.project.trouble)
  const first = stepOf(location.hash) ?? (app.project.commands.result.length ? 'result' : 'machine')
  history.replaceState(null, '', `#${first}`)
  await go(first, false)
  document.body.dataset.ready = ''
  for await (const message of server.changes()) {
    if (message.changed === app.project.version) continue
    app.project = await server.state()
    await refresh()
  }
  throw Error(server.ENDED)
})

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
  const found = await work('take', 'looking at what it is', what)
  if (!await change(table => { for (const part of Object.keys(table)) delete table[part]; Object.assign(table, found.state) })) return
  said([...kept, ...found.said])
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
