"""Several members before one rig: each of them alone, all of them in every cover.

A member's samples are rows of a group of their own, with the share that is asked as its
quota. As many are drawn on each member, whatever its area: what is asked is a share of
each. Surface, region and T1 are those of all members, one after the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from planning.cache.content import content

from .draws import Draw
from .occlusion import Occlusion
from .placed_bodies import Kind
from .samples import Target
from .scene import Scene

# Samples of all members together, in draws of one; and of each at least.
_TOGETHER, _LEAST = 4, 400


@dataclass(frozen=True, eq=False)
class FamilyScene(Scene):
    """The scene of several members, which share requirements and seed.

    Attributes:
        members: The scene of each alone.
        by_member: Whether what is asked is asked of each member; else of all together.
    """

    members: tuple[Scene, ...] = ()
    by_member: bool = True

    @classmethod
    def of(cls, members: Sequence[Scene]) -> "FamilyScene":
        """Return the scene of members; dominant regions count on from one to the next.

        Obstacles and all else that isn't of a mesh are the first member's.
        """
        first, regions, base = members[0], list[NDArray[np.int64]](), 0
        for member in members:
            regions.append(np.where(member.region >= 0, member.region + base, -1))
            base += int(member.region.max(initial=-1)) + 1
        return cls(
            TriangleMesh.joined([member.mesh for member in members]),
            np.concatenate(regions),
            np.concatenate([member.steep for member in members]),
            first.requirements,
            first.seed,
            first.threads,
            first.check_cancelled,
            first.placed,
            first.obstructions,
            first.cache,
            members=tuple(members),
        )

    @cached_property
    def content(self) -> str:
        """A hash of all that answers about the family depend on."""
        sizes = [len(member.mesh.faces) for member in self.members]
        return content(super().content, sizes, self.by_member)

    @property
    def surfaces(self) -> tuple[Scene, ...]:
        """The members, each with the bodies that stand here."""
        return tuple(member.with_placed(self.placed) for member in self.members)

    @cached_property
    def occlusion(self) -> Occlusion:
        """What each member hides of itself."""
        return Occlusion(tuple(member.visibility for member in self.members))

    @property
    def has_floors(self) -> bool:
        """Whether each member has a quota of its own."""
        return self.by_member

    @property
    def without_floors(self) -> Scene:
        """The scene of which all members together have one quota."""
        return self._with(by_member=False)

    def floor_rows(
        self, samples: Target, kind: Kind
    ) -> tuple[NDArray[np.int64], int, float]:
        """Return the member of each sample from 1, how many numbers, and the share."""
        if not self.by_member:
            return np.zeros(len(samples), dtype=np.int64), 1, 0.0
        asked = self.requirements
        share = asked.dominant_coverage if kind == "projector" else asked.coverage
        return 1 + samples.member, 1 + len(self.members), share

    def more_of_regions(self, target: Target, draw: Draw) -> Target | None:
        """Return None: regions of a family have no floors."""
        return None

    def _carry(self, other: Scene) -> None:
        other.__dict__["occlusion"] = self.occlusion

    def drawn(self, draw: Draw, within: NDArray[np.bool_] | None, *part: int) -> Target:
        """Return as many samples of each member, of some of its faces (None: all)."""
        n = max(_LEAST, _TOGETHER * draw.count // len(self.members))
        some, first, drawn = draw.of(min(draw.count, n)), 0, list[Target]()
        for index, member in enumerate(self.members):
            last = first + len(member.mesh.faces)
            inside = None if within is None else within[first:last]
            own = member.drawn(some, inside, *part)
            samples = replace(own.samples, faces=own.samples.faces + first)
            drawn.append(Target(samples, own.steep, np.full(len(own), index)))
            first = last
        return _joined(drawn)


def _joined(parts: Sequence[Target]) -> Target:
    """Return samples of all members as one, each of the mean weight."""
    every = [part.samples for part in parts]
    n = sum(len(samples) for samples in every)
    return Target(
        SurfaceSamples(
            np.concatenate([samples.points for samples in every]),
            np.concatenate([samples.normals for samples in every]),
            np.concatenate([samples.faces for samples in every]),
            sum(samples.weight * len(samples) for samples in every) / n,
        ),
        np.concatenate([part.steep for part in parts]),
        np.concatenate([part.member for part in parts]),
    )
