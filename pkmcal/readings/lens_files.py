"""Files of a camera's lens: OpenCV's YAML and JSON, and ``camera_info`` of ROS.

OpenCV's YAML has a first line ``%YAML:1.0`` and tags ``!!opencv-matrix`` that libraries for YAML
refuse; of either form no more than numbers, words and lists under names is read here.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray
from pkmcal.exceptions import FileError
from pkmcal.files.atomic import write_whole

_MATRIX = ("camera_matrix", "cameramatrix", "k", "m1", "intrinsic_matrix")
_BENT = (
    "distortion_coefficients", "distortion_coeffs", "distcoeffs", "dist_coeffs", "dist_coeff",
    "dist_coefs", "distortion", "dist", "d", "d1",
)  # fmt: skip
_FISHEYE = "fisheye_model"  # of OpenCV's example of a calibration, beside its own four numbers
_MODEL = ("distortion_model", "camera_model")
_PLAIN = ("", "plumb_bob", "pinhole", "radtan", "brown", "opencv")
_SIGMA = (
    "stddeviationsintrinsics",
    "std_deviations_intrinsics",
    "std_deviation_intrinsics",
    "standard_deviations",
)
_SIGMA_OF_PARTS = (("cameramatrix_std_dev", 4), ("dist_coeffs_std_dev", 5))
_COVARIANCE = "lens_covariance"
_RESOLUTION = "cameraresolution"  # of OpenCV's interactive calibration: width and height
_SIZE = {"width": ("image_width", "width"), "height": ("image_height", "height")}
_ROI = ("x_offset", "y_offset", "width", "height")  # of ROS, in pixels of the whole sensor
_BINNING = ("binning_x", "binning_y")  # of ROS: pixels that are one of a picture; 0 is 1
_DATA = ("data", "matrix", "")  # where numbers of a matrix are; "": in the lines below its name
_APART = 1e-6  # of two focal lengths in proportion, by which they differ nevertheless
_NAMES = ("k1", "k2", "p1", "p2", "k3")
_ENTRY = re.compile(r"^(?P<indent> *)(?:- )?(?P<name>[A-Za-z_][\w. -]*?) *: *(?P<rest>.*)$")
_NAMED = re.compile(r"(?:^|[{,]) *\"?([A-Za-z_][\w.-]*)\"? *:")  # of YAML and JSON
_NUMBER = re.compile(r"[-+]?(?:\.?(?:nan|inf)\b|(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)", re.IGNORECASE)
_NOTHING = ("", "None", "null", "~")


def read_lens(path: str | PathLike[str]) -> dict[str, Any]:
    """Read fx fy cx cy k1 k2 p1 p2 k3; where they are stated width, height and lens_sigma.

    Of ``camera_info`` with binning_x, binning_y or roi they are those of the pictures, not of the
    whole sensor. Standard deviations are those of OpenCV's calibrations, stdDeviationsIntrinsics or
    as its interactive calibration writes them. lens_covariance is (9, 9).

    Raises
    ------
    ValueError
        Naming the file: no camera matrix, numbers missing, or a lens of another kind.
    OSError
        The file cannot be read.
    """
    file = Path(path)
    text = file.read_text(encoding="utf-8", errors="replace")
    if text.lstrip().startswith("<"):
        raise FileError(f"{file}: XML is not read; save the calibration as YAML or JSON")
    try:
        found = json.loads(text) if text.lstrip().startswith("{") else _entries(text)
    except json.JSONDecodeError as error:
        raise FileError(f"{file}, line {error.lineno}: no JSON: {error.msg}") from None
    if not isinstance(found, Mapping):
        raise FileError(f"{file}: expected a camera matrix and its names, found a list")
    known = {str(name).lower().strip(): value for name, value in found.items()}
    where = _Where(file, text)
    model = str(_first(known, _MODEL) or "").strip("\"' ")
    if model.lower() not in _PLAIN:
        raise FileError(
            f"{where(*_MODEL)}:"
            f" distortion model {model!r}: only the numbers k1 k2 p1 p2 k3 of OpenCV are"
            " supported; rectify the images and state the lens of the rectified ones"
        )
    if any(_numbers(known.get(_FISHEYE))):
        raise FileError(
            f"{where(_FISHEYE)}:"
            f" the lens is a fisheye, which the numbers k1 k2 p1 p2 k3 of OpenCV do not"
            " describe; rectify the images and state the lens of the rectified ones"
        )
    if "m1" in known and "m2" in known:
        raise FileError(
            f"{where('m2')}: M1 and M2: two cameras; write a file for each, with camera_matrix and"
            " distortion_coefficients"
        )
    matrix = _list(known, _MATRIX, where)
    if len(matrix) != 9:
        raise FileError(
            f"{where(*_MATRIX)}:"
            f" expected a camera matrix of 9 numbers under {', '.join(_MATRIX[:3])}; found"
            f" {len(matrix)} of {', '.join(map(str, found)) or 'nothing'}"
        )
    if matrix[0] <= 0 or matrix[4] <= 0 or abs(matrix[1]) > 1e-9 * matrix[0]:
        raise FileError(
            f"{where(*_MATRIX)}:"
            f" the camera matrix must have focal lengths above 0 and no skew; found"
            f" {matrix[0]:g}, {matrix[4]:g} and {matrix[1]:g}"
        )
    if not any(matrix[i] for i in (2, 5)) and any(matrix[6:8]):  # column by column: Open3D
        matrix = np.reshape(matrix, (3, 3)).T.ravel().tolist()
    if matrix[6:] != [0.0, 0.0, 1.0]:
        raise FileError(
            f"{where(*_MATRIX)}: the last row of the camera matrix must be 0, 0, 1; found"
            f" {', '.join(f'{each:g}' for each in matrix[6:])}"
        )
    bent = _distortion(known, where)
    if np.any(np.asarray(bent[5:]) != 0.0):
        raise FileError(
            f"{where(*_BENT)}:"
            f" {len(bent)} distortion coefficients (rational, thin prism or tilted): only k1"
            " k2 p1 p2 k3 are supported; calibrate with these, or rectify the images"
        )
    lens: dict[str, Any] = dict(
        zip(("fx", "cx", "fy", "cy"), (matrix[i] for i in (0, 2, 4, 5)), strict=True)
    )
    lens |= dict(zip(_NAMES, bent, strict=False))
    lens |= _size(known)
    sigma = _sigma(known, where)
    if sigma is not None:
        lens["lens_sigma"] = sigma
    return _of_a_part(lens, known, where)


class _Where:
    """The file of a lens and the line of a name in it, as messages begin."""

    def __init__(self, file: Path, text: str) -> None:
        self._file, self._lines = file, dict[str, int]()
        for number, line in enumerate(text.splitlines(), 1):
            for name in _NAMED.findall(line):
                self._lines.setdefault(name.lower(), number)

    def __call__(self, *names: str) -> str:
        """The line of the first of these names that the file has; the file alone without one."""
        line = next((self._lines[each] for each in names if each in self._lines), None)
        return f"{self._file}" if line is None else f"{self._file}, line {line}"


def _size(known: Mapping[str, Any]) -> dict[str, int]:
    """Width and height, those that are stated."""
    resolution, found = _numbers(known.get(_RESOLUTION)), dict[str, int]()
    if len(resolution) == 2:
        found = {"width": int(resolution[0]), "height": int(resolution[1])}
    for name, words in _SIZE.items():
        size = _numbers(_first(known, words))
        if len(size) == 1:
            found[name] = int(size[0])
    return found


def _of_a_part(lens: dict[str, Any], known: Mapping[str, Any], where: _Where) -> dict[str, Any]:
    """The lens of pictures of a part of the sensor, or with pixels put together, as ROS has them.

    Matrix, width and height of ``camera_info`` are those of the whole sensor, pixel by pixel. The
    first of b pixels that are put together has its middle (b - 1)/2 before theirs.
    """
    roi = known.get("roi")
    if isinstance(roi, str) and (inside := roi.strip()).startswith("{"):
        roi = dict(each.partition(":")[::2] for each in inside.strip("{} ").split(","))
        roi = {name.strip(): value.strip() for name, value in roi.items()}
    if roi not in (None, *_NOTHING) and not isinstance(roi, Mapping):
        raise FileError(f"{where('roi')}: roi: expected {', '.join(_ROI)}; found {str(roi)[:60]}")
    part = [_whole(roi, name, f"{where('roi')}: roi: ") for name in _ROI]
    binning = [_whole(known, name, f"{where(name)}: ") or 1 for name in _BINNING]
    covariance = np.eye(9)
    for i, (focal, middle, side) in enumerate((("fx", "cx", "width"), ("fy", "cy", "height"))):
        first, count, together = part[i], part[2 + i], binning[i]
        end = lens.get(side, 0)
        if end and first + count > end:
            raise FileError(
                f"{where('roi')}:"
                f" roi: pixels {first} to {first + count} are not within {side} {end}"
            )
        lens[focal] /= together
        lens[middle] = (lens[middle] - first) / together + 0.5 * (1.0 / together - 1.0)
        covariance[[i, 2 + i], [i, 2 + i]] /= together
        if side in lens:
            lens[side] = (count or end) // together
        elif count:
            lens[side] = count // together
    if "lens_sigma" in lens:
        lens["lens_sigma"] = covariance @ lens["lens_sigma"] @ covariance
    return lens


def _whole(known: Any, name: str, where: str) -> int:
    """A whole number from 0 on under a name; 0 where there is none."""
    value = known.get(name) if isinstance(known, Mapping) else None
    try:
        found = float(0 if value is None or str(value).strip() in _NOTHING else value)
    except (TypeError, ValueError):
        found = -1.0
    if found < 0 or not found.is_integer():
        raise FileError(
            f"{where}{name}: expected a whole number from 0 on; found {str(value).strip()}"
        )
    return int(found)


def _distortion(known: Mapping[str, Any], where: _Where) -> list[float]:
    """Numbers of the distortion; none is stated only where nothing is called so."""
    words = (*_BENT, *_MODEL, *(name for name, _ in _SIGMA_OF_PARTS))
    strange = [name for name in known if name.startswith("dist") and name not in words]
    if strange and not any(name in known for name in _BENT):
        raise FileError(
            f"{where(strange[0])}:"
            f" {strange[0]}: distortion is read under {', '.join(_BENT[:3])}; rename it"
        )
    return _list(known, _BENT, where)


def _list(known: Mapping[str, Any], names: tuple[str, ...], where: _Where) -> list[float]:
    """Return numbers under the first of several names, which must be numbers and no more."""
    name = next((each for each in names if each in known), "")
    value = known.get(name)
    inner = _first(value, _DATA) if isinstance(value, Mapping) else value
    rest = _NUMBER.sub("", str(inner)).strip(" []{}()-,;'\"")
    found = _numbers(value)
    if (value and inner is None) or rest not in _NOTHING or not np.isfinite(found).all():
        raise FileError(
            f"{where(name)}: {name}: expected a list of finite numbers; found {str(value)[:60]}"
        )
    return found


def _sigma(known: Mapping[str, Any], where: _Where) -> FloatArray | None:
    """Uncertainty of the nine numbers: a covariance (9, 9); None where none is stated.

    A focal length that was held in proportion to the other is wrong by as much as that.
    """
    if _COVARIANCE in known:
        found = np.array(_list(known, (_COVARIANCE,), where))
        if found.size != 81:
            raise FileError(
                f"{where(_COVARIANCE)}: {_COVARIANCE} has {found.size} numbers, 9 x 9 are needed"
            )
        return found.reshape(9, 9)
    stated = _list(known, _SIGMA, where)
    if not stated:
        parts = [_list(known, (name,), where) for name, _ in _SIGMA_OF_PARTS]
        if not any(parts):
            return None
        for (name, count), part in zip(_SIGMA_OF_PARTS, parts, strict=True):
            if len(part) != count:
                raise FileError(
                    f"{where(name)}: {name} has {len(part)} numbers, {count} are needed"
                )
        stated = [number for part in parts for number in part]
    sigma = np.array([*stated, *[0.0] * 9][:9])
    if (sigma < 0.0).any():
        raise FileError(
            f"{where(*_SIGMA, *dict(_SIGMA_OF_PARTS))}:"
            f" standard deviations of a lens must be 0 or above"
        )
    covariance = np.diag(sigma**2)
    if (sigma[0] == 0.0) != (sigma[1] == 0.0):
        both = float(sigma[:2].max())
        covariance[:2, :2] = both**2 * (1.0 - _APART * (1.0 - np.eye(2)))
    return covariance


def write_lens(
    path: str | PathLike[str],
    lens: FloatArray,
    size: tuple[int, int],
    places: Mapping[str, FloatArray],
    comment: str = "",
) -> None:
    """Write a lens as OpenCV's FileStorage does.

    Parameters
    ----------
    path : str or path
        The file.
    lens : ndarray (9,)
        fx fy cx cy k1 k2 p1 p2 k3.
    size : (int, int)
        Width and height of pictures, px; 0: not known.
    places : mapping of str to ndarray (4, 4)
        Motions by name, mm.
    comment : str
        Lines, each with its ``#``.
    """
    fx, fy, cx, cy, *bent = lens.tolist()
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    lines = ["%YAML:1.0", "---", *comment.splitlines()]
    if all(size):
        lines += [f"image_width: {size[0]}", f"image_height: {size[1]}"]
    named = {"camera_matrix": matrix, "distortion_coefficients": np.array([bent]).T, **places}
    for name, values in named.items():
        data = ", ".join(f"{value!r}" for value in values.ravel().tolist())
        rows, columns = values.shape
        lines += [
            f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d",
            f"   data: [ {data} ]",
        ]  # fmt: skip
    write_whole(Path(path), "\n".join(lines) + "\n")


def _first(known: Mapping[str, Any], names: tuple[str, ...]) -> Any:
    return next((known[name] for name in names if name in known), None)


def _numbers(value: Any) -> list[float]:
    """Numbers of a list, a list of lists, a matrix with `data`, or a text that shows them."""
    if value is None:
        return []
    if isinstance(value, Mapping):
        return _numbers(_first(value, _DATA))
    if isinstance(value, list):
        return [number for each in value for number in _numbers(each)]
    if isinstance(value, str):
        return [float(re.sub(r"\.(?=[a-zA-Z])", "", each)) for each in _NUMBER.findall(value)]
    return [float(value)]


def _entries(text: str) -> dict[str, Any]:
    """Names of YAML at the outermost level: a text each, or a matrix with the text of its data."""
    found: dict[str, Any] = {}
    top, inner = "", ""
    for line in text.splitlines():
        plain = line.split(" #")[0].rstrip()
        if not plain or plain.lstrip().startswith(("#", "%", "---")):
            continue
        entry = _ENTRY.match(plain)
        if entry is None or (entry["indent"] and inner == "data" and ":" not in plain):
            _add(found, top, inner, plain)
        elif not entry["indent"]:
            top, inner = entry["name"].lower(), ""
            rest = entry["rest"]
            if data := re.search(r"data *: *(\[.*)", rest):
                found[top], inner = {"data": data[1]}, "data"
            elif rest.startswith("!!") or not rest:
                found[top] = {}
            else:
                found[top] = rest
        else:
            inner = entry["name"].lower()
            _add(found, top, inner, entry["rest"])
    return found


def _add(found: dict[str, Any], top: str, inner: str, text: str) -> None:
    """Go on with what stands under a name."""
    if isinstance(found.get(top), dict):
        found[top][inner] = found[top].get(inner, "") + " " + text
    elif top:
        found[top] = f"{found.get(top, '')} {text}"
