// The server's answers. Everything that leaves the page goes through here.
const fragment = new URLSearchParams(location.hash.slice(1))
if (fragment.get('t')) {
  localStorage.setItem('token', fragment.get('t'))
  history.replaceState(null, '', location.pathname)
}
addEventListener('hashchange', () => location.hash.startsWith('#t=') && location.reload()) // opened again
const tab = crypto.randomUUID()
const headers = { 'x-pkmcal-token': localStorage.getItem('token') ?? '', 'x-pkmcal-tab': tab }

let again = 'pkmcal app' // what starts it again
export const ended = () => Error(`The server of this window does not answer: it has ended, as by Ctrl-C in its terminal. Your project is kept in its folder. To go on, type in a terminal: ${again}`)

const PATIENCE = 5000 // ms for the head of an answer; a large file takes its time

async function ask(path, settings = {}) {
  const silent = now => dispatchEvent(new CustomEvent('silent', { detail: now }))
  const late = settings.method === 'PUT' ? 0 : setTimeout(() => silent(true), PATIENCE)
  const answer = await fetch(path, { ...settings, headers }).finally(() => { clearTimeout(late); silent(false) }).catch(() => { throw settings.method === 'PUT' ? Error(`This cannot be read, or the server ended: ${settings.body.name}`) : ended() })
  if (answer.status === 401) throw Error('This page has no right to this server: open it from the terminal again.')
  if (!answer.ok && (answer.status !== 409 || path.startsWith('/api/live'))) throw Error((await answer.json().catch(() => ({}))).error ?? `${answer.status}`)
  return answer
}

const post = (path, data, signal) => ask(path, { method: 'POST', body: JSON.stringify(data ?? {}), signal })

export async function state() {
  const answer = await (await ask('/api/state')).json()
  again = answer.again
  return answer
}

export const core = async kind => packed(await (await ask(`/wasm/${kind}`)).arrayBuffer())
export const cancel = job => post(`/api/cancel/${job}`)

// The new state, and whether another tab was first.
export async function change(table, version) {
  const answer = await post('/api/state', { state: table, version })
  return { ...(await answer.json()), late: answer.status === 409 }
}

export async function undo(version) {
  const answer = await post('/api/undo', { version })
  return { ...(await answer.json()), late: answer.status === 409 }
}

export async function send(file) {
  const answer = await ask(`/api/file/${encodeURIComponent(file.name || 'file')}`, { method: 'PUT', body: file })
  return answer.json() // its name here, and what there is to say
}

export const run = (operation, given, signal) => post(`/api/run/${operation}`, given, signal).then(lines)

// A measurement with a machine: what happens, line by line, and what is said to it.
export const measuring = asked => post('/api/live', asked).then(lines)
export const start = name => post(`/api/live/${name}/start`)
export const typed = (name, number, text) => post(`/api/live/${name}/type`, { number, text })
export const stop = () => post('/api/live/stop')

// The versions that other tabs make, and the one that is there when this begins.
export async function* changes() {
  for await (const { version, changed, by } of lines(await ask('/api/events'))) if (version || by !== tab) yield version ?? changed
}

export async function save(path) {
  const answer = await ask(`/api/download/${path.split('/').map(encodeURIComponent).join('/')}`)
  const link = document.createElement('a')
  link.href = URL.createObjectURL(await answer.blob())
  link.download = path.split('/').pop()
  link.click()
  setTimeout(() => URL.revokeObjectURL(link.href), 60000)
}

async function* lines(answer) {
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader()
  let rest = ''
  for (;;) {
    const { value, done } = await reader.read().catch(() => ({ done: true }))
    if (done) return
    const parts = (rest + value).split('\n')
    rest = parts.pop()
    for (const part of parts) if (part) yield JSON.parse(part)
  }
}

// As the scripts of a machine take their core: compressed and in base64.
async function packed(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream('deflate'))
  const small = new Uint8Array(await new Response(stream).arrayBuffer())
  let text = ''
  for (let k = 0; k < small.length; k += 4096) text += String.fromCharCode(...small.subarray(k, k + 4096))
  return btoa(text)
}
