"""The frames that a projector shows, in order: what each means to a decoder.

What is drawn is defined once, in `ring_patterns`, which the check renders.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from planning.verify.reconstruction.arrays import Mask
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)

from .ring_patterns import RingsForCamera

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
        discs: Of each camera by its id: what is drawn, with its root disc.
    """

    projector: ProjectorCalibration
    discs: dict[str, RingsForCamera]

    @classmethod
    def of(
        cls, projector: ProjectorCalibration, cameras: Sequence[CameraCalibration]
    ) -> "PatternSequence":
        """Return what a projector shows for the cameras of a rig, one or more."""
        discs = {camera.id: projector.pattern_for(camera) for camera in cameras}
        return cls(projector, discs)

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """White, black, each bit and its inverse, each camera's disc and inverse."""
        frames = [Frame(0, "white"), Frame(1, "black")]
        for bit in range(self.projector.pattern.n_bits):
            for inverse in (False, True):
                frames.append(Frame(len(frames), "bit", bit=bit, inverse=inverse))
        for camera in self.discs:
            for inverse in (False, True):
                frames.append(
                    Frame(len(frames), "root", camera=camera, inverse=inverse)
                )
        return tuple(frames)

    def frame_names(self, camera: str) -> tuple[str, ...]:
        """Return the names of the frames that a camera's decoder reads, in order."""
        return tuple(f.name for f in self.frames if f.camera in (None, camera))

    def annulus_levels(self, frame: Frame) -> Mask:
        """Return whether each annulus is bright in a white, black or bit frame."""
        pattern = self.projector.pattern
        if frame.bit is not None:
            return (pattern.bit(frame.bit) > 0.5) != frame.inverse
        return np.full(pattern.n_annuli, frame.kind == "white")
