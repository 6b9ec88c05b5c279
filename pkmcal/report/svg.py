"""Figures as SVG that takes its colours from the page it stands in."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

from pkmcal.report.drawing import BLUE, FAINT, GREEN, GRID, INK, ORANGE, PINK, encoded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# What a page may change, by the name of its CSS variable; others stay as they are drawn.
_VARIABLES = {
    **{INK: "ink", "#333333": "ink", "#404040": "ink"},
    **{FAINT: "faint", "#999999": "faint"},
    **{GRID: "grid", "#d9d9d9": "grid"},
    **{BLUE: "blue", ORANGE: "orange", GREEN: "green", PINK: "pink"},
}
_SVG = "http://www.w3.org/2000/svg"
_LINK = "{http://www.w3.org/1999/xlink}href"


def inline_svg(figure: Figure, name: str, text: str) -> str:
    """The figure as an ``<svg>`` element, always the same for the same figure.

    Parameters
    ----------
    figure : Figure
        Drawn `in_context`.
    name : str
        Of letters and digits; its ids are no others' on the page.
    text : str
        What it shows, for those who cannot see it.
    """
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", "http://www.w3.org/1999/xlink")
    root = ElementTree.fromstring(encoded(figure, "svg", name, "none"))
    metadata = root.find(f"{{{_SVG}}}metadata")
    if metadata is not None:
        root.remove(metadata)
    for element in root.iter():
        _own_names(element, name)
        if "style" in element.attrib:
            element.set("style", _themed(element.attrib["style"]))
    root.set("style", f"max-width: {figure.get_figwidth():g}in")
    for size in ("width", "height"):
        del root.attrib[size]
    root.set("role", "img")
    root.set("aria-label", text)
    root.set("class", "figure")
    return ElementTree.tostring(root, encoding="unicode")


def _own_names(element: ElementTree.Element, name: str) -> None:
    """Put the figure's name before ids and what refers to them."""
    attributes = element.attrib
    if "id" in attributes:
        attributes["id"] = f"{name}-{attributes['id']}"
    if attributes.get(_LINK, "").startswith("#"):
        attributes[_LINK] = f"#{name}-{attributes[_LINK][1:]}"
    for key, value in attributes.items():
        if "url(#" in value:
            attributes[key] = value.replace("url(#", f"url(#{name}-")


def _themed(declarations: str) -> str:
    for colour, variable in _VARIABLES.items():
        declarations = declarations.replace(colour, f"var(--{variable})")
    return declarations
