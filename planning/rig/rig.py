"""The rig: which devices there are, where they may stand, and what counts as measured.

A rig is a preset or a TOML file (`docs/reference/rig-files.md`); `load_rig` gives the
devices in pixels, metres and radians and the requirements that a plan is held to.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from planning.model.devices.bodies import Obstacle
from planning.model.document.head_records import carried_records
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.requirements import Requirements, Workspace
from planning.scene.lights import light_of

from .devices.edge_optics import edge_notes
from .devices.existing_devices import build_existing, check_existing
from .devices.lens_fit import LensFit, unsharp
from .devices.models import Model, most_of, stock_of
from .devices.rig_devices import (
    device_document,
    device_notes,
    drawn_edges,
    light_budget,
)
from .devices.rig_heads import head_faults, head_notes, model_faults
from .devices.rig_models import Light, RigDevices, pinhole_of
from .object_size import ObjectSize
from .obstacle_tables import obstacles_of
from .rig_requirements import build_requirements, build_workspace, limit_notes
from .rig_tables import MountingTable
from .tables.pattern_tables import DenseTable, RingsTable
from .toml.rig_files import changed, read_rig, rig_folder
from .wishes import Wishes


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
class Rig(RigDevices):
    """Devices, placement and limits of one rig, in metres and radians.

    The table is as written, in millimetres and degrees; files that it names are looked
    for in the folder.
    """

    def replace(self, **tables: Any) -> "Rig":  # noqa: ANN401 - as a file has them
        """Return a rig with tables laid over it: ``placement={"standoff_mm": 900}``.

        Raises:
            RigError: As of `load_rig`.
        """
        rig = replace(self, table=changed(self.table, tables))
        _check_devices(rig)
        return rig

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

    def fit(self, model: Model, size: ObjectSize) -> LensFit:
        """Return how a model suits an object, see `LensFit`."""
        role = model.role.replace(self.projector_key, "projector")
        stands = self.standoff_m, self.standoff_play_m
        return LensFit(role, model.table, model.device, *stands, size)

    def fits(self, mesh: TriangleMesh) -> tuple[LensFit, ...]:
        """Return how cameras and projectors suit an object."""
        size = ObjectSize.of(mesh)
        return tuple(
            self.fit(model, size)
            for model in (*self.camera_models, *self.projector_models)
        )

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
            notes += edge_notes(drawn, lamp.device, pinhole_of(eye), self.standoff_m)
        if self.head is not None:
            notes += head_notes(self.head, self.optics_of)
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
        drawn = drawn_edges(self.projector_table, self.projector_device())
        light = light_budget(self.table, self.projector_table, self.camera_device())
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
        if table.dense != DenseTable():
            listed["dense"] = table.dense.model_dump()
        if table.mounting != MountingTable():
            listed["mounting"] = table.mounting.model_dump()
        if table.photometry is not None:
            listed["photometry"] = table.photometry.model_dump(exclude_none=True)
        if table.placement.clearance_mm:
            listed["clearance_m"] = table.placement.clearance_mm * 1e-3
        for key, value in carried_records(self.head, self.turntable, self.stations):
            listed[key] = value
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
            "n_candidate_projectors": self.n_projector_poses,
            "n_candidate_cameras": self.n_camera_poses,
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

    def _document_of(self, model: Model) -> dict[str, Any]:
        lit = {"light": self.light} if model in self.projector_models else {}
        return {**device_document(model.table, model.device), **lit}


def _check_devices(rig: Rig) -> None:
    """Refuse a rig whose devices can't be sharp at the standoff."""
    faults = model_faults(rig.table, rig.models)
    if not faults and rig.head is not None:
        faults = [*head_faults(rig.head, rig.optics_of)]
    if faults:
        raise RigError("\n".join(f"rig {rig.name}: {fault}" for fault in faults))
    models = (*rig.projector_models, *rig.camera_models)
    # The standoff of a head counts from its origin, and its volume is looked at above.
    blurred = [
        f"rig {rig.name}: {unsharp(rig.fit(model, ObjectSize.ball(0.0)))}"
        for model in models
        if rig.head is None
        and not model.device.range_m[0] <= rig.standoff_m <= model.device.range_m[1]
    ]
    if blurred:
        raise InfeasibleLimitsError("\n".join(blurred))
    if not math.isfinite(rig.outer_ring_radius()):
        raise RigError(
            f"rig {rig.name}: rings.tilt_deg = {rig.table.rings.tilt_deg:g} turns the "
            f"ring axis 90 degrees or more away from an image corner; turn it less"
        )
