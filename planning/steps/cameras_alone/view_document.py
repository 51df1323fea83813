"""Turns cameras alone into a plan: poses rounded, every claim recomputed from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from planning.cameras.baselines.baseline_rows import baseline_rows
from planning.cameras.baselines.seams import SampledSurface
from planning.cameras.photogrammetry.best_pairs import widest_sample
from planning.cameras.photogrammetry.measured_views import measured_views
from planning.cameras.photogrammetry.view_stage import ViewStage
from planning.model.devices.planned import PlannedCamera
from planning.model.document.certificates import Certificates
from planning.model.document.coverage_records import CameraMarginal
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.report.claims.claims import Claims
from planning.report.claims.judged import Devices
from planning.report.entries import device_entries as entries
from planning.report.entries.plan_entry import Told, document_of
from planning.report.entries.surface_entry import surface_of
from planning.report.partial_plan import PlanRequest, Prepared
from planning.scene.draws import DRAWS
from planning.scene.scene import Scene

from .view_claims import view_claims

# What cameras alone measure by.
ASSUMED = (
    "texture on all of the surface, as fine as the cameras resolve",
    "even light of the room, under which no texture moves",
)
# A point must be found within so many pixels of the cameras, where those are largest.
_TAU_PIXELS = 4.0


@dataclass(frozen=True, eq=False)
class ViewPlan:
    """Cameras alone in the making: what was ordered, and how far it came."""

    ready: Prepared
    stage: ViewStage
    cameras: tuple[PlannedCamera, ...]
    truncated: bool = False

    @property
    def request(self) -> PlanRequest:
        """What is asked."""
        return self.ready.request

    @property
    def scene(self) -> Scene:
        """Surface, target and requirements."""
        return self.ready.scene


def write_view_plan(partial: ViewPlan, clock: Stopwatch) -> RigPlan:
    """Round the poses, recompute every claim from them, and write the document."""
    scene, devices = partial.scene, _rounded_devices(partial)
    with clock.stage("claims", "coverage, recomputed from the rounded poses"):
        claims = view_claims(scene, devices)
        marginal = _marginal(partial, claims)
    samples = claims.target_samples.samples
    baselines = baseline_rows(
        devices.cameras,
        SampledSurface(samples.points, samples.normals),
        claims.measured_by,
        scene.requirements.camera.max_incidence,
    )
    told = Told(
        _final_requirements(scene, claims, devices),
        claims.coverage,
        entries.region_records(scene.mesh, partial.ready.regions, claims),
        (),
        entries.camera_records(scene, devices.cameras, claims),
        marginal,
        _certificates(partial),
        tuple(baselines),
    )
    surface = surface_of(scene, devices, partial.ready)
    document = document_of(
        *(partial.ready, surface, claims, told, clock),
        truncated=partial.truncated,
        assumed=ASSUMED,
    )
    return RigPlan(document, surface)


def _rounded_devices(partial: ViewPlan) -> Devices:
    """The cameras and the reference set as they will be written."""
    names = entries.device_ids(partial.cameras, "C")
    cameras = zip(partial.cameras, names, strict=True)
    return Devices(
        (),
        tuple(entries.rounded_camera(camera, name) for camera, name in cameras),
        (),
        tuple(entries.rounded_camera(c, "") for c in partial.stage.reference),
    )


def _final_requirements(scene: Scene, claims: Claims, devices: Devices) -> Requirements:
    """State tau and the reference set as they are."""
    required = scene.requirements
    workspace = replace(
        required.workspace,
        n_reference_projectors=0,
        n_reference_cameras=len(devices.reference_cameras),
    )
    widest = widest_sample(scene, devices.cameras, claims.target_samples)
    check = replace(required.check, tau_m=round(_TAU_PIXELS * widest, 6))
    return replace(required, workspace=workspace, check=check)


def _certificates(partial: ViewPlan) -> Certificates:
    cameras, scene = partial.stage.certificate, partial.scene
    if scene.requirements.region_coverage:
        cameras = cameras.changed(floors=len(scene.large_regions))
    return Certificates(cameras=cameras)


def _marginal(partial: ViewPlan, claims: Claims) -> tuple[CameraMarginal, ...]:
    """Measured areas of target and surface with 1, 2, ... cameras."""
    scene, planned = partial.scene, len(partial.cameras)
    sets = scene.target_samples(DRAWS.claims), scene.surface_samples(DRAWS.claims)
    of_plan = claims.coverage.target.measured_m2, claims.coverage.surface.measured_m2

    def areas(cameras: Sequence[PlannedCamera]) -> tuple[float, float]:
        a, b = (
            samples.samples.weight
            * int(measured_views(scene, cameras, samples).measured.sum())
            for samples in sets
        )
        return a, b

    by_count: Mapping[int, Sequence[PlannedCamera]] = partial.stage.by_count
    rows: dict[int, tuple[float, float]] = {}
    for n, cameras in sorted(by_count.items()):
        a, b = of_plan if n == planned else areas(cameras)
        if n > planned:
            # A camera added to the planned ones can't measure less than they do.
            a, b = max(a, rows[n - 1][0]), max(b, rows[n - 1][1])
        rows[n] = a, b
    return tuple(
        CameraMarginal(n_cameras=n, measured_target_m2=a, measured_surface_m2=b)
        for n, (a, b) in rows.items()
    )
