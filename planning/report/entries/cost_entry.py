"""The plan's `cost`: eq. (8)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import prod

import numpy as np

from planning.model.document.device_records import CameraRecord, ProjectorRecord
from planning.model.document.input_records import FiguresRecord, RigRecord
from planning.model.document.plan_document import CostRecord
from planning.rings.acquisition import frame_time, n_frames

# What places light, with what that needs to know of the surface, is t4. All the rest of
# planning is t5. The check is neither: t1 to t3 are of a scan, not of planning.
_PROJECTOR_STAGES = ("regions", "projectors", "bounds", "projector_poses", "rings")
_CHECK = "check"


def cost_record(
    rig: RigRecord,
    projectors: Sequence[ProjectorRecord],
    cameras: Sequence[CameraRecord],
    *,
    n_before: int,
    stages: Mapping[str, float],
    scan: Mapping[str, float] | None = None,
) -> CostRecord:
    """Return the plan's `cost`; `docs/method/cost.md` defines every key.

    With M_j N_j pixels of camera j::

        C = (sum_j M_j N_j)(t1 + t2) + t3 + t4 + t5

    t1 (acquisition: frames times the time of one) and t2 (pixels to points) are seconds
    a pixel, t3 (fusion), t4 (projector planning) and t5 (camera planning) seconds.
    C_before is the same with the cameras of the greedy cover, which is what D was
    before it was minimised: each has its own pixels and root discs. C_all_rings has
    the rings that were left out. What isn't known is None, and C with it.

    Args:
        rig: Says how fast its devices are.
        projectors: As planned.
        cameras: Likewise.
        n_before: Cameras of the greedy cover.
        stages: Measured processor times of the stages of planning [s].
        scan: Where a check was made those of `render`, `decode` and `merge` [s].
    """
    pixels = sum(prod(camera.resolution) for camera in cameras)
    planned = [one.planned() for one in projectors]
    frame_s = _frame_time(rig, projectors, cameras)
    shown = n_frames(planned, len(cameras))
    t4 = sum(stages.get(name, 0.0) for name in _PROJECTOR_STAGES)
    known = CostRecord(
        pixels=pixels,
        n_cameras_before=n_before,
        n_frames=shown,
        frame_s=frame_s,
        t4=t4,
        t5=sum(stages.values()) - stages.get(_CHECK, 0.0) - t4,
        t1=None if frame_s is None else shown * frame_s / pixels,
        t2=None,
        t3=None,
        C=None,
        C_before=None,
    )
    if scan is None:
        return known
    t2, t3 = scan["decode"] / pixels, scan["merge"]
    known = known.changed(t2=t2, t3=t3, render_s=scan["render"])
    if frame_s is None:
        return known
    every = [
        replace(one, ring_radii=np.append(one.ring_radii, record.rings.left_out))
        if record.rings
        else one
        for one, record in zip(planned, projectors, strict=True)
    ]
    totals = {
        name: n_frames(shows, count) * frame_s
        + pixels * count / len(cameras) * t2
        + (t3 + known.t4 + known.t5)
        for name, shows, count in (
            ("C", planned, len(cameras)),
            ("C_before", planned, n_before),
            ("C_all_rings", every, len(cameras)),
        )
    }
    return known.changed(**totals)


def _frame_time(
    rig: RigRecord,
    projectors: Sequence[ProjectorRecord],
    cameras: Sequence[CameraRecord],
) -> float | None:
    """Of the longest exposure, planned or else stated, and of the slowest models."""
    lamps = rig.figures_of("projector", (one.model for one in projectors))
    eyes = rig.figures_of("camera", (one.model for one in cameras))
    exposures = [one.exposure.exposure_s for one in projectors if one.exposure]
    if not exposures:
        exposures = [1e-3 * each.exposure_ms for each in eyes if each.exposure_ms]
    shown = _slowest(lamps) if projectors else math.inf
    return frame_time(_slowest(eyes), shown, max(exposures, default=None))


def _slowest(figures: Sequence[FiguresRecord]) -> float | None:
    rates = [each.frame_rate_hz for each in figures]
    known = [rate for rate in rates if rate is not None]
    return min(known) if len(known) == len(rates) else None
