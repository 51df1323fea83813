"""What limits of pairs look at: of samples, and of what a cell of poses may have."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planning.scene.samples import LightOnSamples

from .camera_limits import ViewedSamples
from .light_terms import GreyLevels
from .limit import Array

# Of noise in the image, as stated and by the light, of misplaced rings, of the phase
# and of the panel's pixels, s_N; of the calibration, s_C.
Term = Literal["edges", "light", "phase", "rings", "linearity", "camera", "projector"]
NOISE_TERMS: tuple[Term, ...] = ("edges", "light", "phase", "rings", "linearity")


@dataclass(frozen=True, eq=False)
class PairQuality:
    """How well a pair triangulates n samples.

    Attributes:
        conditioning: |r.m|, shape (n,).
        sigma: What `max_sigma_m` limits: s_N, or sqrt(s_N^2 + s_C^2) [m], shape (n,).
        terms: Independent parts of the deviation along the normal by `Term` [m], (n,)
            each; what is stated of none of them is absent.
        pitch: Distance of neighbouring rings in the image in [px], shape (n,).
        view: How the camera sees them: it stands at -t r from a sample.
        light: That falls on them: the projector stands at minus its offsets.
        edge_px: Noise of edges in the image [px], shape (n,).
        drawn_m: How far rings and their edges lie off along m, rms [m], shape (n,).
        grey: How bright they come out; None: nobody says.
        light_cos: Cosine of the angle at which ray and light meet, shape (n,); None: of
            rings, which it says little of.
    """

    conditioning: Array
    sigma: Array
    terms: dict[Term, Array]
    pitch: Array
    view: ViewedSamples
    light: LightOnSamples
    edge_px: Array
    drawn_m: Array
    grey: GreyLevels | None = None
    light_cos: Array | None = None

    @property
    def total(self) -> Array:
        """Root of the sum of the squares of all terms, in [m], shape (n,)."""
        return np.sqrt(sum(np.square(term) for term in self.terms.values()))


@dataclass(frozen=True, eq=False)
class PairCell:
    """The best of one projector with a camera anywhere in a cell of poses, (k,) each.

    |r.m| and |N.r| at most, t |g| at least; s_px in [px], h in [m], and at least what
    moves the surfaces of equal code, times |N.r| [m]. Of coded pixels also the least
    and the largest angle at which ray and light may meet.
    """

    conditioning: Array
    facing: Array
    shift: Array
    noise: Array
    spacing: Array
    placement: Array
    angles: tuple[Array, Array] | None = None
