"""Traps of mesh libraries, each with a file made here: read whole or refused."""

import base64
import bz2
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from geometry.files.gltf_format import read_gltf
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import MeshError, TriangleMesh

# A unit right triangle times 30 mm, twice over: area 2 * 450 mm² as a 30 mm square.
SQUARE = ((0, 0, 0), (30, 0, 0), (30, 30, 0), (0, 30, 0))
AREA = 9e-4
FACET = (
    "facet normal 0 0 1 outer loop vertex 0 0 0 vertex 30 0 0 vertex 0 30 0 "
    "endloop endfacet"
)
V_LINES = "".join(f"v {x} {y} {z}\n" for x, y, z in SQUARE)


def read(path: Path, content: str | bytes, **options) -> TriangleMesh:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_mesh(path, **options)


def refused(path: Path, content: str | bytes, message: str, **options) -> None:
    with pytest.raises(MeshError, match=message) as caught:
        read(path, content, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 2 3 4\n",
        "f -4 -3 -2 -1\n",
        "f 1/ 2/ 3/ 4/\n",
        "f 1//2 2//9 3//1 4//1\n",
        "f 1/5/6 2/5 3//6 4\n",
        "f\t1  2\t3 4   \n",
        "f 1 2 \\\n3 \\\n4",
        "f 1 2 3 4 \\",
        "mtllib C:\\parts\\\nf 1 2 3 4\n",
        "f 1 2 3\r\nf 1 3 4\r\n",
        "f 1 2 3\rf 1 3 4\r",
        "f +1 02 3 4\n",
        "usemtl Å\ng Ålesund é f 1 2\nf 1 2 3 4\n",
    ],
)
def test_obj_corners_in_any_dress(faces: str, tmp_path: Path) -> None:
    for text in (V_LINES + faces, "\ufeff" + V_LINES + faces):
        mesh = read(tmp_path / "a.obj", text)
        assert (len(mesh.vertices), len(mesh.faces)) == (4, 2)
        assert mesh.area == pytest.approx(AREA, rel=1e-12)
    wide = (V_LINES + faces).encode("utf-16")
    assert read(tmp_path / "b.obj", wide).area == pytest.approx(AREA, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (V_LINES.replace("30", "30,0") + "f 1 2 3\n", "could not convert"),
        (V_LINES.replace("30", "3_0") + "f 1 2 3\n", "other signs than digits"),
        (V_LINES + "f 1 2 3_0\n", "line 5: a face's corner isn't a number"),
        (V_LINES + "f 1,2,3\n", "line 5: a face needs three corners, has 1"),
        (V_LINES + "f 1 2 3\0\n", "line 5: a face's corner isn't a number"),
        (V_LINES + "w 1 2 3\nf 1 2 3\n", "line 5: 'w' isn't known in OBJ"),
        (V_LINES + "v 1 2 3 v 4 5 6\nf 1 2 3\n", "could not convert"),
        (V_LINES + "v 1 2 3 4 5\nf 1 2 3\n", "line 5: a vertex has 5 numbers"),
        (V_LINES + "f 1 2 99999999999999999999\n", "face 1 names a vertex"),
        (V_LINES + "call half.obj\nf 1 2 3\n", "line 5: 'call' brings in another"),
    ],
)
def test_obj_damage_is_refused_not_skipped(
    text: str, message: str, tmp_path: Path
) -> None:
    refused(tmp_path / "a.obj", text, message)


def test_a_polygon_round_a_hole_is_cut_inside_its_outline(tmp_path: Path) -> None:
    """A square frame as one polygon: out, over a bridge, round the hole, and back."""
    outer = [(0, 0), (40, 0), (40, 40), (0, 40)]
    hole = [(10, 10), (10, 30), (30, 30), (30, 10)]
    lines = "".join(f"v {x} {y} 0\n" for x, y in outer + hole)
    corners = [1, 2, 3, 4, 1, 5, 6, 7, 8, 5]
    for turn in range(len(corners)):
        order = corners[turn:] + corners[:turn]
        mesh = read(tmp_path / "a.obj", lines + f"f {' '.join(map(str, order))}\n")
        assert mesh.area == pytest.approx(1e-6 * (1600 - 400), rel=1e-9), turn
        inside = np.abs(mesh.face_centroids[:, :2] - 0.02).max(axis=1) < 0.01
        assert not inside.any(), turn
        assert np.all(mesh.face_normals[:, 2] > 0), turn


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("OFF\n4 1 0\n{v}3 0 1 2\n3 0 2 3\n", "header promises 4 vertices and 1 faces"),
        ("OFF\n4 3 0\n{v}3 0 1 2\n3 0 2 3\n", "header promises 4 vertices and 3 faces"),
        ("OFF\n4 2 0\n{v}3 0 1 2\n2 0 2\n", "the content holds something else"),
        ("OFF\n2147483648 2 0\n{v}3 0 1 2\n", "the content holds something else"),
        ("OFF\n4 -1 0\n{v}", "no line with the numbers"),
        ("OFF\n4 1 0\n0 0 0 9\n30 0 0\n30 30 0\n0 30 0\n3 0 1 2\n", "something else"),
    ],
)
def test_off_counts_must_fit(text: str, message: str, tmp_path: Path) -> None:
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in SQUARE)
    refused(tmp_path / "a.off", text.format(v=rows), message)


def ply(
    order: str, real: str, count: str, index: str, *, mixed: bool, extras: bool
) -> bytes:
    """A square as one quad, or as a quad and a triangle; with an element in between."""
    form = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[order]
    kinds = {"float": "f", "double": "d", "short": "h"}
    sizes = {"uchar": "B", "int": "i", "uint": "I", "ushort": "H", "short": "h"}
    head = f"ply\nformat {form} 1.0\nelement vertex 4\n"
    head += "".join(f"property {real} {axis}\n" for axis in "xyz")
    head += "property uchar red\n" * extras
    if extras:
        head += "element junk 2\nproperty list uchar short data\nproperty double w\n"
    head += f"element face {1 + mixed}\n" + "property float before\n" * extras
    head += f"property list {count} {index} vertex_index\n"
    head += "property uchar flag\n" * extras + "end_header\n"
    rows: list[tuple[str, tuple[float, ...]]] = []
    for p in SQUARE:
        rows.append((f"3{kinds[real]}" + "B" * extras, (*p, *((7,) * extras))))
    if extras:
        rows += [("B2hd", (2, 10, 13, 0.5)), ("Bd", (0, 0.25))]
    for corners in [(0, 1, 2, 3), (0, 1, 2)][: 1 + mixed]:
        kind = "f" * extras + f"{sizes[count]}{len(corners)}{sizes[index]}"
        values = (0.5,) * extras + (len(corners), *corners) + (1,) * extras
        rows.append((kind + "B" * extras, values))
    if order:
        return head.encode() + b"".join(struct.pack(order + k, *v) for k, v in rows)
    return (head + "".join(" ".join(map(str, v)) + "\n" for _, v in rows)).encode()


@pytest.mark.parametrize("order", ["<", ">", ""])
@pytest.mark.parametrize("real", ["float", "double", "short"])
@pytest.mark.parametrize(("count", "index"), [("uchar", "int"), ("uint", "short")])
def test_ply_in_every_order_and_type(
    order: str, real: str, count: str, index: str, tmp_path: Path
) -> None:
    for mixed in (False, True):
        for extras in (False, True):
            data = ply(order, real, count, index, mixed=mixed, extras=extras)
            mesh = read(tmp_path / "a.ply", data)
            assert mesh.source is not None
            # The triangle of a mixed file is one that the quad is cut into.
            assert mesh.source.n_faces == 2 + mixed
            assert len(mesh.faces) == 2
            assert mesh.area == pytest.approx(AREA, rel=1e-12)
            refused(tmp_path / "b.ply", data + b"9", "more than its header says")
            refused(tmp_path / "c.ply", data[:-2], "cut short|isn't there|there are")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("property float z", "property float w"), "no x, y and z"),
        (("vertex_indices", "corners"), "no list vertex_indices"),
        (("uchar int", "float int"), "has the line 'property list float int"),
        (("element face 1", "element face -1"), "has the line 'element face -1'"),
        (("element face 1", "element face 999999999999"), "cut short"),
        (("format ascii 1.0\n", ""), "doesn't state the format"),
        (("3 0 1 2\n", "2 0 1\n"), "face 1 has 2 corners"),
        (("3 0 1 2\n", "3 0 1 1.5\n"), "isn't whole"),
        (("3 0 1 2\n", "3 0 1 nan\n"), "isn't whole"),
        (("3 0 1 2\n", "3 0 1 1e30\n"), "isn't whole"),
        (("3 0 1 2\n", "3 0 1 -1\n"), r"face 1 names a vertex that isn.t there, of 3"),
        (("3 0 1 2\n", "3 0 1 3\n"), r"face 1 names a vertex that isn.t there, of 3"),
        (("30 0 0", "30,0 0 0"), "could not convert"),
    ],
)
def test_ply_damage_is_refused(
    change: tuple[str, str], message: str, tmp_path: Path
) -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
        "end_header\n0 0 0\n30 0 0\n0 30 0\n3 0 1 2\n"
    )
    assert read(tmp_path / "a.ply", text).area == pytest.approx(4.5e-4)
    assert change[0] in text
    refused(tmp_path / "a.ply", text.replace(*change), message)
    crlf = text.replace("\n", "\r\n")
    assert read(tmp_path / "b.ply", crlf).area == pytest.approx(4.5e-4)


def stl(n: int, head: bytes = b"solid made by hand") -> bytes:
    record = struct.pack("<12fH", 0, 0, 0, 0, 0, 0, 30, 0, 0, 0, 30, 0, 0x801F)
    return head.ljust(80) + struct.pack("<I", n) + record


def test_binary_stl_called_solid_or_coloured_is_read_by_its_count(
    tmp_path: Path,
) -> None:
    for head in (b"solid made by hand", b"COLOR=\xff\0\0\xff", b"\0"):
        mesh = read(tmp_path / "a.stl", stl(1, head))
        assert mesh.area == pytest.approx(4.5e-4)
    for n in (0, 2, 2**32 - 1):
        refused(tmp_path / "a.stl", stl(n, b"made"), f"length .{n} facets in 134 bytes")
        refused(tmp_path / "a.stl", stl(n), "STL")


SCENE = {
    "asset": {"version": "2.0"},
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
}


def gltf(
    *, nodes: object = None, order: tuple[int, ...] = (0, 1, 2, 0, 2, 3), **changes
):
    points = np.array(SQUARE, "<f4") / 1000
    stored = points.tobytes() + np.array(order, "<u2").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(stored).decode()
    tree = {
        **SCENE,
        "buffers": [{"byteLength": len(stored), "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 2 * len(order)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {
                "bufferView": 1,
                "componentType": 5123,
                "count": len(order),
                "type": "SCALAR",
            },
        ],
    }
    if nodes is not None:
        tree["nodes"] = nodes
    return json.dumps(tree | changes)


def mode(number: int) -> dict[str, object]:
    shape = {"attributes": {"POSITION": 0}, "indices": 1, "mode": number}
    return {"meshes": [{"primitives": [shape]}]}


def test_gltf_scenes_are_placed_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.gltf"
    turn = [0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]
    nested = [
        {"translation": [1, 2, 3], "children": [1, 2]},
        {"rotation": turn, "scale": [2, 1, 1], "mesh": 0},
        {"scale": [-1, 1, 1], "mesh": 0, "camera": 0},
    ]
    mesh = read(path, gltf(nodes=nested))
    assert len(mesh.faces) == 4
    # Twice as long and turned a quarter: x to y; mirrored: to negative x.
    by_hand = np.array([[1 - 0.03, 2, 3], [1.0, 2.06, 3]])
    np.testing.assert_allclose(mesh.bounds, by_hand, atol=1e-7)
    assert mesh.area == pytest.approx(3 * AREA, rel=1e-6)
    columns = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]
    mesh = read(path, gltf(nodes=[{"matrix": columns, "mesh": 0}]))
    by_hand = np.array([[4.97, 6, 7], [5, 6.03, 7]])
    np.testing.assert_allclose(mesh.bounds, by_hand, atol=1e-6)
    both = [{"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}]
    assert len(read(path, gltf(nodes=both)).faces) == 2
    assert len(read(path, gltf(nodes=both, scenes=[])).faces) == 4


def test_gltf_strips_and_fans_are_triangles(tmp_path: Path) -> None:
    path = tmp_path / "a.gltf"
    for number, order in ((5, (0, 1, 3, 2)), (6, (0, 1, 2, 3))):
        mesh = read(path, gltf(order=order, **mode(number)))
        assert mesh.area == pytest.approx(AREA, rel=1e-6)
        # Before the winding is mended: every other triangle of a strip is turned.
        raw = read_gltf(gltf(order=order, **mode(number)).encode(), None)
        a, b, c = (raw.vertices[raw.faces[:, k]] for k in range(3))
        assert np.all(np.cross(b - a, c - a)[:, 2] > 0)
    refused(path, gltf(order=(0, 1, 2, 3)), "4 corners make no triangles")
    refused(path, gltf(order=(0, 1, 2, 0, 2, 4)), "a vertex that isn't there, of 4")
    refused(path, gltf(**mode(1)), "shows no triangle mesh")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"nodes": [{"mesh": 0, "skin": 0}]}, "a skeleton poses its mesh"),
        ({"nodes": [{"mesh": 0, "weights": [0.5]}]}, "morph targets deform its mesh"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "hangs in two places"),
        ({"nodes": [{"mesh": 1}]}, "it names entry 1 of 1 meshes"),
        ({"nodes": [{"mesh": 0, "scale": [1, 1]}]}, "no usable transform"),
        ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "no usable transform"),
        ({"nodes": [{"mesh": 0, "matrix": [1, 2]}]}, "a matrix of 2 numbers"),
        ({"scene": 3}, "it names entry 3 of 1 scenes"),
        ({"asset": {"version": "1.0"}}, "glTF version '1.0'"),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, "compressed with EXT_m"),
        (
            {"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}]},
            "EXT_mesh_gpu_instancing repeats",
        ),
        ({"bufferViews": [{"buffer": 0, "byteLength": 40}] * 2}, "don't fit into a v"),
        ({"buffers": [{"byteLength": 99, "uri": "data:;base64,AAAA"}]}, "3 of 99"),
        ({"buffers": [{"byteLength": 99}]}, "its buffer 0 isn't there"),
    ],
)
def test_gltf_that_shows_something_else_is_refused(
    changes: dict[str, object], message: str, tmp_path: Path
) -> None:
    refused(tmp_path / "a.gltf", gltf(**changes), message)


def test_gltf_quantised_positions_are_decoded(tmp_path: Path) -> None:
    points = np.array(SQUARE, np.int16) * 1000
    padded = np.zeros((4, 4), "<i2")
    padded[:, :3] = points
    stored = padded.tobytes()
    uri = "data:;base64," + base64.b64encode(stored).decode()
    shape = {"attributes": {"POSITION": 0}, "mode": 6}
    changes = {
        "meshes": [{"primitives": [shape]}],
        "buffers": [{"byteLength": 32, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": 32, "byteStride": 8}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5122,
                "normalized": True,
                "count": 4,
                "type": "VEC3",
            }
        ],
    }
    used = {"extensionsUsed": ["KHR_mesh_quantization"]}
    mesh = read(tmp_path / "a.gltf", gltf(**changes, **used))
    assert mesh.area == pytest.approx((30_000 / 32_767) ** 2, rel=1e-12)
    refused(tmp_path / "a.gltf", gltf(**changes), "holds VEC3 of 5122")


MODEL = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"{more}>
<resources><object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="30"
 y="0" z="0"/><vertex x="0" y="30" z="0"/></vertices><triangles>
<triangle v1="0" v2="1" v3="{last}"/></triangles></mesh></object>{objects}</resources>
<build>{items}</build></model>"""


def three_mf(path: Path, **parts: str) -> Path:
    words = {"unit": "millimeter", "more": "", "last": "2", "objects": ""}
    words["items"] = '<item objectid="1"/>'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", MODEL.format(**(words | parts)))
    return path


def test_3mf_components_and_items_are_placed_by_their_transforms(
    tmp_path: Path,
) -> None:
    twice = (
        '<object id="2"><components><component objectid="1"/><component objectid="1" '
        'transform="0 1 0 -1 0 0 0 0 1 100 0 0"/></components></object>'
    )
    items = (
        '<item objectid="2"/><item objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 50"/>'
    )
    mesh = load_mesh(three_mf(tmp_path / "a.3mf", objects=twice, items=items))
    assert len(mesh.faces) == 3
    # The second is turned a quarter about z (row vectors) and moved along x.
    by_hand = np.array([[0, 0, 0], [0.1, 0.03, 0.05]])
    np.testing.assert_allclose(mesh.bounds, by_hand, atol=1e-12)
    assert mesh.area == pytest.approx(3 * 4.5e-4)
    assert load_mesh(three_mf(tmp_path / "b.3mf", unit="inch")).area == pytest.approx(
        4.5e-4 * 25.4**2
    )


BEAMS = ' requiredextensions="b" xmlns:b="http://schemas.microsoft.com/beams/2017/02"'


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"unit": "furlong"}, "states the unit 'furlong', which isn't known"),
        ({"last": "3"}, "names a vertex that isn't there, of 3"),
        ({"last": "-1"}, "names a vertex that isn't there, of 3"),
        ({"last": "1_0"}, "other signs than digits"),
        ({"items": ""}, "its build lists no object"),
        ({"items": '<item objectid="9"/>'}, "its build names object '9', not there"),
        ({"items": '<item objectid="1" transform="1 0"/>'}, "isn't twelve numbers"),
        ({"more": BEAMS}, "it requires the extension"),
        (
            {
                "objects": '<object id="2"><components><component objectid="2"/>'
                "</components></object>",
                "items": '<item objectid="2"/>',
            },
            "is a component of itself",
        ),
    ],
)
def test_3mf_that_cannot_be_built_is_refused(
    parts: dict[str, str], message: str, tmp_path: Path
) -> None:
    path = three_mf(tmp_path / "a.3mf", **parts)
    with pytest.raises(MeshError, match=message):
        load_mesh(path)


def test_3mf_that_multiplies_without_end_is_refused_at_once(tmp_path: Path) -> None:
    """Each object holds the one before ten times: 10^12 triangles from a page."""
    objects = "".join(
        f'<object id="{n}"><components>'
        + f'<component objectid="{n - 1}"/>' * 10
        + "</components></object>"
        for n in range(2, 14)
    )
    path = three_mf(tmp_path / "a.3mf", objects=objects, items='<item objectid="13"/>')
    with pytest.raises(MeshError, match="repeated without end"):
        load_mesh(path)


@pytest.mark.parametrize(
    "text",
    [
        f"solid a {FACET}\n{FACET}\nendsolid a\n",
        f"solid a\n{FACET}\nendsolid a {FACET}\n",
        f"solid a\n{FACET}\nendsolid a solid b {FACET}\n{FACET}\nendsolid\n",
    ],
)
def test_stl_facets_in_the_place_of_a_name_are_refused(
    text: str, tmp_path: Path
) -> None:
    refused(tmp_path / "a.stl", text, "facets stand on the line of a 'solid'")


def test_a_bz2_file_damaged_behind_its_first_stream_is_refused(tmp_path: Path) -> None:
    halves = [bz2.compress(part.encode()) for part in (V_LINES, "f 1 2 3 4\n")]
    whole = b"".join(halves)
    assert read(tmp_path / "a.obj.bz2", whole).area == pytest.approx(AREA)
    damaged = halves[0] + b"X" + halves[1][1:]
    refused(tmp_path / "b.obj.bz2", damaged, "can't be unpacked")
    refused(tmp_path / "c.obj.bz2", whole[:-3], "ends before the end of its stream")


@pytest.mark.parametrize("shift", [0, 1, 2, 3])
@pytest.mark.parametrize("way", [1, -1])
def test_a_polygon_stored_twice_counts_once(
    shift: int, way: int, tmp_path: Path
) -> None:
    again = np.roll([1, 2, 3, 4], shift)[::way]
    text = V_LINES + "f 1 2 3 4\nf " + " ".join(map(str, again)) + "\n"
    mesh = read(tmp_path / "a.obj", text)
    assert len(mesh.faces) == 2
    assert mesh.area == pytest.approx(AREA, rel=1e-12)
    apart = V_LINES + V_LINES + "f 1 2 3 4\nf " + " ".join(map(str, again + 4))
    assert read(tmp_path / "b.obj", apart).area == pytest.approx(AREA, rel=1e-12)


def test_a_polygon_that_takes_minutes_to_cut_is_refused(tmp_path: Path) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 3002, endpoint=False)
    radius = 30.0 + 5.0 * np.cos(angle * 1501.0)
    lines = [
        f"v {x} {y} 0\n"
        for x, y in zip(radius * np.cos(angle), radius * np.sin(angle), strict=True)
    ]
    corners = " ".join(str(k + 1) for k in range(3002))
    text = "".join(lines) + f"f {corners}\n"
    refused(tmp_path / "a.obj", text, "concave and has 3002 corners")


def test_a_small_archive_of_much_is_not_set_aside_at_once(
    tmp_path: Path, monkeypatch
) -> None:
    import gzip

    from geometry.files import archives

    path = tmp_path / "a.obj.gz"
    path.write_bytes(gzip.compress(b"\n" * (1 << 21)))
    monkeypatch.setattr(archives, "_MAX_BYTES", 1 << 20)
    with pytest.raises(MeshError, match="unpacks to more than"):
        load_mesh(path)


def test_absurd_coordinates_count_as_infinite(tmp_path: Path) -> None:
    grid = [(x, y) for y in range(6) for x in range(6)]
    lines = "".join(f"v {3 * x} {3 * y} 0\n" for x, y in grid) + "v 1e200 0 0\n"
    quads = "".join(
        f"f {i + 1} {i + 2} {i + 8} {i + 7}\n" for i in range(29) if i % 6 < 5
    )
    mesh = read(tmp_path / "a.obj", lines + quads + "f 1 2 37\n")
    assert mesh.source is not None
    made = {repair.kind: repair.count for repair in mesh.source.repairs}
    assert made == {"non-finite vertices removed": 1, "non-finite faces removed": 1}
    assert mesh.area == pytest.approx(225e-6)
