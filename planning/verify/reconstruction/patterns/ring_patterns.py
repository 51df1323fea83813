"""What a projector draws: Gray-coded annuli about the ring axis, and the root discs.

A sequence is white, black, each bit of the annulus index with its inverse, and for each
camera the disc that tells the two roots of its rays apart, with its inverse: in all
``2 ceil(log2 N) + 2 + 2 n_cameras`` frames for N annuli, one more than rings.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from planning.model.devices.planned import code_bits
from planning.verify.reconstruction.arrays import Array, Grey, Images, Indices, Mask
from planning.verify.reconstruction.light_laws import LightLaw

Kind = Literal["white", "black", "bit", "root", "phase"]


@dataclass(frozen=True)
class Frame:
    """One image of the sequence.

    Attributes:
        number: Place in the sequence, from 0.
        kind: `white`, `black`, a `bit` of the annulus index or a pixel's stripe, a
            camera's `root` disc, or a sinusoid of a `phase`.
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
class DrawnRings:
    """What one projector draws: its frames, how they look, what a decoder reads.

    Attributes:
        light: Its light.
        radii: Ring edges, rising: tangents R = x/z (diverging) or radii in [m], (n,).
    """

    light: LightLaw
    radii: Array

    @property
    def n_annuli(self) -> int:
        """Areas that the rings part the panel into."""
        return len(self.radii) + 1

    @property
    def n_bits(self) -> int:
        """Bits of the annulus index."""
        return code_bits(len(self.radii))

    @property
    def outer_radius(self) -> float:
        """Where the outermost annulus ends: one more gap beyond the last ring."""
        return float(2.0 * self.radii[-1] - self.radii[-2])

    @cached_property
    def codes(self) -> Indices:
        """Gray code of each annulus, shape (n_annuli,)."""
        index = np.arange(self.n_annuli)
        return index ^ (index >> 1)

    @cached_property
    def index_of_code(self) -> NDArray[np.int16]:
        """Annulus of each code, -1 for codes that aren't drawn, (2**n_bits,)."""
        table = np.full(1 << self.n_bits, -1, dtype=np.int16)
        table[self.codes] = np.arange(self.n_annuli)
        return table

    @cached_property
    def flipping_bit(self) -> Indices:
        """Bit that changes across each ring edge, shape (n_rings,)."""
        changed = self.codes[1:] ^ self.codes[:-1]
        return np.log2(changed).astype(np.int64)

    def bit(self, bit: int) -> Grey:
        """Return whether each annulus is bright in the frame of a bit, (n_annuli,)."""
        return ((self.codes >> bit) & 1).astype(np.float32)

    def entry(self) -> dict[str, Any]:
        """Return what decoders elsewhere must know of it, as plain JSON values."""
        return {
            "n_annuli": self.n_annuli,
            "n_bits": self.n_bits,
            "outer_radius": self.outer_radius,
            "ring_radii": self.radii.tolist(),
            "flipping_bit": self.flipping_bit.tolist(),
        }

    def frames(self, cameras: Iterable[str]) -> tuple[Frame, ...]:
        """Return white, black, each bit and its inverse, each camera's disc and so."""
        coded = [Frame(0, "bit", bit=bit) for bit in range(self.n_bits)]
        coded += [Frame(0, "root", camera=camera) for camera in cameras]
        both = [replace(one, inverse=dark) for one in coded for dark in (False, True)]
        shown = [Frame(0, "white"), Frame(0, "black"), *both]
        return tuple(replace(one, number=n) for n, one in enumerate(shown))

    def bright(self, frame: Frame) -> Mask:
        """Return whether each annulus is bright in a white, black or bit frame."""
        if frame.bit is not None:
            return (self.bit(frame.bit) > 0.5) != frame.inverse
        return np.full(self.n_annuli, frame.kind == "white")

    def gaps_m(self, rings: NDArray[np.integer], depth: Array) -> Array:
        """Return how far rings are from the next one inwards, at depths z [m], (n,)."""
        first = self.radii[0] - (self.radii[1] - self.radii[0])
        steps = np.diff(self.radii, prepend=first)
        return self.light.across_m(steps[rings], self.radii[rings], depth)

    def lines(self, width: float) -> Self:
        """Return rings whose odd annuli are bright lines on these.

        The width is in the unit of the radii and less than `least_gap`.
        """
        sides = 0.5 * width * np.array([-1.0, 1.0])
        return replace(self, radii=(self.radii[:, None] + sides).ravel())

    @property
    def least_gap(self) -> float:
        """Least distance of a ring from the next one, or from the centre."""
        return float(np.diff(self.radii, prepend=0.0).min())


@dataclass(frozen=True, eq=False)
class RingsForCamera(DrawnRings):
    """What one projector draws, as one camera's decoder reads it.

    Attributes:
        camera_in_ring: The camera's optical centre in the ring frame [m], shape (3,).
    """

    camera_in_ring: Array

    @property
    def n_frames(self) -> int:
        """Frames that the decoder reads."""
        return 2 * self.n_bits + 4

    def root_level(self, x: Array, y: Array) -> Array:
        """Return what is zero on the border of the disc, with the sign of r.m.

        With o the camera in ring coordinates, at p = (x, y) of the plane of the rings::

            diverging  |p|^2 o_z - o_x p_x - o_y p_y        parallel  p.(p - o)
        """
        across, down, away = self.camera_in_ring
        square = self.light.root_weight(away)
        return x * (square * x - across) + y * (square * y - down)

    def root_side(self, p: Array) -> Array:
        """Return the signed distance of ring-plane points from the border of the disc.

        To first order in units of p, positive outside the disc, shape (n,).

        Args:
            p: Normalised (x/z, y/z) or, in parallel light, (x, y) in [m], shape (n, 2).
        """
        square = self.light.root_weight(self.camera_in_ring[2])
        slope = lengths(2.0 * square * p - self.camera_in_ring[:2])
        return self.root_level(*p.T) / np.maximum(slope, 1e-12)


@dataclass(frozen=True, eq=False)
class Frames:
    """Images of one camera under the patterns of one projector.

    Attributes:
        stack: white, black, then each bit and its inverse, then the root disc and its
            inverse; shape (n_frames, h, w), grey levels 0 to 255.
        corner: Pixel (u, v) of the stack's top-left pixel in the camera's image.
    """

    stack: Images
    corner: tuple[int, int]
