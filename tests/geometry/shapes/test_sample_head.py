"""The sample head: a sound mesh, a head's measures and features, a population."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geometry.mesh.mesh import MeshError, TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.shapes.sample_head.geodesic import geodesic_grid
from geometry.shapes.sample_head.sample_head import HeadShape, sample_head
from planning.cli.other_commands import write_sample

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def head() -> TriangleMesh:
    return sample_head(n_faces=40_000)


def volume(mesh):
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


def edges(mesh):
    return np.concatenate(
        [mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]
    )


def profile(mesh, x_mm, z_mm):
    """First surface met from the front, y in mm, along the ray at (x, z)."""
    x_mm, z_mm = np.broadcast_arrays(np.atleast_1d(x_mm), np.atleast_1d(z_mm))
    origins = np.stack([x_mm * 1e-3, np.full(len(x_mm), -1.0), z_mm * 1e-3], axis=1)
    rays = np.broadcast_to([0.0, 1.0, 0.0], origins.shape)
    _, distance = RayCaster(mesh).first_hits(origins, rays)
    return 1e3 * (distance - 1.0)


def assert_sound(mesh):
    """Closed, manifold, one sphere, outward; no face so thin that it has no normal."""
    pairs = edges(mesh)
    n = len(mesh.vertices)
    codes = pairs[:, 0] * n + pairs[:, 1]
    assert len(np.unique(codes)) == len(codes), "an edge is run through twice one way"
    assert np.array_equal(np.sort(codes), np.sort(pairs[:, 1] * n + pairs[:, 0]))
    assert len(np.unique(mesh.faces)) == n
    assert n - len(pairs) // 2 + len(mesh.faces) == 2
    assert volume(mesh) > 0.0
    quality = 4 * np.sqrt(3) * mesh.face_areas
    quality /= np.sum(
        (mesh.corners - np.roll(mesh.corners, 1, axis=1)) ** 2, axis=(1, 2)
    )
    assert quality.min() > 0.1


def winding(mesh, inside):
    """Solid angle of the mesh seen from a point over 4 pi, and the least part of it."""
    a, b, c = np.moveaxis(mesh.corners - inside, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    dot = lambda u, v: np.einsum("ij,ij->i", u, v)  # noqa: E731
    below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    angles = 2.0 * np.arctan2(triple, below)
    return angles.sum() / (4 * np.pi), angles.min()


@pytest.mark.parametrize("n_faces", [500, 2_000])
def test_mesh_is_sound_at_every_resolution(n_faces):
    mesh = sample_head(n_faces=n_faces)
    assert n_faces <= len(mesh.faces) <= n_faces + 41 * np.sqrt(n_faces / 20)
    assert_sound(mesh)


def test_no_face_cuts_another(head):
    assert_sound(head)
    # Every face is counter-clockwise seen from one point, and together they wrap it
    # once: a surface over the sphere, which can't cut itself.
    turns, least = winding(head, np.array([0.0, 0.020, -0.004]))
    assert turns == pytest.approx(1.0, abs=1e-9)
    assert least > 0.0


def test_measures_of_an_adult(head):
    size = 1e3 * np.ptp(head.bounds, axis=0)
    assert 168 <= size[0] <= 190
    assert 195 <= size[1] <= 215
    assert 230 <= size[2] <= 255
    # A mannequin head holds 4 to 6 litres with its neck; area goes with it.
    assert 4.0e-3 < volume(head) < 6.5e-3
    assert 0.14 < head.area < 0.22


def test_an_open_neck_has_one_level_border():
    """One closed loop of border edges, all at the height of the cut; nothing below."""
    mesh = sample_head(n_faces=8_000, open_neck=True)
    edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    each, times = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    border = each[times == 1]
    assert times.max() == 2
    ends, degree = np.unique(border, return_counts=True)
    assert np.all(degree == 2)
    parts = connected_components(
        coo_array((np.ones(len(border)), border.T), shape=(len(mesh.vertices),) * 2)
    )[1]
    assert len(np.unique(parts[ends])) == 1
    heights = mesh.vertices[ends, 2]
    assert np.ptp(heights) == 0.0
    assert mesh.vertices[:, 2].min() >= heights[0] - 1e-12
    closed = sample_head(n_faces=8_000)
    assert 0.85 * closed.area < mesh.area < closed.area


def test_resolutions_agree_on_the_surface(head):
    coarse = sample_head(n_faces=15_000)
    assert volume(coarse) == pytest.approx(volume(head), rel=2e-3)
    x = np.linspace(-55, 55, 23)
    assert np.abs(profile(coarse, x, 45.0) - profile(head, x, 45.0)).max() < 0.2


def test_left_is_the_mirror_of_right(head):
    x, z = np.meshgrid(np.linspace(2, 60, 30), np.linspace(-100, 80, 61))
    left = profile(head, x.ravel(), z.ravel())
    right = profile(head, -x.ravel(), z.ravel())
    met = np.isfinite(left)
    assert np.array_equal(met, np.isfinite(right))
    assert met.mean() > 0.9
    assert np.abs(left[met] - right[met]).max() < 1e-3


def test_nose_is_the_foremost_point_and_stands_out(head):
    tip = 1e3 * head.vertices[np.argmin(head.vertices[:, 1])]
    assert abs(tip[0]) < 2.0
    assert -48 < tip[2] < -30
    beside = profile(head, 30.0, tip[2])[0]
    assert tip[1] < beside - 15
    # The upper lip's root lies behind the tip: the nose has an underside.
    assert profile(head, 0.0, -57.0)[0] > tip[1] + 10


def test_profile_runs_brow_root_tip_lips_furrow_chin(head):
    z = np.array([14.0, 3.0, -38.0, -56.0, -78.5, -91.0, -101.0])
    brow, root, tip, lip_root, lip, furrow, chin = profile(head, 0.0, z)
    assert tip < brow < root
    assert tip < lip < lip_root
    assert lip < furrow
    assert chin < furrow


@pytest.mark.parametrize("side", [-1, 1])
def test_eyes_lie_in_sockets_and_bulge(head, side):
    eye, brow, cheek = profile(head, side * 31.5, np.array([0.0, 19.0, -24.0]))
    assert eye > brow + 5, "the eye lies behind the brow"
    inner, outer = profile(head, side * np.array([16.0, 52.0]), 2.0)
    assert eye < inner
    assert eye < outer, "the eyeball bulges between the corners of the eye"
    under = profile(head, side * 31.5, -13.0)[0]
    assert under > min(eye, cheek), "a furrow parts the lower lid from the cheek"


@pytest.mark.parametrize("side", [-1, 1])
def test_ears_are_the_widest_part_and_hollow(head, side):
    x = side * head.vertices[:, 0] * 1e3
    widest = 1e3 * head.vertices[np.argmax(x)]
    assert 15 < widest[1] < 50
    assert -25 < widest[2] < 30
    y = np.linspace(-6.0, 60.0, 67)
    origins = np.stack([np.full(67, side * 1.0), 1e-3 * y, np.full(67, -0.008)], axis=1)
    rays = np.broadcast_to([-float(side), 0.0, 0.0], origins.shape)
    _, distance = RayCaster(head).first_hits(origins, rays)
    out = 1e3 * (1.0 - distance)
    rim = int(np.argmax(out))
    assert out[rim] > out[-1] + 8, "the rim stands off the side of the head"
    # From the front: up to the tragus, down into the bowl, up to the rim.
    bowl = int(np.argmin(out[12:rim])) + 12
    tragus = out[:bowl].max()
    assert min(tragus, out[rim]) > out[bowl] + 5, "a bowl lies between"


def test_parameters_move_what_they_name():
    base = HeadShape()
    plain = sample_head(base, n_faces=2_500)
    size = np.ptp(plain.bounds, axis=0) * 1e3
    tip = -1e3 * plain.bounds[0, 1]
    longer = sample_head(HeadShape(nose_projection=24.0), n_faces=2_500)
    assert -1e3 * longer.bounds[0, 1] - tip == pytest.approx(5.0, abs=0.5)
    taller = sample_head(HeadShape(crown_height=123.0), n_faces=2_500)
    assert 1e3 * (taller.bounds - plain.bounds)[1, 2] == pytest.approx(10.0, abs=0.5)
    necked = sample_head(HeadShape(neck_length=32.0), n_faces=2_500)
    assert 1e3 * (plain.bounds - necked.bounds)[0, 2] == pytest.approx(10.0, abs=0.5)
    eared = sample_head(HeadShape(ear_standoff=22.0), n_faces=2_500)
    assert np.ptp(eared.bounds, axis=0)[0] * 1e3 > size[0] + 6
    twice = sample_head(HeadShape(scale=2.0), n_faces=2_500)
    assert twice.vertices == pytest.approx(2.0 * plain.vertices)
    assert np.array_equal(twice.faces, plain.faces)


@pytest.mark.long
def test_every_parameter_matters():
    plain = sample_head(n_faces=500)
    for field in fields(HeadShape):
        near = float(field.default) * 1.05 + 0.5
        other = sample_head(HeadShape(**{field.name: near}), n_faces=500)
        moved = np.linalg.norm(other.vertices - plain.vertices, axis=1).max()
        assert moved > 1e-4, field.name


def test_population_is_varied_and_sound():
    heads = [HeadShape.random(seed) for seed in range(200)]
    assert HeadShape.random(7) == heads[7]
    assert len(set(heads)) == 200
    widths = np.array([h.width for h in heads])
    assert widths.mean() == pytest.approx(154.0, abs=1.5)
    assert widths.std() == pytest.approx(6.0, abs=1.0)
    for shape in heads[:4]:
        mesh = sample_head(shape, n_faces=2_000)
        assert_sound(mesh)
        turns, least = winding(mesh, np.array([0.0, 0.020, -0.004]))
        assert turns == pytest.approx(1.0, abs=1e-9)
        assert least > 0.0


def test_file_is_the_same_every_time_and_in_millimetres(tmp_path):
    first, second = tmp_path / "a.obj", tmp_path / "b.obj"
    mesh = write_sample(first, n_faces=2_000)
    write_sample(second, n_faces=2_000)
    assert first.read_bytes() == second.read_bytes()
    lines = first.read_text("ascii").splitlines()
    assert not any("-0.0000" in line for line in lines)
    assert any("mm" in line and "+z" in line and "-y" in line for line in lines[:3])
    rows = [line.split() for line in lines if line[0] in "vf"]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], dtype=float)
    faces = np.array([row[1:] for row in rows if row[0] == "f"], dtype=int)
    assert vertices == pytest.approx(mesh.vertices * 1e3, abs=5.01e-5)
    assert np.array_equal(faces - 1, mesh.faces)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.obj", "b.obj"]


def test_the_file_at_the_root_is_what_the_generator_writes(tmp_path):
    committed = ROOT / "face.obj"
    assert 20_000 <= committed.read_text("ascii").count("\nf ")
    assert committed.stat().st_size < 2.5e6
    write_sample(tmp_path / "face.obj")
    ours = np.loadtxt(tmp_path / "face.obj", usecols=(1, 2, 3), comments=("#", "f"))
    theirs = np.loadtxt(committed, usecols=(1, 2, 3), comments=("#", "f"))
    # Another machine's square roots may differ in the last bit, no more.
    assert np.abs(ours - theirs).max() < 2e-4


@pytest.mark.parametrize("n_faces", [0, 499, 2_000_001, float("nan")])
def test_resolution_out_of_range(n_faces):
    with pytest.raises(MeshError, match="must lie in 500 to 2000000"):
        sample_head(n_faces=n_faces)


@pytest.mark.parametrize(
    "bad", [{"width": 40.0}, {"scale": 0.0}, {"nose_hump": float("nan")}]
)
def test_proportions_out_of_range(bad):
    name = next(iter(bad))
    with pytest.raises(MeshError, match=f"head {name} is .*: must lie in"):
        HeadShape(**bad)


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_geodesic_grid(n):
    grid = geodesic_grid(n)
    assert len(grid.faces) == 20 * n * n
    mesh = TriangleMesh(grid.directions, grid.faces)
    assert_sound(mesh)
    assert np.linalg.norm(grid.directions, axis=1) == pytest.approx(1.0)
    for axis in range(3):
        mirrored = grid.directions * np.where(np.arange(3) == axis, -1.0, 1.0)
        gap = np.linalg.norm(mirrored[:, None] - grid.directions[None], axis=2)
        assert gap.min(axis=1).max() < 1e-12
    with pytest.raises(ValueError, match="at least 1"):
        geodesic_grid(0)


@pytest.mark.parametrize(("coarse", "fine"), [(1, 1), (2, 4), (4, 7), (5, 13)])
def test_interpolation_is_exact_on_the_icosahedron(coarse, fine):
    # On the flat faces of the icosahedron positions are linear, so linear
    # interpolation must reproduce them.
    few, many = geodesic_grid(coarse), geodesic_grid(fine)
    corners = geodesic_grid(1).directions
    flat = [
        g.directions / (g.directions @ _face_normal(corners, g)).max(axis=1)[:, None]
        for g in (few, many)
    ]
    assert few.interpolate(flat[0], many) == pytest.approx(flat[1], abs=1e-12)


def _face_normal(corners, grid):
    faces = geodesic_grid(1).faces
    centres = corners[faces].sum(axis=1)
    return (centres / np.linalg.norm(centres, axis=1, keepdims=True)).T


def test_a_family_is_from_child_to_adult_whatever_its_size():
    family = [HeadShape.of_family(3, k) for k in range(40)]
    assert family[7] == HeadShape.of_family(3, 7)
    assert family[7] != HeadShape.of_family(4, 7)
    scales = np.array([shape.scale for shape in family])
    assert scales.min() < 0.91
    assert scales.max() > 0.97
    # A child's nose stands out less, beyond its size: the correlation shows.
    noses = np.array([shape.nose_projection for shape in family])
    assert np.corrcoef(scales, noses)[0, 1] > 0.4
