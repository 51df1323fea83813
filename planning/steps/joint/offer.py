"""What the joint program chooses from, and what it must light and measure.

So many candidates of each kind that do well in covers, the devices of the two stages
among them. What must be lit is a share of what all candidates reach, as ever; what must
be measured a share of what cameras reach of the light of the two stages' projectors: a
number that doesn't change with the projectors taken, so that a bound can be proved.
Where the samples say that the two stages' devices have a little less, that is enough.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_cover import measured_of
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.input_records import RigRecord
from planning.projectors.candidate_set import CandidateSet
from planning.proofs.quotas import Quotas, RegionFloors
from planning.report.partial_plan import PartialPlan
from planning.rings.centred_axes import centred_axes
from planning.scene.draws import DRAWS
from planning.scene.samples import Target
from solvers.joint.joint_problem import JointProblem, Requirement

from .tables import JointTables

_Mask = NDArray[np.bool_]
# Candidates of each kind; and projectors whose pairs say which cameras do well.
_OFFERED, _LIGHTING = 80, 12


@dataclass(frozen=True, eq=False)
class JointOffer:
    """Devices on offer, those of the two stages first, and what they must do.

    Attributes:
        tables: What they light and measure.
        n_own: How many projectors and cameras are the two stages'.
        lit: Samples that must be lit.
        measured: Samples that must be measured.
    """

    tables: JointTables
    n_own: tuple[int, int]
    lit: Quotas
    measured: Quotas

    def problem(self, rig: RigRecord) -> JointProblem:
        """State the joint program, with the costs of a rig."""
        tables, required = self.tables, self.tables.scene.requirements
        return JointProblem(
            tables.lit,
            tables.pairs,
            Requirement(self.lit.total, self.lit.floors),
            Requirement(self.measured.total, self.measured.floors),
            row_sets=self.lit.regions.row,
            projector_costs=np.array(
                [rig.cost_of("projector", one.model) for one in tables.projectors]
            ),
            camera_costs=np.array(
                [rig.cost_of("camera", one.model) for one in tables.cameras]
            ),
            most=(required.max_projectors, required.max_cameras),
        )

    @property
    def own(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The two stages' devices by their places."""
        return np.arange(self.n_own[0]), np.arange(self.n_own[1])


def joint_offer(partial: PartialPlan) -> JointOffer:
    """Return candidates around the devices of a plan, and what is asked of them."""
    scene, required = partial.scene, partial.scene.requirements
    target = scene.target_samples(DRAWS.joint)
    own = JointTables.of(scene, target, partial.projectors, partial.cameras)
    lights = CandidateSet.over(scene, target, partial.stage.candidates.projectors)
    places = several_covers(lights.lit, _OFFERED)
    projectors = with_axes(partial, lights.of(places))
    regions = RegionFloors.of(scene, target)
    reached = lights.reached | np.any(own.lit, axis=1)
    measured = np.any(own.pairs, axis=(1, 2))
    lit_quota = Quotas.of(regions, reached, required.dominant_coverage)
    able = _measurable(partial, partial.projectors, target).any(axis=1) | measured
    quota = Quotas.of(regions, able, required.coverage)
    sees = _measurable(partial, (*partial.projectors, *projectors[:_LIGHTING]), target)
    views = partial.camera_stage.cover.candidates.cameras
    cameras = tuple(views[c] for c in several_covers(sees, _OFFERED))
    return JointOffer(
        JointTables.of(
            scene,
            target,
            (*partial.projectors, *projectors),
            (*partial.cameras, *cameras),
        ),
        (len(partial.projectors), len(partial.cameras)),
        lit_quota.as_far_as(np.any(own.lit, axis=1)),
        quota.as_far_as(measured),
    )


def with_axes(
    partial: PartialPlan, projectors: Sequence[PlannedProjector]
) -> tuple[PlannedProjector, ...]:
    """Return candidates with ring axes of the kind that the plan's have.

    Centred ones are about what each lights, free ones stand as the candidates', with
    all rings: axes of both kinds in a plan would be neither.
    """
    if partial.axes != "centred" or not projectors:
        return tuple(projectors)
    return centred_axes(partial.scene, projectors, partial.request.ring_margin)


def _measurable(
    partial: PartialPlan, projectors: Sequence[PlannedProjector], target: Target
) -> _Mask:
    """Return which candidate camera measures which sample with any of them, (n, m)."""
    scene, views = partial.scene, partial.camera_stage.cover.candidates
    measured = np.zeros((len(target), len(views.cameras)), dtype=bool)
    lit = CandidateSet.over(scene, target, tuple(projectors)).reached
    _, some = measured_of(scene, projectors, views, target)
    measured[lit] = some
    return measured


def several_covers(covers: _Mask, count: int) -> NDArray[np.int64]:
    """Return candidates of one greedy cover after the other, (count,) at most.

    Each covers all that candidates cover, less those that covers before have taken.
    """
    left = np.arange(covers.shape[1])
    chosen: list[int] = []
    while len(chosen) < count and len(left):
        waiting, before = covers[:, left].any(axis=1), len(chosen)
        while len(chosen) < count and waiting.any():
            gains = covers[waiting][:, left].sum(axis=0)
            best = int(np.argmax(gains))
            if not gains[best]:
                break
            chosen.append(int(left[best]))
            waiting &= ~covers[:, left[best]]
            left = np.delete(left, best)
        if len(chosen) == before:
            break
    return np.array(chosen, dtype=np.int64)


def devices_of(
    tables: JointTables, projectors: Sequence[int], cameras: Sequence[int]
) -> tuple[tuple[PlannedProjector, ...], tuple[PlannedCamera, ...]]:
    """Return devices by their places."""
    return (
        tuple(tables.projectors[p] for p in projectors),
        tuple(tables.cameras[c] for c in cameras),
    )
