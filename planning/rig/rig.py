"""The rig: which devices there are, where they may stand, and what counts as measured.

A rig is a preset or a TOML file (`docs/reference/rig-files.md`); `load_rig` gives the
devices in pixels, metres and radians and the requirements that a plan is held to.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from planning.model.bodies import Mount
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.obstacles import Obstacle
from planning.model.requirements import Requirements, Workspace
from planning.scene.lights import light_of

from .existing_devices import build_existing, check_existing
from .lens_fit import LensFit, unsharp
from .models import Model, models_of, most_of, stock_of
from .object_size import ObjectSize
from .obstacle_tables import obstacles_of
from .rig_devices import (
    device_document,
    device_notes,
    drawn_edges,
    edge_notes,
    light_budget,
)
from .rig_requirements import build_requirements, build_workspace, limit_notes
from .rig_tables import MountingTable, ParallelTable, PinholeTable, RigTable, RingsTable
from .toml.rig_files import changed, read_rig, rig_folder
from .wishes import Wishes

Light = Literal["diverging", "parallel"]


def load_rig(
    name: str | Path | Mapping[str, Any] = "default",
    light: Light | None = None,
    *,
    checked: bool = True,
) -> "Rig":
    """Load a preset by its name, a rig file by its path, or tables as it has them.

    None: the rig's light. Unless `checked`, devices needn't be sharp at the standoff.

    Raises:
        RigError: One line for each fault: where it is, the value, the rule, what to do.
        InfeasibleLimitsError: If a device isn't sharp at the standoff.
    """
    if light not in (None, "diverging", "parallel"):
        raise RigError(f"light = {light!r} must be 'diverging' or 'parallel'")
    table = read_rig(name)
    rig = Rig(table, light or table.light, rig_folder(name))
    if checked:
        _check_devices(rig)
    return rig


@dataclass(frozen=True, eq=False)
class Rig:
    """Devices, placement and limits of one rig, in metres and radians.

    The table is as written, in millimetres and degrees; files that it names are looked
    for in the folder.
    """

    table: RigTable
    light: Light
    folder: Path = Path()

    def replace(self, **tables: Any) -> "Rig":  # noqa: ANN401 - as a file has them
        """Return a rig with tables laid over it: ``placement={"standoff_mm": 900}``.

        Raises:
            RigError: As of `load_rig`.
        """
        rig = replace(self, table=changed(self.table, tables))
        _check_devices(rig)
        return rig

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
    def ring_offset(self) -> float:
        """Tilt of the ring axis [rad]; in parallel light its shift on the panel [m]."""
        tilt = math.radians(self.table.rings.tilt_deg)
        light = light_of(self.projector_device())
        return light.ring_offset(tilt, self.standoff_m)

    @property
    def rings(self) -> RingsTable:
        """The ring pattern as written."""
        return self.table.rings

    @property
    def ring_gap_m(self) -> float | None:
        """Distance of neighbouring rings at the standoff in [m]; None: not fixed."""
        gap = self.rings.gap_mm
        return None if gap is None else gap * 1e-3

    @property
    def n_projector_poses(self) -> int:
        """Projector poses offered to the cover, or that define what is reachable."""
        placement = self.table.placement
        return max(placement.n_candidate_projectors, placement.n_reference_projectors)

    @property
    def n_camera_poses(self) -> int:
        """Camera poses offered to the cover, or that define what is reachable."""
        placement = self.table.placement
        return max(placement.n_candidate_cameras, placement.n_reference_cameras)

    @cached_property
    def projector_models(self) -> tuple[Model, ...]:
        """The models of projectors of this light, the first one first.

        Raises:
            RigError: If the rig has no projector for this light, or a list is none.
        """
        key = self.projector_key
        return models_of(self.table, key, self._projector_table)

    @cached_property
    def camera_models(self) -> tuple[Model, ...]:
        """The models of cameras, the first one first.

        Raises:
            RigError: As of projectors.
        """
        return models_of(self.table, "camera", self.table.camera)

    def models(self, kind: str) -> tuple[Model, ...]:
        """Return the models of a `projector` or a `camera`."""
        return self.projector_models if kind == "projector" else self.camera_models

    def projector_device(self) -> PinholeModel | ParallelModel:
        """Return the optics of the first model of projectors."""
        return self.projector_models[0].device

    def camera_device(self) -> PinholeModel:
        """Return the optics of the first model of cameras."""
        return _pinhole(self.camera_models[0])

    @property
    def optics(
        self,
    ) -> tuple[tuple[PinholeModel | ParallelModel, ...], tuple[PinholeModel, ...]]:
        """Optics of all models of projectors, and of cameras."""
        lit = tuple(model.device for model in self.projector_models)
        return lit, tuple(_pinhole(model) for model in self.camera_models)

    def mounts(self) -> dict[str, Mount | None]:
        """Return `projector_mount` and `camera_mount` of `Workspace`."""
        tables = {"projector": self._projector_table, "camera": self.table.camera}
        return {f"{kind}_mount": Mount.of(each.mount) for kind, each in tables.items()}

    def fit(self, model: Model, size: ObjectSize) -> LensFit:
        """Return how a model suits an object, see `LensFit`."""
        role = model.role.replace(self.projector_key, "projector")
        stands = self.standoff_m, self.standoff_play_m
        return LensFit(role, model.table, model.device, *stands, size)

    def fits(self, mesh: TriangleMesh) -> tuple[LensFit, ...]:
        """Return how cameras and projectors suit an object."""
        size = ObjectSize.of(mesh)
        return tuple(self.fit(model, size) for model in self._all_models)

    def outer_ring_radius(self) -> float:
        """Return the outermost ring, wherever the ring axis is turned or shifted to."""
        return max(
            light_of(model.device).image_ring(self.ring_offset)
            for model in self.projector_models
        )

    def notes(self) -> tuple[str, ...]:
        """Return what a user should know of limits and devices, a sentence each."""
        lamps, eyes = self.projector_models, self.camera_models
        notes = [n for m in (*lamps, *eyes) for n in device_notes(m.role, m.table)]
        for lamp, eye in product(lamps, eyes):
            drawn = drawn_edges(lamp.table, lamp.device)
            notes += edge_notes(drawn, lamp.device, _pinhole(eye), self.standoff_m)
        return (*limit_notes(self.table.limits), *notes)

    def requirements(
        self,
        mesh_centre: Sequence[float] | NDArray[np.float64],
        object_radius_m: float,
        wishes: Wishes,
        *,
        tau_m: float,
    ) -> Requirements:
        """Return what a plan of this rig must reach for one object.

        Centre and radius are those of the smallest ball that holds it [m]; within
        `tau_m` [m] a sample must have a measured point.

        Raises:
            InputError: If an argument isn't usable.
            InfeasibleLimitsError: If no position in the workspace is admissible, or
                more devices stand already than are allowed.
        """
        middle_m = self.standoff_m + object_radius_m

        def overflow(kind: str) -> bool:
            devices = [model.device for model in self.models(kind)]
            return not all(d.holds_ball(object_radius_m, middle_m) for d in devices)

        workspace = build_workspace(
            self.table,
            self.outer_ring_radius(),
            mesh_centre,
            object_radius_m,
            wishes.up,
            (overflow("projector"), overflow("camera")),
        )
        workspace = replace(workspace, **self.mounts())
        kinds = {kind: self.models(kind) for kind in ("projector", "camera")}
        wishes = replace(
            wishes,
            max_projectors=most_of(kinds["projector"], wishes.max_projectors),
            max_cameras=most_of(kinds["camera"], wishes.max_cameras),
        )
        drawn = drawn_edges(self._projector_table, self.projector_device())
        light = light_budget(self.table, self._projector_table, self.camera_device())
        required = build_requirements(
            self.table, wishes, workspace, tau_m=tau_m, drawn_edges=drawn, light=light
        )
        existing = build_existing(self.table.existing, workspace, kinds)
        stock = tuple(s for kind, of in kinds.items() for s in stock_of(kind, of))
        required = replace(required, existing=existing, stock=stock)
        check_existing(required)
        return required

    def obstacles(
        self, workspace: Workspace, mesh: TriangleMesh
    ) -> tuple[Obstacle, ...]:
        """Return what stands about an object, and isn't a device.

        Raises:
            RigError: If the file of an obstacle can't be read.
            InfeasibleLimitsError: If a keep-out zone that blocks holds the object.
        """
        table = self.table
        return obstacles_of(
            table.obstacle, table.workspace, workspace, mesh, self.folder
        )

    def to_document(self) -> dict[str, Any]:
        """Return the resolved rig for `plan.json`: plain values, metres, radians.

        Tables whose keys end in _mm or _deg are as written in the rig file.
        """
        table = self.table
        listed: dict[str, Any] = {
            key: [entry.to_document() for entry in getattr(table, key)]
            for key in ("existing", "obstacle")
            if getattr(table, key)
        }
        if table.mounting != MountingTable():
            listed["mounting"] = table.mounting.model_dump()
        if table.photometry is not None:
            listed["photometry"] = table.photometry.model_dump(exclude_none=True)
        if table.placement.clearance_mm:
            listed["clearance_m"] = table.placement.clearance_mm * 1e-3
        for kind in ("projector", "camera"):
            if more := self.models(kind)[1:]:
                listed[f"more_{kind}s"] = [self._document_of(model) for model in more]
        return {
            "name": self.name,
            "description": table.description,
            "light": self.light,
            "projector": self._document_of(self.projector_models[0]),
            "camera": self._document_of(self.camera_models[0]),
            "standoff_m": self.standoff_m,
            "standoff_play_m": self.standoff_play_m,
            "n_candidate_projectors": table.placement.n_candidate_projectors,
            "n_candidate_cameras": table.placement.n_candidate_cameras,
            "rings": {
                "tilt": None,
                "shift_m": None,
                light_of(self.projector_device()).offset_key: self.ring_offset,
                "gap_m": self.ring_gap_m,
                "spacing": self.rings.spacing,
                "axis": self.rings.axis,
                "margin_m": self.rings.margin_mm * 1e-3,
                "outer_radius": self.outer_ring_radius(),
            },
            "workspace": table.workspace.to_document(),
            "limits": table.limits.model_dump(mode="json"),
            "calibration": table.calibration.model_dump(mode="json"),
            "requirements": table.requirements.model_dump(mode="json"),
            "check": table.check.model_dump(mode="json"),
            "notes": list(self.notes()),
            **listed,
        }

    @property
    def _all_models(self) -> tuple[Model, ...]:
        return (*self.camera_models, *self.projector_models)

    def _document_of(self, model: Model) -> dict[str, Any]:
        lit = {"light": self.light} if model in self.projector_models else {}
        return {**device_document(model.table, model.device), **lit}

    @property
    def projector_key(self) -> str:
        """Table of the projector of this light."""
        return "projector" if self.light == "diverging" else "parallel_projector"

    @property
    def _projector_table(self) -> PinholeTable | ParallelTable:
        """The projector of this light as written."""
        key = self.projector_key
        table = getattr(self.table, key)
        if table is None:
            raise RigError(
                f"rig {self.name}: light '{self.light}' needs a table [{key}]; "
                f'add it, or lay the file over one that has it: base = "default"'
            )
        return table


def _pinhole(model: Model) -> PinholeModel:
    assert isinstance(model.device, PinholeModel)
    return model.device


def _check_devices(rig: Rig) -> None:
    """Refuse a rig whose devices can't be sharp at the standoff."""
    models = (*rig.projector_models, *rig.camera_models)
    blurred = [
        f"rig {rig.name}: {unsharp(rig.fit(model, ObjectSize.ball(0.0)))}"
        for model in models
        if not model.device.range_m[0] <= rig.standoff_m <= model.device.range_m[1]
    ]
    if blurred:
        raise InfeasibleLimitsError("\n".join(blurred))
    if not math.isfinite(rig.outer_ring_radius()):
        raise RigError(
            f"rig {rig.name}: rings.tilt_deg = {rig.table.rings.tilt_deg:g} turns the "
            f"ring axis 90 degrees or more away from an image corner; turn it less"
        )
