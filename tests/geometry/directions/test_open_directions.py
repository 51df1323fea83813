"""Cells open to a sample: no direction that passes lies in a closed one."""

from dataclasses import replace

import numpy as np
import pytest
from support.plain_shapes import box, grid, joined, torus

from geometry.directions.cube_map import CubeMap
from geometry.directions.open_directions import DirectionLimits, OpenDirections
from geometry.directions.silhouettes import POINTS, Silhouettes
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.rays.visibility import Visibility
from geometry.shapes.primitives import sphere

FREE = DirectionLimits(np.deg2rad(80.0), 0.0)


def directions(n: int, seed: int = 0) -> np.ndarray:
    found = np.random.default_rng(seed).normal(size=(n, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def shifted(mesh: TriangleMesh, by: tuple[float, float, float]) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + np.array(by), mesh.faces)


def maps_of(mesh, cube, *, limits=FREE, n=POINTS, steep=None, occlusion=True, seed=1):
    visibility = Visibility(mesh)
    samples = sample_surface(mesh, n, seed=seed)
    steep = np.zeros((n, 3)) if steep is None else steep
    makes = OpenDirections(visibility, limits, cube, occlusion=occlusion)
    return (
        samples,
        visibility,
        makes.maps(samples.points, samples.normals, steep, samples.faces),
    )


def seen_from(mesh, points, normals, half_angle):
    edges = Silhouettes(mesh)
    return edges.seen_from(edges.sides(points, normals), half_angle)


def is_free(samples, visibility, row, asked):
    """Whether a device far away in each direction sees a sample, by one ray each."""
    far = samples.points[row] + 50.0 * visibility.caster.extent * asked
    one = slice(row, row + 1)
    points, normals = samples.points[one], samples.normals[one]
    return np.array([not visibility.blocked(o, points, normals)[0] for o in far])


MESHES = {
    "ring": torus(0.1, 0.06, around=48, about_tube=32),
    "ring far away": shifted(
        torus(0.1, 0.06, around=24, about_tube=16), (300.0, 200.0, 10.0)
    ),
    "tiny ring": torus(1e-5, 6e-6, around=24, about_tube=16),
    "box over a plate": joined(
        grid(0.2, 0.2, divisions=(3, 3)), shifted(box((0.05, 0.04, 0.03)), (0, 0, 0.05))
    ),
    "two plates": joined(
        grid(0.2, 0.2, divisions=(2, 2)),
        shifted(grid(0.2, 0.1, divisions=(1, 1)), (0.02, 0, 0.03)),
    ),
}


def test_what_isnt_looked_at_closely_is_open_beyond_the_cap_by_a_cell_at_most():
    cube, mesh = CubeMap(16), MESHES["ring"]
    samples, _, closely = maps_of(mesh, cube, occlusion=False)
    limits = replace(FREE, closely=False)
    _, _, roughly = maps_of(mesh, cube, limits=limits, occlusion=False)
    assert np.all(roughly >= closely)
    assert np.sum(roughly) < 1.1 * np.sum(closely)
    away = np.arccos(np.clip(samples.normals @ cube.centres.T, -1.0, 1.0))
    more = roughly & ~closely
    assert more.any()
    assert np.all((away - cube.radii)[more] <= FREE.max_incidence + 1e-9)
    _, _, shaded = maps_of(mesh, cube)
    _, _, among = maps_of(mesh, cube, limits=limits)
    assert np.all(among >= shaded)


@pytest.mark.long
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("n", [8, 48])
def test_what_passes_is_in_an_open_cell(name, n):
    cube = CubeMap(n)
    samples, visibility, maps = maps_of(MESHES[name], cube)
    blocked = closed = 0
    for row in range(0, POINTS, 4):
        asked = directions(600, seed=row)
        asked = asked[asked @ samples.normals[row] >= np.cos(FREE.max_incidence)]
        free = is_free(samples, visibility, row, asked)
        is_open = maps[row, cube.locate(asked)]
        assert is_open[free].all()
        blocked += np.count_nonzero(~free)
        closed += np.count_nonzero(~is_open)
    assert blocked > 0
    # What is blocked is mostly known to be.
    assert closed >= (0.6 if n == 48 else 0.0) * blocked


def test_a_ball_hides_nothing_of_itself():
    """Convex: incidence alone closes cells, and exactly those that the cap misses."""
    cube = CubeMap(16)
    samples, _, maps = maps_of(sphere(0.1), cube)
    assert (maps == maps_of(sphere(0.1), cube, occlusion=False)[2]).all()
    # Points all over each cell, its border included.
    steps = np.linspace(0.0, 1.0, 21)
    corners = cube.corners
    low = corners[:, :-1, :-1, None], corners[:, :-1, 1:, None]
    high = corners[:, 1:, :-1, None], corners[:, 1:, 1:, None]
    u = steps[:, None]
    bottom, top = (a * (1.0 - u) + b * u for a, b in (low, high))
    v = steps[:, None, None]
    inside = bottom[..., None, :, :] * (1.0 - v) + top[..., None, :, :] * v
    inside = inside.reshape(cube.size, -1, 3)
    inside /= np.linalg.norm(inside, axis=2, keepdims=True)
    limit = FREE.max_incidence
    for row in range(8):
        best = (inside @ samples.normals[row]).max(axis=1)
        assert maps[row, best >= np.cos(limit)].all()
        # The points are 0.3 degrees apart.
        assert not maps[row, best < np.cos(limit + np.deg2rad(0.3))].any()


def test_maps_are_made_in_several_threads_at_once():
    """Rays of a map don't wait for the threads that make maps."""
    mesh = torus(0.1, 0.06, around=80, about_tube=60)
    cube = CubeMap(48)
    rough = TriangleMesh(
        mesh.vertices * np.random.default_rng(0).uniform(0.9, 1.1, mesh.vertices.shape),
        mesh.faces,
    )
    visibility = Visibility(rough, threads=2)
    samples = sample_surface(rough, 6 * POINTS, seed=1)
    makes = OpenDirections(visibility, FREE, cube)
    found: dict[int, np.ndarray] = {}

    def make(part: slice) -> None:
        points, normals = samples.points[part], samples.normals[part]
        zero, faces = np.zeros((POINTS, 3)), samples.faces[part]
        found[part.start] = makes.maps(points, normals, zero, faces)

    parts = [slice(b, b + POINTS) for b in range(0, 6 * POINTS, POINTS)]
    visibility.caster.share(make, parts)
    assert len(found) == 6
    first = found[0].copy()
    make(parts[0])
    assert (found[0] == first).all()


def test_under_a_roof_only_the_gap_is_open():
    """A plate 30 mm over another: a sample sees past its edge, and not through it."""
    roof = shifted(grid(0.2, 0.2, divisions=(1, 1)), (0, 0, 0.03))
    mesh = joined(grid(0.3, 0.3, divisions=(1, 1)), roof)
    cube = CubeMap(64)
    visibility = Visibility(mesh)
    point, normal = np.array([[0.03, 0.01, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    makes = OpenDirections(visibility, DirectionLimits(np.deg2rad(89.0), 0.0), cube)
    cells = makes.maps(point, normal, np.zeros((1, 3)), np.array([0]))[0]
    up = cube.centres[:, 2] > 0.02
    hit = point + cube.centres * (0.03 / np.where(up, cube.centres[:, 2], 1.0))[:, None]
    off = np.abs(hit[:, :2]).max(axis=1) - 0.1
    # 3 degrees from where the roof ends there is no doubt.
    doubt = 0.03 * np.deg2rad(3.0) / np.maximum(cube.centres[:, 2], 0.02) ** 2
    assert not cells[up & (off < -doubt)].any()
    assert cells[up & (off > doubt) & (cube.centres[:, 2] > 0.05)].all()


def test_what_a_near_roof_hides_opens_no_cell(monkeypatch):
    """Clutter far above a roof: of the faces near the sample it is no part."""
    parts = [grid(0.3, 0.3, divisions=(1, 1))]
    parts.append(shifted(grid(0.2, 0.2, divisions=(4, 4)), (0, 0, 0.03)))
    for x, y, z in np.random.default_rng(3).uniform(-1.0, 1.0, (80, 3)):
        parts.append(
            shifted(box((0.03, 0.03, 0.03)), (0.3 * x, 0.3 * y, 0.6 + 0.3 * z))
        )
    mesh, cube = joined(*parts), CubeMap(48)
    visibility, limits = Visibility(mesh), DirectionLimits(np.deg2rad(89.0), 0.0)
    point, up = np.array([[0.03, 0.01, 0.0]]), np.array([[0.0, 0.0, 1.0]])

    def under_the_roof():
        makes = OpenDirections(visibility, limits, cube)
        cells = makes.maps(point, up, np.zeros((1, 3)), np.array([0]))[0]
        rise = np.maximum(cube.centres[:, 2], 0.02)
        hit = point + cube.centres * (0.03 / rise)[:, None]
        off = np.abs(hit[:, :2]).max(axis=1) - 0.1
        return cells[(cube.centres[:, 2] > 0.02) & (off < -0.03 * 0.07 / rise**2)]

    assert under_the_roof().size > 2000
    assert not under_the_roof().any()
    monkeypatch.setattr("geometry.directions.open_directions._NEAR", ())
    assert under_the_roof().mean() > 0.1


@pytest.mark.parametrize("slacks", [0.0, 0.1, 0.5, 1.0, 2.0, 5.0, 12.0, 40.0])
def test_beside_a_wall_nothing_is_closed_that_the_planner_sees(slacks):
    """Nearer to a crease than the rays' slack, the wall counts for some rays only."""
    corners = [(-1, 0, 0), (1, 0, 0), (1, -1, 0), (-1, -1, 0), (1, 0, 1), (-1, 0, 1)]
    faces = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (0, 4, 5)]
    mesh = TriangleMesh(0.1 * np.array(corners, dtype=float), np.array(faces))
    visibility, cube = Visibility(mesh), CubeMap(32)
    point = np.array([[0.013, -slacks * visibility.slack, 0.0]])
    up = np.array([[0.0, 0.0, 1.0]])
    makes = OpenDirections(visibility, FREE, cube)
    cells = makes.maps(point, up, np.zeros((1, 3)), np.array([0]))[0]
    asked = directions(4_000)
    asked = asked[asked[:, 2] >= np.cos(FREE.max_incidence)]
    far = point + asked
    free = [not visibility.blocked(o, point, up)[0] for o in far]
    assert cells[cube.locate(asked[free])].all()
    if slacks == 40.0:
        assert not cells[cube.locate(asked[asked[:, 1] > 0.3])].any()


def test_samples_of_slivers_are_taken_to_be_free():
    plate = grid(0.2, 0.2, divisions=(2, 2))
    roof = shifted(grid(0.2, 0.2, divisions=(1, 1)), (0, 0, 0.03))
    thin = np.array([[-0.05, 0, 0.01], [0.05, 0, 0.01], [0, 1e-6, 0.01]])
    mesh = joined(plate, roof, TriangleMesh(thin, np.array([[0, 1, 2]])))
    visibility, cube = Visibility(mesh), CubeMap(16)
    last = np.array([len(mesh.faces) - 1])
    makes = OpenDirections(visibility, FREE, cube)
    point, up = mesh.face_centroids[last], np.array([[0.0, 0.0, 1.0]])
    cells = makes.maps(point, up, np.zeros((1, 3)), last)[0]
    within = cube.centres[:, 2] >= np.cos(FREE.max_incidence)
    assert cells[within].all()
    # Off the sliver the roof closes what is above.
    cells = makes.maps(mesh.face_centroids[:1], up, np.zeros((1, 3)), np.array([0]))[0]
    assert not cells[cube.centres[:, 2] > 0.9].any()


@pytest.mark.parametrize("angle", [0.0, 20.0, 40.0, 70.0])
def test_cells_along_the_steep_direction_close_as_a_whole(angle):
    cube = CubeMap(24)
    limits = DirectionLimits(FREE.max_incidence, np.deg2rad(angle))
    steep = directions(POINTS, seed=4)
    samples, _, maps = maps_of(sphere(0.1), cube, limits=limits, steep=steep)
    asked = directions(4_000, seed=2)
    cell = cube.locate(asked)
    for row in range(POINTS):
        ok = asked @ samples.normals[row] >= np.cos(limits.max_incidence)
        tangent = np.abs(asked @ steep[row])
        assert maps[row, cell[ok & (tangent <= np.cos(limits.min_tangent_angle))]].all()
        closed_for_sure = np.deg2rad(angle) - 2.0 * cube.radii.max()
        if closed_for_sure > 0.0:
            assert not maps[row, cell[tangent > np.cos(closed_for_sure)]].any()
    arbitrary = maps_of(sphere(0.1), cube, limits=limits)[2]
    assert (arbitrary == maps_of(sphere(0.1), cube)[2]).all()


def test_silhouettes_are_where_sides_change():
    """A cube seen from below and +x: the outline of these two sides, not their edge."""
    plate = shifted(grid(8.0, 8.0, divisions=(1, 1)), (0, 0, -3))
    mesh = joined(box((2.0, 2.0, 2.0)), plate)
    point, up = np.array([[2.5, 0.1, -3.0]]), np.array([[0.0, 0.0, 1.0]])
    owners, begin, end = seen_from(mesh, point, up, 1.5)
    assert not owners.any()
    ends = np.rint(np.stack([begin, end], axis=1) + point).astype(int)
    found = {frozenset(map(tuple, edge.tolist())) for edge in ends}
    outline = [
        ((1, -1, 1), (1, 1, 1)),
        ((1, -1, -1), (1, -1, 1)),
        ((1, 1, -1), (1, 1, 1)),
        ((-1, -1, -1), (1, -1, -1)),
        ((-1, 1, -1), (1, 1, -1)),
        ((-1, -1, -1), (-1, 1, -1)),
    ]
    assert {frozenset(edge) for edge in outline} <= found
    assert frozenset([(1, -1, -1), (1, 1, -1)]) not in found
    # What lies below the plane, the plate's own border among it, isn't asked about.
    assert all(z >= -1 for edge in found for _, _, z in edge)


def test_faces_that_disagree_on_their_outside_have_the_same_silhouettes():
    mesh = torus(0.1, 0.06, around=24, about_tube=16)
    flipped = mesh.faces.copy()
    flipped[::3] = flipped[::3, ::-1]
    samples = sample_surface(mesh, POINTS, seed=2)
    found = [
        seen_from(m, samples.points, samples.normals, 1.2)
        for m in (mesh, TriangleMesh(mesh.vertices, flipped))
    ]
    edges = [
        {
            (int(o), *np.round(np.sort([a, b], axis=0).ravel(), 9))
            for o, a, b in zip(*one, strict=True)
        }
        for one in found
    ]
    assert edges[0] == edges[1]
    assert len(edges[0]) > 300


def test_edges_of_one_face_or_three_are_always_silhouettes():
    """Three plates that share an edge over a sample: it is one from everywhere."""
    corners = [(0, -1, 1), (0, 1, 1), (1, 0, 2), (-1, 0, 2), (0.2, 0, 3)]
    fan = TriangleMesh(
        np.array(corners, dtype=float), np.array([(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    )
    mesh = joined(grid(4.0, 4.0, divisions=(1, 1)), fan)
    point, up = np.array([[0.3, 0.2, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    _, begin, end = seen_from(mesh, point, up, 1.5)
    assert len({frozenset(map(tuple, ends)) for ends in np.stack([begin, end], 1)}) == 7
