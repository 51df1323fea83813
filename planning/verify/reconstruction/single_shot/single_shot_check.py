"""The check of a plan from single images: its mesh is the prior that labels rings."""

import time

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples
from planning.model.plan import RigPlan
from planning.verify.reconstruction.check.check import conclude
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Progress

from .single_shot_rig import shoot_rig


def reconstruct_single_shot(
    plan: RigPlan,
    samples: SurfaceSamples | None = None,
    predicted: NDArray[np.bool_] | None = None,
    *,
    tolerance_m: float,
    seed: int,
    threads: int = 2,
    photometry: Photometry | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Measure the object of a plan from one image of each pair of devices.

    Args:
        plan: Devices, patterns and the object; its mesh is the prior, too.
        samples: As in `reconstruct_plan`.
        predicted: Likewise; what sequences would measure.
        tolerance_m: How near the object is taken to lie to the mesh [m].
        seed: Of the pixel noise.
        threads: Worker threads; the result doesn't depend on them.
        photometry: Simulated light and sensor.
        progress: Called with the pairs done and their total.
    """
    light = photometry or Photometry()
    begin = time.thread_time()
    shots = shoot_rig(
        plan,
        plan.surface.mesh,
        tolerance_m=tolerance_m,
        photometry=light,
        seed=seed,
        progress=progress,
    )
    pairs = [((shot.projector, shot.camera), shot.decoded) for shot in shots]
    return conclude(
        plan,
        pairs,
        seed=seed,
        threads=threads,
        samples=samples,
        predicted=predicted,
        photometry=light,
        seconds={"render": 0.0, "decode": time.thread_time() - begin, "merge": 0.0},
    )
