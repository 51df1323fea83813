"""A plan in the making: what was ordered, and the stages as far as they came."""

from dataclasses import dataclass

from geometry.mesh.mesh import TriangleMesh
from geometry.regions.regions import DominantRegions
from planning.cameras.proved_cameras import CameraStage
from planning.model.document.certificates import CamerasBy
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.projectors.projector_stage import ProjectorStage
from planning.rig.mounted import Mounted
from planning.rig.range_guard import Guard
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.rings.ring_stage import RingStage
from planning.scene.interest import Interest
from planning.scene.ranges.ranged_body import RangedBody
from planning.scene.scene import Scene


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
    """

    mesh: TriangleMesh
    rig: Rig
    wishes: Wishes
    seed: int = 0
    threads: int = 2
    command: tuple[str, ...] = ()
    interest: Interest | None = None
    prove: bool = False
    ranges: tuple[RangedBody, Guard] | None = None
    cameras_by: CamerasBy = "both"
    mounted: Mounted | None = None
    evaluates: bool = False


@dataclass(frozen=True, eq=False)
class Prepared:
    """A request, ready to have devices placed.

    Attributes:
        curvature_radius_m: Physical scale of the curvature.
        template: A projector that stands nowhere: light, optics and rings.
        camera: A camera that stands nowhere.
    """

    request: PlanRequest
    scene: Scene
    regions: DominantRegions
    curvature_radius_m: float
    template: PlannedProjector
    camera: PlannedCamera


@dataclass(frozen=True, eq=False)
class PartialPlan:
    """All stages as far as they came; enough to write a plan from.

    `projectors` have evenly spaced rings; `rings` holds those that cameras let finer.
    """

    ready: Prepared
    stage: ProjectorStage
    projectors: tuple[PlannedProjector, ...]
    camera_stage: CameraStage
    cameras: tuple[PlannedCamera, ...]
    truncated: bool = False
    rings: RingStage | None = None

    @property
    def request(self) -> PlanRequest:
        """What is asked."""
        return self.ready.request

    @property
    def scene(self) -> Scene:
        """Surface, target and requirements."""
        return self.ready.scene

    @property
    def final_projectors(self) -> tuple[PlannedProjector, ...]:
        """The projectors with their own rings, once the cameras stand."""
        return self.projectors if self.rings is None else self.rings.projectors
