from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plain_shapes import box, cylinder, grid, joined, torus

from geometry.curvature.curvature import CurvatureField, principal_curvatures
from geometry.curvature.face_curvature import steep_directions
from geometry.curvature.refinement import cut_for_curvature
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import components, face_pairs, mesh_edges
from geometry.regions.cones import averaged_normals, normal_cone
from geometry.regions.dominance import dominant_faces, face_curvedness
from geometry.regions.regions import DominantRegions, dominant_regions
from geometry.shapes.primitives import sphere

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data" / "meshes"
needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the shared data lies beside the repository only"
)


def regions_of(mesh: TriangleMesh, **options: float) -> DominantRegions:
    return dominant_regions(mesh, principal_curvatures(mesh), **options)


BUMPS = np.array([[-0.05, 0.0], [0.05, 0.02]])


def bumpy(cells: int = 100) -> TriangleMesh:
    """A slightly domed plate 0.3 m wide with two steep bumps."""
    flat = grid(0.3, 0.2, divisions=(cells, (2 * cells) // 3))
    xy = flat.vertices[:, :2]
    z = -0.3 * (xy**2).sum(axis=1)
    for centre, height in zip(BUMPS, (0.015, 0.012), strict=True):
        z = z + height * np.exp(-((xy - centre) ** 2).sum(axis=1) / (2 * 0.012**2))
    return TriangleMesh(np.column_stack([xy, z]), flat.faces)


def near_bumps(mesh: TriangleMesh, reach: float) -> np.ndarray:
    away = mesh.face_centroids[:, None, :2] - BUMPS
    return np.linalg.norm(away, axis=2).min(axis=1) < reach


def overlap(a: np.ndarray, b: np.ndarray, weights: np.ndarray) -> float:
    return float(weights[a & b].sum() / weights[a | b].sum())


def test_dominant_is_the_asked_share_of_the_trusted_area_and_the_most_curved() -> None:
    ball = sphere(0.1, subdivisions=5)
    mesh = TriangleMesh(ball.vertices * [1.0, 0.6, 0.35], ball.faces)
    field = principal_curvatures(mesh)
    curvedness, trusted = face_curvedness(mesh, field)
    assert trusted.all()
    for share in (0.1, 0.2, 0.4):
        found = dominant_regions(mesh, field, area_share=share, min_region_share=0.0)
        assert share <= found.dominant_share < share + 0.03
        inside = found.face_region >= 0
        assert curvedness[inside].min() >= curvedness[~inside].max()


def test_bumps_are_dominant_the_plate_and_its_rim_are_not() -> None:
    mesh = bumpy()
    found = regions_of(mesh, area_share=0.1)
    inside = found.face_region >= 0
    assert near_bumps(mesh, 0.05)[inside].all()
    assert inside[near_bumps(mesh, 0.006)].all()


@pytest.mark.parametrize(
    ("mesh", "share"),
    [
        (sphere(0.1, subdivisions=4), 1.0),
        (cylinder(0.05, 0.3, capped=False), 1.0),
        (torus(0.1, 0.01), 1.0),
        (grid(0.2, 0.1, divisions=(30, 20)), 1.0),
    ],
    ids=["sphere", "tube", "thin torus", "plate"],
)
def test_a_uniform_body_is_dominant_as_a_whole(
    mesh: TriangleMesh, share: float
) -> None:
    found = regions_of(mesh)
    assert found.dominant_share == pytest.approx(share, abs=1e-12)
    assert np.all(found.face_region >= 0)


def test_a_plateau_is_never_cut_through() -> None:
    # Rims are curved most, then comes the side, equal everywhere: taken whole.
    mesh = cylinder(0.05, 0.3, around=120, along=120)
    found = regions_of(mesh)
    side = np.abs(mesh.face_normals[:, 2]) < 0.1
    mid_side = side & (np.abs(mesh.face_centroids[:, 2]) < 0.13)
    cap = ~side & (np.linalg.norm(mesh.face_centroids[:, :2], axis=1) < 0.03)
    assert np.all(found.face_region[mid_side] >= 0)
    assert np.all(found.face_region[cap] == -1)


def test_where_nothing_is_trusted_everything_counts_as_uniform() -> None:
    triangle = TriangleMesh(0.1 * np.eye(3), np.array([[0, 1, 2]]))
    field = principal_curvatures(triangle, radius=0.1)
    found = dominant_regions(triangle, field)
    assert not face_curvedness(triangle, field)[1].any()
    assert [list(region.faces) for region in found] == [[0]]
    np.testing.assert_array_equal(found.steep, np.zeros((1, 3)))


def crumpled() -> TriangleMesh:
    """Noise of a fifth of an edge: normals scatter, splitting leaves fragments."""
    ball = sphere(0.1, subdivisions=4)
    noise = np.random.default_rng(0).normal(size=ball.vertices.shape)
    return TriangleMesh(ball.vertices + 0.2 * ball.mean_edge * noise, ball.faces)


@pytest.mark.parametrize("limit", [30.0, 50.0])
@pytest.mark.parametrize(
    "mesh",
    [sphere(0.1, subdivisions=4), torus(0.1, 0.04), bumpy(), crumpled()],
    ids=["sphere", "torus", "bumps", "crumpled"],
)
def test_regions_are_connected_disjoint_and_fit_the_cone(
    mesh: TriangleMesh, limit: float
) -> None:
    found = regions_of(mesh, cone_half_angle=np.deg2rad(limit))
    assert len(found) >= 2
    pairs = face_pairs(mesh_edges(mesh.faces))[0]
    averaged = averaged_normals(mesh, pairs)
    for number, region in enumerate(found):
        assert region.id == number
        np.testing.assert_array_equal(
            region.faces, np.flatnonzero(found.face_region == number)
        )
        areas = mesh.face_areas[region.faces]
        assert region.area_m2 == pytest.approx(areas.sum(), rel=1e-12)
        normals = mesh.face_normals[region.faces]
        mean = areas @ normals
        np.testing.assert_allclose(
            region.mean_normal, mean / np.linalg.norm(mean), atol=1e-12
        )
        angle = np.arccos(np.clip(normals @ region.mean_normal, -1, 1))
        # Noise turns faces by more; what is judged are normals averaged over 1 %.
        turned = np.einsum("ij,ij->i", averaged, mesh.face_normals).min()
        if turned > np.cos(np.deg2rad(15.0)):
            held = areas[angle <= np.deg2rad(limit + 5.0)].sum()
            assert held >= 0.95 * areas.sum()
        mean = areas @ averaged[region.faces]
        lean = averaged[region.faces] @ (mean / np.linalg.norm(mean))
        held = areas[lean >= np.cos(np.deg2rad(limit)) - 1e-12].sum()
        assert held >= 0.95 * areas.sum()
        assert areas[angle <= region.cone_angle + 1e-12].sum() >= 0.98 * areas.sum()
        inner = np.isin(pairs, region.faces).all(axis=1)
        local = np.searchsorted(region.faces, pairs[inner])
        assert components(local, len(region.faces))[0] == 1
    areas = np.array([region.area_m2 for region in found])
    assert np.all(np.diff(areas) <= 1e-9 * mesh.area)
    # Only where the surface is dominant as a whole may a fragment be a region.
    assert areas.min() >= 0.0005 * mesh.area or np.all(found.face_region >= 0)


def test_a_fragment_is_left_alone_only_if_it_fits_no_neighbour() -> None:
    mesh = crumpled()
    least, limit = 0.01, np.deg2rad(50.0)
    found = regions_of(mesh, area_share=1.0, min_region_share=least)
    assert np.all(found.face_region >= 0)
    met = found.face_region[face_pairs(mesh_edges(mesh.faces))[0]]
    met = np.unique(np.sort(met[met[:, 0] != met[:, 1]], axis=1), axis=0)
    assert min(region.area_m2 for region in found) < least * mesh.area
    for a, b in met:
        if min(found[a].area_m2, found[b].area_m2) >= least * mesh.area:
            continue
        union = np.concatenate([found[a].faces, found[b].faces])
        assert normal_cone(mesh, union)[1] > limit


def test_no_more_than_a_tenth_of_what_is_dominant_is_dropped() -> None:
    mesh = crumpled()
    field = principal_curvatures(mesh)
    curvedness, trusted = face_curvedness(mesh, field)
    pairs = face_pairs(mesh.edges, manifold_only=False)[0]
    least = 0.01
    dominant = dominant_faces(mesh, curvedness, trusted, pairs, 0.3, least * mesh.area)
    # Held to the least area, more would be dropped here.
    half_angle = np.deg2rad(50.0)
    found = dominant_regions(
        mesh,
        field,
        area_share=0.3,
        min_region_share=least,
        cone_half_angle=half_angle,
    )
    kept = found.face_region >= 0
    assert not np.any(kept & ~dominant)
    assert mesh.face_areas[kept].sum() >= 0.9 * mesh.face_areas[dominant].sum()
    assert min(region.area_m2 for region in found) < least * mesh.area


def test_mean_curvedness_is_that_of_the_shape() -> None:
    for region in regions_of(sphere(0.1, subdivisions=5)):
        assert region.mean_curvedness == pytest.approx(10.0, rel=0.02)
    for region in regions_of(cylinder(0.05, 0.3, around=120, along=120, capped=False)):
        # The rim is dominant with the rest, but its curvature isn't known.
        assert region.mean_curvedness < 20.0 / np.sqrt(2.0) * 1.02


def test_small_islands_vanish_and_pinholes_are_filled() -> None:
    mesh = bumpy()
    share = mesh.face_areas[near_bumps(mesh, 0.02)].sum() / mesh.area
    big = regions_of(mesh, area_share=0.1, min_region_share=0.0)
    assert len(big) >= 2
    none = regions_of(mesh, area_share=0.1, min_region_share=3 * share)
    assert len(none) == 0
    assert np.all(none.face_region == -1)
    # Around each bump, the ring where its slope has no curvature is a hole.
    filled = regions_of(mesh, area_share=0.1, min_region_share=0.01)
    inside = filled.face_region >= 0
    pairs = face_pairs(mesh_edges(mesh.faces))[0]
    outer = pairs[~inside[pairs].any(axis=1)]
    count, label = components(outer, len(mesh.faces))
    area = np.bincount(label, mesh.face_areas * ~inside, count)
    assert np.all((area == 0) | (area > 0.01 * mesh.area))


def test_steep_is_unit_in_the_face_and_across_a_tube() -> None:
    mesh = cylinder(0.05, 0.3, around=120, along=120, capped=False)
    found = regions_of(mesh)
    steep = found.steep
    length = np.linalg.norm(steep, axis=1)
    known = length > 0
    trusted = face_curvedness(mesh, principal_curvatures(mesh))[1]
    np.testing.assert_array_equal(known, trusted)
    np.testing.assert_allclose(length[known], 1.0, rtol=1e-12)
    across = np.einsum("ij,ij->i", steep, mesh.face_normals)
    np.testing.assert_allclose(across, 0.0, atol=1e-12)
    np.testing.assert_allclose(steep[known, 2], 0.0, atol=0.02)


def test_steep_follows_magnitude_not_sign() -> None:
    # Seen from inside, the tube's steep curvature is negative; the direction stays.
    tube = cylinder(0.05, 0.3, around=90, along=60, capped=False)
    inside = TriangleMesh(tube.vertices, tube.faces[:, ::-1])
    for mesh in (tube, inside):
        steep = steep_directions(mesh, principal_curvatures(mesh))
        known = np.abs(steep).sum(axis=1) > 0
        assert known.mean() > 0.8
        np.testing.assert_allclose(steep[known, 2], 0.0, atol=0.02)


def synthetic(mesh: TriangleMesh, k1: float, k2: float) -> CurvatureField:
    """A made-up field on a plate: k1 along x, k2 along y."""
    n = len(mesh.vertices)
    ways = (np.tile([1.0, 0, 0], (n, 1)), np.tile([0.0, 1, 0], (n, 1)))
    order = (0, 1) if k1 >= k2 else (1, 0)
    ks = (np.full(n, k1), np.full(n, k2))
    valid = np.ones(n, dtype=bool)
    return CurvatureField(
        0.01, 0.01, ks[order[0]], ks[order[1]], ways[order[0]], ways[order[1]], valid
    )


@pytest.mark.parametrize(
    ("k1", "k2", "axis"),
    [
        (10.0, 6.9, 0),
        (10.0, 7.1, None),
        (-10.0, -6.9, 0),
        (-10.0, -7.1, None),
        (6.0, -10.0, 1),
        (-6.0, 10.0, 1),
        (10.0, 0.0, 0),
        (0.0, -10.0, 1),
        (0.0, 0.0, None),
        (1e-3, 0.0, None),
    ],
)
def test_the_direction_is_kept_where_curvatures_differ_by_more_than_0_3(
    k1: float, k2: float, axis: int | None
) -> None:
    mesh = grid(0.2, 0.1, divisions=(6, 4))
    steep = steep_directions(mesh, synthetic(mesh, k1, k2))
    expected = np.zeros(3) if axis is None else np.eye(3)[axis]
    np.testing.assert_allclose(np.abs(steep), np.tile(expected, (48, 1)), atol=1e-9)


def test_a_sphere_has_no_steep_direction() -> None:
    mesh = sphere(0.1, subdivisions=4)
    np.testing.assert_array_equal(
        regions_of(mesh).steep, np.zeros((len(mesh.faces), 3))
    )


def test_regions_move_and_scale_with_the_mesh_and_repeat_exactly() -> None:
    mesh = bumpy(60)
    first, again = regions_of(mesh), regions_of(mesh)
    np.testing.assert_array_equal(first.face_region, again.face_region)
    np.testing.assert_array_equal(first.steep, again.steep)
    turn = Rotation.from_rotvec([0.4, 0.2, -0.9]).as_matrix()
    changed = TriangleMesh(1000 * mesh.vertices @ turn.T + 1e5, mesh.faces)
    other = regions_of(changed)
    same = first.face_region == other.face_region
    assert mesh.face_areas[same].sum() > 0.9999 * mesh.area
    assert len(other) == len(first)
    for a, b in zip(first, other, strict=True):
        assert b.area_m2 == pytest.approx(1e6 * a.area_m2, rel=1e-2)
        assert b.mean_normal @ (turn @ a.mean_normal) > 0.999


def test_remeshing_and_noise_keep_the_dominant_surface() -> None:
    coarse, fine = bumpy(75), bumpy(150)
    masks = [regions_of(mesh).face_region >= 0 for mesh in (coarse, fine)]
    # Faces of the fine plate, looked up in the coarse one by their place.
    cell = np.array([0.3 / 75, 0.2 / 50])
    place = (fine.face_centroids[:, :2] + [0.15, 0.1]) / cell
    column, row = np.floor(place).astype(int).T
    u, v = (place - np.floor(place)).T
    lookup = column * 50 + row + np.where(v > u, 75 * 50, 0)
    assert overlap(masks[0][lookup], masks[1], fine.face_areas) > 0.9
    size = np.linalg.norm(fine.bounds[1] - fine.bounds[0])
    noise = np.random.default_rng(0).normal(size=fine.vertices.shape)
    # Noise of 0.1 % of the size along the normal, a third of an edge here.
    noisy = TriangleMesh(
        fine.vertices + 1e-3 * size * noise * [0, 0, 1] * 0.3, fine.faces
    )
    assert overlap(regions_of(noisy).face_region >= 0, masks[1], fine.face_areas) > 0.8


def test_a_cut_off_box_edge_is_found_on_both_sides() -> None:
    mesh = box((0.1, 0.1, 0.1), divisions=40)
    inside = regions_of(mesh).face_region >= 0
    distance = np.sort(0.05 - np.abs(mesh.face_centroids), axis=1)[:, 1]
    assert inside[distance < 0.002].all()
    assert not inside[distance > 0.02].any()


def test_fragments_take_no_share_of_what_is_dominant() -> None:
    mesh = bumpy()
    rng = np.random.default_rng(0)
    dust = sphere(0.0015, subdivisions=2)
    places = rng.uniform(-0.1, 0.1, (60, 3)) + [0.0, 0.0, 0.3]
    dirty = TriangleMesh(
        np.concatenate([mesh.vertices, *(dust.vertices + at for at in places)]),
        np.concatenate(
            [mesh.faces]
            + [
                dust.faces + len(mesh.vertices) + k * len(dust.vertices)
                for k in range(len(places))
            ]
        ),
    )
    radius = 0.007
    clean = dominant_regions(mesh, principal_curvatures(mesh, radius))
    found = dominant_regions(dirty, principal_curvatures(dirty, radius))
    n = len(mesh.faces)
    assert np.all(found.face_region[n:] == -1)
    kept = overlap(found.face_region[:n] >= 0, clean.face_region >= 0, mesh.face_areas)
    assert kept > 0.99


def test_averaged_normals_lose_noise_and_keep_large_faces() -> None:
    ball = sphere(0.1, subdivisions=6)
    noise = np.random.default_rng(0).normal(size=ball.vertices.shape)
    rough = TriangleMesh(ball.vertices + 0.2 * ball.mean_edge * noise, ball.faces)
    true = ball.face_centroids / np.linalg.norm(
        ball.face_centroids, axis=1, keepdims=True
    )
    pairs = face_pairs(mesh_edges(ball.faces))[0]
    errors = [
        overlap_angle(normals, true)
        for normals in (rough.face_normals, averaged_normals(rough, pairs))
    ]
    assert errors[1] < 0.5 * errors[0]
    cube = box((0.1, 0.1, 0.1))
    pairs = face_pairs(mesh_edges(cube.faces))[0]
    kept = np.einsum("ij,ij->i", averaged_normals(cube, pairs), cube.face_normals)
    assert kept.min() > 0.999


def overlap_angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.arccos(np.clip((a * b).sum(axis=1), -1, 1)) ** 2)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"area_share": 0.0}, r"area_share must lie in \(0, 1\], got 0.0"),
        ({"area_share": 1.01}, "area_share"),
        ({"area_share": float("nan")}, "area_share"),
        ({"min_region_share": -0.1}, r"min_region_share must lie in \[0, 1\)"),
        ({"min_region_share": float("nan")}, "min_region_share"),
        ({"cone_half_angle": 0.0}, "cone_half_angle"),
        ({"cone_half_angle": 4.0}, "cone_half_angle"),
    ],
)
def test_bad_options_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        regions_of(sphere(0.1, subdivisions=1), **options)


def test_a_field_of_another_mesh_is_refused() -> None:
    field = principal_curvatures(sphere(0.1, subdivisions=1))
    with pytest.raises(ValueError, match="the field has 42 vertices, the mesh 162"):
        dominant_regions(sphere(0.1, subdivisions=2), field)


@needs_shared
def test_on_a_real_face_nose_lips_chin_and_brows_come_out() -> None:
    mesh = load_mesh(SHARED / "face_scan_james.obj")
    found = regions_of(mesh)
    inside = found.face_region >= 0
    assert 0.12 < found.dominant_share < 0.25
    # The tip of the nose is the foremost point; the rest lies below or above it.
    tip = mesh.face_centroids[np.argmax(mesh.face_centroids[:, 2])]
    for name, below in (("nose", 0.0), ("lips", 0.033), ("chin", 0.075)):
        level = np.abs(mesh.face_centroids[:, 1] - (tip[1] - below)) < 0.012
        middle = level & (np.abs(mesh.face_centroids[:, 0] - tip[0]) < 0.012)
        front = middle & (mesh.face_centroids[:, 2] > tip[2] - 0.06)
        assert (
            mesh.face_areas[front & inside].sum() > 0.3 * mesh.face_areas[front].sum()
        ), name
    cheeks = (np.abs(np.abs(mesh.face_centroids[:, 0] - tip[0]) - 0.05) < 0.01) & (
        np.abs(mesh.face_centroids[:, 1] - tip[1]) < 0.01
    )
    assert mesh.face_areas[cheeks & inside].sum() < 0.1 * mesh.face_areas[cheeks].sum()
    size = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0])
    noise = np.random.default_rng(0).normal(size=mesh.vertices.shape)
    noisy = TriangleMesh(mesh.vertices + 1e-3 * size * noise / np.sqrt(3), mesh.faces)
    assert overlap(regions_of(noisy).face_region >= 0, inside, mesh.face_areas) > 0.8


def test_the_regions_of_a_cube_lie_along_its_edges_whatever_its_triangles() -> None:
    plain = box((0.1, 0.1, 0.1))
    turned = TriangleMesh(
        plain.vertices, np.concatenate([plain.faces[6:], plain.faces[:6, [1, 2, 0]]])
    )
    for mesh in (plain, turned):
        assert len(mesh.faces) == 12
        cut, _ = cut_for_curvature(mesh)
        inside = regions_of(cut).face_region >= 0
        off = np.sort(0.05 - np.abs(cut.face_centroids), axis=1)[:, 1]
        assert inside[off < 0.003].all()
        assert not inside[off > 0.02].any()


def test_edges_of_two_boxes_are_kept_though_their_parts_are_below_the_least() -> None:
    # Sharp corners fit no cone, and what is left of an edge beside them is little.
    one = box((1.0, 1.0, 1.0))
    two = TriangleMesh(one.vertices + [4.5, 1.0, 1.0], one.faces)
    mesh, _ = cut_for_curvature(joined(one, two))
    found = regions_of(mesh)
    assert 0.1 < found.dominant_share < 0.25
    assert len(found) <= 100
    # No wider than from the diagonal of a corner to its three sides.
    widest = np.arccos(1.0 / np.sqrt(3.0))
    assert max(region.cone_angle for region in found) <= widest + 1e-9
    # Each of the corners has its part, and nothing lies in the middle of a side.
    centres = mesh.face_centroids[found.face_region >= 0]
    corners = np.concatenate([one.vertices, two.vertices])
    away = np.linalg.norm(centres[:, None] - corners, axis=2)
    assert away.min(axis=0).max() < 0.1
    assert away.min(axis=1).max() < 0.5


def test_equal_areas_are_numbered_by_their_lowest_face() -> None:
    one = bumpy(60)
    other = TriangleMesh(one.vertices * [-1, 1, 1] + [0.5, 0, 0], one.faces[:, ::-1])
    n = len(one.vertices)
    pair = TriangleMesh(
        np.concatenate([one.vertices, other.vertices]),
        np.concatenate([one.faces, other.faces + n]),
    )
    found = regions_of(pair)
    assert len(found) >= 2
    for turn in range(4):
        way = Rotation.from_rotvec([0.3 * turn, 0.7, 0.2 * turn]).as_matrix()
        moved = TriangleMesh(3.7 * pair.vertices @ way.T + 100.0, pair.faces)
        np.testing.assert_array_equal(regions_of(moved).face_region, found.face_region)
    areas = np.array([region.area_m2 for region in found])
    twins = np.flatnonzero(np.abs(np.diff(areas)) < 1e-9 * pair.area)
    assert len(twins)
    assert all(found[i].faces[0] < found[i + 1].faces[0] for i in twins.tolist())


def test_an_eyeball_in_its_socket_stays_curved() -> None:
    # Convex in concave: with sign, the two would cancel.
    flat = grid(0.3, 0.3, divisions=(120, 120))
    away = np.linalg.norm(flat.vertices[:, :2], axis=1)
    ball = np.sqrt(np.maximum(0.02**2 - away**2, 0.0))
    z = ball - 0.02 * np.exp(-((away / 0.03) ** 2))
    mesh = TriangleMesh(np.column_stack([flat.vertices[:, :2], z]), flat.faces)
    inside = regions_of(mesh, area_share=0.05).face_region >= 0
    near = np.linalg.norm(mesh.face_centroids[:, :2], axis=1)
    assert inside[near < 0.02].all()
    assert not inside[near > 0.08].any()


def test_on_the_sample_head_every_feature_is_in_a_region_on_both_sides() -> None:
    mesh = load_mesh(Path(__file__).resolve().parents[3] / "face.obj", unit="mm")
    found = regions_of(mesh)
    assert len(found) <= 30
    inside = found.face_region >= 0
    at = mesh.face_centroids
    share = mesh.face_areas[inside].sum() / mesh.area
    assert 0.15 < share < 0.25
    # The head looks along -y; its halves are mirror images about x = 0.
    left, right = (mesh.face_areas[inside & (s * at[:, 0] > 0)].sum() for s in (1, -1))
    assert left == pytest.approx(right, rel=0.02)
    tip = at[np.argmin(at[:, 1])]
    for across, up, reach in ((0.0, 0.0, 0.012), (0.035, 0.045, 0.01)):
        for side in (-1, 1):
            spot = np.hypot(at[:, 0] - side * across, at[:, 2] - tip[2] - up) < reach
            spot &= mesh.face_normals[:, 1] < -0.3
            assert mesh.face_areas[spot & inside].sum() > (
                0.6 * mesh.face_areas[spot].sum()
            )
    ears = np.abs(at[:, 0]) > 0.97 * np.abs(at[:, 0]).max()
    assert inside[ears].mean() > 0.9
