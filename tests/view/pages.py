"""Pages of machines in Chromium: scripts move them, and Python reads what they say."""

from __future__ import annotations

import dataclasses
import html
import json
import re
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from pkmcal.view import page, scripts

from .. import browser

# Waits for the machines, moves each as its list says, and writes what it then is into the page.
_DRIVER = """<pre id="said"></pre><script>
(async () => {
const moves = %s, said = []
const roots = [...document.querySelectorAll(".pkmcal-view")]
while (roots.some(root => !root.machine)) await new Promise(next => setTimeout(next, 5))
for (const [k, root] of roots.entries()) {
  const { mover, changed, limits } = root.machine
  const tell = () => said[k].push({ pose: mover.pose, own: mover.own, q: mover.q,
    stopped: mover.stopped, mode: mover.mode, conditioning: mover.conditioning(),
    limits: limits(), text: root.innerText })
  said.push([])
  tell()
  for (const [name, ...values] of moves[k]) { mover[name](...values); changed(); tell() }
}
document.getElementById("said").textContent = JSON.stringify(said)
})().catch(error => { document.getElementById("said").textContent = "failed: " + error })
</script>"""


# A page unpacks in the background while its clock runs ahead to the end of the budget. Scripts that
# look every few ms of that clock whether it is ready keep the end away, for minutes if need be.
_BUDGET = "--virtual-time-budget=1000000"
_WAIT = """
const wait = () => document.querySelector(".pkmcal-view.moves") || setTimeout(wait, 5)
wait()
"""


def dumped(file: Path) -> browser.Seen:
    """The document of a page with a script that waits for its machine."""
    return browser.look(file, "--dump-dom", "--window-size=1000,800", _BUDGET)


def started(file: Path) -> browser.Seen:
    """The document of a page, without its scripts, once its machine has started, by its own policy.

    That names what may run by hash in a report: what waits is named beside it.
    """
    text = file.read_text(encoding="utf-8")
    digest = b64encode(sha256(_WAIT.encode()).digest()).decode()
    text = text.replace("script-src 'sha256-", f"script-src 'sha256-{digest}' 'sha256-")
    other = file.with_name("waits.html")
    other.write_text(text.replace("</body>", f"<script>{_WAIT}</script></body>"), encoding="utf-8")
    seen = dumped(other)
    without = re.sub(r"<script.*?</script>", "", seen.dom, flags=re.DOTALL)
    return dataclasses.replace(seen, dom=without)


def said(
    folder: Path, robots: Sequence[Any], moves: Sequence[Sequence[Sequence[Any]]]
) -> list[list[dict[str, Any]]]:
    """Of each machine what it is at first and after each of its moves."""
    elements = "".join(page.element(page.machine(robot)) for robot in robots)
    text = f"<!doctype html><meta charset='utf-8'><style>{scripts.style()}</style>{elements}"
    file = folder / "machines.html"
    file.write_text(text + _DRIVER % page.as_script(moves), encoding="utf-8")
    seen = dumped(file)
    found = re.search(r'<pre id="said">(.*?)</pre>', seen.dom, re.DOTALL)
    assert found and found[1] and not found[1].startswith("failed"), (
        found and found[1],
        seen.console,
    )
    assert not seen.console
    result: list[list[dict[str, Any]]] = json.loads(html.unescape(found[1]))
    return result
