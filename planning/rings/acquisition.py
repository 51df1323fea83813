"""How long a rig takes to record its sequences: frames, and the time that one takes."""

import math
from collections.abc import Iterable, Sequence

from planning.model.devices.planned import PlannedCamera, PlannedProjector, code_bits

# Quotients of rates that are whole but for rounding are whole.
_ROUNDING = 1e-9


def n_frames(projectors: Iterable[PlannedProjector], n_cameras: int) -> int:
    """Return how many frames projectors show, one after the other.

    Of rings white, black, every bit of the annulus index with its inverse, and for each
    camera the root disc with its inverse; of dense codes what `DenseCode` says. Cameras
    record all at once::

        sum_p (2 + 2 ceil(log2(n_rings + 1)) + 2 n_cameras)

    Cameras alone record once.
    """
    if not (projectors := tuple(projectors)):
        return 1
    return sum(
        2 + 2 * code_bits(len(one.ring_radii)) + 2 * n_cameras
        if one.code is None
        else one.code.n_frames(one.device.resolution)
        for one in projectors
    )


def pixels_read(
    projectors: Sequence[PlannedProjector], cameras: Sequence[PlannedCamera]
) -> int:
    """Return the part of eq. (8) that a plan alone decides: pixels times frames."""
    pixels = sum(math.prod(camera.device.resolution) for camera in cameras)
    return pixels * n_frames(projectors, len(cameras))


def frame_time(
    camera_hz: float | None, projector_hz: float | None, exposure_s: float | None
) -> float | None:
    """Return how long a frame is shown [s]; None: a rate isn't known.

    A projector refreshes its image as a whole, so a camera that is triggered by it
    waits for whole refreshes::

        ceil(projector_hz max(1 / camera_hz, exposure_s)) / projector_hz

    Where there is none, of infinite rate, only the camera takes its time.
    """
    if camera_hz is None or projector_hz is None:
        return None
    if math.isinf(projector_hz):
        return max(1.0 / camera_hz, exposure_s or 0.0)
    wanted = projector_hz * max(1.0 / camera_hz, exposure_s or 0.0)
    return max(math.ceil(wanted - _ROUNDING), 1) / projector_hz
