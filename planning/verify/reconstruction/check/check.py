"""The check of a plan from pixels: render, decode, triangulate, merge, compare."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples, sample_surface
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Decoded
from planning.verify.reconstruction.faults.causes import (
    MeasuredClouds,
    explained,
    rejection,
)
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import (
    Pairs,
    Progress,
    Spent,
    decode_rendered,
)

from .accuracy import judge, measure_accuracy, measure_completeness
from .merge import merge
from .result import PairCount, Reconstruction

_DEFAULT_SAMPLES = 20_000


def reconstruct_plan(
    plan: RigPlan,
    *,
    seed: int,
    threads: int = 2,
    truth: RigPlan | None = None,
    samples: SurfaceSamples | None = None,
    predicted: NDArray[np.bool_] | None = None,
    photometry: Photometry | None = None,
    progress: Progress | None = None,
) -> Reconstruction:
    """Measure the object of a plan through rendered images, and judge the result.

    Args:
        plan: What the decoder believes: poses, optics, patterns; its mesh is compared.
        seed: Of the pixel noise; every frame draws from a stream of its own.
        threads: Worker threads; the result doesn't depend on them.
        truth: What really stands there, devices matched by id; the plan by default. A
            device that it lacks is off.
        samples: Points of the surface to judge completeness on; those outside the
            target are left aside. Fresh ones of the target by default.
        predicted: Which of the samples the plan claims measured, shape (n,). Without it
            completeness is reported but not judged.
        photometry: Simulated light and sensor.
        progress: Called with the pairs done and their total.

    Raises:
        ValueError: If `predicted` comes without samples, or in another number.
    """
    light = photometry or Photometry()
    spent = Spent()
    decoded = decode_rendered(
        plan,
        truth or plan,
        light,
        seed=seed,
        threads=threads,
        progress=progress,
        spent=spent,
    )
    return conclude(
        plan,
        decoded,
        seed=seed,
        threads=threads,
        samples=samples,
        predicted=predicted,
        photometry=light,
        seconds=spent.seconds,
    )


def conclude(
    plan: RigPlan,
    decoded: Pairs,
    *,
    seed: int,
    threads: int = 2,
    samples: SurfaceSamples | None = None,
    predicted: NDArray[np.bool_] | None = None,
    photometry: Photometry | None = None,
    seconds: dict[str, float] | None = None,
) -> Reconstruction:
    """Merge what the pairs of a rig measured, and judge it.

    Args:
        plan: As in `reconstruct_plan`.
        decoded: Projector, camera and what they gave, of every pair.
        seed: Of the samples, where none are given.
        threads: As in `reconstruct_plan`.
        samples: Likewise.
        predicted: Likewise.
        photometry: Of the simulation; None: the images were taken.
        seconds: Processor time spent so far by stage [s]; that of `merge` is added.
    """
    samples, predicted = _target_samples(plan, samples, predicted, seed)
    spent = Spent(seconds)
    parts = [
        replace(
            pair.cloud,
            projector=np.full(len(pair.cloud), p, dtype=np.int16),
            camera=np.full(len(pair.cloud), c, dtype=np.int16),
        )
        for (p, c), pair in decoded
    ]
    everything = Cloud.join(parts)
    gap_m, pitch_px = _ring_gap(plan, everything)
    with spent.on("merge"):
        merged = merge(everything, gap_m=gap_m, pitch_px=pitch_px)
    limits = plan.requirements.check
    mesh = plan.surface.mesh
    completeness = measure_completeness(
        everything, merged.cloud, samples, predicted, limits.tau_m
    )
    pairs = tuple(_count(plan, p, c, pair) for (p, c), pair in decoded)
    accuracy, why = None, rejection(pairs) or "no ring edge was decoded"
    failures: tuple[str, ...] = (f"no point was measured: {why}",)
    if len(merged.cloud):
        accuracy = measure_accuracy(merged.cloud, mesh, threads=threads)
        failures = judge(accuracy, completeness, limits)
    if accuracy is not None and failures:
        measured = MeasuredClouds(
            plan, decoded, pairs, everything, samples, predicted, completeness.missing
        )
        failures = explained(failures, measured)
    return Reconstruction(
        everything,
        merged,
        accuracy,
        completeness,
        pairs,
        photometry,
        failures,
        spent.seconds,
    )


def _target_samples(
    plan: RigPlan,
    samples: SurfaceSamples | None,
    predicted: NDArray[np.bool_] | None,
    seed: int,
) -> tuple[SurfaceSamples, NDArray[np.bool_] | None]:
    target = plan.surface.target_faces(plan.requirements.target)
    if samples is None:
        if predicted is not None:
            raise ValueError("predicted needs the samples that it speaks of")
        mesh = plan.surface.mesh
        return sample_surface(mesh, _DEFAULT_SAMPLES, seed=seed, within=target), None
    inside = target[samples.faces]
    if predicted is None:
        return samples.take(inside), None
    if predicted.shape != (len(samples),):
        raise ValueError(
            f"predicted has shape {predicted.shape} for {len(samples)} samples"
        )
    return samples.take(inside), predicted[inside]


def _ring_gap(plan: RigPlan, cloud: Cloud) -> tuple[float, float]:
    """Median distance of neighbouring rings, across the beam [m] and in images [px]."""
    if len(cloud) == 0:
        return plan.requirements.check.tau_m, 1.0
    gaps = np.empty(len(cloud))
    for p, projector in enumerate(plan.projectors):
        own = cloud.projector == p
        radii = projector.ring_radii
        step = np.diff(radii, prepend=radii[0] - (radii[1] - radii[0]))[cloud.ring[own]]
        if projector.light == "diverging":
            ring = calibrate_projector(projector).to_ring(cloud.points[own])
            step = step * ring[:, 2] / np.sqrt(1.0 + radii[cloud.ring[own]] ** 2)
        gaps[own] = step
    centres = np.array([camera.world_from_device[:3, 3] for camera in plan.cameras])
    focal = np.array([calibrate_camera(camera).focal_px for camera in plan.cameras])
    reach = np.linalg.norm(cloud.points - centres[cloud.camera], axis=1)
    pitch = gaps * focal[cloud.camera] / reach
    return float(np.median(gaps)), float(np.median(pitch))


def _count(plan: RigPlan, p: int, c: int, pair: Decoded) -> PairCount:
    return PairCount(
        plan.projectors[p].id,
        plan.cameras[c].id,
        pair.lit_pixels,
        pair.n_edges,
        len(pair.cloud),
        pair.rejected,
    )
