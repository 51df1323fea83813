"""What a plan of cameras alone may claim, recomputed from its poses on fresh samples.

No light is asked for: all of the target counts as lit, and as reachable by projectors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.cameras.photogrammetry.best_pairs import best_pairs
from planning.cameras.photogrammetry.measured_views import (
    MeasuredViews,
    measured_views,
    reached_by_views,
    unseen_causes,
)
from planning.model.devices.planned import PlannedCamera
from planning.model.document.coverage_records import (
    Areas,
    Coverage,
    PredictedSigma,
)
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices, by_cause
from planning.report.claims.region_claims import RegionSamples, claim_regions
from planning.scene.draws import DRAWS
from planning.scene.limits.view_pair_limits import VIEW_CAUSES
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene

_Mask = NDArray[np.bool_]
# One place more: of what is measured there is no cause.
_NAMES = np.array([*VIEW_CAUSES, ""])


@dataclass(frozen=True, eq=False)
class JudgedViews:
    """What becomes of n samples.

    Attributes:
        views: What the cameras see and measure of them.
        reached: Which are measured, or could be by reference cameras, shape (n,).
        causes: By which limit each isn't measured, "" where it is, shape (n,).
    """

    target: Target
    views: MeasuredViews
    reached: _Mask
    causes: NDArray[np.str_]

    @classmethod
    def of(cls, scene: Scene, devices: Devices, target: Target) -> "JudgedViews":
        """Judge samples."""
        views = measured_views(scene, devices.cameras, target)
        causes = unseen_causes(scene, devices.cameras, target, views)
        reached = views.measured.copy()
        others = np.flatnonzero(~reached)
        if len(others):
            more = target.take(others)
            reached[others] = reached_by_views(scene, devices.reference_cameras, more)
        return cls(target, views, reached, _NAMES[causes])

    def areas(self) -> Areas:
        """Return the areas of a plan."""
        weight, n = self.target.samples.weight, len(self.target)
        return Areas(
            area_m2=weight * n,
            reachable_by_projectors_m2=weight * n,
            lit_m2=weight * n,
            reachable_by_cameras_m2=weight * int(self.reached.sum()),
            measured_m2=weight * int(self.views.measured.sum()),
        )


def view_claims(scene: Scene, devices: Devices) -> Claims:
    """Recompute every area from poses as they will be written."""
    target = JudgedViews.of(scene, devices, scene.target_samples(DRAWS.claims))
    surface = JudgedViews.of(scene, devices, scene.surface_samples(DRAWS.claims))
    views, weight = target.views, target.target.samples.weight
    coverage = Coverage(
        samples=len(target.target),
        surface=surface.areas(),
        target=target.areas(),
        uncovered_by_cause=by_cause(target.causes, weight),
        unreachable_by_cause={},
        sigma=predicted_sigma(scene, devices.cameras, target),
    )
    regions = _region_samples(scene, devices, target)
    alone = views.measured[:, None] & ~views.others
    return Claims(
        coverage,
        (),
        (),
        tuple((weight * views.by_pair.sum(axis=0)).tolist()),
        tuple((weight * alone.sum(axis=0)).tolist()),
        claim_regions(devices, regions),
        target.target,
        views.by_pair,
        regions,
    )


def predicted_sigma(
    scene: Scene, cameras: Sequence[PlannedCamera], target: JudgedViews
) -> PredictedSigma | None:
    """Return the deviation of each measured sample's best pair; None: none is."""
    chosen = np.flatnonzero(target.views.measured)
    if not len(chosen):
        return None
    best = best_pairs(scene, cameras, target.target.take(chosen))
    noise = best.terms["matches"]
    (median, p95), (noise_median, noise_p95) = (
        np.quantile(values, (0.5, 0.95)).tolist() for values in (best.sigma, noise)
    )
    return PredictedSigma(
        median_m=median,
        p95_m=p95,
        noise_median_m=noise_median,
        noise_p95_m=noise_p95,
        terms_rms_m={
            name: float(np.sqrt(np.mean(np.square(term))))
            for name, term in best.terms.items()
        },
    )


def _region_samples(
    scene: Scene, devices: Devices, judged: JudgedViews
) -> RegionSamples:
    """Return the judged samples of the target, and what large regions lack."""
    parts = [judged]
    more = scene.more_of_regions(judged.target, DRAWS.region_claims)
    if more is not None:
        parts.append(JudgedViews.of(scene, devices, more))
    target = merged(*(part.target for part in parts)) if more else judged.target
    every = np.ones(len(target), dtype=bool)
    return RegionSamples(
        scene,
        target,
        scene.region[target.samples.faces],
        every,
        np.concatenate([part.views.measured for part in parts]),
        every,
        np.concatenate([part.reached for part in parts]),
        np.concatenate([part.causes for part in parts]),
        np.full(len(target), -1),
        np.concatenate([part.views.by_pair for part in parts]),
    )
