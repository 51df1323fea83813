"""Faults too large for an adjustment to reach: devices swapped, or far from place."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from planning.verify.reconstruction.arrays import Array

from .adjustment import adjust, expected_of
from .bundle import Bundle
from .explanations import Change, Explanation, misfit
from .search import FAULT
from .supposed import Evidence, Role, Supposed

_ROLES: tuple[Role, Role] = ("cameras", "projectors")
# A change must leave no more than this share of the mismatch.
MUST_LEAVE = 0.5
# Turns about the object that a device is tried in.
_PLACES = 720
# Starts are compared on every so many edges, with this cap; the best few are fitted.
_THIN, _FAR_CAP_M, _FITTED = 8, 5e-2, 12


def gross(evidence: Evidence, rig: Supposed) -> Explanation:
    """Return the swap, or the one device elsewhere, that leaves the least mismatch."""
    before = misfit(evidence, rig)

    def explained(change: Change, after: Supposed) -> Explanation:
        return Explanation(change, rig, after, (before, misfit(evidence, after)))

    found: list[Explanation] = []
    for role in _ROLES:
        for one, other in combinations(range(len(getattr(rig, role))), 2):
            swapped = list(getattr(rig, role))
            swapped[one], swapped[other] = swapped[other], swapped[one]
            after = replace(rig, **{role: tuple(swapped)})
            found.append(explained(Change(role, (one, other), ("swap",)), after))
    best = min(found, key=lambda each: each.left_m[1], default=None)
    if best is not None and best.left_m[1] <= MUST_LEAVE * before:
        return best
    alone = [
        (Change(role, (index,), ("turn", "shift")), evidence.index(role) == index)
        for role in _ROLES
        for index in np.unique(evidence.index(role)).tolist()
    ]
    # The device whose edges are farthest off first.
    alone.sort(key=lambda one: -misfit(evidence.take(np.flatnonzero(one[1])), rig))
    for change, own in alone:
        few = evidence.take(np.flatnonzero(own)[::_THIN])
        found.append(explained(change, _elsewhere(evidence, few, rig, change)))
        if found[-1].left_m[1] <= MUST_LEAVE * before:
            return found[-1]
    return min(found, key=lambda each: each.left_m[1])


def _elsewhere(
    evidence: Evidence, few: Evidence, rig: Supposed, change: Change
) -> Supposed:
    """Fit a device's pose from all about the object, over a few of its edges first."""
    role, (index,) = change.role, change.devices
    device, middle = getattr(rig, role)[index], rig.objects[0].centre

    def turned(turn: Array) -> Supposed:
        pose = np.eye(4)
        pose[:3, :3] = turn @ device.world_from_device[:3, :3]
        pose[:3, 3] = middle + turn @ (device.centre - middle)
        devices = list(getattr(rig, role))
        devices[index] = replace(device, world_from_device=pose)
        return replace(rig, **{role: tuple(devices)})

    def left(one: Supposed) -> float:
        return misfit(few, one, _FAR_CAP_M)

    def fitted(edges: Evidence, one: Supposed) -> Supposed:
        bundle = Bundle(edges, one)
        expected, columns = np.zeros(bundle.n_unknowns), change.columns(bundle)
        expected[columns] = expected_of(bundle, FAULT)[columns]
        return adjust(bundle, expected).supposed

    turns = Rotation.random(_PLACES, rng=np.random.default_rng(0)).as_matrix()
    starts = sorted(map(turned, [np.eye(3), *turns]), key=left)[:_FITTED]
    return fitted(evidence, min((fitted(few, one) for one in starts), key=left))
