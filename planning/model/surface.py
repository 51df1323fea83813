"""The surface as planned: what every claim in a plan speaks about."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints, Mask
from geometry.files.file_content import file_content
from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.mesh.topology import numbered

from .devices.bodies import Obstacle
from .errors import PlanFileError
from .files import reading
from .packed_arrays import unpacked_arrays

# Kinds of numbers and the shape of each array; any number n.
_ARRAYS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "vertices": ("f", ("n", 3)),
    "faces": ("iu", ("n", 3)),
    "member": ("iu", ("n faces",)),
    "region": ("iu", ("n faces",)),
    "steep": ("f", ("n faces", 3)),
    "reference_projectors": ("f", ("n", 4, 4)),
    "reference_rings": ("f", ("n projectors", 4, 4)),
    "reference_cameras": ("f", ("n", 4, 4)),
}
# Of all obstacles, one after the other; no array where there are none.
_OBSTACLES: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "obstacle_names": ("U", ("n",)),
    "obstacle_vertices": ("f", ("n", 3)),
    "obstacle_faces": ("iu", ("n", 3)),
    "obstacle_of_face": ("iu", ("n",)),
}
# Of each obstacle, where there are some that stand before one station alone.
_STATIONS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "obstacle_stations": ("U", ("n",)),
}
# Model of each reference pose, where the rig has several.
_MODELS: dict[str, tuple[str, tuple[int | str, ...]]] = {
    "reference_projector_models": ("iu", ("n projectors",)),
    "reference_camera_models": ("iu", ("n cameras",)),
}
# Squares and cubes of what is larger by far overflow.
_LARGEST = 1e9
_BESIDE_MESH = list(_ARRAYS)[2:]


@dataclass(frozen=True, eq=False)
class Surface:
    """The repaired, oriented mesh in metres, and the reference poses (`surface.npz`).

    Attributes:
        mesh: The mesh as planned.
        member: Index of the mesh that each face came from, shape (n_f,).
        region: Dominant region of each face, -1 for none, shape (n_f,).
        steep: Unit T1 of each face, zero where the direction is arbitrary or the face
            isn't in the target, shape (n_f, 3).
        reference_projectors: ``world_from_device`` of the reference set, (n, 4, 4).
        reference_rings: ``world_from_ring`` of the same poses, shape (n, 4, 4).
        reference_cameras: ``world_from_device`` of the reference set, (n, 4, 4).
        obstacles: What stands about the object and isn't a device.
        reference_projector_models: Model of each of these poses, by its place in the
            rig, shape (n,); None: all are the first.
        reference_camera_models: The same of cameras.

    Raises:
        PlanFileError: If an array is of another kind of numbers, or of another shape.
    """

    mesh: TriangleMesh
    member: Ints
    region: Ints
    steep: Array
    reference_projectors: Array
    reference_rings: Array
    reference_cameras: Array
    obstacles: tuple[Obstacle, ...] = ()
    reference_projector_models: Ints | None = None
    reference_camera_models: Ints | None = None

    def __post_init__(self) -> None:
        # Others are as many as these: a lone number has no length to ask for.
        for name in ("reference_projectors", "reference_cameras"):
            _check_arrays({name: getattr(self, name)}, {})
        sizes: dict[int | str, int] = {
            "n faces": len(self.mesh.faces),
            "n projectors": len(self.reference_projectors),
            "n cameras": len(self.reference_cameras),
        }
        beside = {name: getattr(self, name) for name in _BESIDE_MESH}
        _check_arrays(beside | self._models, sizes)

    def models_of(self, kind: str) -> Ints:
        """Return the model of each reference pose of a `projector` or a `camera`."""
        stated = self._models.get(f"reference_{kind}_models")
        poses = getattr(self, f"reference_{kind}s")
        return np.zeros(len(poses), dtype=np.int64) if stated is None else stated

    @property
    def _models(self) -> dict[str, Ints]:
        models = {name: getattr(self, name) for name in _MODELS}
        return {name: of for name, of in models.items() if of is not None}

    @cached_property
    def in_dominant(self) -> Mask:
        """Whether each face belongs to a dominant region, shape (n_f,)."""
        return self.region >= 0

    def target_faces(self, target: str) -> Mask:
        """Return whether each face is in the target: all of `surface`, or regions."""
        whole = np.ones_like(self.in_dominant)
        return whole if target == "surface" else self.in_dominant

    def sha256(self) -> str:
        """Return the hexadecimal SHA-256 digest of `content`."""
        return hashlib.sha256(self.content).hexdigest()

    @cached_property
    def content(self) -> bytes:
        """What `surface.npz` holds, the same bytes for equal values."""
        buffer = BytesIO()
        arrays: dict[str, Any] = {
            "vertices": self.mesh.vertices,
            "faces": self.mesh.faces,
            **{name: getattr(self, name) for name in _BESIDE_MESH},
            **_packed(self.obstacles),
            **self._models,
        }
        np.savez_compressed(buffer, **arrays)
        return buffer.getvalue()

    @classmethod
    def load(cls, path: Path, sha256: str | None = None) -> "Surface":
        """Read `surface.npz`.

        Args:
            path: The file.
            sha256: Its digest as the plan has it; None: it isn't compared.

        Raises:
            PlanFileError: If the file is missing, another one than the plan's, broken,
                or lacks an array.
        """
        beside = "; the surface must stand beside the plan, "
        beside += "copy both from the output folder"
        with reading(path, PlanFileError, absent=beside):
            content = file_content(path)
        # Before it is unpacked: what was damaged on the way may break any reader.
        if sha256 not in (None, hashlib.sha256(content).hexdigest()):
            raise PlanFileError(
                f"{path}: its SHA-256 isn't the one in the plan; "
                f"the two files must come from one run"
            )
        try:
            packed = unpacked_arrays(content)
            wanted = _ARRAYS | (_OBSTACLES if set(_OBSTACLES) & set(packed) else {})
            sometimes = _MODELS | _STATIONS
            wanted |= {n: of for n, of in sometimes.items() if n in packed}
            if lacking := wanted.keys() - packed.keys():
                raise PlanFileError(f"{min(lacking)} is missing; plan again")
            arrays: dict[str, Any] = {name: _plain(packed[name]) for name in wanted}
            solids = (*_OBSTACLES, *_STATIONS)
            apart = ("vertices", "faces", *solids)
            _check_arrays({name: arrays[name] for name in apart if name in arrays}, {})
            obstacles = _unpacked(*(arrays.pop(name, None) for name in solids))
            mesh = TriangleMesh(arrays.pop("vertices"), arrays.pop("faces"))
            return cls(mesh, **arrays, obstacles=obstacles)
        except (MeshError, PlanFileError) as error:
            raise PlanFileError(f"{path}: {error}") from None


def _are_characters(names: NDArray[Any]) -> bool:
    """Whether names (n,) are of characters that there are, no halves of any."""
    if names.dtype.kind != "U":
        return False
    codes = np.frombuffer(names.tobytes(), f"{names.dtype.byteorder}u4")
    return bool(np.all((codes < 0xD800) | ((codes > 0xDFFF) & (codes < 0x110000))))


def _plain(array: NDArray[Any]) -> NDArray[Any]:
    """Return narrower floats, or those of another machine, as ours; others as it is."""
    floats = array.dtype.kind == "f" and np.can_cast(array.dtype, np.float64)
    return array.astype(np.float64, copy=False) if floats else array


def _check_arrays(
    arrays: Mapping[str, NDArray[Any]], sizes: Mapping[int | str, int]
) -> None:
    for name, array in arrays.items():
        kinds, shape = (_ARRAYS | _OBSTACLES | _STATIONS | _MODELS)[name]
        wanted = [sizes.get(size, size) for size in shape]
        fits = array.ndim == len(wanted) and all(
            want in ("n", has) for want, has in zip(wanted, array.shape, strict=True)
        )
        fits &= array.dtype.kind in kinds
        # Wider floats are none that linear algebra takes.
        fits &= kinds != "f" or np.can_cast(array.dtype, np.float64)
        fits &= kinds != "U" or _are_characters(array)
        if not fits or (kinds == "f" and not np.all(np.abs(array) < _LARGEST)):
            floats = f"floats of less than {_LARGEST:g}"
            number = {"f": floats, "iu": "integers", "U": "names"}[kinds]
            raise PlanFileError(
                f"`{name}` must be ({', '.join(map(str, wanted))}) {number}, got "
                f"{array.dtype} of shape {array.shape}; plan again"
            )


def _packed(obstacles: Sequence[Obstacle]) -> dict[str, Any]:
    """Return `_OBSTACLES`, and `_STATIONS` if any has one; nothing of none."""
    if not obstacles:
        return {}
    meshes = [obstacle.mesh for obstacle in obstacles]
    together = TriangleMesh.joined(meshes)
    values = (
        np.array([obstacle.name for obstacle in obstacles]),
        together.vertices,
        together.faces,
        np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes]),
    )
    packed: dict[str, Any] = dict(zip(_OBSTACLES, values, strict=True))
    if any(obstacle.station for obstacle in obstacles):
        packed["obstacle_stations"] = np.array([each.station for each in obstacles])
    return packed


def _unpacked(
    names: NDArray[np.str_] | None,
    vertices: Array,
    faces: Ints,
    of_face: Ints,
    stations: NDArray[np.str_] | None,
) -> tuple[Obstacle, ...]:
    """Return the obstacles that `_packed` took; None: there are none."""
    if names is None:
        return ()
    if not (len(of_face) == len(faces) and np.all(np.isin(of_face, range(len(names))))):
        raise MeshError("`obstacle_of_face` must name an obstacle for each face")
    if stations is not None and len(stations) != len(names):
        raise MeshError("`obstacle_stations` must name one for each obstacle, or none")
    at = [""] * len(names) if stations is None else stations.tolist()
    obstacles: list[Obstacle] = []
    try:
        TriangleMesh(vertices, faces)
        for index, (name, station) in enumerate(zip(names.tolist(), at, strict=True)):
            used, local = numbered(faces[of_face == index], len(vertices))
            mesh = TriangleMesh(vertices[used], local)
            obstacles.append(Obstacle(name, mesh, station))
    except MeshError as error:
        raise MeshError(f"`obstacle_vertices` and `obstacle_faces`: {error}") from None
    return tuple(obstacles)
