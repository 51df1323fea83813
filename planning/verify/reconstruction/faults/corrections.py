"""One change of one thing: a device's pose or optics, two devices swapped, the object.

Parameters are lengths at the object in [m], so that one step size suits them all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)

from .supposed import Evidence, Role, Supposed

Device = CameraCalibration | ProjectorCalibration
Kind = Literal[
    "swap", "focal", "aim", "place", "pose", "far pose", "scale", "moved", "similar"
]
# What a change can do that another can, too: the fuller one explains no less.
_CONTAINS: dict[Kind, frozenset[Kind]] = {
    "pose": frozenset(("aim", "place")),
    "far pose": frozenset(("aim", "place", "pose")),
    "similar": frozenset(("scale", "moved")),
}

# Tangents at the object's distance by which a device may have been turned aside [m].
_ASIDE_M = np.linspace(-0.06, 0.06, 7)
_PLACES = 120
_ROLLS = 6


@dataclass(frozen=True, eq=False)
class Correction:
    """A change with free parameters, none of which is no change.

    Attributes:
        kind: What is changed.
        role: Of the devices; None: the object.
        devices: Indices of the devices that it changes.
        n_parameters: Free parameters; what can't be told from edges counts, too.
        apply: What stands there for given parameters, shape (n_parameters,).
    """

    kind: Kind
    role: Role | None
    devices: tuple[int, ...]
    n_parameters: int
    apply: Callable[[Supposed, Array], Supposed]

    def concerns(self, evidence: Evidence) -> Mask:
        """Return which edges it bears on."""
        if self.role is None:
            return np.ones(len(evidence), dtype=bool)
        return np.isin(evidence.index(self.role), self.devices)

    def repeats(self, other: "Correction") -> bool:
        """Return whether it is the other one again, or with more freedom."""
        if self.role != other.role or self.devices != other.devices:
            return False
        fuller = _CONTAINS.get(self.kind, frozenset())
        return other.kind == self.kind or other.kind in fuller


def of_device(role: Role, index: int, kind: Kind, reach_m: float) -> Correction:
    """Return a change of a device's pose or focal length.

    Args:
        role: Which list the device is in.
        index: Where.
        kind: `focal`, `aim` (turned about its centre), `place` or `pose` (both).
        reach_m: Distance of the object, for turning lengths into angles [m].
    """

    def apply(supposed: Supposed, x: Array) -> Supposed:
        device = getattr(supposed, role)[index]
        if kind == "focal":
            size = supposed.body.mesh.radius
            return _with(supposed, role, {index: _zoomed(device, 1.0 + x[0] / size)})
        turn = x[:3] / reach_m if kind != "place" else np.zeros(3)
        shift = x[-3:] if kind != "aim" else np.zeros(3)
        return _with(supposed, role, {index: _moved(device, turn, shift)})

    count = {"focal": 1, "aim": 3, "place": 3, "pose": 6}[kind]
    return Correction(kind, role, (index,), count, apply)


def standing_at(role: Role, index: int, pose: Array, reach_m: float) -> Correction:
    """Return a change of pose that begins at quite another one, shape (4, 4)."""
    near = of_device(role, index, "pose", reach_m)

    def apply(supposed: Supposed, x: Array) -> Supposed:
        there = replace(getattr(supposed, role)[index], world_from_device=pose)
        return near.apply(_with(supposed, role, {index: there}), x)

    return replace(near, kind="far pose", apply=apply)


def swapped(role: Role, one: int, other: int) -> Correction:
    """Return the exchange of two devices: each stands where the other should."""

    def apply(supposed: Supposed, x: Array) -> Supposed:
        del x
        devices = getattr(supposed, role)
        return _with(supposed, role, {one: devices[other], other: devices[one]})

    return Correction("swap", role, (one, other), 0, apply)


def of_object(kind: Kind) -> Correction:
    """Return a change of the object: `scale` about its centre, `moved`, `similar`."""
    counts = {"scale": 1, "moved": 6, "similar": 7}

    def apply(supposed: Supposed, x: Array) -> Supposed:
        body = supposed.body
        size = body.mesh.radius
        scale = 1.0 + float(x[-1]) / size if kind != "moved" else 1.0
        turn, shift = np.eye(3), np.zeros(3)
        if kind != "scale":
            turn = Rotation.from_rotvec(x[:3] / size).as_matrix()
            shift = x[3:6]
        changed = replace(
            body,
            turn=turn @ body.turn,
            scale=scale * body.scale,
            shift=body.shift + shift,
        )
        return replace(supposed, body=changed)

    return Correction(kind, None, (), counts[kind], apply)


def _with(supposed: Supposed, role: Role, changed: dict[int, Device]) -> Supposed:
    devices = enumerate(getattr(supposed, role))
    return replace(supposed, **{role: tuple(changed.get(k, one) for k, one in devices)})


def _moved(device: Device, turn: Array, shift: Array) -> Device:
    pose = device.world_from_device.copy()
    pose[:3, :3] = Rotation.from_rotvec(turn).as_matrix() @ pose[:3, :3]
    pose[:3, 3] += shift
    return replace(device, world_from_device=pose)


def _zoomed(device: Device, factor: float) -> Device:
    matrix = device.matrix.copy()
    matrix[0, 0] *= factor
    matrix[1, 1] *= factor
    return replace(device, matrix=matrix)


def turns_aside(pose: Array) -> list[Array]:
    """Return turns about a device's x and y axes, as lengths at the object [m].

    Args:
        pose: ``world_from_device``, shape (4, 4).
    """
    x, y = pose[:3, 0], pose[:3, 1]
    return [a * x + b * y for a in _ASIDE_M for b in _ASIDE_M]


def far_poses(pose: Array, middle: Array) -> list[Array]:
    """Return poses all about the object at the same distance, in several rolls.

    The directions are a Fibonacci lattice on the sphere; the aim at the object stays.

    Args:
        pose: ``world_from_device``, shape (4, 4).
        middle: Of the object in the world [m], shape (3,).
    """
    k = np.arange(_PLACES) + 0.5
    z = 1.0 - 2.0 * k / _PLACES
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - z * z)
    sphere = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    away = pose[:3, 3] - middle
    reach = float(np.linalg.norm(away))
    poses: list[Array] = []
    for towards in sphere:
        about = Rotation.align_vectors(towards, away / reach)[0].as_matrix()
        for roll in np.arange(_ROLLS) * (2.0 * np.pi / _ROLLS):
            turned = Rotation.from_rotvec(roll * towards).as_matrix() @ about
            new = np.eye(4)
            new[:3, :3] = turned @ pose[:3, :3]
            new[:3, 3] = middle + turned @ away
            poses.append(new)
    return poses
