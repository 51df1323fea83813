"""Heads moved by the pose program to where what they measure lies widest in limits.

Each in turn is the projector of section III's program: a source at the origin of its
frame whose field is the measuring volume, over the samples that it measures more
squarely than the others do. Of those as many count as are required, as of projectors
(`share_margin`); the rest is to spare. Between its devices and the surface rays decide:
a move is taken the whole way, half or a quarter of it, if then what is asked is lit and
measured with some to spare, or no less than before, what counts as squarely at least,
and no housing is in another's way. Fresh samples confirm the end; where they don't,
nothing is moved.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.arrays import Array, Ints, Mask
from planning.projectors.pose_programs import part_of_the_way, view_program
from planning.projectors.share_margin import margin_at_share
from solvers.poses.pose_problem import PoseProgram, pose_margins
from solvers.poses.pose_program import pose_slack, solve_pose

from .head_cover import HeadCover, HeadSets
from .head_poses import HeadSource, PlacedHead

_SWEEPS = 3
# Gains below this aren't worth a move [rad].
_GAIN = 1e-3
_STEPS = (1.0, 0.5, 0.25)
# Served beyond what is asked, so that fresh samples don't fall short.
_SPARE = 0.01


def wider_heads(
    source: HeadSource,
    cover: HeadCover,
    fresh: HeadCover,
    heads: Sequence[PlacedHead],
) -> tuple[PlacedHead, ...]:
    """Return heads at poses of larger margin, as many, that serve no less.

    Args:
        source: Gives heads at poses.
        cover: What is asked, and of which samples.
        fresh: The same of others.
        heads: Where they begin.
    """
    state = _Heads(source, cover, list(heads))
    for _ in range(_SWEEPS):
        if not any([state.improve(k) for k in range(len(heads))]):
            break
    short = [
        replace(fresh, sets=HeadSets.of(source.scene, some, fresh.sets.target)).lacking(
            np.arange(len(some))
        )
        for some in (heads, state.heads)
    ]
    return tuple(state.heads if short[1] <= short[0] else heads)


class _Heads:
    """Heads as they stand, and what each does of the cover's samples."""

    def __init__(
        self, source: HeadSource, cover: HeadCover, heads: list[PlacedHead]
    ) -> None:
        self.source, self.cover, self.heads = source, cover, heads
        self.sets = HeadSets.of(source.scene, heads, cover.sets.target)

    def improve(self, k: int) -> bool:
        """Move one head to where the least margin of what is its is larger."""
        self.source.scene.check_cancelled()
        start = self.heads[k].world_from_head
        program = self._program(k)
        if program is None:
            return False
        end = solve_pose(program).world_from_device
        before = float(pose_margins(program, start).min())
        for step in _STEPS:
            pose = part_of_the_way(start, end, step)
            inside = float(pose_slack(program, pose).min()) >= 0.0
            wider = float(pose_margins(program, pose).min()) > before + _GAIN
            if inside and wider and self._moved(k, pose):
                return True
        return False

    def _moved(self, k: int, pose: Array) -> bool:
        """Take a pose if it serves as much; whether it was."""
        offered = replace(self.source.at(pose), quarters=self.heads[k].quarters)
        if not self.source.may_stand(offered):
            return False
        heads = [*self.heads]
        heads[k] = offered
        if self.source.colliding(heads) is not None:
            return False
        one = HeadSets.of(self.source.scene, [offered], self.sets.target)
        sets = self.sets.with_at(k, one)
        before, after = self._served(self.sets), self._served(sets)
        spared = np.ceil((1.0 + _SPARE) * self.cover.floors_with(after))
        least = np.minimum(self.cover.counts(before), spared)
        if np.any(self.cover.counts(after) < least):
            return False
        level = self._level(self._facing(self.heads, self.sets))
        if self._level(self._facing(heads, sets)) < level:
            return False
        self.heads, self.sets = heads, sets
        return True

    def _served(self, sets: HeadSets) -> Mask:
        """Which rows heads serve, shape (m,)."""
        return np.any(replace(self.cover, sets=sets).covers, axis=1)

    def _facing(self, heads: Sequence[PlacedHead], sets: HeadSets) -> Array:
        """How squarely each head measures each sample: the cosine, or -inf, (n, k)."""
        samples = sets.target.samples
        places = np.stack([head.world_from_head[:3, 3] for head in heads])
        ways = places[None] - samples.points[:, None]
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        facing = np.einsum("ni,nki->nk", samples.normals, ways)
        return np.where(sets.measured, facing, -np.inf)

    def _level(self, facing: Array) -> float:
        """How squarely at least as many samples as are required are measured."""
        due = self.cover.floors_with(self._served(self.sets))
        return margin_at_share(facing, int(due[self.cover.totals[1]]))

    def _program(self, k: int) -> PoseProgram | None:
        """The pose program of one head; None: nothing is its."""
        facing = self._facing(self.heads, self.sets)
        counts = facing[:, k] >= max(self._level(facing), -1.0)
        own = np.flatnonzero(counts & (np.argmax(facing, axis=1) == k))
        if not len(own):
            return None
        program = self._of(k, own)
        # The maker's volume is another than what the devices see.
        inside = np.flatnonzero(
            pose_slack(program, program.world_from_device)[:-1] >= 0.0
        )
        if not len(inside):
            return None
        return self._of(k, own[inside])

    def _of(self, k: int, assigned: Ints) -> PoseProgram:
        source = self.source
        return view_program(
            source.scene,
            source.workspace,
            source.view.device,
            self.heads[k].world_from_head,
            self.sets.target.take(assigned),
        )
