"""The whole plan file, format `ringrig-plan`, version 1."""

import json
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_serializer, model_validator

from planning.model.requirements import Requirements

from .certificates import Certificates
from .check_records import ReconstructionRecord
from .coverage_records import (
    CameraMarginal,
    Coverage,
    ExposureSchedule,
    Overlap,
    ProjectorMarginal,
    RegionRecord,
    RobustRecord,
)
from .device_records import (
    BaselineRow,
    CameraRecord,
    EvaluationRecord,
    ProjectorRecord,
)
from .family_records import AlignmentRecord, FamilyRecord
from .input_records import (
    MeshRecord,
    RangesRecord,
    RigRecord,
    SurfaceRecord,
    Units,
)
from .joint_records import JointRecord
from .made_with import MadeWith
from .part import FileName, FolderName, Part
from .request_records import RequestRecord
from .ring_records import RingAxes
from .station_records import StationsRecord
from .survival_records import SurvivalRecord

FORMAT = "ringrig-plan"
VERSION = 1


class CostRecord(Part):
    """Eq. (8); `docs/method/cost.md` defines every key.

    Attributes:
        n_frames: Frames that the projectors show, one after the other.
        frame_s: Time of one; None: the rig doesn't say how fast its devices are.
        t1: None where `frame_s` is.
        t2: None: no check was made; likewise `t3` and `render_s`.
        C: None where a term is; likewise `C_before` and `C_all_rings`.
        render_s: What the simulated images took; no part of C.
    """

    pixels: int
    n_cameras_before: int
    n_frames: int = 0
    frame_s: float | None = None
    t4: float
    t5: float
    t1: float | None
    t2: float | None
    t3: float | None
    C: float | None
    C_before: float | None
    C_all_rings: float | None = None
    render_s: float | None = None


class MemberRecord(Part):
    """What the plan does for one of its meshes.

    Attributes:
        mesh: Index in `meshes`.
        name: Of a member of a family; likewise all below.
        path: Its own plan, beside this one.
        digest: Of that plan (`RigPlan.digest`).
        alignment: Where it stands.
    """

    mesh: int
    coverage: Coverage
    regions: tuple[int, ...]
    reconstruction: ReconstructionRecord | None = None
    name: FolderName = ""
    path: FileName = ""
    digest: str = ""
    alignment: AlignmentRecord | None = None


class PlanDocument(Part):
    """A plan as it is written; metres, radians, and pixels where named.

    Attributes:
        request: None: the plan is from before.
        assumed: What the object or its surroundings must have, and no claim shows.
    """

    format: Literal["ringrig-plan"]
    version: Literal[1]
    units: Units
    seed: Annotated[int, Field(ge=0)]
    created: str
    made_with: MadeWith | None = None
    command: tuple[str, ...]
    truncated: bool
    meshes: Annotated[tuple[MeshRecord, ...], Field(min_length=1)]
    surface: SurfaceRecord
    rig: RigRecord
    request: RequestRecord | None = None
    requirements: Requirements
    regions: tuple[RegionRecord, ...]
    projectors: tuple[ProjectorRecord, ...]
    cameras: tuple[CameraRecord, ...]
    ring_axes: RingAxes | None = None
    coverage: Coverage
    overlaps: tuple[Overlap, ...] = ()
    firing_schedule: ExposureSchedule | None = None
    marginal: tuple[ProjectorMarginal | CameraMarginal, ...]
    certificates: Certificates
    baselines: tuple[BaselineRow, ...]
    ranges: RangesRecord | None = None
    evaluation: EvaluationRecord | None = None
    robust: RobustRecord | None = None
    survival: SurvivalRecord | None = None
    joint: JointRecord | None = None
    family: FamilyRecord | None = None
    stations: StationsRecord | None = None
    camera_groups: tuple[tuple[str, ...], ...] = ()
    assumed: tuple[str, ...] = ()
    cost: CostRecord
    members: tuple[MemberRecord, ...]
    reconstruction: ReconstructionRecord | None
    timings_s: dict[str, float]

    @property
    def faces_chosen_by(self) -> str:
        """What chose the faces of the regions; older plans don't say that it bent."""
        selection = self.surface.selection
        return "curvature" if selection is None else selection.kind

    @property
    def own_mesh(self) -> MeshRecord:
        """The mesh that the plan speaks of: of a family's that of its worst member."""
        worst = 0 if self.family is None else self.family.worst
        return self.meshes[min(worst, len(self.meshes) - 1)]

    @model_validator(mode="after")
    def _stations_hold_devices(self) -> Self:
        stations = () if self.stations is None else self.stations.stations
        named = {n for one in stations for n in (*one.projectors, *one.cameras)}
        if more := named - {d.id for d in (*self.projectors, *self.cameras)}:
            raise ValueError(f"stations name {sorted(more)}, which aren't in the plan")
        return self

    @model_validator(mode="after")
    def _has_certificates(self) -> Self:
        alone = self.requirements.pattern == "none"
        if (self.certificates.projectors is None) is not alone:
            verb = "is there" if alone else "is missing"
            raise ValueError(
                f"certificates.projectors {verb}, requirements.pattern is "
                f"{self.requirements.pattern!r}"
            )
        return self

    @field_serializer("requirements")
    def _write_requirements(self, requirements: Requirements) -> dict[str, Any]:
        return requirements.to_document()

    @classmethod
    def read(cls, text: str | bytes) -> Self:
        """Read the text of a plan file; nothing is converted.

        Raises:
            ValueError: If anything is missing or of another type.
        """
        return cls.model_validate_json(text, strict=True)


def plan_schema() -> str:
    """Return the JSON Schema of a plan file as text, as `plan.schema.json` has it."""
    return json.dumps(PlanDocument.model_json_schema(), indent=1) + "\n"
