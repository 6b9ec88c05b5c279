// The window: five screens over one project that the server keeps.
import * as server from './transport.js'
import { STEPS, app, attempt, frame, go, trouble } from './frame.js'

// each screen is fetched when it is first shown
for (const [step] of STEPS) app.screens[step] = async main => (await import(`./${step}.js`))[step](main)
window.workbench = app // what tests ask
addEventListener('unhandledrejection', event => trouble(event.reason?.message ?? String(event.reason)))

attempt(async () => {
  app.project = await server.state()
  frame()
  await go(app.project.commands.result.length ? 'result' : 'machine', false)
  document.body.dataset.ready = ''
  for await (const message of server.changes()) {
    if (message.changed === app.project.version) continue
    app.project = await server.state()
    await go(app.step, false)
  }
})
