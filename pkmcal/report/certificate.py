"""Statements of a certificate beside the report: who, what, with what, how uncertain."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from pkmcal.arrays import FloatArray, rms
from pkmcal.calibration.identification import Identification
from pkmcal.core.library import POSE
from pkmcal.effects.expansion import REFERENCE, coefficients, temperatures
from pkmcal.estimation.identifiability import listed
from pkmcal.estimation.uncertainty import stated_variances
from pkmcal.exceptions import ArgumentError
from pkmcal.files import reading
from pkmcal.files.toml_lines import Source
from pkmcal.files.toml_table import Table
from pkmcal.statistics.budget import Budget, Contribution, standard
from pkmcal.statistics.noise import SIGNIFICANT

_TEXTS = (
    "number", "customer", "machine", "manufacturer", "serial", "operator", "place", "method",
    "remarks",
)  # fmt: skip
_INSTRUMENT = ("name", "serial", "certificate", "expanded", "factor", "noise")
_TEMPERATURE = ("mean", "uncertainty", "expansion", "expansion_uncertainty")
_NOWHERE = np.empty(0)
_ROUNDED = 0.1  # K, to which temperatures are stated


@dataclass(frozen=True)
class Statement:
    """The content of a certificate's file.

    Attributes
    ----------
    texts : dict
        Number, customer, machine, manufacturer, serial, operator, place, date, method, remarks:
        "" where not stated, which is then left for the pen.
    instrument : dict
        Name, serial and certificate of the instrument.
    expanded, factor : float
        Expanded uncertainty of a coordinate it reads, mm, and its coverage factor; NaN: not stated.
    noise : float
        Standard deviation of what it reads again at one place, mm, which is part of that; NaN: not
        stated.
    temperature : float
        Mean of the machine during the measurement, °C; NaN: not stated.
    temperature_uncertainty : float
        Half width of its range, K.
    expansion, expansion_uncertainty : float
        Coefficient of thermal expansion and half width of its range, 1/K.
    datum : float
        Standard uncertainty of where the frame lies, mm.
    """

    texts: dict[str, str] = field(default_factory=dict)
    instrument: dict[str, str] = field(default_factory=dict)
    expanded: float = float("nan")
    factor: float = 2.0
    noise: float = float("nan")
    temperature: float = float("nan")
    temperature_uncertainty: float = 0.0
    expansion: float = float("nan")
    expansion_uncertainty: float = 0.0
    datum: float = 0.0


def read(path: str | PathLike[str]) -> Statement:
    """Read the TOML file of a certificate; all its keys may be left out.

    Raises
    ------
    ValueError
        An unknown key, a number where a text is needed, or below zero: one line with file and line.
    """
    source = Source(reading.content(path, reading.MOST_ROBOT), str(path))
    top = Table(source.data, source)
    top.only((*_TEXTS, "date", "instrument", "temperature", "datum"), "a certificate")
    texts = {key: top.text(key) if key in top else "" for key in _TEXTS}
    texts["date"] = _date(top)
    empty = Table({}, source)
    tool = top.table("instrument") if "instrument" in top else empty
    tool.only(_INSTRUMENT)
    heat = top.table("temperature") if "temperature" in top else empty
    heat.only(_TEMPERATURE)
    if ("mean" in heat) != ("expansion" in heat):
        heat.fail("", "state mean and expansion, both")
    nan = float("nan")
    return Statement(
        texts=texts,
        instrument={k: tool.text(k) if k in tool else "" for k in _INSTRUMENT[:3]},
        expanded=_positive(tool, "expanded", nan),
        factor=_positive(tool, "factor", 2.0),
        noise=_positive(tool, "noise", nan),
        temperature=heat.number("mean", "1", nan),
        temperature_uncertainty=_positive(heat, "uncertainty", 0.0),
        expansion=heat.number("expansion", "1", nan),
        expansion_uncertainty=_positive(heat, "expansion_uncertainty", 0.0),
        datum=_positive(top, "datum", 0.0),
    )


def _date(top: Table) -> str:
    if "date" not in top:
        return ""
    value = top["date"]
    return value.isoformat() if isinstance(value, datetime.date) else top.text("date")


def _positive(table: Table, key: str, default: float) -> float:
    value = table.number(key, "1", default)
    if value < 0 or (key == "factor" and value == 0):
        table.fail(key, f"must be positive, found {value:g}")
    return value


def budget(found: Identification, stated: Statement, predicted: FloatArray) -> Budget:
    """Return the uncertainty budget of a coordinate of the tool's position over the workspace.

    Parameters
    ----------
    found : Identification
        The calibration.
    stated : Statement
        What is known beside the measurements.
    predicted : ndarray (N,)
        Standard deviation of the tool's position at poses of the workspace, mm.

    Raises
    ------
    ValueError
        What is stated of temperatures contradicts the measurements or the calibration.
    """
    _same_heat(found, stated)
    lines = []
    if np.isfinite(stated.expanded):
        remark = f"U = {stated.expanded:g} mm, k = {stated.factor:g}"
        lines.append(
            Contribution("instrument", stated.expanded / stated.factor, type="B", remark=remark)
        )
    if predicted.size:
        dof = found.parameter_dof[np.isfinite(found.stderr)]
        remark = f"over {len(predicted)} poses of the workspace; frame and targets included"
        lines.append(
            Contribution(
                "identified numbers",
                rms(predicted) / np.sqrt(3.0),
                dof=float(np.median(dof)) if dof.size else float("inf"),
                remark=remark,
            )
        )
    lines += _misfit(found, stated)
    if np.isfinite(stated.temperature):
        length = float(np.linalg.norm(found.fit.start.pose[:, :3], axis=1).max())
        mean = stated.temperature - REFERENCE
        half, coefficient = stated.temperature_uncertainty, stated.expansion_uncertainty
        lines += [
            Contribution(
                "temperature",
                standard(half, "rectangular"),
                stated.expansion * length,
                type="B",
                remark=f"±{half:g} K rectangular, over {length:.4g} mm at {stated.expansion:g}/K",
            ),
            Contribution(
                "coefficient of expansion",
                standard(coefficient, "rectangular"),
                mean * length,
                type="B",
                remark=f"±{coefficient:g}/K rectangular, {mean:+.3g} K from {REFERENCE:g} °C",
            ),
        ]
    held = found.datum.names
    remark = "as stated" if stated.datum else "none stated"
    if held:
        remark = f"by definition: {len(held)} numbers are held ({listed(held)})"
    lines.append(Contribution("datum", stated.datum, type="B", remark=remark))
    return Budget(tuple(lines))


def _same_heat(found: Identification, stated: Statement) -> None:
    """Refuse another temperature than was measured, another expansion than was calibrated with."""
    read, mean = temperatures(found.fit.equations.table.sets), stated.temperature
    room = max(stated.temperature_uncertainty, _ROUNDED)
    if read and (mean < read[0] - room or mean > read[1] + room):
        raise ArgumentError(
            f"certificate: [temperature] mean states {mean:g} °C, and the measurements have"
            f" {read[0]:.4g} to {read[1]:.4g} °C"
        )
    used, per_kelvin = sorted(found.expansion.values()), stated.expansion
    room = stated.expansion_uncertainty
    if used and (per_kelvin < used[0] - room or per_kelvin > used[-1] + room):
        given = " to ".join(f"{value:g}" for value in sorted({used[0], used[-1]}))
        raise ArgumentError(
            f"certificate: [temperature] expansion states {per_kelvin:g}/K, and the calibration"
            f" used {given}/K"
        )


def _shared_noise(found: Identification, stated: Statement) -> float:
    """Return noise that residuals and U of the instrument both hold, mm.

    As stated, or else as good as `sigma` says, and no more than the instrument's own uncertainty; 0
    where nothing is stated of one of them.
    """
    whole = stated.expanded / stated.factor
    if np.isfinite(stated.noise) and np.isfinite(whole):
        return min(stated.noise, whole)
    lengths = [each for each in found.fit.equations.table.sets if "mm" in each.units]
    variances = [stated_variances(each) for each in lengths]
    known = [np.mean(each) for each in variances if each is not None]
    if not known or len(known) < len(variances) or not np.isfinite(whole):
        return 0.0
    return min(float(np.sqrt(np.mean(known))), whole)


def _beyond(scatter: float, noise: float) -> float:
    """A scatter without the noise that it holds, mm."""
    return float(np.sqrt(max(scatter**2 - noise**2, 0.0)))


def _of_noise(noise: float, stated: Statement) -> str:
    """Say whether a scatter holds the noise of the instrument, which its U may hold as well."""
    if noise:
        return f"without the noise of the instrument, {noise:.3g} mm, which is part of its U"
    if np.isfinite(stated.expanded) and np.isnan(stated.noise):
        return "noise of the instrument included, though U holds it too: noise is not stated"
    return "noise of the instrument included"


def _misfit(found: Identification, stated: Statement) -> list[Contribution]:
    """Return the misfit of machine and model: repeats tell one from the other."""
    sure, noise = found.fit.uncertainty, _shared_noise(found, stated)
    split = sure.repeats(plain=True)
    if np.isfinite(found.repeatability):
        missed = found.lack_of_fit_chance < SIGNIFICANT
        return [
            Contribution(
                "repeatability",
                _beyond(found.repeatability, noise),
                dof=split.pure_freedom,
                remark=f"scatter of repeated poses, {_of_noise(noise, stated)}",
            ),
            Contribution(
                "lack of fit",
                found.lack_of_fit if missed else 0.0,
                dof=split.missed_freedom,
                remark="what the model misses beyond that" if missed else "not significant",
            ),
        ]
    total = np.array([each for each, _ in sure.noises])
    known = total[np.isfinite(total)]
    if not known.size:
        return []
    return [
        Contribution(
            "repeatability and lack of fit",
            _beyond(float(np.sqrt(known.mean())), noise),
            dof=max(sure.fit.freedom, 0.0) or float("inf"),
            remark=f"residuals, {_of_noise(noise, stated)}; only repeated poses would tell"
            " repeatability from lack of fit",
        )
    ]


def _shown(stated: Statement, read: tuple[float, float] | None) -> str:
    if not np.isfinite(stated.temperature):
        return "" if read is None else f"{read[0]:.4g} to {read[1]:.4g} °C, as measured"
    return f"({stated.temperature:g} ± {stated.temperature_uncertainty:g}) °C"


def _reference(found: Identification) -> str:
    """State the temperature at which the machine's lengths are those identified."""
    if found.expansion:
        return f"{REFERENCE:g} °C (ISO 1): the stated lengths are corrected to it"
    return f"{REFERENCE:g} °C (ISO 1): lengths are not corrected to it, but as measured"


def _expansion(found: Identification, stated: Statement) -> str:
    """Return the thermal expansion that was used, and its uncertainty."""
    sure = ", its uncertainty is not stated"
    if stated.expansion_uncertainty > 0:
        sure = f", ± {stated.expansion_uncertainty * 1e6:.3g} µm/m/K"
    if found.expansion:
        return coefficients(found.expansion) + sure
    if np.isfinite(stated.expansion):
        return f"{stated.expansion * 1e6:.3g} µm/m/K{sure}; no length was reduced by it"
    return ""


def _extent(poses: FloatArray) -> dict[str, list[float]]:
    """State the extent of the tool's poses (N, 6) along each coordinate, mm and rad."""
    if not len(poses):
        return {}
    ways = [(way.min(), way.max()) for way in poses.T[:3]]
    turns = [_arc(angles) for angles in poses.T[3:]]
    ends = np.array([*ways, *turns]).tolist()
    return dict(zip(POSE, ends, strict=True))


def _arc(angles: FloatArray) -> tuple[float, float]:
    """The ends of the shortest arc that holds all angles, rad; its middle is within half a turn."""
    ordered = np.sort(angles % (2 * np.pi))
    gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    first = (int(np.argmax(gaps)) + 1) % len(ordered)
    length = 2 * np.pi - gaps.max()
    low = ordered[first] - 2 * np.pi * round((ordered[first] + length / 2) / (2 * np.pi))
    return low, low + length


def _over_measured(
    found: Identification, stated: Statement, predicted: FloatArray
) -> dict[str, Any] | None:
    """U over the poses that were measured, where all of it is known, and where these are."""
    if not predicted.size:
        return None
    made = budget(found, stated, predicted)
    return {
        "expanded_uncertainty": made.expanded,
        "coverage": made.coverage,
        "poses": len(predicted),
        "extent": _extent(found.fit.end.pose),
    }


def as_data(
    found: Identification,
    stated: Statement,
    predicted: FloatArray,
    tools: FloatArray,
    where: str = "",
    measured: FloatArray = _NOWHERE,
    left_out: int = 0,
) -> dict[str, Any]:
    """The certificate as JSON files hold it.

    Parameters
    ----------
    found, stated, predicted
        As `budget` takes them.
    tools : ndarray (N, 6)
        Poses of the tool where `predicted` is, mm and rad.
    where : str
        How these poses were drawn.
    measured : ndarray (K,)
        What is predicted at the poses that were measured, mm.
    left_out : int
        How many poses were drawn at which nothing is predicted.
    """
    made = budget(found, stated, predicted)
    worst = None
    if predicted.size:
        k = int(np.argmax(predicted))
        there = budget(found, stated, predicted[k : k + 1])
        worst = {
            "expanded_uncertainty": there.expanded,
            "coverage": there.coverage,
            "position": tools[k, :3].tolist(),
        }
    return {
        **stated.texts,
        "instrument": stated.instrument,
        "temperature": _shown(stated, temperatures(found.fit.equations.table.sets)),
        "reference_temperature": _reference(found),
        "expansion": _expansion(found, stated),
        "instrument_stated": bool(np.isfinite(stated.expanded)),
        "standard_uncertainty": made.combined,
        "expanded_uncertainty": made.expanded,
        "region": where,
        "extent": _extent(tools),
        "measured": _over_measured(found, stated, measured),
        "coverage_factor": made.factor,
        "coverage": made.coverage,
        "dof": made.dof,
        "poses": len(predicted),
        "poses_left_out": left_out,
        "worst": worst,
        "budget": [
            {
                "source": line.source,
                "type": line.type,
                "standard": line.standard,
                "sensitivity": line.sensitivity,
                "contribution": line.share,
                "dof": line.dof,
                "remark": line.remark,
            }
            for line in made.contributions
        ],
    }
