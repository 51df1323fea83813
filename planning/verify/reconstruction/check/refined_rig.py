"""A rig as the images of an object say that it stands, and how surely."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.scanner import Scanner

_MM = 1e3


@dataclass(frozen=True)
class Moved:
    """By how much a body differs from what it was taken to be.

    Attributes:
        id: Of the device; `object` for the object.
        turn_rad: Angle of its turn.
        turn_sigma_rad: Standard deviation of that about any one axis.
        shift_m: Length of its displacement.
        shift_sigma_m: Standard deviation of that along any one axis.
        zoom: Its focal length's change as a share; of the object, its size's.
        zoom_sigma: Standard deviation of that.
        surprise: The change in units of what was expected: root of the mean square.
    """

    id: str
    turn_rad: float
    turn_sigma_rad: float
    shift_m: float
    shift_sigma_m: float
    zoom: float
    zoom_sigma: float
    surprise: float

    @property
    def words(self) -> str:
        """All of it in a few words."""
        what = "size" if self.id == "object" else "focal length"
        return (
            f"turned by {np.rad2deg(self.turn_rad):.4f} ± "
            f"{np.rad2deg(self.turn_sigma_rad):.4f} degrees, displaced by "
            f"{_MM * self.shift_m:.3f} ± {_MM * self.shift_sigma_m:.3f} mm, {what} "
            f"{100 * self.zoom:+.4f} ± {100 * self.zoom_sigma:.4f} %"
        )


@dataclass(frozen=True, eq=False)
class RefinedRig:
    """What an adjustment over an object's edges makes of a rig.

    Attributes:
        scanner: The rig, its object as before.
        moved: What moved by how much, the largest surprise first.
        named: What is off by more than was expected, in words.
        before_px: Median distance of the edges from their rings on the mesh before.
        after_px: After it, differences between object and mesh taken out.
        relief_m: Standard deviation of these differences.
    """

    scanner: Scanner
    moved: tuple[Moved, ...]
    named: tuple[str, ...]
    before_px: float
    after_px: float
    relief_m: float

    def lines(self) -> list[str]:
        """Return what is said of it."""
        first, *_ = self.moved
        lines = [
            f"refined   edges were {self.before_px:.3f} px off their rings on the mesh "
            f"(median), now {self.after_px:.3f} px; the object differs from the mesh "
            f"by {_MM * self.relief_m:.3f} mm (rms)",
            f"          {first.id} differs most, {first.surprise:.1f} times what is "
            f"expected of it",
        ]
        lines += [f"          {words}" for words in self.named]
        return lines + [f"          {one.id}: {one.words}" for one in self.moved]

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values, SI."""
        return {
            "moved": [vars(one) for one in self.moved],
            "named": list(self.named),
            "before_px": self.before_px,
            "after_px": self.after_px,
            "relief_m": self.relief_m,
        }

    def calibration_file(self) -> dict[str, Any]:
        """Return it as `--calibration` reads it."""
        return {
            "format": "ringrig-calibration",
            "version": 1,
            "devices": [
                _device_entry(one.id, one.world_from_device, one.matrix)
                if not isinstance(one, ProjectorCalibration)
                or one.light.name == "diverging"
                else _device_entry(one.id, one.world_from_device, None)
                for one in (*self.scanner.projectors, *self.scanner.cameras)
            ],
        }


def _device_entry(name: str, pose: Array, matrix: Array | None) -> dict[str, Any]:
    entry: dict[str, Any] = {"id": name, "world_from_device": pose.tolist()}
    return entry if matrix is None else entry | {"K": matrix.tolist()}
