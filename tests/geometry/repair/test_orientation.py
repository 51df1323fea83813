"""Which side of a surface is its outside: against shapes whose outside is known."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plain_shapes import box, cylinder, grid, joined, torus

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.repair.nesting import containers
from geometry.repair.openness import look_out, spots_on
from geometry.repair.orientation import orient
from geometry.repair.repair import clean
from geometry.shapes.primitives import sphere

TURNED = "faces turned outwards"
REWOUND = "faces rewound like their neighbours"
FOLLOWED = "of these turned like the rest, being too small or hidden"
PIECES = "pieces turned outwards"
ONE_SIDED = "edges where a one-sided surface can't be wound alike"


def welded(mesh: TriangleMesh) -> TriangleMesh:
    vertices, faces, *_ = clean(mesh.vertices, mesh.faces)
    return TriangleMesh(vertices, faces)


def flipped(mesh: TriangleMesh, which: np.ndarray | None = None) -> TriangleMesh:
    flip = np.ones(len(mesh.faces), dtype=bool) if which is None else which
    faces = np.where(flip[:, None], mesh.faces[:, ::-1], mesh.faces)
    return TriangleMesh(mesh.vertices, faces)


def moved(mesh: TriangleMesh, *by: float) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + np.array(by), mesh.faces)


def cap(share: float, radius: float = 0.1) -> TriangleMesh:
    """The part of a sphere above a height, about a share of its area."""
    ball = sphere(radius, subdivisions=4)
    return TriangleMesh(
        ball.vertices, ball.faces[ball.face_centroids[:, 2] > radius * (1 - 2 * share)]
    )


def soup(mesh: TriangleMesh, seed: int) -> TriangleMesh:
    """Each face on its own, moved by less than a thousandth of its size."""
    rng = np.random.default_rng(seed)
    shift = rng.normal(scale=1e-4 * mesh.mean_edge, size=(len(mesh.faces), 1, 3))
    corners = (mesh.corners + shift).reshape(-1, 3)
    return TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))


def moebius(n: int = 60) -> TriangleMesh:
    u = np.arange(n) * (2.0 * np.pi / n)
    rows = [
        np.column_stack(
            [
                (1 + w * np.cos(u / 2)) * np.cos(u),
                (1 + w * np.cos(u / 2)) * np.sin(u),
                w * np.sin(u / 2),
            ]
        )
        for w in (-0.2, 0.2)
    ]
    faces = []
    for i in range(n):
        a, d = i, n + i
        b, c = (i + 1, n + i + 1) if i + 1 < n else (n, 0)
        faces += [(a, b, c), (a, c, d)]
    return TriangleMesh(0.1 * np.concatenate(rows), np.array(faces))


def outward(mesh: TriangleMesh) -> np.ndarray:
    """Whether each face of a mesh of convex bodies at known places faces outwards."""
    return np.einsum("ij,ij->i", mesh.face_normals, mesh.face_centroids) > 0


def result(mesh: TriangleMesh) -> tuple[TriangleMesh, dict[str, int]]:
    faces, repairs = orient(mesh)
    assert np.array_equal(np.sort(faces, axis=1), np.sort(mesh.faces, axis=1))
    assert all(repair.count > 0 for repair in repairs)
    return TriangleMesh(mesh.vertices, faces), {r.kind: r.count for r in repairs}


def assert_oriented_like(mesh: TriangleMesh, truth: TriangleMesh) -> None:
    np.testing.assert_allclose(mesh.face_normals, truth.face_normals, atol=1e-9)


# One piece at a time: whatever the winding, the same result

BALL = sphere(0.1, subdivisions=3)
FRAGMENT = moved(sphere(0.002, subdivisions=1), 0.3, 0.0, 0.0)
TUBE = cylinder(0.05, 0.2, capped=False)
KNOWN = {
    "ball": BALL,
    "cap of 10 %": cap(0.1),
    "hemisphere": cap(0.5),
    "ball with a mouth": cap(0.9),
    "ball with a pinhole": TriangleMesh(BALL.vertices, BALL.faces[1:]),
    "tube": TUBE,
    "short tube": cylinder(0.1, 0.05, capped=False),
    "ball and fragment": joined(BALL, FRAGMENT),
    "hemisphere and fragment": joined(cap(0.5), FRAGMENT),
    "hemisphere about a ball": joined(cap(0.5), sphere(0.03, subdivisions=2)),
    "two balls": joined(BALL, moved(sphere(0.05, subdivisions=2), 0.2, 0.0, 0.0)),
    "eye in its socket": joined(BALL, moved(sphere(0.03, subdivisions=3), 0.09, 0, 0)),
    "boxes that share an edge": welded(
        joined(box((1.0, 1.0, 1.0)), moved(box((1.0, 1.0, 1.0)), 1.0, 1.0, 0.0))
    ),
    "hollow ball": joined(BALL, flipped(sphere(0.09, subdivisions=3))),
    "hollow ball with a core": joined(
        BALL, flipped(sphere(0.095, subdivisions=3)), sphere(0.09, subdivisions=3)
    ),
    "hollow ball with a pebble": joined(
        BALL, flipped(sphere(0.09, subdivisions=3)), moved(FRAGMENT, -0.28, 0.0, 0.0)
    ),
    "torus": torus(0.1, 0.03, around=48, about_tube=24),
}


def pieces_of(mesh: TriangleMesh) -> list[np.ndarray]:
    """Runs of faces that share no vertex with others, as bool arrays (n_f,)."""
    first = np.flatnonzero(
        mesh.faces.min(axis=1)
        > np.maximum.accumulate(np.concatenate([[-1], mesh.faces.max(axis=1)[:-1]]))
    )
    ends = [*first.tolist(), len(mesh.faces)]
    return [
        (np.arange(len(mesh.faces)) >= a) & (np.arange(len(mesh.faces)) < b)
        for a, b in pairwise(ends)
    ]


@pytest.mark.parametrize("name", KNOWN)
def test_what_is_right_is_left_alone(name: str) -> None:
    mesh, repairs = result(KNOWN[name])
    np.testing.assert_array_equal(mesh.faces, KNOWN[name].faces)
    assert repairs == {}


@pytest.mark.parametrize("name", KNOWN)
def test_what_is_stored_inside_out_is_turned_whole(name: str) -> None:
    truth = KNOWN[name]
    mesh, repairs = result(flipped(truth))
    assert_oriented_like(mesh, truth)
    assert repairs[TURNED] == len(truth.faces)


@pytest.mark.parametrize(
    "name", [n for n in KNOWN if len(pieces_of(KNOWN[n])) > 1 and "pebble" not in n]
)
def test_each_piece_may_be_stored_inside_out_on_its_own(name: str) -> None:
    truth = KNOWN[name]
    for piece in pieces_of(truth):
        mesh, repairs = result(flipped(truth, piece))
        assert_oriented_like(mesh, truth)
        assert repairs[TURNED] == piece.sum()
        assert repairs[PIECES] == 1


@pytest.mark.parametrize("name", KNOWN)
def test_random_winding_is_undone(name: str) -> None:
    truth = KNOWN[name]
    # Under half of each piece, so that its majority says what was stored.
    mixed = np.random.default_rng(3).random(len(truth.faces)) < 0.3
    if "pebble" in name or "boxes" in name:
        mixed[:] = False
        mixed[1::5] = True
    mesh, repairs = result(flipped(truth, mixed))
    assert_oriented_like(mesh, truth)
    assert repairs[REWOUND] == mixed.sum()


@pytest.mark.parametrize(("seed", "name"), list(enumerate(KNOWN)))
def test_no_verdict_depends_on_place_turn_or_scale(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    scale = 10.0 ** rng.uniform(-3, 3)
    for stored in (KNOWN[name], flipped(KNOWN[name])):
        faces, repairs = orient(stored)
        for shift in (0.0, 100.0 * scale):
            other = TriangleMesh(scale * stored.vertices @ turn.T + shift, stored.faces)
            again, same = orient(other)
            np.testing.assert_array_equal(again, faces)
            assert same == repairs


def test_the_inner_wall_is_turned_where_its_winding_is_wrong() -> None:
    """Three shells that are all stored outwards: the middle one bounds a cavity."""
    shells = [sphere(r, subdivisions=3) for r in (0.1, 0.09, 0.08)]
    mesh, repairs = result(joined(*shells))
    assert_oriented_like(mesh, joined(shells[0], flipped(shells[1]), shells[2]))
    assert repairs == {TURNED: len(shells[1].faces), PIECES: 1}


def test_a_crack_in_the_outer_wall_turns_no_inner_wall() -> None:
    outer, inner = sphere(0.1, subdivisions=4), sphere(0.095, subdivisions=4)
    cracked = TriangleMesh(outer.vertices, outer.faces[1:])
    wound = joined(cracked, flipped(inner))
    mesh, repairs = result(wound)
    assert_oriented_like(mesh, wound)
    assert repairs == {}
    mesh, _ = result(joined(cracked, inner))
    assert_oriented_like(mesh, wound)
    # Half a wall is none: what lies in it is a body of its own.
    half = TriangleMesh(outer.vertices, outer.faces[outer.face_centroids[:, 2] > 0.0])
    mesh, _ = result(joined(half, inner))
    assert_oriented_like(mesh, joined(half, inner))


def test_a_small_part_inside_a_solid_keeps_its_side() -> None:
    """Parts inside a housing are no cavities, and cavities no parts."""
    part = moved(sphere(0.03, subdivisions=2), 0.02, 0.0, 0.0)
    for inner in (part, flipped(part)):
        stored = joined(BALL, inner)
        mesh, repairs = result(stored)
        assert_oriented_like(mesh, stored)
        assert repairs == {}
        mesh, repairs = result(flipped(stored))
        assert_oriented_like(mesh, stored)
        assert repairs[PIECES] == 2


def test_an_open_piece_that_nobody_sees_follows_the_body_around_it() -> None:
    hidden = moved(grid(0.04, 0.04, divisions=(3, 3)), 0.0, 0.0, 0.01)
    other = moved(sphere(0.2, subdivisions=3), 1.0, 0.0, 0.0)
    truth = joined(BALL, hidden, other)
    stored = flipped(truth, np.arange(len(truth.faces)) < len(BALL.faces) + 18)
    mesh, repairs = result(stored)
    assert_oriented_like(mesh, truth)
    assert repairs == {TURNED: len(BALL.faces) + 18, PIECES: 2}


# Sides that nothing tells


@pytest.mark.parametrize(
    "mesh",
    [
        grid(0.2, 0.1, divisions=(5, 4)),
        # An S: what one half hides, the other shows.
        joined(cap(0.3), flipped(moved(cap(0.3), 1.0, 0.0, 0.0))),
    ],
)
def test_a_side_that_nothing_tells_is_left(mesh: TriangleMesh) -> None:
    if len(mesh.faces) == 40:
        for stored in (mesh, flipped(mesh)):
            assert result(stored)[1] == {}
        return
    _, repairs = result(mesh)
    assert repairs == {TURNED: len(mesh.faces) // 2, PIECES: 1}


def test_a_one_sided_surface_is_left_and_named() -> None:
    strip = moebius()
    mesh, repairs = result(strip)
    assert repairs.get(TURNED, 0) == 0
    assert repairs[ONE_SIDED] >= 1
    # All edges but the seam agree.
    assert repairs[ONE_SIDED] <= 2
    assert len(mesh.faces) == len(strip.faces)


def test_a_fragment_that_shows_both_sides_goes_with_the_rest() -> None:
    fragment = TriangleMesh(
        np.array([[0.3, 0.0, 0.0], [0.301, 0.0, 0.0], [0.3, 0.001, 0.0]]),
        np.array([[0, 1, 2]]),
    )
    truth = joined(cap(0.5), fragment)
    mesh, repairs = result(flipped(truth))
    assert_oriented_like(mesh, truth)
    assert repairs == {TURNED: len(truth.faces), PIECES: 2, FOLLOWED: 1}


def test_many_fragments_never_outvote_the_body() -> None:
    rng = np.random.default_rng(0)
    fragments = [
        moved(grid(1e-3, 1e-3, divisions=(1, 1)), *(0.3 * rng.normal(size=3)))
        for _ in range(200)
    ]
    truth = joined(cap(0.6), *fragments)
    body = np.arange(len(truth.faces)) < len(cap(0.6).faces)
    for stored in (flipped(truth, body), flipped(truth, ~body), flipped(truth)):
        mesh, _ = result(stored)
        np.testing.assert_allclose(
            mesh.face_normals[body], truth.face_normals[body], atol=1e-9
        )


# Non-manifold


def test_a_soup_of_single_triangles_is_turned_one_by_one() -> None:
    pieces = soup(BALL, 0)
    flip = np.random.default_rng(1).random(len(pieces.faces)) < 0.5
    mesh, repairs = result(flipped(pieces, flip))
    assert outward(mesh).all()
    assert repairs == {TURNED: flip.sum(), PIECES: flip.sum()}


def test_cells_that_share_a_wall_face_outwards() -> None:
    """Two cubes on one wall: ten outer faces are known, the wall has no outside."""
    cube = box((1.0, 1.0, 1.0))
    mirrored = TriangleMesh(cube.vertices * [-1.0, 1.0, 1.0], cube.faces[:, ::-1])
    cells = welded(joined(cube, moved(mirrored, 1.0, 0.0, 0.0)))
    wall = np.abs(cells.face_centroids[:, 0] - 0.5) < 1e-9
    assert wall.sum() == 2
    outside = np.einsum(
        "ij,ij->i", cells.face_normals, cells.face_centroids - [0.5, 0, 0]
    )
    for flip in (~wall, np.ones_like(wall), cells.face_centroids[:, 0] < 0.4):
        mesh, _ = result(flipped(cells, flip))
        now = np.einsum(
            "ij,ij->i", mesh.face_normals, mesh.face_centroids - [0.5, 0, 0]
        )
        np.testing.assert_allclose(now[~wall], np.abs(outside[~wall]))


# What the verdicts rest on


@pytest.mark.parametrize("depth", [0.25, 0.5, 1.0, 2.0, 4.0])
def test_openness_inside_a_tube_is_its_view_factor(depth: float) -> None:
    """From the wall to the mouth at distance z: (X^2+1/2)/sqrt(X^2+1) - X, X=z/2R."""
    tube = flipped(cylinder(1.0, 12.0, around=192, along=96, capped=False))
    mouth = 6.0 - depth
    band = np.abs(tube.face_centroids[:, 2] - mouth) < 0.07
    spots = spots_on(tube, 2000, group=np.zeros(len(band), np.int64), within=band)
    escaped = look_out(RayCaster(tube), spots, 64)

    def factor(z: np.ndarray) -> np.ndarray:
        x = z / 2.0
        return (x * x + 0.5) / np.sqrt(x * x + 1.0) - x

    z = spots.points[:, 2]
    truth = (factor(6.0 - z) + factor(6.0 + z)).mean()
    assert escaped.mean() / 64 == pytest.approx(truth, abs=0.004)


def test_spots_are_area_true_and_no_group_goes_without() -> None:
    plate = grid(2.0, 1.0, divisions=(40, 20))
    mesh = joined(plate, moved(box((1e-3, 1e-3, 1e-3)), 0.0, 0.0, 1.0))
    group = np.r_[np.zeros(len(plate.faces), np.int64), np.ones(12, np.int64)]
    spots = spots_on(mesh, 1600, group=group, least=3)
    counts = np.bincount(spots.faces, minlength=len(mesh.faces))
    assert set(counts[: len(plate.faces)]) == {1}
    assert counts[len(plate.faces) :].sum() == 3
    inside = np.all(np.abs(spots.points[:1600, :2]) <= [1.0, 0.5], axis=1)
    assert inside.all()


def test_what_holds_what_is_found_layer_by_layer() -> None:
    radii = (0.1, 0.08, 0.06, 0.04)
    far = moved(sphere(0.01, subdivisions=2), 0.5, 0.0, 0.0)
    across = moved(sphere(0.02, subdivisions=2), 0.1, 0.0, 0.0)
    parts = [*(sphere(r, subdivisions=3) for r in radii), far, across]
    mesh = joined(*parts)
    patch = np.repeat(np.arange(6), [len(part.faces) for part in parts])
    every = np.ones(6, dtype=bool)
    held = containers(mesh, patch, every, every, RayCaster(mesh))
    assert [row.tolist() for row in held] == [[], [0], [0, 1], [0, 1, 2], [], []]
    held = containers(mesh, patch, np.arange(6) != 1, every, RayCaster(mesh))
    assert held[3].tolist() == [0, 2]


def test_what_lies_in_the_box_of_a_body_need_not_lie_in_it() -> None:
    """A ball in the hole of a ring, and one that sticks out of its tube."""
    parts = [
        torus(0.1, 0.03, around=48, about_tube=24),
        sphere(0.02, subdivisions=2),
        moved(sphere(0.02, subdivisions=2), 0.0, 0.075, 0.0),
        moved(sphere(0.02, subdivisions=2), -0.1, 0.0, 0.0),
    ]
    # With the axis of the ring along x, rays from its hole cross its tube twice.
    mesh = joined(*(TriangleMesh(np.roll(p.vertices, 1, 1), p.faces) for p in parts))
    patch = np.repeat(np.arange(4), [len(part.faces) for part in parts])
    every = np.ones(4, dtype=bool)
    held = containers(mesh, patch, every, every, RayCaster(mesh))
    assert [row.tolist() for row in held] == [[], [], [], [0]]


def test_a_fragment_needs_more_than_a_slight_advantage() -> None:
    """A plate above a ball shows the upper side a little more; it keeps its side."""
    fragment = moved(grid(1e-3, 1e-3, divisions=(1, 1)), 0.0, 0.0, 0.2)
    for plate in (fragment, flipped(fragment)):
        assert result(joined(BALL, plate))[1] == {}
