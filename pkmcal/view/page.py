"""The page of a machine: its data, the scripts that move and draw it, the core as WebAssembly.

Everything is in one file that asks for no other. Numbers are JSON; what is large, the WebAssembly
and the machine as it lies in its memory, is compressed and in base64.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from hashlib import sha256
from typing import Any

import numpy as np

from pkmcal.arms.arm import SerialArm
from pkmcal.arrays import FloatArray
from pkmcal.display import printable
from pkmcal.kinematics.robot import Robot
from pkmcal.screw import to_pose
from pkmcal.view import parallel, serial
from pkmcal.view.scripts import MODULES, resource, scripts, style

_DIGITS = 3  # of the ends of the cloud, mm


def html(robot: Robot | SerialArm, poses: FloatArray | None = None) -> str:
    """The page of a robot, with poses (N, 6) to visit, or of an arm, with coordinates (N, n)."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("pkmcal.view", "page"), autoescape=True, undefined=StrictUndefined
    )
    data = machine(robot)
    if poses is not None:
        data["places"] = places("poses", robot, poses)
    return environment.get_template("view.html.jinja").render(
        title=printable(robot.name), style=Markup(style()), view=Markup(element(data))
    )


def beyond(robot: Robot | SerialArm) -> str:
    """List parts of a robot or an arm that the page cannot draw; empty where there are none."""
    return "" if isinstance(robot, SerialArm) else parallel.beyond(robot.model)


def machine(robot: Robot | SerialArm, cloud: bool = True) -> dict[str, Any]:
    """A robot or an arm as the scripts take it; of a robot with a cloud of its workspace."""
    found = serial.data(robot) if isinstance(robot, SerialArm) else parallel.data(robot, cloud)
    found["name"] = printable(found["name"])
    found["machine"] = packed(found["machine"])
    if "cloud" in found:
        found["cloud"] = _cloud(found["cloud"])
    return found


_ELEMENT = (
    '<div class="pkmcal-view"><p class="without">The machine moves in browsers of 2023 and later,'
    " with JavaScript.</p></div>\n"
)
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


def places(
    name: str, robot: Robot | SerialArm, poses: FloatArray, q: FloatArray | None = None
) -> dict[str, Any]:
    """Poses (N, 6) that the page goes to one by one; of an arm joint coordinates (N, n)."""
    if isinstance(robot, SerialArm):
        q = poses
        poses = to_pose(robot.rigid.forward(poses))  # as the page has it
    found: dict[str, Any] = {"name": name, "poses": poses.tolist()}
    return found if q is None else found | {"q": q.tolist()}


def element(data: dict[str, Any]) -> str:
    """The element of a page that shows the machine, with all that it needs but its style."""
    return _ELEMENT + _LOADER % (packed(scripts(*_more(data)).encode()), _given(data))


def plain_element(data: dict[str, Any]) -> tuple[str, str]:
    """Return a page's element without other scripts, and the hash by which its policy names it.

    The scripts are as they are, for unpacking them would take the right to run any text.
    """
    run = f"\n(async (root, data) => {{\n{scripts(*_more(data))}\n}})"
    run += f"(document.currentScript.previousElementSibling, {_given(data)})\n"
    digest = b64encode(sha256(run.encode()).digest()).decode()
    return f"{_ELEMENT}<script>{run}</script>\n", f"sha256-{digest}"


def _more(data: dict[str, Any]) -> list[str]:
    """Scripts that not every page needs."""
    return [name for name in ("calibration", "cameras", "stiffness") if data.get(name)]


def _given(data: dict[str, Any]) -> str:
    module = resource(f"wasm/{MODULES[data['kind']]}.wasm")
    return as_script({**data, "wasm": packed(module)})


def as_script(data: object) -> str:
    """Data as JavaScript in a page: no text ends the script or opens a comment in it."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def packed(content: bytes) -> str:
    """Bytes, compressed and in base64."""
    return b64encode(zlib.compress(content, 9)).decode()


def _cloud(points: FloatArray) -> dict[str, Any] | None:
    """Points (N, 3), mm, as 16-bit numbers between their ends."""
    if len(points) < 2:
        return None
    low = points.min(axis=0)
    step = np.maximum(np.ptp(points, axis=0), 1e-9) / 65535
    whole = np.rint((points - low) / step).astype("<u2")
    rounded = (np.round(low, _DIGITS).tolist(), step.tolist())
    return {"low": rounded[0], "step": rounded[1], "points": packed(whole.tobytes())}
