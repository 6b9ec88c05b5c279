"""A seal says whether a file is still as it was written, and every format goes on reading it."""

from __future__ import annotations

import io
import json
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import image

from pkmcal.files.seal import is_sealed, sealed
from pkmcal.files.toml_lines import Source
from pkmcal.report.drawing import empty_figure, encoded

SVG = encoded(empty_figure(1, 1), "svg")
PNG = encoded(empty_figure(1, 1), "png")
CONTENTS = {
    ".csv": b"# head\nx [mm]\n1\n",
    ".toml": b'name = "a"\n',
    ".json": b'{\n  "a": 1\n}\n',
    ".html": b"<!doctype html>\n<p>text</p>\n",
    ".svg": SVG,
    ".png": PNG,
    ".pdf": b"%PDF-1.4\ntrailer\nstartxref\n9\n%%EOF\n",
    ".xml": b"<a>\n  <b/>\n</a>\n",
    ".urdf": b"<a>\n  <b/>\n</a>\n",
    ".h": b"#ifndef A_H\n#define A_H\n#endif\n",
    ".c": b"int a;\n",
    ".yaml": b"%YAML:1.0\n---\nimage_width: 640\n",
    ".ini": b"[A]\nB = 1\n",
    ".hal": b"setp a.b 1\n",
}


@pytest.mark.parametrize("kind", CONTENTS)
def test_what_was_sealed_is_and_what_was_changed_at_any_byte_is_not(kind: str) -> None:
    content = CONTENTS[kind]
    written = sealed(content, kind)
    assert is_sealed(written, kind)
    assert not is_sealed(content, kind)
    for at in range(0, len(written), max(1, len(written) // 200)):
        changed = bytearray(written)
        changed[at] ^= 1
        assert not is_sealed(bytes(changed), kind), at
    for other in (written + b" ", b" " + written, written[:-1], written[1:], b""):
        assert not is_sealed(other, kind)


@given(st.binary(max_size=300), st.sampled_from(list(CONTENTS)))
def test_nothing_that_others_write_is_taken_for_sealed(content: bytes, kind: str) -> None:
    assert not is_sealed(content, kind)
    written = sealed(content, kind)
    assert is_sealed(written, kind) or written == content or len(content) < 12


def test_files_of_other_kinds_stay_as_they_are_and_are_never_taken_for_ours() -> None:
    for kind in (".cfg", ".g", ".gcode", ""):
        assert sealed(b"G1 X1\n", kind) == b"G1 X1\n"
        assert not is_sealed(b"G1 X1\n", kind)


@pytest.mark.parametrize("content", [b"name: Maslow 4\nMaslow_tlX: -27.5\n", b"a: 1\n", b""])
def test_a_machine_s_configuration_in_yaml_is_its_owner_s(content: bytes) -> None:
    assert sealed(content, ".yaml") == content and not is_sealed(content, ".yaml")


def test_a_seal_with_another_digest_is_none() -> None:
    written = sealed(CONTENTS[".csv"], ".csv")
    assert not is_sealed(written.replace(written[21:85], b"0" * 64), ".csv")


def test_every_format_is_read_as_before() -> None:
    assert Source(sealed(CONTENTS[".toml"], ".toml"), "a.toml").data == {"name": "a"}
    assert json.loads(sealed(CONTENTS[".json"], ".json"))["a"] == 1
    assert ElementTree.fromstring(sealed(SVG, ".svg")).tag.endswith("svg")
    plain, marked = (image.imread(io.BytesIO(each)) for each in (PNG, sealed(PNG, ".png")))
    np.testing.assert_array_equal(plain, marked)
