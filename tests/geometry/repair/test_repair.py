from pathlib import Path

import numpy as np
import pytest
from support.plain_shapes import box, cylinder, grid, joined

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.mesh.topology import components, face_pairs, mesh_edges
from geometry.repair.orientation import orient
from geometry.repair.repair import clean
from geometry.shapes.primitives import sphere

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data" / "meshes"
needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the shared data lies beside the repository only"
)


def flipped(mesh: TriangleMesh) -> TriangleMesh:
    return TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def moved(mesh: TriangleMesh, *by: float) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + np.array(by), mesh.faces)


def dome(radius: float = 0.1) -> TriangleMesh:
    """The upper half of a sphere: open, its outside known."""
    ball = sphere(radius, subdivisions=4)
    return TriangleMesh(ball.vertices, ball.faces[ball.face_centroids[:, 2] > 0])


def oriented(mesh: TriangleMesh) -> tuple[TriangleMesh, dict[str, int]]:
    faces, repairs = orient(mesh)
    of_faces = {r.kind: r.count for r in repairs if r.kind.startswith("faces")}
    return TriangleMesh(mesh.vertices, faces), of_faces


def as_sets(faces: np.ndarray) -> set[tuple[int, ...]]:
    """Faces as cycles: equal if wound alike, whatever corner they start from."""
    start = np.argmin(faces, axis=1)
    turned = [np.roll(f, -s) for f, s in zip(faces, start, strict=True)]
    return {tuple(int(i) for i in f) for f in turned}


# Cleaning


def test_a_soup_is_welded_back_into_the_mesh_it_came_from() -> None:
    ball = sphere(0.1, subdivisions=3)
    soup = ball.corners.reshape(-1, 3)
    vertices, faces, _, repairs = clean(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(vertices) == len(ball.vertices)
    np.testing.assert_array_equal(vertices[faces], ball.corners)
    assert [(r.kind, r.count) for r in repairs] == [
        ("vertices welded", len(soup) - len(ball.vertices))
    ]


def test_positive_and_negative_zero_are_one_place() -> None:
    vertices = np.array(
        [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, -0.0, 0], [0, -1, 0]]
    )
    welded, faces, _, _ = clean(vertices, np.array([[0, 1, 2], [3, 4, 1]]))
    assert len(welded) == 4
    assert faces[0, 0] == faces[1, 0]


def test_welding_survives_places_that_share_a_hash(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept = np.bitwise_xor

    class Colliding:
        @staticmethod
        def reduce(values: np.ndarray, axis: int) -> np.ndarray:
            return kept.reduce(values, axis=axis) & np.uint64(7)

    monkeypatch.setattr("geometry.repair.repair.np.bitwise_xor", Colliding)
    ball = sphere(0.1, subdivisions=2)
    soup = ball.corners.reshape(-1, 3)
    vertices, faces, _, _ = clean(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(vertices) == len(ball.vertices)
    np.testing.assert_array_equal(vertices[faces], ball.corners)


def test_every_planted_fault_is_removed_and_counted() -> None:
    ball = sphere(0.1, subdivisions=2)
    n = len(ball.vertices)
    line = ball.vertices[0] + np.outer([0.0, 1.0, 2.0], [1e-3, 0, 0])
    vertices = np.vstack([ball.vertices, line, [[np.nan, 0, 0]], [[0, np.inf, 0]]])
    planted = [
        [n, n + 1, n + 2],  # collinear
        [5, 5, 6],  # two corners alike
        ball.faces[3],
        np.roll(ball.faces[4], 1),
        ball.faces[7][::-1],  # the same triangle seen from behind
        [0, 1, n + 3],
    ]
    faces = np.vstack([ball.faces, planted])
    cleaned, kept, origin, repairs = clean(vertices, faces)
    np.testing.assert_array_equal(cleaned[kept], ball.corners)
    np.testing.assert_array_equal(origin, np.arange(len(ball.faces)))
    assert {r.kind: r.count for r in repairs} == {
        "non-finite vertices removed": 2,
        "non-finite faces removed": 1,
        "vertices welded": 1,
        "zero-area faces removed": 2,
        "duplicate faces removed": 3,
        "unreferenced vertices removed": 2,
    }


def test_thin_but_real_triangles_stay() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0]])
    assert len(clean(vertices, np.array([[0, 1, 2]]))[1]) == 1
    assert len(clean(1e-9 * vertices, np.array([[0, 1, 2]]))[1]) == 1


def test_a_mesh_with_nothing_left_or_mostly_broken_is_refused() -> None:
    line = np.outer(np.arange(3.0), [1, 1, 1])
    with pytest.raises(
        MeshError, match=r"none of its 1 faces .*zero-area faces removed: 1"
    ):
        clean(line, np.array([[0, 1, 2]]))
    ball = sphere(0.1, subdivisions=2)
    vertices = ball.vertices.copy()
    vertices[:30] = np.nan
    with pytest.raises(
        MeshError, match=r"of 320 faces have corners that aren't finite"
    ):
        clean(vertices, ball.faces)


# Topology


def test_edges_borders_and_components_of_known_shapes() -> None:
    two = joined(
        grid(1.0, 1.0, divisions=(3, 2)), moved(sphere(0.1, subdivisions=1), 9, 0, 0)
    )
    edges = mesh_edges(two.faces)
    assert edges.border.sum() == 10
    assert set(np.unique(edges.n_faces)) == {1, 2}
    ends = np.sort(two.faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
    np.testing.assert_array_equal(edges.ends[edges.of_face], ends)
    pairs = face_pairs(edges)[0]
    assert len(pairs) == (edges.n_faces == 2).sum()
    count, label = components(pairs, len(two.faces))
    assert count == 2
    np.testing.assert_array_equal(label, np.repeat([0, 1], [12, 80]))


def test_components_are_numbered_by_their_lowest_node() -> None:
    count, label = components(np.array([[4, 1], [6, 0], [3, 6]]), 7)
    assert count == 4
    np.testing.assert_array_equal(label, [0, 1, 2, 0, 1, 3, 0])


def test_faces_about_a_branching_edge_are_paired_only_on_request() -> None:
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    edges = mesh_edges(faces)
    assert len(face_pairs(edges)[0]) == 0
    count, _ = components(face_pairs(edges, manifold_only=False)[0], 3)
    assert count == 1


# Orientation


@pytest.mark.parametrize("seed", [0, 1])
def test_random_winding_is_made_consistent_and_outward(seed: int) -> None:
    ball = sphere(0.1, subdivisions=3)
    flip = np.random.default_rng(seed).random(len(ball.faces)) < 0.4
    mixed = np.where(flip[:, None], ball.faces[:, ::-1], ball.faces)
    mesh, repairs = oriented(TriangleMesh(ball.vertices, mixed))
    assert as_sets(mesh.faces) == as_sets(ball.faces)
    assert repairs == {"faces rewound like their neighbours": int(flip.sum())}


@pytest.mark.parametrize("first_is_flipped", [False, True])
def test_winding_follows_the_majority_of_a_patch(first_is_flipped: bool) -> None:
    plate = grid(0.2, 0.1, divisions=(6, 4))
    flip = np.random.default_rng(0).random(len(plate.faces)) < 0.3
    flip[0] = first_is_flipped
    mixed = np.where(flip[:, None], plate.faces[:, ::-1], plate.faces)
    mesh, repairs = oriented(TriangleMesh(plate.vertices, mixed))
    assert as_sets(mesh.faces) == as_sets(plate.faces)
    assert repairs == {"faces rewound like their neighbours": int(flip.sum())}


def test_each_closed_body_is_turned_on_its_own() -> None:
    good, bad = sphere(0.1, subdivisions=2), moved(box((0.1, 0.1, 0.1)), 0.5, 0, 0)
    mesh, repairs = oriented(joined(good, flipped(bad)))
    assert as_sets(mesh.faces) == as_sets(joined(good, bad).faces)
    assert repairs == {"faces turned outwards": 12}


def test_a_mesh_that_is_right_is_left_alone() -> None:
    for mesh in (sphere(0.1, subdivisions=2), dome(), cylinder(0.1, 0.3, capped=False)):
        faces, repairs = orient(mesh)
        np.testing.assert_array_equal(faces, mesh.faces)
        assert repairs == ()


@pytest.mark.parametrize("inside_out", [False, True])
def test_the_inner_wall_of_a_hollow_shell_keeps_facing_the_cavity(
    inside_out: bool,
) -> None:
    shell = joined(
        sphere(0.1, subdivisions=3),
        flipped(sphere(0.09, subdivisions=3)),
        # A pebble that rattles inside, and one that lies outside.
        moved(sphere(0.01, subdivisions=1), 0.02, 0.01, 0.0),
        moved(sphere(0.02, subdivisions=2), 0.3, 0.0, 0.0),
    )
    mesh, repairs = oriented(flipped(shell) if inside_out else shell)
    assert as_sets(mesh.faces) == as_sets(shell.faces)
    assert repairs.get("faces turned outwards", 0) == (
        len(shell.faces) if inside_out else 0
    )


def test_open_surfaces_face_the_side_that_is_seen_from_outside() -> None:
    tube = cylinder(0.05, 0.2, capped=False)
    for mesh in (dome(), tube):
        turned, repairs = oriented(flipped(mesh))
        assert as_sets(turned.faces) == as_sets(mesh.faces)
        assert repairs == {"faces turned outwards": len(mesh.faces)}


def test_a_flat_plate_says_nothing_and_keeps_its_side() -> None:
    plate = grid(0.2, 0.1, divisions=(4, 4))
    for mesh in (plate, flipped(plate)):
        faces, repairs = orient(mesh)
        np.testing.assert_array_equal(faces, mesh.faces)
        assert repairs == ()


def test_a_floating_fragment_never_decides_for_the_rest() -> None:
    fragment = TriangleMesh(
        np.array([[0.0, 0, 0.2], [0.001, 0, 0.2], [0, 0.001, 0.2]]),
        np.array([[0, 1, 2]]),
    )
    good = joined(fragment, dome())
    for order in (
        joined(fragment, flipped(dome())),
        joined(flipped(fragment), flipped(dome())),
    ):
        mesh, _ = oriented(order)
        # The dome ends up outwards whatever the fragment does.
        assert as_sets(mesh.faces[1:]) == as_sets(good.faces[1:])
    # A fragment that says nothing follows the body that was stored inside out.
    mesh, repairs = oriented(joined(flipped(fragment), flipped(dome())))
    assert as_sets(mesh.faces) == as_sets(good.faces)
    assert repairs == {"faces turned outwards": len(good.faces)}


def test_two_boxes_that_share_an_edge_are_both_turned_outwards() -> None:
    a = box((1.0, 1.0, 1.0))
    b = moved(a, 1.0, 1.0, 0.0)
    both = joined(a, flipped(b))
    vertices, faces, _, _ = clean(both.vertices, both.faces)
    shared = TriangleMesh(vertices, faces)
    assert (mesh_edges(faces).n_faces == 4).sum() == 1
    mesh, _ = oriented(shared)
    volume = np.linalg.det(mesh.corners).sum() / 6.0
    assert volume == pytest.approx(2.0)


def test_orientation_follows_the_mesh_when_it_is_scaled_or_moved() -> None:
    mesh = joined(flipped(dome()), moved(sphere(0.02, subdivisions=2), 0.0, 0.0, 0.3))
    expected = as_sets(orient(mesh)[0])
    for scale, shift in ((1e-3, 0.0), (1e3, 0.0), (1.0, 1e5)):
        changed = TriangleMesh(scale * mesh.vertices + shift, mesh.faces)
        assert as_sets(orient(changed)[0]) == expected


@needs_shared
def test_the_hollow_bust_is_left_as_it_is_stored() -> None:
    mesh = load_mesh(SHARED / "snowden_bust_lo.obj", unit="in")
    assert mesh.source is not None
    # Two stray triangles beside it; nothing is turned or removed.
    assert [(repair.kind, repair.count) for repair in mesh.source.repairs] == [
        ("faces of fragments outside the rest, kept but left out of its size", 2)
    ]
    assert (mesh_edges(mesh.faces).n_faces > 2).sum() == 88
