"""A plan in the making: what was ordered, and the stages as far as they came."""

import math
from dataclasses import dataclass, field, replace

from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from geometry.regions.regions import DominantRegions
from planning.cache.cache import NO_CACHE, Cache
from planning.cameras.proved_cameras import CameraStage
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import CamerasBy
from planning.model.document.family_records import AlignedBy, AlignmentRecord
from planning.model.document.ring_records import AxisTaken, RingAxis
from planning.model.document.station_records import Stationed
from planning.projectors.projector_stage import ProjectorStage
from planning.proofs.surviving_counts import SurvivingCount
from planning.rig.mounted import Mounted
from planning.rig.range_guard import Guard
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.rings.ring_stage import RingStage
from planning.scene.interest import Interest
from planning.scene.lights import light_of
from planning.scene.ranges.ranged_body import RangedBody
from planning.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class FamilyRequest:
    """Several meshes for one rig.

    Attributes:
        names: Of each, all different; they name folders.
        meshes: Where each stands before the rig.
        alignments: What moved them there.
        align: How that was found.
        quantile: Share of them that must be served.
    """

    names: tuple[str, ...]
    meshes: tuple[TriangleMesh, ...]
    alignments: tuple[AlignmentRecord, ...]
    align: AlignedBy = "given"
    quantile: float = 1.0

    @property
    def n_asked(self) -> int:
        """Members that must be served, one at least."""
        return max(1, math.ceil(self.quantile * len(self.names) - 1e-9))


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """What is asked: the mesh, the rig, the wishes, and how to go about it.

    Attributes, where they aren't those of `plan_rig`:
        interest: The user's own target; None: the dominant regions by curvature.
        ranges: The body whose sphere the mesh is, and what the rig's limits keep free
            for it; None: the mesh was known.
        mounted: Devices that stay, which the rig holds already; None: none but those
            of its file.
        evaluates: Whether these are all there will be.
        axis_wanted: Where ring axes stand after all; None: as was asked.
        stated: What the user asked, where wishes were tightened for it; None: they
            weren't.
        least_projectors: Projectors at least, though fewer light enough.
        family: The members, of which the mesh holds all; None: it is one mesh.
        cache: What was answered before.
    """

    mesh: TriangleMesh
    rig: Rig
    wishes: Wishes
    seed: int = 0
    threads: int = field(default_factory=n_threads)
    command: tuple[str, ...] = ()
    interest: Interest | None = None
    prove: bool = False
    ranges: tuple[RangedBody, Guard] | None = None
    cameras_by: CamerasBy = "both"
    mounted: Mounted | None = None
    evaluates: bool = False
    axis_wanted: RingAxis | None = None
    stated: Wishes | None = None
    least_projectors: int = 0
    family: FamilyRequest | None = None
    cache: Cache = NO_CACHE

    @property
    def ring_axis(self) -> RingAxis | None:
        """Where ring axes may stand; None: the pattern has none."""
        if self.wishes.pattern != "rings":
            return None
        return self.axis_wanted or self.wishes.ring_axis or self.rig.rings.axis

    @property
    def ring_margin(self) -> float:
        """How far beside the object rings are projected, in the unit of radii."""
        light = light_of(self.rig.projector_device())
        return light.ring_step(1e-3 * self.rig.rings.margin_mm, self.rig.standoff_m)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A request, ready to have devices placed.

    Attributes:
        curvature_radius_m: Physical scale of the curvature.
        templates: A projector of each model that stands nowhere: light, optics, rings.
        cameras: A camera of each model that stands nowhere.
    """

    request: PlanRequest
    scene: Scene
    regions: DominantRegions
    curvature_radius_m: float
    templates: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]


@dataclass(frozen=True, eq=False)
class PartialPlan:
    """All stages as far as they came; enough to write a plan from.

    `projectors` have evenly spaced rings about `axes`; `rings` holds those that cameras
    let finer. `other_axes` are the projectors with other axes, to compare. `surviving`
    says what survival takes of projectors and cameras; None: it isn't asked for.
    `stationed` are the heads or steps that the devices belong to; None: to none.
    """

    ready: Prepared
    stage: ProjectorStage
    projectors: tuple[PlannedProjector, ...]
    camera_stage: CameraStage
    cameras: tuple[PlannedCamera, ...]
    axes: AxisTaken | None = "free"
    truncated: bool = False
    rings: RingStage | None = None
    other_axes: tuple[PlannedProjector, ...] = ()
    surviving: tuple[SurvivingCount, SurvivingCount] | None = None
    stationed: Stationed | None = None

    @property
    def request(self) -> PlanRequest:
        """What is asked."""
        return self.ready.request

    @property
    def scene(self) -> Scene:
        """Surface, target and requirements."""
        return self.ready.scene

    def told(self, **changes: object) -> "PartialPlan":
        """Return the same with other words about its stations."""
        assert self.stationed is not None
        record = self.stationed.record.changed(**changes)
        return replace(self, stationed=replace(self.stationed, record=record))

    @property
    def final_projectors(self) -> tuple[PlannedProjector, ...]:
        """The projectors with their own rings, once the cameras stand."""
        return self.projectors if self.rings is None else self.rings.projectors
