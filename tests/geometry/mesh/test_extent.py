from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation
from support.plain_shapes import box, joined, torus

from geometry.files.readers import load_mesh
from geometry.mesh.bearing import bearing
from geometry.mesh.extent import enclosing_ball, main_bodies
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere

Z = np.array([0.0, 0.0, 1.0])


def moved(mesh: TriangleMesh, turn: np.ndarray, shift: np.ndarray) -> TriangleMesh:
    return TriangleMesh(mesh.vertices @ turn.T + shift, mesh.faces)


@pytest.mark.parametrize("seed", range(40))
def test_the_smallest_ball_holds_all_points_and_its_centre_lies_among_those_on_it(
    seed: int,
) -> None:
    # Optimality: the centre of the smallest ball is a mean of points on its surface.
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(2, 60)), 3)) * rng.uniform(0.01, 5, 3)
    if seed % 4 == 0:
        points = np.round(points)
    if seed % 5 == 0:
        points[:, 2] = 7.0
    centre, radius = enclosing_ball(points)
    distances = np.linalg.norm(points - centre, axis=1)
    assert distances.max() <= radius * (1 + 1e-9) + 1e-15
    on = points[distances >= radius * (1 - 1e-9)]
    means = linprog(
        np.zeros(len(on)),
        A_eq=np.vstack([on.T, np.ones(len(on))]),
        b_eq=np.append(centre, 1.0),
    )
    assert means.status == 0


def test_balls_known_in_closed_form() -> None:
    cube = np.stack(np.meshgrid([0, 2], [0, 2], [0, 2]), axis=-1).reshape(-1, 3)
    centre, radius = enclosing_ball(cube.astype(float))
    np.testing.assert_allclose(centre, [1, 1, 1], atol=1e-12)
    assert radius == pytest.approx(np.sqrt(3), rel=1e-12)
    centre, radius = enclosing_ball(np.ones((4, 3)))
    assert radius == 0.0
    np.testing.assert_allclose(centre, [1, 1, 1])


def test_an_objects_ball_turns_and_moves_with_it() -> None:
    mesh = joined(box((0.1, 0.2, 0.3)), sphere(0.04, subdivisions=3))
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    shift = np.array([1e3, -5.0, 2.0])
    other = moved(mesh, turn, shift)
    assert other.size == pytest.approx(mesh.size, rel=1e-9)
    np.testing.assert_allclose(other.centre, turn @ mesh.centre + shift, atol=1e-9)


def test_a_small_fragment_far_away_does_not_say_where_the_object_is() -> None:
    ball = sphere(0.1, subdivisions=3)
    fragment = moved(
        sphere(0.004, subdivisions=1), np.eye(3), np.array([0.0, 0.0, 5.0])
    )
    mesh = joined(ball, fragment)
    assert mesh.size == pytest.approx(ball.size, rel=1e-12)
    np.testing.assert_allclose(mesh.centre, ball.centre, atol=1e-12)
    assert mesh.reach == pytest.approx(5.0, rel=1e-2)
    assert mesh.bounds[1, 2] > 5.0
    assert mesh.main.sum() == len(ball.faces)


def test_many_bodies_alike_all_count_and_so_does_a_body_of_some_size() -> None:
    row = [
        moved(sphere(0.01, subdivisions=1), np.eye(3), np.array([0.1 * i, 0, 0]))
        for i in range(300)
    ]
    assert joined(*row).main.all()
    large = joined(
        sphere(0.1, subdivisions=2),
        moved(sphere(0.011, subdivisions=2), np.eye(3), np.full(3, 1.0)),
    )
    assert large.main.all()


def test_fragments_that_are_many_count_together() -> None:
    # Each holds 0.4 % of the large body; only the first 1 % of the whole may go.
    areas = np.array([1.0] + [0.004] * 10)
    faces = np.arange(33).reshape(-1, 3)
    kept = main_bodies(faces, areas)
    assert kept[0]
    assert kept[1:].sum() == 8


@pytest.mark.parametrize("angle", [0.4, 1.9, 3.0, -2.2])
def test_a_bearing_turns_with_the_object_about_its_axis(angle: float) -> None:
    mesh = joined(
        box((0.1, 0.2, 0.3)),
        moved(sphere(0.05, subdivisions=2), np.eye(3), np.array([0.2, 0.1, 0])),
    )
    turn = Rotation.from_rotvec(angle * Z).as_matrix()
    np.testing.assert_allclose(
        bearing(moved(mesh, turn, np.full(3, 40.0)), Z),
        turn @ bearing(mesh, Z),
        atol=1e-9,
    )


def test_a_bearing_of_a_box_is_one_of_two_and_of_a_body_of_revolution_any() -> None:
    turn = Rotation.from_rotvec(0.8 * Z).as_matrix()
    long = moved(box((0.3, 0.1, 0.1)), turn, np.zeros(3))
    assert abs(bearing(long, Z) @ turn[:, 0]) == pytest.approx(1.0, abs=1e-9)
    for mesh in (sphere(0.1, subdivisions=3), torus(0.1, 0.04)):
        found = bearing(mesh, Z)
        assert found @ Z == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(found) == pytest.approx(1.0)


def test_rounding_does_not_choose_between_equal_bearings() -> None:
    square = box((0.1, 0.1, 0.2))
    first = bearing(square, Z)
    for shift in (1e2, -3e3, 7.7):
        other = moved(square, np.eye(3), np.full(3, shift))
        np.testing.assert_allclose(bearing(other, Z), first, atol=1e-7)


def test_a_fragment_does_not_decide_the_scale_of_a_file(tmp_path) -> None:
    ball = sphere(0.1, subdivisions=3)
    fragment = moved(
        sphere(0.002, subdivisions=1), np.eye(3), np.array([0.0, 0.0, 3.0])
    )
    both = joined(ball, fragment)
    path = tmp_path / "ball.off"
    rows = [" ".join(map(repr, row)) for row in both.vertices.tolist()]
    rows += ["3 {} {} {}".format(*face) for face in both.faces.tolist()]
    head = f"OFF\n{len(both.vertices)} {len(both.faces)} 0\n"
    path.write_text(head + "\n".join(rows) + "\n")
    mesh = load_mesh(path, size_mm=200.0)
    assert mesh.size == pytest.approx(0.2, rel=1e-2)
    assert mesh.bounds[1, 2] == pytest.approx(
        3.002 / np.ptp(ball.bounds[:, 2]) * 0.2, rel=1e-2
    )
    assert [(r.kind, r.count) for r in mesh.source.repairs] == [
        (
            "faces of fragments outside the rest, kept but left out of its size",
            len(fragment.faces),
        )
    ]


@pytest.mark.parametrize(("away", "stays"), [(5.0, True), (50.0, False)])
def test_a_fragment_out_of_all_proportion_is_left_out(
    away: float, stays: bool, tmp_path: Path
) -> None:
    ball = sphere(0.1, subdivisions=3)
    corners = np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0]])
    fragment = TriangleMesh(corners + [away, 0.0, 0.0], np.array([[0, 1, 2]]))
    whole = joined(fragment, ball)
    path = tmp_path / "a.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (1e3 * whole.vertices).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (whole.faces + 1).tolist()]
    path.write_text("\n".join(lines))
    mesh = load_mesh(path)
    assert len(mesh.faces) == len(ball.faces) + stays
    assert mesh.radius == pytest.approx(0.1, rel=1e-9)
    assert mesh.source is not None
    made = {repair.kind: repair.count for repair in mesh.source.repairs}
    removed = "faces of fragments more than 100 radii away removed"
    assert made.get(removed, 0) == 1 - stays
    # A choice of the file's faces still finds the same ones.
    assert mesh.origin is not None
    np.testing.assert_array_equal(
        mesh.origin.face, np.arange(1 - stays, len(whole.faces))
    )
