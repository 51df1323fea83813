"""Images of two cameras to measured points, with no knowledge of the object."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_erosion, label

from planning.verify.reconstruction.arrays import Array, Grey, Indices, Mask
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.dense.dense_decode import depth_steps
from planning.verify.reconstruction.decode.dense.dense_limits import DenseLimits

from .level_image import Grid, halved_images
from .two_views import homogeneous, plane_normals
from .window_fit import REACH_PX, Fitted, WindowFit
from .window_search import WindowSearch

# Grey levels up to which a pixel shows but noise, and the dark beside the object.
DARK = 20.0
# Images are halved so often.
_LEVELS = 4
# Correlation of windows that are looked at more closely, and of those that match.
_ABOUT, _LEAST = 0.6, 0.85
# What a match is off beside its noise, alike whatever the noise is: windows are taken
# for planes, and surfaces are curved; images are taken on grids [px].
_LEAST_OFF_PX = 0.08
# Neighbours so far off tell how a surface bends [px].
_FAR_PX = 6.0
# The largest incidence at which windows are compared [rad].
_STEEPEST = np.deg2rad(80.0)
# At the border of a surface matches count up to so many times the median noise.
_VAGUE = 2.0
# Neighbours on its plane that a place has in a surface.
_LEAST_NEIGHBOURS, _SIGMAS = 2, 5.0
# So far off stand neighbours: nearer ones share most of their windows [px].
_APART_PX = 3.0
# What hangs together on fewer pixels is no surface.
_FEWEST_PX = 225
# Why a place may give no point, in the order in which it is asked.
VIEW_CAUSES = (
    *("no_match", "dark", "aslant", "angle", "unsure"),
    *("depth_step", "alone", "isolated", "border"),
)


@dataclass(frozen=True, eq=False)
class ObjectImage:
    """The part of a camera's image that holds the object.

    Attributes:
        grey: As recorded, shape (h, w).
        corner: Pixel (u, v) of the top-left pixel.
    """

    grey: Grey
    corner: tuple[int, int]


@dataclass(frozen=True, eq=False)
class MatchedViews:
    """What two cameras measured; indices of devices in the cloud are 0.

    Attributes:
        cloud: The points; `rays` of the first camera, `beams` of the second.
        n_asked: Pixels of which points were sought.
        rejected: Those that gave none, by cause.
    """

    cloud: Cloud
    n_asked: int
    rejected: dict[str, int]


def match_views(
    cameras: tuple[CameraCalibration, CameraCalibration],
    images: tuple[ObjectImage, ObjectImage],
    ball: tuple[Array, float],
    limits: DenseLimits,
    seed: tuple[int, ...],
) -> MatchedViews:
    """Measure what both cameras see, by windows of the first one's pixels.

    Args:
        cameras: As they are believed to stand.
        images: What they recorded.
        ball: Where the object is: centre in the world, shape (3,), and radius [m].
        limits: Angles, sigma and spacing of points.
        seed: Of the planes that the search draws.
    """
    first, second = cameras
    depth = float((ball[0] - first.centre) @ first.axis)
    depths = max(depth - ball[1], 1e-3 * depth), depth + ball[1]
    levels = tuple(halved_images(one.grey, one.corner, _LEVELS) for one in images)
    step = max(1, round(limits.spacing_m * first.focal_px / depth))
    search = WindowSearch(cameras, (levels[0], levels[1]), depths, seed)
    found = search.found(step, DARK)
    about = np.flatnonzero(found.scores >= _ABOUT)
    if not len(about):
        none = {"no_match": len(found.scores)} if len(found.scores) else {}
        return MatchedViews(Cloud.empty(), len(found.scores), none)
    fit = WindowFit(cameras, (levels[0][0], levels[1][0]), DARK)
    fitted = fit.fitted(found.grid.pixels[about], found.planes[about])
    cloud = _cloud(first, second, found.grid.pixels[about], fitted)
    return _judged(cloud, fitted, found.grid, about, cameras, limits)


def _cloud(
    first: CameraCalibration, second: CameraCalibration, pixels: Array, fitted: Fitted
) -> Cloud:
    """Points of all windows."""
    local = homogeneous(first, pixels)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = 1.0 / fitted.planes[:, 0]
        away = z * np.linalg.norm(local, axis=1)
    rays = local / np.linalg.norm(local, axis=1)[:, None]
    rays = rays @ first.world_from_device[:3, :3].T
    points = first.centre + away[:, None] * rays
    beams = _towards(second, points)
    n = len(pixels)
    device = np.zeros(n, dtype=np.int16)
    # With d = 1 / z a pixel along the epipolar line moves the point by z^2 / (du/dd).
    per_px = away * z / np.maximum(fitted.moved, 1e-12)
    cosine = np.clip(np.einsum("ij,ij->i", rays, beams), -1.0, 1.0)
    return Cloud(
        points=points,
        rays=rays,
        beams=beams,
        pixels=pixels,
        camera=device,
        projector=device,
        ring=np.full(n, -2, dtype=np.int16),
        conditioning=np.sqrt(1.0 - cosine**2),
        shift=per_px[:, None] * rays,
        noise_px=fitted.sigma * fitted.moved,
        blur_px=np.full(n, np.nan),
        bias_px=np.full(n, _LEAST_OFF_PX),
    )


def _judged(
    cloud: Cloud,
    fitted: Fitted,
    grid: Grid,
    about: Indices,
    cameras: tuple[CameraCalibration, CameraCalibration],
    limits: DenseLimits,
) -> MatchedViews:
    """Leave out what doesn't match, is unsure, or hangs together with nothing."""
    first, second = cameras
    cosine = np.einsum("ij,ij->i", cloud.rays, cloud.beams)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    spread = np.linalg.norm(cloud.shift, axis=1) * np.hypot(
        cloud.noise_px, cloud.bias_px
    )
    with np.errstate(invalid="ignore"):
        fails = {
            "no_match": ~((fitted.scores >= _LEAST) & (fitted.planes[:, 0] > 0.0)),
            "dark": ~fitted.lit,
            "aslant": ~_facing(cloud, fitted, first),
            "angle": ~((angle >= limits.min_angle) & (angle <= limits.max_angle)),
            "unsure": ~(spread <= limits.max_sigma_m),
        }
    alone = ~np.any(list(fails.values()), axis=0)
    depth, sigma = np.full(grid.index.shape, np.nan), np.zeros(grid.index.shape)
    place = np.flatnonzero(grid.index.ravel() >= 0)[about]
    away = np.linalg.norm(cloud.points - first.centre, axis=1)
    depth.ravel()[place[alone]] = away[alone]
    sigma.ravel()[place[alone]] = spread[alone]
    at_step = depth_steps(depth, sigma, limits.max_slant * grid.step / first.focal_px)
    fails["depth_step"] = at_step.ravel()[place]
    planes = np.full((*grid.index.shape, 3), np.nan)
    planes.reshape(-1, 3)[place[alone]] = fitted.planes[alone]
    lone = _neighbours(planes, sigma, grid.step, first.focal_px) < _LEAST_NEIGHBOURS
    fails["alone"] = lone.ravel()[place]
    whole = np.isfinite(depth) & ~at_step & ~lone
    whole = _hanging_together(whole, _FEWEST_PX // grid.step**2)
    fails["isolated"] = ~whole.ravel()[place]
    # What lies beside a surface may look like its border, but never as exactly.
    inner = binary_erosion(whole, iterations=-(-REACH_PX // grid.step))
    at_border = whole & ~np.asarray(inner, dtype=bool)
    typical = np.median(cloud.noise_px[alone]) if alone.any() else 0.0
    vague = cloud.noise_px > _VAGUE * typical
    fails["border"] = at_border.ravel()[place] & vague
    n_asked = int(np.count_nonzero(grid.index >= 0))
    outcome = np.full(len(about), -1)
    for cause in reversed(fails):
        outcome[fails[cause]] = VIEW_CAUSES.index(cause)
    rejected = {
        cause: int(np.count_nonzero(outcome == k))
        for k, cause in enumerate(VIEW_CAUSES)
    }
    rejected["no_match"] += n_asked - len(about)
    bent = _bending(planes, grid.step).ravel()[place]
    known = np.isfinite(bent)
    factor = np.where(known, fitted.planes[:, 0] / (fitted.planes[:, 0] - bent), 1.0)
    points = first.centre + factor[:, None] * (cloud.points - first.centre)
    cloud = replace(cloud, points=points, beams=_towards(second, points))
    return MatchedViews(cloud.take(outcome < 0), n_asked, rejected)


def _bending(planes: Array, step: int) -> Array:
    """Return how far surfaces lie off their windows' planes in d, NaN unknown, (h, w).

    Of a quadric the plane of a round window of radius R is off in its middle by
    (d_uu + d_vv) R^2 / 8, and neighbours' slopes tell both second derivatives.
    """
    bent = np.full((2, *planes.shape[:2]), np.nan)
    far = max(1, round(_FAR_PX / step))
    for k, (axis, slope) in enumerate(((0, 2), (1, 1))):
        d = planes[:, :, slope]
        ahead, behind = (np.roll(d, way * far, axis) for way in (-1, 1))
        bent[k] = (ahead - behind) / (2.0 * far * step)
        edge = [slice(None)] * 2
        for part in (slice(0, far), slice(-far, None)):
            edge[axis] = part
            bent[(k, *edge)] = np.nan
    return bent.sum(axis=0) * (REACH_PX + 0.5) ** 2 / 8.0


def _towards(camera: CameraCalibration, points: Array) -> Array:
    beams = points - camera.centre
    return beams / np.linalg.norm(beams, axis=1)[:, None]


def _facing(cloud: Cloud, fitted: Fitted, first: CameraCalibration) -> Mask:
    """Whether both cameras look at the front of a window's plane, not too steeply."""
    normals = plane_normals(first, cloud.pixels, fitted.planes)
    least = np.cos(_STEEPEST)
    looks = [np.einsum("ij,ij->i", normals, r) for r in (cloud.rays, cloud.beams)]
    return (looks[0] >= least) & (looks[1] >= least)


def _neighbours(planes: Array, sigma: Array, step: int, focal_px: float) -> Indices:
    """Return how many of four neighbours lie on each place's plane, shape (h, w).

    But for noise, and half of what is between both, for surfaces are curved.

    Args:
        planes: d, d_u, d_v of each place; NaN: unknown, shape (h, w, 3).
        sigma: Deviation of its depth [m], shape (h, w).
        step: Pixels between places.
        focal_px: Of the first camera.
    """
    count = np.zeros(sigma.shape, dtype=np.int64)
    far = max(1, round(_APART_PX / step))
    for axis, slope in ((0, 2), (1, 1)):
        for way in (far, -far):
            there = np.roll(planes[:, :, 0], -way, axis)
            spread = np.hypot(sigma, np.roll(sigma, -way, axis))
            edge = [slice(None)] * 2
            edge[axis] = slice(-far, None) if way > 0 else slice(0, far)
            there[tuple(edge)] = np.nan
            with np.errstate(invalid="ignore", divide="ignore"):
                expected = planes[:, :, 0] + way * step * planes[:, :, slope]
                off = np.abs(1.0 / there - 1.0 / expected)
                between = 0.5 * far * step / (focal_px * planes[:, :, 0])
                count += off <= between + _SIGMAS * spread
    return count


def _hanging_together(whole: Mask, fewest: int) -> Mask:
    """Places of pieces of so many or more."""
    pieces = np.zeros(whole.shape, dtype=np.int64)
    label(whole, output=pieces)
    size = np.bincount(pieces.ravel(), minlength=1)
    size[0] = 0
    return whole & (size[pieces] >= fewest)
