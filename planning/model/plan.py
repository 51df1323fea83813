"""The plan: a JSON document with typed views of its devices and requirements.

The document (format `ringrig-plan`, version 1) is what scripts rely on; the views here
are what the checks, the reconstruction, the drawing and the exports read.
"""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel

from .bodies import Body
from .errors import PlanFileError
from .files import sha256_of, write_together
from .planned import PlannedCamera, PlannedProjector
from .requirements import Requirements
from .surface import Surface

FORMAT = "ringrig-plan"
VERSION = 1

_SECTIONS = (
    "units",
    "seed",
    "truncated",
    "meshes",
    "surface",
    "rig",
    "requirements",
    "regions",
    "projectors",
    "cameras",
    "coverage",
    "marginal",
    "certificates",
    "baselines",
    "cost",
    "members",
    "reconstruction",
    "timings_s",
)


@dataclass(frozen=True, eq=False)
class RigPlan:
    """A plan, as written.

    Attributes:
        document: The JSON document.
        surface: The surface that its claims speak about.
    """

    document: dict[str, Any]
    surface: Surface

    @cached_property
    def requirements(self) -> Requirements:
        """What was asked of the plan."""
        return Requirements.from_document(self.document["requirements"])

    @cached_property
    def projectors(self) -> tuple[PlannedProjector, ...]:
        """The projectors, in the order of their ids."""
        return tuple(_projector(entry) for entry in self.document["projectors"])

    @cached_property
    def cameras(self) -> tuple[PlannedCamera, ...]:
        """The cameras, in the order of their ids."""
        return tuple(_camera(entry) for entry in self.document["cameras"])

    @property
    def coverage(self) -> dict[str, Any]:
        """Areas of the surface and the target, and what isn't covered, by cause."""
        return self.document["coverage"]

    def save(self, path: str | Path) -> None:
        """Write the plan, and `surface.npz` beside it.

        Args:
            path: Where `plan.json` goes; its folder is made if need be.

        Raises:
            OSError: If the folder can't be written.
        """
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        surface = path.parent / self.document["surface"]["path"]
        write_together(
            {
                surface: lambda file: file.write(self.surface.content),
                path: lambda file: file.write(self.to_json().encode()),
            }
        )

    def to_json(self) -> str:
        """Return the document as JSON text."""
        # A surface that was read may be packed otherwise by this numpy.
        packed = self.document["surface"] | {"sha256": self.surface.sha256()}
        document = self.document | {"surface": packed}
        return json.dumps(document, indent=1, allow_nan=False) + "\n"

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a plan and the surface beside it.

        Raises:
            PlanFileError: If a file is missing, isn't a plan of a version that is
                understood, or doesn't belong to the other.
        """
        path = Path(path)
        document = _read_document(path)
        surface_path = path.parent / str(document["surface"].get("path", "surface.npz"))
        surface = Surface.load(surface_path)
        if sha256_of(surface_path) != document["surface"].get("sha256"):
            raise PlanFileError(
                f"{surface_path}: its SHA-256 isn't the one in {path.name}; "
                f"the two files must come from one run"
            )
        plan = cls(document, surface)
        try:
            _ = plan.requirements, plan.projectors, plan.cameras
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise PlanFileError(
                f"{path}: broken plan ({type(error).__name__}: {error}); plan again"
            ) from None
        return plan


def _read_document(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise PlanFileError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise PlanFileError(f"{path}: not readable as JSON ({error})") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise PlanFileError(f"{path}: not a plan, its `format` must be '{FORMAT}'")
    if document.get("version") != VERSION:
        raise PlanFileError(
            f"{path}: version {document.get('version')}, this program reads {VERSION}"
        )
    missing = [name for name in _SECTIONS if name not in document]
    if missing:
        raise PlanFileError(f"{path}: lacks {', '.join(missing)}; plan again")
    return document


def _pose(entry: dict[str, Any], name: str) -> NDArray[np.float64]:
    pose = np.array(entry[name], dtype=np.float64)
    if pose.shape != (4, 4) or not np.all(np.isfinite(pose)):
        raise ValueError(f"{entry.get('id')}: {name} must be 4 x 4 finite numbers")
    turn = pose[:3, :3]
    if not np.allclose(turn.T @ turn, np.eye(3), atol=1e-6) or np.linalg.det(turn) < 0:
        raise ValueError(f"{entry.get('id')}: {name} must hold a rotation")
    return pose


def _projector(entry: dict[str, Any]) -> PlannedProjector:
    width, height = entry["resolution"]
    low, high = entry["range_m"]
    light = entry["light"]
    if light not in ("diverging", "parallel"):
        raise ValueError(f"{entry['id']}: light must be diverging or parallel")
    radii = np.array(entry["ring_radii"], dtype=np.float64)
    if radii.ndim != 1 or len(radii) < 2 or not np.all(np.diff(radii, prepend=0.0) > 0):
        raise ValueError(f"{entry['id']}: ring_radii must be 2 or more, rising from 0")
    device = (
        PinholeModel(np.array(entry["K"], dtype=float), (width, height), (low, high))
        if light == "diverging"
        else ParallelModel(
            (width, height), entry["pixel_pitch_m"], (low, high), entry["beam_radius"]
        )
    )
    return PlannedProjector(
        entry["id"],
        light,
        _pose(entry, "world_from_device"),
        _pose(entry, "world_from_ring"),
        device,
        radii,
        _existing(entry),
        Body.read(entry),
    )


def _camera(entry: dict[str, Any]) -> PlannedCamera:
    width, height = entry["resolution"]
    low, high = entry["range_m"]
    k1, k2, p1, p2, k3 = entry["distortion"]
    device = PinholeModel(
        np.array(entry["K"], dtype=float),
        (width, height),
        (low, high),
        (k1, k2, p1, p2, k3),
    )
    pose = _pose(entry, "world_from_device")
    return PlannedCamera(entry["id"], pose, device, _existing(entry), Body.read(entry))


def _existing(entry: dict[str, Any]) -> str:
    return str(entry["name"]) if entry.get("existing") else ""
