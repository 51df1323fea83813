"""The fewest cameras for projectors: K-fold, and whatever one device is lost."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import CameraCover, n_fixed
from planning.cameras.proved_cameras import CameraStage
from planning.model.devices.calibration_errors import Survival
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.candidate_certificate import counted
from planning.proofs.device_stock import DeviceStock
from planning.proofs.losses import PairDemand
from planning.proofs.quotas import RegionFloors
from planning.proofs.surviving_counts import SurvivingCount, larger_selections
from planning.scene.draws import DRAWS
from planning.scene.measuring.measured import lit_samples, measuring_pairs, pair_counts
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from solvers.surviving.fewest_surviving import (
    SurvivingSolution,
    least_surviving,
    solve_surviving,
)
from solvers.surviving.surviving_cover import SurvivingCover

_Mask = NDArray[np.bool_]
_Index = NDArray[np.int64]

_ROUNDS = 4
# Cameras beyond the bound that are tried.
_MORE = 16
# Standard errors above floors at which selections aim, and at which fresh ones agree.
_AIMED = 1.0
# Counted work of each bound.
_BUDGET = 1e8


def surviving_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    stage: CameraStage,
    asked: Survival,
    without: int,
) -> tuple[CameraStage, SurvivingCount]:
    """Return the stage with the fewest cameras found that survival asks for.

    A camera counts for a sample as often as it measures it with different projectors.
    With a projector lost, the others and what they light are a case of its own; a
    camera may be lost as any set of the cover. `without` survival so many do.
    """
    offered, allowed = stage.cover.candidates, scene.requirements.max_cameras
    target = scene.target_samples(DRAWS.cameras)
    pairs = _PairsOfAll.on(scene, projectors, stage, target)
    place = {id(camera): c for c, camera in enumerate(offered.cameras)}
    start = np.array(sorted(place[id(one)] for one in stage.cameras), dtype=np.int64)
    plain = stage.certificate.needed.lower_bound + asked.survive
    bound = max(plain, least_surviving(pairs.cover(), budget=_BUDGET))
    pairs, enough, found = _confirmed(scene, projectors, stage, pairs, start, bound)
    cameras = tuple(offered.cameras[c] for c in found.selected)
    more = larger_selections(pairs.cover(), found.selected, allowed)
    count = SurvivingCount(
        needed=max(len(enough.selected), len(cameras)),
        without=without,
        lower_bound=min(bound, len(enough.selected)),
        everywhere=_everywhere(stage, cameras, asked),
        more={n: tuple(offered.cameras[c] for c in some) for n, some in more.items()},
        met=found.status != "infeasible",
    )
    weight = stage.cover.samples.target.samples.weight
    reached = float(stage.cover.measured.any(axis=1).sum()) * weight
    taken = _with_cameras(stage, cameras, found.selected)
    return counted(taken, cameras, reached), count


def _confirmed(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    stage: CameraStage,
    pairs: "_PairsOfAll",
    start: _Index,
    bound: int,
) -> tuple["_PairsOfAll", SurvivingSolution, SurvivingSolution]:
    """Return what is enough, and what is allowed of it, when fresh samples agree.

    Where they don't they join the samples, a few times.
    """
    allowed, attempt = scene.requirements.max_cameras, 0
    while True:
        attempt += 1
        cover = pairs.cover()
        enough = found = _solved(scene, cover, start, bound, bound + _MORE)
        start = enough.selected
        if allowed is not None and len(start) > allowed:
            found = _solved(scene, cover, start, allowed, allowed)
        if found.status == "infeasible" or attempt == _ROUNDS:
            return pairs, enough, found
        draw = DRAWS.surviving_cameras.later(attempt)
        fresh = _PairsOfAll.on(scene, projectors, stage, scene.target_samples(draw))
        if fresh.demand(0.0).met(fresh.pairs[:, start]):
            return pairs, enough, found
        pairs = pairs.with_samples(fresh)


def _solved(
    scene: Scene, cover: SurvivingCover, start: _Index, least: int, most: int
) -> SurvivingSolution:
    return solve_surviving(
        cover, lower_bound=least, most=most, start=start, seed=scene.seed
    )


def _everywhere(
    stage: CameraStage, cameras: tuple[PlannedCamera, ...], asked: Survival
) -> int | None:
    """What is proved over all poses: of covers, and of one more where one may go."""
    bound = stage.certificate.continuous
    if bound is None:
        return None
    alone = all(camera.existing for camera in cameras)
    return len(cameras) if alone else bound.lower_bound + asked.survive


def _with_cameras(
    stage: CameraStage, cameras: tuple[PlannedCamera, ...], chosen: _Index
) -> CameraStage:
    """The stage whose cover has other cameras; nothing is proved of these.

    Best covers of other numbers measure once, and may measure more.
    """
    cover: CameraCover = stage.cover
    covered = int(cover.measured[:, chosen].any(axis=1).sum())
    selection = replace(cover.selection, chosen=chosen, n_covered=covered)
    cover = replace(cover, selection=selection, by_count=None)
    return replace(
        stage, by_count={}, cameras=cameras, cover=cover, routes=None, rival=()
    )


@dataclass(frozen=True, eq=False)
class _PairsOfAll:
    """Which candidate measures which lit sample with which projector, (n, m, n_p)."""

    scene: Scene
    cameras: Sequence[PlannedCamera]
    target: Target
    regions: RegionFloors
    pairs: _Mask

    @classmethod
    def on(
        cls,
        scene: Scene,
        projectors: Sequence[PlannedProjector],
        stage: CameraStage,
        target: Target,
    ) -> "_PairsOfAll":
        samples = lit_samples(scene, projectors, target)
        offered = stage.cover.candidates
        views = offered.on(samples.target)
        pairs = measuring_pairs(scene, offered.cameras, samples, views)
        regions = RegionFloors.of(scene, samples.target, "camera")
        return cls(scene, offered.cameras, samples.target, regions, pairs)

    @property
    def _asked(self) -> Survival:
        return self.scene.requirements.survival or Survival()

    def with_samples(self, other: "_PairsOfAll") -> "_PairsOfAll":
        """Return the pairs on the samples of both."""
        target = merged(self.target, other.target)
        return replace(
            self,
            target=target,
            regions=RegionFloors.of(self.scene, target, "camera"),
            pairs=np.concatenate([self.pairs, other.pairs]),
        )

    def cases(self) -> list[NDArray[np.uint8]]:
        """Return how often each camera measures each sample in each case, (n, m)."""
        n_projectors = self.pairs.shape[2] if self._asked.survive else 0
        return [
            pair_counts(self.pairs),
            *(pair_counts(self.pairs, p) for p in range(n_projectors)),
        ]

    def demand(self, spare: float) -> PairDemand:
        """Return what is asked of these samples, by what the candidates reach."""
        views, share = self._asked.views, self.scene.requirements.coverage
        reached = np.stack(
            [case.sum(axis=1, dtype=np.int64) >= views for case in self.cases()], axis=1
        )
        return PairDemand.of(self._asked, self.regions, reached, share, spare=spare)

    def cover(self) -> SurvivingCover:
        """State the cover."""
        demand, required = self.demand(_AIMED), self.scene.requirements
        stock = DeviceStock.of(self.cameras, required.stock_of("camera"))
        return SurvivingCover.of(
            self.cases(),
            [quotas.total for quotas in demand.quotas],
            need=self._asked.views,
            losable=bool(self._asked.survive),
            row_sets=self.regions.row,
            floors=np.stack([quotas.floors for quotas in demand.quotas]),
            n_fixed=n_fixed(self.scene),
            kinds=None if stock is None else stock.kinds,
            stock=None if stock is None else stock.counts,
        )
