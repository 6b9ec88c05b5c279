"""The emitter: a derivation in named steps becomes one C function.

A `Function` is written like the derivation on paper: inputs, then named intermediates (`let`),
then outputs. Derivatives go through the names by the chain rule, so the C keeps the paper's
symbols. Common subexpressions are shared across everything a function computes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

Value = Any  # a SymPy expression or matrix; SymPy is untyped
LINE = 100


@dataclass
class _Argument:
    name: str
    size: int | None  # None is a scalar
    doc: str
    indices: Sequence[str] = ()

    def entry(self, i: int) -> str:
        """The C lvalue of one entry of an output."""
        if self.size is None:
            return f"*{self.name}"
        return f"{self.name}[{self.indices[i] if self.indices else i}]"

    def declaration(self, output: bool) -> str:
        """The C parameter."""
        if self.size is None:
            return f"real *{self.name}" if output else f"real {self.name}"
        return f"{'' if output else 'const '}real {self.name}[{self.size}]"


@dataclass
class _Step:
    """One named intermediate: `symbols` are its entries, `exprs` what they stand for."""

    symbols: list[sp.Symbol]
    exprs: list[sp.Expr]
    doc: str
    sincos: sp.Expr | None = None  # the angle, when the two entries are its sine and cosine

    @property
    def doubles(self) -> bool:
        """Whether it calls a function that only doubles have."""
        return self.sincos is not None or self.is_angle

    @property
    def is_angle(self) -> bool:
        """Whether it is the angle of a sine and a cosine."""
        return len(self.exprs) == 1 and isinstance(self.exprs[0], sp.atan2)


@dataclass
class Function:
    """One C function: `title` and `formula` make its header comment."""

    name: str
    title: str
    formula: str
    inputs: list[_Argument] = field(default_factory=list)
    outputs: list[tuple[_Argument, list[sp.Expr]]] = field(default_factory=list)
    steps: list[_Step] = field(default_factory=list)
    zeros: dict[sp.Symbol, sp.Expr] = field(default_factory=dict)
    known: dict[sp.Expr, sp.Expr] = field(default_factory=dict)
    declared: list[sp.Symbol] = field(default_factory=list)

    # inputs ---------------------------------------------------------------------------------

    def scalar(self, name: str, doc: str) -> sp.Symbol:
        """Declare a scalar input."""
        self.inputs.append(_Argument(name, None, doc))
        return self._declare([name])[0]

    def vector(self, name: str, size: int, doc: str) -> sp.Matrix:
        """Declare a vector input; its entries print as ``name[0]``, ``name[1]``, ..."""
        return sp.Matrix(self.named(name, [str(i) for i in range(size)], doc))

    def matrix(self, name: str, doc: str) -> sp.Matrix:
        """Declare a 3 x 3 input, row by row."""
        return self.vector(name, 9, doc).reshape(3, 3)

    def named(self, name: str, indices: Sequence[str], doc: str) -> list[sp.Symbol]:
        """Declare a vector input whose entries are indexed by the given C constants."""
        self.inputs.append(_Argument(name, len(indices), doc))
        return self._declare([f"{name}[{index}]" for index in indices])

    def perturbation(self, name: str, size: int) -> sp.Matrix:
        """Variables to differentiate by that are zero in the emitted code."""
        symbols = [sp.Symbol(f"{name}{i}", real=True) for i in range(size)]
        self.zeros.update(dict.fromkeys(symbols, sp.S.Zero))
        return sp.Matrix(symbols)

    # intermediates --------------------------------------------------------------------------

    def let(self, name: str, value: Value, doc: str = "") -> Value:
        """Name an intermediate; returns symbols (of the value's shape) that stand for it."""
        exprs = _entries(value)
        scalar = not isinstance(value, sp.MatrixBase)
        symbols = self._declare([name] if scalar else [f"{name}{i}" for i in range(len(exprs))])
        self.steps.append(_Step(symbols, exprs, doc))
        return symbols[0] if scalar else sp.Matrix(symbols).reshape(*value.shape)

    def sincos(self, name: str, angle: sp.Expr, doc: str = "") -> tuple[sp.Symbol, sp.Symbol]:
        """Name the sine and cosine of an angle: returns ``(s<name>, c<name>)``."""
        s, c = self._declare([f"s{name}", f"c{name}"])
        self.steps.append(_Step([s, c], [sp.sin(angle), sp.cos(angle)], doc, angle))
        self.known.update({sp.sin(angle): s, sp.cos(angle): c})
        return s, c

    def angle(self, name: str, sine: sp.Expr, cosine: sp.Expr, doc: str = "") -> sp.Symbol:
        """Name the angle of a sine and a cosine, which are symbols, up to a positive factor."""
        (symbol,) = self._declare([name])
        self.steps.append(_Step([symbol], [sp.atan2(sine, cosine)], doc))
        return symbol

    def gradient(self, value: Value, variables: Iterable[sp.Symbol]) -> sp.Matrix:
        """Total derivative of each entry by each variable, through all named intermediates."""
        rows = _entries(value)
        return sp.Matrix([[self._total(e, x, {}) for x in _entries(variables)] for e in rows])

    def output(self, name: str, value: Value, doc: str, indices: Sequence[str] = ()) -> None:
        """Declare an output (a matrix is written row by row)."""
        scalar = not isinstance(value, sp.MatrixBase)
        exprs = _entries(value)
        size = None if scalar else len(exprs)
        self.outputs.append((_Argument(name, size, doc, indices), exprs))

    def written_out(self, value: Value) -> Value:
        """Substitute every named intermediate back: the formula in the inputs alone."""
        for step in reversed(self.steps):
            value = value.subs(dict(zip(step.symbols, step.exprs, strict=True)))
        return value.subs(self.zeros)

    def result(self, name: str) -> sp.Matrix:
        """One output, written out in the inputs alone (for proofs)."""
        exprs = next(exprs for argument, exprs in self.outputs if argument.name == name)
        return self.written_out(sp.Matrix(exprs))

    # ----------------------------------------------------------------------------------------

    def _declare(self, names: Sequence[str]) -> list[sp.Symbol]:
        symbols = [sp.Symbol(name, real=True) for name in names]
        clash = set(symbols) & set(self.declared)
        if clash:
            raise ValueError(f"{self.name}: {clash} declared twice")
        self.declared += symbols
        return symbols

    def _total(self, expr: sp.Expr, x: sp.Symbol, memo: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
        total = sp.diff(expr, x)
        for step in self.steps:
            for symbol, definition in zip(step.symbols, step.exprs, strict=True):
                if symbol in expr.free_symbols:
                    if symbol not in memo:
                        memo[symbol] = self._total(definition, x, memo)
                    total += sp.diff(expr, symbol) * memo[symbol]
        return total.subs(self.zeros).xreplace(self.known)

    def emit(self) -> str:
        """The C function, with its header comment."""
        statements = _Statements(self)
        lines = [*_comment(self, statements.counts), *statements.lines, "}"]
        if any(step.doubles for step in self.steps):  # see csrc/lanes.h
            lines = ["#ifndef NARROW", *lines, "#endif"]
        return "\n".join([*lines, ""])


class _Statements:
    """The body of a function: live steps in their order, shared subexpressions before use."""

    def __init__(self, function: Function) -> None:
        self.printer = _Printer(function.declared)
        self.lines: list[str] = []
        aliases: dict[sp.Symbol, sp.Expr] = dict(function.zeros)
        steps, flat = [], []
        for step in function.steps:
            exprs = [e.xreplace(aliases) for e in step.exprs]
            kept = []
            for symbol, expr in zip(step.symbols, exprs, strict=True):
                if step.sincos is None and (expr.is_Symbol or (-expr).is_Symbol or expr.is_Number):
                    aliases[symbol] = expr
                else:
                    kept.append((symbol, expr))
            steps.append((step, kept))
        outputs = [(a, [sp.sympify(e).xreplace(aliases) for e in es]) for a, es in function.outputs]
        live = set().union(*(e.free_symbols for _, es in outputs for e in es))
        for _step, kept in reversed(steps):
            if any(symbol in live for symbol, _ in kept):
                live |= set().union(*(e.free_symbols for _, e in kept))
        steps = [(s, [(n, e) for n, e in kept if n in live or s.sincos is not None])
                 for s, kept in steps if any(n in live for n, _ in kept)]  # fmt: skip
        flat = [e for s, kept in steps if s.sincos is None for _, e in kept]
        flat += [e for _, es in outputs for e in es]
        shared, reduced = sp.cse(flat, symbols=sp.numbered_symbols("t", real=True), list=True)
        self.shared = dict(shared)
        self.printer.rank.update({symbol: 10_000 + i for i, (symbol, _) in enumerate(shared)})
        rest = iter(reduced)
        for step, kept in steps:
            if step.doc:
                self.lines.append(f"    /* {step.doc} */")
            if step.sincos is None:
                for symbol, _ in kept:
                    self._assign(f"const real {symbol}", next(rest))
            else:
                (s, _), (c, _) = kept
                angle = self.printer.print(step.sincos.xreplace(aliases))
                self.lines += [f"    real {s}, {c};", f"    FN(sincos)({angle}, &{s}, &{c});"]
        for argument, exprs in outputs:
            for i, expr in enumerate(exprs):
                self._assign(argument.entry(i), next(rest), constant=expr.is_Number)
        self.counts = self.printer.counts

    def _assign(self, target: str, expr: sp.Expr, constant: bool = False) -> None:
        rank = self.printer.rank
        for symbol in sorted(expr.free_symbols & set(self.shared), key=rank.__getitem__):
            if symbol in self.shared:
                self._assign(f"const real {symbol}", self.shared.pop(symbol))
        text = self.printer.print(expr)
        if constant:
            text = f"FN(fill)({text})"
        self.lines += _wrapped(f"    {target} = {text};")


class _Printer:
    """SymPy expression to C: one short method per node, and a refusal for every other node."""

    def __init__(self, declared: Sequence[sp.Symbol]) -> None:
        self.rank = {symbol: i for i, symbol in enumerate(declared)}
        self.counts = {"+": 0, "*": 0, "/": 0, "sqrt": 0}

    def print(self, expr: sp.Expr) -> str:
        method = getattr(self, f"_{type(expr).__name__}", None)
        if method is None:
            method = self._Rational if expr.is_Rational else None
        if method is None:
            raise NotImplementedError(f"the emitter has no C for {type(expr).__name__}: {expr}")
        return method(expr)

    def _atan2(self, expr: sp.Expr) -> str:
        return f"arctangent2({', '.join(map(self.print, expr.args))})"

    def _Symbol(self, expr: sp.Symbol) -> str:
        return expr.name

    def _Rational(self, expr: sp.Rational) -> str:
        if expr.q & (expr.q - 1) or abs(expr.p) >= 2**24:
            raise NotImplementedError(f"{expr} is no float: write it as a quotient of names")
        return f"{float(expr)!r}f"  # exact, and C widens it to whatever `real` is

    def _Add(self, expr: sp.Add) -> str:
        terms = sorted(expr.args, key=self._order)
        text = self.print(terms[0])
        for term in terms[1:]:
            minus = term.could_extract_minus_sign() and _leading(term) < 0
            text += f" - {self._factor(-term)}" if minus else f" + {self._factor(term)}"
            self.counts["+"] += 1
        return text

    def _Mul(self, expr: sp.Mul) -> str:
        number, factors = expr.as_coeff_mul()
        above = [f for f in factors if not _is_inverse(f)]
        below = [1 / f for f in factors if _is_inverse(f)]
        parts = [self._factor(f) for f in sorted(above, key=self._order)]
        sign = "-" if number < 0 else ""
        if abs(number) != 1 or not parts:
            parts.insert(0, self.print(abs(number)))
        self.counts["*"] += len(parts) - 1
        text = sign + "*".join(parts)
        if below:
            self.counts["/"] += 1
            self.counts["*"] += len(below) - 1
            under = "*".join(self._factor(f) for f in sorted(below, key=self._order))
            text += f"/({under})" if len(below) > 1 or "*" in under else f"/{under}"
        return text

    def _Pow(self, expr: sp.Pow) -> str:
        base, exponent = expr.args
        if exponent == sp.Rational(1, 2):
            self.counts["sqrt"] += 1
            return f"FN(root)({self.print(base)})"
        if exponent.is_Integer and 2 <= exponent <= 4:
            if not base.is_Symbol:
                raise NotImplementedError(f"name {base} before raising it to a power")
            self.counts["*"] += int(exponent) - 1
            return "*".join([base.name] * int(exponent))
        if exponent.is_negative:
            self.counts["/"] += 1
            under = self.print(1 / expr)
            return f"1.0f/({under})" if "*" in under or " " in under else f"1.0f/{under}"
        raise NotImplementedError(f"the emitter does not expand the power {expr}")

    def _factor(self, expr: sp.Expr) -> str:
        text = self.print(expr)
        return f"({text})" if expr.is_Add or text.startswith("-") else text

    def _order(self, term: sp.Expr) -> tuple[bool, list[int], str]:
        """Positive terms first, then the order in which the derivation declared its symbols."""
        ranks = sorted(self.rank.get(s, -1) for s in term.free_symbols)
        return (bool(_leading(term) < 0), ranks, str(term))


def _leading(term: sp.Expr) -> sp.Expr:
    return term.as_coeff_Mul()[0]


def _is_inverse(expr: sp.Expr) -> bool:
    return expr.is_Pow and bool(expr.exp.is_negative)


def _entries(value: Value | Iterable[sp.Expr]) -> list[sp.Expr]:
    scalar = isinstance(value, sp.Expr) and not isinstance(value, sp.MatrixBase)
    return [value] if scalar else list(value)


def _comment(function: Function, counts: dict[str, int]) -> list[str]:
    lines = ["/*", f" * {function.title}"]
    lines += [f" *     {line}" for line in function.formula.splitlines()]
    arguments = [("in ", a) for a in function.inputs] + [("out", a) for a, _ in function.outputs]
    for direction, a in arguments:
        shape = "" if a.size is None else f"[{a.size}]"
        lines.append(f" * {direction} {a.name + shape:14} {a.doc}")
    lines.append(" * operations: " + ", ".join(f"{n} {op}" for op, n in counts.items()))
    lines.append(" */")
    declared = [a.declaration(output=False) for a in function.inputs]
    declared += [a.declaration(output=True) for a, _ in function.outputs]
    head = f"INLINE void FN({function.name})("
    return [*lines, *_wrapped(head + ", ".join(declared) + ")", ", "), "{"]


def _wrapped(line: str, gap: str = " ") -> list[str]:
    """Break a long line at gaps, continuation indented by eight."""
    lines = []
    while len(line) > LINE:
        cut = line.rfind(gap, 12, LINE) + len(gap) - 1
        if cut < 12:
            break
        lines.append(line[:cut])
        line = " " * 8 + line[cut + 1 :]
    return [*lines, line]
