"""What every plan says, whatever it measures by."""

from dataclasses import dataclass
from datetime import UTC, datetime

from planning.cameras.baselines.seams import overlap_components
from planning.model.document.certificates import Certificates
from planning.model.document.coverage_records import (
    CameraMarginal,
    Coverage,
    ProjectorMarginal,
    RegionRecord,
)
from planning.model.document.device_records import (
    BaselineRow,
    CameraRecord,
    ProjectorRecord,
)
from planning.model.document.input_records import RigRecord, Units
from planning.model.document.made_with import MadeWith
from planning.model.document.plan_document import (
    FORMAT,
    VERSION,
    MemberRecord,
    PlanDocument,
)
from planning.model.progress import Stopwatch
from planning.model.requirements import Requirements
from planning.model.surface import Surface
from planning.report.claims.claims import Claims
from planning.report.partial_plan import Prepared

from . import device_entries as entries
from .cost_entry import cost_record
from .request_entry import request_record, signed


@dataclass(frozen=True, eq=False)
class Told:
    """What differs from plan to plan of what every plan says."""

    requirements: Requirements
    coverage: Coverage
    regions: tuple[RegionRecord, ...]
    projectors: tuple[ProjectorRecord, ...]
    cameras: tuple[CameraRecord, ...]
    marginal: tuple[ProjectorMarginal | CameraMarginal, ...]
    certificates: Certificates
    baselines: tuple[BaselineRow, ...]


def document_of(
    ready: Prepared,
    surface: Surface,
    claims: Claims,
    told: Told,
    clock: Stopwatch,
    *,
    truncated: bool,
    **others: object,
) -> PlanDocument:
    """Return the document of a plan that isn't checked; `others` are more of it."""
    request, scene = ready.request, ready.scene
    rig = RigRecord(**request.rig.to_document())
    document = PlanDocument(
        format=FORMAT,
        version=VERSION,
        units=Units(length="m", angle="rad"),
        seed=request.seed,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        made_with=MadeWith.here(),
        command=request.command,
        truncated=truncated,
        meshes=(entries.mesh_record(scene.mesh, scene.shell),),
        surface=entries.surface_record(ready, surface),
        rig=rig,
        request=request_record(request),
        requirements=told.requirements,
        regions=told.regions,
        projectors=told.projectors,
        cameras=told.cameras,
        coverage=told.coverage,
        marginal=told.marginal,
        certificates=told.certificates,
        baselines=told.baselines,
        camera_groups=tuple(
            tuple(told.cameras[c].id for c in group)
            for group in overlap_components(claims.measured_by)
        ),
        cost=cost_record(
            rig,
            told.projectors,
            told.cameras,
            n_before=told.certificates.cameras.greedy_count,
            stages=clock.processor,
        ),
        members=(
            MemberRecord(
                mesh=0,
                coverage=told.coverage,
                regions=tuple(region.id for region in told.regions),
                reconstruction=None,
            ),
        ),
        reconstruction=None,
        timings_s=dict(clock.seconds),
        **others,  # type: ignore[arg-type]
    )
    return signed(document)
