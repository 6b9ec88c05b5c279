"""Draws of residuals that look like those of a fit, by chance alone.

Tests take errors to be Gaussian, equal and independent. Rounded logs of actuators give those of a
pose in common, sessions have noise of their own, instruments heavy tails: what is shown alike by
draws that have all of this is by chance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pkmcal.arrays import FloatArray, IntArray
from pkmcal.statistics.cluster_noise import Clusters, variances
from pkmcal.statistics.linear_fit import LinearFit
from pkmcal.statistics.weighed import Halves

_DRAWS = 39
_TURNED = 3  # equations of a visit, whose errors another machine does not turn to any side
_LEAST_LEFT = 0.05  # of an equation, that its own value does not decide
_VISITS = 300  # that tell what causes share
_LEAST = 1e-6  # share of the largest variance of a visit, below which another is as large
_TOLD = 1e-6  # share of a parameter's information that these visits have, at least


def drawn_alike(
    fit: LinearFit,
    use: IntArray,
    visit: IntArray,
    component: IntArray,
    by_cause: FloatArray | None = None,
) -> Iterator[LinearFit]:
    """Fits of errors drawn at random, as large at each visit as those of the fit are.

    Where each component was read once at a visit these share errors: as causes let them that are
    independent at each visit, where they are given, else as they do on average. A visit of few
    equations is as large as that on average alone: of the same size, errors of a single one would
    have another sign at most, as those of another machine have.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    use : ndarray of int (u,)
        Equations that are drawn.
    visit, component : ndarray of int (u,)
        Of these, by number from 0.
    by_cause : ndarray (M, n) or None
        What each cause does to the equations.
    """
    rng = np.random.default_rng(0)
    left = fit.residual / np.sqrt(np.maximum(1.0 - fit.leverage(), _LEAST_LEFT))
    halves = _halves(fit, left, use, visit, component, by_cause)
    equations = np.bincount(visit)
    of_visit = np.zeros(len(left), dtype=np.intp)
    of_visit[use] = visit
    size = np.zeros(len(equations))
    for rows, half in halves:
        each = np.linalg.solve(half, left[rows][:, :, None])
        size += np.bincount(of_visit[rows[:, 0]], (each**2).sum(axis=(1, 2)), len(size))
    for _ in range(_DRAWS):
        drawn = [rng.normal(size=(*rows.shape, 1)) for rows, _ in halves]
        own = np.zeros(len(size))
        for (rows, _), each in zip(halves, drawn, strict=True):
            own += np.bincount(of_visit[rows[:, 0]], (each**2).sum(axis=(1, 2)), len(size))
        scale = np.sqrt(size / np.where(equations < _TURNED, equations, own))
        noise = np.zeros(len(left))
        for (rows, half), each in zip(halves, drawn, strict=True):
            noise[rows] = scale[of_visit[rows]] * (half @ each)[:, :, 0]
        yield replace(fit, residual=noise - fit.design @ (fit.design.T @ noise))


def _halves(
    fit: LinearFit,
    left: FloatArray,
    use: IntArray,
    visit: IntArray,
    component: IntArray,
    by_cause: FloatArray | None,
) -> list[Halves]:
    """Halves of the covariance of equations that share errors."""
    count, components = int(visit.max()) + 1, int(component.max()) + 1
    if len(np.unique(visit * components + component)) < len(use):
        return [(use[:, None], np.ones((len(use), 1, 1)))]
    named = np.zeros(len(left), dtype=np.intp)
    named[use] = component
    order = use[np.lexsort((component, visit))]
    counts = np.bincount(visit)
    begins = np.cumsum(counts) - counts
    together = [order[begins[counts == m, None] + np.arange(m)] for m in np.unique(counts).tolist()]
    if by_cause is not None:
        clusters = [_parts(rows, named[rows], by_cause, components) for rows in together]
        theta = _told(fit, clusters, -(-count // _VISITS))
        if theta is not None:
            return [(each.left, _root(np.tensordot(theta, each.parts, 1))) for each in clusters]
    every = np.zeros((count, components))
    every[visit, component] = left[use]
    common = every.T @ every / count
    return [
        (rows, _root(common[named[rows][:, :, None], named[rows][:, None, :]])) for rows in together
    ]


def _root(covariance: FloatArray) -> FloatArray:
    """A half (n, m, m) of covariances that may be singular, which this is not."""
    size, ways = np.linalg.eigh(covariance)
    least = _LEAST * np.maximum(size.max(axis=1, keepdims=True), np.finfo(float).tiny)
    half: FloatArray = ways * np.sqrt(np.maximum(size, least))[:, None, :]
    return half


def _parts(rows: IntArray, named: IntArray, by_cause: FloatArray, components: int) -> Clusters:
    """Noise of each component, and of all causes, of visits with these equations (n, m)."""
    own = (named == np.arange(components)[:, None, None])[..., None] * np.eye(rows.shape[1])
    cause = by_cause[rows]
    return Clusters(rows, np.concatenate([own, (cause @ cause.transpose(0, 2, 1))[None]]))


def _told(fit: LinearFit, clusters: list[Clusters], every: int) -> FloatArray | None:
    """Variances of components and of causes; None where there are no causes or too few visits."""
    size = np.mean(np.concatenate([
        np.trace(each.parts[-1], axis1=1, axis2=2) / each.left.shape[1] for each in clusters
    ]))  # fmt: skip
    some = [Clusters(each.left[::every], each.parts[:, ::every]) for each in clusters]
    rows = np.concatenate([each.left.ravel() for each in some])
    design = fit.design[rows]
    known = design.T @ design + fit.prior.T @ fit.prior
    if not size > 0.0 or np.linalg.eigvalsh(known).min(initial=1.0) < _TOLD:
        return None
    noise = fit.squares / fit.freedom
    scale = np.append(np.full(len(some[0].parts) - 1, noise), noise / size)
    units = scale[:, None, None, None]
    pull = fit.design.T @ fit.residual  # that of the prior is the opposite
    beyond = -np.linalg.lstsq(fit.prior.T, pull, rcond=None)[0]
    some = [Clusters(each.left, units * each.parts) for each in some]
    return scale * variances(fit, beyond, some)
