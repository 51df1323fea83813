"""Strict reader of the triangles of glTF 2.0, GLB and .gltf with its buffers."""

import json
import struct

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array, Ints

from .gltf_buffers import PACKED, QUANTIZED, Buffers, Fetch, Tree, item
from .polygons import strip_triangles, with_area
from .reading import FormatError, RawMesh, ScenePart, joined

# Required extensions that leave the triangles as the core format stores them.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_glb(data: bytes) -> RawMesh:
    """Return what the default scene of a GLB file shows."""
    if len(data) < 20 or not data.startswith(b"glTF"):
        raise FormatError("it has no GLB header")
    version, length = struct.unpack("<2I", data[4:12])
    if version != 2:
        raise FormatError(f"it is GLB version {version}, only 2 is read")
    if length != len(data):
        what = "cut short" if length > len(data) else "longer than it says"
        raise FormatError(f"it is {what}: {len(data)} of {length} bytes")
    chunks: list[tuple[bytes, bytes]] = []
    at = 12
    while at < length:
        size = int.from_bytes(data[at : at + 4], "little")
        if at + 8 + size > length:
            raise FormatError(f"its part {len(chunks) + 1} is longer than the file")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 8 + size
    if chunks[0][0] != b"JSON":
        raise FormatError("its first part isn't JSON")
    stored = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None
    return read_gltf(chunks[0][1], None, stored)


def read_gltf(text: bytes, fetch: Fetch | None, stored: bytes | None = None) -> RawMesh:
    """Return what the default scene shows.

    The unit is the metre, unless all meshes state the same other one under
    ``extras.units``, as mesh libraries write it. The first buffer of a GLB is what it
    has ``stored``.
    """
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"its JSON can't be read ({error})") from None
    if not isinstance(tree, dict):
        raise FormatError("its JSON isn't an object")
    _check_extensions(tree)
    buffers = Buffers(tree, fetch, stored)
    meshes: dict[int, list[tuple[Array, Ints]]] = {}
    parts: list[ScenePart] = []
    units: set[str] = set()
    for node, world_from_node in _placed(tree):
        if "mesh" not in node:
            continue
        index = node["mesh"]
        mesh = item(tree, "meshes", index)
        _check_rigid(node, mesh)
        if index not in meshes:
            shapes = [_primitive(buffers, p) for p in mesh["primitives"]]
            meshes[index] = [shape for shape in shapes if shape is not None]
        units.add(_unit(mesh))
        parts += [ScenePart(v, f, world_from_node) for v, f in meshes[index]]
    if not parts and tree.get("meshes"):
        raise FormatError("its default scene shows no triangle mesh")
    if len(units) > 1:
        raise FormatError(f"its meshes state different units: {sorted(units)}")
    return joined(parts, "".join(units))


def _unit(mesh: Tree) -> str:
    extras = mesh.get("extras")
    stated = extras.get("units") if isinstance(extras, dict) else None
    return str(stated)[:20] if stated else "m"


def _check_extensions(tree: Tree) -> None:
    version = str(tree.get("asset", {}).get("version", ""))
    if not version.startswith("2."):
        raise FormatError(f"it is glTF version '{version[:20]}', only 2 is read")
    for name in tree.get("extensionsRequired", ()):
        if name in PACKED:
            raise FormatError(f"it is compressed with {name}; export it uncompressed")
        if name != QUANTIZED and not str(name).startswith(_HARMLESS):
            raise FormatError(f"it requires the extension {name}, which isn't read")


def _placed(tree: Tree) -> list[tuple[Tree, Array]]:
    """Return every node of the default scene with its transform to the world."""
    nodes = tree.get("nodes", ())
    if tree.get("scenes"):
        roots = item(tree, "scenes", tree.get("scene", 0)).get("nodes", ())
    else:
        children = {c for node in nodes for c in node.get("children", ())}
        roots = [i for i in range(len(nodes)) if i not in children]
    placed: list[tuple[Tree, Array]] = []
    seen: set[int] = set()
    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    while waiting:
        index, world_from_parent = waiting.pop()
        node = item(tree, "nodes", index)
        if index in seen:
            raise FormatError(f"its node {index} hangs in two places")
        seen.add(index)
        with np.errstate(over="ignore", invalid="ignore"):
            world_from_node = world_from_parent @ _transform(index, node)
        placed.append((node, world_from_node))
        waiting += [(c, world_from_node) for c in reversed(node.get("children", ()))]
    return placed


def _transform(index: int, node: Tree) -> Array:
    matrix = np.array(node.get("matrix", np.eye(4).ravel()), dtype=np.float64)
    if matrix.shape != (16,):
        raise FormatError(f"its node {index} has a matrix of {matrix.size} numbers")
    # Stored column by column.
    matrix = matrix.reshape(4, 4).T
    shift = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    scale = np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    turn = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    sizes = (shift.shape, scale.shape, turn.shape) == ((3,), (3,), (4,))
    whole = sizes and all(np.all(np.isfinite(v)) for v in (matrix, shift, scale, turn))
    if not (whole and np.any(turn) and np.all(matrix[3] == (0, 0, 0, 1))):
        raise FormatError(f"its node {index} has no usable transform")
    local = np.eye(4)
    local[:3, :3] = Rotation.from_quat(turn).as_matrix() * scale
    local[:3, 3] = shift
    return matrix @ local


def _check_rigid(node: Tree, mesh: Tree) -> None:
    """Refuse what is shown in another shape than it is stored in."""
    if "skin" in node:
        raise FormatError("a skeleton poses its mesh, which isn't read; apply the pose")
    if np.any(node.get("weights", mesh.get("weights", ()))):
        raise FormatError("morph targets deform its mesh, which isn't read; apply them")
    if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
        raise FormatError("EXT_mesh_gpu_instancing repeats its mesh, which isn't read")


def _primitive(buffers: "Buffers", primitive: Tree) -> tuple[Array, Ints] | None:
    mode = primitive.get("mode", _TRIANGLES)
    if mode in (0, 1, 2, 3):
        return None
    points = buffers.values(primitive["attributes"].get("POSITION"), "VEC3")
    if "indices" in primitive:
        order = buffers.values(primitive["indices"], "SCALAR").reshape(-1)
    else:
        order = np.arange(len(points))
    order = order.astype(np.int64)
    if mode == _TRIANGLES and len(order) % 3 == 0:
        return points.astype(np.float64), order.reshape(-1, 3)
    if mode == _STRIP and len(order) >= 3 and order.min() >= 0:
        return points.astype(np.float64), strip_triangles(order)
    if mode == _FAN and len(order) >= 3:
        hub = np.full(len(order) - 2, order[0])
        faces = np.stack([hub, order[1:-1], order[2:]], axis=1)
        return points.astype(np.float64), with_area(faces)
    raise FormatError(f"{len(order)} corners make no triangles in mode {mode}")
