"""Every pair of a rig, rendered as it really stands and decoded as it is believed."""

import time
from collections.abc import Callable, Generator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from threading import Lock

from geometry.parallel import abandonable
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.decode.decode import (
    Decoded,
    PairIndex,
    Pairs,
    decode,
)
from planning.verify.reconstruction.decode.dense.dense_decode import decode_dense
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera
from planning.verify.reconstruction.scanner import ScanLimits, Scanner

from .dense_render import render_dense
from .lamp import Lamp
from .occluders import obstacles_of
from .photometry import Photometry
from .render import render_pair
from .rendered_light import Shown
from .view import RenderedView, view

# Called with the pairs done and their total; with 0 before the first of them.
Progress = Callable[[int, int], None]
# From a projector, a camera and what it took to what is decoded; None: nothing.
Develop = Callable[[int, int, Frames], Frames | None]


class RenderedScene:
    """What really stands there while the patterns of a plan are shown.

    Devices are matched by id; `lenses` are light and sensor behind each camera's lens.
    """

    def __init__(self, plan: Scanner, truth: Scanner, photometry: Photometry) -> None:
        self._plan, self._truth = plan, truth
        self._caster = RayCaster(truth.mesh, threads=1)
        self._cameras = {camera.id: camera for camera in truth.cameras}
        self._projectors = {one.id: one for one in truth.projectors}
        middle = truth.mesh.centre
        self.lenses = [
            photometry.through_lens(
                self._cameras.get(camera.id, camera).focus,
                float((middle - camera.centre) @ camera.axis),
                camera.focal_px,
            )
            for camera in plan.cameras
        ]

    def seen(self, c: int) -> RenderedView | None:
        """Return what a camera sees; None: nothing, or it isn't there."""
        camera = self._cameras.get(self._plan.cameras[c].id)
        if camera is None:
            return None
        before = obstacles_of(self._truth, camera.id)
        return view(camera, self._truth.mesh, self._caster, self.lenses[c], before)

    def shown(self, p: int, patterns: RingsForCamera) -> Shown | None:
        """Return a projector that shows its patterns; None: it isn't there."""
        design = self._plan.projectors[p]
        projector = self._projectors.get(design.id)
        if projector is None:
            return None
        before = obstacles_of(self._truth, projector.id)
        focus = self._truth.projector_focus
        light, exposed = self._plan.light, dict(self._plan.exposures)
        lamp = None if light is None else Lamp(light, exposed[design.id])
        return Shown(projector, design, patterns, self._caster, focus, before, lamp)


def decode_rendered(
    plan: Scanner,
    truth: Scanner,
    photometry: Photometry,
    *,
    seed: int,
    threads: int,
    spent: "Spent",
    progress: Progress | None = None,
    believed: Scanner | None = None,
    develop: Develop | None = None,
) -> Pairs:
    """Render and decode every pair; the order, and every number, is always the same.

    Patterns are drawn for the plan, which is also what the decoder knows of poses and
    optics, unless something else is `believed`. `develop` is called in any thread with
    the frames of each pair, and returns those that are decoded. Views of cameras are
    kept until their pairs are done, and take most of the memory.
    """
    scene = RenderedScene(plan, truth, photometry)
    known = dict((believed or plan).pairs())
    beside = _on_at_once(plan, truth)

    def look(c: int) -> RenderedView | None:
        with spent.on("render"):
            return scene.seen(c)

    def shown(p: int, c: int) -> Shown | None:
        return scene.shown(p, plan.projectors[p].pattern_for(plan.cameras[c]))

    def measure(pair: PairIndex) -> Decoded:
        p, c = pair
        with spent.on("render"):
            one, seen = shown(p, c), views[c].result()
            if seen is None or one is None:
                return Decoded.nothing()
            others = [other for k in beside[p] if (other := shown(k, c)) is not None]
            lens = scene.lenses[c]
            draw = render_pair if one.design.dense is None else render_dense
            frames = draw(seen, one, lens, (seed, p, c), others)
        if develop is not None:
            frames = develop(p, c, frames)
            if frames is None:
                return Decoded.nothing()
        with spent.on("decode"):
            return decode_pair(frames, one.patterns, known[pair], plan.limits)

    cameras = sorted({c for _, c in known})
    views: dict[int, Future[RenderedView | None]] = {}
    jobs: dict[PairIndex, Future[Decoded]] = {}
    decoded: Pairs = []
    with abandonable(threads) as pool:
        for k, c in enumerate(cameras):
            # No thread waits for the next view while another casts it.
            for ahead in cameras[len(views) : k + threads]:
                views[ahead] = pool.submit(look, ahead)
            jobs |= {pair: pool.submit(measure, pair) for pair in known if pair[1] == c}
        if progress is not None:
            wait([views[c] for c in cameras[:threads]])
            progress(0, len(known))
        for c in cameras:
            for pair in (pair for pair in known if pair[1] == c):
                decoded.append((pair, jobs.pop(pair).result()))
                if progress is not None:
                    progress(len(decoded), len(known))
            del views[c]
    return decoded


def decode_pair(
    frames: Frames,
    patterns: RingsForCamera,
    calibration: PairCalibration,
    limits: ScanLimits,
) -> Decoded:
    """Measure what a camera saw of a projector's rings, or of its coded pixels."""
    dense = calibration.projector.dense
    if dense is not None:
        return decode_dense(frames, dense, calibration, limits.dense)
    return decode(frames, patterns, calibration, **limits.decoder)


def over_pairs(
    scanner: Scanner,
    measure: Callable[[PairIndex], Decoded],
    *,
    threads: int,
    progress: Progress | None,
) -> Pairs:
    """Measure every pair, in any order and thread, and report how many are done."""
    keys = [pair for pair, _ in scanner.pairs()]
    measured: Pairs = []
    with abandonable(threads) as pool:
        for pair, decoded in zip(keys, pool.map(measure, keys), strict=True):
            measured.append((pair, decoded))
            if progress is not None:
                progress(len(measured), len(keys))
    return measured


def _on_at_once(plan: Scanner, truth: Scanner) -> list[list[int]]:
    """Return for each projector those that are on at the same time, by mistake."""
    # What the plan itself exposes together lights apart, and is rendered one by one.
    names = [projector.id for projector in plan.projectors]
    wrong = [truth.shining_with(name) - plan.shining_with(name) for name in names]
    return [[k for k, one in enumerate(names) if one in others] for others in wrong]


class Spent:
    """Processor time by stage, over all threads: what eq. (8) calls t1, t2 and t3."""

    def __init__(self) -> None:
        self.seconds = {"render": 0.0, "decode": 0.0, "merge": 0.0}
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
