"""How much a surface bends between rings: kappa(R) of the interpolation error.

Between two rings the surface is interpolated by a chord. With h their gap in the ring
coordinate c (radius, or tangent), the chord errs along the beam by at most::

    e = kappa h^2 / 8

kappa is the second derivative of the height z over c in parallel light. In diverging
light a plane has 1/z linear in R, so a chord is straight in 1/z::

    e = sqrt(1 + R^2) z^2 |d^2(1/z)/dR^2| h^2 / 8

`docs/method/rings.md`, "Spacing". A crease has a slope jump and no kappa, see
`ring_creases`.
"""

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedProjector
from planning.scene.lights import Light, light_of

from .beam_profile import BeamProfile

_QUANTILE = 0.99


def chord_errors(
    heights: NDArray[np.float64],
    coordinates: NDArray[np.float64],
    reach: int,
    light: Light,
) -> NDArray[np.float64]:
    """Return how far the surface is from the chord over it, along the beam.

    The exact error at the middle of a gap of 2 `reach` rows; no derivative is taken.

    Args:
        heights: z in ring coordinates [m], shape (n_c, n_a).
        coordinates: Ring coordinates of the rows, equally spaced, shape (n_c,).
        reach: Rows from the middle to either end.
        light: Of the projector.

    Returns:
        In [m], NaN where an end is missing, shape (n_c, n_a).
    """
    errors = np.full_like(heights, np.nan)
    before, middle, after = (
        heights[: -2 * reach],
        heights[reach:-reach],
        heights[2 * reach :],
    )
    stretch = light.stretch(coordinates[reach:-reach])[:, None]
    errors[reach:-reach] = np.abs(middle - light.chord(before, after)) * stretch
    return errors


def smooth_stretches(
    projector: PlannedProjector,
    profile: BeamProfile,
    reach: int,
    max_incidence: float,
) -> NDArray[np.bool_]:
    """Whether a chord's ends and middle are lit and on one surface, (n_c, n_a).

    A surface that is lit all along never rises faster against the beam than
    tan(max_incidence), by the mean value theorem: a steeper chord crosses a step.
    """
    lit, whole = profile.lit, np.zeros_like(profile.lit)
    chart = light_of(projector.device).slope_chart
    high, along = chart(profile.heights, profile.coordinates)
    steepest = np.tan(max_incidence) * (along[reach:] - along[:-reach])
    flat = np.abs(high[reach:] - high[:-reach]) <= steepest[:, None]
    together = lit[: -2 * reach] & lit[reach:-reach] & lit[2 * reach :]
    whole[reach:-reach] = together & flat[:-reach] & flat[reach:]
    return whole


def ring_curvature(
    errors: NDArray[np.float64], usable: NDArray[np.bool_], gap: float
) -> NDArray[np.float64]:
    """Return kappa(R): 0.99 of each row's |kappa| are no larger; 0 where none is known.

    Not the largest: on a mesh one facet would decide.

    Args:
        errors: Of chords over `gap`, in [m], shape (n_c, n_a).
        usable: Chords that count, same shape.
        gap: Length of the chords in the ring coordinate.

    Returns:
        In [m] per squared unit of the ring coordinate, shape (n_c,).
    """
    kappa = np.zeros(len(errors))
    for row in np.flatnonzero(usable.any(axis=1)):
        kappa[row] = np.quantile(errors[row, usable[row]], _QUANTILE)
    return 8.0 * kappa / gap**2
