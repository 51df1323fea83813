"""Cameras and ring axes of a point, for projectors that moved, from kept views."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import CameraCover, candidate_cover
from planning.cameras.camera_stage import proves_as_much
from planning.cameras.proved_cameras import CameraStage, camera_stage
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.ring_records import AxisTaken
from planning.model.front import FrontPoint
from planning.proofs.selection import CandidateCover, Selection, select_fewest
from planning.report.partial_plan import PartialPlan
from planning.rings.axis_moves import move_ring_axes
from planning.rings.centred_axes import centred_axes
from planning.rings.kept_pairs import rings_for_pairs
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, measured_by, taken
from planning.scene.scene import Scene

from .best_counts import with_more
from .front_matrix import FrontMatrix

_Projectors = tuple[PlannedProjector, ...]
_Rig = tuple[_Projectors, CameraStage]


@dataclass(frozen=True, eq=False)
class PointCameras:
    """Chooses a point's number of cameras for projectors that moved.

    Their views of the samples are kept, so other light costs no ray of a candidate.

    Attributes:
        share: What the point measures of the target.
    """

    scene: Scene
    matrix: FrontMatrix
    point: FrontPoint
    share: float

    def placed(
        self, projectors: _Projectors, axes: AxisTaken | None, margin: float
    ) -> _Rig:
        """Return the projectors with their ring axes, and the cameras."""
        if axes == "centred":
            projectors = centred_axes(self.scene, projectors, margin)
        samples, measured = self._measured(projectors)
        chosen = self._chosen(measured, samples)
        if axes == "free":
            cameras = [self.matrix.cameras[i] for i in chosen]
            projectors = move_ring_axes(self.scene, projectors, cameras, samples)
            samples, measured = self._measured(projectors)
            chosen = self._chosen(measured, samples, chosen)
        return projectors, self._stage(samples, measured, chosen)

    def left(
        self, projectors: _Projectors, axes: AxisTaken | None, margin: float
    ) -> _Rig:
        """Return the point's own projectors, with the axes and cameras it has."""
        if axes != "free" or self.point.axes != "free":
            return self.placed(projectors, axes, margin)
        chosen = np.array(self.point.views, dtype=np.int64)
        return projectors, self._stage(*self._measured(projectors), chosen)

    def keep_the_point(self, rig: _Rig) -> bool:
        """Return whether as much is measured as the point says, and enough if it is."""
        found = rig[1].cover.selection
        enough = not self.point.meets or found.status != "infeasible"
        return enough and found.n_covered >= self.share * len(self.matrix.target)

    def worth(self, rig: _Rig) -> tuple[bool, int]:
        """Return what the better of two rigs has more of."""
        return self.keep_the_point(rig), rig[1].cover.selection.n_covered

    def _with_axes_for(
        self,
        projectors: _Projectors,
        cameras: Sequence[PlannedCamera],
        stage: CameraStage,
    ) -> tuple[_Projectors, CameraStage]:
        """Return the projectors with ring axes for cameras that left the candidates.

        What is proved of their number is proved again for these axes; where that is
        less, they are dropped.
        """
        moved = move_ring_axes(self.scene, projectors, cameras, stage.cover.samples)
        chosen = stage.cover.selection.chosen
        again = self._stage(*self._measured(moved), chosen)
        selection = again.cover.selection
        if proves_as_much(selection, stage.certificate, len(chosen)):
            return moved, again
        return projectors, stage

    def with_rings(
        self, partial: PartialPlan, cameras: tuple[PlannedCamera, ...]
    ) -> PartialPlan:
        """Return the plan with other cameras, and ring axes and radii for them.

        Axes have moved for those of the camera stage.
        """
        partial = replace(partial, cameras=cameras)
        projectors, stage = partial.projectors, partial.camera_stage
        if partial.axes is None:
            return partial
        if partial.axes == "free" and cameras is not stage.cameras:
            projectors, stage = self._with_axes_for(projectors, cameras, stage)
        rings = rings_for_pairs(
            self.scene.among((*projectors, *cameras)),
            projectors,
            cameras,
            partial.request.rig.rings.spacing,
            stage.cover.samples,
            margin=partial.request.ring_margin,
        )
        return replace(partial, projectors=projectors, camera_stage=stage, rings=rings)

    def _stage(
        self,
        samples: LitSamples,
        measured: NDArray[np.bool_],
        chosen: NDArray[np.int64],
    ) -> CameraStage:
        cover = candidate_cover(self.scene, measured, samples, self.matrix.cameras)
        views = CameraCover(
            self.matrix.views, samples, measured, as_taken(cover, chosen)
        )
        return camera_stage(self.scene, views)

    def _measured(
        self, projectors: Sequence[PlannedProjector]
    ) -> tuple[LitSamples, NDArray[np.bool_]]:
        """Samples of the matrix that are lit, and which candidate measures which."""
        matrix, target = self.matrix, self.matrix.target
        lit = lit_stages(self.scene, projectors, target) == LIT
        every = LitSamples.of(projectors, target, lit)
        views = matrix.views.on(target)
        measured = measured_by(self.scene, matrix.cameras, every, views)
        bright = np.flatnonzero(lit.any(axis=1))
        return taken(every, bright, lit), measured[bright]

    def _chosen(
        self,
        measured: NDArray[np.bool_],
        samples: LitSamples,
        kept: NDArray[np.int64] | None = None,
    ) -> NDArray[np.int64]:
        """Those chosen before where they measure what the point says; else the most."""
        if kept is None:
            kept = np.array(self.point.views, dtype=np.int64)
        scene, cameras = self.matrix.scene, self.matrix.cameras
        cover = candidate_cover(scene, measured, samples, cameras)
        if cover.n_covered(kept) >= self.share * len(self.matrix.target):
            return kept
        best, _ = cover.most_covering(len(kept), kept)
        best = with_more(cover, best, len(kept))
        return max((kept, best), key=cover.n_covered)


def as_taken(cover: CandidateCover, chosen: NDArray[np.int64]) -> Selection:
    """Return candidates as a selection, with what is proved of fewer and of as many."""
    fewest = select_fewest(replace(cover, max_count=None))
    _, bound = cover.most_covering(len(chosen), chosen)
    met = cover.enough(chosen)
    proved = "optimal" if fewest.lower_bound >= len(chosen) else "feasible"
    return replace(
        fewest,
        chosen=chosen,
        smallest=chosen if met else fewest.smallest,
        status=proved if met else "infeasible",
        n_covered=cover.n_covered(chosen),
        n_covered_bound=max(bound, cover.n_covered(chosen)),
    )
