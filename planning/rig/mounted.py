"""Devices that are bolted already, with their poses: from a CSV file, or of a plan.

Places are in the axes of the mesh file, as the summary of a plan prints them.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from planning.model.devices.bodies import Existing
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InputError
from planning.model.plan import RigPlan
from planning.model.requirements import Requirements, Workspace
from planning.model.surface import Surface
from planning.model.table_types import fault_words
from planning.scene.placed_bodies import Device, kind_of
from planning.scene.ranges.csv_rows import CsvRow, read_csv

from .devices.models import Model, named
from .existing_tables import ExistingTable
from .rig import Rig
from .rig_tables import check_names

_POSITION = ("x_mm", "y_mm", "z_mm")
# Columns of each way to say where a device looks, and those that may go with it.
_AIM = ("aim_x_mm", "aim_y_mm", "aim_z_mm")
_ANGLES = ("pan_deg", "tilt_deg")
_QUATERNION = ("qw", "qx", "qy", "qz")
_WAYS = {_AIM: ("roll_deg",), _ANGLES: ("roll_deg",), _QUATERNION: ()}
REQUIRED = ("name", "kind", *_POSITION)
OPTIONAL = (*_AIM, *_ANGLES, "roll_deg", *_QUATERNION, "model", "frame")
# How far a written quaternion may be from length 1.
_UNIT = 1e-3


@dataclass(frozen=True, eq=False)
class Mounted:
    """Devices that stay where they are.

    Attributes:
        path: Where their poses are from.
        sha256: Of that file.
        tables: Their poses, one entry of `[[existing]]` each.
        rings: Ring frame and radii of projectors whose rings stay, by name.
        plan: Whose devices these all are; None: of no plan.
    """

    path: str
    sha256: str
    tables: tuple[ExistingTable, ...]
    rings: Mapping[str, PlannedProjector] = field(default_factory=dict)
    plan: RigPlan | None = None

    def count(self, kind: str) -> int:
        """Return how many are a `projector` or a `camera`."""
        return sum(table.kind == kind for table in self.tables)

    def on(self, rig: Rig) -> Rig:
        """Return the rig with these among its existing devices, these first.

        One that the rig file knows by kind and name stands where it does here, in the
        body that the rig file gives it.

        Raises:
            InputError: If a name is of devices of both kinds.
        """
        known = {(table.kind, table.name): table for table in rig.table.existing}
        tables = [
            table.model_copy(
                update={"body": old.body, "model": table.model or old.model}
            )
            if (old := known.pop((table.kind, table.name), None))
            else table
            for table in self.tables
        ]
        tables += known.values()
        try:
            check_names("existing", [table.name for table in tables])
        except ValueError as error:
            raise InputError(f"{self.path} and rig {rig.name}: {error}") from None
        return replace(rig, table=rig.table.model_copy(update={"existing": tables}))

    def reference(self, workspace: Workspace) -> Surface | None:
        """Return what holds the reference poses of their plan, if they are of this one.

        Poses that it may offer as well define what is reachable as they did there.
        """
        if self.plan is None:
            return None
        # What only becomes known of the poses and their rings, as they are.
        same = replace(
            self.plan.requirements.workspace,
            n_reference_projectors=workspace.n_reference_projectors,
            n_reference_cameras=workspace.n_reference_cameras,
            reference_ring_radius=workspace.reference_ring_radius,
        )
        return self.plan.surface if same == workspace else None

    def with_rings(self, required: Requirements) -> Requirements:
        """Return requirements whose existing projectors have the rings that stay."""

        def ringed(device: Existing) -> Existing:
            kept = self.rings.get(device.name)
            if kept is None or device.kind != "projector":
                return device
            rows = tuple(tuple(row) for row in kept.world_from_ring.tolist())
            radii = tuple(kept.ring_radii.tolist())
            return replace(device, world_from_ring=rows, ring_radii=radii)

        return replace(required, existing=tuple(map(ringed, required.existing)))


def read_mounted(
    path: str | Path, rig: Rig, only: Sequence[str] | None = None
) -> Mounted:
    """Read poses from a CSV file, or the devices of a `plan.json` with their rings.

    Args:
        path: The file, or the folder of a plan; `docs/use/evaluate.md` has the columns.
        rig: Whose optics a plan's devices must have.
        only: Names of the devices that are taken; None: all.

    Raises:
        InputError: If the file can't be used; of a CSV file it names the line.
    """
    if Path(path).is_dir():
        path = Path(path) / "plan.json"
    if Path(path).suffix.lower() == ".json":
        return _of_plan(Path(path), rig, only)
    table = read_csv(path, REQUIRED, OPTIONAL)
    lines: dict[str, int] = {}
    for row in table.rows:
        name = row.cells["name"]
        if name in lines:
            raise InputError(
                f"{row.where}: {name!r} is on line {lines[name]} already; every device "
                f"has a name of its own"
            )
        lines[name] = row.line
    chosen = _chosen(list(lines), only, table.path)
    tables = (_read_row(row) for row in table.rows if row.cells["name"] in chosen)
    return Mounted(table.path, table.sha256, tuple(tables))


def split_fixed(words: str) -> tuple[str, list[str] | None]:
    """Return the path and the names of `plan.json:P1,C1`; None: no name is given."""
    path, _, names = words.rpartition(":")
    if not path or Path(words).exists():
        return words, None
    return path, [name.strip() for name in names.split(",")]


def _read_row(row: CsvRow) -> ExistingTable:
    """One device; exactly one way says where it looks."""
    if not row.has("name"):
        raise InputError(f"{row.where}: name is empty; every device has one")
    if row.has("frame"):
        raise InputError(
            f"{row.where}: {row.cells['name']!r} is in another frame "
            f"({row.cells['frame']}), must be in the axes of the mesh file; export "
            f"without --frame"
        )
    values: dict[str, Any] = {name: row.cells[name] for name in ("name", "kind")}
    if row.has("model"):
        values["model"] = row.cells["model"]
    position = [row.number(name) for name in _POSITION]
    begun = [way for way in _WAYS if any(row.has(name) for name in way)]
    if len(begun) != 1:
        kinds = ", or ".join(" ".join(way) for way in _WAYS)
        raise InputError(
            f"{row.where}: {row.cells['name']!r} {'says twice' if begun else 'lacks'} "
            f"where it looks; fill in {kinds}"
        )
    (way,) = begun
    if missing := [name for name in way if not row.has(name)]:
        raise InputError(f"{row.where}: {', '.join(missing)} is empty; fill it in")
    if row.has("roll_deg") and "roll_deg" not in _WAYS[way]:
        raise InputError(f"{row.where}: roll_deg beside a quaternion; keep one of them")
    figures = [row.number(name) for name in way]
    if way == _QUATERNION:
        values["pose_mm"] = _pose_mm(figures, position, row.where)
    else:
        values["position_mm"] = position
        angles = dict(zip(way, figures, strict=True))
        values |= {"aim_mm": figures} if way == _AIM else angles
        values["roll_deg"] = row.number("roll_deg") if row.has("roll_deg") else 0.0
    try:
        return ExistingTable(origin="mesh", **values)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        words = fault_words(fault, unknown="take it out", remedy="correct it")
        raise InputError(f"{row.where}: {words}") from None


def _pose_mm(
    quaternion: list[float], position: list[float], where: str
) -> list[list[float]]:
    """The pose of a quaternion (w, x, y, z) from device to mesh axes."""
    length = math.hypot(*quaternion)
    if not abs(length - 1.0) <= _UNIT:
        raise InputError(
            f"{where}: qw, qx, qy, qz has length {length:.6g}, must be 1; write more "
            f"digits"
        )
    turn = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    return _written(turn, np.array(position))


def _written(turn: np.ndarray, position_mm: np.ndarray) -> list[list[float]]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, position_mm
    return pose.tolist()


def _of_plan(path: Path, rig: Rig, only: Sequence[str] | None) -> Mounted:
    """Devices of a plan by their ids; under their names, where they stood already."""
    plan = RigPlan.load(path)
    if (stations := plan.document.stations) is not None and not stations.cross:
        raise InputError(
            f"{path}: its devices measure by {len(stations.stations)} stations "
            f"({stations.kind}), and devices that stand are evaluated as pairs of all; "
            f"`plan verify` checks this plan, a CSV file of one station is evaluated"
        )
    devices = {device.id: device for device in (*plan.projectors, *plan.cameras)}
    chosen = _chosen(list(devices), only, str(path))
    spaced = {r.id for r in plan.document.projectors if r.rings is not None}
    tables, rings = [], {}
    for name, device in devices.items():
        if name not in chosen:
            continue
        _check_optics(device, rig, str(path))
        _check_body(device, rig, str(path))
        pose, called = device.world_from_device, device.existing or name
        tables.append(
            ExistingTable(
                name=called,
                kind="camera" if isinstance(device, PlannedCamera) else "projector",
                pose_mm=_written(pose[:3, :3], 1e3 * pose[:3, 3]),
                origin="mesh",
                model=device.model or None,
            )
        )
        if isinstance(device, PlannedProjector) and name in spaced:
            rings[called] = device
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    # Without one of its devices, it isn't this plan.
    whole = plan if len(tables) == len(devices) else None
    return Mounted(str(path), digest, tuple(tables), rings, whole)


def _chosen(names: list[str], only: Sequence[str] | None, path: str) -> Sequence[str]:
    if not names:
        raise InputError(f"{path}: holds no device")
    for name in only or ():
        if name not in names:
            raise InputError(
                f"{path}: has no device {name!r}; its devices are {', '.join(names)}"
            )
    return names if only is None else only


def _check_optics(device: Device, rig: Rig, path: str) -> None:
    """Refuse a device that isn't of a model of the rig."""
    kind, model = kind_of(device), _model_of(device, rig, path)
    theirs, ours = device.device.to_document(), model.device.to_document()
    for key in ours:
        # A plan keeps no distortion of projectors.
        if (kind, key) == ("projector", "distortion"):
            continue
        one, other = theirs.get(key), ours.get(key)
        same = one == other
        if not same and None not in (one, other):
            a, b = np.array(one, dtype=float), np.array(other, dtype=float)
            same = a.shape == b.shape and np.allclose(a, b, rtol=1e-9, atol=0.0)
        if not same:
            raise InputError(
                f"{path}: {device.id} has {key} = {one}, a {kind} of rig "
                f"{rig.name!r} {other}; give --rig the file that the plan was made with"
            )


def _model_of(device: Device, rig: Rig, path: str) -> Model:
    models = rig.models(kind_of(device))
    if (model := named(models, device.model)) is not None:
        return model
    known = ", ".join(repr(model.table.name) for model in models)
    raise InputError(
        f"{path}: {device.id} is of the model {device.model!r}, rig {rig.name!r} has "
        f"{known}; give --rig the file that the plan was made with"
    )


def _check_body(device: Device, rig: Rig, path: str) -> None:
    """Refuse a device whose housing would be lost; another one may be measured."""
    if device.body is None:
        return
    kind = kind_of(device)
    # One that the rig file knows by name has the body that it has there.
    if device.existing and any(
        (table.kind, table.name) == (kind, device.existing)
        for table in rig.table.existing
    ):
        return
    if _model_of(device, rig, path).body is None:
        raise InputError(
            f"{path}: {device.id} has a housing, a {kind} of rig {rig.name!r} none; "
            f"give --rig the file that the plan was made with"
        )
