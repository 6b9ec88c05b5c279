"""Accuracy of a machine by itself, wherever its base and its platform are drawn.

A camera tells neither where the base is nor where on the platform its board is to more than the
lens allows, and no user needs it: what counts is how far the platform is off elsewhere after the
best motions of both frames.
"""

from __future__ import annotations

import numpy as np

from pkmcal import screw
from pkmcal.arrays import FloatArray, propagate, rms
from pkmcal.fitted.fit import Fit
from pkmcal.kinematics.calibratable import as_given, as_machine

UNDETERMINED = 1e-3  # mm a pose or target moves per mm along an undetermined combination
_TOLD = 1e-9  # of the largest, a singular value of the motions of frames


def machine_accuracy(fit: Fit, places: FloatArray, reference: FloatArray) -> FloatArray:
    """Predict the standard deviation of the platform, mm (N,), but for motions of its frames.

    Parameters
    ----------
    fit : Fit
        Of sessions the machine is that of the last.
    places : ndarray (N, 6), of an arm (N, n)
        Where.
    reference : ndarray (M, 6), of an arm (M, n)
        Places over which both frames are moved as far as possible onto the true ones.

    Returns
    -------
    ndarray (N,)
        inf where it moves along with what the measurements do not determine.
    """
    return _deviations(fit, machine_rates(fit, places, reference))


def _deviations(fit: Fit, alone: FloatArray) -> FloatArray:
    """Return `machine_accuracy` (N,) by the `machine_rates` (N, 3, g) of its places."""
    own = fit.parameters.geometry_of()
    variance = propagate(alone, fit.covariance[np.ix_(own, own)])
    undetermined = (fit.undetermined() * fit.parameters.scale[:, None])[own]
    moved = np.linalg.norm(alone @ undetermined, axis=(1, 2))
    return np.where(moved < UNDETERMINED, np.sqrt(variance), np.inf)


def measured_places(fit: Fit) -> FloatArray:
    """The measured poses (N, 6), of an arm (N, n), as places of `machine_accuracy`."""
    end = fit.end
    at = fit.parameters.robot.as_commands(end.pose, end.actuators)
    return at[np.isfinite(end.pose).all(axis=1)]


def times_stated(fit: Fit, changes: FloatArray) -> float:
    """How far changes of the parameters move the machine, over how well it is stated to be known.

    Rms over the measured poses, but for motions of its frames; NaN where it is not known.

    Parameters
    ----------
    fit : Fit
        The fit.
    changes : ndarray (n, k)
        Of the parameters, mm and rad, by k errors that have nothing to do with each other.
    """
    places = measured_places(fit)
    if not len(places):
        return float("nan")
    alone = machine_rates(fit, places, places)
    off = alone @ changes[fit.parameters.geometry_of()]
    stated = rms(_deviations(fit, alone))
    usual = np.isfinite(stated) and stated > 0.0
    return float(np.sqrt(np.square(off).sum() / len(off)) / stated) if usual else float("nan")


def machine_rates(fit: Fit, places: FloatArray, reference: FloatArray) -> FloatArray:
    """How the platform's places (N, 3, g) follow numbers, but for motions of its frames.

    Numbers are those of `Parameters.geometry_of`; places and reference as of `machine_accuracy`.
    """
    rates, motions = _rates(fit, reference)
    left, size, right = np.linalg.svd(motions.reshape(-1, 12), full_matrices=False)
    told = size > _TOLD * size[0]
    flat = rates.reshape(len(left), -1)
    follow = right[told].T @ ((left[:, told].T @ flat) / size[told, None])
    own_rates, own_motions = (rates, motions) if places is reference else _rates(fit, places)
    alone: FloatArray = (own_rates - own_motions @ follow)[:, 3:]
    return alone


def _rates(fit: Fit, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Twists (N, 6, g) of the platform by numbers and (N, 6, 12) by motions of frames, as arcs."""
    chosen = fit.parameters
    machine = as_machine(as_given(chosen.robot.replace(chosen.values_at(fit.end.theta))))
    at, q, _ = machine.commanded(places)
    weights = np.repeat([machine.length, 1.0], 3)[:, None]
    rates = machine.error_twists(at, q)[:, :, chosen.places] * weights
    pose = screw.from_pose(at)
    motions = np.zeros((len(at), 6, 12))
    motions[:, :3, :3] = motions[:, 3:, 3:6] = np.eye(3)
    motions[:, 3:, :3] = -np.cross(pose[:, :3, 3, None], np.eye(3)[None], axisa=1, axisb=1, axisc=1)
    motions[:, :3, 6:9] = motions[:, 3:, 9:] = pose[:, :3, :3]
    known: FloatArray = motions * weights
    return rates, known
