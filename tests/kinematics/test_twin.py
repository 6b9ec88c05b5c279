"""The laws that the NumPy twin obeys on machines made by hand, and the published digits."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from .. import twin

RNG_SEED = 3
EX_THIRD = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)  # columns ey, ez, ex
EY_THIRD = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], float)  # columns ez, ex, ey


def limb(kind: str, actuator: int, **changes: Any) -> SimpleNamespace:
    fields = {
        "kind": kind,
        "actuator": actuator,
        "branch": 0,
        "frame": np.eye(3),
        "platform_frame": np.eye(3),
    }
    return SimpleNamespace(**(fields | {"couple": 0.0, "weights": ()} | changes))


def machine(
    pose_map: str, home: list[float], limbs: list[SimpleNamespace], rows: list[dict[str, Any]]
) -> SimpleNamespace:
    slots = np.zeros((len(limbs), len(twin.SLOTS)))
    for slot, row in zip(slots, rows, strict=True):
        slot[:3], slot[3:6] = row["base"], row["platform"]
        slot[twin.SLOTS.index("gain")] = 1.0
        for name, value in row.items():
            if name not in ("base", "platform"):
                slot[twin.SLOTS.index(name)] = value
    return SimpleNamespace(
        map=pose_map, home=np.array(home), limbs=limbs, geometry=SimpleNamespace(slots=slots)
    )


def ring(radius: float, degrees: float, z: float = 0.0) -> list[float]:
    angle = np.radians(degrees)
    return [radius * np.cos(angle), radius * np.sin(angle), z]


def hexapod() -> SimpleNamespace:
    base, platform = (-10, 10, 110, 130, 230, 250), (-50, 50, 70, 170, 190, 290)
    rows = [
        {"base": ring(300, a), "platform": ring(150, b), "offset": 0.3, "gain": 1.001}
        for a, b in zip(base, platform, strict=True)
    ]
    return machine("spatial", [0, 0, 400, 0, 0, 0], [limb("UPS", i) for i in range(6)], rows)


def linear_delta(per_carriage: int = 1) -> SimpleNamespace:
    limbs, rows = [], []
    for i, angle in enumerate((210, 330, 90)):
        across = np.array(ring(25, angle + 90))
        for side in (0,) if per_carriage == 1 else (-1, 1):
            limbs.append(limb("PUS", i, branch=-1))
            base, platform = ring(180, angle), ring(30, angle)
            rows.append({"base": base + side * across, "platform": platform + side * across})
            rows[-1] |= {"rod": 340.0, "offset": 2.0}
            if per_carriage == 1:
                rows[-1] |= {"tilt1": 0.01, "tilt2": -0.02}
    return machine("translation", [0, 0, 30, 0, 0, 0], limbs, rows)


def rotary_delta(branch: int) -> SimpleNamespace:
    limbs, rows = [], []
    for i, angle in enumerate((0, 120, 240)):
        out, axis = np.array(ring(1, angle)), np.array(ring(1, angle - 90))
        frame = np.column_stack([out, np.cross(axis, out), axis])  # q = 0 points outwards
        limbs.append(limb("RUS", i, branch=branch, frame=frame))
        rows.append(
            {"base": 120 * out, "platform": 40 * out, "crank": 150.0, "rod": 350.0, "tilt1": 0.01}
        )
    return machine("translation", [0, 0, -300, 0, 0, 0], limbs, rows)


def planar_3rrr() -> SimpleNamespace:
    rows = [
        {"base": ring(200, a), "platform": ring(60, a), "crank": 120.0, "rod": 130.0}
        for a in (90, 210, 330)
    ]
    return machine("planar", [0] * 6, [limb("RUS", i, branch=1) for i in range(3)], rows)


def three_rps() -> SimpleNamespace:
    limbs, rows = [], []
    for i, angle in enumerate((0, 120, 240)):
        normal = np.array(ring(1, angle + 90))
        frame = np.column_stack([[0, 0, 1], np.cross(normal, [0, 0, 1]), normal])
        limbs.append(limb("RPS", i, frame=frame, weights=(1.0,)))
        rows.append({"base": ring(250, angle), "platform": ring(120, angle)})
    return machine("spatial", [0, 0, 400, 0, 0, 0], limbs, rows)


def paper_machine(d: float, spatial: bool = False) -> SimpleNamespace:
    """2TPR&2TPS of Table 1 and Table 2."""
    rows = [
        {"base": [d, -192.35, 0], "platform": [140, -40, 0]},
        {"base": [d, 192.35, 0], "platform": [140, 40, 0]},
        {"base": [0, 139.25, 0], "platform": [0, 100, 0]},
        {"base": [0, -139.25, 0], "platform": [0, -100, 0]},
    ]
    home = [0, 0, 400, 0, 0, 0]
    if not spatial:
        return machine("2tpr2tps", home, [limb("UPS", i) for i in range(4)], rows)
    axes = {"frame": EY_THIRD, "platform_frame": EX_THIRD, "couple": 100.0, "weights": (1.0, 1.0)}
    limbs = [limb("UPS", 0), limb("UPS", 1), limb("UPR", 2, **axes), limb("UPR", 3, **axes)]
    return machine("spatial", home, limbs, rows)


POSES = {
    "hexapod": (hexapod(), [20, -30, 420, 0.1, -0.15, 0.2]),
    "linear delta": (linear_delta(), [20, -30, 25, 0, 0, 0]),
    "linear delta, two rods a carriage": (linear_delta(2), [20, -30, 25, 0, 0, 0]),
    "rotary delta, branch +1": (rotary_delta(1), [20, -30, -310, 0, 0, 0]),
    "rotary delta, branch -1": (rotary_delta(-1), [20, -30, -310, 0, 0, 0]),
    "planar 3-RRR": (planar_3rrr(), [12, -8, 0, 0, 0, 0.2]),
    "2TPR&2TPS": (paper_machine(294.2), [380 * np.tan(-0.08), 25, 380, 0.12, -0.08, 0]),
}


def test_the_twin_numbers_its_slots_as_the_package_does() -> None:
    from pkmcal.core.library import SLOTS

    assert tuple(SLOTS) == twin.SLOTS


@pytest.mark.parametrize(("model", "pose"), POSES.values(), ids=POSES)
def test_the_closures_vanish_at_the_inverse(model: Any, pose: list[float]) -> None:
    residual = twin.closures(model, np.array(pose), twin.inverse(model, np.array(pose)))
    assert np.abs(residual).max() < 1e-11


@pytest.mark.parametrize(("model", "pose"), POSES.values(), ids=POSES)
def test_forward_undoes_inverse(model: Any, pose: list[float]) -> None:
    found = twin.forward(model, twin.inverse(model, np.array(pose)))
    np.testing.assert_allclose(found, pose, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("model", "pose"), POSES.values(), ids=POSES)
def test_the_branch_is_the_sign_of_u_times_the_anchors_motion(
    model: Any, pose: list[float]
) -> None:
    p, q = np.array(pose, float), twin.inverse(model, np.array(pose))
    for one, n in zip(model.limbs, twin.numbers(model, None), strict=True):
        if one.branch == 0:
            continue
        anchor, _ = twin.driver(one, n, q[one.actuator])
        moved, _ = twin.driver(one, n, q[one.actuator] + 1e-6)
        d = p[:3] + twin.rotation(p) @ twin.platform_point(n) - anchor
        assert np.sign(d @ (moved - anchor)) == one.branch


def test_the_two_rotary_branches_are_different_cranks() -> None:
    pose = np.array([20, -30, -310, 0, 0, 0])
    one, other = twin.inverse(rotary_delta(1), pose), twin.inverse(rotary_delta(-1), pose)
    assert np.abs(one - other).min() > 0.1


def test_a_limb_out_of_reach_is_nan() -> None:
    assert np.isnan(twin.inverse(linear_delta(), np.array([900, 0, 0, 0, 0, 0]))).any()
    assert np.isnan(twin.inverse(rotary_delta(1), np.array([0, 0, -900, 0, 0, 0]))).all()


def test_rotation_is_proper_and_takes_its_angles_in_the_stated_order() -> None:
    R = twin.rotation(np.array([0, 0, 0, 0.3, -0.4, 0.7]))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1.0)
    # about fixed axes: alpha about x first, then beta about y, then gamma about z
    quarter = np.pi / 2
    turned = twin.rotation(np.array([0, 0, 0, quarter, quarter, 0])) @ [0, 1, 0]
    np.testing.assert_allclose(turned, [1, 0, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("d", "free", "lengths"),
    [
        (292.4, (0, 400, 0, 0), (454.352597109338,) * 2 + (401.921089892033,) * 2),
        (294.2, (0, 400, 0, 0), (454.959517429848,) * 2 + (401.921089892033,) * 2),
        (
            292.4,
            (25, 380, 0.12, -0.08),
            (462.963307455999, 454.775423459028, 393.475313335163, 374.920120345963),
        ),
        (
            294.2,
            (25, 380, 0.12, -0.08),
            (463.677487536096, 455.505465837323, 393.475313335163, 374.920120345963),
        ),
    ],
)
def test_published_leg_lengths_of_2tpr2tps(
    d: float, free: tuple[float, ...], lengths: tuple[float, ...]
) -> None:
    model = paper_machine(d)
    pose = twin.pose_of_free(model, np.array(free, float))
    np.testing.assert_allclose(twin.inverse(model, pose), lengths, rtol=0, atol=1e-9)


def test_published_forward_solution_of_2tpr2tps() -> None:
    pose = twin.forward(paper_machine(292.4), np.array([450, 452, 400, 405]))
    published = [6.00092002071403, -6.205857532186, 400.479518293888]
    published += [-0.031217451630, 0.014983215564, 0]
    np.testing.assert_allclose(pose, published, rtol=0, atol=1e-9)


def test_both_passive_constraints_of_the_tpr_limbs_give_x_equal_z_tan_beta() -> None:
    q = np.array([450, 452, 400, 405])
    spatial, mapped = paper_machine(292.4, spatial=True), paper_machine(292.4)
    pose = twin.forward(spatial, q)
    np.testing.assert_allclose(pose, twin.forward(mapped, q), rtol=0, atol=1e-9)
    assert len(twin.closures(spatial, pose, q)) == 8


def test_the_3rps_keeps_its_joints_in_their_planes() -> None:
    model, q = three_rps(), np.array([410, 430, 450])
    pose = twin.forward(model, q)
    np.testing.assert_allclose(twin.inverse(model, pose), q, rtol=0, atol=1e-10)
    for one, n in zip(model.limbs, twin.numbers(model, None), strict=True):
        joint = pose[:3] + twin.rotation(pose) @ twin.platform_point(n)
        assert abs(joint @ one.frame[:, 2]) < 1e-10
    assert abs(pose[3]) > 0.01 and abs(pose[4]) > 0.01


SQUARE = [name for name in POSES if "two rods" not in name]


@pytest.mark.parametrize("name", SQUARE)
def test_forward_jacobian_is_the_inverse_of_the_pose_jacobian(name: str) -> None:
    model, pose = POSES[name][0], np.array(POSES[name][1], float)
    product = twin.pose_jacobian(model, pose) @ twin.forward_jacobian(
        model, twin.inverse(model, pose)
    )
    np.testing.assert_allclose(product, np.eye(len(product)), rtol=0, atol=1e-6)


def test_offset_moves_the_pose_as_its_actuator_does() -> None:
    model, pose = POSES["hexapod"][0], np.array(POSES["hexapod"][1], float)
    q = twin.inverse(model, pose)
    by_slot = twin.error_jacobian(model, q).reshape(6, 6, len(twin.SLOTS))
    offsets = by_slot[:, :, twin.SLOTS.index("offset")]
    gains = np.array([n["gain"] for n in twin.numbers(model, None)])
    np.testing.assert_allclose(offsets * gains, twin.forward_jacobian(model, q), atol=1e-8)
    # gain scales the actuator, so its column is q times the offset's
    np.testing.assert_allclose(by_slot[:, :, twin.SLOTS.index("gain")], offsets * q, atol=1e-5)


def test_shifting_every_base_point_shifts_the_pose() -> None:
    model, pose = POSES["hexapod"][0], np.array(POSES["hexapod"][1], float)
    by_slot = twin.error_jacobian(model, twin.inverse(model, pose)).reshape(6, 6, -1)
    moved = by_slot[:, :, :3].sum(axis=1)
    np.testing.assert_allclose(moved, np.eye(6, 3), atol=1e-9)


def test_a_random_small_error_moves_the_pose_by_the_error_jacobian() -> None:
    model, pose = POSES["rotary delta, branch -1"][0], POSES["rotary delta, branch -1"][1]
    q = twin.inverse(model, np.array(pose))
    slots = model.geometry.slots
    error = 1e-5 * np.random.default_rng(RNG_SEED).standard_normal(slots.size)
    moved = twin.forward(model, q, slots + error.reshape(slots.shape)) - twin.forward(model, q)
    np.testing.assert_allclose(moved, twin.error_jacobian(model, q) @ error, atol=1e-7)
