"""One change of one thing: pose or optics of a device, two devices swapped, the object.

Parameters are lengths at the object in [m], so that one step size suits them all.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import DeviceCalibration

from .supposed import Evidence, Object, Role, Supposed

Move = Literal["swap", "afar", "turn", "shift", "zoom"]
Moves = tuple[Move, ...]
_N_PARAMETERS: dict[Move, int] = {
    "swap": 0,
    "afar": 0,
    "turn": 3,
    "shift": 3,
    "zoom": 1,
}
# Tangents at the object's distance by which a device may have been turned aside [m].
_ASIDE_M = np.linspace(-0.06, 0.06, 7)
_PLACES = 120
_ROLLS = 6


@dataclass(frozen=True, eq=False)
class Correction:
    """A change with free parameters, none of which is no change.

    Attributes:
        role: Of the devices.
        devices: Indices of the one that it changes, or of the two that it swaps.
        moves: What it changes; parameters stand in their order.
        pose: Where a device that is taken `afar` begins, shape (4, 4).
    """

    role: Role
    devices: tuple[int, ...]
    moves: Moves
    pose: Array | None = None

    @property
    def n_parameters(self) -> int:
        """Free parameters; what can't be told from edges counts, too."""
        return sum(_N_PARAMETERS[move] for move in self.moves)

    def concerns(self, evidence: Evidence) -> Mask:
        """Return which edges it bears on."""
        return np.isin(evidence.index(self.role), self.devices)

    def repeats(self, other: "Correction") -> bool:
        """Return whether it is the other one again, or with more freedom."""
        same = self.role == other.role and self.devices == other.devices
        return same and {*self.moves} >= {*other.moves}

    def apply(self, supposed: Supposed, x: Array) -> Supposed:
        """Return what stands there for given parameters, shape (n_parameters,)."""
        devices = list(getattr(supposed, self.role))
        first, last = self.devices[0], self.devices[-1]
        if "swap" in self.moves:
            devices[first], devices[last] = devices[last], devices[first]
        else:
            devices[first] = self._changed(devices[first], supposed.objects[0], x)
        return replace(supposed, **{self.role: tuple(devices)})

    def _changed(
        self, device: DeviceCalibration | Object, body: Object, x: Array
    ) -> DeviceCalibration | Object:
        ends = np.cumsum([_N_PARAMETERS[move] for move in self.moves])
        steps = dict(zip(self.moves, np.split(x, ends[:-1]), strict=True))
        begin = device.world_from_device if self.pose is None else self.pose
        pose = begin.copy()
        size = reach = body.mesh.radius
        if device is not body:
            reach = float(np.linalg.norm(device.centre - body.centre))
        if "turn" in steps:
            turn = Rotation.from_rotvec(steps["turn"] / reach).as_matrix()
            pose[:3, :3] = turn @ pose[:3, :3]
        if "shift" in steps:
            pose[:3, 3] += steps["shift"]
        device = replace(device, world_from_device=pose)
        if "zoom" not in steps:
            return device
        factor = 1.0 + float(steps["zoom"][0]) / size
        if isinstance(device, Object):
            return replace(device, scale=factor * device.scale)
        matrix = device.matrix.copy()
        matrix[[0, 1], [0, 1]] *= factor
        return replace(device, matrix=matrix)


def turns_aside(pose: Array) -> list[Array]:
    """Return turns about the x and y axes of a pose, as lengths at the object [m]."""
    x, y = pose[:3, 0], pose[:3, 1]
    return [a * x + b * y for a in _ASIDE_M for b in _ASIDE_M]


def far_poses(pose: Array, middle: Array) -> list[Array]:
    """Return poses all about the object at the same distance, in several rolls.

    The directions are a Fibonacci lattice on the sphere; the aim at the object stays.
    """
    k = np.arange(_PLACES) + 0.5
    z = 1.0 - 2.0 * k / _PLACES
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - z * z)
    sphere = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    away = pose[:3, 3] - middle
    poses: list[Array] = []
    for towards in sphere:
        about = Rotation.align_vectors(towards, away / np.linalg.norm(away))[0]
        for roll in np.arange(_ROLLS) * (2.0 * np.pi / _ROLLS):
            turned = (Rotation.from_rotvec(roll * towards) * about).as_matrix()
            new = np.eye(4)
            new[:3, :3] = turned @ pose[:3, :3]
            new[:3, 3] = middle + turned @ away
            poses.append(new)
    return poses
