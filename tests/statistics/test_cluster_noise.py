"""Noises that equations of a cluster share: those at which the restricted likelihood is largest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.optimize import minimize

from pkmcal.arrays import FloatArray
from pkmcal.statistics.cluster_noise import Clusters, variances, weighed_by
from pkmcal.statistics.linear_fit import LinearFit, linear_fit

TRUE = np.array([0.5, 3.0])  # variances of rows, and of what a cluster shares
SIZES = (2, 5)  # equations of a cluster, of two kinds
COUNT = 20  # clusters of each


def drawn(
    seed: int, true: FloatArray = TRUE, priors: int = 2
) -> tuple[LinearFit, FloatArray, list[Clusters]]:
    """A fit of unit weights: each cluster has noise of its rows, and one that moves all of them."""
    rng = np.random.default_rng(seed)
    m, p = COUNT * sum(SIZES), 4
    order, clusters, first = rng.permutation(m), [], 0  # rows of a cluster stand anywhere
    noise = np.sqrt(true[0]) * rng.normal(size=m)
    for size in SIZES:
        left = order[first : first + COUNT * size].reshape(COUNT, size)
        way = rng.uniform(0.5, 1.5, (COUNT, size))
        noise[left] += np.sqrt(true[1]) * way * rng.normal(size=(COUNT, 1))
        own = np.broadcast_to(np.eye(size), (COUNT, size, size))
        clusters.append(Clusters(left, np.stack([own, way[:, :, None] * way[:, None, :]])))
        first += COUNT * size
    jacobian, prior = rng.normal(size=(m, p)), rng.normal(size=(priors, p))
    stated = rng.normal(size=priors)  # of numbers that are 0
    whole = np.vstack([jacobian, prior])
    b = np.linalg.lstsq(whole, np.concatenate([noise, stated]), rcond=None)[0]
    rows = np.arange(m)
    fit = linear_fit(jacobian, noise - jacobian @ b, prior, np.eye(p), rows, 0 * rows)
    return fit, stated - prior @ b, clusters


def covariance(clusters: list[Clusters], theta: FloatArray) -> FloatArray:
    """The covariance of all equations, (M, M)."""
    places = np.concatenate([each.left.ravel() for each in clusters])
    blocks = [one for each in clusters for one in np.tensordot(theta, each.parts, 1)]
    whole = np.zeros((len(places), len(places)))
    whole[np.ix_(places, places)] = block_diag(*blocks)
    return whole


def solved(
    fit: LinearFit, beyond: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal matrix, residuals and those of the prior of generalised least squares, by inverses."""
    inverse = np.linalg.inv(noise)
    normal = fit.design.T @ inverse @ fit.design + fit.prior.T @ fit.prior
    b = np.linalg.solve(normal, fit.design.T @ inverse @ fit.residual + fit.prior.T @ beyond)
    return normal, fit.residual - fit.design @ b, beyond - fit.prior @ b


@pytest.mark.parametrize(("seed", "priors"), [(0, 2), (1, 0), (2, 2)])
def test_variances_are_those_of_the_largest_restricted_likelihood(seed: int, priors: int) -> None:
    """Against a dense likelihood that SciPy maximises."""
    fit, beyond, clusters = drawn(seed, priors=priors)

    def unlikely(logarithms: FloatArray) -> float:
        noise = covariance(clusters, np.exp(logarithms))
        normal, residual, left = solved(fit, beyond, noise)
        squares = residual @ np.linalg.solve(noise, residual) + left @ left
        return float(np.linalg.slogdet(noise)[1] + np.linalg.slogdet(normal)[1] + squares)

    best = minimize(unlikely, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-5})
    assert_allclose(variances(fit, beyond, clusters), np.exp(best.x), rtol=2e-3)


def test_variances_of_draws_are_those_that_were_drawn() -> None:
    found = np.array([variances(*drawn(seed)) for seed in range(60)])
    error = found.std(axis=0) / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - TRUE) < 3.5 * error).all()
    assert (error < 0.1 * TRUE).all()  # else it shows nothing


def test_of_rows_alone_it_is_the_mean_square_with_degrees_of_freedom() -> None:
    fit, beyond, clusters = drawn(3, priors=0)
    alone = [Clusters(each.left, each.parts[:1]) for each in clusters]
    assert variances(fit, beyond, alone) == pytest.approx(fit.squares / fit.freedom, rel=1e-3)


def test_equations_that_are_in_no_cluster_tell_nothing() -> None:
    """Nor is a group that no cluster has changed."""
    fit, beyond, clusters = drawn(4)
    (few,) = clusters[:1]
    found = variances(fit, beyond, [few])
    louder = fit.residual.copy()
    louder[clusters[1].left] *= 1000.0
    assert_allclose(variances(replace(fit, residual=louder), beyond, [few]), found, rtol=1e-12)
    absent = Clusters(few.left, np.concatenate([few.parts, np.zeros_like(few.parts[:1])]))
    three = variances(fit, beyond, [absent])
    assert_allclose(three, [*found, 1.0], rtol=1e-12)


def test_a_fit_with_these_variances_is_that_of_generalised_least_squares() -> None:
    fit, beyond, clusters = drawn(5)
    noise = covariance(clusters, TRUE)
    normal, residual, _ = solved(fit, beyond, noise)
    found = weighed_by(fit, beyond, clusters, TRUE)
    assert_allclose(found.unweigh(found.fit.residual), residual, atol=1e-10)
    assert_allclose(
        found.fit.design.T @ found.fit.design + found.fit.prior.T @ found.fit.prior,
        np.eye(4),
        atol=1e-10,
    )
    by_inverse = fit.back @ np.linalg.inv(normal) @ fit.back.T
    assert_allclose(found.fit.back @ found.fit.back.T, by_inverse, atol=1e-10)
    weighed = found.weigh(np.linalg.cholesky(noise))
    assert_allclose(weighed @ weighed.T, np.eye(len(noise)), atol=1e-9)  # noise of one


def fitted(design: np.ndarray, values: np.ndarray) -> LinearFit:
    left, singular, right = np.linalg.svd(design, full_matrices=False)
    rows = np.arange(len(values))
    residual = values - left @ (left.T @ values)
    return linear_fit(
        left, residual, np.zeros((0, design.shape[1])), right.T / singular, rows, 0 * rows
    )


def test_a_parameter_that_the_clusters_do_not_tell_changes_no_variance() -> None:
    """One of rows alone that are left out, as outliers are."""
    rng = np.random.default_rng(5)
    design, noise = rng.normal(size=(60, 3)), np.repeat([1.0, 4.0], 30)
    values = noise * rng.normal(size=60)
    design[40:, 2] = 0.0
    used = np.r_[0:25, 30:40]
    design[used, 2] = 0.0
    groups = np.zeros((2, len(used), 1, 1))
    groups[0, used < 30], groups[1, used >= 30] = 1.0, 1.0
    clusters = [Clusters(used[:, None], groups)]
    without = fitted(design[used, :2], values[used])
    alone = [Clusters(np.arange(len(used))[:, None], groups)]
    found = variances(fitted(design, values), np.zeros(0), clusters)
    expected = variances(without, np.zeros(0), alone)
    assert np.allclose(found, expected, rtol=1e-3)
