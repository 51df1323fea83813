import gc
import weakref
from unittest.mock import Mock

import numpy as np
import pytest
from embreex.rtcore_scene import EmbreeScene
from support.plain_shapes import box, grid

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere


def directions(n: int, seed: int = 0) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def box_hit(origins: np.ndarray, along: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Distance to a box by slabs; inf for a miss."""
    t1, t2 = (-half - origins) / along, (half - origins) / along
    near, far = np.minimum(t1, t2).max(axis=1), np.maximum(t1, t2).min(axis=1)
    return np.where((near <= far) & (near > 0), near, np.inf)


def test_first_hits_on_a_box_agree_with_slabs_to_float64() -> None:
    size = np.array([0.1, 0.2, 0.3])
    caster = RayCaster(box(tuple(size), divisions=3))
    origins = directions(3000, 1)
    along = -origins + 0.15 * np.random.default_rng(2).normal(size=origins.shape)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    faces, distances = caster.first_hits(origins, along)
    truth = box_hit(origins, along, size / 2)
    # embree rounds to float32, so a ray through an edge of the box may go either way.
    sure = np.isfinite(truth) == (faces >= 0)
    assert sure.mean() > 0.999
    hit = (faces >= 0) & sure
    assert 0.2 < hit.mean() < 0.9
    np.testing.assert_allclose(distances[hit], truth[hit], rtol=1e-6)
    assert np.median(np.abs(distances[hit] - truth[hit])) < 1e-15
    normals = caster.mesh.face_normals[faces[hit]]
    assert np.all(np.einsum("ij,ij->i", normals, along[hit]) < 0)
    np.testing.assert_array_equal(distances[faces < 0], np.inf)


def test_occlusion_counts_only_what_lies_within_reach() -> None:
    caster = RayCaster(grid(1.0, 1.0, divisions=(2, 2)))
    origins = np.tile([0.1, 0.2, 1.0], (4, 1))
    along = np.array([[0.0, 0, -1], [0, 0, -1], [0, 0, 1], [1, 0, 0]])
    blocked = caster.occluded(origins, along, np.array([0.999, 1.001, 9.0, 9.0]))
    np.testing.assert_array_equal(blocked, [False, True, False, False])


def test_back_faces_block_and_are_hit_like_front_faces() -> None:
    caster = RayCaster(sphere(0.1, subdivisions=3))
    along = directions(500)
    faces, distances = caster.first_hits(np.zeros(3), along)
    assert np.all(faces >= 0)
    np.testing.assert_allclose(distances, 0.1, rtol=2e-2)
    assert caster.occluded(np.zeros(3), along, np.full(500, 0.11)).all()


def test_far_from_the_origin_nothing_changes() -> None:
    mesh = sphere(0.1, subdivisions=4)
    far = np.array([1e4, -2e4, 3e4])
    origins, along = 0.5 * directions(2000), -directions(2000)
    here = RayCaster(mesh).first_hits(origins, along)
    moved = RayCaster(TriangleMesh(mesh.vertices + far, mesh.faces))
    there = moved.first_hits(origins + far, along)
    np.testing.assert_array_equal(there[0], here[0])
    np.testing.assert_allclose(there[1], here[1], atol=1e-9)


def test_the_number_of_threads_changes_nothing() -> None:
    mesh = sphere(0.1, subdivisions=3)
    origins, along = 0.3 * directions(5000, 3), directions(5000, 4)
    one, two = RayCaster(mesh, threads=1), RayCaster(mesh, threads=2)
    hits = one.first_hits(origins, along), two.first_hits(origins, along)
    for a, b in zip(*hits, strict=True):
        np.testing.assert_array_equal(a, b)
    reach = np.full(5000, 0.25)
    np.testing.assert_array_equal(
        one.occluded(origins, along, reach), two.occluded(origins, along, reach)
    )


def test_inputs_stay_untouched_and_no_rays_are_no_error() -> None:
    caster = RayCaster(sphere(0.1, subdivisions=1))
    origins, along, reach = np.ones((3, 3)), -directions(3), np.full(3, 2.0)
    kept = origins.copy(), along.copy(), reach.copy()
    caster.occluded(origins, along, reach)
    caster.first_hits(origins, along)
    for now, before in zip((origins, along, reach), kept, strict=True):
        np.testing.assert_array_equal(now, before)
    assert caster.occluded(np.zeros(3), np.empty((0, 3)), np.empty(0)).shape == (0,)
    assert caster.first_hits(np.zeros(3), np.empty((0, 3)))[0].shape == (0,)


NAN = np.full((2, 3), np.nan)
OK = np.tile([0.0, 0.0, 1.0], (2, 1))


@pytest.mark.parametrize(
    ("origins", "along", "reach", "message"),
    [
        (np.zeros((3, 3)), OK, np.ones(2), r"origins must be \(3,\) or \(2, 3\)"),
        (np.zeros(3), OK[0], np.ones(2), r"directions must be \(n, 3\), got \(3,\)"),
        (np.zeros(3), NAN, np.ones(2), "finite"),
        (NAN, OK, np.ones(2), "finite"),
        (np.zeros(3), OK, np.ones(3), r"distances must be \(2,\)"),
        (
            np.zeros(3),
            OK,
            np.array([1.0, np.inf]),
            r"distances must be \(2,\) and finite",
        ),
    ],
)
def test_what_embree_would_swallow_is_refused(
    origins: np.ndarray, along: np.ndarray, reach: np.ndarray, message: str
) -> None:
    caster = RayCaster(sphere(0.1, subdivisions=1))
    with pytest.raises(ValueError, match=message):
        caster.occluded(origins, along, reach)


def test_a_caster_needs_a_thread() -> None:
    with pytest.raises(ValueError, match="threads must be at least 1, got 0"):
        RayCaster(sphere(0.1, subdivisions=1), threads=0)


def test_casters_of_a_mesh_share_a_tree_and_keep_no_mesh_alive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = Mock(wraps=EmbreeScene)
    monkeypatch.setattr("geometry.rays.rays.EmbreeScene", made)
    meshes = [sphere(radius, subdivisions=2) for radius in (0.1, 0.1, 0.2)]
    casters = [RayCaster(mesh, threads=n) for n in (1, 2) for mesh in meshes]
    assert made.call_count == len(meshes)
    along = directions(50)
    hits = [one.first_hits(np.zeros(3), along)[1].mean() for one in casters]
    np.testing.assert_allclose(hits, 2 * [0.1, 0.1, 0.2], rtol=0.05)
    kept = weakref.ref(meshes[0])
    del meshes, casters
    gc.collect()
    assert kept() is None
