"""Hollow or solid, wall and inside: against bodies whose inside is known exactly."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from support.plain_shapes import box, cylinder, flipped, joined, torus, turned

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.repair.hollow import (
    CAVITIES,
    HOLLOW,
    OPEN,
    SOLID,
    MeshShell,
    lies_inside,
    measure_shell,
    outside_faces,
)
from geometry.shapes.primitives import sphere

SHARED = Path(__file__).resolve().parents[4] / "shared" / "data" / "meshes"
needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the shared data lies beside the repository only"
)


def ball_with_mouth(radius: float, wall: float, mouth: float) -> TriangleMesh:
    """A spherical shell, cut open over a cone of half angle `mouth` about +z."""
    theta = np.linspace(np.pi, mouth, 60)
    arc = np.column_stack([np.sin(theta), np.cos(theta)])
    arc[0] = (0.0, -1.0)
    return turned(np.concatenate([radius * arc, (radius - wall) * arc[::-1]]))


def pipe(radius: float, wall: float, length: float) -> TriangleMesh:
    z = np.linspace(-0.5 * length, 0.5 * length, 41)
    outer = np.column_stack([np.full_like(z, radius + wall), z])
    inner = np.column_stack([np.full_like(z, radius), z[::-1]])
    return turned(np.concatenate([outer, inner]))


def cup(radius: float, wall: float, depth: float) -> TriangleMesh:
    z = np.linspace(0.0, depth, 41)
    outer = np.column_stack([np.full_like(z, radius + wall), z])
    outer = np.concatenate([[[0.0, -wall], [radius + wall, -wall]], outer])
    inner = np.column_stack([np.full_like(z, radius), z[::-1]])
    return turned(np.concatenate([outer, inner, [[0.0, 0.0]]]))


def slotted(slot: float, depth: float, length: float) -> TriangleMesh:
    """A wide block with a slot from its top, open at both ends."""
    w, d, b = 0.5 * slot, depth, 5.0 * depth
    outline = np.array(
        [[-b, -b], [b, -b], [b, d], [w, d], [w, 0.0], [-w, 0.0], [-w, d], [-b, d]]
    )
    n = len(outline)
    low, high = -0.5 * length, 0.5 * length
    vertices = np.concatenate([np.insert(outline, 1, y, axis=1) for y in (low, high)])
    i = np.arange(n)
    j = (i + 1) % n
    sides = np.concatenate(
        [np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])]
    )
    cut = np.array([[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4], [0, 5, 6], [0, 6, 7]])
    mesh = TriangleMesh(vertices, np.concatenate([sides, cut[:, ::-1], cut + n]))
    volume = np.linalg.det(mesh.corners).sum() / 6.0
    return mesh if volume > 0 else flipped(mesh)


@cache
def shell_of(name: str) -> tuple[TriangleMesh, MeshShell]:
    mesh = BODIES[name]
    return mesh, measure_shell(RayCaster(mesh))


def from_wall(z: float) -> float:
    """View factor from a tube of radius 1, at depth z, to its mouth."""
    x = 0.5 * z
    return (x * x + 0.5) / np.sqrt(x * x + 1.0) - x


BALL, CORE = sphere(0.1, subdivisions=4), sphere(0.096, subdivisions=4)
BODIES = {
    "cube": box((0.1, 0.1, 0.1), divisions=3),
    "ball": BALL,
    "plate": box((0.1, 0.1, 0.001), divisions=3),
    "torus": torus(0.1, 0.03),
    "bowl": ball_with_mouth(0.1, 0.002, np.pi / 2),
    "hemisphere": TriangleMesh(
        BALL.vertices, BALL.faces[BALL.face_centroids[:, 2] > 0]
    ),
    "sealed": joined(BALL, flipped(CORE)),
    "bubble": joined(BALL, flipped(sphere(0.03, subdivisions=3))),
    "narrow mouth": ball_with_mouth(0.1, 0.002, np.radians(24.0)),
    "wide mouth": ball_with_mouth(0.1, 0.002, np.radians(65.0)),
    "wider mouth": ball_with_mouth(0.1, 0.002, np.radians(80.0)),
    "pipe": pipe(1.0, 0.02, 10.0),
    "cup": cup(1.0, 0.02, 2.0),
    "slot": slotted(0.01, 0.14, 6.0),
}
KINDS = {
    SOLID: ("cube", "ball", "plate", "torus", "bowl", "wider mouth"),
    OPEN: ("hemisphere",),
    CAVITIES: ("bubble", "slot"),
    HOLLOW: ("sealed", "narrow mouth", "wide mouth", "pipe", "cup"),
}


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind in KINDS for name in KINDS[kind]]
)
def test_hollow_shells_are_told_from_solids(kind: str, name: str) -> None:
    _, shell = shell_of(name)
    assert shell.kind == kind
    if kind in (SOLID, OPEN):
        assert shell.inside_m2 == 0.0
        assert shell.wall_m is None


def faces_inside(caster: RayCaster) -> np.ndarray:
    return ~outside_faces(caster)


# A sphere's inside sees its mouth alike from everywhere: (1 - cos mouth)/2, which is
# 0.043, 0.289 and 0.413; a third is the limit.
@pytest.mark.long
def test_the_inside_of_a_ball_with_a_mouth_is_all_or_nothing() -> None:
    for name in ("narrow mouth", "wide mouth"):
        mesh, shell = shell_of(name)
        inner = 2.0 * np.pi * 0.098**2 * (1.0 + np.cos(MOUTHS[name]))
        assert shell.inside_m2 == pytest.approx(inner, rel=0.01)
        assert shell.wall_m == pytest.approx(0.002, rel=0.02)
        assert shell.mean_wall_m == pytest.approx(0.002, rel=0.03)
        assert shell.sealed_m2 == 0.0
        radius = np.linalg.norm(mesh.face_centroids, axis=1)
        inside = faces_inside(RayCaster(mesh))
        assert np.mean(inside == (radius < 0.099)) > 0.98


MOUTHS = {"narrow mouth": np.radians(24.0), "wide mouth": np.radians(65.0)}


def test_a_sealed_inner_wall_is_inside_to_the_last_face() -> None:
    mesh, shell = shell_of("sealed")
    assert shell.inside_m2 == pytest.approx(CORE.area, rel=1e-9)
    assert shell.sealed_m2 == pytest.approx(CORE.area, rel=1e-9)
    # Between the facets of two balls of equal mesh the wall is nearly even.
    assert shell.wall_m == pytest.approx(0.004, rel=0.01)
    volume = np.linalg.det(mesh.corners).sum() / 6.0
    assert shell.mean_wall_m == pytest.approx(2.0 * volume / mesh.area, rel=1e-9)
    inside = faces_inside(RayCaster(mesh))
    np.testing.assert_array_equal(inside, np.arange(len(mesh.faces)) >= len(BALL.faces))


def test_a_bubble_in_a_solid_is_a_cavity_with_a_thick_wall() -> None:
    _, shell = shell_of("bubble")
    bubble = sphere(0.03, subdivisions=3)
    assert shell.inside_m2 == pytest.approx(bubble.area, rel=1e-9)
    assert shell.sealed_m2 == pytest.approx(bubble.area, rel=1e-9)
    assert shell.wall_m == pytest.approx(0.07, rel=0.02)


def test_a_pipe_is_inside_where_both_mouths_show_less_than_a_third() -> None:
    _, shell = shell_of("pipe")
    edge = brentq(lambda z: from_wall(z) + from_wall(10.0 - z) - 1.0 / 3.0, 0.0, 5.0)
    assert shell.inside_m2 == pytest.approx(2.0 * np.pi * (10.0 - 2.0 * edge), rel=0.01)
    assert shell.wall_m == pytest.approx(0.02, rel=0.02)


def test_a_cup_is_inside_below_the_depth_where_its_mouth_shows_a_third() -> None:
    mesh, shell = shell_of("cup")
    edge = brentq(lambda z: from_wall(z) - 1.0 / 3.0, 0.0, 2.0)
    truth = 2.0 * np.pi * (2.0 - edge) + np.pi
    assert shell.inside_m2 == pytest.approx(truth, rel=0.01)
    assert shell.sealed_m2 == 0.0
    inside = faces_inside(RayCaster(mesh))
    where = mesh.face_centroids
    rim = np.abs(where[:, 2] - (2.0 - edge)) < 0.1
    wall = np.hypot(where[:, 0], where[:, 1]) < 1.01
    deep = wall & (where[:, 2] > -0.01) & (where[:, 2] < 2.0 - edge)
    assert np.mean(inside[~rim] == deep[~rim]) > 0.999


def test_a_slot_is_inside_where_it_shows_less_than_a_twentieth() -> None:
    """On the wall of a long slot: (1 - z / sqrt(z^2 + w^2)) / 2; on its floor less."""
    _, shell = shell_of("slot")
    edge = brentq(lambda z: 0.5 * (1.0 - z / np.hypot(z, 0.01)) - 0.05, 0.0, 0.14)
    truth = 6.0 * (2.0 * (0.14 - edge) + 0.01)
    assert shell.inside_m2 == pytest.approx(truth, rel=0.03)


def test_single_points_are_judged_like_the_whole() -> None:
    mesh = BODIES["cup"]
    caster = RayCaster(mesh)
    height = mesh.face_centroids[:, 2]
    inner = np.flatnonzero(
        (np.hypot(*mesh.face_centroids.T[:2]) < 1.0) & (height > 0.01) & (height < 1.0)
    )
    outer = np.flatnonzero(np.hypot(*mesh.face_centroids.T[:2]) > 1.01)
    for faces, expected in ((inner, True), (outer, False)):
        assert len(faces) > 1000
        found = lies_inside(caster, faces, mesh.face_centroids[faces])
        assert set(found.tolist()) == {expected}


# At least one of each kind, walls thin, thick and none.
MOVED = ("plate", "wider mouth", "hemisphere", "bubble", "sealed", "wide mouth", "cup")


@pytest.mark.parametrize(("seed", "name"), list(enumerate(MOVED)))
def test_nothing_depends_on_place_turn_or_scale(seed: int, name: str) -> None:
    mesh, shell = shell_of(name)
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    scale = 10.0 ** rng.uniform(-3, 3)
    shift = scale * rng.normal(size=3) * 100.0
    other = TriangleMesh(scale * mesh.vertices @ turn.T + shift, mesh.faces)
    found = measure_shell(RayCaster(other))
    assert found.kind == shell.kind
    assert found.inside_m2 == pytest.approx(scale**2 * shell.inside_m2, rel=2e-3)
    assert found.sealed_m2 == pytest.approx(scale**2 * shell.sealed_m2, rel=1e-6)
    for now, before in (
        (found.wall_m, shell.wall_m),
        (found.mean_wall_m, shell.mean_wall_m),
    ):
        assert (now is None) == (before is None)
        if now is not None:
            assert now == pytest.approx(scale * before, rel=1e-3)


def test_fragments_neither_hide_a_shell_nor_make_one() -> None:
    rng = np.random.default_rng(0)
    fragment = sphere(1e-3, subdivisions=1)
    far = [
        TriangleMesh(fragment.vertices + 0.3 * shift, fragment.faces)
        for shift in rng.normal(size=(40, 3))
        if 0.12 < 0.3 * np.linalg.norm(shift)
    ]
    for name in ("narrow mouth", "ball", "hemisphere"):
        mesh, shell = shell_of(name)
        found = measure_shell(RayCaster(joined(mesh, *far)))
        assert found.kind == shell.kind
        assert found.inside_m2 == pytest.approx(shell.inside_m2, rel=0.01)


def test_the_number_of_threads_changes_nothing(monkeypatch) -> None:
    monkeypatch.setattr("geometry.repair.hollow._SPOTS", 2000)
    mesh = BODIES["narrow mouth"]
    shell = measure_shell(RayCaster(mesh, threads=2))
    assert measure_shell(RayCaster(mesh, threads=1)) == shell
    np.testing.assert_array_equal(
        faces_inside(RayCaster(mesh, threads=1)), faces_inside(RayCaster(mesh))
    )


def test_a_tessellation_of_few_long_faces_is_measured_alike() -> None:
    """Spots lie on the area, not on the faces."""
    coarse = joined(
        cylinder(1.02, 2.0, around=96, along=1),
        flipped(cylinder(1.0, 1.96, around=96, along=1)),
    )
    shell = measure_shell(RayCaster(coarse))
    assert shell.kind == HOLLOW
    inner = cylinder(1.0, 1.96, around=96, along=1)
    assert shell.inside_m2 == pytest.approx(inner.area, rel=1e-9)
    assert shell.wall_m == pytest.approx(0.02, rel=0.01)


@needs_shared
def test_the_real_bust_is_a_hollow_shell() -> None:
    shell = measure_shell(
        RayCaster(load_mesh(SHARED / "snowden_bust_lo.obj", unit="in"))
    )
    assert shell.kind == HOLLOW
    assert shell.wall_m == pytest.approx(1.5e-3, abs=0.05e-3)
    assert shell.mean_wall_m == pytest.approx(shell.wall_m, rel=0.05)


@needs_shared
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("face_scan_james.obj", OPEN),
        ("tm_reference.obj", OPEN),
        ("tm_ADIS16480.STL", CAVITIES),
        ("vtk_bunny.ply", SOLID),
        ("vtk_horse.ply", SOLID),
    ],
)
def test_real_meshes_are_what_they_are(name: str, kind: str) -> None:
    mesh = load_mesh(SHARED / name, size_mm=100)
    assert measure_shell(RayCaster(mesh)).kind == kind


@pytest.mark.parametrize("away", [1.0, 5.0])
def test_a_fragment_far_away_makes_no_inside(away: float) -> None:
    ball = sphere(0.1, subdivisions=4)
    corners = np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0]])
    fragment = TriangleMesh(corners + [away, 0.0, 0.0], np.array([[0, 1, 2]]))
    shell = measure_shell(RayCaster(joined(ball, fragment)))
    assert shell.kind == SOLID
    assert shell.inside_m2 == 0.0
