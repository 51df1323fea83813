"""What a projector draws: Gray-coded annuli about the ring axis, and the root discs.

A sequence is white, black, each bit of the annulus index with its inverse, and for each
camera the disc that tells the two roots of its rays apart, with its inverse: in all
``2 ceil(log2 N) + 2 + 2 n_cameras`` frames for N annuli, one more than rings.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Grey, Images, Indices
from planning.verify.reconstruction.light_laws import LightLaw


@dataclass(frozen=True, eq=False)
class DrawnRings:
    """What one projector draws.

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
        return max(1, (self.n_annuli - 1).bit_length())

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

    @property
    def steps(self) -> Array:
        """Distance of each ring from the next one inwards, shape (n,)."""
        first = self.radii[0] - (self.radii[1] - self.radii[0])
        return np.diff(self.radii, prepend=first)


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

    def root_side(self, p: Array) -> Array:
        """Return the signed distance of ring-plane points from the border of the disc.

        With o the camera in ring coordinates, the sign is that of r.m::

            diverging  |p|^2 o_z - o_x p_x - o_y p_y        parallel  p.(p - o)

        to first order in units of p, positive outside the disc.

        Args:
            p: Normalised (x/z, y/z) or, in parallel light, (x, y) in [m], shape (n, 2).

        Returns:
            Shape (n,).
        """
        square = self.light.root_weight(self.camera_in_ring[2])
        flat = self.camera_in_ring[:2]
        level = square * np.sum(p * p, axis=1) - p @ flat
        slope = np.linalg.norm(2.0 * square * p - flat, axis=1)
        return level / np.maximum(slope, 1e-12)


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
