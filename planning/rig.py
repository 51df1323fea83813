"""The rig: which devices there are, where they may stand, and what counts as measured.

A rig is a preset or a TOML file (`docs/rig-files.md`); `load_rig` gives the devices in
pixels, metres and radians and the requirements that a plan is held to.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel

from . import optics
from .errors import InfeasibleLimitsError, InputError, RigError
from .requirements import (
    CameraLimits,
    CheckLimits,
    ProjectorLimits,
    Requirements,
    TriangulationLimits,
    Workspace,
)
from .rig_files import Figure, Preset, list_presets, read_rig
from .rig_models import ParallelTable, PinholeTable, RigTable

__all__ = ["Figure", "Preset", "Rig", "list_presets", "load_rig"]

Light = Literal["diverging", "parallel"]
Pattern = Literal["rings", "dense", "none"]
Target = Literal["dominant", "surface"]

UP_VECTORS: dict[str, tuple[float, float, float]] = {
    f"{sign}{name}": (
        factor if name == "x" else 0.0,
        factor if name == "y" else 0.0,
        factor if name == "z" else 0.0,
    )
    for sign, factor in (("", 1.0), ("-", -1.0))
    for name in "xyz"
}
_WARN_INCIDENCE_DEG = 70.0


def load_rig(name: str | Path = "default", light: Light | None = None) -> "Rig":
    """Load a preset or a rig file.

    Args:
        name: Name of a preset, or path of a TOML file.
        light: `diverging` or `parallel`; None: what the rig says.

    Raises:
        RigError: One line for each fault: where it is, the value, the rule, what to do.
    """
    if light not in (None, "diverging", "parallel"):
        raise RigError(f"light = {light!r} must be 'diverging' or 'parallel'")
    table = read_rig(name)
    rig = Rig(table, light or table.light)
    _check_devices(rig)
    return rig


@dataclass(frozen=True, eq=False)
class Rig:
    """Devices, placement and limits of one rig, in metres and radians.

    Attributes:
        table: The rig as written, in millimetres and degrees.
        light: `diverging` or `parallel`.
    """

    table: RigTable
    light: Light

    @property
    def name(self) -> str:
        """Name of the rig."""
        return self.table.name

    @property
    def standoff_m(self) -> float:
        """Distance of devices from the surface in [m]."""
        return self.table.placement.standoff_mm * 1e-3

    @property
    def standoff_play_m(self) -> float:
        """How much nearer or farther than the standoff a device may be in [m]."""
        return self.table.placement.standoff_play_mm * 1e-3

    @property
    def ring_tilt_rad(self) -> float:
        """Turn of the ring axis against the projector's optical axis in [rad]."""
        return math.radians(self.table.rings.tilt_deg)

    @property
    def ring_shift_m(self) -> float:
        """Shift of the ring axis in the panel's plane, parallel light, in [m].

        ``standoff tan(tilt)``: as far on the object as the turned axis would move.
        """
        return self.standoff_m * math.tan(self.ring_tilt_rad)

    @property
    def ring_gap_m(self) -> float | None:
        """Distance of neighbouring rings at the standoff in [m]; None: not fixed."""
        gap = self.table.rings.gap_mm
        return None if gap is None else gap * 1e-3

    @property
    def n_candidate_projectors(self) -> int:
        """Projector poses offered to the cover."""
        return self.table.placement.n_candidate_projectors

    @property
    def n_candidate_cameras(self) -> int:
        """Camera poses offered to the cover."""
        return self.table.placement.n_candidate_cameras

    @property
    def n_reference_projectors(self) -> int:
        """Projector poses that define what is reachable."""
        return self.table.placement.n_reference_projectors

    @property
    def n_reference_cameras(self) -> int:
        """Camera poses that define what is reachable."""
        return self.table.placement.n_reference_cameras

    def projector_device(self) -> PinholeModel | ParallelModel:
        """Return the optics of a projector; a new value each time.

        Raises:
            RigError: If the rig has no projector for this light.
        """
        table = self._projector_table
        if isinstance(table, ParallelTable):
            return _parallel(table)
        return _pinhole(table, "projector")

    def camera_device(self) -> PinholeModel:
        """Return the optics of a camera; a new value each time."""
        return _pinhole(self.table.camera, "camera")

    @cached_property
    def _projector_table(self) -> PinholeTable | ParallelTable:
        key = "projector" if self.light == "diverging" else "parallel_projector"
        table = getattr(self.table, key)
        if table is None:
            raise RigError(
                f"rig {self.name}: light '{self.light}' needs a table [{key}]; "
                f'add it, or lay the file over one that has it: base = "default"'
            )
        return table

    def projector_centre_ray(self) -> NDArray[np.float64]:
        """Return the direction of the image centre in the projector's frame, (3,).

        With a vertical offset the optical axis misses the image: aim this ray.
        """
        device = self.projector_device()
        if isinstance(device, ParallelModel):
            return np.array([0.0, 0.0, 1.0])
        return device.rays(0.5 * (np.array(device.resolution) - 1.0))

    def outer_ring_radius(self) -> float:
        """Return the outermost ring, wherever the ring axis is turned or shifted to.

        Diverging: tangent of the angle between ring axis and farthest image corner,
        ``tan(corner + tilt)``. Parallel: half the panel's diagonal (the beam's radius
        if that is less) plus the shift, in [m].
        """
        device = self.projector_device()
        if isinstance(device, PinholeModel):
            return optics.largest_corner_tangent(
                device.camera_matrix, device.resolution, self.ring_tilt_rad
            )
        reach = float(np.hypot(*device.half_panel))
        if device.beam_radius is not None:
            reach = min(reach, device.beam_radius)
        return reach + self.ring_shift_m

    def notes(self, object_radius_m: float | None = None) -> tuple[str, ...]:
        """Return what a user should know of these limits, a sentence each."""
        limits = self.table.limits
        theta, tau = limits.projector_max_incidence_deg, limits.min_tangent_angle_deg
        found: list[str] = []
        if tau <= 90.0 - theta:
            found.append(
                f"the tangent limit of {tau:g} degrees doesn't bind: at an incidence of "
                f"{theta:g} degrees or less the angle is at least {90.0 - theta:g}"
            )
        if theta > _WARN_INCIDENCE_DEG:
            found.append(
                f"projector incidence up to {theta:g} degrees: errors triple at 75, "
                f"and at 84 only 0.6 of the surface is measured"
            )
        if object_radius_m is not None:
            found += self._depth_notes(object_radius_m)
        return tuple(found)

    def _depth_notes(self, radius: float) -> list[str]:
        """Compare the visible part of a ball with what is sharp."""
        reach = self.standoff_m + self.standoff_play_m + radius
        ends = {"camera": (self.camera_device(), math.sqrt(reach**2 - radius**2))}
        if self.light == "diverging":
            device = cast(PinholeModel, self.projector_device())
            ends["projector"] = (device, ends["camera"][1])
        return [
            f"the {role} is sharp to {device.range_m[1]:.2f} m; the rim of an object of "
            f"radius {radius * 1e3:.0f} mm can be {far:.2f} m away"
            for role, (device, far) in ends.items()
            if far > device.range_m[1]
        ]

    def requirements(
        self,
        mesh_centre: Sequence[float] | NDArray[np.float64],
        object_radius_m: float,
        *,
        max_projectors: int,
        tau_m: float,
        max_cameras: int | None = None,
        target: Target = "dominant",
        pattern: Pattern = "rings",
        dominant_coverage: float | None = None,
        coverage: float | None = None,
        min_reachable: float | None = None,
        accuracy_mm: float | None = None,
        up: str | None = None,
    ) -> Requirements:
        """Return what a plan of this rig must reach for one object.

        Args:
            mesh_centre: Centre of the object's bounding box in [m], shape (3,).
            object_radius_m: Radius of the ball about it that holds the object in [m].
            max_projectors: Projectors at most.
            tau_m: Distance within which a sample must have a measured point in [m].
            max_cameras: Cameras at most; None: as many as needed.
            target: `dominant` regions or the whole `surface`.
            pattern: `rings`, `dense` or `none`.
            dominant_coverage: Lit over reachable; None: what the rig says.
            coverage: Measured over reachable; None: what the rig says.
            min_reachable: Reachable over target; None: what the rig says.
            accuracy_mm: Largest s_N in [mm]; None: what the rig says.
            up: x, y, z, -x, -y or -z; None: what the rig says.

        Raises:
            InputError: If an argument isn't usable.
            InfeasibleLimitsError: If no position in the workspace is admissible.
        """
        given = self.table.requirements
        centre = _finite_centre(mesh_centre)
        _check_choice("target", target, ("dominant", "surface"))
        _check_choice("pattern", pattern, ("rings", "dense", "none"))
        _check_count("max_projectors", max_projectors)
        if max_cameras is not None:
            _check_count("max_cameras", max_cameras)
        _check_length("object_radius_m", object_radius_m)
        _check_length("tau_m", tau_m)
        workspace = self._workspace(centre, object_radius_m, up)
        _check_floor(workspace)
        return Requirements(
            max_projectors=max_projectors,
            max_cameras=max_cameras,
            coverage=_share("coverage", coverage, given.coverage),
            dominant_coverage=_share(
                "dominant_coverage", dominant_coverage, given.dominant_coverage
            ),
            min_reachable=_share("min_reachable", min_reachable, given.min_reachable),
            target=target,
            pattern=pattern,
            projector=self._projector_limits(),
            camera=self._camera_limits(),
            triangulation=self._triangulation_limits(accuracy_mm),
            check=self._check_limits(tau_m),
            workspace=workspace,
        )

    def _projector_limits(self) -> ProjectorLimits:
        limits = self.table.limits
        return ProjectorLimits(
            max_incidence=math.radians(limits.projector_max_incidence_deg),
            min_tangent_angle=math.radians(limits.min_tangent_angle_deg),
        )

    def _camera_limits(self) -> CameraLimits:
        limits = self.table.limits
        return CameraLimits(
            max_incidence=math.radians(limits.camera_max_incidence_deg),
            max_sample_distance_m=_metres(limits.max_sample_distance_mm),
        )

    def _triangulation_limits(self, accuracy_mm: float | None) -> TriangulationLimits:
        limits = self.table.limits
        if accuracy_mm is not None:
            _check_length("accuracy_mm", accuracy_mm)
        sigma_mm = limits.max_sigma_mm if accuracy_mm is None else accuracy_mm
        return TriangulationLimits(
            min_conditioning=limits.min_conditioning,
            noise_px=limits.noise_px,
            max_sigma_m=_metres(sigma_mm),
            min_ring_pitch_px=limits.min_ring_pitch_px,
            ring_sigma_m=_metres(limits.ring_sigma_mm),
            min_angle=_radians(limits.min_angle_deg),
            max_angle=_radians(limits.max_angle_deg),
        )

    def _check_limits(self, tau_m: float) -> CheckLimits:
        check = self.table.check
        return CheckLimits(
            max_rms_m=check.max_rms_mm * 1e-3,
            max_p95_m=check.max_p95_mm * 1e-3,
            max_bias_m=check.max_bias_mm * 1e-3,
            tau_m=tau_m,
            min_completeness=check.min_completeness,
            max_predicted_missing=check.max_predicted_missing,
        )

    def _workspace(
        self, centre: tuple[float, float, float], radius: float, up: str | None
    ) -> Workspace:
        table = self.table.workspace
        _check_choice("up", up or table.up, tuple(UP_VECTORS))
        up_vector = UP_VECTORS[up or table.up]
        axis = np.array(table.axis or up_vector, dtype=np.float64)
        shell = (
            self.standoff_m - self.standoff_play_m + radius,
            self.standoff_m + self.standoff_play_m + radius,
        )
        return Workspace(
            centre=centre,
            object_radius_m=float(radius),
            up=up_vector,
            axis=cast(
                tuple[float, float, float],
                tuple((axis / np.linalg.norm(axis)).tolist()),
            ),
            half_angle=math.radians(table.half_angle_deg or 180.0),
            projector_radius_m=shell,
            camera_radius_m=shell,
            floor_m=None if table.floor_mm is None else table.floor_mm * 1e-3,
            n_reference_projectors=self.n_reference_projectors,
            n_reference_cameras=self.n_reference_cameras,
            reference_ring_radius=self.outer_ring_radius(),
        )

    def to_document(self) -> dict[str, Any]:
        """Return the resolved rig for `plan.json`: plain values, metres, radians."""
        placement = self.table.placement
        return {
            "name": self.name,
            "description": self.table.description,
            "light": self.light,
            "projector": self._projector_document(),
            "camera": _pinhole_document(self.table.camera, self.camera_device()),
            "placement": {
                "standoff_m": self.standoff_m,
                "standoff_play_m": self.standoff_play_m,
                "n_candidate_projectors": placement.n_candidate_projectors,
                "n_candidate_cameras": placement.n_candidate_cameras,
                "n_reference_projectors": placement.n_reference_projectors,
                "n_reference_cameras": placement.n_reference_cameras,
            },
            "rings": {
                "tilt": self.ring_tilt_rad,
                "shift_m": self.ring_shift_m if self.light == "parallel" else None,
                "gap_m": self.ring_gap_m,
                "outer_radius": self.outer_ring_radius(),
            },
            "workspace": self.table.workspace.model_dump(mode="json"),
            "limits": self.table.limits.model_dump(mode="json"),
            "requirements": self.table.requirements.model_dump(mode="json"),
            "check": self.table.check.model_dump(mode="json"),
            "notes": list(self.notes()),
        }

    def _projector_document(self) -> dict[str, Any]:
        table, device = self._projector_table, self.projector_device()
        if isinstance(table, PinholeTable):
            return {
                **_pinhole_document(table, cast(PinholeModel, device)),
                "light": self.light,
                "pixel_pitch_m": None,
                "beam_radius": None,
            }
        beam = cast(ParallelModel, device)
        return {
            "name": table.name,
            "light": self.light,
            "K": None,
            "resolution": list(beam.resolution),
            "distortion": None,
            "range_m": list(beam.range_m),
            "pixel_pitch_m": beam.pixel_pitch_m,
            "beam_radius": beam.beam_radius,
            "figures": _figures(table),
            "sources": _sources(table),
        }


def _pinhole(table: PinholeTable, role: str) -> PinholeModel:
    width, height = table.resolution_px
    fx, fy = _focal_px(table)
    if table.principal_point_px is not None:
        cx, cy = table.principal_point_px
    else:
        cx = 0.5 * (width - 1)
        cy = optics.principal_row(height, table.vertical_offset_percent or 0.0)
    k1, k2, p1, p2, k3 = table.distortion
    return PinholeModel(
        np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        (width, height),
        _sharp_range(table, math.sqrt(fx * fy), role),
        (k1, k2, p1, p2, k3),
    )


def _focal_px(table: PinholeTable) -> tuple[float, float]:
    if table.focal_px is not None:
        return table.focal_px[0], table.focal_px[1]
    if table.throw_ratio is not None:
        f = optics.focal_length_from_throw(table.throw_ratio, table.resolution_px[0])
    else:
        f = optics.focal_length_px(
            cast(float, table.focal_mm) * 1e-3, cast(float, table.pixel_um) * 1e-6
        )
    return f, f


def _sharp_range(table: PinholeTable, focal: float, role: str) -> tuple[float, float]:
    """Meet of the distances the lens can be set to and the depth of field it has."""
    low, high = (x * 1e-3 for x in table.range_mm or (0.0, math.inf))
    if table.focus is not None:
        pixel_m = cast(float, table.pixel_um) * 1e-6
        try:
            near, far = optics.depth_of_field(
                focal * pixel_m,
                table.focus.f_number,
                table.focus.blur_px * pixel_m,
                table.focus.distance_mm * 1e-3,
            )
        except ValueError as error:
            raise RigError(f"[{role}.focus] {error}; correct distance_mm") from None
        low, high = max(low, near), min(high, far)
    if not low < high:
        raise RigError(
            f"[{role}] no distance is sharp: the depth of field ends at "
            f"{min(low, high):.3f} m where range_mm begins or before; refocus or stop down"
        )
    if not math.isfinite(high):
        raise RigError(
            f"[{role}] the depth of field has no far end; write range_mm with the "
            f"farthest distance that is wanted"
        )
    return low, high


def _parallel(table: ParallelTable) -> ParallelModel:
    width, height = table.resolution_px
    low, high = table.range_mm
    return ParallelModel(
        (width, height),
        table.pixel_pitch_mm * 1e-3,
        (low * 1e-3, high * 1e-3),
        _metres(table.beam_radius_mm),
    )


def _pinhole_document(table: PinholeTable, device: PinholeModel) -> dict[str, Any]:
    return {
        "name": table.name,
        "K": device.camera_matrix.tolist(),
        "resolution": list(device.resolution),
        "distortion": list(device.distortion),
        "range_m": list(device.range_m),
        "figures": _figures(table),
        "sources": _sources(table),
    }


def _figures(table: PinholeTable | ParallelTable) -> dict[str, Any]:
    return table.model_dump(
        mode="json", exclude={"name", "sources"}, exclude_none=True, exclude_unset=True
    )


def _sources(table: PinholeTable | ParallelTable) -> dict[str, str]:
    unsaid = "stated in the rig file, without a source"
    return {key: table.sources.get(key, unsaid) for key in table.figures()}


def _check_devices(rig: Rig) -> None:
    """Refuse a rig whose devices can't be sharp at the standoff."""
    devices = {"projector": rig.projector_device(), "camera": rig.camera_device()}
    for role, device in devices.items():
        low, high = device.range_m
        if not low <= rig.standoff_m <= high:
            raise RigError(
                f"rig {rig.name}: placement.standoff_mm = {rig.standoff_m * 1e3:g} lies "
                f"outside the distances at which the {role} is sharp, {low * 1e3:.0f} "
                f"to {high * 1e3:.0f} mm; move the standoff or refocus"
            )
    if not math.isfinite(rig.outer_ring_radius()):
        raise RigError(
            f"rig {rig.name}: rings.tilt_deg = {rig.table.rings.tilt_deg:g} turns the "
            f"ring axis 90 degrees or more away from an image corner; turn it less"
        )


def _check_floor(workspace: Workspace) -> None:
    if workspace.floor_m is None:
        return
    cosine = float(np.clip(np.dot(workspace.axis, workspace.up), -1.0, 1.0))
    steepest = max(0.0, math.acos(cosine) - workspace.half_angle)
    highest = workspace.projector_radius_m[0 if steepest > 0.5 * math.pi else 1]
    highest *= math.cos(steepest)
    if not highest >= workspace.floor_m:
        raise InfeasibleLimitsError(
            f"workspace.floor_mm = {workspace.floor_m * 1e3:g} lies above the highest "
            f"position that shell and cone allow, {highest * 1e3:.0f} mm over the "
            f"object's centre; lower the floor or widen the cone"
        )


def _finite_centre(
    centre: Sequence[float] | NDArray[np.float64],
) -> tuple[float, float, float]:
    values = np.asarray(centre, dtype=np.float64)
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise InputError(f"mesh_centre must be three finite numbers, got {centre}")
    x, y, z = values.tolist()
    return x, y, z


def _check_choice(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(f"{name} = {value!r} must be one of {', '.join(known)}")


def _check_count(name: str, value: int) -> None:
    if not value >= 1:
        raise InputError(f"{name} = {value} must be 1 or more")


def _check_length(name: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise InputError(f"{name} = {value} must be positive and finite")


def _share(name: str, value: float | None, default: float) -> float:
    share = default if value is None else float(value)
    if not 0.0 < share <= 1.0:
        raise InputError(f"{name} = {share} must be a share, over 0 and at most 1")
    return share


def _metres(millimetres: float | None) -> float | None:
    return None if millimetres is None else millimetres * 1e-3


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)
