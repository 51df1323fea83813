"""What happens to each of the 64 files that break readers, and that it is documented.

`REFUSED`, `READ` and `ENDS` are the table. Here all that are refused go through the
command line, all others through the reader, and the cheapest of those (`CHEAP`) through
planning with few candidates. `benchmarks/meshes/nasty.py` sends all 64 through the
whole default job, each in a process, and holds exit codes and messages against `ENDS`.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from geometry.files.readers import load_mesh

NASTY = Path(__file__).resolve().parents[4] / "shared" / "data" / "nasty"
needs_shared = pytest.mark.skipif(
    not NASTY.is_dir(), reason="the shared data lies beside the repository only"
)

# Exit code 3: a part of the one line that is printed.
REFUSED = {
    "as_BoxWithInfinites.glb": "none of its 12 faces is usable (non-finite vertices",
    "as_empty.ply": "the file is empty (0 bytes); export the mesh again",
    "as_invalid.off": "the header promises 3 vertices and 4 faces",
    "as_malformed2.obj": "line 23: a face needs three corners, has 0",
    "as_number_formats.obj": "could not convert string to float: '3.1+e2'",
    "as_points.ply": "it holds 4 points and no faces; a surface is needed",
    "as_testline.obj": "it holds 8 points and no faces",
    "cgal_blobby_3cc.off": "0.8115 mm in unit mm, must be 1 mm to 100 m; --unit m ",
    "cgal_fold.off": "0.3969 mm in unit mm, must be 1 mm to 100 m; --unit m ",
    "derived_empty.obj.gz": "it is empty: no vertices",
    "derived_face_metres.ply": "--unit m would make it 200 mm",
    "tm_cap.zip": "1.614e+04 m in unit m, must be 1 mm to 100 m; --unit mm ",
    "tm_empty.obj": "it is empty: no vertices",
    "tm_empty.stl": "it is empty: no vertices",
    "tm_face_in_group_name.obj": "it holds 1 points and no faces",
    "tm_fuze.obj": "--unit m would make it 215.1 mm",
    "tm_fuze.ply": "--unit m would make it 215.1 mm",
    "tm_headless.ctm": "format '.ctm' isn't supported; convert it to one of obj",
    "tm_not_convex.obj": "--unit m would make it 762 mm",
    "tm_obj_points.obj": "it holds 8 points and no faces",
    "tm_ply_empty_bin.ply": "it is empty: no vertices",
    "tm_ply_points_bin.ply": "it holds 8 points and no faces",
    "tm_points_emptyface.ply": "it holds 1024 points and no faces",
    "tm_soup.stl": "--unit m would make it 997.4 mm",
}
# Planned: faces in the file, faces after repair, longest side in mm, and in which of
# those repairs that leave the shape as it is the counts must be what they are.
READ = {
    "as_3DSMaxExport.STL": (2000, 2000, 57.035, {"vertices welded": 4958}),
    "as_Spider_ascii.stl": (1368, 1312, 8.0, {"zero-area faces removed": 56}),
    "as_box.3mf": (12, 12, 30.0, {}),
    "as_box_longline.obj": (
        944,
        12,
        1.0,
        {"zero-area faces removed": 466, "duplicate faces removed": 466},
    ),
    "as_concave_polygon.obj": (64, 64, 1.4850, {}),
    "as_cube_with_vertexcolors.obj": (12, 12, 1.0, {}),
    "as_sphereWithHole.stl": (285, 285, 3.0, {"vertices welded": 709}),
    "as_triangle.stl": (1, 1, 2.0, {}),
    "as_triangle_with_two_solids.stl": (2, 2, 4.0, {}),
    "cgal_ALSTOM_TEST4.off": (2033, 2033, 862.52, {}),
    "cgal_cube-shuffled.off": (12, 12, 2.0, {}),
    "cgal_degtri_sliding.off": (8, 4, 5.0, {"zero-area faces removed": 4}),
    "cgal_horizons.off": (3200, 3200, 1.6385, {}),
    "cgal_mask_cone.off": (2332, 2332, 1.56624, {"vertices welded": 30}),
    "cgal_oblong-shuffled.off": (840, 840, 78.0, {"vertices welded": 2}),
    "cgal_quads_to_stitch.off": (16, 16, 2.0, {"vertices welded": 5}),
    "cgal_tet-shuffled.off": (4, 4, 1.0, {}),
    "derived_face_dup_faces.ply": (
        12728,
        12228,
        321.24,
        {"vertices welded": 287, "duplicate faces removed": 500},
    ),
    "derived_face_georef.ply": (12228, 12228, 200.0, {"vertices welded": 287}),
    "derived_face_holes.ply": (
        11643,
        11643,
        321.24,
        {"vertices welded": 287, "unreferenced vertices removed": 5},
    ),
    "derived_face_mm.ply": (12228, 12228, 200.0, {"vertices welded": 287}),
    "derived_face_zero_area.ply": (
        12428,
        12228,
        321.24,
        {"vertices welded": 387, "zero-area faces removed": 200},
    ),
    "igl_2triangles.off": (2, 2, 2.0, {}),
    "igl_halftunnel.off": (1568, 1568, 12.295, {}),
    "igl_inspired_mesh_quads_Conjugate.off": (3266, 3266, 41.555, {}),
    "igl_planexy.off": (32, 32, 2.0, {}),
    "tm_Duck.glb": (4212, 4212, 1654.8, {"vertices welded": 291}),
    "tm_boolean.glb": (3936, 3936, 5707.1, {"vertices welded": 4}),
    "tm_cube_and_sphere_same_name.3mf": (5132, 5132, 92.801, {}),
    "tm_joined_tetrahedra.obj": (8, 7, 2.0, {"duplicate faces removed": 1}),
    "tm_mirror.ply": (286, 286, 1.1180, {}),
    "tm_nancolor.obj": (12, 12, 1.0, {}),
    "tm_nested.glb": (36, 36, 3336.6, {"vertices welded": 48}),
    "tm_obj_with_no_face_in_chunk.obj": (1, 1, 3.0, {}),
    "tm_pins.glb": (3408, 3408, 254.0, {}),
    "tm_quadknot.obj": (2880, 2880, 181.32, {}),
    "tm_simple_pole.glb": (580, 580, 20500.0, {"vertices welded": 624}),
    "tm_tet.ply": (4, 4, 2.0, {}),
    "tm_two_objects_mixed_case_names.stl": (24, 24, 6.0, {"vertices welded": 56}),
    "tm_whitespace.off": (12, 12, 3.2660, {}),
}
# Exit code of the whole default job, and words of its message, which
# `benchmarks/meshes/nasty.py` holds every file to.
ENDS = {
    "as_3DSMaxExport.STL": (1, "of the reachable target, 90.0 % is required"),
    "as_Spider_ascii.stl": (1, "of the reachable target, 90.0 % is required"),
    "as_box.3mf": (1, "of the target predicted measured at"),
    "as_box_longline.obj": (1, "no point was measured"),
    "as_concave_polygon.obj": (1, "no point was measured"),
    "as_cube_with_vertexcolors.obj": (1, "no point was measured"),
    "as_sphereWithHole.stl": (1, "of the reachable target, 90.0 % is required"),
    "as_triangle.stl": (1, "no point was measured"),
    "as_triangle_with_two_solids.stl": (1, "no point was measured"),
    "cgal_ALSTOM_TEST4.off": (0, "planned, check passed"),
    "cgal_cube-shuffled.off": (1, "no point was measured"),
    "cgal_degtri_sliding.off": (1, "no point was measured"),
    "cgal_horizons.off": (1, "no point was measured"),
    "cgal_mask_cone.off": (1, "can be lit from anywhere in the workspace"),
    "cgal_oblong-shuffled.off": (1, "can be lit from anywhere in the workspace"),
    "cgal_quads_to_stitch.off": (1, "no point was measured"),
    "cgal_tet-shuffled.off": (1, "no point was measured"),
    "derived_face_dup_faces.ply": (0, "planned, check passed"),
    "derived_face_georef.ply": (0, "planned, check passed"),
    "derived_face_holes.ply": (0, "planned, check passed"),
    "derived_face_mm.ply": (0, "planned, check passed"),
    "derived_face_zero_area.ply": (0, "planned, check passed"),
    "igl_2triangles.off": (1, "no point was measured"),
    "igl_halftunnel.off": (1, "of the reachable target, 90.0 % is required"),
    "igl_inspired_mesh_quads_Conjugate.off": (0, "planned, check passed"),
    "igl_planexy.off": (1, "no point was measured"),
    "tm_Duck.glb": (1, "of the reachable target, 90.0 % is required"),
    "tm_boolean.glb": (4, "no camera of 480 poses measures any lit sample"),
    "tm_cube_and_sphere_same_name.3mf": (
        1,
        "of the reachable target, 90.0 % is required",
    ),
    "tm_joined_tetrahedra.obj": (1, "no point was measured"),
    "tm_mirror.ply": (1, "no point was measured"),
    "tm_nancolor.obj": (1, "no point was measured"),
    "tm_nested.glb": (1, "can be lit from anywhere in the workspace"),
    "tm_obj_with_no_face_in_chunk.obj": (1, "no point was measured"),
    "tm_pins.glb": (0, "planned, check passed"),
    "tm_quadknot.obj": (1, "of the reachable target, 90.0 % is required"),
    "tm_simple_pole.glb": (4, "lights any part of the target"),
    "tm_tet.ply": (1, "no point was measured"),
    "tm_two_objects_mixed_case_names.stl": (1, "no point was measured"),
    "tm_whitespace.off": (1, "no point was measured"),
}
# The library can't read the first, and cuts the second as a fan over its hole.
UNLIKE_LIBRARY = {
    "igl_inspired_mesh_quads_Conjugate.off",
    "as_concave_polygon.obj",
}


@needs_shared
def test_the_table_names_every_file_once() -> None:
    names = {path.name for path in NASTY.iterdir()}
    assert names == REFUSED.keys() | READ.keys()
    assert not REFUSED.keys() & READ.keys()
    assert len(names) == 64
    assert ENDS.keys() == READ.keys()
    assert {code for code, _ in ENDS.values()} <= {0, 1, 4}


@needs_shared
@pytest.mark.parametrize("name", sorted(REFUSED))
def test_a_refused_file_ends_the_main_job_in_one_line(
    name: str, small_job, tmp_path: Path
) -> None:
    ended = small_job.run(NASTY / name, tmp_path)
    assert ended.code == 3
    assert ended.plan is None
    assert ended.lines == 1
    assert ended.message.startswith(f"plan: {NASTY / name}: ")
    assert REFUSED[name] in ended.message
    assert not (tmp_path / "plan").exists()


@needs_shared
@pytest.mark.parametrize("name", sorted(READ))
def test_a_file_that_is_read_is_read_whole(name: str) -> None:
    stored, kept, size, repairs = READ[name]
    mesh = load_mesh(NASTY / name)
    source = mesh.source
    assert source is not None
    assert (source.n_faces, len(mesh.faces)) == (stored, kept)
    assert 1e3 * np.ptp(mesh.bounds, axis=0).max() == pytest.approx(size, rel=2e-5)
    made = {repair.kind: repair.count for repair in source.repairs}
    assert made.items() >= repairs.items()
    if name in UNLIKE_LIBRARY:
        return
    other = library(NASTY / name)
    assert len(other.faces) == stored
    scale = source.scale_to_m
    # Faces without area add none, doubled ones are compared by the set of places.
    np.testing.assert_array_equal(
        places(mesh.corners, scale), places(other.triangles * scale, scale)
    )


def library(path: Path) -> trimesh.Trimesh:
    """The file as trimesh reads it, which shares no code with the readers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return trimesh.load_scene(path, process=False, skip_materials=True).to_mesh()


def places(corners: np.ndarray, scale: float) -> np.ndarray:
    """Return the faces with area, corners and rows sorted, each once."""
    a, b, c = (corners[:, k] for k in range(3))
    sides = np.stack([b - a, c - b, a - c])
    longest = np.einsum("kij,kij->ki", sides, sides).max(axis=0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    step = scale * 1e-3 * max(np.abs(corners / scale).max(), 1e-3) / 10
    grid = np.round(corners[area > 1e-10 * longest] / step).astype(np.int64)
    order = np.lexsort(grid.transpose(2, 0, 1)[::-1], axis=-1)
    grid = np.take_along_axis(grid, order[:, :, None], axis=1)
    return np.unique(grid.reshape(-1, 9), axis=0)


@needs_shared
def test_the_concave_polygons_and_mixed_quads_cover_what_they_outline() -> None:
    """Areas by a slow reading of the text, polygon by polygon."""
    mesh = load_mesh(NASTY / "as_concave_polygon.obj")
    assert mesh.area == pytest.approx(1e-6 * polygon_area_obj(), rel=1e-5)
    text = (NASTY / "igl_inspired_mesh_quads_Conjugate.off").read_text().split()
    n, m = int(text[1]), int(text[2])
    points = np.array(text[4 : 4 + 3 * n], dtype=float).reshape(-1, 3)
    at, triangles = 4 + 3 * n, 0
    for _ in range(m):
        triangles += int(text[at]) - 2
        at += 1 + int(text[at])
    quads = load_mesh(NASTY / "igl_inspired_mesh_quads_Conjugate.off")
    assert triangles == len(quads.faces) == 3266
    assert len(quads.vertices) == n
    np.testing.assert_allclose(
        1e3 * np.ptp(quads.vertices, axis=0), np.ptp(points, axis=0), rtol=1e-9
    )


def polygon_area_obj() -> float:
    """Sum of the areas of plane polygons: half the length of their vector area."""
    points: list[list[float]] = []
    total = 0.0
    for line in (NASTY / "as_concave_polygon.obj").read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            outline = np.array([points[int(w.split("/")[0]) - 1] for w in words[1:]])
            local = outline - outline[0]
            area = np.cross(local[:-1], local[1:]).sum(axis=0)
            total += 0.5 * float(np.linalg.norm(area))
    return total


@needs_shared
def test_a_georeferenced_face_is_read_where_it_stands() -> None:
    """Coordinates near 10^6 cost float32 digits in the file, nothing in the reading."""
    far, near = (
        load_mesh(NASTY / f"derived_face_{name}.ply") for name in ("georef", "mm")
    )
    assert np.abs(far.bounds).max() > 100
    assert np.abs(near.bounds).max() < 1
    np.testing.assert_array_equal(
        np.sort(far.faces, axis=1), np.sort(near.faces, axis=1)
    )
    assert far.area == pytest.approx(near.area, rel=2e-3)


# Planned here with few candidates and without the check, so most end better than above.
CHEAP = {
    "as_triangle.stl": 0,
    "cgal_degtri_sliding.off": 0,
    "cgal_quads_to_stitch.off": 0,
}


@needs_shared
@pytest.mark.parametrize("name", sorted(CHEAP))
def test_a_tiny_file_goes_through_the_main_job(
    name: str, small_job, tmp_path: Path
) -> None:
    code = CHEAP[name]
    ended = small_job.run(NASTY / name, tmp_path)
    assert ended.code == code, ended.message
    assert (ended.plan is not None) == (code in (0, 1))
    assert ended.lines == (0 if code in (0, 1) else 1)
