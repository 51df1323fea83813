"""Every pair of a rig, rendered as it really stands and decoded as it is believed."""

import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock

import numpy as np

from geometry.rays.rays import RayCaster
from planning.model.plan import RigPlan
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    PairCalibration,
    calibrate_camera,
    calibrate_projector,
)
from planning.verify.reconstruction.decode.decode import Decoded, decode
from planning.verify.reconstruction.patterns.ring_patterns import Frames, ring_patterns

from .defocus import defocus_of, through_lens
from .occluders import Both, obstacles_of
from .photometry import Photometry
from .render import Shown, render_pair
from .render_schedule import on_at_once
from .view import RenderedView, view

# Rings that run more steeply along the viewing ray cross steps between surfaces, unless
# the plan counts on surface seen at such incidence [rad].
_SLANTED = np.deg2rad(65.0)
_SLANT_MARGIN = np.deg2rad(5.0)
Progress = Callable[[int, int], None]
Pairs = list[tuple[tuple[int, int], Decoded]]
# From a projector, a camera and what it took to what is decoded; None: nothing.
Develop = Callable[[int, int, Frames], Frames | None]


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

    def look(c: int) -> RenderedView | None:
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
