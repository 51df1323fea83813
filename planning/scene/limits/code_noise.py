"""What noise leaves uncertain of a code: in the image, and of its surfaces.

Of rings an edge is found in the image, s_px wide, and its surface lies s_R and s_L off
along m. Of coded pixels each pixel of the image is told where on the panel its light is
from; that is off by the noise of the phase, and moves a surface along m by so many
pixels times k, what a pixel of the panel is along m::

    s_code = P / (2 pi) s_phi,    s_phi = sqrt(2 / N) s_I / B

with the period P of N shifted sinusoids, the noise s_I of a pixel half lit and the
amplitude B; without shifts a code is told to a pixel, 1 / sqrt(12) of it. A blur b of
light and image, in pixels of the panel, leaves exp(-2 pi^2 (b / P)^2) of an amplitude.
`docs/method/dense.md`.
"""

from dataclasses import dataclass, field

import numpy as np

from planning.model.light.dense_code import DenseCode
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.light.light_budget import LightBudget
from planning.model.requirements import TriangulationLimits
from planning.scene.codes.surfaces import CodeSurfaces, PixelSurfaces
from planning.scene.samples import LightOnSamples

from .camera_limits import ViewedSamples
from .edge_terms import blur_px, edge_linearity_m, edge_width_px
from .light_terms import (
    GreyLevels,
    edge_noise_px,
    electrons,
    grey_levels,
    phase_noise,
)
from .limit import Array
from .pair_quality import Term

# Standard deviation of what is told to a pixel [px].
_TO_A_PIXEL = float(np.sqrt(1.0 / 12.0))


@dataclass(frozen=True, eq=False)
class CodeNoise:
    """Independent parts of it at n samples, by `Term`, (n,) each.

    Attributes:
        image_px: In the image, across lines of equal code [px].
        surface_m: Of the surfaces of equal code along m [m].
        grey: How bright the samples come out; None: nobody says.
    """

    image_px: dict[Term, Array]
    surface_m: dict[Term, Array] = field(default_factory=dict[Term, Array])
    grey: GreyLevels | None = None


def together(parts: dict[Term, Array], n: int) -> Array:
    """Return the root of the sum of the squares of independent parts, shape (n,)."""
    return np.sqrt(sum((np.square(part) for part in parts.values()), np.zeros(n)))


def code_noise(
    light: LightOnSamples,
    surfaces: CodeSurfaces,
    seen: ViewedSamples,
    image_px_m: Array,
    limits: TriangulationLimits,
) -> CodeNoise:
    """Return the noise of a projector's code in a camera's image.

    `image_px_m` is what a pixel of the image is along m [m], shape (n,).
    """
    squarely = np.maximum(light.incidence_cos, 1e-9)
    image: dict[Term, Array] = {"edges": limits.noise_px / squarely}
    surface: dict[Term, Array] = {}
    drawn = limits.drawn_edges or DrawnEdges()
    at = drawn, surfaces.depths, surfaces.pixel_m, image_px_m
    grey = _grey(limits.light, light, surfaces, seen)
    if isinstance(surfaces, PixelSurfaces):
        told = _phase_px(surfaces.code, blur_px(*at), squarely, grey)
        # A pixel of the panel, as of the principal point, along m.
        surface["phase"] = told * surfaces.levers[:, 2]
    elif grey is not None:
        image["light"] = edge_noise_px(grey, edge_width_px(*at))
    if limits.ring_sigma_m is not None:
        surface["rings"] = np.full_like(squarely, limits.ring_sigma_m)
    if limits.drawn_edges is not None:
        surface["linearity"] = edge_linearity_m(*at)
    return CodeNoise(image, surface, grey)


def _phase_px(
    code: DenseCode, blur: Array, squarely: Array, grey: GreyLevels | None
) -> Array:
    """Return s_code, in pixels of the panel, (n,): as stated, or by the light."""
    if not code.shifts:
        return np.full_like(blur, _TO_A_PIXEL)
    modulation = np.exp(-2.0 * np.square(np.pi * blur / code.period_px))
    modulation = np.maximum(modulation, 1e-9)
    phase = (
        code.phase_noise / (squarely * modulation)
        if grey is None
        else phase_noise(grey, code.shifts, modulation)
    )
    return code.period_px / (2.0 * np.pi) * phase


def _grey(
    budget: LightBudget | None,
    light: LightOnSamples,
    surfaces: CodeSurfaces,
    seen: ViewedSamples,
) -> GreyLevels | None:
    """How bright samples come out in a camera's image; None: nothing says."""
    if budget is None:
        return None
    off = np.square(seen.off_centre).sum(axis=1) / budget.focal_px**2
    squarely = surfaces.lux_per_lm * np.maximum(light.incidence_cos, 0.0)
    lit, dark = electrons(budget, squarely, surfaces.exposure_s)
    return grey_levels(budget, lit, dark, 1.0 / np.sqrt(1.0 + off))


def least_phase_px(
    code: DenseCode, limits: TriangulationLimits, incidence_cos: Array
) -> Array:
    """Return a bound below s_code, in pixels of the panel, (n,): nothing is blurred.

    By light that a rig states it may be as little as you like.
    """
    if code.shifts and limits.light is not None:
        return np.zeros_like(incidence_cos)
    none = np.zeros_like(incidence_cos)
    return _phase_px(code, none, np.maximum(incidence_cos, 1e-9), None)
