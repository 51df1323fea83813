"""The pose program of section III: each projector moves to the largest margins."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.device_poses import moved_to
from planning.model.devices.planned import PlannedProjector
from planning.proofs.losses import light_kept, still_lit
from planning.proofs.quotas import Quotas
from planning.scene.bodies.clearance import lacks_clearance
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_margins, lit_stages
from planning.scene.limits import projector_limits
from planning.scene.placed_bodies import moves_bodies
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.mount_settings import settable
from solvers.poses.pose_problem import pose_margins
from solvers.poses.pose_program import pose_slack, solve_pose

from .fewest_projectors import confirms
from .loss_confirmation import confirms_losses
from .pose_programs import part_of_the_way, pose_program
from .projector_stage import ProjectorStage
from .share_margin import lit_by_any, margin_at_share, to_keep, widest_between

_SWEEPS = 6
# Gains below this aren't worth a move [rad].
_GAIN = 1e-4
_STEPS = (1.0, 0.5, 0.25)
# Samples on which poses between the candidates are compared; all of them decide.
_SEARCHED = 2000
# Of the samples that candidates reach: so many others a pose may light.
_STRAY = 0.002
# Of all that must stay lit after a loss, to spare.
_SPARE = 0.01
# Draw of samples that no cover saw.
_CONFIRMING = 9


def widen_margins(scene: Scene, stage: ProjectorStage) -> tuple[PlannedProjector, ...]:
    """Return the projectors at the poses where what counts is lit with most margin.

    What counts are the samples that have the margin at the required share
    (`share_margin`). First poses between the candidates are offered. Then each
    projector in turn solves the pose program over those of them that are assigned to
    it. Occlusion isn't part of that program, so rays decide after every move: the whole
    way is tried, then half, then a quarter, and a move that lowers the margin at the
    share isn't taken, nor one that leaves too few samples lit, of all or of a region
    with a floor, nor one that lights what no candidate does: what is required, and was
    proved, is a share of what they cover. Fresh samples confirm the end; where they
    deny it and not the beginning, nothing is moved.
    """
    samples, reached = stage.candidates.samples, stage.candidates.reached
    survival = scene.requirements.survival
    state = _Lit(scene, samples, list(stage.projectors), reached)
    if survives := bool(survival and survival.survive):
        aims = stage.candidates.cover.aims
        state.kept_after_loss = light_kept(_spared(aims), np.isfinite(state.margin))
    # With too few devices, what they light is what counts.
    quotas = stage.candidates.cover.aims.as_far_as(lit_by_any(state.margin))
    required, kept = quotas.total, to_keep(state.margin, quotas)
    if required == 0:
        return stage.projectors
    if not moves_bodies(state.projectors):
        # What bodies stand in the way of was settled for the poses chosen.
        state = _between(state, quotas, kept, len(stage.reference))
    for _ in range(_SWEEPS):
        moved = [
            _improve(state, p, required, kept)
            for p, projector in enumerate(state.projectors)
            if not projector.existing
        ]
        if not any(moved):
            break
    # Margins fitted to few samples may be paid for by others.
    wider, chosen = tuple(state.projectors), stage.projectors
    held = confirms(stage.candidates, wider, _CONFIRMING)
    lost = not held and confirms(stage.candidates, chosen, _CONFIRMING)
    if survives and not lost:
        fresh = scene.target_samples(DRAWS.surviving_projectors.later(_CONFIRMING))
        lost = not confirms_losses(stage.candidates, wider, fresh)
    return chosen if lost else wider


def _spared(quotas: Quotas) -> Quotas:
    """Some more of all, so that fresh samples should confirm what a loss leaves."""
    return replace(quotas, total=int(np.ceil((1.0 + _SPARE) * quotas.total)))


def _between(state: "_Lit", quotas: Quotas, kept: Quotas, n_lattice: int) -> "_Lit":
    """Projectors at poses between the candidates, if what counts has more margin."""
    n, required = len(state.samples), quotas.total
    some = np.arange(0, n, -(-n // _SEARCHED))
    few = state.on(some)
    on_few = quotas.part(some).as_far_as(lit_by_any(few.margin))
    offered = widest_between(
        state.scene,
        tuple(state.projectors),
        few.margins,
        replace(on_few, total=max(1, on_few.total)),
        n_lattice,
    )
    moved = state.with_all(list(offered))
    wider = margin_at_share(moved.margin, required) > margin_at_share(
        state.margin, required
    )
    held = kept.enough(lit_by_any(moved.margin)) and moved.survives(moved.margin)
    return moved if wider and held else state


@dataclass(eq=False)
class _Lit:
    """Projectors as they stand, and the margin of what each lights.

    `kept_after_loss` must stay lit without each projector; empty: none may be lost.
    """

    scene: Scene
    samples: Target
    projectors: list[PlannedProjector]
    reached: NDArray[np.bool_]
    kept_after_loss: tuple[Quotas, ...] = ()
    margin: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        self.margin = self._margins(self.projectors)

    def on(self, chosen: NDArray[np.int64]) -> "_Lit":
        """The same projectors, on some of the samples."""
        samples, reached = self.samples.take(chosen), self.reached[chosen]
        return replace(self, samples=samples, reached=reached)

    def survives(self, margin: NDArray[np.float64]) -> bool:
        """Whether each loss leaves what it must; always where none is to be stood."""
        if not self.kept_after_loss:
            return True
        return still_lit(self.kept_after_loss, np.isfinite(margin))

    def with_all(self, projectors: list[PlannedProjector]) -> "_Lit":
        """Other projectors, on the same samples."""
        return replace(self, projectors=projectors)

    def margins(self, projectors: Sequence[PlannedProjector]) -> NDArray[np.float64]:
        """Margin of each sample and projector in [rad], -inf where unlit.

        Those that stray light nothing.
        """
        margin = self._margins(projectors)
        beyond = np.isfinite(margin[~self.reached]).sum(axis=0)
        margin[:, beyond > _STRAY * self.reached.sum()] = -np.inf
        return margin

    def _margins(self, projectors: Sequence[PlannedProjector]) -> NDArray[np.float64]:
        scene = self.scene.among(projectors)
        lit = lit_stages(scene, projectors, self.samples) == projector_limits.LIT
        return lit_margins(scene, projectors, self.samples, lit)

    def with_moved(
        self, p: int, offered: PlannedProjector
    ) -> NDArray[np.float64] | None:
        """Margins with one projector elsewhere; None if its body collides there."""
        if offered.body is None:
            margin = self.margin.copy()
            margin[:, p] = self.margins([offered])[:, 0]
            return margin
        # Its body moves along, and what others light may change.
        projectors = [*self.projectors]
        projectors[p] = offered
        if lacks_clearance(self.scene.among(projectors), offered):
            return None
        return self.margins(projectors)


def _improve(state: _Lit, p: int, required: int, kept: Quotas) -> bool:
    """Move one projector to where what it is assigned of the share has more margin."""
    level = margin_at_share(state.margin, required)
    best = state.margin.max(axis=1)
    assigned = (best >= level) & (np.argmax(state.margin, axis=1) == p)
    if not assigned.any():
        return False
    projector = state.projectors[p]
    program = pose_program(state.scene, projector, state.samples.take(assigned))
    solution = solve_pose(program)
    if not solution.moved:
        return False
    before = float(pose_margins(program, projector.world_from_device).min())
    for step in _STEPS:
        pose = part_of_the_way(
            projector.world_from_device, solution.world_from_device, step
        )
        settings = settable(state.scene.requirements.workspace, projector, pose[None])
        if not len(settings):
            continue
        pose = settings[0]
        # On a straight way between two poses the shell may be left in between.
        inside = float(pose_slack(program, pose).min()) >= 0.0
        if not (inside and float(pose_margins(program, pose).min()) > before + _GAIN):
            continue
        offered = moved_to(projector, pose)
        margin = state.with_moved(p, offered)
        if margin is None:
            continue
        wide = margin_at_share(margin, required) >= level
        if wide and kept.enough(lit_by_any(margin)) and state.survives(margin):
            state.projectors[p], state.margin = offered, margin
            return True
    return False
