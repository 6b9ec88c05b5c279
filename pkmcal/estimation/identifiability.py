"""Identifiable combinations of the parameters, and how well each is determined.

Everything here is in scaled parameters: 1 means about 1 mm at the machine.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal.arrays import BoolArray, FloatArray, first_largest
from pkmcal.result import ReadOnly
from pkmcal.statistics.linear_fit import ROUNDING, few_rows
from pkmcal.statistics.singular_values import svd

_KINDS = 4  # kinds of parameters whose combinations are looked for
_OUTSIDE = 1e-5  # share of a combination outside some parameters that does not count
_TOGETHER = 512  # supports that are looked at at once
ALIKE = 1e-3  # share by which numbers of a combination differ that are as good as equal
_SURE = 6  # decimals of a coefficient that are more than rounding
_LEAST = 0.01  # coefficient that is printed
_MOST = 24  # terms that are printed
CLEAR = 0.01  # share of the machine's size to which a combination must be determined to count


@dataclass(frozen=True, eq=False)
class Directions(ReadOnly):
    """Orthonormal combinations of the parameters, split into identifiable and not.

    Attributes
    ----------
    identifiable, unidentifiable : ndarray (n, r), (n, n - r)
        Orthonormal columns.
    singular : ndarray (n,)
        Singular values of the scaled, whitened Jacobian, largest first.
    """

    identifiable: FloatArray
    unidentifiable: FloatArray
    singular: FloatArray

    @property
    def rank(self) -> int:
        """Number of identifiable combinations."""
        return int(self.identifiable.shape[1])

    @property
    def gap(self) -> float:
        """Singular value of the last identifiable combination over that of the next."""
        if self.rank in (0, len(self.singular)):
            return float("inf")
        last, next_one = self.singular[self.rank - 1], self.singular[self.rank]
        return float(last / next_one) if next_one > 0 else float("inf")


Decomposed = tuple[FloatArray, FloatArray]  # singular values (n,), directions (n, n)
Measured = tuple[FloatArray, tuple[FloatArray, ...]]  # singular values (n,) of a Jacobian in parts


def decompose(*jacobian: FloatArray) -> Decomposed:
    """Singular values (n,), zeros where there are fewer rows, and all directions (n, n).

    The Jacobian may be in parts, below each other. What nothing reads is a direction of its own,
    the last: others have no part of it, not even by rounding.
    """
    whole, read = _read(jacobian)
    n, count = len(read), whole.shape[1]
    singular, rows = np.zeros(n), np.zeros((n, n))
    if count:
        _, singular[:count], rows[:count, read] = svd(whole)
    rows[count:, ~read] = np.eye(n - count)
    return singular, rows.T


def measured(*jacobian: FloatArray) -> Measured:
    """The singular values of `decompose`, in a third of its time, and what they are of."""
    whole, read = _read(jacobian)
    singular, count = np.zeros(len(read)), whole.shape[1]
    if count:
        singular[:count] = np.linalg.svd(whole, compute_uv=False)
    return singular, jacobian


def _read(jacobian: Sequence[FloatArray]) -> tuple[FloatArray, BoolArray]:
    """Columns of a Jacobian that something reads, as many rows at least; and which they are."""
    factor = few_rows(*jacobian)
    read: BoolArray = np.asarray(factor.any(axis=0))
    count = int(np.count_nonzero(read))
    whole = np.zeros((max(count, len(factor)), count))
    whole[: len(factor)] = factor[:, read]
    return whole, read


def directions(
    before: Decomposed, after: Measured | None, size: float, worst: float = np.inf
) -> Directions:
    """Split the combinations by the Jacobians before and after the fit.

    A combination is identifiable if its singular value is not zero. The Jacobian before the fit,
    of the nominal machine, decides: there the gap is clean. Errors of the machine blur the gap, so
    the Jacobian after the fit overrules only where it determines more combinations to `CLEAR` of
    the machine's size.

    Parameters
    ----------
    before, after : tuple
        `decompose` of the scaled, whitened Jacobian before the fit, `measured` of that after it.
    size : float
        Of the machine, mm.
    worst : float
        Standard deviation in mm, one over the singular value, beyond which a combination does not
        count either, before or after.
    """
    rank, deciding = _count(before[0], worst), before
    if after is not None:
        clear, usable = _count(after[0], CLEAR * size), _count(after[0], worst)
        if clear > rank or usable < rank:
            rank, deciding = (clear if clear > rank else usable), decompose(*after[1])
    singular, basis = deciding
    return Directions(basis[:, :rank], basis[:, rank:], singular)


def held_errors(jacobian: FloatArray, prior: FloatArray, rank: int, size: float) -> FloatArray:
    """Return errors of held combinations that errors of the machine make visible.

    The machine as it was found determines a little what the nominal one does not. That is too
    little to be estimated, but what is held there shifts the other parameters.

    Parameters
    ----------
    jacobian : ndarray (M, n)
        Scaled and whitened, after the fit.
    prior : ndarray (p, n)
        Rows of a prior.
    rank : int
        How many combinations were identifiable.
    size : float
        Of the machine, mm: by more than that no combination is taken to be off.

    Returns
    -------
    ndarray (n, e)
        Scaled standard deviations, a column for each.
    """
    basis, singular = shown_beyond(jacobian, prior, rank)
    errors: FloatArray = basis * np.minimum(1.0 / singular, size)
    return errors


def shown_beyond(
    jacobian: FloatArray, prior: FloatArray, rank: int
) -> tuple[FloatArray, FloatArray]:
    """Combinations (n, e) beyond so many that a Jacobian shows, and their singular values (e,)."""
    if rank == jacobian.shape[1]:
        return np.zeros((rank, 0)), np.zeros(0)
    singular, basis = decompose(jacobian, prior)
    shown = _count(singular, np.inf)
    return basis[:, rank:shown], singular[rank:shown]


def _count(singular: FloatArray, deviation: float) -> int:
    """Number of singular values that are not zero and stand for at most this deviation."""
    floor = max(ROUNDING * float(singular[0]), 1.0 / deviation)
    return int(np.count_nonzero(singular > floor))


def observability(jacobian: FloatArray, poses: int, rank: int) -> dict[str, float]:
    """Observability indices O1 … O5 of a scaled Jacobian, over the identifiable combinations.

    Parameters
    ----------
    jacobian : ndarray (M, n)
        In mm of the measured quantity per mm of the parameters, not whitened.
    poses : int
        Number of measured poses.
    rank : int
        Number of identifiable combinations.

    Notes
    -----
    With singular values σ1 ≥ … ≥ σr and m poses: O1 = (σ1…σr)^(1/r)/√m, O2 = σr/σ1, O3 = σr,
    O4 = σr²/σ1, O5 = 1/Σ(1/σ) (Y. Sun and J. M. Hollerbach, Observability index selection for robot
    calibration, ICRA 2008).
    """
    singular = decompose(jacobian)[0][:rank]
    if rank == 0 or singular[-1] <= 0:
        return dict.fromkeys(("O1", "O2", "O3", "O4", "O5"), 0.0)
    largest, least = float(singular[0]), float(singular[-1])
    return {
        "O1": float(np.exp(np.log(singular).mean()) / np.sqrt(poses)),
        "O2": least / largest,
        "O3": least,
        "O4": least**2 / largest,
        "O5": float(1.0 / np.sum(1.0 / singular)),
    }


def sparse_basis(unidentifiable: FloatArray, families: Sequence[str]) -> FloatArray:
    """Rewrite combinations so that each involves as few kinds of parameters as possible.

    Parameters
    ----------
    unidentifiable : ndarray (n, d)
        Orthonormal columns.
    families : sequence of str, n
        Of the parameters, as `Parameters.families`: a kind more is many combinations more.

    Returns
    -------
    ndarray (n, d)
        The largest entry of each column is 1.
    """
    d = unidentifiable.shape[1]
    if not d:
        return unidentifiable
    kinds = list(dict.fromkeys(families))
    member = np.array([[family == kind for kind in kinds] for family in families])
    found = np.zeros((d, 0))  # orthonormal combinations of the columns
    parts = np.zeros((len(unidentifiable), 0))
    spans: list[set[int]] = []  # kinds among which each part was found
    shares = [unidentifiable[of].T @ unidentifiable[of] for of in member.T]
    for support, dimension in _supports(np.array(shares)):
        if found.shape[1] == d:
            break
        within = sum(span <= {*support} for span in spans)
        if within == dimension:
            continue
        away = ~member[:, list(support)].any(axis=1)
        _, singular, rows = np.linalg.svd(np.vstack([unidentifiable[away], np.zeros((d, d))]))
        inside = rows[np.count_nonzero(singular > _OUTSIDE) :].T
        _, size, turn = svd(inside - found @ (found.T @ inside))
        new = inside @ turn[: np.count_nonzero(size > _OUTSIDE)].T
        if not new.shape[1]:
            continue
        made = unidentifiable @ new
        fewer = parts[:, np.abs(parts[away]).max(axis=0, initial=0.0) <= _OUTSIDE]
        own = _pivots(fewer)  # combinations of fewer kinds: their parameters are taken out
        made -= fewer @ np.linalg.solve(fewer[own], made[own])
        parts = np.hstack([parts, _reduced(made)])
        spans += [{*support}] * new.shape[1]
        found = np.linalg.qr(np.hstack([found, new])).Q
    return parts


def _supports(shares: FloatArray) -> Iterator[tuple[Sequence[int], int]]:
    """Yield supports of few kinds, then that of all, and how many combinations each has at most.

    That is how many combinations have next to nothing outside of it, by the `shares` (k, d, d) of
    the kinds. It is told by eigenvalues, which are the squares of what is outside: quicker than the
    singular values, of which they have half the digits. A few supports of thousands have any.
    """
    kinds = len(shares)
    for size in (*range(1, min(_KINDS, kinds) + 1), kinds):
        several = itertools.combinations(range(kinds), size)
        while some := [*itertools.islice(several, _TOGETHER)]:
            inside = sum(shares[list(each)] for each in zip(*some, strict=True))
            outside = np.linalg.eigvalsh(np.eye(shares.shape[1]) - inside)
            dimensions = np.count_nonzero(outside <= 1.001 * _OUTSIDE**2, axis=1)
            yield from zip(some, dimensions.tolist(), strict=True)


def _reduced(basis: FloatArray) -> FloatArray:
    """Eliminate: each combination has a parameter that the others are without."""
    pivots = _pivots(basis)
    reduced = np.linalg.solve(basis[pivots].T, basis.T).T
    largest = [first_largest(sizes, ALIKE * float(sizes.max())) for sizes in np.abs(reduced).T]
    scaled: FloatArray = reduced / reduced[largest, np.arange(len(pivots))]
    return scaled


def _pivots(basis: FloatArray) -> list[int]:
    """Parameters, one for each combination, that tell the combinations apart best.

    Which they are depends on the space that the columns span alone, not on the columns: the linear
    algebra library turns these in their space as rounding has it.
    """
    rest, pivots = np.linalg.qr(basis).Q, list[int]()
    for _ in range(basis.shape[1]):
        sizes = np.linalg.norm(rest, axis=1)
        pivots.append(first_largest(sizes, ALIKE * float(sizes.max())))
        along = rest[pivots[-1]] / sizes[pivots[-1]]
        rest -= np.outer(rest @ along, along)
    return pivots


def as_sum(
    combination: FloatArray, names: Sequence[str], units: Sequence[str], scale: FloatArray
) -> str:
    """Print a combination of parameters, such as "base1.x + base2.x − platform1.x".

    Measurements do not change where the parameters change together in these proportions. The
    largest come first, with two digits; what is below 0.01 of the largest is left out. Where units
    differ it is said how numbers in other units than mm count.

    Parameters
    ----------
    combination : ndarray (n,)
        Its largest entry is 1.
    names, units : sequence of str
        Of the parameters.
    scale : ndarray (n,)
        How much of its unit is 1 in the combination.
    """
    groups: dict[float, list[str]] = {}
    for value, name in zip(combination, names, strict=True):
        if abs(value) > _LEAST:
            groups.setdefault(float(f"{round(float(value), _SURE):.2g}"), []).append(name)
    terms = [
        (value, text)
        for value, group in sorted(groups.items(), key=lambda pair: (-abs(pair[0]), -pair[0]))
        for text in _runs(group, " − … − " if value < 0 else " + … + ", abs(value) == 1.0)
    ]
    text = "".join(
        f"{' − ' if value < 0 else ' + '}{'' if abs(value) == 1.0 else f'{abs(value):g} '}{name}"
        for value, name in terms[:_MOST]
    )
    if len(terms) > _MOST:
        text += f" + … ({len(terms) - _MOST} more, of at most {abs(terms[_MOST][0]):g})"
    there = np.flatnonzero(np.abs(combination) > _LEAST).tolist()
    count_as = {units[i]: 1.0 / float(scale[i]) for i in there}
    if len(count_as) > 1:
        others = {unit: factor for unit, factor in count_as.items() if unit != "mm"}
        text += f" ({', '.join(_counted(unit, factor) for unit, factor in others.items())})"
    return text.removeprefix(" + ")


def _counted(unit: str, factor: float) -> str:
    """Return the weight of a number that is no length among lengths in mm."""
    if unit == "rad":
        return f"angles as arcs at {factor:.4g} mm"
    return f"numbers {'without unit' if unit == '1' else f'in {unit}'} times {factor:.3g}"


def listed(names: Sequence[str]) -> str:
    """Names in a row; three and more that only count on, as "base1.x … base4.x"."""
    return ", ".join(_runs(names, " … "))


def _runs(names: Sequence[str], between: str, fold: bool = True) -> list[str]:
    """Names, three and more that only count on folded into one text."""
    texts: list[str] = []
    run: list[str] = []
    for name in [*names, ""]:
        if run and _follows(run[-1], name):
            run.append(name)
            continue
        texts += [f"{run[0]}{between}{run[-1]}"] if fold and len(run) > 2 else run
        run = [name]
    return texts


def _follows(name: str, next_name: str) -> bool:
    number = re.search(r"\d+", name)
    if number is None:
        return False
    counted = name[: number.start()] + str(int(number.group()) + 1) + name[number.end() :]
    return counted == next_name
