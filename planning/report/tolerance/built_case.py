"""A plan's claims, recomputed for devices that stand elsewhere."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.parallel import n_threads
from planning.model.devices.calibration_errors import (
    AS_PLANNED,
    PERFECT,
    CalibrationErrors,
    Mounting,
)
from planning.model.plan import RigPlan
from planning.report.claims.judged import Judged
from planning.report.written_plan import written_devices, written_scene
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import camera_views
from planning.scene.measuring.measurability import pair_quality
from planning.scene.measuring.measured import LitSamples, Pair, pairs_of
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene

from .asked import Figures, as_asked
from .drawn_rigs import Deviates, Rig, bounds_of, deviations_of
from .retriangulation import retriangulated

_Array = NDArray[np.float64]
_Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a rig does of n samples.

    Attributes:
        lit: Which any projector lights, shape (n,).
        measured: Which any pair measures, shape (n,).
        best: Index of the projector and of the camera of the pair with the least
            deviation, -1 where none measures, shape (2, n).
        sigma: That deviation, of noise and of what a calibration leaves [m], inf where
            none measures, shape (n,).
        edges: Noise of that pair's edges [px], and how far its rings and their edges
            lie off along m, rms [m], shape (2, n).
    """

    lit: _Mask
    measured: _Mask
    best: NDArray[np.int64]
    sigma: _Array
    edges: _Array


@dataclass(frozen=True, eq=False)
class BuiltCase:
    """A plan with the samples that it is judged on, and what they are as planned.

    Attributes:
        scene: Surface and limits; the plan's own [calibration] is in its limits.
        rig: Devices as planned.
        target: Samples of the target, then those that large regions lack.
        n_target: How many of them are the target's.
        by_projectors: Which the plan's reference poses reach, shape (n,).
        by_cameras: Likewise, of what the plan lights.
        calibration: What remains unknown of each device in a drawn rig.
    """

    scene: Scene
    rig: Rig
    target: Target
    n_target: int
    by_projectors: _Mask
    by_cameras: _Mask
    calibration: CalibrationErrors

    @classmethod
    def of(
        cls,
        plan: RigPlan,
        calibration: CalibrationErrors | None = None,
        *,
        threads: int | None = None,
        later: int = 0,
    ) -> "BuiltCase":
        """Look at the samples that the plan's claims are about.

        Args:
            plan: The plan.
            calibration: What remains unknown; None: what the plan states.
            threads: Worker threads; no result depends on them. None: all cores.
            later: Of streams of samples further on: others than the claims'.
        """
        threads = threads or n_threads()
        scene = scene_of(plan, threads=threads)
        draw = DRAWS.claims.later(later)
        target = scene.target_samples(draw.of(plan.coverage.samples))
        n_target = len(target)
        if (more := scene.more_of_regions(target, DRAWS.region_claims)) is not None:
            target = merged(target, more)
        devices = written_devices(plan)
        judged = Judged.of(scene, devices, target)
        rig = Rig(devices.projectors, devices.cameras)
        if calibration is None:
            calibration = plan.requirements.triangulation.calibration or PERFECT
        return cls(
            scene,
            rig,
            target,
            n_target,
            judged.by_projectors,
            judged.by_cameras,
            calibration,
        )

    def shared(self) -> "BuiltCase":
        """Return the case for threads that each look at a rig of their own."""
        return replace(self, scene=replace(self.scene, threads=1))

    def calibrated(self, scale: float) -> "BuiltCase":
        """Return the case with errors of the calibration so many times as large."""
        return replace(self, calibration=self.calibration.times(scale))

    @cached_property
    def planned(self) -> Outcome:
        """What the plan itself does."""
        return self.outcome(self.rig)

    def outcome(self, rig: Rig) -> Outcome:
        """Return what devices do that stand where this rig has them."""
        scene, n = self.scene.among(rig.devices), len(self.target)
        stages = lit_stages(scene, rig.projectors, self.target) == LIT
        lit = stages.any(axis=1)
        bright = np.flatnonzero(lit)
        samples = LitSamples.of(
            rig.projectors, self.target.take(bright), stages[bright]
        )
        best, sigma = np.full((2, n), -1), np.full(n, np.inf)
        noise = np.zeros((2, n))
        views = camera_views(scene, rig.cameras, samples.target)
        for c, seen in enumerate(views):
            for pair in pairs_of(
                scene.requirements.triangulation,
                samples,
                seen.view,
                samples=seen.samples,
            ):
                total = np.where(pair.measured, self._total(samples, pair), np.inf)
                rows = bright[pair.samples]
                better = total < sigma[rows]
                rows = rows[better]
                sigma[rows], best[:, rows] = total[better], [[pair.projector], [c]]
                found = pair.quality.edge_px, pair.quality.drawn_m
                noise[:, rows] = np.stack(found)[:, better]
        return Outcome(lit, best[0] >= 0, best, sigma, noise)

    def errors(
        self, outcome: Outcome, rig: Rig, unknown: _Array, edges: _Array
    ) -> _Array:
        """Return the errors along the normals of what a rig measures [m], (n,).

        Of the best pair of each sample; NaN where none measures it, or where the
        viewing ray passes its ring by. Unknown are (n_devices, 9) numbers of
        `drawn_rigs`; edges are normal deviates, (n, 3).
        """
        samples, first = self.target.samples, len(rig.projectors)
        errors = np.full(len(self.target), np.nan)
        noise_px, drawn_m = outcome.edges
        for p, c in np.unique(outcome.best[:, outcome.measured], axis=1).T.tolist():
            rows = np.flatnonzero((outcome.best[0] == p) & (outcome.best[1] == c))
            points = samples.points[rows]
            there = retriangulated(
                points,
                rig.projectors[p],
                rig.cameras[c],
                (unknown[p], unknown[first + c]),
                edge_px=noise_px[rows, None] * edges[rows, :2],
                ring_m=drawn_m[rows] * edges[rows, 2],
            )
            moved = (there - points) * samples.normals[rows]
            errors[rows] = moved.sum(axis=1)
        return errors

    def figures(self, outcome: Outcome, errors: _Array) -> Figures:
        """Return what of the target is reached, and how exactly."""
        own = slice(0, self.n_target)
        found = np.abs(errors[own][np.isfinite(errors[own])])
        expected = self.planned.measured[own]
        within = np.abs(errors[own]) <= self.scene.requirements.check.tau_m
        n_measured = int(outcome.measured[own].sum())
        return Figures(
            lit=_share(outcome.lit[own], self.by_projectors[own]),
            coverage=_share(outcome.measured[own], self.by_cameras[own]),
            worst_region=self._worst_region(outcome),
            completeness=_share(within & expected, expected),
            rms_m=float(np.sqrt(np.mean(found**2))) if len(found) else None,
            p95_m=float(np.quantile(found, 0.95)) if len(found) else None,
            lost=1.0 - len(found) / n_measured if n_measured else 0.0,
        )

    def drawn(self, mounting: Mounting, deviates: Deviates) -> Figures:
        """Return what a drawn rig reaches."""
        rig, outcome = self.rig, self.planned
        if mounting != AS_PLANNED:
            rig = rig.moved(deviates.mounted * bounds_of(mounting))
            outcome = self.outcome(rig)
        unknown = deviates.unknown * deviations_of(self.calibration)
        errors = self.errors(outcome, rig, unknown, deviates.edges)
        return self.figures(outcome, errors)

    def predicted_rms_m(self) -> float | None:
        """Return the root of the mean square of the plan's deviations [m]."""
        sigma = self.planned.sigma[: self.n_target]
        sigma = sigma[np.isfinite(sigma)]
        return float(np.sqrt(np.mean(sigma**2))) if len(sigma) else None

    def _worst_region(self, outcome: Outcome) -> float:
        region, shares = self.scene.region[self.target.samples.faces], [1.0]
        for index in self.scene.large_regions.tolist():
            inside = region == index
            shares += [
                _share(done[inside], able[inside])
                for done, able in (
                    (outcome.lit, self.by_projectors),
                    (outcome.measured, self.by_cameras),
                )
            ]
        return min(shares)

    def _total(self, samples: LitSamples, pair: Pair) -> _Array:
        """The deviation of a pair with the calibration of the drawn rig."""
        limits = self.scene.requirements.triangulation
        if self.calibration == (limits.calibration or PERFECT):
            return pair.quality.total
        return pair_quality(
            samples.target.samples.normals[pair.samples],
            pair.quality.light,
            samples.surfaces[pair.projector].take(pair.samples),
            pair.quality.view,
            replace(limits, calibration=self.calibration),
        ).total


def scene_of(plan: RigPlan, *, threads: int) -> Scene:
    """Return what a plan's claims were computed on, as it was asked for."""
    scene = written_scene(plan, threads=threads)
    return scene.asking(as_asked(plan.requirements))


def _share(part: _Mask, whole: _Mask) -> float:
    count = int(whole.sum())
    return int(part.sum()) / count if count else 1.0
