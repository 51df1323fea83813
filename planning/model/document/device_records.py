"""`projectors`, `cameras`, `baselines` and `evaluation` of a plan file."""

from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from geometry.devices import ParallelModel, PinholeModel
from planning.model.devices.bodies import Body
from planning.model.devices.lens_fault import lens_fault
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.light.dense_code import DenseCode

from .part import Interval, Matrix3, Part, Pose, Resolution, Vector3
from .ring_records import RingSharesRecord, RingsRecord, are_radii

Limit = Literal[
    "standoff",
    "cone",
    "floor",
    "box",
    "mounting",
    "keep_out",
    "range",
    "body",
    "clearance",
]


class GreySample(Part):
    """How bright a sample comes out, looked at along a camera's axis.

    Attributes:
        normal: Of its face.
        lit: Grey levels of 255 in lit rings, for the least and the largest albedo.
        dark: Likewise in dark ones.
    """

    point_m: Vector3
    normal: Vector3
    distance_m: float
    incidence: float
    lit: Interval
    dark: Interval


class ExposureRecord(Part):
    """What frames of a projector are exposed for, and how bright its samples are.

    Of the target's samples that are assigned to it; None: none are.
    """

    exposure_s: float
    farthest: GreySample | None = None
    most_grazing: GreySample | None = None
    brightest: GreySample | None = None


class ProjectorRecord(Part):
    """One of `projectors`; areas are of the target.

    Attributes:
        K: Camera matrix in [px], diverging light.
        pixel_pitch_m: Side of a pixel of the panel, parallel light.
        min_margin_rad: Least margin over the samples assigned to it; None: none are.
        lit_area_m2: Area that it lights.
        world_from_mount: Pose of its thread or flange; None: the rig doesn't say.
        rings: None: the run was cut before they were spaced.
        exposure: Absent where the rig says nothing of light.
        model: Name of its model, where the rig has several or counts them.
        code: Of the pattern `dense`, which has no rings.
        station: Where it stands, of `stations`, with those that it measures with.
    """

    id: str
    light: Literal["diverging", "parallel"]
    world_from_device: Pose
    world_from_ring: Pose
    K: Matrix3 | None
    resolution: Resolution
    pixel_pitch_m: float | None
    range_m: Interval
    beam_radius: float | None
    ring_radii: tuple[float, ...]
    min_margin_rad: float | None
    lit_area_m2: float
    body: Body | None = None
    world_from_mount: Pose | None = None
    existing: bool = False
    name: str = ""
    rings: RingsRecord | None = None
    ring_shares: RingSharesRecord | None = None
    exposure: ExposureRecord | None = None
    model: str = ""
    code: DenseCode | None = None
    station: str = ""

    @model_validator(mode="after")
    def _shows_something(self) -> Self:
        if self.code is None:
            are_radii(self.ring_radii)
        elif self.ring_radii:
            raise ValueError("ring_radii and code exclude each other: write one")
        return self

    def planned(self) -> PlannedProjector:
        """Return the projector.

        Raises:
            ValueError: If its optics are none.
        """
        return PlannedProjector(
            self.id,
            self.light,
            np.array(self.world_from_device),
            np.array(self.world_from_ring),
            self._device(),
            np.array(self.ring_radii),
            self.name if self.existing else "",
            self.body,
            pattern="rings" if self.code is None else "dense",
            exposure_s=None if self.exposure is None else self.exposure.exposure_s,
            model=self.model,
            code=self.code,
            station=self.station,
        )

    def _device(self) -> PinholeModel | ParallelModel:
        if self.light == "diverging":
            if self.K is None:
                raise ValueError("K is missing, diverging light needs it")
            matrix = np.array(self.K, dtype=np.float64)
            return PinholeModel(matrix, self.resolution, self.range_m)
        if self.pixel_pitch_m is None:
            raise ValueError("pixel_pitch_m is missing, parallel light needs it")
        return ParallelModel(
            self.resolution, self.pixel_pitch_m, self.range_m, self.beam_radius
        )


class CameraRecord(Part):
    """One of `cameras`; areas are of the target.

    Attributes:
        K: Camera matrix in [px].
        distortion: k1, k2, p1, p2, k3.
        seen_area_m2: Area that it measures.
        sole_area_m2: Area that no other camera measures.
        world_from_mount: As of projectors.
        model: As of projectors.
        station: As of projectors.
    """

    id: str
    world_from_device: Pose
    K: Matrix3
    distortion: tuple[float, float, float, float, float]
    resolution: Resolution
    range_m: Interval
    seen_area_m2: float
    sole_area_m2: float
    body: Body | None = None
    world_from_mount: Pose | None = None
    existing: bool = False
    name: str = ""
    model: str = ""
    station: str = ""

    def planned(self) -> PlannedCamera:
        """Return the camera.

        Raises:
            ValueError: If its optics are none.
        """
        device = PinholeModel(
            np.array(self.K), self.resolution, self.range_m, self.distortion
        )
        if fault := lens_fault(device):
            raise ValueError(f"{self.id}: {fault}")
        pose = np.array(self.world_from_device)
        existing = self.name if self.existing else ""
        return PlannedCamera(
            *(self.id, pose, device, existing, self.body, self.model, self.station)
        )


def projector_record(
    projector: PlannedProjector, *, min_margin_rad: float | None, lit_area_m2: float
) -> ProjectorRecord:
    """Return a projector with its claims as the file holds it."""
    return ProjectorRecord(
        id=projector.id,
        light=projector.light,
        world_from_device=projector.world_from_device.tolist(),
        world_from_ring=projector.world_from_ring.tolist(),
        ring_radii=tuple(projector.ring_radii.tolist()),
        min_margin_rad=min_margin_rad,
        lit_area_m2=lit_area_m2,
        **({} if projector.code is None else {"code": projector.code}),
        **_described(projector, ProjectorRecord),
    )


def camera_record(
    camera: PlannedCamera, *, seen_area_m2: float, sole_area_m2: float
) -> CameraRecord:
    """Return a camera with its claims as the file holds it."""
    return CameraRecord(
        id=camera.id,
        world_from_device=camera.world_from_device.tolist(),
        seen_area_m2=seen_area_m2,
        sole_area_m2=sole_area_m2,
        **_described(camera, CameraRecord),
    )


def _described(
    device: PlannedProjector | PlannedCamera, record: type[Part]
) -> dict[str, Any]:
    """Optics; body, names of device and model: no key where there is none."""
    optics = device.device.to_document().items()
    kept = {key: value for key, value in optics if key in record.model_fields}
    body = {} if device.body is None else {"body": device.body}
    name = {"existing": True, "name": device.existing} if device.existing else {}
    told = {
        key: value for key in ("model", "station") if (value := getattr(device, key))
    }
    return kept | body | name | told


class BaselineRow(Part):
    """The tightest seam point of a pair; lengths in [m], angles in [rad].

    `docs/method/baselines.md` defines every key; the last three are known only where
    ranges were estimated (`docs/use/ranges.md`).
    """

    cameras: tuple[str, str]
    E: Vector3
    standoff1: float
    standoff2: float
    C1: float
    C2: float
    D1: float
    D2: float
    phi: float
    phi_max: float
    d: float
    d_lateral: float
    d_axial: float
    d_max: float | None
    slack: float
    covered: bool
    limit: str
    beta: tuple[float, float]
    iota: tuple[float, float]
    half_field: tuple[float, float]
    max_incidence: float
    delta_axes: float
    delta_surface: float
    normals: tuple[Vector3, Vector3]
    onward: Vector3
    shares_border: bool
    n_seam: int
    d_max_stated: float | None = None
    d_max_sigma: float | None = None
    covered_at_2_sigma: bool | None = None


class ViolationRecord(Part):
    """A limit of where devices may stand that one of an evaluated rig breaks.

    Attributes:
        device: Its id.
        limit: Of its position, of its body, or its range, in which no vertex lies.
        what: The zone, what the body touches, or `too near` and `too far`.
        by_m: How far; None: it touches.
    """

    device: str
    limit: Limit
    what: str = ""
    by_m: float | None


class EvaluationRecord(Part):
    """Where the poses of a rig as it stands are from, and which limits they break."""

    path: str
    sha256: str
    violations: tuple[ViolationRecord, ...] = ()
