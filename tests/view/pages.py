"""Pages of machines in Chromium: scripts move them, and Python reads what they say."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pkmcal as pk
from pkmcal.view import page

from .. import browser

# Waits for the machines, moves each as its list says, and writes what it then is into the page.
_DRIVER = """<pre id="said"></pre><script>
(async () => {
const moves = %s, said = []
const roots = [...document.querySelectorAll(".pkmcal-view")]
while (roots.some(root => !root.machine)) await new Promise(next => setTimeout(next, 20))
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


def said(
    folder: Path, robots: Sequence[Any], moves: Sequence[Sequence[Sequence[Any]]], **settings: Any
) -> list[list[dict[str, Any]]]:
    """Of each machine what it is at first and after each of its moves."""
    elements = "".join(page.element(page.machine(robot)) for robot in robots)
    text = f"<!doctype html><meta charset='utf-8'><style>{page.style()}</style>{elements}"
    file = folder / "machines.html"
    file.write_text(text + _DRIVER % page.as_script(moves), encoding="utf-8")
    seen = browser.dump(file, **settings)
    found = re.search(r'<pre id="said">(.*?)</pre>', seen.dom, re.DOTALL)
    assert found and found[1] and not found[1].startswith("failed"), (
        found and found[1],
        seen.console,
    )
    assert not seen.console
    result: list[list[dict[str, Any]]] = json.loads(html.unescape(found[1]))
    return result


def loaded(names: Sequence[str]) -> Mapping[str, Any]:
    """Built-in machines by name."""
    return {name: pk.load(name) for name in names}
