"""Where the light of two projectors falls: from one image's brightness, and from two.

The paper fires neighbouring projectors at once and calls the brighter pixels their
overlap, ``I_j and I_j+1 != 0``. That needs surface of one albedo, little ambient light
and a threshold; one white frame of each projector alone needs none of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.render.occluders import Occluder

from .supposed import Evidence, Supposed, places

# Less contrast between on and off is noise: three deviations of both [grey levels].
MIN_CONTRAST = 5.0
_LEVELS = 256
# Light met more obliquely isn't told from none (docs/semantics.md) [cosine].
_GLANCING = np.cos(np.deg2rad(89.0))
# Shadow rays stop this share of their length before the point they ask about.
_SHADOW_SLACK = 2e-5


@dataclass(frozen=True, eq=False)
class Whites:
    """A camera's images of projectors' white frames.

    Attributes:
        dark: All projectors off, shape (h, w).
        alone: One projector on at a time, shape (n_projectors, h, w).
        together: All on at once, shape (h, w).
        corner: Pixel (u, v) of the top-left pixel.
    """

    dark: NDArray[np.uint8 | np.float32]
    alone: NDArray[np.uint8 | np.float32]
    together: NDArray[np.uint8 | np.float32]
    corner: tuple[int, int]


def overlap_by_intensity(
    together: NDArray[np.uint8 | np.float32],
    dark: NDArray[np.uint8 | np.float32],
    threshold: float | None = None,
) -> NDArray[np.bool_]:
    """Return the paper's overlap: pixels brighter than one projector makes them.

    Args:
        together: All projectors on, grey levels, shape (h, w).
        dark: All off, same shape.
        threshold: Of the brightness above dark; None: the upper one of `three_classes`.
    """
    light = _brighter(together, dark)
    if threshold is None:
        threshold = three_classes(light)[1]
    return light > max(threshold, MIN_CONTRAST)


def overlap_by_frames(
    alone: NDArray[np.uint8 | np.float32], dark: NDArray[np.uint8 | np.float32]
) -> NDArray[np.bool_]:
    """Return pixels that two projectors or more light, from a white frame of each.

    Args:
        alone: One projector on at a time, grey levels, shape (n_projectors, h, w).
        dark: All off, shape (h, w).
    """
    lit = np.stack([_brighter(one, dark) >= MIN_CONTRAST for one in alone])
    return np.count_nonzero(lit, axis=0) >= 2


def three_classes(light: NDArray[np.float32]) -> tuple[float, float]:
    """Return the thresholds that part grey levels into three classes.

    They maximise the variance between the classes. Source: Otsu, "A threshold selection
    method from gray-level histograms", IEEE Trans. SMC 1979, section IV.

    Args:
        light: Grey levels above dark, any shape.
    """
    level = np.clip(np.rint(light), 0, _LEVELS - 1).astype(np.int64)
    count = np.bincount(level.ravel(), minlength=_LEVELS).astype(np.float64)
    below = np.concatenate([[0.0], np.cumsum(count)])
    moment = np.concatenate([[0.0], np.cumsum(count * np.arange(_LEVELS))])

    def gain(first: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.float64]:
        n, sum_ = below[last] - below[first], moment[last] - moment[first]
        return sum_ * sum_ / np.maximum(n, 1.0)

    ends = np.arange(_LEVELS + 1)
    low, high = np.meshgrid(ends, ends, indexing="ij")
    whole = np.full_like(low, _LEVELS)
    between = gain(np.zeros_like(low), low) + gain(low, high) + gain(high, whole)
    between[low > high] = -np.inf
    # Between heaps of grey every threshold is as good: the middle one is taken.
    best = np.argwhere(between >= (1.0 - 1e-12) * between.max())
    one, two = best.mean(axis=0) - 0.5
    return float(one), float(two)


def best_threshold(
    together: NDArray[np.uint8 | np.float32],
    dark: NDArray[np.uint8 | np.float32],
    lit: NDArray[np.int64],
) -> float:
    """Return the threshold of most balanced accuracy, for who knows the truth.

    Args:
        together: All projectors on, shape (h, w).
        dark: All off, shape (h, w).
        lit: By how many projectors each pixel is lit, shape (h, w).
    """
    light = _brighter(together, dark)
    tried = np.arange(1.0, _LEVELS) - 0.5
    scores = [balanced_accuracy(light > threshold, lit) for threshold in tried]
    return float(tried[int(np.argmax(scores))])


def balanced_accuracy(double: NDArray[np.bool_], lit: NDArray[np.int64]) -> float:
    """Return the mean of the shares of doubly and singly lit pixels told rightly.

    NaN where there are none of either.

    Args:
        double: Pixels said to be lit twice, shape (h, w).
        lit: By how many projectors each is lit; those by none don't count, (h, w).
    """
    twice, once = lit >= 2, lit == 1
    if not (twice.any() and once.any()):
        return float("nan")
    return 0.5 * (float(np.mean(double[twice])) + float(np.mean(~double[once])))


def light_falls(
    projector: ProjectorCalibration,
    outer_radius: float,
    caster: Occluder,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return whether a projector's rings light points of the surface, by ray casting.

    Args:
        projector: As it stands.
        outer_radius: Where the last annulus ends, in its units.
        caster: What stands in the way.
        points: On the surface in [m], shape (n, 3).
        normals: Unit normals there, shape (n, 3).
    """
    pixels, depth = projector.panel(points)
    if projector.light == "diverging":
        beams = points - projector.centre
        reach = np.linalg.norm(beams, axis=1)
        beams, starts = beams / reach[:, None], projector.centre
    else:
        beams, reach = np.broadcast_to(projector.axis, points.shape), depth
        starts = points - reach[:, None] * beams
    ring = projector.to_ring(points)
    with np.errstate(invalid="ignore", divide="ignore"):
        rho = np.hypot(ring[:, 0], ring[:, 1])
        rho = rho / ring[:, 2] if projector.light == "diverging" else rho
        lit = projector.in_panel(pixels) & (depth > 0.0) & (rho <= outer_radius)
    lit &= -np.einsum("ij,ij->i", beams, normals) > _GLANCING
    rows = np.flatnonzero(lit)
    starts = np.broadcast_to(starts, points.shape)[rows]
    stop = reach[rows] * (1.0 - _SHADOW_SLACK)
    lit[rows] = ~caster.occluded(np.ascontiguousarray(starts), beams[rows], stop)
    return lit


def outer_radius(radii: NDArray[np.float64]) -> float:
    """Return where the last annulus ends: as wide as the one before, (n_rings,)."""
    return float(2.0 * radii[-1] - radii[-2])


def lit_twice(
    plan: RigPlan, pixels: NDArray[np.float64], p: int, c: int
) -> tuple[str, ...]:
    """Return which other projectors light most of some pixels, by the plan's geometry.

    Args:
        plan: Of the rig.
        pixels: In the image of camera `c`, shape (n, 2).
        p: Index of the projector that lights them anyway.
        c: Index of the camera.
    """
    supposed = Supposed.of(plan)
    at = places(Evidence.at(plan, pixels, p, c), supposed)
    known = np.isfinite(at.points[:, 0])
    if not known.any():
        return ()
    spot = supposed.body.caster, at.points[known], at.normals[known]
    lit: list[str] = []
    for q, projector in enumerate(supposed.projectors):
        outer = outer_radius(plan.projectors[q].ring_radii)
        if q != p and np.mean(light_falls(projector, outer, *spot)) > 0.5:
            lit.append(projector.id)
    return tuple(lit)


def _brighter(
    image: NDArray[np.uint8 | np.float32], dark: NDArray[np.uint8 | np.float32]
) -> NDArray[np.float32]:
    return np.subtract(image, dark, dtype=np.float32)
