"""Mutants: an operator, a number or a word of the source is exchanged, or a statement dropped.

By tokens, so that C and Python are treated alike: mutmut and cosmic-ray do Python only.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

_EXCHANGED = {
    "+": "-", "-": "+", "*": "/", "/": "*", "**": "*", "//": "/", "%": "*",
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "&&": "||", "||": "&&", "and": "or", "or": "and", "not": "", "is": "is not",
    "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "&": "|", "|=": "&=", "&=": "|=",
    "True": "False", "False": "True", "break": "continue", "continue": "break",
    "larger": "smaller", "fmax": "fmin", "fmin": "fmax", "min": "max", "max": "min",
    "any": "all", "all": "any",
}  # fmt: skip
_C_TOKEN = re.compile(
    r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])'|^[ \t]*#[ \t]*(?:include|if|ifdef"
    r"|ifndef|undef|pragma|error)[^\n]*"
    r"|[A-Za-z_]\w*|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[a-zA-Z]*"
    r"|<<=|>>=|->|\+\+|--|&&|\|\||[-+*/%&|^<>=!]=|<<|>>|.",
    re.DOTALL | re.MULTILINE,
)
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
# One line that sets what is there already, or calls something: no declaration, no head of a loop.
_C_STATEMENT = re.compile(
    r"^[ \t]*((?!(?:return|const|static|goto|else|typedef)\b)"
    r"(?:[\w.\->*]+(?:\[[^;={}]*\])*(?<!\s)[ \t]*[-+*/&|]?=[ \t][^;={}]*|\w+\([^;={}]*\));)"
    r"[ \t]*\\?$",
    re.MULTILINE,
)


@dataclass(frozen=True)
class Change:
    """A piece of a file, and what stands for it in the mutant."""

    file: str
    at: int
    old: str
    new: str

    def applied(self, text: str) -> str:
        """The text of the mutant."""
        return text[: self.at] + self.new + text[self.at + len(self.old) :]

    def line(self, text: str) -> int:
        """Line of the file, from 1."""
        return text.count("\n", 0, self.at) + 1

    def named(self, text: str) -> str:
        """File, line, and what changes there."""
        begin = text.rfind("\n", 0, self.at) + 1
        behind = text[self.at + len(self.old) :].partition("\n")[0].rstrip(" \\")
        old = " ".join(self.old.split())
        line = f"{text[begin : self.at].lstrip()}[{old} -> {self.new}]{behind}"
        return f"{self.file}:{self.line(text)}: {line}"


def changes(root: Path, file: str) -> list[Change]:
    """All mutants of a file, in their order."""
    text = (root / file).read_text(encoding="utf-8")
    of_python = file.endswith(".py")
    found = [
        Change(file, at, old, "pass" if of_python else ";")
        for at, old in (_python_statements(text) if of_python else _c_statements(text))
    ]
    for at, token in _python(text) if of_python else _c(text):
        if token in _EXCHANGED:
            found.append(Change(file, at, token, _EXCHANGED[token]))
        elif match := _NUMBER.match(token):
            found.append(Change(file, at, token, _other(match[0]) + token[match.end() :]))
    return sorted(found, key=lambda change: (change.at, len(change.old)))


def _other(number: str) -> str:
    """One more; twice as much where one more is next to nothing."""
    if number.isdigit():
        return str(int(number) + 1)
    value = float(number)
    return repr(value + 1.0 if value < 100.0 else 2.0 * value)


def _c(text: str) -> Iterator[tuple[int, str]]:
    for match in _C_TOKEN.finditer(text):
        yield match.start(), match[0]


def _c_statements(text: str) -> Iterator[tuple[int, str]]:
    for match in _C_STATEMENT.finditer(text):
        yield match.start(1), match[1]


def _starts(text: str) -> list[int]:
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    return starts


def _python(text: str) -> Iterator[tuple[int, str]]:
    starts = _starts(text)
    kept = (tokenize.OP, tokenize.NAME, tokenize.NUMBER)
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    for before, token in pairwise(tokens):
        unary = token.string in ("*", "**") and before.string in ("(", "[", "{", ",", "=", ":")
        at = starts[token.start[0] - 1] + token.start[1]
        of_is_not = text.startswith("is not", at)
        if token.type in kept and not unary and not of_is_not:
            yield at, token.string


def _python_statements(text: str) -> Iterator[tuple[int, str]]:
    """What calls, raises, or changes something that is there already."""
    starts = _starts(text)
    lines = text.splitlines(keepends=True)

    def place(line: int, column: int) -> int:
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    for node in ast.walk(ast.parse(text)):
        sets = isinstance(node, ast.Assign) and not isinstance(
            node.targets[0], ast.Name | ast.Tuple
        )
        calls = isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant)
        if sets or calls or isinstance(node, ast.AugAssign | ast.Raise):
            begin = place(node.lineno, node.col_offset)
            assert node.end_lineno is not None and node.end_col_offset is not None
            yield begin, text[begin : place(node.end_lineno, node.end_col_offset)]
