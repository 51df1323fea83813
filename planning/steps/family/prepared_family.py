"""A family ready to have devices placed: each member alone, and those to serve."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from geometry.mesh.mesh import TriangleMesh
from planning.model.progress import Stopwatch
from planning.report.partial_plan import FamilyRequest, PlanRequest, Prepared
from planning.scene.family_scene import FamilyScene
from planning.steps.prepare import asked, prepared_for


@dataclass(frozen=True, eq=False)
class PreparedFamily:
    """Members of a family, and which of them are served.

    Attributes:
        request: What is asked, of all members.
        members: Each alone, under the limits of all.
        served: Indices of those that the rig must serve, ascending.
    """

    request: PlanRequest
    members: tuple[Prepared, ...]
    served: tuple[int, ...]

    @property
    def asked(self) -> FamilyRequest:
        """Names, quantile and where members stand."""
        assert self.request.family is not None
        return self.request.family

    @property
    def spare(self) -> int:
        """Members served that needn't be."""
        return len(self.served) - self.asked.n_asked

    @cached_property
    def ready(self) -> Prepared:
        """Those served as one: regions and curvature are said of each member alone."""
        some = [self.members[i] for i in self.served]
        scene = FamilyScene.of([one.scene for one in some])
        return replace(some[0], request=self.request, scene=scene)

    def first_face(self, place: int) -> int:
        """Return the first face of a served member, by its place among them."""
        earlier = [self.members[i] for i in self.served[:place]]
        return sum(len(one.scene.mesh.faces) for one in earlier)

    def without(self, places: Sequence[int]) -> "PreparedFamily":
        """Return the family that needn't serve some, by their places among those."""
        kept = (i for place, i in enumerate(self.served) if place not in places)
        return replace(self, served=tuple(kept))


def prepared_family(request: PlanRequest, clock: Stopwatch) -> PreparedFamily:
    """Find every member's regions; limits, rings and workspace are those of all.

    Raises:
        InputError: If a member has no dominant region and these are the target.
        RigError: If an obstacle's file can't be read.
        InfeasibleLimitsError: If limits exclude each other.
    """
    assert request.family is not None
    requirements, radii = asked(request)

    def ready(mesh: TriangleMesh) -> Prepared:
        own = replace(request, mesh=mesh, family=None)
        return prepared_for(own, requirements, radii, clock)

    members = tuple(map(ready, request.family.meshes))
    return PreparedFamily(request, members, tuple(range(len(members))))
