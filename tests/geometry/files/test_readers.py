import bz2
import gzip
import hashlib
import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.plain_shapes import box

from geometry.files.ply_format import read_ply
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.shapes.primitives import sphere

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data"
needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the shared data lies beside the repository only"
)
SIDES_MM = np.array([40.0, 60.0, 80.0])
TRIANGLE_OBJ = "v 0 0 0\nv 30 0 0\nv 0 30 0\n"


def brick() -> trimesh.Trimesh:
    mesh = box((40.0, 60.0, 80.0), divisions=2)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def sides_mm(mesh: TriangleMesh) -> np.ndarray:
    return 1e3 * (mesh.bounds[1] - mesh.bounds[0])


def write(path: Path, content: str | bytes) -> Path:
    if isinstance(content, str):
        path.write_text(content)
    else:
        path.write_bytes(content)
    return path


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "glb", "gltf", "3mf"])
def test_every_format_gives_the_same_closed_box(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"brick.{kind}"
    if kind == "3mf":
        write(path, three_mf("millimeter", brick()))
    elif kind == "gltf":
        for name, data in trimesh.Scene(brick()).export(file_type="gltf").items():
            write(path if name.endswith(".gltf") else tmp_path / name, data)
    else:
        brick().export(path)
    mesh = load_mesh(path, unit="mm")
    np.testing.assert_allclose(sides_mm(mesh), SIDES_MM, rtol=1e-6)
    assert (len(mesh.vertices), len(mesh.faces)) == (26, 48)
    outward = np.einsum("ij,ij->i", mesh.face_normals, mesh.face_centroids)
    assert np.all(outward > 0)


def three_mf(unit: str, mesh: trimesh.Trimesh) -> bytes:
    vertices = "".join(
        f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in mesh.vertices
    )
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces)
    model = (
        f'<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/'
        f'core/2015/02"><resources><object id="1" type="model"><mesh>'
        f"<vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object></resources>"
        f'<build><item objectid="1"/></build></model>'
    )
    return zipped({"3D/3dmodel.model": model.encode()})


def zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return buffer.getvalue()


@pytest.mark.parametrize("suffix", ["gz", "bz2", "zip"])
def test_compressed_files_are_read_like_plain_ones(suffix: str, tmp_path: Path) -> None:
    plain = brick().export(file_type="ply")
    packed = {
        "gz": gzip.compress,
        "bz2": bz2.compress,
        "zip": lambda data: zipped({"parts/brick.PLY": data, "notes.txt": b"hi"}),
    }[suffix](plain)
    name = "brick.zip" if suffix == "zip" else f"brick.v2.ply.{suffix}"
    mesh = load_mesh(write(tmp_path / name, packed))
    np.testing.assert_allclose(sides_mm(mesh), SIDES_MM, rtol=1e-6)
    assert mesh.source is not None
    assert mesh.source.sha256 == hashlib.sha256(packed).hexdigest()


def test_the_source_records_path_digest_unit_and_counts(tmp_path: Path) -> None:
    path = tmp_path / "brick.ply"
    brick().export(path)
    mesh = load_mesh(str(path), unit="in")
    source = mesh.source
    assert source is not None
    assert source.path == str(path)
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (source.unit, source.scale_to_m) == ("in", 0.0254)
    assert (source.n_vertices, source.n_faces, source.repairs) == (26, 48, ())
    np.testing.assert_allclose(sides_mm(mesh), 25.4 * SIDES_MM, rtol=1e-6)


def test_the_unit_is_the_flag_else_the_formats_else_millimetres(tmp_path: Path) -> None:
    glb = tmp_path / "m.glb"
    brick().apply_scale(0.01).export(glb)
    inches = write(tmp_path / "b.3mf", three_mf("inch", brick()))
    unstated = tmp_path / "b.ply"
    brick().export(unstated)
    cases = [
        (glb, None, "m", 10.0),
        (glb, "cm", "cm", 0.1),
        (inches, None, "in", 25.4),
        (inches, "mm", "mm", 1.0),
        (unstated, None, "mm", 1.0),
        (unstated, "um", "um", None),
    ]
    for path, flag, unit, factor in cases:
        if factor is None:
            with pytest.raises(MeshError, match="--unit"):
                load_mesh(path, unit=flag)
            continue
        mesh = load_mesh(path, unit=flag)
        assert mesh.source is not None
        assert mesh.source.unit == unit
        np.testing.assert_allclose(sides_mm(mesh), factor * SIDES_MM, rtol=1e-6)


def test_size_sets_the_longest_side(tmp_path: Path) -> None:
    path = tmp_path / "brick.obj"
    brick().export(path)
    mesh = load_mesh(path, size_mm=200.0)
    np.testing.assert_allclose(sides_mm(mesh), 2.5 * SIDES_MM, rtol=1e-12)
    assert mesh.source is not None
    assert mesh.source.scale_to_m == pytest.approx(2.5e-3, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        (
            "m",
            r"is 321 m in unit m, must be 1 mm to 100 m; --unit mm .* 321 mm",
        ),
        ("um", r"longest side is 0\.321 mm in unit um.*--unit mm would make it 321 mm"),
    ],
)
def test_an_implausible_size_is_refused_with_the_unit_that_makes_sense(
    unit: str, message: str, tmp_path: Path
) -> None:
    mesh = brick().apply_scale(321.0 / 80.0)
    path = tmp_path / "face.obj"
    mesh.export(path)
    with pytest.raises(MeshError, match=message) as caught:
        load_mesh(path, unit=unit)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_an_implausible_size_that_was_given_is_named_as_given(tmp_path: Path) -> None:
    brick().export(tmp_path / "face.obj")
    with pytest.raises(MeshError) as caught:
        load_mesh(tmp_path / "face.obj", size_mm=1e9)
    rule = "1e+06 m by --size-mm, must be 1 mm to 100 m; state its true size with"
    assert rule in str(caught.value)


def test_scenes_keep_every_body_where_its_transform_puts_it(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = 1.0
    scene.add_geometry(brick().apply_scale(1e-3), geom_name="part", node_name="here")
    scene.graph.update("there", geometry="part", matrix=mirror)
    path = tmp_path / "two.glb"
    scene.export(path)
    mesh = load_mesh(path)
    assert len(mesh.faces) == 96
    np.testing.assert_allclose(sides_mm(mesh), [1040, 60, 80], rtol=1e-5)
    for middle, left in ((0.0, True), (1.0, False)):
        part = (mesh.face_centroids[:, 0] < 0.5) == left
        away = mesh.face_centroids[part] - [middle, 0, 0]
        assert np.all(np.einsum("ij,ij->i", away, mesh.face_normals[part]) > 0)
    assert mesh.source is not None
    assert mesh.source.repairs == ()


def test_obj_understands_what_the_format_allows(tmp_path: Path) -> None:
    text = (
        "\ufeff# comment\r\nmtllib none.mtl\r\no a\r\n"
        "v 0 0 0 1.0\r\nv 40 0 0 # trailing\r\nv 40 40 0\r\nv 0 40 0\r\n"
        "vt 0 0\r\nvn 0 0 1\r\ng An f\r\nusemtl x\r\ns off\r\n"
        "f 1/1/1 2//1 \\\r\n 3/1 -1\r\nl 1 2\r\n"
    )
    mesh = load_mesh(write(tmp_path / "quad.obj", text.encode()))
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 2)
    assert mesh.area == pytest.approx(1.6e-3, rel=1e-12)
    utf16 = write(tmp_path / "quad16.obj", text.removeprefix("\ufeff").encode("utf-16"))
    np.testing.assert_array_equal(load_mesh(utf16).faces, mesh.faces)


def test_a_concave_polygon_keeps_its_outline(tmp_path: Path) -> None:
    # An arrowhead whose first corner sees the notch: a fan would cover it too.
    lines = ["v 0 0 0", "v 40 -30 0", "v 10 0 0", "v 40 30 0"]
    for face in ("f 1 2 3 4", "f 2 3 4 1", "f 3 4 1 2", "f 4 1 2 3"):
        path = write(tmp_path / "arrow.obj", "\n".join([*lines, face]) + "\n")
        mesh = load_mesh(path)
        assert len(mesh.faces) == 2
        assert mesh.area == pytest.approx(0.5 * 60 * 10 * 1e-6, rel=1e-12), face
        assert np.all(mesh.face_normals[:, 2] > 0)


def test_off_may_be_wrapped_coloured_or_glued_to_its_header(tmp_path: Path) -> None:
    flat = "0 0 0  30 0 0  30 30 0  0 30 0".split()
    texts = [
        "OFF\n4 1 0\n" + "\n".join(flat) + "\n4\n0 1\n2 3\n",
        "OFF 4 1 4\n"
        + "\n".join(" ".join(flat[i : i + 3]) for i in (0, 3, 6, 9))
        + "\n4 0 1 2 3 0.1 0.2 0.3\n",
        "COFF\n# colours\n4 1\n"
        + "\n".join(" ".join(flat[i : i + 3]) + " 9 9 9 9" for i in (0, 3, 6, 9))
        + "\n4 0 1 2 3\n",
    ]
    for text in texts:
        mesh = load_mesh(write(tmp_path / "quad.off", text))
        assert len(mesh.faces) == 2
        assert mesh.area == pytest.approx(9e-4, rel=1e-12)


PLY_STRIP = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement tristrips 1\nproperty list int int vertex_indices\n"
    "end_header\n0 0 0\n30 0 0\n0 30 0\n3 0 1 2\n"
)


def triangles_one_by_one(rows):
    """What strips mean: a loop over corners, each triangle turned to face one side."""
    found = []
    for row in rows:
        strip = []
        for corner in row:
            strip = [] if corner == -1 else [*strip, corner]
            if len(strip) >= 3 and len(set(strip[-3:])) == 3:
                a, b, c = strip[-3:]
                found.append((a, b, c) if len(strip) % 2 else (b, a, c))
    return found


@pytest.mark.parametrize(
    "rows",
    [
        [[0, 1, 2]],
        [[0, 1, 2, 3, 4, 5]],
        [[0, 1, 2, -1, 2, 1, 3, 5]],
        [[0, 1, 2, 3, -1, 4, 5, 0], [3, 4, 5, 0, 1]],
        [[-1, 0, 1, 2, -1, -1, 1, 2, 3, -1]],
        # Turns its corner by naming one twice.
        [[0, 1, 2, 3, 3, 4, 4, 5, 1]],
        [[], [0, 1, 2], [], [5, 4, 3, 2, 1, 0]],
    ],
)
@pytest.mark.parametrize("order", ["ascii", "binary_big_endian"])
def test_triangle_strips_of_ply_files_are_triangles(rows, order):
    points = [(0, 0, 0), (9, 0, 1), (3, 8, 0), (9, 9, 4), (1, 2, 7), (5, 5, 5)]
    head = (
        f"ply\nformat {order} 1.0\nelement vertex 6\nproperty float x\nproperty float y"
        f"\nproperty float z\nelement tristrips {len(rows)}\n"
        "property list int int vertex_indices\nend_header\n"
    ).encode()
    if order == "ascii":
        lines = [*points, *((len(row), *row) for row in rows)]
        body = "".join(" ".join(map(str, line)) + "\n" for line in lines).encode()
    else:
        body = np.array(points, ">f4").tobytes()
        body += b"".join(np.array([len(row), *row], ">i4").tobytes() for row in rows)
    raw = read_ply(head + body)
    assert [tuple(face) for face in raw.faces] == triangles_one_by_one(rows)


def test_a_torus_in_strips_is_the_same_surface(tmp_path):
    """As scanners' files store it: all strips in one list, with -1 between."""
    n, m = 24, 12
    u, v = (2 * np.pi * np.arange(k) / k for k in (n, m))
    ring = 30.0 + 10.0 * np.cos(v)
    x, y = (np.outer(f(u), ring).ravel() for f in (np.cos, np.sin))
    z = np.tile(10.0 * np.sin(v), n)
    strips = []
    for i in range(n):
        for j in range(m + 1):
            strips += [i * m + j % m, (i + 1) % n * m + j % m]
        strips.append(-1)
    text = (
        f"ply\nformat ascii 1.0\nelement vertex {n * m}\nproperty float x\n"
        "property float y\nproperty float z\nelement tristrips 1\n"
        "property list int int vertex_indices\nend_header\n"
    )
    text += "".join(f"{a} {b} {c}\n" for a, b, c in zip(x, y, z, strict=True))
    text += " ".join(map(str, [len(strips), *strips])) + "\n"
    raw = read_ply(text.encode())
    assert len(raw.faces) == 2 * n * m
    # Each edge once either way: closed, and wound alike.
    edges = raw.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len({tuple(edge) for edge in edges}) == len(edges)
    assert {tuple(edge) for edge in edges} == {tuple(edge) for edge in edges[:, ::-1]}
    mesh = load_mesh(write(tmp_path / "torus.ply", text))
    assert mesh.source.repairs == ()
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    assert volume / 6.0 == pytest.approx(2 * np.pi**2 * 0.03 * 0.01**2, rel=0.08)


PLY_POINTS = (
    "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
    "property float z\nend_header\n0 0 0\n30 0 0\n"
)
STL_TWO = "solid a\n" + 2 * (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 30 0 0\nvertex 0 30 0\n"
    "endloop\nendfacet\n"
)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", PLY_STRIP.replace("3 0 1 2", "2 0 1"), "strip has 2 corners"),
        ("a.ply", PLY_STRIP.replace("3 0 1 2", "5 0 1 2 -1 1"), "has 1 corners"),
        ("a.ply", PLY_STRIP.replace("3 0 1 2", "4 0 1 2 -2"), "vertex -2, of 3"),
        ("a.ply", PLY_STRIP.replace("3 0 1 2", "4 0 1 2 3"), "vertex 3, of 3"),
        ("a.ply", PLY_STRIP.replace("vertex_indices", "corners"), "no list vertex_i"),
        (
            "a.ply",
            PLY_STRIP.replace(
                "end_header",
                "element face 1\nproperty list int int vertex_indices\nend_header",
            )
            + "3 0 1 2\n",
            "faces and triangle strips",
        ),
        ("a.ply", PLY_POINTS, "2 points and no faces"),
        ("a.ply", "hello", "no PLY header"),
        ("a.ply", "", r"the file is empty \(0 bytes\)"),
        ("a.obj", "# nothing\n", "it is empty: no vertices"),
        ("a.obj", TRIANGLE_OBJ, "3 points and no faces"),
        ("a.obj", TRIANGLE_OBJ + "f\n", "line 4: a face needs three corners, has 0"),
        ("a.obj", TRIANGLE_OBJ + "f 1 2 9\n", "face 1 names a vertex that isn't there"),
        (
            "a.obj",
            TRIANGLE_OBJ + "f 1 2 -9\n",
            "face 1 names a vertex that isn't there",
        ),
        ("a.obj", TRIANGLE_OBJ + "f 1 2 0\n", "line 4: vertices count from 1"),
        ("a.obj", TRIANGLE_OBJ + "f 1 2 x\n", "line 4: a face's corner isn't a number"),
        ("a.obj", "v 1 2\n", "line 1: a vertex needs three numbers"),
        ("a.obj", "v 1 2 3.1+e2\n", "could not convert"),
        ("a.obj", "cstype bspline\n", "line 1: free-form geometry"),
        (
            "a.obj",
            "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
            "none of its 1 faces is usable",
        ),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n", "the header promises 3 vertices"),
        (
            "a.off",
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
            "face 1 names a vertex",
        ),
        ("a.off", "OFF\nx\n", "no line with the numbers"),
        ("a.off", "4OFF\n1 1 0\n", "in three dimensions"),
        ("a.off", "OFF BINARY\n1 1 0\n", "binary OFF"),
        ("a.stl", STL_TWO, "0 of 2 facets could be read"),
        ("a.stl", STL_TWO + "endsolid a\n" + STL_TWO, r"2 of 4 facets"),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 2) + b"\1" * 50, "STL"),
        (
            "a.glb",
            b"glTF" + struct.pack("<4I", 2, 999, 4, 0) + b"{}  ",
            "cut short: 24 of 999",
        ),
        ("a.glb", b"PK", "no GLB header"),
        ("a.gltf", "{", "JSON can't be read"),
        ("a.gltf", "[1]", "JSON isn't an object"),
        ("a.3mf", b"not a zip", "can't be read as 3MF"),
        (
            "a.step",
            "ISO-10303",
            r"format '.step' isn't supported; convert it to one of obj",
        ),
        ("mesh", "v", r"format '.' isn't supported"),
        ("a.ply.gz", b"not gzip", "can't be unpacked"),
        ("a.ply.gz", gzip.compress(b"ply" * 99, mtime=0)[:-9], "can't be unpacked"),
        ("a.ply.bz2", b"not bzip2", "can't be unpacked"),
        ("a.zip", b"not a zip", "can't be unpacked"),
        ("a.zip", zipped({"a.txt": b""}), "must hold one mesh, holds 0: none"),
        ("a.zip", zipped({"a.obj": b"", "b.stl": b""}), "holds 2: a.obj, b.stl"),
    ],
)
def test_what_cannot_be_read_whole_is_refused_in_one_line(
    name: str, content: str | bytes, message: str, tmp_path: Path
) -> None:
    path = write(tmp_path / name, content)
    with pytest.raises(MeshError, match=message) as caught:
        load_mesh(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("cut", [0.35, 0.6, 0.95])
@pytest.mark.parametrize("kind", ["ply", "stl", "glb"])
def test_a_truncated_binary_file_is_refused(
    kind: str, cut: float, tmp_path: Path
) -> None:
    data = brick().export(file_type=kind)
    path = write(tmp_path / f"cut.{kind}", data[: int(cut * len(data))])
    with pytest.raises(MeshError):
        load_mesh(path)


def gltf(**changes: object) -> str:
    tree: dict[str, object] = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}],
    }
    return json.dumps(tree | changes)


def test_compressed_and_sparse_gltf_are_refused_not_read_as_zeros(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.gltf"
    draco = {"extensionsRequired": ["KHR_draco_mesh_compression"]}
    unknown = {"extensionsRequired": ["XX_points"]}
    sparse = {
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {}}]
    }
    cases = [
        (draco, "compressed with KHR_draco"),
        (unknown, "requires the extension XX_points"),
        (sparse, "sparse accessors"),
        ({}, "an accessor stores no data"),
    ]
    for changes, message in cases:
        write(path, gltf(**changes))
        with pytest.raises(MeshError, match=message):
            load_mesh(path, unit="m")


def test_an_ascii_stl_may_be_named_in_any_encoding(tmp_path: Path) -> None:
    text = STL_TWO.replace("solid a", "solid Gehäuse") + "endsolid\n"
    for encoding in ("utf-8", "latin-1", "utf-16"):
        mesh = load_mesh(write(tmp_path / "a.stl", text.encode(encoding)))
        assert mesh.area == pytest.approx(4.5e-4, rel=1e-9)


def test_text_numbers_that_break_off_are_refused_not_dropped(tmp_path: Path) -> None:
    # The last vertex is used by no face: everything else looks whole.
    whole = three_mf("millimeter", brick())
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        model = archive.read("3D/3dmodel.model")
    assert load_mesh(write(tmp_path / "a.3mf", whole)).area > 0
    broken = model.replace(b"</vertices>", b'<vertex x="a" y="0" z="0"/></vertices>')
    path = write(tmp_path / "b.3mf", zipped({"3D/3dmodel.model": broken}))
    with pytest.raises(MeshError, match="a number can't be read"):
        load_mesh(path)


def test_a_gltf_reads_no_file_outside_its_folder(tmp_path: Path) -> None:
    secret = write(tmp_path / "secret.bin", b"\0" * 36)
    folder = tmp_path / "model"
    folder.mkdir()
    for uri in (str(secret), "../secret.bin", "missing.bin"):
        accessor = {"componentType": 5126, "count": 3, "type": "VEC3", "bufferView": 0}
        text = gltf(
            buffers=[{"uri": uri, "byteLength": 36}],
            bufferViews=[{"buffer": 0, "byteLength": 36}],
            accessors=[accessor],
        )
        with pytest.raises(MeshError, match=r"isn't beside it|No such file"):
            load_mesh(write(folder / "a.gltf", text))


def test_bad_paths_and_arguments_say_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="no such file; check the path"):
        load_mesh(tmp_path / "absent.obj")
    with pytest.raises(MeshError, match="is a directory; name one mesh file"):
        load_mesh(tmp_path)
    with pytest.raises(
        MeshError, match="unit 'yard' isn't known, use one of mm, cm, m"
    ):
        load_mesh("x.obj", unit="yard")
    with pytest.raises(MeshError, match="give one"):
        load_mesh("x.obj", unit="mm", size_mm=10.0)
    for size in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(MeshError, match="size must be a positive number"):
            load_mesh("x.obj", size_mm=size)


def test_scaling_a_file_with_its_unit_changes_nothing(tmp_path: Path) -> None:
    ball = sphere(37.123, subdivisions=3)
    for name, factor in (("mm", 1.0), ("um", 1000.0)):
        trimesh.Trimesh(ball.vertices * factor, ball.faces, process=False).export(
            tmp_path / f"{name}.obj", digits=17
        )
    one, other = (load_mesh(tmp_path / f"{u}.obj", unit=u) for u in ("mm", "um"))
    np.testing.assert_array_equal(one.faces, other.faces)
    np.testing.assert_allclose(one.vertices, other.vertices, rtol=1e-13, atol=1e-17)


def border_edges_and_bodies(mesh: TriangleMesh) -> tuple[int, int]:
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    graph = trimesh.graph.connected_component_labels(edges, len(mesh.vertices))
    return int((counts == 1).sum()), int(graph.max() + 1)


@needs_shared
def test_the_real_face_scan_is_welded_and_kept_as_it_is() -> None:
    mesh = load_mesh(SHARED / "meshes" / "face_scan_james.obj")
    assert len(mesh.faces) == 12_228
    assert border_edges_and_bodies(mesh) == (552, 6)
    assert sides_mm(mesh).max() == pytest.approx(321.2, abs=0.1)
    assert mesh.source is not None
    made = {repair.kind: repair.count for repair in mesh.source.repairs}
    # A loose triangle's sides are lit by chance; nothing else may be touched.
    assert made.keys() <= {"faces turned outwards", "pieces turned outwards"}
    assert made.get("faces turned outwards", 0) <= 1


@needs_shared
@pytest.mark.parametrize("name", ["vtk_bunny.ply", "vtk_horse.ply"])
def test_published_meshes_stored_inside_out_are_turned(name: str) -> None:
    mesh = load_mesh(SHARED / "meshes" / name, unit="m")
    assert mesh.source is not None
    repairs = {repair.kind: repair.count for repair in mesh.source.repairs}
    assert repairs["faces turned outwards"] == len(mesh.faces)
