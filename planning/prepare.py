"""What stands before any device does: target, limits, rings, the first candidates."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.curvature.curvature import CurvatureField, principal_curvatures
from geometry.mesh.bearing import bearing
from geometry.regions.regions import DominantRegions, dominant_regions
from geometry.regions.selected_regions import regions_of_faces
from planning.model.errors import InfeasibleLimitsError, InputError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.projectors.candidate_set import NothingLitError
from planning.projectors.projector_stage import ProjectorStage, plan_projectors
from planning.report.advice.projector_relaxations import nothing_lit
from planning.report.partial_plan import PlanRequest
from planning.rings.ring_radii import outer_radius, ring_gap, uniform_radii
from planning.scene.clearance import check_existing_clearance
from planning.scene.scene import Scene

# Upwards in the image: where the ring axis points until the cameras are known.
_FIRST_AZIMUTH = -float(np.pi / 2)


@dataclass(frozen=True, eq=False)
class Prepared:
    """An order, ready to have devices placed.

    Attributes:
        order: What was ordered.
        scene: Surface, target and requirements.
        regions: The target.
        curvature_radius_m: Physical scale of the curvature.
        template: A projector that stands nowhere: light, optics and rings.
        tilt: Tilt or shift of ring axes.
    """

    order: PlanRequest
    scene: Scene
    regions: DominantRegions
    curvature_radius_m: float
    template: PlannedProjector
    tilt: float

    @property
    def ring_offset(self) -> tuple[float, float]:
        """Tilt and azimuth of the ring axis until the cameras are known."""
        return self.tilt, _FIRST_AZIMUTH


def prepared(order: PlanRequest, clock: Stopwatch) -> Prepared:
    """Find the regions and state what is asked.

    Raises:
        InputError: If nothing is curved enough to be a target.
        InfeasibleLimitsError: If limits exclude each other.
    """
    mesh, rig = order.mesh, order.rig
    with clock.stage("regions", "curvature and dominant regions"):
        field = principal_curvatures(mesh)
        regions = _regions(order, field)
        clock.say(f"  {len(regions)} regions, {regions.dominant_share:.1%} of the area")
    requirements, radii, tilt = _resolve(order)
    scene = Scene(
        mesh,
        regions.face_region,
        _steep(regions, order.asked["target"]),
        requirements,
        order.seed,
        order.threads,
        clock.check,
    )
    template = PlannedProjector(
        "",
        rig.light,
        np.eye(4),
        np.eye(4),
        rig.projector_device(),
        radii,
        body=rig.projector_body(),
    )
    camera = PlannedCamera("", np.eye(4), rig.camera_device(), body=rig.camera_body())
    check_existing_clearance(scene, template, camera)
    return Prepared(order, scene, regions, field.radius, template, tilt)


def first_projectors(ready: Prepared, clock: Stopwatch) -> ProjectorStage:
    """Return the fewest projectors of the candidates.

    Raises:
        InfeasibleLimitsError: If no candidate lights any sample.
    """
    rig = ready.order.rig
    with clock.stage("projectors", "projectors: candidates and cover"):
        try:
            stage = plan_projectors(
                ready.scene,
                ready.template,
                rig.n_projector_poses,
                ring_offset=ready.ring_offset,
            )
        except NothingLitError as error:
            helps = nothing_lit(ready.scene, error)
            raise InfeasibleLimitsError(f"{error}; {helps}") from None
        clock.say(
            f"  {len(stage.projectors)} of {len(stage.reference)} candidates; at least "
            f"{stage.certificate.candidates.lower_bound} are needed"
        )
    return stage


def _regions(order: PlanRequest, field: CurvatureField) -> DominantRegions:
    """The user's selection, or else the most curved surface."""
    if order.interest is not None:
        return regions_of_faces(order.mesh, field, order.interest.chosen)
    regions = dominant_regions(order.mesh, field)
    if order.asked["target"] == "dominant" and not len(regions):
        raise InputError(
            "no dominant region: the surface is flat where its curvature can be "
            "trusted; use --target surface, or choose faces with --select"
        )
    return regions


def _resolve(order: PlanRequest) -> tuple[Requirements, Any, float]:
    """Return the requirements, the ring radii, and the tilt or shift of ring axes."""
    mesh, rig = order.mesh, order.rig
    requirements = rig.requirements(
        mesh.centre, mesh.radius, **order.asked, tau_m=rig.standoff_m
    )
    projector, camera = rig.projector_device(), rig.camera_device()
    parallel = rig.light == "parallel"
    tilt = rig.ring_shift_m if parallel else rig.ring_tilt_rad
    workspace = requirements.workspace
    gap = rig.ring_gap_m or ring_gap(
        projector, camera, requirements.triangulation, rig.standoff_m
    )
    corner = rig.outer_ring_radius()
    outer = outer_radius(
        projector, tilt, mesh.radius, workspace.projector_radius_m[0], corner
    )
    if workspace.projector_standoff_m is not None:
        # What is looked at from beside reaches to the corners of the image.
        outer = corner
    radii = uniform_radii(outer, gap if parallel else gap / rig.standoff_m)
    workspace = replace(
        workspace,
        reference_ring_radius=float(radii[-1]),
        bearing=_direction(bearing(mesh, np.array(workspace.axis))),
    )
    return replace(requirements, workspace=workspace), radii, tilt


def _direction(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def _steep(regions: DominantRegions, target: str) -> NDArray[np.float64]:
    """T1 of each face of the target; zero elsewhere, where it binds nothing."""
    if target == "surface":
        return regions.steep
    return np.where((regions.face_region >= 0)[:, None], regions.steep, 0.0)
