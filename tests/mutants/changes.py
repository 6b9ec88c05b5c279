"""Mutants: one operator or number of the source exchanged for another.

By tokens, so that C and Python are treated alike: mutmut and cosmic-ray do Python only.
"""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_EXCHANGED = {
    "+": "-", "-": "+", "*": "/", "/": "*", "**": "*", "//": "/", "%": "*",
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "&&": "||", "||": "&&", "and": "or", "or": "and", "not": "",
    "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "&": "|", "|=": "&=", "&=": "|=",
    "True": "False", "False": "True", "break": "continue", "in": "not in",
    "larger": "smaller", "fmax": "fmin", "fmin": "fmax", "min": "max", "max": "min",
}  # fmt: skip
_C_TOKEN = re.compile(
    r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])'|^[ \t]*#[ \t]*(?:include|if|ifdef"
    r"|ifndef|undef|pragma|error)[^\n]*"
    r"|[A-Za-z_]\w*|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[a-zA-Z]*"
    r"|<<=|>>=|->|\+\+|--|&&|\|\||[-+*/%&|^<>=!]=|<<|>>|.",
    re.DOTALL | re.MULTILINE,
)
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class Change:
    """A token of a file, and what stands for it in the mutant."""

    file: str
    at: int
    old: str
    new: str

    def applied(self, text: str) -> str:
        """The text of the mutant."""
        return text[: self.at] + self.new + text[self.at + len(self.old) :]

    def named(self, text: str) -> str:
        """File, line, and what changes there."""
        line = text.count("\n", 0, self.at) + 1
        begin = text.rfind("\n", 0, self.at) + 1
        whole = text[begin : text.find("\n", self.at)].strip()
        return f"{self.file}:{line}: {self.old!r} -> {self.new!r} in {whole}"


def changes(root: Path, file: str) -> list[Change]:
    """All mutants of a file, in their order."""
    text = (root / file).read_text(encoding="utf-8")
    tokens = _python(text) if file.endswith(".py") else _c(text)
    found = []
    for at, token in tokens:
        if token in _EXCHANGED and not (file.endswith(".py") and token == "|"):
            found.append(Change(file, at, token, _EXCHANGED[token]))
        elif match := _NUMBER.match(token):
            number = match[0]
            more = str(int(number) + 1) if number.isdigit() else f"{2 * float(number) or 1.0!r}"
            found.append(Change(file, at, token, more + token[len(number) :]))
    return found


def _c(text: str) -> Iterator[tuple[int, str]]:
    for match in _C_TOKEN.finditer(text):
        yield match.start(), match[0]


def _python(text: str) -> Iterator[tuple[int, str]]:
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.OP, tokenize.NAME, tokenize.NUMBER):
            yield starts[token.start[0] - 1] + token.start[1], token.string
