"""The page of a machine: its data, the scripts that move and draw it, the core as WebAssembly.

Everything is in one file that asks for no other. Numbers are JSON; what is large, the WebAssembly
and the machine as it lies in its memory, is compressed and in base64.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.display import printable
from pkmcal.kinematics.robot import Robot
from pkmcal.view import parallel, serial

SCRIPTS = ("algebra", "core", "mover", "arm", "limits", "bodies", "scene", "panel", "start")
_MODULES = {"limbs": "limbs", "chains": "chains", "arm": "arms"}
_DIGITS = 3  # of the ends of the cloud, mm


def html(robot: Robot | SerialArm) -> str:
    """The page of a robot or an arm."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("pkmcal.view", "page"), autoescape=True, undefined=StrictUndefined
    )
    return environment.get_template("view.html.jinja").render(
        title=printable(robot.name), style=Markup(style()), view=Markup(element(machine(robot)))
    )


def machine(robot: Robot | SerialArm) -> dict[str, Any]:
    """A robot or an arm as the scripts take it."""
    found = serial.data(robot) if isinstance(robot, SerialArm) else parallel.data(robot)
    found["name"] = printable(found["name"])
    found["machine"] = packed(found["machine"])
    if "cloud" in found:
        found["cloud"] = _cloud(found["cloud"])
    return found


# Unpacks the scripts and runs them with the element before it and the data.
_LOADER = """<script>
(async root => {
const bytes = Uint8Array.from(atob("%s"), letter => letter.charCodeAt(0))
const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))
const text = await new Response(stream).text()
await new Function("root", "data", text)(root, %s)
})(document.currentScript.previousElementSibling)
</script>
"""


def element(data: dict[str, Any]) -> str:
    """The element of a page that shows the machine, with all that it needs but its style."""
    module = _resource(f"wasm/{_MODULES[data['kind']]}.wasm")
    given = as_script({**data, "wasm": packed(module)})
    return (
        '<div class="pkmcal-view"><p class="without">The machine moves in browsers of 2023 and'
        f" later, with JavaScript.</p></div>\n{_LOADER % (packed(scripts().encode()), given)}"
    )


def as_script(data: object) -> str:
    """Data as JavaScript in a page: no text ends the script or opens a comment in it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def packed(content: bytes) -> str:
    """Bytes, compressed and in base64."""
    return b64encode(zlib.compress(content, 9)).decode()


@cache
def style() -> str:
    """The style sheet of the element."""
    return _squeezed(_text("page/view.css"))


@cache
def scripts() -> str:
    """All scripts of the element, one after the other: the body of a function of root and data."""
    body = "\n".join(_squeezed(_text(f"page/{name}.js")) for name in SCRIPTS)
    return f"'use strict'\n{body}\nreturn start(root, data)"


def _squeezed(text: str) -> str:
    """Without indentation, empty lines, and lines that are a comment."""
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith(("//", "/*")))


def _cloud(points: FloatArray) -> dict[str, Any] | None:
    """Points (N, 3), mm, as 16-bit numbers between their ends."""
    if len(points) < 2:
        return None
    low = points.min(axis=0)
    step = np.maximum(np.ptp(points, axis=0), 1e-9) / 65535
    whole = np.rint((points - low) / step).astype("<u2")
    rounded = (np.round(low, _DIGITS).tolist(), step.tolist())
    return {"low": rounded[0], "step": rounded[1], "points": packed(whole.tobytes())}


def _text(name: str) -> str:
    return _resource(name).decode()


@cache
def _resource(name: str) -> bytes:
    return files("pkmcal.view").joinpath(name).read_bytes()
