"""The check of a plan from pixels: render, decode, triangulate, merge, compare."""

import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from geometry.rays import RayCaster
from geometry.sampling import SurfaceSamples, sample_surface

from ..plan import RigPlan
from .calibration import (
    CameraCalibration,
    PairCalibration,
    calibrate_camera,
    calibrate_projector,
)
from .causes import Measured, explained, rejection
from .cloud import Cloud
from .decode import Decoded, decode
from .defocus import defocus_of, through_lens
from .merge import merge
from .obstacles import Both, obstacles_of
from .patterns import Frames, ring_patterns
from .photometry import Photometry
from .render import Shown, render_pair
from .result import PairCount, Reconstruction
from .schedule import on_at_once
from .verdict import judge, measure_accuracy, measure_completeness
from .view import View, view

_DEFAULT_SAMPLES = 20_000
# Rings that run more steeply along the viewing ray cross steps between surfaces, unless
# the plan counts on surface seen at such incidence [rad].
_SLANTED = np.deg2rad(65.0)
_SLANT_MARGIN = np.deg2rad(5.0)
Progress = Callable[[int, int], None]
Pairs = list[tuple[tuple[int, int], Decoded]]
# From a projector, a camera and what it took to what is decoded; None: nothing.
Develop = Callable[[int, int, Frames], Frames | None]


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
        measured = Measured(
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


def decode_rendered(
    plan: RigPlan,
    truth: RigPlan,
    photometry: Photometry,
    *,
    seed: int,
    threads: int,
    spent: "Spent",
    progress: Progress | None = None,
    believed: RigPlan | None = None,
    develop: Develop | None = None,
) -> Pairs:
    """Render and decode every pair; the order, and every number, is always the same.

    Args:
        plan: For which the patterns are drawn.
        truth: What really stands there, devices matched by id.
        photometry: Simulated light and sensor.
        seed: Of the pixel noise.
        threads: Worker threads.
        spent: Receives the processor time.
        progress: Called with the pairs done and their total.
        believed: What the decoder knows of poses and optics; the plan by default.
        develop: Called with the indices of projector and camera and the frames of each
            pair, in any thread; returns those that are decoded.
    """
    mesh = truth.surface.mesh
    caster = RayCaster(mesh, threads=1)
    standing = {camera.id: calibrate_camera(camera) for camera in truth.cameras}
    shining = {
        projector.id: calibrate_projector(projector) for projector in truth.projectors
    }
    known = pair_calibrations(believed or plan)
    drawn = [calibrate_camera(camera) for camera in plan.cameras]
    designed = [calibrate_projector(projector) for projector in plan.projectors]
    radii = [projector.ring_radii for projector in plan.projectors]
    lenses = _lenses(truth, drawn, photometry)
    blurred = defocus_of(truth, "projector")
    limits = decoder_limits(plan)

    def look(c: int) -> View | None:
        camera = standing.get(drawn[c].id)
        with spent.on("render"):
            if camera is None:
                return None
            before = obstacles_of(truth, camera.id)
            return view(camera, mesh, caster, lenses[c], before)

    def shown(p: int, c: int) -> Shown | None:
        """Return a projector as it shows its patterns and a camera's disc."""
        projector = shining.get(designed[p].id)
        if projector is None:
            return None
        before = obstacles_of(truth, projector.id)
        past = caster if before is None else Both(caster, before)
        patterns = ring_patterns(designed[p], radii[p], drawn[c])
        return Shown(projector, designed[p], patterns, past, blurred)

    beside = on_at_once(plan, truth)

    def measure(pair: tuple[int, int]) -> Decoded:
        p, c = pair
        design, seen = designed[p], views[c]
        with spent.on("render"):
            one = shown(p, c)
            if seen is None or one is None:
                return Decoded.nothing()
            others = (shown(k, c) for k in beside[p])
            frames = render_pair(
                seen,
                one.projector,
                design,
                one.patterns,
                one.caster,
                lenses[c],
                (seed, p, c),
                blurred,
                tuple(other for other in others if other is not None),
            )
        if develop is not None:
            frames = develop(p, c, frames)
            if frames is None:
                return Decoded.nothing()
        with spent.on("decode"):
            return decode(frames, one.patterns, known[p, c], **limits)

    with ThreadPoolExecutor(threads) as pool:
        views = list(pool.map(look, range(len(drawn))))
        done = list(reported(pool.map(measure, known), len(known), progress))
    return list(zip(known, done, strict=True))


def _lenses(
    truth: RigPlan, cameras: list[CameraCalibration], photometry: Photometry
) -> list[Photometry]:
    """Return light and sensor behind each camera's lens, focused as it is."""
    defocus, middle = defocus_of(truth, "camera"), truth.surface.mesh.centre
    away = [(middle - c.centre) @ c.world_from_device[:3, 2] for c in cameras]
    return [
        through_lens(photometry, defocus, float(depth), camera.focal_px)
        for camera, depth in zip(cameras, away, strict=True)
    ]


def pair_calibrations(plan: RigPlan) -> dict[tuple[int, int], PairCalibration]:
    """Return what a plan says of every pair, camera by camera."""
    projectors = [calibrate_projector(projector) for projector in plan.projectors]
    return {
        (p, c): PairCalibration(projector, calibrate_camera(camera))
        for c, camera in enumerate(plan.cameras)
        for p, projector in enumerate(projectors)
    }


def decoder_limits(plan: RigPlan) -> dict[str, float]:
    """Return the limits that `decode` takes of a plan."""
    requirements = plan.requirements
    steepest = max(requirements.camera.max_incidence - _SLANT_MARGIN, _SLANTED)
    return {
        "min_conditioning": requirements.triangulation.min_conditioning,
        "max_slant": float(np.tan(steepest)),
    }


class Spent:
    """Processor time by stage, over all threads: what eq. (8) calls t1, t2 and t3."""

    def __init__(self, before: dict[str, float] | None = None) -> None:
        self.seconds = {"render": 0.0, "decode": 0.0, "merge": 0.0} | (before or {})
        self._lock = Lock()

    @contextmanager
    def on(self, stage: str) -> Generator[None]:
        """Count the time of this thread within the block for a stage."""
        begin = time.thread_time()
        try:
            yield
        finally:
            with self._lock:
                self.seconds[stage] += time.thread_time() - begin


def reported(
    results: Iterator[Decoded], total: int, progress: Progress | None
) -> Iterator[Decoded]:
    """Pass results on, and say how many there were."""
    for n, result in enumerate(results, start=1):
        if progress is not None:
            progress(n, total)
        yield result


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
