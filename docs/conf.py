"""How Sphinx builds the site: `make docs`, which runs it from the project's root."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path
from typing import Any

import pkmcal as pk
from pkmcal.files.toml_lines import tomllib
from pkmcal.result import Result

project = "pkmcal"
author = "The pkmcal developers"
copyright = author  # Sphinx asks for it under this name
release = metadata.version("pkmcal")

# The root is the source folder, so that one relative link serves the site and the repository.
root_doc = "docs/index"
include_patterns = ["*.md", "docs/**.md", "examples/*/README.md", "benchmarks/recorded/*.md"]
templates_path = ["templates"]
html_additional_pages = {"index": "to_first_page.html"}

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
myst_heading_anchors = 3

default_role = "py:obj"  # `robot.inverse` in a docstring: a link where there is such a name
autodoc_typehints = "none"  # numpydoc's Parameters say them in words
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "inherited-members": True}
numpydoc_show_class_members = False  # autodoc writes the members out

html_theme = "pydata_sphinx_theme"
html_title = "pkmcal"
html_theme_options = {
    "navigation_depth": 2,
    "show_toc_level": 2,
    "show_prev_next": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"README": [], "docs/index": [], "**": ["sidebar-nav-bs"]}
html_static_path = ["static"]
html_css_files = ["wide.css"]  # outputs of 100 columns fit
html_copy_source = False
html_show_sourcelink = False


def signature_of_class(
    app: Any, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str
) -> tuple[str, None] | None:
    """No signature where functions make the object: results, and what holds private fields."""
    private = "_" in re.findall(r"[(, ](\w)", signature or "")
    if what == "class" and (issubclass(obj, Result) or private):
        return "", None
    return None


def names_of_files(app: Any, page: str, source: list[str]) -> None:
    """Show above a block the name of the file that it is: ```` ```toml mine.toml ````."""
    source[0] = re.sub(
        r"^```(toml|text) (\S+)$",
        r"```{code-block} \1\n:caption: \2\n",
        source[0],
        flags=re.MULTILINE,
    )


def pages_of_machines(app: Any, error: Exception | None) -> None:
    """Write the page of each machine of the gallery, which its picture opens."""
    if error is None and app.builder.format == "html":
        machines = Path(app.confdir, "gallery", "machines.toml").read_text(encoding="utf-8")
        folder = Path(app.outdir, "docs", "gallery")
        folder.mkdir(parents=True, exist_ok=True)
        for stem, source in tomllib.loads(machines).items():
            pk.load(source).show(folder / f"{stem}.html")


def setup(app: Any) -> None:
    """Connect to Sphinx: to pages as they are read, to signatures before numpydoc, to the end."""
    app.connect("autodoc-process-signature", signature_of_class, priority=400)
    app.connect("source-read", names_of_files)
    app.connect("build-finished", pages_of_machines)
