"""95 % intervals hold the true value in 95 % of fits, whatever rows of a pose share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pkmcal.arrays import FloatArray
from pkmcal.statistics.clusters import Sandwich, shared_error_score
from pkmcal.statistics.covariance import covariance
from pkmcal.statistics.distributions import f_tail
from pkmcal.statistics.linear_fit import LinearFit, linear_fit

from .designs import Design, arm, coverage, errors, hexapod

Covered = Callable[[LinearFit], tuple[FloatArray, FloatArray]]


def by_rule(design: Design, rule: str = "auto") -> Covered:
    def covered(fit: LinearFit) -> tuple[FloatArray, FloatArray]:
        found = covariance(fit, rule, stated=False, robust=False)  # type: ignore[arg-type]
        return np.diagonal(found.of(design.contrasts)), found.freedom(design.contrasts)

    return covered


def exact(design: Design, shared: float) -> FloatArray:
    """Deviations of the least-squares parameters, from the covariance of the errors itself."""
    fit = design.fit
    same = (fit.key()[:, None] == fit.key()).astype(float)
    middle = fit.design.T @ (np.eye(len(fit.key())) + shared**2 * same) @ fit.design
    return np.sqrt(np.diagonal(design.contrasts @ middle @ design.contrasts.T))


def small() -> LinearFit:
    """Twelve clusters of one to three equations, three parameters, one prior row."""
    rng = np.random.default_rng(3)
    cluster = np.sort(np.concatenate([np.arange(12), rng.integers(0, 12, 14)]))
    jacobian = rng.normal(size=(26, 3))
    prior = np.array([[0.7, 0.0, 0.0]])
    return linear_fit(jacobian, rng.normal(size=26), prior, np.eye(3), cluster, cluster % 2)


# --- the formulas, against the definitions with large matrices ------------------------------------


def test_the_basis_makes_the_normal_matrix_the_identity() -> None:
    fit = small()
    whole = fit.design.T @ fit.design + fit.prior.T @ fit.prior
    np.testing.assert_allclose(whole, np.eye(3), atol=1e-12)


def test_adjusted_residuals_have_the_variance_of_their_errors() -> None:
    for fit in (small(), hexapod(3, 30).fit):
        sandwich = Sandwich(fit)
        hat = fit.design @ fit.design.T
        adjust = sandwich.adjusted(np.eye(len(hat)))
        for cluster in range(fit.clusters):
            mine = np.flatnonzero(fit.cluster == cluster)
            left = np.eye(len(mine)) - hat[np.ix_(mine, mine)]
            block = adjust[np.ix_(mine, mine)]
            restored = block @ left @ block
            values, vectors = np.linalg.eigh(left)
            told = vectors[:, values > 1e-8]
            np.testing.assert_allclose(restored, told @ told.T, atol=1e-7)
            np.testing.assert_allclose(
                sandwich.retained[mine], np.diagonal(told @ told.T), atol=1e-7
            )


def test_degrees_of_freedom_are_satterthwaites() -> None:
    """2 E² / Var of the variance estimate, a quadratic form in independent errors."""
    fit = small()
    contrast = np.array([[0.3, -1.0, 0.5]])
    # without a prior exactly; the rows of one take part of the leverage
    free = replace(fit, prior=np.zeros((0, 3)), design=np.linalg.qr(fit.design).Q)
    sandwich = Sandwich(free)
    maker = np.eye(26) - free.design @ free.design.T
    form = np.zeros((26, 26))
    for cluster in range(free.clusters):
        mine = free.cluster == cluster
        along = sandwich.adjusted((free.design @ contrast[0] * mine)[:, None])[:, 0]
        form += np.outer(maker @ along, maker @ along)
    values = np.linalg.eigvalsh(form)
    found = sandwich.freedom(contrast)[0]
    assert found == pytest.approx(values.sum() ** 2 / (values**2).sum(), rel=1e-9)
    y = free.residual
    variance = (contrast @ Sandwich(replace(free, residual=maker @ y)).data @ contrast.T)[0, 0]
    assert variance == pytest.approx(y @ form @ y, rel=1e-9)


def test_the_score_has_the_moments_of_its_quadratic_form() -> None:
    """Under independent errors its mean is 0 and its deviation 1, by simulation."""
    for design in (arm(15), hexapod(15, 5)):
        rng = np.random.default_rng(1)
        scores = [
            shared_error_score(design.fitted(errors(design, 0.0, rng))[0]) for _ in range(400)
        ]
        assert np.mean(scores) == pytest.approx(0.0, abs=4 / np.sqrt(400))
        assert np.std(scores) == pytest.approx(1.0, abs=0.15)


def test_one_row_a_pose_has_no_score() -> None:
    design = hexapod(60)
    fit, _ = design.fitted(errors(design, 0.0, np.random.default_rng(0)))
    assert shared_error_score(fit) == -np.inf


def test_a_known_prior_adds_degrees_of_freedom() -> None:
    """A parameter that only the prior determines is as sure as the prior, however few data."""
    design = np.zeros((6, 2))
    design[:, 0] = 1.0 / np.sqrt(6.0)
    fit = LinearFit(
        design, np.array([1.0, -1, 1, -1, 0, 0]), np.array([[0.0, 1.0]]), np.eye(2),
        np.arange(6), np.zeros(6, dtype=np.intp),
    )  # fmt: skip
    for rule in ("classical", "cluster"):
        found = covariance(fit, rule, stated=False, robust=False)  # type: ignore[arg-type]
        freedom = found.freedom(np.eye(2))
        assert freedom[0] == pytest.approx(5.0)
        assert freedom[1] == np.inf
        assert found.of(np.eye(2))[1, 1] == pytest.approx(1.0)


# --- what the intervals hold ----------------------------------------------------------------------

QUICK = [("arm", 15, 0.0), ("arm", 15, 3.0), ("hexapod", 15, 2.0)]
CELLS = [
    *(("arm", poses, shared) for poses in (12, 15, 40) for shared in (0.0, 0.5, 3.0)),
    *(("hexapod", poses, shared) for poses in (15, 40) for shared in (0.0, 0.5, 2.0)),
]


def cell(name: str, poses: int) -> Design:
    return arm(poses) if name == "arm" else hexapod(poses, 5)


@pytest.mark.parametrize(("name", "poses", "shared"), QUICK)
def test_intervals_hold_95_percent_though_rows_of_a_pose_share_errors(
    name: str, poses: int, shared: float
) -> None:
    design = cell(name, poses)
    held, half, _ = coverage(design, lambda rng: errors(design, shared, rng), by_rule(design), 120)
    assert 0.92 < held < 0.98
    if not shared:
        assert (half.mean(axis=0) / 1.96 / exact(design, 0.0)).mean() < 1.08


@pytest.mark.slow
@pytest.mark.parametrize(("name", "poses", "shared"), CELLS)
def test_intervals_hold_93_to_97_percent_in_500_fits(name: str, poses: int, shared: float) -> None:
    design = cell(name, poses)
    held, half, _ = coverage(design, lambda rng: errors(design, shared, rng), by_rule(design), 500)
    assert 0.93 < held < 0.97
    if not shared and poses >= 15:
        # what is paid for errors that might be shared: with 15 poses 1.047 (arm) and 1.057
        # (hexapod) in thousands of runs
        width = (half.mean(axis=0) / 1.96 / exact(design, 0.0)).mean()
        assert width < (1.035 if poses == 40 else 1.07)


@pytest.mark.slow
@pytest.mark.parametrize(
    "design", [hexapod(60), hexapod(15, 1, "pose"), hexapod(40, 1, "pose", None)]
)
def test_rows_that_share_nothing_have_students_intervals(design: Design) -> None:
    held, half, _ = coverage(design, lambda rng: errors(design, 0.0, rng), by_rule(design), 500)
    assert 0.93 < held < 0.97
    assert (half.mean(axis=0) / 1.96 / exact(design, 0.0)).mean() < 1.03


def test_classical_intervals_are_too_small_where_rows_share_errors() -> None:
    design = arm(15)
    held, _, _ = coverage(
        design, lambda rng: errors(design, 3.0, rng), by_rule(design, "classical"), 60
    )
    assert held < 0.85


@pytest.mark.parametrize(
    ("equations", "true", "least"),
    [(60, 1.0, 0.945), (60, 1.5, 0.935), (24, 1.2, 0.915), (24, 2.0, 0.935), (60, 5.0, 0.94)],
)
def test_a_refuted_sigma_is_scaled(equations: int, true: float, least: float) -> None:
    """Birge ratio: never down, up where the residuals leave no more than a tenth of chance."""
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(equations, 12))).Q
    rows = np.arange(equations)
    fit = LinearFit(basis, np.zeros(equations), np.zeros((0, 12)), np.eye(12), rows, 0 * rows)
    design = Design(fit, np.ones(12, dtype=bool), rows)  # type: ignore[arg-type]

    def covered(fit: LinearFit) -> tuple[FloatArray, FloatArray]:
        found = covariance(fit, "auto", stated=True, robust=False)
        assert found.scale >= 1.0
        return np.diagonal(found.of(np.eye(12))), found.freedom(np.eye(12))

    held, _, _ = coverage(design, lambda rng: true * rng.normal(size=equations), covered, 1500)
    assert least < held < 0.965


# --- several contrasts at once -------------------------------------------------------------------


def test_one_contrast_has_the_same_degrees_of_freedom_alone_and_together() -> None:
    sandwich = Sandwich(arm(15).fit)
    for row in arm(15).contrasts[:5]:
        assert sandwich.joint_freedom(row[None]) == pytest.approx(sandwich.freedom(row[None])[0])


@pytest.mark.parametrize(
    ("poses", "least"), [(15, 0.0), (40, 0.01)]
)  # with few poses the test keeps to the safe side
@pytest.mark.parametrize("shared", [0.0, 2.0])
def test_numbers_that_are_zero_are_found_needed_in_5_of_100(
    poses: int, least: float, shared: float
) -> None:
    """Hotelling's T² with the degrees of freedom of all of them, not the least of any."""
    design, rng = hexapod(poses, 5), np.random.default_rng(0)
    contrasts, count, found = design.contrasts, len(design.contrasts), []
    freedom = Sandwich(design.fit).joint_freedom(contrasts) - count + 1.0
    for _ in range(500):
        fit, wrong = design.fitted(errors(design, shared, rng))
        matrix = contrasts @ Sandwich(fit).data @ contrasts.T
        ratio = float(wrong @ np.linalg.solve(matrix, wrong)) / count
        found.append(f_tail(ratio * freedom / (freedom + count - 1.0), count, freedom))
    assert least <= np.mean(np.array(found) < 0.05) <= 0.075
