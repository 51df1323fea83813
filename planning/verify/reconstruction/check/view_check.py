"""The simulated reconstruction of cameras alone: render, match, merge, compare."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from geometry.parallel import abandonable, n_threads
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.views.view_decode import (
    MatchedViews,
    ObjectImage,
    match_views,
)
from planning.verify.reconstruction.render.photometry import Photometry, assumed_light
from planning.verify.reconstruction.render.rendered import Progress, Spent
from planning.verify.reconstruction.render.textured import (
    SolidTexture,
    render_textured,
    typical_pixel,
)
from planning.verify.reconstruction.scanner import Scanner

from .accuracy import Expected, share_of
from .calibration_sigma import calibration_sigma
from .dense_merge import merge_dense
from .judged import fresh_samples, judged
from .merge import Merged
from .result import PairCount, Reconstruction

# Of the ball that holds the object so many places are looked at, and pairs are matched
# whose rays meet within the limits at this share of those that both see.
_PLACES, _LEAST_SHARE = 500, 0.05

_Pair = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Ball:
    """Where the object is, as the workspace says: centre (3,) and radius [m]."""

    centre: Array
    radius_m: float


def reconstruct_views(
    plan: Scanner,
    ball: Ball,
    *,
    seed: int,
    threads: int | None = None,
    truth: Scanner | None = None,
    expected: Expected | None = None,
    photometry: Photometry | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Measure an object by the texture in rendered images, and judge the result.

    Arguments are as of `reconstruct`; what is matched is known to lie within the ball.
    """
    threads, spent = threads or n_threads(), Spent()
    light = photometry or assumed_light(plan)
    images = _images(plan, truth or plan, light, ball, seed, threads, spent)
    pairs = list(matched_pairs(plan, ball))
    if progress is not None:
        progress(0, len(pairs))

    def measure(pair: _Pair) -> MatchedViews | None:
        one, other = (images[c] for c in pair)
        if one is None or other is None:
            return None
        cameras = plan.cameras[pair[0]], plan.cameras[pair[1]]
        where = ball.centre, ball.radius_m
        with spent.on("decode"):
            return match_views(
                cameras, (one, other), where, plan.limits.dense, (seed, *pair)
            )

    found: list[tuple[_Pair, MatchedViews]] = []
    with abandonable(threads) as pool:
        for pair, matched in zip(pairs, pool.map(measure, pairs), strict=True):
            if matched is not None:
                found.append((pair, matched))
            if progress is not None:
                progress(len(found), len(pairs))
    clouds = [_of_cameras(gave.cloud, *pair) for pair, gave in found]
    everything = Cloud.join([Cloud.empty(), *clouds])
    with spent.on("merge"):
        merged = merge_views(everything, plan)
    counts = tuple(_count(plan, pair, gave) for pair, gave in found)
    return judged(
        *(plan, everything, merged, counts, expected or fresh_samples(plan, seed)),
        photometry=light,
        spent=spent,
        nothing="no point was measured: no images matched",
    )


def matched_pairs(plan: Scanner, ball: Ball) -> list[_Pair]:
    """Return pairs of cameras that see much of the ball together at a fit angle."""
    rng = np.random.default_rng(0)
    ways = rng.standard_normal((_PLACES, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    reach = ball.radius_m * np.cbrt(rng.random((_PLACES, 1)))
    places = ball.centre + reach * ways
    seen = [_in_image(camera, places) for camera in plan.cameras]
    limits = plan.limits.dense
    pairs: list[_Pair] = []
    for a, b in combinations(range(len(plan.cameras)), 2):
        both = places[seen[a] & seen[b]]
        rays = [both - plan.cameras[c].centre for c in (a, b)]
        rays = [r / np.linalg.norm(r, axis=1)[:, None] for r in rays]
        cosine = np.clip(np.einsum("ij,ij->i", *rays), -1.0, 1.0)
        angle = np.arccos(cosine)
        fit = (angle >= limits.min_angle) & (angle <= limits.max_angle)
        if share_of(fit) >= _LEAST_SHARE:
            pairs.append((a, b))
    return pairs


def merge_views(cloud: Cloud, plan: Scanner) -> Merged:
    """Average what several pairs of cameras measured of one place.

    The second camera of a pair stands for what lights a dense code: pairs with another
    one are others, whose noise is their own.
    """
    by_pair = replace(
        cloud, projector=cloud.by_camera, ring=np.full_like(cloud.ring, -1)
    )
    if not len(cloud):
        none, nothing = np.zeros(0, dtype=bool), np.zeros(0)
        return Merged(cloud, none, none, none, np.zeros((0, 3)), nothing, nothing)
    found = merge_dense(by_pair, plan, cell_m=plan.limits.dense.spacing_m)
    kept = replace(
        found.cloud,
        projector=np.zeros_like(found.cloud.projector),
        ring=(-2 - found.cloud.projector).astype(np.int16),
    )
    return Merged(
        kept,
        found.stays,
        np.zeros(len(cloud), dtype=bool),
        found.shared,
        found.normals,
        found.sigma,
        calibration_sigma(kept, found.normals, plan),
    )


def _images(
    plan: Scanner,
    truth: Scanner,
    light: Photometry,
    ball: Ball,
    seed: int,
    threads: int,
    spent: Spent,
) -> list[ObjectImage | None]:
    """What each camera of the plan records; None: nothing, or it isn't there."""
    caster = RayCaster(truth.mesh, threads=1)
    texture = SolidTexture.drawn(typical_pixel(plan, ball.centre), seed)
    standing = {camera.id: camera for camera in truth.cameras}

    def record(c: int) -> ObjectImage | None:
        camera = standing.get(plan.cameras[c].id)
        if camera is None:
            return None
        with spent.on("render"):
            return render_textured(truth, camera, caster, texture, light, (seed, c))

    with abandonable(threads) as pool:
        return list(pool.map(record, range(len(plan.cameras))))


def _in_image(camera: CameraCalibration, places: Array) -> Mask:
    pixels = camera.project(places)
    width, height = camera.resolution
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0.0) & (pixels <= np.array([width - 1, height - 1]))
    return np.asarray(inside.all(axis=1), dtype=bool)


def _of_cameras(cloud: Cloud, a: int, b: int) -> Cloud:
    """Return points with the indices of both cameras."""
    named = cloud.of_devices(0, a)
    return replace(named, ring=np.full(len(cloud), -2 - b, dtype=np.int16))


def _count(plan: Scanner, pair: _Pair, gave: MatchedViews) -> PairCount:
    one, other = (plan.cameras[c].id for c in pair)
    n = gave.n_asked
    return PairCount(other, one, n, n, len(gave.cloud), gave.rejected)
