"""Regions of faces that a user chose, or of the highest weight."""

import numpy as np
import pytest
from support.plain_shapes import box, cylinder, grid

from geometry.curvature.curvature import principal_curvatures
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import components, face_pairs, mesh_edges
from geometry.regions.cones import averaged_normals
from geometry.regions.regions import DominantRegions, dominant_regions
from geometry.regions.selected_regions import (
    heaviest_faces,
    regions_of_faces,
)
from geometry.shapes.primitives import sphere


def regions_of(mesh: TriangleMesh, chosen: np.ndarray) -> DominantRegions:
    return regions_of_faces(mesh, principal_curvatures(mesh), chosen)


def is_connected(mesh: TriangleMesh, faces: np.ndarray) -> bool:
    pairs = face_pairs(mesh_edges(mesh.faces[faces]), manifold_only=False)[0]
    return components(pairs, len(faces))[0] == 1


def test_one_side_of_a_box_is_one_region_that_looks_along_its_normal() -> None:
    mesh = box((0.08, 0.06, 0.04), divisions=4)
    chosen = mesh.face_normals[:, 2] > 0.9
    found = regions_of(mesh, chosen)
    assert len(found) == 1
    np.testing.assert_array_equal(found.face_region >= 0, chosen)
    np.testing.assert_allclose(found[0].mean_normal, [0, 0, 1], atol=1e-12)
    assert found[0].area_m2 == pytest.approx(0.08 * 0.06, rel=1e-12)
    assert found[0].cone_angle == pytest.approx(0.0, abs=1e-7)
    assert found.dominant_share == pytest.approx(48 / (2 * (48 + 24 + 32)), rel=1e-12)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.8, 1.0])
def test_exactly_the_chosen_faces_are_the_target(share: float) -> None:
    ball = sphere(0.1, subdivisions=3)
    # Scattered single faces too: no speck is dropped, no hole filled.
    chosen = np.random.default_rng(3).random(len(ball.faces)) < share
    chosen[17] = True
    found = regions_of(ball, chosen)
    np.testing.assert_array_equal(found.face_region >= 0, chosen)
    areas = [region.area_m2 for region in found]
    assert np.all(np.diff(areas) <= 1e-9 * ball.area)
    normals = averaged_normals(ball, face_pairs(mesh_edges(ball.faces))[0])
    for region in found:
        np.testing.assert_array_equal(
            np.flatnonzero(found.face_region == region.id), region.faces
        )
        assert is_connected(ball, region.faces)
        areas = ball.face_areas[region.faces]
        mean = areas @ normals[region.faces]
        lean = normals[region.faces] @ (mean / np.linalg.norm(mean))
        inside = lean >= np.cos(np.deg2rad(50.0)) - 1e-12
        assert areas[inside].sum() >= 0.95 * areas.sum()


def test_a_whole_ball_needs_at_least_as_many_cones_as_its_area_says() -> None:
    ball = sphere(0.1, subdivisions=4)
    found = regions_of(ball, np.ones(len(ball.faces), dtype=bool))
    # A cone of 50 degrees that may miss 5 % holds (1 - cos 50) / 2 / 0.95 of a ball.
    assert len(found) >= 0.95 * 2 / (1 - np.cos(np.deg2rad(50.0)))


def test_an_open_border_is_chosen_like_anything_else() -> None:
    plate = grid(0.2, 0.1, divisions=(30, 20))
    chosen = np.abs(plate.face_centroids[:, 0]) > 0.095
    field = principal_curvatures(plate)
    assert not np.all(field.valid[plate.faces[chosen]])
    found = regions_of_faces(plate, field, chosen)
    np.testing.assert_array_equal(found.face_region >= 0, chosen)
    assert len(found) == 2


def test_steep_directions_are_those_of_the_curvature() -> None:
    tube = cylinder(0.05, 0.3, around=120, along=60, capped=False)
    chosen = tube.face_normals[:, 0] > 0.5
    found = regions_of(tube, chosen)
    middle = chosen & (np.abs(tube.face_centroids[:, 2]) < 0.1)
    assert middle.any()
    around = np.cross([0.0, 0.0, 1.0], tube.face_normals[middle])
    along = np.abs(np.einsum("ij,ij->i", found.steep[middle], around))
    np.testing.assert_allclose(along, 1.0, atol=1e-3)


def test_what_curvature_chose_can_be_chosen_again() -> None:
    ball = sphere(0.1, subdivisions=4)
    mesh = TriangleMesh(ball.vertices * [1.0, 0.6, 0.35], ball.faces)
    field = principal_curvatures(mesh)
    found = dominant_regions(mesh, field)
    again = regions_of_faces(mesh, field, found.face_region >= 0)
    np.testing.assert_array_equal(again.face_region >= 0, found.face_region >= 0)
    np.testing.assert_array_equal(again.steep, found.steep)
    assert again.dominant_share == found.dominant_share


def test_a_painted_one_chooses_exactly_the_painted_faces() -> None:
    ball = sphere(0.1, subdivisions=4)
    for low in (-0.95, -0.2, 0.4, 0.9):
        # From most of the ball, far above a fifth, down to a small cap.
        paint = (ball.vertices[:, 2] >= low * 0.1).astype(float)
        painted = np.all(paint[ball.faces] == 1.0, axis=1)
        chosen = heaviest_faces(ball, paint, ball.faces)
        np.testing.assert_array_equal(chosen, painted)


def by_face(mesh: TriangleMesh, weight: np.ndarray, share: float = 0.2) -> np.ndarray:
    """The heaviest faces where each has a weight of its own."""
    corners = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    return heaviest_faces(mesh, np.repeat(weight, 3), corners, area_share=share)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.6, 1.0])
def test_the_heaviest_share_of_the_area_is_taken(share: float) -> None:
    mesh = box((0.08, 0.06, 0.04), divisions=9)
    weight = np.random.default_rng(1).random(len(mesh.faces)) + 0.1
    chosen = by_face(mesh, weight, share)
    taken = mesh.face_areas[chosen].sum() / mesh.area
    # No more than the one face that crosses the share.
    assert share - 1e-12 <= taken <= share + mesh.face_areas.max() / mesh.area
    if share < 1:
        assert weight[chosen].min() > weight[~chosen].max()
    # Only the order of the weights counts.
    other = by_face(mesh, 7e-4 * weight**3, share)
    np.testing.assert_array_equal(chosen, other)


def test_equal_weights_are_taken_all_or_none_and_zero_never() -> None:
    plate = grid(0.2, 0.1, divisions=(20, 10))
    n = len(plate.faces)
    steps = np.floor(np.arange(n) * 4 / n)
    np.testing.assert_array_equal(by_face(plate, steps), steps == 3)
    share = by_face(plate, steps, 0.3)
    np.testing.assert_array_equal(share, steps >= 2)
    everything = by_face(plate, steps, 1.0)
    np.testing.assert_array_equal(everything, steps >= 1)
    assert by_face(plate, np.ones(n)).all()


def test_a_face_weighs_as_much_as_its_lightest_corner() -> None:
    square = TriangleMesh(np.eye(4)[:, :3], np.array([[0, 1, 2], [3, 2, 1]]))
    weight = [0.5, 2.0, 3.0, 9.0, np.nan]
    for share, chosen in ((0.3, [False, True]), (1.0, [True, True])):
        heaviest = heaviest_faces(square, weight, square.faces, area_share=share)
        np.testing.assert_array_equal(heaviest, chosen)


def test_what_cannot_be_a_selection_or_a_weight_is_refused() -> None:
    ball = sphere(0.1, subdivisions=1)
    n = len(ball.faces)
    field = principal_curvatures(ball)
    for bad in (np.ones(n), np.ones(n - 1, bool), np.ones((n, 1), bool), [0, 1]):
        with pytest.raises(ValueError, match=f"chosen must be {n} bool, one a face"):
            regions_of_faces(ball, field, bad)
    with pytest.raises(ValueError, match="at least one face, holds none"):
        regions_of_faces(ball, field, np.zeros(n, bool))
    for share in (0.0, 1.1, np.nan):
        with pytest.raises(ValueError, match="area_share must lie in"):
            by_face(ball, np.ones(n), share)
    for value in (-1.0, np.nan, np.inf):
        weight = np.ones(len(ball.vertices))
        weight[2] = value
        refusal = f"weight of vertex 2 is {value}, must be a finite number, at least 0"
        with pytest.raises(ValueError, match=refusal):
            heaviest_faces(ball, weight, ball.faces)
    with pytest.raises(ValueError, match="no face has a weight above 0"):
        by_face(ball, np.zeros(n))


def test_thousands_of_scattered_faces_are_as_many_regions() -> None:
    ball = sphere(0.1, subdivisions=6)
    pairs = face_pairs(mesh_edges(ball.faces))[0]
    order = np.random.default_rng(5).permutation(len(ball.faces))[:6000]
    chosen = np.zeros(len(ball.faces), dtype=bool)
    chosen[order] = True
    found = regions_of(ball, chosen)
    np.testing.assert_array_equal(found.face_region >= 0, chosen)
    inner = pairs[chosen[pairs].all(axis=1)]
    lonely = components(inner, len(ball.faces))[0] - int((~chosen).sum())
    assert lonely > 4000
    assert len(found) == lonely
