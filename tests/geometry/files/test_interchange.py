import numpy as np
import pytest
import trimesh
from support.plain_shapes import box, torus

from geometry.files.interchange import from_trimesh, to_trimesh
from geometry.mesh.mesh import MeshError
from geometry.shapes.primitives import sphere


def test_a_mesh_comes_back_from_trimesh_as_it_went() -> None:
    mesh = torus(0.1, 0.04)
    back = from_trimesh(to_trimesh(mesh))
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    assert back.source is not None
    assert back.source.unit == "m"
    assert back.source.repairs == ()


def test_units_are_taken_from_the_argument_then_from_the_object() -> None:
    shape = trimesh.creation.box((120.0, 60.0, 40.0))
    with pytest.raises(MeshError, match=r"its unit is None, must be one of .*unit="):
        from_trimesh(shape)
    with pytest.raises(MeshError, match="its unit is 'furlongs'"):
        from_trimesh(shape, unit="furlongs")
    assert np.ptp(from_trimesh(shape, unit="mm").bounds, axis=0).max() == 0.12
    shape.units = "inches"
    longest = np.ptp(from_trimesh(shape).bounds, axis=0).max()
    assert longest == pytest.approx(120 * 0.0254)
    with pytest.raises(MeshError, match="longest side is 120 m"):
        from_trimesh(shape, unit="m")


def test_it_is_repaired_and_oriented_like_a_file() -> None:
    ball = sphere(0.1, subdivisions=2)
    soup = ball.corners[:, ::-1].reshape(-1, 3)
    shape = trimesh.Trimesh(
        soup, np.arange(len(soup)).reshape(-1, 3), process=False, validate=False
    )
    mesh = from_trimesh(shape, unit="m")
    assert len(mesh.vertices) == len(ball.vertices)
    out = np.einsum("ij,ij->i", mesh.face_normals, mesh.face_centroids)
    assert (out > 0).all()
    assert {r.kind for r in mesh.source.repairs} >= {"vertices welded"}


def test_scenes_are_placed_by_their_transforms() -> None:
    scene = trimesh.Scene()
    part = to_trimesh(box((0.1, 0.1, 0.1)))
    scene.add_geometry(part, transform=np.eye(4))
    moved = trimesh.transformations.translation_matrix((1.0, 0.0, 0.0))
    scene.add_geometry(part, transform=moved)
    mesh = from_trimesh(scene, unit="m")
    np.testing.assert_allclose(mesh.bounds, [[-0.05, -0.05, -0.05], [1.05, 0.05, 0.05]])


def test_what_has_no_faces_is_refused() -> None:
    with pytest.raises(MeshError, match="no faces"):
        from_trimesh(trimesh.Trimesh(), unit="m")
