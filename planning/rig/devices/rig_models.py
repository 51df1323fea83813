"""The devices of a rig: its tables, and the models that stand in them."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from geometry.devices import DeviceModel, ParallelModel, PinholeModel
from planning.model.devices.bodies import Mount
from planning.model.devices.heads import Head, Stations, Turntable
from planning.model.errors import RigError
from planning.rig.rig_tables import ParallelTable, PinholeTable, RigTable

from .models import Model, models_of, named
from .rig_heads import head_of, stations_of, turntable_of

Light = Literal["diverging", "parallel"]


@dataclass(frozen=True, eq=False)
class RigDevices:
    """What projectors and cameras a rig has.

    Attributes:
        table: As written.
        light: Of its projectors.
        folder: Where files that it names are looked for.
    """

    table: RigTable
    light: Light
    folder: Path = Path()

    @property
    def name(self) -> str:
        """Name of the rig."""
        return self.table.name

    @cached_property
    def projector_models(self) -> tuple[Model, ...]:
        """The models of projectors of this light, the first one first.

        Raises:
            RigError: If the rig has no projector for this light, or a list is none.
        """
        key = self.projector_key
        return models_of(self.table, key, self.projector_table)

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
        return pinhole_of(self.camera_models[0])

    @property
    def optics(
        self,
    ) -> tuple[tuple[PinholeModel | ParallelModel, ...], tuple[PinholeModel, ...]]:
        """Optics of all models of projectors, and of cameras."""
        lit = tuple(model.device for model in self.projector_models)
        return lit, tuple(pinhole_of(model) for model in self.camera_models)

    def optics_of(self, kind: str, model: str = "") -> DeviceModel:
        """Return the optics of a `projector` or a `camera` by its model's name.

        Raises:
            RigError: If the rig has no such model.
        """
        found = named(self.models(kind), model)
        if found is None:
            raise RigError(f"rig {self.name}: no {kind} is called {model!r}")
        return found.device

    @cached_property
    def head(self) -> Head | None:
        """The sensor head that its devices stand in; None: they stand alone."""
        return head_of(self.table, self.optics_of)

    @cached_property
    def turntable(self) -> Turntable | None:
        """The table that turns the part; its point counts from `Workspace.origin_m`."""
        return turntable_of(self.table)

    @property
    def stations(self) -> Stations | None:
        """How often the head is set down, and by what; None: it isn't carried."""
        return stations_of(self.table)

    def mounts(self) -> dict[str, Mount | None]:
        """Return `projector_mount` and `camera_mount` of `Workspace`."""
        tables = {"projector": self.projector_table, "camera": self.table.camera}
        return {f"{kind}_mount": Mount.of(each.mount) for kind, each in tables.items()}

    @property
    def projector_key(self) -> str:
        """Table of the projector of this light."""
        return "projector" if self.light == "diverging" else "parallel_projector"

    @property
    def projector_table(self) -> PinholeTable | ParallelTable:
        """The projector of this light as written."""
        key = self.projector_key
        table = getattr(self.table, key)
        if table is None:
            raise RigError(
                f"rig {self.name}: light '{self.light}' needs a table [{key}]; "
                f'add it, or lay the file over one that has it: base = "default"'
            )
        return table


def pinhole_of(model: Model) -> PinholeModel:
    """Return the optics of a model of cameras."""
    assert isinstance(model.device, PinholeModel)
    return model.device
