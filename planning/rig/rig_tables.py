"""The schema of rig files: TOML tables in millimetres and degrees, checked by pydantic.

Unknown keys, numbers out of range, text for numbers and NaN are refused. What each key
means: `docs/reference/rig-files.md`.
"""

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from planning.model.devices.bodies import BodyTable, MountTable
from planning.model.devices.calibration_errors import (
    MOST_FOCAL,
    PERFECT,
    CalibrationErrors,
    Mounting,
)
from planning.model.light.photometry_table import PhotometryTable
from planning.model.light.response_table import Response
from planning.model.table_types import (
    Acute,
    Limit,
    Name,
    Pair,
    Positive,
    PositivePair,
    Share,
    ShareOrNone,
    SourcedTable,
    Table,
    fits_memory,
)

from .existing_tables import ExistingTable
from .obstacle_tables import ObstacleTable
from .tables.carrier_tables import StationsTable, TurntableTable
from .tables.head_tables import HeadTable
from .tables.pattern_tables import DenseTable, RingsTable
from .tables.placement_table import PlacementTable
from .workspace_tables import WorkspaceTable, check_names

# Far beyond any device.
MOST_PIXELS = 100_000
MOST_DEVICES, MOST_MODELS = 1_000, 20
Resolution = Annotated[
    list[Annotated[int, Field(ge=2, le=MOST_PIXELS)]],
    Field(min_length=2, max_length=2),
    AfterValidator(fits_memory),
]
FocalPercent = Annotated[float, Field(ge=0.0, le=1e2 * MOST_FOCAL)]
Rate = Annotated[float, Field(ge=1e-3, le=1e6)]
Five = Annotated[list[float], Field(min_length=5, max_length=5)]


class FocusTable(Table):
    """A lens set to one distance, `[projector.focus]` or `[camera.focus]`."""

    distance_mm: Positive
    f_number: Positive
    blur_px: Positive


class DeviceTable(SourcedTable):
    """A device, perhaps of the catalogue, with body and mount."""

    name: Name
    device: Name | None = None
    count: Annotated[int, Field(ge=1, le=MOST_DEVICES)] | None = None
    cost: Annotated[float, Field(ge=1e-6, le=1e9)] | None = None
    body: BodyTable | None = None
    mount: MountTable | None = None


class PinholeTable(DeviceTable):
    """A camera or a diverging projector, `[camera]` or `[projector]`."""

    resolution_px: Resolution
    focal_px: PositivePair | None = None
    focal_mm: Positive | None = None
    throw_ratio: Positive | None = None
    principal_point_px: Pair | None = None
    vertical_offset_percent: float | None = None
    distortion: Five = Field(default=[0.0, 0.0, 0.0, 0.0, 0.0])
    pixel_um: Positive | None = None
    range_mm: PositivePair | None = None
    frame_rate_hz: Rate | None = None
    focus: FocusTable | None = None

    @model_validator(mode="after")
    def _check_figures(self) -> Self:
        ways = ("focal_px", "focal_mm", "throw_ratio")
        given = [name for name in ways if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"needs exactly one of focal_px, focal_mm and throw_ratio, "
                f"has {' and '.join(given) or 'none'}"
            )
        if self.pixel_um is None and (self.focal_mm is not None or self.focus):
            raise ValueError("needs pixel_um beside focal_mm or [focus]; write it")
        if None not in (self.principal_point_px, self.vertical_offset_percent):
            raise ValueError(
                "has principal_point_px and vertical_offset_percent, which say the "
                "same; keep one"
            )
        if self.range_mm is None and self.focus is None:
            raise ValueError("needs range_mm or [focus], the distances that are sharp")
        _check_rising(self.range_mm)
        return self


class ProjectorTable(PinholeTable):
    """A projector of diverging light, `[projector]`."""

    response: Response = None


class CameraTable(PinholeTable):
    """A camera, `[camera]`."""

    exposure_ms: Annotated[float, Field(gt=0.0, le=1e6)] | None = None


class ParallelTable(DeviceTable):
    """A projector of parallel light, `[parallel_projector]`."""

    resolution_px: Resolution
    pixel_pitch_mm: Positive
    range_mm: PositivePair
    beam_radius_mm: Positive | None = None
    frame_rate_hz: Rate | None = None
    response: Response = None

    @model_validator(mode="after")
    def _check_range(self) -> Self:
        _check_rising(self.range_mm)
        return self


def _check_rising(bounds: list[float] | None) -> None:
    if bounds is not None and not bounds[0] < bounds[1]:
        raise ValueError(
            f"range_mm = {bounds} must rise: nearest distance first, farthest second"
        )


class LimitsTable(Table):
    """When a point counts as lit, seen and measurable, `[limits]`."""

    projector_max_incidence_deg: Acute = 60.0
    min_tangent_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 40.0
    camera_max_incidence_deg: Acute = 70.0
    max_sample_distance_mm: Limit = None
    min_conditioning: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1
    noise_px: Annotated[float, Field(ge=0.0)] = 0.1
    min_ring_pitch_px: Limit = 6.0
    max_sigma_mm: Limit = 0.3
    ring_sigma_mm: Limit = None
    min_angle_deg: Annotated[float, Field(ge=0.0, lt=180.0)] | None = None
    max_angle_deg: Annotated[float, Field(gt=0.0, le=180.0)] | None = None

    @model_validator(mode="after")
    def _check_angles(self) -> Self:
        # The tangent limit must bind, formulation section 2.
        least = 90.0 - self.projector_max_incidence_deg
        written = "min_tangent_angle_deg" in self.model_fields_set
        if written and 0.0 < self.min_tangent_angle_deg <= least:
            raise ValueError(
                f"min_tangent_angle_deg = {self.min_tangent_angle_deg:g} never binds: "
                f"the angle between light and tangent is always at least 90 - "
                f"projector_max_incidence_deg = {least:g}; raise it above {least:g}, "
                f"or remove it"
            )
        low, high = self.min_angle_deg, self.max_angle_deg
        if low is not None and high is not None and not low < high:
            raise ValueError(
                f"min_angle_deg = {low:g} must be less than max_angle_deg = {high:g}"
            )
        return self


class CalibrationTable(SourcedTable):
    """What a calibration leaves of each device, `[calibration]`.

    `from`, a preset that the rest is laid over, has been resolved.
    """

    description: str = ""
    angle_deg: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    position_mm: Annotated[float, Field(ge=0.0)] = 0.0
    focal_percent: FocalPercent = 0.0
    principal_px: Annotated[float, Field(ge=0.0)] = 0.0

    def errors(self) -> CalibrationErrors | None:
        """Return them in metres, radians and shares; None: nothing is left."""
        errors = CalibrationErrors(
            math.radians(self.angle_deg),
            1e-3 * self.position_mm,
            1e-2 * self.focal_percent,
            self.principal_px,
        )
        return None if errors == PERFECT else errors


class MountingTable(Table):
    """How far devices may stand beside their planned poses, `[mounting]`."""

    position_mm: Annotated[float, Field(ge=0.0)] = 0.0
    angle_deg: Annotated[float, Field(ge=0.0, le=45.0)] = 0.0
    focal_percent: FocalPercent = 0.0

    def bounds(self) -> Mounting:
        """Return them in metres, radians and shares."""
        return Mounting(
            1e-3 * self.position_mm,
            math.radians(self.angle_deg),
            1e-2 * self.focal_percent,
        )


class RequirementsTable(Table):
    """What share of the target a plan must reach, `[requirements]`."""

    coverage: Share = 0.95
    dominant_coverage: Share = 0.90
    min_reachable: Share = 0.90
    region_coverage: ShareOrNone = 0.5
    region_share: Share = 0.03


class CheckTable(Table):
    """What the reconstruction from pixels must reach, `[check]`."""

    max_rms_mm: Positive = 0.1
    max_p95_mm: Positive = 0.3
    max_bias_mm: Positive = 0.03
    min_completeness: Share = 0.90
    max_predicted_missing: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.01
    ambient: Annotated[float, Field(ge=0.0, le=10.0)] = 0.05


class RigTable(Table):
    """A whole rig file; a list of devices has been parted into the first and more."""

    name: Name
    description: str = ""
    light: Literal["diverging", "parallel"] = "diverging"
    camera: CameraTable
    projector: ProjectorTable | None = None
    parallel_projector: ParallelTable | None = None
    placement: PlacementTable = PlacementTable()
    rings: RingsTable = RingsTable()
    dense: DenseTable = DenseTable()
    workspace: WorkspaceTable = WorkspaceTable()
    limits: LimitsTable = LimitsTable()
    calibration: CalibrationTable = CalibrationTable()
    mounting: MountingTable = MountingTable()
    photometry: PhotometryTable | None = None
    requirements: RequirementsTable = RequirementsTable()
    check: CheckTable = CheckTable()
    head: HeadTable | None = None
    turntable: TurntableTable | None = None
    stations: StationsTable | None = None
    existing: list[ExistingTable] = Field(default=[])
    obstacle: list[ObstacleTable] = Field(default=[])
    more_cameras: list[CameraTable] = Field(default=[], max_length=MOST_MODELS)
    more_projectors: list[ProjectorTable] = Field(default=[], max_length=MOST_MODELS)
    more_parallel_projectors: list[ParallelTable] = Field(
        default=[], max_length=MOST_MODELS
    )

    @model_validator(mode="after")
    def _check_clearance(self) -> Self:
        devices = (self.camera, self.projector, self.parallel_projector)
        devices += (*self.more_cameras, *self.more_projectors, *self.existing)
        devices += (*self.more_parallel_projectors, self.head)
        clearance = self.placement.clearance_mm
        if clearance and not any(device and device.body for device in devices):
            raise ValueError(
                f"placement.clearance_mm = {clearance:g} is between housings, and no "
                f"device has one; write [camera.body] or [projector.body]"
            )
        return self

    @model_validator(mode="after")
    def _place_head(self) -> Self:
        if self.head is None:
            return self
        placed = self.placement.at_head(self.head.stands_mm, self.head.depths_mm)
        return self.model_copy(update={"placement": placed})

    @model_validator(mode="after")
    def _check_noise(self) -> Self:
        if self.limits.noise_px == 0.0 and self.photometry is None:
            raise ValueError(
                "limits.noise_px = 0 leaves no noise at all; write [photometry], whose "
                "light has its own, or a noise over 0"
            )
        return self

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        check_names("existing", [device.name for device in self.existing])
        solid = [zone.name for zone in self.workspace.keep_out if zone.blocks]
        check_names("obstacle", [table.name for table in self.obstacle] + solid)
        return self
