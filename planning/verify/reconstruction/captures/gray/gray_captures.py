"""Gray-code images and the calibration that comes with them, to a cloud.

Nothing is planned, so that nothing is judged: no mesh is known, and points are in the
camera's frame.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planning.model.errors import CapturesError
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.check.merge import Merged
from planning.verify.reconstruction.check.tiles import Tiles, plane_normals
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Decoded
from planning.verify.reconstruction.decode.dense.coded_pixels import (
    CodedPixels,
    read_codes,
)
from planning.verify.reconstruction.decode.dense.dense_decode import measure_codes
from planning.verify.reconstruction.decode.dense.dense_inspection import inspect_dense
from planning.verify.reconstruction.decode.dense.dense_limits import DenseLimits
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern

from .gray_folder import read_gray

# Points of a Gray code alone are off by parts of a stripe, so that a plane takes many.
_TILE_PX = 12.0
_WORTH_A_WORD = 0.01


@dataclass(frozen=True, eq=False)
class GrayCapture:
    """What one camera's Gray-code images tell.

    Attributes:
        read: Codes of its pixels, in pixels of the projector.
        notes: What was left out or made good.
    """

    read: CodedPixels
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class GrayCloud:
    """Points of one pair, in the camera's frame.

    Attributes:
        merged: They, with normals and standard deviations.
        decoded: What was decoded, and why not.
        notes: What was left out or made good.
    """

    merged: Merged
    decoded: Decoded
    notes: tuple[str, ...]


def read_capture(
    folder: Path, pattern: DensePattern, *, code_step: int = 1
) -> GrayCapture:
    """Read and decode the images of a folder.

    Args:
        folder: The images.
        pattern: What was coded: the projector's pixels, or every `code_step`-th.
        code_step: Pixels of the projector that a pixel of the code was shown on. Its
            column c counts as pixel ``code_step c``, as the programs that calibrate
            with such codes have it.

    Raises:
        CapturesError: If the images can't be read, or contradict each other.
    """
    images = read_gray(folder, pattern)
    frames, notes = inspect_dense(images.stack, pattern, images.names)
    read = read_codes(frames, pattern)
    notes = (*images.notes, *notes, *_coarse(read))
    if not len(read.map.told):
        raise CapturesError(
            f"{folder}: no pixel tells a code: {len(read.lit)} pixels are lit and show "
            f"several codes at once; focus both devices"
        )
    codes, sigma, moved = (
        np.float32(code_step) * values
        for values in (read.map.codes, read.map.sigma, read.map.moved)
    )
    scaled = replace(read.map, codes=codes, sigma=sigma, moved=moved)
    return GrayCapture(replace(read, map=scaled), notes)


def _coarse(read: CodedPixels) -> tuple[str, ...]:
    """Say what stripes the camera doesn't resolve."""
    return tuple(
        f"the finest {one.dropped} of the bits of {what} are not resolved by the "
        f"camera and not used: stripes are {one.width_px} px wide"
        for what, one in zip(("columns", "rows"), read.stripes, strict=True)
        if one.dropped
    )


def reconstruct_gray(
    capture: GrayCapture, pair: PairCalibration, limits: DenseLimits
) -> GrayCloud:
    """Return the points of a capture.

    Args:
        capture: As read.
        pair: Its devices, the camera at the origin.
        limits: Of the points.
    """
    decoded = measure_codes(capture.read, pair, limits)
    cloud, notes = decoded.cloud, list(capture.notes)
    n_off = decoded.rejected["residual"]
    if n_off > _WORTH_A_WORD * max(decoded.n_edges, 1):
        notes.append(
            f"{n_off / decoded.n_edges:.1%} of the lit pixels are left out: the rays "
            f"of both devices pass each other (median {decoded.residual_px:.2f} px of "
            f"the projector); if it is most of them, the calibration is of another "
            f"rig, or its projector's pixels are of another size than the code's "
            f"(--code-step)"
        )
    return GrayCloud(_alone(cloud), decoded, tuple(notes))


def _alone(cloud: Cloud) -> Merged:
    """Return points of one pair as merged ones: all stay."""
    n = len(cloud)
    normals = np.full((n, 3), np.nan)
    if n:
        tiles = Tiles.of(cloud.pixels, _TILE_PX)
        normals = plane_normals(cloud.points, cloud.rays, tiles)[0]
    none, every = np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
    sigma = cloud.sigma(normals)
    return Merged(cloud, every, none, none, normals, sigma, np.zeros(n))
