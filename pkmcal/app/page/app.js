// The window: five screens over one project that the server keeps.
import * as server from './transport.js'
import { app, attempt, frame, go, trouble } from './frame.js'
import { machine } from './machine.js'
import { plan } from './plan.js'
import { measure } from './measure.js'
import { result } from './result.js'
import { out } from './out.js'

Object.assign(app.screens, { machine, plan, measure, result, out })
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
