"""Many overlapping clouds to one: eqs. (5)-(7), from what was measured alone.

Poses are known, so that the clouds are in one frame already. Where clouds overlap is
found from the light in the images, and confirmed by geometry: a camera's pixel shows
one point, and a ray of light lights one. Points at steps that others contradict, or
that nothing confirms, go; what several cameras measured of a ring is one curve.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import PairIndex
from planning.verify.reconstruction.decode.lit_image import LitImage
from planning.verify.reconstruction.scanner import Scanner

from .calibration_sigma import calibration_sigma, camera_px
from .dense_merge import cells_of, merge_dense
from .overlaps import compare_overlaps, pixel_sizes
from .rings.point_sigma import Sigmas
from .rings.ring_curves import RingCurves

# Points of two projectors are of one spot in a cell so large [px].
_SPOT_PX = 1.5
# In cells so large those go whose sigma is so many times that of another pair: they
# fell on other places, but hardly measure them.
_PLACE_PX, _MUCH_WORSE = 4.0, 6.0
# The projector blurs the edges that it draws, but not steps. Edges are taken for steps
# below these shares of a pair's median blur: if no other camera confirms them; if an
# edge of another projector lies there, too, or its light differs; if another camera
# contradicts them. The light's word counts one less against what a camera confirms,
# and so does sharpness: such edges may be steps, and no line has them.
_SHARP, _CROSSED, _CONTRADICTED = 0.5, 0.75, 0.9


@dataclass(frozen=True, eq=False)
class Merged:
    """One cloud without redundancy.

    Attributes:
        cloud: The points that stay, moved onto the curves that all cameras measured.
        stays: Which of all points these are, shape (n_all,).
        steps: Which are left out as edges between surfaces, shape (n_all,).
        shared: Which lie where two projectors' light shows, shape (n_all,).
        normals: By the points around, towards the camera; NaN: too few, shape (n, 3).
        sigma: Standard deviation of each point along its normal, of noise [m]; NaN
            likewise.
        calibration: That of what the calibration leaves [m], shape (n,); 0: not stated.
    """

    cloud: Cloud
    stays: Mask
    steps: Mask
    shared: Mask
    normals: Array
    sigma: Array
    calibration: Array

    def joined(self, other: "Merged") -> "Merged":
        """Return the points of both, of sequences that measured different places."""
        pairs = ((getattr(one, f.name) for one in (self, other)) for f in fields(self))
        clouds, *columns = map(tuple, pairs)
        return Merged(Cloud.join(clouds), *map(np.concatenate, columns))


def merge(
    cloud: Cloud, plan: Scanner, lit: Mapping[PairIndex, LitImage], *, pitch_px: float
) -> Merged:
    """Remove false and redundant points, and average what remains.

    Points of rings along these, and those of coded pixels in cells: see `merge_rings`
    and `merge_dense`. Arguments are as of `merge_rings`.
    """
    coded = cloud.ring < 0
    if not coded.any():
        return merge_rings(cloud, plan, lit, pitch_px=pitch_px)
    dense = _dense_part(cloud.take(coded), plan)
    if coded.all():
        return dense
    rings = merge_rings(cloud.take(~coded), plan, lit, pitch_px=pitch_px)
    return _in_order(rings, dense, coded)


def _dense_part(cloud: Cloud, plan: Scanner) -> Merged:
    """Merge points of coded pixels."""
    found = merge_dense(cloud, plan, cell_m=plan.limits.dense.spacing_m)
    return Merged(
        found.cloud,
        found.stays,
        np.zeros(len(cloud), dtype=bool),
        found.shared,
        found.normals,
        found.sigma,
        calibration_sigma(found.cloud, found.normals, plan),
    )


def _in_order(rings: Merged, dense: Merged, coded: Mask) -> Merged:
    """Bring points of both kinds into the order in which they were measured."""
    joined = rings.joined(dense)
    place = np.concatenate([np.flatnonzero(~coded), np.flatnonzero(coded)])
    masks = {}
    for name in ("stays", "steps", "shared"):
        masks[name] = np.zeros(len(coded), dtype=bool)
        masks[name][place] = getattr(joined, name)
    order = np.argsort(place[joined.stays])
    return Merged(
        joined.cloud.take(order),
        **masks,
        normals=joined.normals[order],
        sigma=joined.sigma[order],
        calibration=joined.calibration[order],
    )


def merge_rings(
    cloud: Cloud, plan: Scanner, lit: Mapping[PairIndex, LitImage], *, pitch_px: float
) -> Merged:
    """Remove false and redundant points, and average what remains along its rings.

    Args:
        cloud: Of all pairs.
        plan: Whose devices measured it; the object isn't looked at.
        lit: What each pair's images show.
        pitch_px: About how far rings are apart in images.
    """
    shared, crossed, differs = compare_overlaps(cloud, plan, lit)
    # Cameras disagree by what the calibration leaves, and count for as much less.
    unsure_px = np.hypot(cloud.noise_px, camera_px(cloud, plan))
    curves = RingCurves.of(replace(cloud, noise_px=unsure_px), plan)
    sharpness = _sharpness(cloud)
    confirmed, contradicted = curves.evidence(sharpness)
    steps = ~confirmed & ((sharpness < _SHARP) | differs)
    steps |= crossed & (sharpness < np.where(confirmed, _SHARP, _CROSSED))
    steps |= differs & (sharpness < _CROSSED)
    steps |= contradicted & (sharpness < _CONTRADICTED)
    doubtful = sharpness < np.where(confirmed, _SHARP, _CROSSED)

    noise = cloud.noise_px / np.hypot(unsure_px, cloud.bias_px)
    fit = curves.only(~(steps | (sharpness < _SHARP))).fitted(noise)
    left = Sigmas.of(
        cloud, fit, plan, doubtful=doubtful, steps=steps, pitch_px=pitch_px
    )
    fitted, normals, sigma = left.cloud, left.normals, left.sigma
    calibration = calibration_sigma(fitted, normals, plan)
    total = np.hypot(sigma, calibration)

    stays = ~(steps | fit.redundant)
    size = pixel_sizes(cloud, plan)
    projector = cloud.projector.astype(np.int64)
    # What one camera sees at a slant another's point doesn't stand for.
    octant = ((normals > 0.0) @ np.array([1, 2, 4])).astype(np.int64)
    camera = cloud.camera.astype(np.int64)
    pair = projector * len(plan.cameras) + camera
    for among, side_px, kind, source, ratio in (
        (stays & shared, _SPOT_PX, camera, projector, 1.0),
        (stays, _PLACE_PX, octant, pair, _MUCH_WORSE),
    ):
        some = np.flatnonzero(among & stays)
        if len(some):
            side_m = side_px * float(np.median(size[some]))
            cell = cells_of(fitted.points[some], kind[some], side_m)
            most = plan.limits.max_sigma_m
            stays[some] = _sure(cell, source[some], total[some], ratio, most)
    return Merged(
        fitted.take(stays),
        stays,
        steps,
        shared,
        normals[stays],
        sigma[stays],
        calibration[stays],
    )


def _sharpness(cloud: Cloud) -> Array:
    """Blur of each edge as a share of the median of its pair; NaN: unknown, (n,)."""
    sharpness = np.full(len(cloud), np.nan)
    for camera in np.unique(cloud.camera):
        for projector in np.unique(cloud.projector):
            pair = (cloud.camera == camera) & (cloud.projector == projector)
            if np.isfinite(cloud.blur_px[pair]).any():
                usual = np.nanmedian(cloud.blur_px[pair])
                sharpness[pair] = cloud.blur_px[pair] / usual
    return sharpness


def _sure(
    cell: Array, source: Indices, sigma: Array, ratio: float, most: float
) -> Mask:
    """Which points are of the best one's source in their cell, or about as sure.

    None of another source is over `most` [m] where the best keeps to it.
    """
    # Without a normal a point gives way to any other.
    known = np.where(np.isfinite(sigma), sigma, np.inf)
    _, place = np.unique(cell, return_inverse=True)
    least = np.full(place.max() + 1, np.inf)
    np.minimum.at(least, place, known)
    best = np.flatnonzero(known == least[place])[::-1]
    best_source = np.empty(len(least), dtype=source.dtype)
    best_source[place[best]] = source[best]
    good = source == best_source[place]
    others = np.minimum(ratio * least, np.maximum(most, least))
    return good | ((ratio > 1.0) & (known <= others[place]))
