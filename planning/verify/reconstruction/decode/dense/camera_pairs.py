"""Two cameras that see the same pixels of a projector, by each other.

A pixel of the one camera shows a place of the panel; where the other camera shows the
same place follows from its own codes, which are linear about a pixel::

    code(x) = code(x_0) + J (x - x_0)

The point lies where both viewing rays meet, and the projector's pose and lens count for
nothing.
"""

import numpy as np
from scipy.spatial import KDTree

from geometry.arrays import lengths
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.code_map import CodeMap

from .dense_limits import DenseLimits
from .uneven_light import UNSURE

# A code lies this far from the pixel that shows it, at most [px].
_BESIDE_PX = 1.0
_LEAST_OFF_PX = 0.01
_SIGMAS = 5.0


def between_cameras(
    one: tuple[CameraCalibration, CodeMap],
    other: tuple[CameraCalibration, CodeMap],
    limits: DenseLimits,
) -> tuple[Cloud, int]:
    """Return points that two cameras measured by the codes of one projector.

    And of how many pixels of the first one they were asked. All indices of devices are
    0, and `beams` the other's viewing rays.
    """
    (camera, codes), (second, theirs) = one, other
    places = _asked(codes)
    n_asked = len(places)
    wanted = codes.codes.reshape(-1, 2)[places].astype(np.float64)
    spread = codes.sigma.reshape(-1, 2)[places].astype(np.float64)
    pixels, by_code, found = _shown_at(theirs, wanted)
    places, wanted, spread = places[found], wanted[found], spread[found]
    own = codes.pixels(places)
    rays, beams = camera.rays(own), second.rays(pixels)
    t, gap, along = _meet(camera.centre, rays, second.centre, beams)
    points = camera.centre + t[:, None] * rays
    # Both cameras' codes are off; as pixels of the second camera, along its line.
    sigma_px, across_px = _along_line(by_code, np.sqrt(2.0) * spread, along, second)
    reach = lengths(points - second.centre)
    moved = np.linalg.norm(codes.moved.reshape(-1, 2)[places], axis=1)
    slope = np.sqrt(np.abs(np.linalg.det(by_code)))
    passes_px = gap / reach * second.focal_px
    cosine = np.clip(np.einsum("ij,ij->i", rays, beams), -1.0, 1.0)
    angle = np.arccos(cosine)
    per_px = reach / second.focal_px / np.maximum(np.sin(angle), 1e-9)
    with np.errstate(invalid="ignore"):
        good = (t > 0.0) & (angle >= limits.min_angle) & (angle <= limits.max_angle)
        good &= passes_px <= limits.slack_px + _SIGMAS * across_px
        good &= per_px * sigma_px <= limits.max_sigma_m
    n = len(places)
    device = np.zeros(n, dtype=np.int16)
    cloud = Cloud(
        points=points,
        rays=rays,
        beams=beams,
        pixels=own,
        camera=device,
        projector=device,
        ring=np.full(n, -2, dtype=np.int16),
        conditioning=np.sin(angle),
        shift=per_px[:, None] * rays,
        noise_px=sigma_px,
        blur_px=np.full(n, np.nan),
        bias_px=np.hypot(_LEAST_OFF_PX, np.sqrt(2.0) * UNSURE * moved * slope),
    )
    return cloud.take(good), n_asked


def _asked(codes: CodeMap) -> Indices:
    """Pixels of which points are made, flat."""
    rows, columns = np.divmod(codes.told, codes.codes.shape[1])
    return codes.told[(rows % codes.step == 0) & (columns % codes.step == 0)]


def _shown_at(codes: CodeMap, wanted: Array) -> tuple[Array, Array, Mask]:
    """Where a camera shows codes, between its pixels.

    Returns the pixels (u, v) of those that it shows, (k, 2); what they move by with a
    code, J^-1, (k, 2, 2); and which these are, (n,).
    """
    map_ = codes.codes.astype(np.float64)
    slopes = np.stack([_slope(map_, 1), _slope(map_, 0)], axis=-1).reshape(-1, 2, 2)
    flat = map_.reshape(-1, 2)
    able = np.flatnonzero(
        np.isfinite(flat).all(axis=1) & np.isfinite(slopes).all((1, 2))
    )
    found = np.zeros(len(wanted), dtype=bool)
    if len(able) == 0 or len(wanted) == 0:
        return np.zeros((0, 2)), np.zeros((0, 2, 2)), found
    # The nearest code isn't quite the nearest pixel, where the surface is aslant: what
    # is left is a step of less than a pixel or it is none.
    _, nearest = KDTree(flat[able]).query(wanted)
    near = able[nearest]
    slope = slopes[near]
    size = np.abs(np.linalg.det(slope))
    regular = size > 1e-6
    inverse = np.linalg.inv(np.where(regular[:, None, None], slope, np.eye(2)))
    step = np.einsum("nij,nj->ni", inverse, wanted - flat[near])
    found = regular & (np.abs(step) <= _BESIDE_PX).all(axis=1)
    return codes.pixels(near[found]) + step[found], inverse[found], found


def _slope(codes: Array, axis: int) -> Array:
    """Central differences of codes (h, w, 2) over pixels; NaN at borders."""
    slope = np.full(codes.shape, np.nan)
    inner = [slice(None)] * 3
    ahead, behind = list(inner), list(inner)
    inner[axis], ahead[axis], behind[axis] = slice(1, -1), slice(2, None), slice(-2)
    slope[tuple(inner)] = 0.5 * (codes[tuple(ahead)] - codes[tuple(behind)])
    return slope


def _meet(
    origin: Array, rays: Array, other: Array, beams: Array
) -> tuple[Array, Array, Array]:
    """Where viewing rays come nearest to another camera's.

    Returns distances along the first [m], how far they pass each other [m], and unit
    directions of the first ray across the second's, shape (n, 3).
    """
    baseline = other - origin
    cosine = np.einsum("ij,ij->i", rays, beams)
    with np.errstate(invalid="ignore", divide="ignore"):
        t = (rays @ baseline - cosine * (beams @ baseline)) / (1.0 - cosine**2)
        s = cosine * t - beams @ baseline
        between = t[:, None] * rays - s[:, None] * beams - baseline
        along = rays - cosine[:, None] * beams
        along /= lengths(along)[:, None]
    behind = (t <= 0.0) | (s <= 0.0)
    return np.where(behind, np.nan, t), lengths(between), along


def _along_line(
    by_code: Array, spread: Array, along: Array, camera: CameraCalibration
) -> tuple[Array, Array]:
    """Deviations of a position (n,) [px] along its epipolar line, and across it.

    Args:
        by_code: What the pixel moves by with the code, shape (n, 2, 2).
        spread: Standard deviations of codes, shape (n, 2).
        along: The line's direction in the world, shape (n, 3).
        camera: That sees it.
    """
    line = along @ camera.world_from_device[:3, :2]
    line /= np.maximum(lengths(line), 1e-12)[:, None]
    across = line[:, ::-1] * np.array([-1.0, 1.0])
    sides = (
        lengths(np.einsum("ni,nij->nj", side, by_code) * spread)
        for side in (line, across)
    )
    one, other = sides
    return one, other
