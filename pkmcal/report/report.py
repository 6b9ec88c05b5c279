"""A calibration as one HTML file that needs nothing else, and the same as contents."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pkmcal import display
from pkmcal.calibration.identification import Identification
from pkmcal.calibration.summary import WIDER
from pkmcal.display import printable
from pkmcal.effects.expansion import in_words
from pkmcal.files.atomic import write_whole
from pkmcal.files.provenance import checksums, comment, version
from pkmcal.fitted.row_names import row_names
from pkmcal.report import certificate, contents, machine_view, pdf, yielding
from pkmcal.report.as_json import as_json
from pkmcal.report.axes import axes
from pkmcal.report.certificate import Statement
from pkmcal.report.places import in_the_workspace
from pkmcal.view import scripts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CERTAIN = 1e4  # degrees of freedom that are as good as infinitely many
_SMALL = 1e-3  # below which numbers are written with a power of ten
_TEMPLATE = "report.html.jinja"
FILES = ("report.html", "report.json", "robot.toml")
PDF = "report.pdf"


def write(
    found: Identification,
    folder: Path,
    files: Mapping[str, bytes],
    stated: Statement | None = None,
    *,
    with_pdf: bool = False,
) -> list[Path]:
    """Write ``report.html``, ``report.json`` and ``robot.toml``, the same for the same inputs.

    Parameters
    ----------
    found : Identification
        What is reported.
    folder : Path
        An existing folder.
    files : mapping of str to bytes
        What was read, by name: the report states the checksums.
    stated : Statement, optional
        Of a certificate, which the report then begins with.
    with_pdf : bool
        Whether Chromium prints ``report.pdf`` of it, which contains when.

    Raises
    ------
    ValueError
        No PDF can be printed; if that shows only in printing, the other files have been written.
    OSError
        The folder cannot be written.
    """
    if with_pdf:
        pdf.browser()
    facts = gather(found, files, stated)
    page, numbers, robot = (folder / name for name in FILES)
    found.robot.save(robot, comment(files))
    write_whole(numbers, as_json(_as_data(facts), schema="report") + "\n")
    write_whole(page, html(facts))
    if not with_pdf:
        return [page, numbers, robot]
    pdf.print_page(page, folder / PDF)
    return [page, numbers, robot, folder / PDF]


def gather(
    found: Identification, files: Mapping[str, bytes], stated: Statement | None = None
) -> dict[str, Any]:
    """Collect everything that the report says; the calibration itself is ``found``."""
    state, sentence = contents.verdict(found)
    points = contents.points(found)
    places = in_the_workspace(found)
    no_places, accuracy, area = "", None, None
    if isinstance(places, str):
        no_places = places
    else:
        accuracy, area = contents.over_the_workspace(found, places)
    signed = None
    if stated is not None:
        sure, at, region, unsure = np.empty(0), np.empty((0, 6)), "", 0
        if accuracy is not None:
            sure, at = accuracy.predicted, accuracy.tools[np.isfinite(accuracy.accuracy)]
            region, unsure = accuracy.where, len(accuracy.accuracy) - len(sure)
        measured = contents.over_the_measured(found)
        signed = certificate.as_data(found, stated, sure, at, region, measured, unsure)
    return {
        "state": state,
        "verdict": sentence,
        "found": found,
        "points": points,
        "worst": contents.worst(points),
        "wider": WIDER,
        "outlier_names": row_names(found.fit.equations.prediction.datasets, found.outliers),
        "moved": contents.moved(points),
        "directions": contents.directions(found),
        "parameters": contents.parameters(found),
        "instruments": contents.instruments(found),
        "pictures": contents.pictures(found),
        "held_out_numbers": contents.held_out_numbers(found),
        "correlation": contents.correlation(found),
        "iso9283": contents.iso9283(found),
        "axes": axes(found),
        "certificate": signed,
        "heat": in_words(
            found.fit.equations.table.sets, found.expansion, found.fit.parameters.robot
        ),
        "accuracy": accuracy,
        "slice": area,
        "no_accuracy": no_places,
        "stiffness": yielding.of(found.robot, None if isinstance(places, str) else places),
        "inputs": checksums(files),
        "instrument_sought": contents.instrument_identified(found),
        "of_target": contents.reads_lengths(found),
        "arm": found.fit.parameters.robot.kind == "arm",
        "export": contents.export_command(found),
        "version": version(),
    }


def html(facts: Mapping[str, Any]) -> str:
    """Return the page. Names come from files that anybody may have written: all text is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("pkmcal.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "short": _short,
        "of_freedom": lambda dof: "∞" if dof > _CERTAIN else _short(dof),
        "shown": contents.shown,
        "fixed": lambda value, unit, places: display.fixed(
            display.displayed(value, unit)[0], places
        ),
        "unit": lambda unit: display.displayed(0.0, unit)[1],
        "printable": printable,
    }
    figures = {
        name: Markup(svg)  # matplotlib escapes the texts in it
        for name, svg in _figures(facts).items()
    }
    view, digest = machine_view.element(facts["found"])
    parts = {"figures": figures, "view": Markup(view), "view_digest": digest}
    style = Markup(scripts.style())
    return environment.get_template(_TEMPLATE).render(**facts, **parts, view_style=style)


def _as_data(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Select what goes into the JSON file: the facts, and every attribute of the calibration."""
    left_out = ("found", "of_target", "heat", "worst", "outlier_names", "wider", "moved", "arm")
    kept = {name: value for name, value in facts.items() if name not in left_out}
    return kept | {"calibration": facts["found"]}


def _figures(facts: Mapping[str, Any]) -> dict[str, str]:
    """Draw all figures as SVG elements, by name."""
    from pkmcal.report import figures
    from pkmcal.report.residual_figure import residuals
    from pkmcal.report.svg import inline_svg

    found: Identification = facts["found"]
    fitted = np.array([[row["before"], row["after"]] for row in facts["points"]]).T
    groups = {f"fitted, {int(np.isfinite(fitted[1]).sum())} points": (fitted[0], fitted[1])}
    held = int(np.isfinite(found.holdout_off).sum())
    if held:
        pair = (found.holdout_off_before, found.holdout_off)
        groups = {f"held out, {held} points": pair} | groups
    groups = {title: pair for title, pair in groups.items() if np.isfinite(pair[1]).any()}
    wanted: dict[str, tuple[Callable[[], Figure | None], str]] = {
        "points": (
            lambda: figures.before_after(groups) if groups else None,
            "Distances before and after",
        ),
        "residuals": (lambda: residuals(found), "Residuals by row and direction"),
        "machine": (lambda: figures.machine(found), "The nominal and the calibrated machine"),
        "correlation": (
            lambda: figures.correlation(facts["correlation"], found.free),
            "Correlations of the parameters",
        ),
        "convergence": (lambda: figures.convergence(found.history), "Misfit after each step"),
    }
    if facts["accuracy"] is not None and facts["accuracy"].predicted.size:
        wanted["accuracy"] = (
            lambda: figures.accuracy(facts["accuracy"], facts["slice"]),
            "Expected accuracy over the workspace",
        )
    if facts["stiffness"] is not None and facts["stiffness"].map is not None:
        wanted["stiffness"] = (
            lambda: figures.stiffness(facts["stiffness"]),
            "Stiffness over the workspace",
        )
    for k, score in enumerate(facts["iso9283"]):
        wanted[f"iso{k}"] = (lambda score=score: figures.poses(score), "Accuracy of each pose")  # type: ignore[misc]
    drawn = {}
    for name, (draw, text) in wanted.items():
        made = draw()
        if made is not None:
            drawn[name] = inline_svg(made, name, text)
    return drawn


def _short(value: float) -> str:
    """Show a number with three significant digits."""
    if not np.isfinite(value):
        return "–"
    return (
        f"{value:.3g}" if abs(value) < _SMALL else display.fixed(value, display.decimals(value, 3))
    )
