"""What a plan was made from: `meshes`, `surface`, `rig` and `ranges`."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from geometry.devices import ParallelModel, PinholeModel
from planning.model.devices.bodies import Body
from planning.model.devices.lens_fault import lens_fault
from planning.model.devices.stated_tables import STATED_TABLES, check_stated

from .head_records import CarrierRecord, HeadRecord, TurntableRecord
from .part import Count, Interval, Matrix3, Part, Resolution, Size, Vector3


class Units(Part):
    """Of every figure that doesn't name its own."""

    length: Literal["m"]
    angle: Literal["rad"]


class Repair(Part):
    """What was repaired, and how often."""

    kind: str
    count: int


class ShellRecord(Part):
    """What kind of body a mesh is: `solid`, `hollow shell` and so on."""

    kind: str
    wall_m: Size | None = None
    mean_wall_m: Size | None = None
    inside_m2: Size = 0.0
    sealed_m2: Size = 0.0


class MeshRecord(Part):
    """A mesh as it was read; None where it came from no file."""

    path: str | None
    sha256: str | None
    unit: str
    scale_to_m: float
    n_vertices: Count
    n_faces: Count
    area_m2: Size
    repairs: tuple[Repair, ...] = ()
    shell: ShellRecord = ShellRecord(kind="solid")


class SelectionRecord(Part):
    """What the faces of the regions were chosen by.

    Attributes:
        kind: `curvature`, or what the user gave.
        n_removed_by_repair: Chosen faces that repair took away.
    """

    kind: str
    source: str | None
    sha256: str | None
    n_faces: Count
    area_m2: Size
    n_removed_by_repair: Count


class SurfaceRecord(Part):
    """The file of the surface as planned, beside the plan and nowhere else."""

    path: Literal["surface.npz"]
    sha256: str
    curvature_radius_m: Size
    dominant_share: Size
    selection: SelectionRecord | None = None


class FocusFigures(Part):
    """A lens set to one distance."""

    distance_mm: float
    f_number: Annotated[float, Field(gt=0.0)]
    blur_px: float


class FiguresRecord(Part):
    """Figures of a device as its rig file writes them, of either light."""

    body: dict[str, list[float]] | None = None
    mount: dict[str, list[float] | float] | None = None
    resolution_px: Resolution | None = None
    focal_px: Interval | None = None
    focal_mm: float | None = None
    throw_ratio: float | None = None
    principal_point_px: Interval | None = None
    vertical_offset_percent: float | None = None
    distortion: tuple[float, ...] | None = None
    pixel_um: float | None = None
    frame_rate_hz: float | None = None
    exposure_ms: float | None = None
    response: float | tuple[float, ...] | None = None
    pixel_pitch_mm: float | None = None
    range_mm: Interval | None = None
    beam_radius_mm: float | None = None
    focus: FocusFigures | None = None


class ModelRecord(Part):
    """A device model of the rig: optics, figures as written, and their sources.

    Attributes:
        count: How many of it there are; None: any number.
        cost: Of one, in a unit of the user's own; None: not stated.
    """

    name: str = ""
    K: Matrix3 | None
    resolution: Resolution
    distortion: tuple[float, ...] | None = None
    range_m: Interval
    pixel_pitch_m: float | None = None
    beam_radius: float | None = None
    figures: FiguresRecord = FiguresRecord()
    sources: dict[str, str] = Field(default={})
    body: Body | None = None
    light: str = ""
    count: int | None = None
    cost: float | None = None

    @model_validator(mode="after")
    def _images_by_one_law(self) -> Self:
        if self.K is not None and (self.pixel_pitch_m or self.beam_radius):
            raise ValueError("K excludes pixel_pitch_m and beam_radius: write one")
        device = None if self.K is None else self.optics
        if isinstance(device, PinholeModel) and (fault := lens_fault(device)):
            raise ValueError(fault)
        return self

    @property
    def optics(self) -> PinholeModel | ParallelModel:
        """Its optics; a plan keeps no distortion of projectors.

        Raises:
            ValueError: If they are none.
        """
        if self.K is not None:
            bent = () if self.light else (self.distortion or ())
            k1, k2, p1, p2, k3 = *bent, *[0.0] * (5 - len(bent))
            size, terms = self.resolution, (k1, k2, p1, p2, k3)
            return PinholeModel(np.array(self.K), size, self.range_m, terms)
        if self.pixel_pitch_m is None:
            raise ValueError("neither K nor pixel_pitch_m: one says what it images")
        return ParallelModel(
            self.resolution, self.pixel_pitch_m, self.range_m, self.beam_radius
        )


class ObstacleRecord(Part):
    """An obstacle as its rig file has it; lengths in [mm], angles in degrees.

    Attributes:
        centre_mm: None: of a `table` that stands right under the object.
    """

    name: str
    shape: Literal["box", "cylinder", "table", "mesh"]
    centre_mm: Vector3 | None = None
    turn_deg: Vector3 = (0.0, 0.0, 0.0)
    size_mm: Vector3 | None = None
    radius_mm: float | None = None
    height_mm: float | None = None

    @model_validator(mode="after")
    def _has_its_sizes(self) -> Self:
        sizes: dict[str, tuple[str, ...]] = {
            "mesh": (),
            "cylinder": ("radius_mm", "height_mm"),
        }
        for name in sizes.get(self.shape, ("size_mm",)):
            if getattr(self, name) is None:
                raise ValueError(f"a {self.shape} needs {name}")
        if self.centre_mm is None and self.shape != "table":
            raise ValueError(f"a {self.shape} needs centre_mm")
        return self


class RigRecord(Part):
    """The resolved rig; tables whose keys end in _mm or _deg are as in its file.

    Attributes:
        more_projectors: Other models than `projector`; of cameras likewise.
    """

    name: str = ""
    description: str = ""
    light: str
    projector: ModelRecord
    camera: ModelRecord
    standoff_m: float | None = None
    standoff_play_m: float | None = None
    n_candidate_projectors: int | None = None
    n_candidate_cameras: int | None = None
    rings: dict[str, Any] = Field(default={})
    workspace: dict[str, Any] = Field(default={})
    limits: dict[str, float | None] = Field(default={})
    calibration: dict[str, Any] = Field(default={})
    requirements: dict[str, float] = Field(default={})
    check: dict[str, float] = Field(default={})
    notes: tuple[str, ...] = ()
    existing: tuple[dict[str, Any], ...] = ()
    obstacle: tuple[ObstacleRecord, ...] = ()
    mounting: dict[str, float] = Field(default={})
    photometry: dict[str, Any] = Field(default={})
    clearance_m: float = 0.0
    more_projectors: tuple[ModelRecord, ...] = ()
    more_cameras: tuple[ModelRecord, ...] = ()
    head: HeadRecord | None = None
    turntable: TurntableRecord | None = None
    stations: CarrierRecord | None = None
    dense: dict[str, Any] = Field(default={})

    @model_validator(mode="after")
    def _tables(self) -> Self:
        for name in STATED_TABLES:
            if table := getattr(self, name):
                check_stated(name, table)
        return self

    def models(self, kind: str) -> tuple[ModelRecord, ...]:
        """Return the models of a `projector` or a `camera`, the first one first."""
        return (getattr(self, kind), *getattr(self, f"more_{kind}s"))

    def model_of(self, kind: str, name: str) -> ModelRecord:
        """Return a model by the name that devices give; of none known the first."""
        models = self.models(kind)
        return next((model for model in models if model.name == name), models[0])

    def cost_of(self, kind: str, name: str) -> float:
        """Return what one device of a model costs; 1 where the rig states none."""
        cost = self.model_of(kind, name).cost
        return 1.0 if cost is None else cost

    def figures_of(self, kind: str, names: Iterable[str]) -> list[FiguresRecord]:
        """Return the figures of the models that devices name; of none the first's."""
        taken = {self.model_of(kind, name).name for name in names}
        models = self.models(kind)
        return [m.figures for m in models if m.name in taken] or [models[0].figures]


class RangePoint(Part):
    """A point of the object, as estimated from its lines of the file."""

    point: str
    lines: tuple[int, ...]
    position_m: Vector3
    covariance_m2: tuple[Vector3, Vector3, Vector3]
    chi_square: float
    n_free: int
    residual_m: float


class RefusedPoint(Part):
    """A point that wasn't used, and why."""

    point: str
    lines: tuple[int, ...]
    reason: str


class EstimatedSphere(Part):
    """The least-squares sphere; covariance of centre and radius."""

    centre_m: Vector3
    radius_m: float
    covariance_m2: tuple[tuple[float, ...], ...]
    shape_sigma_m: float
    chi_square: float


class RangesRecord(Part):
    """What is known of a body by its ranges alone, and what was kept free for it."""

    path: str
    sha256: str
    significance: float
    observations: tuple[dict[str, Any], ...]
    points: tuple[RangePoint, ...]
    refused: tuple[RefusedPoint, ...]
    sphere: EstimatedSphere
    position_sigma_m: float
    guard_m: float
    guard_rad: float
    stated: dict[str, Any]
