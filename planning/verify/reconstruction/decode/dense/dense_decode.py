"""Images of a dense sequence to measured points, with no knowledge of the object."""

import numpy as np
from scipy.ndimage import binary_dilation, label

from planning.verify.reconstruction.arrays import Array, Grey, Indices, Mask
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.code_map import CodeMap
from planning.verify.reconstruction.decode.decode import Decoded
from planning.verify.reconstruction.decode.edges import ImageEdges
from planning.verify.reconstruction.decode.lit_image import LitImage
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern
from planning.verify.reconstruction.patterns.ring_patterns import Frames

from .coded_pixels import CODE_CAUSES, CodedPixels, read_codes
from .dense_limits import DenseLimits
from .two_rays import TwoRays, meet_rays
from .uneven_light import UNSURE

# Saturated pixels that are kept as evidence, about.
_SATURATED_KEPT = 500
# Fewer pixels that hang together are no surface.
_FEWEST = 25
_SIGMAS = 5.0
# What a code may be off beside its noise, alike in every image: steps of the panel's
# pixels and of grey levels [px of the projector].
_LEAST_OFF_PX = 0.005
# Why a pixel may give no point, in the order in which it is asked.
DENSE_CAUSES = (
    *CODE_CAUSES,
    "no_intersection",
    "residual",
    "angle",
    "unsure",
    "depth_step",
    "isolated",
)


def decode_dense(
    frames: Frames,
    pattern: DensePattern,
    calibration: PairCalibration,
    limits: DenseLimits,
) -> Decoded:
    """Measure points from images, pattern and calibration alone.

    Raises:
        ValueError: If the frames aren't as many as the pattern's.
    """
    return measure_codes(read_codes(frames, pattern), calibration, limits)


def measure_codes(
    read: CodedPixels, calibration: PairCalibration, limits: DenseLimits
) -> Decoded:
    """Measure the points of pixels whose codes are read.

    Points are made of every so many pixels, so that they are about `spacing_m` apart;
    all are looked at to find the steps between surfaces.
    """
    codes, camera = read.map, calibration.camera
    shape, places = codes.codes.shape[:2], codes.told
    pixels = codes.pixels(places)
    met = meet_rays(
        camera.centre,
        camera.rays(pixels),
        codes.codes.reshape(-1, 2)[places].astype(np.float64),
        codes.sigma.reshape(-1, 2)[places].astype(np.float64),
        calibration.projector,
    )
    fails = _failures(met, limits)
    depth = np.full(shape, np.nan)
    alone = ~np.any(list(fails.values()), axis=0)
    depth.ravel()[places[alone]] = met.distances[alone]
    spread = np.zeros(shape)
    spread.ravel()[places] = np.nan_to_num(met.per_px * met.sigma_px)
    mixed = np.zeros(shape, dtype=bool)
    mixed.ravel()[read.lit[read.causes == CODE_CAUSES.index("mixed")]] = True
    at_step = depth_steps(depth, spread, limits.max_slant / camera.focal_px)
    beside = binary_dilation(mixed, np.ones((3, 3), dtype=bool))
    at_step |= np.asarray(beside, dtype=bool)
    whole = np.isfinite(depth) & ~at_step
    fails["depth_step"] = at_step.ravel()[places]
    fails["isolated"] = ~_hanging_together(whole).ravel()[places]

    step = _step(met.distances[alone] / camera.focal_px, limits.spacing_m)
    asked = _on_grid(places, shape[1], step)
    outcome = np.full(len(places), -1, dtype=np.int8)
    for cause in reversed(fails):
        outcome[fails[cause]] = DENSE_CAUSES.index(cause)
    lit_asked = _on_grid(read.lit, shape[1], step)
    early = read.causes[lit_asked]
    every = np.concatenate([early[early >= 0], outcome[asked]])
    good = asked & (outcome < 0)
    told = CodeMap(
        np.where(at_step[:, :, None], np.nan, codes.codes),
        codes.sigma,
        codes.moved,
        codes.corner,
        step,
    )
    return Decoded(
        cloud_of(met, pixels, codes.moved.reshape(-1, 2)[places]).take(good),
        len(read.lit),
        int(np.count_nonzero(lit_asked)),
        {
            cause: int(np.count_nonzero(every == k))
            for k, cause in enumerate(DENSE_CAUSES)
        },
        ImageEdges.nothing(),
        np.zeros(0, dtype=np.int8),
        len(read.saturated),
        read.saturated[:: max(1, len(read.saturated) // _SATURATED_KEPT)],
        LitImage.nothing(),
        told,
        _typical(met.residual_px),
    )


def cloud_of(met: TwoRays, pixels: Array, moved: Grey) -> Cloud:
    """Return points of two rays that meet, all of them.

    Of pixels (u, v), whose codes uneven light had moved, shape (n, 2) each.
    """
    n = len(pixels)
    device = np.zeros(n, dtype=np.int16)
    return Cloud(
        points=met.points,
        rays=met.rays,
        beams=met.beams,
        pixels=pixels,
        camera=device,
        projector=device,
        ring=np.full(n, -1, dtype=np.int16),
        conditioning=np.sin(met.angle),
        shift=met.per_px[:, None] * met.rays,
        noise_px=met.sigma_px,
        blur_px=np.full(n, np.nan),
        bias_px=np.hypot(_LEAST_OFF_PX, UNSURE * np.linalg.norm(moved, axis=1)),
    )


def depth_steps(depth: Array, spread: Array, per_px: float) -> Mask:
    """Return pixels beside a step between surfaces, shape (h, w).

    Where the distance to a neighbour changes by more than `per_px` of itself and what
    noise explains: of both one may show the two surfaces at once.

    Args:
        depth: Along the viewing rays; NaN: unknown [m].
        spread: Its standard deviation [m].
        per_px: Of a pixel, as a share of the distance.
    """
    steps = np.zeros(depth.shape, dtype=bool)
    for axis in (0, 1):
        ahead = [slice(None)] * 2
        behind = [slice(None)] * 2
        ahead[axis], behind[axis] = slice(1, None), slice(-1)
        one, other = tuple(ahead), tuple(behind)
        noise = np.hypot(spread[one], spread[other])
        most = per_px * np.minimum(depth[one], depth[other]) + _SIGMAS * noise
        # Beside pixels without a depth nothing is known.
        step = np.abs(depth[one] - depth[other]) > most
        steps[one] |= step
        steps[other] |= step
    return steps


def _failures(met: TwoRays, limits: DenseLimits) -> dict[str, Mask]:
    """Why points of two rays don't count, each by itself, shape (n,)."""
    most = limits.slack_px + _SIGMAS * met.residual_sigma_px
    angle = met.angle
    with np.errstate(invalid="ignore"):
        return {
            "no_intersection": ~np.isfinite(met.distances),
            "residual": ~(met.residual_px <= most),
            "angle": ~((angle >= limits.min_angle) & (angle <= limits.max_angle)),
            "unsure": ~(met.per_px * met.sigma_px <= limits.max_sigma_m),
        }


def _hanging_together(whole: Mask) -> Mask:
    """Pixels of pieces that are large enough."""
    pieces = np.zeros(whole.shape, dtype=np.int64)
    label(whole, output=pieces)
    size = np.bincount(pieces.ravel(), minlength=1)
    size[0] = 0
    return size[pieces] >= _FEWEST


def _step(pixel_m: Array, spacing_m: float) -> int:
    """Return every how many pixels a point is made."""
    if not len(pixel_m):
        return 1
    return max(1, int(spacing_m / float(np.median(pixel_m))))


def _on_grid(places: Indices, width: int, step: int) -> Mask:
    rows, columns = np.divmod(places, width)
    return (rows % step == 0) & (columns % step == 0)


def _typical(residuals: Array) -> float:
    """Median; NaN of nothing."""
    known = residuals[np.isfinite(residuals)]
    return float(np.median(known)) if len(known) else np.nan
