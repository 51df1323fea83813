"""Faults too large for an adjustment to reach: devices swapped, or far from place."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import DeviceCalibration

from .adjustment import adjust
from .bundle import SHIFT, TURN, Bundle
from .explanations import Change, Explanation, misfit
from .supposed import Evidence, Role, Supposed

_ROLES: tuple[Role, Role] = ("cameras", "projectors")
# Directions about the object that a device is tried in, and turns about each.
_PLACES, _ROLLS = 120, 6
# Starts are compared on every so many edges, with this cap; the best few are fitted.
_THIN, _FAR_CAP_M, _FITTED = 4, 5e-2, 12
# What a device may have been turned and displaced by from there [rad], [m].
_TURNED, _SHIFTED_M = 0.3, 0.3


def gross(evidence: Evidence, rig: Supposed) -> Explanation:
    """Return the swap, or the one device elsewhere, that leaves the least mismatch."""
    before = misfit(evidence, rig)
    tried: list[tuple[Change, Supposed]] = []
    for role in _ROLES:
        for one, other in combinations(range(len(getattr(rig, role))), 2):
            swapped = list(getattr(rig, role))
            swapped[one], swapped[other] = swapped[other], swapped[one]
            change = Change(role, (one, other), ("swap",))
            tried.append((change, replace(rig, **{role: tuple(swapped)})))
    found = [
        Explanation(change, rig, after, (before, misfit(evidence, after)))
        for change, after in tried
    ]
    best = min(found, key=lambda e: e.left_m[1], default=None)
    if best is None or best.left_m[1] > 0.5 * before:
        found += [
            _elsewhere(evidence, rig, role, index, before)
            for role in _ROLES
            for index in np.unique(evidence.index(role)).tolist()
        ]
    return min(found, key=lambda e: e.left_m[1])


def _elsewhere(
    evidence: Evidence, rig: Supposed, role: Role, index: int, before: float
) -> Explanation:
    """Fit a device's pose from all about the object."""
    change = Change(role, (index,), ("turn", "shift"))
    few = evidence.take(np.flatnonzero(change.concerns(evidence))[::_THIN])
    device: DeviceCalibration = getattr(rig, role)[index]
    middle = rig.objects[0].centre

    def posed(pose: Array) -> Supposed:
        devices = list(getattr(rig, role))
        devices[index] = replace(device, world_from_device=pose)
        return replace(rig, **{role: tuple(devices)})

    def left(one: Supposed) -> float:
        return misfit(few, one, _FAR_CAP_M)

    starts = map(posed, _far_poses(device.world_from_device, middle))
    fitted = [
        _fitted(Bundle(few, one), change) for one in sorted(starts, key=left)[:_FITTED]
    ]
    after = _fitted(Bundle(evidence, min(fitted, key=left)), change)
    return Explanation(change, rig, after, (before, misfit(evidence, after)))


def _fitted(bundle: Bundle, change: Change) -> Supposed:
    expected = np.zeros(bundle.n_unknowns)
    for part, value in ((TURN, _TURNED), (SHIFT, _SHIFTED_M)):
        expected[bundle.columns(change.role, change.devices[0], part)] = value
    return adjust(bundle, expected).supposed


def _far_poses(pose: Array, middle: Array) -> list[Array]:
    """Return poses all about the object at the same distance, in several rolls.

    The directions are a Fibonacci lattice on the sphere; the aim at the object stays.
    The pose itself comes first.
    """
    k = np.arange(_PLACES) + 0.5
    z = 1.0 - 2.0 * k / _PLACES
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - z * z)
    sphere = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    away = pose[:3, 3] - middle
    poses = [pose]
    for towards in sphere:
        about = Rotation.align_vectors(towards, away / np.linalg.norm(away))[0]
        for roll in np.arange(_ROLLS) * (2.0 * np.pi / _ROLLS):
            turned = (Rotation.from_rotvec(roll * towards) * about).as_matrix()
            new = np.eye(4)
            new[:3, :3] = turned @ pose[:3, :3]
            new[:3, 3] = middle + turned @ away
            poses.append(new)
    return poses
