"""A calibration file: what was measured of devices after they were mounted.

JSON; metres and pixels, as in `plan.json`. Devices and values that it lacks stay as in
the plan.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator
from scipy.spatial.transform import Rotation

from geometry.files.file_content import file_content
from planning.model.errors import CalibrationError
from planning.model.files import reading
from planning.model.table_types import (
    Axis,
    Name,
    Table,
    WrittenPose,
    fault_words,
    read_pose,
)
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    DeviceCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.scanner import Scanner

_Matrix = Annotated[list[Axis], Field(min_length=3, max_length=3)]
_Lens = Annotated[list[float], Field(min_length=5, max_length=5)]
# Patterns and root discs are drawn for the planned poses; farther off another unit or
# another device is meant: share of the distance to the object's centre, and radians.
_FARTHEST = 0.3
_MOST_TURNED = np.deg2rad(30.0)
# Focal lengths of a projector may differ so much from those that its images are for.
_MOST_ZOOMED = 0.1


class _Device(Table):
    id: Name
    world_from_device: WrittenPose | None = None
    K: _Matrix | None = None
    distortion: _Lens | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.world_from_device is not None:
            read_pose(self.world_from_device, "world_from_device")
        if self.K is not None:
            _check_matrix(np.array(self.K))
        if self.world_from_device is None and self.K is None and not self.distortion:
            raise ValueError(
                f"{self.id} has no measured value; write world_from_device, K or "
                f"distortion, or leave the device out"
            )
        return self


class _File(Table):
    format: Literal["ringrig-calibration"]
    version: Literal[1]
    devices: Annotated[list[_Device], Field(min_length=1)]


def _check_matrix(matrix: Array) -> None:
    plain = matrix.copy()
    plain[[0, 1, 0, 1], [0, 1, 2, 2]] = 0.0
    if plain.tolist() != [[0.0] * 3, [0.0] * 3, [0.0, 0.0, 1.0]]:
        raise ValueError(
            f"K = {matrix.tolist()} must be [fx, 0, cx], [0, fy, cy], [0, 0, 1] in px"
        )
    if not np.all(np.diag(matrix) > 0.0):
        raise ValueError(f"K: focal lengths {np.diag(matrix)[:2]} px must be positive")


def calibrated(plan: Scanner, path: Path) -> Scanner:
    """Return a plan with its devices as a calibration file says they are.

    Raises:
        CalibrationError: If the file can't be read, or doesn't fit the plan.
    """
    planned = {device.id: device for device in (*plan.projectors, *plan.cameras)}
    mounted: dict[str, DeviceCalibration] = {}
    for device in _read(path).devices:
        if device.id not in planned:
            raise CalibrationError(
                f"{path}: device {device.id!r} isn't in the plan, which has "
                f"{', '.join(planned)}"
            )
        if device.id in mounted:
            raise CalibrationError(f"{path}: device {device.id!r} twice; keep one")
        try:
            mounted[device.id] = _mounted(device, planned[device.id], plan)
        except ValueError as error:
            raise CalibrationError(f"{path}: {device.id}: {error}") from None
    return replace(
        plan,
        cameras=tuple(mounted.get(one.id, one) for one in plan.cameras),
        projectors=tuple(mounted.get(one.id, one) for one in plan.projectors),
    )


def _mounted(
    device: _Device, planned: DeviceCalibration, plan: Scanner
) -> DeviceCalibration:
    pose = _measured_pose(device, planned, plan)
    if isinstance(planned, ProjectorCalibration):
        _require_drawn(device, planned)
        # The rings move with their projector.
        ring = np.linalg.inv(planned.world_from_device) @ planned.world_from_ring
        mounted = replace(planned, world_from_device=pose, world_from_ring=pose @ ring)
        if device.K is None:
            return mounted
        return replace(mounted, matrix=np.array(device.K), drawn_for=planned.matrix)
    assert isinstance(planned, CameraCalibration)
    return replace(
        planned,
        world_from_device=pose,
        matrix=planned.matrix if device.K is None else np.array(device.K),
        distortion=tuple(device.distortion or planned.distortion),
    )


def _require_drawn(device: _Device, planned: ProjectorCalibration) -> None:
    """Refuse optics of a projector whose rings the decoder wouldn't know."""
    if device.K is not None and planned.light.name != "diverging":
        raise ValueError(
            f"K = {device.K} of a projector of parallel light; leave it out: its "
            f"pixels are {1e3 / planned.matrix[0, 0]:g} mm apart"
        )
    if device.K is not None and not np.allclose(
        np.diag(device.K)[:2], np.diag(planned.matrix)[:2], rtol=_MOST_ZOOMED
    ):
        raise ValueError(
            f"K = {device.K} isn't near the one that its patterns are drawn for "
            f"({planned.matrix.tolist()}), within {_MOST_ZOOMED:.0%}; put the measured "
            f"optics into the rig file, plan, and project those"
        )
    if device.distortion is not None and any(device.distortion):
        raise ValueError(
            f"distortion = {device.distortion} of a projector isn't known to the "
            f"decoder; correct the images that it shows for its lens"
        )


def _measured_pose(device: _Device, planned: DeviceCalibration, plan: Scanner) -> Array:
    """Return where a device was measured; where it should stand if it wasn't."""
    if device.world_from_device is None:
        return planned.world_from_device
    measured = read_pose(device.world_from_device, "world_from_device")
    away = float(np.linalg.norm(measured[:3, 3] - planned.centre))
    reach = float(np.linalg.norm(planned.centre - plan.mesh.centre))
    if not away <= _FARTHEST * reach:
        raise ValueError(
            f"stands {away:.3g} m from its place in the plan, at most "
            f"{_FARTHEST * reach:.3g} m; write metres in the axes of the mesh, or plan "
            f"with the device as it stands"
        )
    turn = measured[:3, :3].T @ planned.world_from_device[:3, :3]
    angle = float(Rotation.from_matrix(turn).magnitude())
    if not angle <= _MOST_TURNED:
        raise ValueError(
            f"is turned by {np.degrees(angle):.1f} degrees from the plan, at most "
            f"{np.degrees(_MOST_TURNED):.0f}; +x is right, +y down, +z along the axis"
        )
    return measured


def _read(path: Path) -> _File:
    with reading(path, CalibrationError):
        content = file_content(path)
    try:
        return _File.model_validate(json.loads(content))
    except ValidationError as error:
        fault = fault_words(
            error.errors(include_url=False)[0],
            unknown="see docs/use/captures.md",
            remedy="write such a value",
        )
        raise CalibrationError(f"{path}: {fault}") from None
    except (ValueError, RecursionError) as error:
        raise CalibrationError(
            f"{path}: not JSON ({error}); correct that place"
        ) from None
