"""The file of a front: its candidates, their matrix, and what each point takes."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from geometry.files.file_content import file_content
from planning.model.devices.device_poses import moved_to, poses_of
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InputError, PlanFileError
from planning.model.files import reading
from planning.model.front import Front, FrontPoint
from planning.model.packed_arrays import unpacked_arrays
from planning.projectors.candidate_set import CandidateSet
from planning.report.partial_plan import Prepared
from planning.scene.draws import DRAWS
from planning.scene.placed_bodies import existing_devices, movable

from .front_matrix import FrontMatrix

FRONT_FILE = "pareto.npz"
# What values of a head that holds anything raise.
_DAMAGED = ValueError, KeyError, TypeError, RecursionError
_FORMAT, _VERSION = "ringrig-front", 2
_ARRAYS = (
    *("stages", "seen", "projector_poses", "projector_rings", "projector_models"),
    *("camera_poses", "camera_models", "point_rings"),
)
_AGAIN = "make the front again with --pareto"


@dataclass(frozen=True, eq=False)
class KeptFront:
    """A front with the matrix that it is of, as written to a file.

    Attributes:
        front: The points.
        digests: Of what the matrix depends on, by what it is.
        arrays: Candidates that don't stand already, the first limit that projectors
            violate, and what cameras see, eight samples a byte; ring frames of every
            point's projectors, point after point.
    """

    front: Front
    digests: dict[str, str]
    arrays: dict[str, NDArray[Any]]

    @classmethod
    def of(
        cls,
        ready: Prepared,
        matrix: FrontMatrix,
        front: Front,
        taken: Iterable[PlannedProjector],
    ) -> "KeptFront":
        """Return a front with what it was chosen from.

        `taken` are the projectors of every point, point after point.
        """
        projectors = movable(matrix.candidates.projectors)
        cameras = movable(matrix.cameras)
        return cls(
            front,
            digests_of(ready),
            {
                "stages": matrix.candidates.stages,
                "seen": np.packbits(matrix.seen, axis=0),
                "projector_poses": poses_of(projectors),
                "projector_rings": np.stack([p.world_from_ring for p in projectors]),
                "projector_models": _models(projectors, ready.templates),
                "camera_poses": poses_of(cameras),
                "camera_models": _models(cameras, ready.cameras),
                "point_rings": np.stack([p.world_from_ring for p in taken]),
            },
        )

    def write(self, file: BinaryIO) -> None:
        """Write the file."""
        head = {
            "format": _FORMAT,
            "version": _VERSION,
            "digests": self.digests,
            "front": self.front.to_document(),
        }
        arrays: Any = self.arrays | {"head": np.array(json.dumps(head))}
        np.savez_compressed(file, **arrays, content=np.array(_content(arrays)))

    @property
    def standing(self) -> tuple[int, int]:
        """How many projectors and cameras stand already: they have no candidate."""
        arrays = self.arrays
        return (
            arrays["stages"].shape[1] - len(arrays["projector_poses"]),
            arrays["seen"].shape[1] - len(arrays["camera_poses"]),
        )

    def rings_of(self, point: FrontPoint) -> NDArray[np.float64]:
        """Return the ring frames of a point's projectors, shape (k, 4, 4)."""
        before = [p.projectors for p in self.front.points[: self._place(point)]]
        first = sum(before)
        return self.arrays["point_rings"][first : first + point.projectors]

    def _place(self, point: FrontPoint) -> int:
        return [one.count for one in self.front.points].index(point.count)

    def matrix(self, ready: Prepared) -> FrontMatrix:
        """Return the matrix, of the mesh, rig and requirements that it was made for.

        Raises:
            InputError: If they are others.
            PlanFileError: If the arrays are of other samples, models or devices.
        """
        self._check(digests_of(ready))
        kept, scene = self.arrays, ready.scene.without_floors
        samples = scene.target_samples(DRAWS.projectors)
        standing = existing_devices(scene.requirements, ready.templates)
        placed = existing_devices(scene.requirements, ready.cameras)
        n = len(samples)
        columns = len(standing) + len(kept["projector_poses"])
        if not (
            kept["stages"].shape == (n, columns)
            and kept["seen"].shape[1] == len(placed) + len(kept["camera_poses"])
            and kept["projector_models"].max(initial=0) < len(ready.templates)
            and kept["camera_models"].max(initial=0) < len(ready.cameras)
        ):
            raise PlanFileError(
                f"{FRONT_FILE}: is a damaged front (its arrays don't fit the mesh and "
                f"rig); {_AGAIN}"
            )
        projectors = tuple(
            replace(
                ready.templates[model], world_from_device=pose, world_from_ring=rings
            )
            for pose, rings, model in zip(
                *(kept["projector_poses"], kept["projector_rings"]),
                kept["projector_models"].tolist(),
                strict=True,
            )
        )
        cameras = tuple(
            moved_to(ready.cameras[model], pose)
            for pose, model in zip(
                kept["camera_poses"], kept["camera_models"].tolist(), strict=True
            )
        )
        candidates = CandidateSet(
            scene,
            samples,
            (*standing, *projectors),
            kept["stages"],
            len(standing),
        )
        return FrontMatrix(
            candidates,
            (*placed, *cameras),
            np.unpackbits(kept["seen"], axis=0, count=n).astype(bool),
        )

    def _check(self, digests: dict[str, str]) -> None:
        for name, digest in digests.items():
            if self.digests.get(name) != digest:
                raise InputError(
                    f"{FRONT_FILE} was made for another {name}: its matrix holds no "
                    f"longer; give the same, or {_AGAIN}"
                )


def read_front(folder: Path) -> KeptFront:
    """Read the front that a folder keeps.

    Raises:
        InputError: If there is none.
        PlanFileError: If it is damaged, or of another version.
    """
    path = folder / FRONT_FILE
    with reading(path, InputError, absent=f"; {_AGAIN}"):
        try:
            file = unpacked_arrays(file_content(path))
            head = json.loads(str(file["head"]))
            known = head["format"], head["version"]
            kept = _whole(head, file) if known == (_FORMAT, _VERSION) else None
        except (PlanFileError, *_DAMAGED) as error:
            what = "a field" if isinstance(error, ValidationError) else str(error)
            raise PlanFileError(
                f"{path}: is no front, or a damaged one ({what}); {_AGAIN}"
            ) from None
    if kept is None:
        raise PlanFileError(
            f"{path}: is {known[0]!r} of version {known[1]!r}, and {_FORMAT!r} of "
            f"version {_VERSION!r} is read; {_AGAIN}"
        )
    return kept


def _whole(head: dict[str, Any], file: Mapping[str, NDArray[Any]]) -> KeptFront:
    """Return the front of a file; raise ValueError unless it is as it was written."""
    arrays = {name: file[name] for name in _ARRAYS}
    if str(file["content"]) != _content(arrays | {"head": file["head"]}):
        raise ValueError("its content isn't what was written")
    front = Front(**head["front"])
    _hold_together(front, arrays)
    return KeptFront(front, dict(head["digests"]), arrays)


def _content(arrays: dict[str, NDArray[Any]]) -> str:
    """Return a digest of the head and all arrays."""
    every = ((name, arrays[name]) for name in ("head", *_ARRAYS))
    return _digest(*(p for name, a in every for p in (name, a.dtype.str, a.shape, a)))


def _hold_together(front: Front, arrays: dict[str, NDArray[Any]]) -> None:
    """Raise ValueError unless points and candidates have all that is told of them.

    Candidates a pose, a model and a column each, points a ring frame and a column for
    each of their devices.
    """
    poses = {name: arrays[f"{name}_poses"] for name in ("projector", "camera")}
    frames = *poses.values(), arrays["projector_rings"], arrays["point_rings"]
    models = [arrays[f"{name}_models"] for name in poses]
    if not (
        all(a.ndim == 3 and a.shape[1:] == (4, 4) for a in frames)
        and all(np.isfinite(a).all() for a in frames)
        and all(len(m) == len(p) for m, p in zip(models, poses.values(), strict=True))
        and all(m.ndim == 1 and m.dtype.kind == "i" for m in models)
        and all(m.min(initial=0) >= 0 for m in models)
        and len(arrays["projector_rings"]) == len(poses["projector"])
        and all(arrays[name].ndim == 2 for name in ("stages", "seen"))
        and arrays["stages"].dtype == np.int8
        and arrays["seen"].dtype == np.uint8
        and len(arrays["seen"]) == -(-len(arrays["stages"]) // 8)
        and len(arrays["point_rings"]) == sum(p.projectors for p in front.points)
        and all(
            0 < len({*taken}) == len(taken) == count and max(taken) < columns
            for point in front.points
            for taken, count, columns in (
                (point.lights, point.projectors, arrays["stages"].shape[1]),
                (point.views, point.cameras, arrays["seen"].shape[1]),
            )
        )
    ):
        raise ValueError("its arrays don't fit together")


def digests_of(ready: Prepared) -> dict[str, str]:
    """Return a digest of each thing that a matrix depends on, causes first.

    How many devices there may be it doesn't depend on.
    """
    scene, request = ready.scene, ready.request
    asked = scene.requirements.to_document()
    # Free axes after centred ones that didn't pass the check are no other question.
    axis = replace(request, axis_wanted=None).ring_axis
    for name in ("max_projectors", "max_cameras"):
        del asked[name]
    # Of obstacles the rig has names and places, and their files the rest.
    meshes = [one.mesh for one in scene.obstructions]
    obstacles = [part for mesh in meshes for part in (mesh.vertices, mesh.faces)]
    return {
        "mesh": _digest(scene.mesh.vertices, scene.mesh.faces),
        "rig": _digest(request.rig.to_document()),
        "seed": _digest(request.seed),
        "target": _digest(scene.region, scene.steep),
        "set of obstacles": _digest(*obstacles),
        "set of requirements": _digest(asked | {"ring_axis": axis}),
    }


def _digest(*parts: object) -> str:
    sha = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            sha.update(np.ascontiguousarray(part).tobytes())
        else:
            sha.update(json.dumps(part, sort_keys=True).encode())
    return sha.hexdigest()


def _models(
    devices: Sequence[PlannedProjector] | Sequence[PlannedCamera],
    templates: Sequence[PlannedProjector] | Sequence[PlannedCamera],
) -> NDArray[np.int64]:
    places = {template.model: place for place, template in enumerate(templates)}
    return np.array([places[device.model] for device in devices], dtype=np.int64)
