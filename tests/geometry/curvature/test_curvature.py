from types import ModuleType

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plain_shapes import box, cylinder, grid, torus

from geometry.curvature.curvature import (
    CurvatureField,
    facet_size,
    principal_curvatures,
)
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.tensors import packed, unpacked
from geometry.shapes.primitives import sphere

R, TUBE = 0.1, 0.04


def steep(field: CurvatureField) -> np.ndarray:
    larger = np.abs(field.k_max) >= np.abs(field.k_min)
    return np.where(larger[:, None], field.direction_max, field.direction_min)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def torus_truth(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Curvature about the axis, and the unit directions about the tube and the axis."""
    x, y, z = mesh.vertices.T
    arm = np.hypot(x, y)
    cosine = (arm - R) / TUBE
    about_axis = np.column_stack([-y, x, 0 * x]) / arm[:, None]
    radial = np.column_stack([x, y, 0 * x]) / arm[:, None]
    about_tube = -radial * (z / TUBE)[:, None] + np.outer(cosine, [0, 0, 1])
    return cosine / (R + TUBE * cosine), about_tube, about_axis


def test_a_sphere_is_positive_and_exact_at_two_scales() -> None:
    for radius in (0.1, 3.0):
        field = principal_curvatures(sphere(radius, subdivisions=5))
        assert field.valid.all()
        assert np.all(field.k_max >= field.k_min)
        assert rms(field.k_max * radius - 1) < 0.01
        assert rms(field.k_min * radius - 1) < 0.01
        assert rms(field.curvedness * radius - 1) < 0.01


def test_turning_a_mesh_inside_out_swaps_and_negates() -> None:
    mesh = torus(R, TUBE, around=140, about_tube=70)
    out = principal_curvatures(mesh)
    back = principal_curvatures(TriangleMesh(mesh.vertices, mesh.faces[:, ::-1]))
    np.testing.assert_allclose(back.k_max, -out.k_min, atol=1e-6 / TUBE)
    np.testing.assert_allclose(back.k_min, -out.k_max, atol=1e-6 / TUBE)


def test_a_tube_bends_across_its_axis_only() -> None:
    radius = 0.05
    mesh = cylinder(radius, 0.3, around=120, along=120, capped=False)
    field = principal_curvatures(mesh)
    assert 0.85 < field.valid.mean() < 1
    ok = field.valid
    assert rms(field.k_max[ok] * radius - 1) < 0.01
    assert rms(field.k_min[ok] * radius) < 0.01
    around = np.cross([0.0, 0, 1], mesh.vertices * [1, 1, 0]) / radius
    lean = np.abs(np.einsum("ij,ij->i", field.direction_max, around))[ok]
    assert np.degrees(np.arccos(np.clip(lean, 0, 1))).max() < 2
    assert np.abs(np.abs(field.direction_min[ok, 2]) - 1).max() < 1e-3
    np.testing.assert_array_equal(steep(field)[ok], field.direction_max[ok])


def test_a_torus_has_its_curvatures_and_directions_and_they_converge() -> None:
    errors = []
    for around in (70, 140, 280):
        mesh = torus(R, TUBE, around=around, about_tube=around // 2)
        field = principal_curvatures(mesh, radius=0.5 * mesh.mean_edge)
        about_axis, tube_way, axis_way = torus_truth(mesh)
        errors.append(
            (rms(field.k_max - 1 / TUBE) * TUBE, rms(field.k_min - about_axis) * TUBE)
        )
        for found, true in (
            (field.direction_max, tube_way),
            (field.direction_min, axis_way),
        ):
            np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=1e-12)
            lean = np.abs(np.einsum("ij,ij->i", found, true))
            assert np.degrees(np.arccos(np.clip(lean, 0, 1))).max() < 2
    assert max(errors[1]) < 0.01
    for k in range(2):
        # Second order: half the edge, a quarter of the error.
        assert errors[1][k] < errors[0][k] / 3
        assert errors[2][k] < errors[1][k] / 3


def test_the_inner_half_of_a_torus_is_a_saddle() -> None:
    mesh = torus(R, TUBE)
    field = principal_curvatures(mesh)
    inner = np.hypot(*mesh.vertices.T[:2]) < R - 0.5 * TUBE
    assert np.all(field.k_min[inner] < 0)
    assert np.all(field.k_max[inner] > 0)


def test_the_steep_direction_belongs_to_the_larger_magnitude() -> None:
    # Seen from inside a tube, the curvature of larger magnitude is the smaller one.
    tube = cylinder(0.05, 0.2, around=90, along=60, capped=False)
    field = principal_curvatures(TriangleMesh(tube.vertices, tube.faces[:, ::-1]))
    ok = field.valid
    np.testing.assert_array_equal(steep(field)[ok], field.direction_min[ok])
    assert np.abs(steep(field)[ok, 2]).max() < 0.02


def test_a_plane_is_flat_up_to_its_border_strip() -> None:
    mesh = grid(0.2, 0.1, divisions=(40, 20))
    radius = 0.012
    field = principal_curvatures(mesh, radius)
    np.testing.assert_array_equal(field.k_max, 0.0)
    np.testing.assert_array_equal(field.k_min, 0.0)
    inset = (np.array([0.1, 0.05]) - np.abs(mesh.vertices[:, :2])).min(axis=1)
    # Distances run along edges, so they may exceed the straight ones, never fall short.
    assert field.valid[inset > radius + 1e-12].all()
    assert not field.valid[inset < 0.7 * radius].any()
    assert not principal_curvatures(mesh, 1e-3).valid[inset < 1e-9].any()


def test_a_wide_radius_keeps_its_distance_from_the_border() -> None:
    mesh = grid(0.2, 0.2, divisions=(100, 100))
    field = principal_curvatures(mesh, radius=0.04)
    inset = 0.1 - np.abs(mesh.vertices[:, :2]).max(axis=1)
    # Rows at that distance exactly are rounding's to decide.
    assert field.valid[inset > 0.04 + 1e-6].all()
    assert not field.valid[inset < 0.04 - 1e-6].any()


def test_an_open_border_never_looks_curved() -> None:
    rng = np.random.default_rng(0)
    mesh = grid(0.2, 0.2, divisions=(60, 60))
    rim = (np.abs(mesh.vertices[:, :2]) > 0.0999).any(axis=1)
    vertices = mesh.vertices.copy()
    # Torn edges, as scanners leave them: teeth of half an edge.
    vertices[rim] += rng.normal(scale=1.5e-3, size=(rim.sum(), 3))
    field = principal_curvatures(TriangleMesh(vertices, mesh.faces))
    assert field.valid.any()
    assert not field.valid[rim].any()
    assert field.curvedness.max() < 0.05 / field.scale


def test_a_pinhole_spoils_its_rim_only() -> None:
    ball = sphere(0.1, subdivisions=5)
    holed = TriangleMesh(ball.vertices, ball.faces[1:])
    field = principal_curvatures(holed)
    assert (~field.valid).sum() == 3
    assert np.abs(field.k_max[field.valid] * 0.1 - 1).max() < 0.1


def test_a_radius_is_physical_however_fine_the_mesh() -> None:
    # A dimple narrower than the radius: what is left of it depends on the radius alone.
    found = []
    for cells in (60, 120, 240):
        flat = grid(0.2, 0.2, divisions=(cells, cells))
        away = (flat.vertices[:, :2] ** 2).sum(axis=1)
        dimple = 0.002 * np.exp(-away / (2 * 0.008**2))
        mesh = TriangleMesh(flat.vertices - dimple[:, None] * [0, 0, 1], flat.faces)
        field = principal_curvatures(mesh, 0.012)
        assert field.radius == field.scale == 0.012
        found.append(field.k_min[np.argmin(away)])
    true = -0.002 / 0.008**2
    assert found[2] > 0.8 * true
    np.testing.assert_allclose(found[1], found[2], rtol=0.03)
    np.testing.assert_allclose(found[0], found[2], rtol=0.2)


def test_the_default_radius_is_2_percent_of_the_size() -> None:
    mesh = sphere(0.1, subdivisions=4)
    assert principal_curvatures(mesh).radius == pytest.approx(0.004, rel=1e-9)


def test_a_coarse_mesh_states_the_scale_of_its_facets() -> None:
    mesh = sphere(0.1, subdivisions=2)
    field = principal_curvatures(mesh)
    assert field.scale > 2 * field.radius
    assert field.scale == facet_size(mesh)
    assert rms(field.k_max * 0.1 - 1) < 0.15


@pytest.mark.parametrize("cells", [1, 4])
def test_flat_faces_and_sharp_creases_have_no_facets(cells: int) -> None:
    mesh = box((0.1, 0.1, 0.1), divisions=cells)
    assert facet_size(mesh) == 0.0
    field = principal_curvatures(mesh)
    assert field.scale == field.radius


def test_facets_of_a_cylinder_are_as_wide_as_they_are() -> None:
    mesh = cylinder(0.05, 0.3, around=40, along=1, capped=False)
    # The turn is across; the diagonals of flat cells don't turn.
    width = 2 * 0.05 * np.sin(np.pi / 40)
    assert facet_size(mesh) == pytest.approx(width, rel=1e-6)


def test_a_wider_radius_resists_noise() -> None:
    ball = sphere(0.1, subdivisions=5)
    noise = np.random.default_rng(0).normal(size=ball.vertices.shape)
    noisy = TriangleMesh(ball.vertices + 0.02 * ball.mean_edge * noise, ball.faces)
    errors = [
        rms(principal_curvatures(noisy, n * ball.mean_edge).k_max * 0.1 - 1)
        for n in (2, 4, 8)
    ]
    assert errors[0] > 2 * errors[1] > 3 * errors[2]
    assert errors[2] < 0.04


def test_curvature_moves_with_the_mesh_and_scales_inversely() -> None:
    mesh = torus(R, TUBE, around=60, about_tube=30)
    field = principal_curvatures(mesh)
    turn = Rotation.from_rotvec([0.3, -1.1, 0.6]).as_matrix()
    changed = TriangleMesh(
        1000 * mesh.vertices @ turn.T + [10.0, 2e3, -5e3], mesh.faces
    )
    other = principal_curvatures(changed)
    np.testing.assert_allclose(1000 * other.k_max, field.k_max, rtol=1e-6)
    np.testing.assert_allclose(1000 * other.k_min, field.k_min, atol=1e-5)
    lean = np.einsum("ij,ij->i", other.direction_max, field.direction_max @ turn.T)
    np.testing.assert_allclose(np.abs(lean), 1.0, atol=1e-6)


def test_tensors_have_the_curvatures_as_eigenvalues() -> None:
    field = principal_curvatures(torus(R, TUBE, around=40, about_tube=20))
    k, ways = (field.k_max, field.k_min), (field.direction_max, field.direction_min)
    tensors = packed(k, ways)
    values = np.linalg.eigvalsh(unpacked(tensors))
    expected = np.sort(
        np.column_stack([field.k_max, field.k_min, 0 * field.k_max]), axis=1
    )
    np.testing.assert_allclose(values, expected, atol=1e-6)


SOUP = np.random.default_rng(5)


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (SOUP.normal(size=(30, 3)), SOUP.integers(0, 30, (60, 3))),
        (np.round(SOUP.normal(size=(40, 3))), SOUP.integers(0, 40, (60, 3))),
        (SOUP.normal(size=(90, 3)), np.arange(90).reshape(-1, 3)),
        (SOUP.normal(size=(9, 3)), np.array([[0, 1, 2]])),
        (np.eye(4, 3), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])),
        (np.eye(3), np.array([[0, 1, 1], [0, 1, 2]])),
        (SOUP.normal(size=(30, 3)), SOUP.integers(0, 30, (80, 2))[:, [0, 1, 1]]),
    ],
    ids=[
        "tangle",
        "coincident",
        "soup",
        "unused vertices",
        "tetrahedron",
        "degenerate",
        "no area",
    ],
)
def test_what_crashes_libigl_comes_back_finite(
    vertices: np.ndarray, faces: np.ndarray
) -> None:
    mesh = TriangleMesh(vertices, faces)
    field = principal_curvatures(mesh)
    assert isinstance(field, CurvatureField)
    assert len(field.valid) == len(mesh.vertices)
    for values in (field.k_max, field.k_min, field.direction_max, field.direction_min):
        assert np.isfinite(values).all()
    assert np.all(field.k_max >= field.k_min)
    np.testing.assert_array_equal(field.k_max[~field.valid], 0.0)
    np.testing.assert_allclose(np.linalg.norm(field.direction_max, axis=1), 1.0)
    unused = np.setdiff1d(np.arange(len(vertices)), faces)
    assert not field.valid[unused].any()


def test_creases_of_a_box_are_its_curved_places() -> None:
    mesh = box((0.1, 0.1, 0.1), divisions=40)
    field = principal_curvatures(mesh)
    on_edge = (np.abs(mesh.vertices) > 0.0499).sum(axis=1) >= 2
    middle = (np.abs(mesh.vertices) < 0.035).sum(axis=1) >= 2
    assert field.curvedness[on_edge].min() > 50
    np.testing.assert_allclose(field.curvedness[middle], 0.0, atol=0.05)


def test_faces_on_the_same_corners_turned_apart_dont_crash() -> None:
    mesh = sphere(0.1, subdivisions=3)
    around = mesh.faces[(mesh.faces == 0).any(axis=1)]
    doubled = np.concatenate([mesh.faces, around[:, ::-1]])
    field = principal_curvatures(TriangleMesh(mesh.vertices, doubled))
    assert not field.valid[0]
    assert np.isfinite(field.k_max).all()
    assert field.valid.mean() > 0.8


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan"), float("inf")])
def test_a_radius_must_be_positive(radius: float) -> None:
    with pytest.raises(ValueError, match="radius must be a positive number of metres"):
        principal_curvatures(sphere(0.1, subdivisions=1), radius)


@pytest.mark.parametrize("kind", ["regular", "irregular"])
@pytest.mark.parametrize("name", ["sphere", "cylinder", "torus", "ellipsoid"])
def test_curvature_of_known_shapes_in_any_position(
    curved_shapes: ModuleType, name: str, kind: str
) -> None:
    shape = curved_shapes.SHAPES[name]
    mesh = getattr(shape, kind)(20_000)
    assert 0.9 * 20_000 < len(mesh.faces) < 1.1 * 20_000
    turn = Rotation.random(rng=np.random.default_rng(7)).as_matrix()
    tilted = TriangleMesh(mesh.vertices @ turn.T, mesh.faces)
    k1, k2, d1, d2 = shape.truth(mesh.vertices)
    truth = (k1, k2, d1 @ turn.T, d2 @ turn.T)
    # A radius below an edge is the route for clean meshes; None is the default.
    for radius, limit in ((0.5 * mesh.mean_edge, 0.01), (None, 0.03)):
        field = principal_curvatures(tilted, radius)
        assert field.valid.mean() > 0.9
        k = np.stack([field.k_max, field.k_min])
        ways = np.stack([field.direction_max, field.direction_min])
        off = curved_shapes.errors(truth, k, ways, field.valid)
        assert off[0] < limit
        assert off[1] < limit
        assert off[2] < np.deg2rad(2.0)


def test_what_lies_at_a_border_spoils_nothing_beyond_its_strip() -> None:
    # The rims of this tube are too close to fit; their neighbours know nothing of them.
    mesh = cylinder(0.05, 0.3, around=60, along=60, capped=False)
    rng = np.random.default_rng(0)
    rim = np.abs(mesh.vertices[:, 2]) > 0.1499
    torn = np.array(mesh.vertices)
    torn[rim] += 0.3 * mesh.mean_edge * rng.normal(size=(rim.sum(), 3))
    radius = 4.0 * mesh.mean_edge
    whole = principal_curvatures(mesh, radius)
    found = principal_curvatures(TriangleMesh(torn, mesh.faces), radius)
    both = whole.valid & found.valid
    assert both.mean() > 0.5
    assert np.abs(found.k_max - whole.k_max)[both].max() < 0.02 / 0.05


def test_a_given_radius_is_taken_at_its_word() -> None:
    mesh = sphere(0.1, subdivisions=2)
    assert principal_curvatures(mesh, 1e-3).scale == 1e-3
    assert principal_curvatures(mesh).scale > 4e-3


def test_what_was_asked_of_a_mesh_is_known():
    mesh = sphere(0.1, subdivisions=3)
    field = principal_curvatures(mesh)
    assert principal_curvatures(mesh) is field
    assert principal_curvatures(mesh, 2.0 * field.radius) is not field
    alike = TriangleMesh(mesh.vertices, mesh.faces)
    assert principal_curvatures(alike) is not field
