"""What a rig must do: every limit that binds, in metres and radians.

These values are written into the plan file, so that each claim can be recomputed from
the plan and the surface alone. A limit that is None doesn't bind.
"""

import json
from dataclasses import asdict, dataclass, replace
from math import pi
from typing import Any, Literal

from .devices.bodies import Box, Existing, Mount, Triple
from .devices.calibration_errors import PERFECT, CalibrationErrors, Robust, Survival
from .light.drawn_edges import DrawnEdges
from .light.light_budget import LightBudget

# Of a workspace: zones and standoffs that aren't given have no key.
_ZONES = ("box", "keep_out", "mounting")
_STANDOFFS = ("projector_standoff_m", "camera_standoff_m")
_MOUNTS = ("projector_mount", "camera_mount")
_LEFT_OUT = (*_ZONES, *_STANDOFFS, *_MOUNTS, "origin", "clearance_m")
# Of an existing device, likewise.
_OF_ITS_OWN = ("body", "world_from_ring", "ring_radii", "model")


@dataclass(frozen=True)
class ProjectorLimits:
    """When a surface point counts as lit: the margins of eq. (2).

    Attributes:
        max_incidence: theta_max; -N.L >= cos(max_incidence) [rad].
        min_tangent_angle: tau_min; angle between L and the line of T1 [rad].
        max_sample_distance_m: Largest p(z) / (-N.L) of a dense code's pixels [m].
    """

    max_incidence: float
    min_tangent_angle: float
    max_sample_distance_m: float | None = None


@dataclass(frozen=True)
class CameraLimits:
    """When a surface point counts as seen.

    Attributes:
        max_incidence: Largest angle between N and the direction of the camera [rad].
        max_sample_distance_m: Largest z / (f cos(incidence)) in [m].
    """

    max_incidence: float
    max_sample_distance_m: float | None = None


@dataclass(frozen=True)
class TriangulationLimits:
    """When a pair of projector and camera measures a point well enough.

    Attributes:
        min_conditioning: Least |r.m|; 0 without rings.
        noise_px: s_0, edge noise at frontal light [px].
        max_sigma_m: Largest s_N, or s of the whole budget [m].
        min_ring_pitch_px: Least distance of neighbouring rings in the image [px].
        ring_sigma_m: s_R, error of ring placement [m].
        min_angle: Least triangulation angle, `dense` and `none` only [rad].
        max_angle: Largest triangulation angle, `dense` and `none` only [rad].
        calibration: What a calibration leaves of each device; None: nobody says.
        accuracy_of: Whether `max_sigma_m` limits `noise` alone, or the `total` with
            what the calibration leaves.
        drawn_edges: What blurs the panel's pixels; None: edges lie on their rings.
        light: What reaches the sensors; None: nobody says, and none is counted.
    """

    min_conditioning: float
    noise_px: float
    max_sigma_m: float | None = None
    min_ring_pitch_px: float | None = None
    ring_sigma_m: float | None = None
    min_angle: float | None = None
    max_angle: float | None = None
    calibration: CalibrationErrors | None = None
    accuracy_of: Literal["noise", "total"] = "total"
    drawn_edges: DrawnEdges | None = None
    light: LightBudget | None = None

    @property
    def angles(self) -> tuple[float, float]:
        """Least and largest triangulation angle, any where none is stated [rad]."""
        return self.min_angle or 0.0, self.max_angle or pi

    @property
    def limited_calibration(self) -> CalibrationErrors:
        """What the calibration leaves as far as `max_sigma_m` is a limit of it."""
        whole = self.calibration if self.accuracy_of == "total" else None
        return whole or PERFECT


@dataclass(frozen=True)
class CheckLimits:
    """What the reconstruction from pixels must reach.

    Attributes:
        max_rms_m: Root mean square distance of points from the surface [m].
        max_p95_m: 95th percentile of the absolute distance [m].
        max_bias_m: Absolute mean of the signed distance, outside positive [m].
        tau_m: Distance within which a sample must have a measured point [m].
        min_completeness: Least share of the target predicted measured with a point
            within tau.
        max_predicted_missing: Largest share of the samples predicted measured that
            have no point within tau.
        ambient: Room light, as a share of the projector's at normal incidence.
    """

    max_rms_m: float
    max_p95_m: float
    max_bias_m: float
    tau_m: float
    min_completeness: float
    max_predicted_missing: float
    ambient: float = 0.05


@dataclass(frozen=True)
class Stock:
    """How many devices there are of a model; of a `projector` or a `camera`."""

    kind: str
    model: str
    count: int


@dataclass(frozen=True)
class Workspace:
    """Where devices may stand: a shell about the object, or what zones leave of it.

    A position Q is admissible iff |Q - centre| lies in the device's radius range, the
    angle between Q - centre and `axis` is at most `half_angle`, (Q - centre) . up >=
    floor_m where a floor is given, Q is in `box` and on one of `mounting` where they
    are given, and inside none of `keep_out`.

    Attributes:
        centre: Centre of the smallest ball that holds the object's main bodies, in the
            world [m].
        object_radius_m: Radius of that ball [m].
        up: Unit vector that points up.
        axis: Unit vector, axis of the cone.
        half_angle: Half opening of the cone [rad]; pi is the whole shell.
        projector_radius_m: Least and largest distance of projectors from `centre` [m].
        camera_radius_m: Least and largest distance of cameras from `centre` [m].
        floor_m: Least height above `centre` along `up` [m]; None: no floor.
        n_reference_projectors: Poses in the projectors' reference set.
        n_reference_cameras: Poses in the cameras' reference set.
        reference_ring_radius: Outermost ring of the reference projectors: its tangent
            R (diverging) or its radius in [m] (parallel); 0 without rings.
        bearing: Unit vector across `axis`, turning with the object, from which
            candidates are laid out; None: a world axis decides.
        box: Room that holds every device; None: no room.
        keep_out: Volumes in which no optical centre stands.
        mounting: Planes on which optical centres lie; none: anywhere.
        projector_standoff_m: Of tiled placement, where the object overflows their
            field: distance of projectors from the surface [m]; else None.
        camera_standoff_m: The same of cameras.
        origin: `mesh` where places of the rig file count from the origin of the mesh;
            None: from `centre`. All places above count from `centre` either way.
        clearance_m: What housings keep between each other, unless both stand already.
        projector_mount: Where projectors are fastened; None: it isn't said.
        camera_mount: The same of cameras.
    """

    centre: tuple[float, float, float]
    object_radius_m: float
    up: tuple[float, float, float]
    axis: tuple[float, float, float]
    half_angle: float
    projector_radius_m: tuple[float, float]
    camera_radius_m: tuple[float, float]
    floor_m: float | None
    n_reference_projectors: int
    n_reference_cameras: int
    reference_ring_radius: float
    bearing: tuple[float, float, float] | None = None
    box: Box | None = None
    keep_out: tuple[Box, ...] = ()
    mounting: tuple[Box, ...] = ()
    projector_standoff_m: float | None = None
    camera_standoff_m: float | None = None
    origin: Literal["mesh"] | None = None
    clearance_m: float = 0.0
    projector_mount: Mount | None = None
    camera_mount: Mount | None = None

    @property
    def origin_m(self) -> Triple:
        """Where places of the rig file count from, in the world [m]."""
        return (0.0, 0.0, 0.0) if self.origin == "mesh" else self.centre

    def mount_of(self, kind: str) -> Mount | None:
        """Return the mount of a `projector` or a `camera`."""
        return self.projector_mount if kind == "projector" else self.camera_mount

    @property
    def free_mounts(self) -> "Workspace":
        """The same workspace with mounts that can be set to anything."""
        one, other = self.projector_mount, self.camera_mount
        return replace(
            self,
            projector_mount=None if one is None else one.free,
            camera_mount=None if other is None else other.free,
        )

    @property
    def written(self) -> "Workspace":
        """The workspace with floor and zones from `origin_m`, as in the rig file."""
        return self if self.origin is None else self.moved(self.centre)

    def moved(self, by_m: Triple) -> "Workspace":
        """Return the workspace with floor and zones displaced, against its shell."""
        rise = sum(a * b for a, b in zip(by_m, self.up, strict=True))
        return replace(
            self,
            floor_m=None if self.floor_m is None else self.floor_m + rise,
            box=None if self.box is None else self.box.moved(by_m),
            keep_out=tuple(zone.moved(by_m) for zone in self.keep_out),
            mounting=tuple(plane.moved(by_m) for plane in self.mounting),
        )

    @property
    def whole_shell(self) -> "Workspace":
        """The same shell without cone, floor, room, keep-out volumes or mountings."""
        return replace(
            self, half_angle=pi, floor_m=None, box=None, keep_out=(), mounting=()
        )

    def inset(self, by_m: float) -> "Workspace":
        """Return the workspace shrunk on all sides.

        Poses that are optimised inside it stay admissible when they are rounded.
        """
        projector, camera = (
            (low + by_m, high - by_m) if high - low > 2.0 * by_m else (low, high)
            for low, high in (self.projector_radius_m, self.camera_radius_m)
        )
        least = min(projector[0], camera[0])
        return replace(
            self,
            projector_radius_m=projector,
            camera_radius_m=camera,
            half_angle=self.half_angle
            if self.half_angle >= pi
            else max(0.0, self.half_angle - by_m / least),
            floor_m=None if self.floor_m is None else self.floor_m + by_m,
            box=None if self.box is None else self.box.grown(-by_m),
            keep_out=tuple(zone.grown(by_m) for zone in self.keep_out),
            mounting=tuple(plane.grown(-by_m) for plane in self.mounting),
        )


@dataclass(frozen=True)
class Requirements:
    """All that is asked of a plan.

    Attributes:
        max_projectors: Projectors at most.
        max_cameras: Cameras at most; None: as many as the coverage needs.
        coverage: Measured area / area reachable by cameras, on the target.
        dominant_coverage: Lit area / area reachable by projectors, on the target.
        min_reachable: Area reachable by projectors / target area.
        target: `dominant` or chosen faces, the whole `surface`, or its `outside`.
        pattern: `rings`, a `dense` code of every pixel, or `none`, cameras alone.
        existing: Devices that stand already and are part of every plan.
        region_coverage: Floor of lit / reachable and of measured / reachable in each.
        region_share: Regions of at least this share of the target's area have it.
        robust: What drawn rigs must meet, where the rest is tightened for it.
        stock: Models of which there are so many and no more.
        survival: Pairs that must measure what counts, and losses to survive.
        min_views: Cameras that must see what counts, of `none`.
    """

    max_projectors: int
    max_cameras: int | None
    coverage: float
    dominant_coverage: float
    min_reachable: float
    target: Literal["dominant", "surface", "outside"]
    pattern: Literal["rings", "dense", "none"]
    projector: ProjectorLimits
    camera: CameraLimits
    triangulation: TriangulationLimits
    check: CheckLimits
    workspace: Workspace
    existing: tuple[Existing, ...] = ()
    region_coverage: float = 0.0
    region_share: float = 0.01
    robust: Robust | None = None
    stock: tuple[Stock, ...] = ()
    survival: Survival | None = None
    min_views: int | None = None

    def stock_of(self, kind: str) -> dict[str, int]:
        """Return how many there are of each counted model of a kind."""
        return {one.model: one.count for one in self.stock if one.kind == kind}

    def existing_of(self, kind: str) -> tuple[Existing, ...]:
        """Return the existing devices that are a `projector` or a `camera`."""
        return tuple(device for device in self.existing if device.kind == kind)

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values: tuples become lists, every float is kept."""
        document = json.loads(json.dumps(asdict(self)))
        devices = [(device, _OF_ITS_OWN) for device in document["existing"]]
        tables = [
            (document["workspace"], _LEFT_OUT),
            (document, ("existing", "robust", "stock", "survival", "min_views")),
            (document["triangulation"], ("light",)),
            (document["projector"], ("max_sample_distance_m",)),
        ]
        for table, names in devices + tables:
            for name in names:
                if not table[name]:
                    del table[name]
        return document
