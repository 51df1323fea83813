"""The frames that a projector shows, in order: what each means to a decoder.

What is drawn is defined once, in `reconstruction.patterns`, which the check renders.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedCamera, PlannedProjector
from planning.verify.reconstruction.calibration import (
    ProjectorCalibration,
    calibrate_camera,
    calibrate_projector,
)

from .ring_patterns import RingPatterns, ring_patterns

Kind = Literal["white", "black", "bit", "root"]


@dataclass(frozen=True)
class Frame:
    """One image of the sequence.

    Attributes:
        number: Place in the sequence, from 0.
        kind: `white`, `black`, a `bit` of the annulus index, or a camera's `root` disc.
        bit: Which bit, from 0 for the one that flips most often; None for the others.
        camera: Whose root disc; None for the others.
        inverse: Bright and dark exchanged, within what is drawn at all.
    """

    number: int
    kind: Kind
    bit: int | None = None
    camera: str | None = None
    inverse: bool = False

    @property
    def name(self) -> str:
        """Name of its files, without the ending."""
        what = {"bit": f"bit{self.bit}", "root": f"root-{self.camera}"}
        name = f"{self.number:02d}-{what.get(self.kind, self.kind)}"
        return f"{name}-inverse" if self.inverse else name


@dataclass(frozen=True, eq=False)
class PatternSequence:
    """All that one projector shows.

    Attributes:
        projector: As the patterns are drawn for it.
        patterns: Rings and codes; for each camera one, of which only the disc differs.
    """

    projector: ProjectorCalibration
    patterns: dict[str, RingPatterns]

    @property
    def rings(self) -> RingPatterns:
        """Rings and codes, the same for every camera."""
        return next(iter(self.patterns.values()))

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """White, black, each bit and its inverse, each camera's disc and inverse."""
        found = [Frame(0, "white"), Frame(1, "black")]
        for bit in range(self.rings.n_bits):
            for inverse in (False, True):
                found.append(Frame(len(found), "bit", bit=bit, inverse=inverse))
        for camera in self.patterns:
            for inverse in (False, True):
                found.append(Frame(len(found), "root", camera=camera, inverse=inverse))
        return tuple(found)

    def annulus_levels(self, frame: Frame) -> NDArray[np.bool_]:
        """Return whether each annulus is bright in a white, black or bit frame."""
        n = self.rings.n_annuli
        if frame.kind == "bit":
            assert frame.bit is not None
            return (self.rings.bit(frame.bit) > 0.5) != frame.inverse
        return np.full(n, frame.kind == "white")


def pattern_sequence(
    projector: PlannedProjector, cameras: Sequence[PlannedCamera]
) -> PatternSequence:
    """Return what a projector shows for the cameras of a plan, one or more."""
    design = calibrate_projector(projector)
    return PatternSequence(
        design,
        {
            camera.id: ring_patterns(
                design, projector.ring_radii, calibrate_camera(camera)
            )
            for camera in cameras
        },
    )
