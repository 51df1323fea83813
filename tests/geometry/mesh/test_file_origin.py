"""A mesh knows which polygon of its file each triangle came from, whatever was done."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.plain_shapes import box

from geometry.files.readers import load_mesh
from geometry.mesh.file_origin import FileOrigin
from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.repair.orientation import orient
from geometry.shapes.primitives import sphere

CELL_MM = 10.0
# Outlines in a cell of side 1, counter-clockwise: a triangle, a square, a pentagon,
# an arrow that a fan would cut wrongly, and a hexagon with a notch.
SHAPES = [
    [(0, 0), (1, 0), (0, 1)],
    [(0, 0), (1, 0), (1, 1), (0, 1)],
    [(0, 0), (1, 0), (1, 0.5), (0.5, 1), (0, 0.5)],
    [(0.1, 0), (0.5, 0.3), (0.9, 0), (0.5, 1)],
    [(0, 0), (0.5, 0.4), (1, 0), (1, 1), (0.5, 0.9), (0, 1)],
]


def outline_area(shape: list[tuple[float, float]]) -> float:
    x, y = np.array(shape, dtype=np.float64).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


class Row:
    """Polygons side by side in cells of 10 mm, stored in a random order."""

    def __init__(self, n: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.shape_of_cell = rng.integers(len(SHAPES), size=n)
        # Cell of each polygon of the file.
        self.cells = rng.permutation(n)
        self.vertices: list[tuple[float, float, float]] = []
        self.polygons: list[list[int]] = []
        for cell in self.cells:
            outline = SHAPES[self.shape_of_cell[cell]]
            first = len(self.vertices)
            self.vertices += [
                (CELL_MM * (int(cell) + x), CELL_MM * y, 0.0) for x, y in outline
            ]
            self.polygons.append(list(range(first, first + len(outline))))

    def obj(self) -> bytes:
        lines = [f"v {v[0]!r} {v[1]!r} {v[2]!r}" for v in self.vertices]
        lines += ["f " + " ".join(f"{i + 1}/1" for i in p) for p in self.polygons]
        return "\n".join(lines).encode()

    def off(self) -> bytes:
        lines = ["OFF", f"{len(self.vertices)} {len(self.polygons)} 0"]
        lines += [f"{v[0]!r} {v[1]!r} {v[2]!r}" for v in self.vertices]
        lines += [f"{len(p)} " + " ".join(map(str, p)) for p in self.polygons]
        return "\n".join(lines).encode()

    def ply(self, order: str) -> bytes:
        """Return the row as PLY; `order` is ascii, or the sign of a byte order.

        Columns stand on both sides of the coordinates and of the corners.
        """
        name = {"ascii": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}
        header = (
            f"ply\nformat {name[order]} 1.0\ncomment by hand\n"
            f"element vertex {len(self.vertices)}\n"
            "property double x\nproperty double y\nproperty double z\n"
            "property float number\n"
            f"element face {len(self.polygons)}\nproperty short cell\n"
            "property list uchar int vertex_indices\nproperty uchar odd\nend_header\n"
        ).encode()
        vertices = [(*v, i) for i, v in enumerate(self.vertices)]
        faces = [
            (int(c), len(p), *p, int(c) % 2)
            for c, p in zip(self.cells, self.polygons, strict=True)
        ]
        if order == "ascii":
            rows = [" ".join(map(repr, row)) for row in (*vertices, *faces)]
            return header + "\n".join(rows).encode() + b"\n"
        body = b"".join(struct.pack(f"{order}dddf", *v) for v in vertices)
        body += b"".join(struct.pack(f"{order}hB{len(f) - 3}iB", *f) for f in faces)
        return header + body

    def write(self, folder: Path, kind: str) -> Path:
        suffix, _, order = kind.partition(" ")
        path = folder / f"row.{suffix}"
        content = {"obj": self.obj, "off": self.off}.get(suffix)
        path.write_bytes(self.ply(order) if content is None else content())
        return path


KINDS = ["obj", "off", "ply ascii", "ply <", "ply >"]


def origin_of(mesh: TriangleMesh) -> FileOrigin:
    assert mesh.origin is not None
    return mesh.origin


def cells_of(mesh: TriangleMesh) -> np.ndarray:
    """Cell in which each triangle lies."""
    return np.floor(mesh.face_centroids[:, 0] / (1e-3 * CELL_MM)).astype(int)


def assert_corners_are_the_files_own(mesh: TriangleMesh, row: Row) -> None:
    stored = 1e-3 * np.array(row.vertices)[origin_of(mesh).corners]
    for axis in range(3):
        np.testing.assert_allclose(
            np.sort(stored[..., axis], axis=1),
            np.sort(mesh.corners[..., axis], axis=1),
            rtol=1e-12,
        )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_every_triangle_knows_its_polygon_in_mixed_files(
    kind: str, seed: int, tmp_path: Path
) -> None:
    row = Row(40, seed)
    mesh = load_mesh(row.write(tmp_path, kind), unit="mm")
    origin = origin_of(mesh)
    np.testing.assert_array_equal(row.cells[origin.face], cells_of(mesh))
    assert origin.n_faces == 40
    assert origin.n_vertices == len(row.vertices)
    assert np.all(np.diff(origin.face) >= 0), "triangles stand in the file's order"
    # Touching corners are welded, yet every triangle keeps the file's own vertices.
    assert len(mesh.vertices) < len(row.vertices)
    assert_corners_are_the_files_own(mesh, row)
    # All of each polygon came through, and nothing beside its outline.
    areas = np.bincount(origin.face, mesh.face_areas, origin.n_faces)
    truth = [outline_area(SHAPES[row.shape_of_cell[c]]) for c in row.cells]
    np.testing.assert_allclose(areas, 1e-4 * np.array(truth), rtol=1e-9)


@pytest.mark.parametrize("order", ["ascii", "<", ">"])
def test_properties_of_a_ply_file_are_read_along(order: str, tmp_path: Path) -> None:
    row = Row(25, seed=7)
    mesh = load_mesh(row.write(tmp_path, f"ply {order}"), unit="mm")
    origin = origin_of(mesh)
    assert set(origin.face_properties) == {"cell", "odd"}
    assert set(origin.vertex_properties) == {"number"}
    np.testing.assert_array_equal(origin.face_properties["cell"], row.cells)
    np.testing.assert_array_equal(origin.face_properties["odd"], row.cells % 2)
    number = origin.vertex_properties["number"]
    np.testing.assert_array_equal(number, np.arange(len(row.vertices)))
    with pytest.raises(ValueError, match="read-only"):
        number[0] = 1


@pytest.mark.parametrize("kind", ["obj", "off", "ply <"])
def test_numbers_survive_every_repair(kind: str, tmp_path: Path) -> None:
    row = Row(30, seed=3)
    doubled, flat = row.polygons[4], row.polygons[9][:2]
    bad = len(row.vertices)
    row.vertices.append((float("nan"), 0.0, 0.0))
    planted = {
        2: [flat[0], flat[1], flat[1]],
        11: list(doubled),
        20: [0, 1, bad],
    }
    cells = list(row.cells)
    for at, polygon in planted.items():
        row.polygons.insert(at, polygon)
        cells.insert(at, -1)
    row.cells = np.array(cells)
    mesh = load_mesh(row.write(tmp_path, kind), unit="mm")
    origin = origin_of(mesh)
    np.testing.assert_array_equal(row.cells[origin.face], cells_of(mesh))
    assert origin.n_faces == 33
    assert sorted(set(range(33)) - set(origin.face.tolist())) == sorted(planted)
    assert_corners_are_the_files_own(mesh, row)


def quad_box(folder: Path, *, flipped: np.ndarray) -> Path:
    """A box of six quads in PLY; `side` tells each one's axis: +x 0, -x 1, ... -z 5."""
    corners = [(x, y, z) for x in (0, 30) for y in (0, 40) for z in (0, 50)]
    sides = [
        [4, 6, 7, 5], [0, 1, 3, 2], [2, 3, 7, 6], [0, 4, 5, 1], [1, 5, 7, 3],
        [0, 2, 6, 4],
    ]  # fmt: skip
    quads = [s[::-1] if f else s for s, f in zip(sides, flipped, strict=True)]
    order = np.random.default_rng(5).permutation(6)
    lines = [
        "ply", "format ascii 1.0", "element vertex 8", "property float x",
        "property float y", "property float z", "element face 6",
        "property list uchar int vertex_index", "property int side", "end_header",
    ]  # fmt: skip
    lines += [f"{c[0]} {c[1]} {c[2]}" for c in corners]
    lines += [f"4 {' '.join(map(str, quads[i]))} {i}" for i in order]
    path = folder / "box.ply"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("flipped", [0, 63, 0b101001, 0b000111])
def test_turning_faces_keeps_their_numbers(flipped: int, tmp_path: Path) -> None:
    which = np.array([(flipped >> k) & 1 for k in range(6)], dtype=bool)
    mesh = load_mesh(quad_box(tmp_path, flipped=which), unit="mm")
    side = origin_of(mesh).face_properties["side"][origin_of(mesh).face].astype(int)
    outward = np.zeros((12, 3))
    outward[np.arange(12), side // 2] = np.where(side % 2 == 0, 1.0, -1.0)
    np.testing.assert_allclose(mesh.face_normals, outward, atol=1e-12)


def test_orientation_keeps_the_order_of_faces() -> None:
    ball, block = sphere(0.1, subdivisions=2), box((0.02, 0.03, 0.04), divisions=3)
    faces = np.vstack([ball.faces, block.faces + len(ball.vertices)])
    rng = np.random.default_rng(2)
    faces = rng.permutation(faces)
    flip = rng.random(len(faces)) < 0.4
    faces[flip] = faces[flip, ::-1]
    mesh = TriangleMesh(np.vstack([ball.vertices, block.vertices]), faces)
    turned, _ = orient(mesh)
    np.testing.assert_array_equal(np.sort(turned, axis=1), np.sort(faces, axis=1))


@pytest.mark.parametrize("kind", ["stl", "glb", "3mf", "obj", "off", "ply"])
def test_triangles_count_in_the_order_of_the_file(kind: str, tmp_path: Path) -> None:
    ball = sphere(40.0, subdivisions=2)
    order = np.random.default_rng(1).permutation(len(ball.faces))
    mesh = trimesh.Trimesh(ball.vertices, ball.faces[order], process=False)
    path = tmp_path / f"ball.{kind}"
    mesh.export(path)
    found = load_mesh(path, unit="mm")
    origin = origin_of(found)
    np.testing.assert_array_equal(origin.face, np.arange(len(order)))
    np.testing.assert_allclose(
        found.face_centroids, 1e-3 * ball.face_centroids[order], atol=1e-7
    )


def test_bodies_count_one_after_the_other(tmp_path: Path) -> None:
    text = ""
    for name, z in (("zeta", 0.0), ("alpha", 20.0), ("mid", 40.0)):
        text += f"solid {name}\n"
        for x in (0.0, 20.0):
            text += (
                f"facet normal 0 0 1\nouter loop\nvertex {x} 0 {z}\n"
                f"vertex {x + 10} 0 {z}\nvertex {x} 10 {z}\nendloop\nendfacet\n"
            )
        text += f"endsolid {name}\n"
    path = tmp_path / "bodies.stl"
    path.write_text(text)
    mesh = load_mesh(path, unit="mm")
    np.testing.assert_array_equal(origin_of(mesh).face, np.arange(6))
    np.testing.assert_allclose(
        mesh.corners[:, :, 2].mean(axis=1), [0, 0, 0.02, 0.02, 0.04, 0.04], atol=1e-9
    )


def test_an_origin_that_does_not_fit_is_refused() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    good = FileOrigin(np.array([0, 0]), faces, 1, 4)
    with pytest.raises(ValueError, match=r"face must be \(n,\) and corners \(n, 3\)"):
        FileOrigin(np.array([0]), faces, 1, 4)
    with pytest.raises(ValueError, match=r"face spans 0\.\.1, must lie in 0\.\.0"):
        FileOrigin(np.array([0, 1]), faces, 1, 4)
    with pytest.raises(ValueError, match=r"corners spans 0\.\.3, must lie in 0\.\.2"):
        FileOrigin(np.array([0, 0]), faces, 1, 3)
    with pytest.raises(ValueError, match=r"'a' must be \(1,\), got \(2,\)"):
        FileOrigin(np.array([0, 0]), faces, 1, 4, {"a": np.zeros(2)})
    with pytest.raises(ValueError, match=r"'b' must be \(4,\), got \(3,\)"):
        FileOrigin(np.array([0, 0]), faces, 1, 4, {}, {"b": np.zeros(3)})
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert TriangleMesh(square, faces, origin=good).origin is good
    with pytest.raises(MeshError, match="origin tells of 2 faces, the mesh has 1"):
        TriangleMesh(square, faces[:1], origin=good)
