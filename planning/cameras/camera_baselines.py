"""Maximises a plan's baselines on its scene: rays, bodies and rings decide."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.baseline_limits import BaselineLimits, RingsOnSurface
from planning.cameras.baselines.camera_moves import at_poses
from planning.cameras.baselines.seams import SampledSurface
from planning.cameras.baselines.widest_baselines import (
    BaselineSearch,
    WidestBaselines,
)
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.losses import PairDemand
from planning.proofs.quotas import Quotas, RegionFloors
from planning.scene.bodies.clearance import lacks_clearance
from planning.scene.draws import DRAWS
from planning.scene.limits.calibration_terms import surface_deviation
from planning.scene.measuring.measurability import expected_noise_px, expected_sigma_m
from planning.scene.measuring.measured import (
    LitSamples,
    lit_samples,
    measured_by,
    measuring_pairs,
)
from planning.scene.placed_bodies import moves_bodies
from planning.scene.scene import Scene

from .camera_bodies import lit_among

_Check = Callable[[NDArray[np.float64]], bool]
# What candidates cover is the measure of all claims: cameras may measure this share of
# it more, no further. Where candidates cover nearly all that is lit none can.
_BEYOND, _NEARLY = 0.002, 0.97
# Of what pairs must measure after a loss, kept to spare for fresh samples.
_MORE = 1.01
# Programs times cameras, which take that much longer: the first moves gain most.
_CAMERA_PROGRAMS = 180


@dataclass(frozen=True, eq=False)
class BaselineSamples:
    """Lit samples on which baselines are maximised.

    Attributes:
        scene: With the bodies of the projectors.
        projectors: As planned, with their rings.
        lit: The samples, lit were there no cameras.
        covered: Samples that any candidate measures, shape (n,); None: any may be.
    """

    scene: Scene
    projectors: tuple[PlannedProjector, ...]
    lit: LitSamples
    covered: NDArray[np.bool_] | None = None

    @cached_property
    def surface(self) -> SampledSurface:
        """The samples as the seams take them."""
        samples = self.lit.target.samples
        return SampledSurface(samples.points, samples.normals)

    @cached_property
    def rings(self) -> RingsOnSurface:
        """The rings of every projector on the samples."""
        limits = self.scene.requirements.triangulation
        coded = [surfaces.on_average() for surfaces in self.lit.surfaces]
        levers = np.stack([rings.levers for rings in coded])
        placed = surface_deviation(limits.limited_calibration, levers)
        away = float(np.mean(self.scene.requirements.workspace.camera_radius_m))
        return RingsOnSurface(
            np.stack([rings.normals for rings in coded]),
            np.stack([rings.spacing for rings in coded]),
            np.stack(
                [
                    expected_noise_px(limits, light, rings, away)
                    for light, rings in zip(
                        self.lit.lights, self.lit.surfaces, strict=True
                    )
                ]
            ),
            self.lit.lit,
            np.hypot(placed, self._told),
            turning=self.scene.requirements.pattern == "dense",
        )

    @property
    def _told(self) -> NDArray[np.float64]:
        """Standard deviation of the code itself along m [m], shape (n_p, n)."""
        limits = self.scene.requirements.triangulation
        return np.stack(
            [
                expected_sigma_m(limits, light, coded)
                for light, coded in zip(self.lit.lights, self.lit.surfaces, strict=True)
            ]
        )

    def count_lit(self, cameras: Sequence[PlannedCamera]) -> int:
        """Return how many samples stay lit past the bodies of cameras."""
        return int(lit_among(self.projectors, self.lit, cameras).any(axis=1).sum())

    def measured(
        self, cameras: Sequence[PlannedCamera], least_lit: int
    ) -> NDArray[np.bool_]:
        """Return which camera measures which sample, (n, k); none where that can't be.

        It can't be where bodies collide or leave too little lit, nor where more is
        measured that no candidate covers than is spoken of as nothing.
        """
        none = np.zeros((len(self.lit.target), len(cameras)), dtype=bool)
        scene, samples = self.scene, self.lit
        if moves_bodies(cameras):
            scene = scene.among((*self.projectors, *cameras))
            lit = lit_among(self.projectors, samples, cameras)
            fits = not any(lacks_clearance(scene, camera) for camera in cameras)
            if not fits or lit.any(axis=1).sum() < least_lit:
                return none
            samples = replace(samples, lit=lit)
        measured = measured_by(scene, cameras, samples)
        if self.covered is not None:
            beyond = np.count_nonzero(measured.any(axis=1) & ~self.covered)
            if beyond > _BEYOND * np.count_nonzero(self.covered):
                return none
        return measured


def baseline_samples(
    scene: Scene, projectors: Sequence[PlannedProjector]
) -> BaselineSamples:
    """Return lit samples that no cover ever saw.

    On a cover's samples, to which its cameras are fitted, a move seems to lose less
    than it does.
    """
    lit = lit_samples(scene, projectors, scene.target_samples(DRAWS.baselines))
    return BaselineSamples(scene, tuple(projectors), lit)


def held_to_candidates(
    samples: BaselineSamples,
    candidates: Sequence[PlannedCamera],
    cover: LitSamples,
    measured: NDArray[np.bool_],
) -> BaselineSamples:
    """Return the samples with which of them any candidate covers.

    `measured` says which candidate measures which sample of the cover, (n, m).
    """
    if measured[cover.lit.any(axis=1)].any(axis=1).mean() >= _NEARLY:
        return samples
    covered = measured_by(samples.scene, candidates, samples.lit).any(axis=1)
    return replace(samples, covered=np.asarray(covered))


def widen_baselines(
    samples: BaselineSamples,
    cameras: Sequence[PlannedCamera],
    *,
    max_evaluations: int = 48,
    max_programs: int | None = None,
    spare_field: float = 0.0,
    confirmed: bool = False,
) -> WidestBaselines:
    """Maximise the baselines of cameras; no move is taken that loses coverage.

    `spare_field` [rad] of the half fields is kept free beyond seams; if `confirmed`,
    more samples must agree to each move. Without `max_programs` there are the fewer
    the more cameras there are.
    """
    if max_programs is None:
        max_programs = max(_CAMERA_PROGRAMS // max(len(cameras), 1), 4)
    least_lit = samples.count_lit(cameras)
    checks = _keeping_floors(samples, cameras, least_lit)
    checks += _keeping_pairs(samples, cameras)
    checks += [_confirming(samples, cameras)] if confirmed else []
    search = BaselineSearch(
        cameras,
        lambda poses: samples.measured(at_poses(cameras, poses), least_lit),
        samples.surface,
        baseline_limits(samples.scene, spare_field),
        rings=samples.rings,
        confirm=(lambda poses: all(agrees(poses) for agrees in checks))
        if checks
        else None,
        max_evaluations=max_evaluations,
        max_programs=max_programs,
    )
    return search.run()


def _keeping_floors(
    samples: BaselineSamples, cameras: Sequence[PlannedCamera], least_lit: int
) -> list[_Check]:
    """Whether no region falls below its floor by a move, or further; empty: no floors.

    What counts is a share of what is lit, which is no less than what can be measured.
    """
    regions = RegionFloors.of(samples.scene, samples.lit.target, "camera")
    if not regions.share:
        return []

    def measured(standing: Sequence[PlannedCamera]) -> NDArray[np.bool_]:
        return np.any(samples.measured(standing, least_lit), axis=1)

    lit = np.ones(len(samples.lit.target), dtype=bool)
    floors = Quotas.of(regions, lit, 0.0, spare=1.0).as_far_as(measured(cameras))
    return [lambda poses: floors.enough(measured(at_poses(cameras, poses)))]


def _keeping_pairs(
    samples: BaselineSamples, cameras: Sequence[PlannedCamera]
) -> list[_Check]:
    """Whether what pairs must measure, after every loss, stays; empty: one suffices.

    What counts is a share of what is lit in each case, as far as it is measured now.
    """
    asked = samples.scene.requirements.survival
    if asked is None:
        return []
    scene, lit, share = samples.scene, samples.lit, samples.scene.requirements.coverage
    regions = RegionFloors.of(scene, lit.target, "camera")
    left = [
        np.any(np.delete(lit.lit, p, axis=1), axis=1) for p in range(lit.lit.shape[1])
    ]
    reached = np.stack([lit.lit.any(axis=1), *(left if asked.survive else [])], axis=1)
    demand = PairDemand.of(asked, regions, reached, share * _MORE, spare=1.0)
    kept = demand.kept(measuring_pairs(scene, cameras, lit))
    return [
        lambda poses: demand.upheld(
            kept, measuring_pairs(scene, at_poses(cameras, poses), lit)
        )
    ]


def _confirming(samples: BaselineSamples, cameras: Sequence[PlannedCamera]) -> _Check:
    """Whether further samples, drawn when first needed, lose nothing by a move."""
    scene, projectors = samples.scene, samples.projectors

    @cache
    def drawn() -> tuple[BaselineSamples, int, int]:
        target = scene.target_samples(DRAWS.confirming_baselines)
        more = BaselineSamples(
            scene, projectors, lit_samples(scene, projectors, target)
        )
        least_lit = more.count_lit(cameras)
        return more, least_lit, _count(more.measured(cameras, least_lit))

    def confirm(poses: NDArray[np.float64]) -> bool:
        more, least_lit, before = drawn()
        return _count(more.measured(at_poses(cameras, poses), least_lit)) >= before

    return confirm


def _count(measured: NDArray[np.bool_]) -> int:
    return int(measured.any(axis=1).sum())


def baseline_limits(scene: Scene, spare_field: float = 0.0) -> BaselineLimits:
    """Return what binds a camera; `spare_field` as for `widen_baselines`."""
    required = scene.requirements
    low, _ = required.triangulation.angles
    return BaselineLimits(
        required.camera.max_incidence,
        max(required.triangulation.min_conditioning, np.sin(low)),
        scene.safe_workspace,
        required.triangulation.min_ring_pitch_px,
        required.triangulation.max_sigma_m,
        spare_field,
        required.triangulation.limited_calibration,
    )
