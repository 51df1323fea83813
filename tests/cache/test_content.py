"""Keys: what changes an answer changes them, and nothing else does."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from support.factories import make_requirements, make_rig, make_scene

from geometry.mesh.mesh import MeshSource, TriangleMesh
from geometry.shapes.primitives import sphere
from planning.cache import content as contents
from planning.cache.content import content
from planning.model.requirements import CheckLimits


@dataclass(frozen=True, eq=False)
class _Value:
    values: np.ndarray
    name: str = ""


def test_what_differs_has_another_key():
    values = [
        *(None, True, 1, 1.0, "1", b"1", 0.0, -0.0, float("nan"), 1e-300),
        *((), (1,), ((1,),), (1, 1), ("a", "b"), ("ab", ""), ("", "ab")),
        *({"a": 1}, {"a": 2}, {"b": 1}),
        *(np.zeros(2), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros(2, np.float32)),
        *(np.zeros(2, bool), np.zeros(0), np.zeros((0, 3)), np.ones(2)),
        *(_Value(np.zeros(2)), _Value(np.zeros(2), "x"), _Value(np.zeros(3))),
    ]
    assert len({content(value) for value in values}) == len(values)


def test_what_is_equal_has_one_key():
    array = np.arange(6.0).reshape(2, 3)
    assert content(array) == content(np.asfortranarray(array)) == content(array[:, :])
    assert content(_Value(array)) == content(_Value(array.copy()))
    assert content((1, 2)) == content([1, 2])
    assert content({"a": 1, "b": 2}) == content({"b": 2, "a": 1})


def test_a_mesh_is_its_triangles_wherever_they_came_from():
    ball = sphere(0.1, subdivisions=2)
    source = MeshSource("a.obj", "00", "mm", 1e-3, 1, 1)
    assert content(ball) == content(TriangleMesh(ball.vertices, ball.faces, source))
    moved = ball.vertices.copy()
    moved[0, 0] = np.nextafter(moved[0, 0], 1.0)
    assert content(TriangleMesh(moved, ball.faces)) != content(ball)


def test_nothing_is_known_of_what_cannot_be_read():
    for value in (lambda: 1, {1, 2}, object(), np.array([None])):
        with pytest.raises(TypeError, match="no content"):
            content(value)


def test_a_scene_is_all_that_answers_hang_on_and_projectors_know_less():
    mesh = sphere(0.1, subdivisions=2)
    required = make_requirements(mesh, make_rig(), max_projectors=3)
    scene = make_scene(mesh, required)
    assert content(scene) == content(make_scene(sphere(0.1, subdivisions=2), required))
    steep = np.zeros((len(mesh.faces), 3))
    steep[0, 0] = 1.0
    turned = make_scene(mesh, required, steep=steep)
    assert content(turned.for_light) != content(scene.for_light)

    def asking(**changes):
        return make_scene(mesh, replace(required, **changes))

    ours = {"dominant_coverage": 0.5, "region_coverage": 0.1, "max_projectors": 2}
    theirs = {"coverage": 0.5, "max_cameras": 2, "min_reachable": 0.5}
    theirs["check"] = CheckLimits(*[1.0] * 6)
    for name, value in (ours | theirs).items():
        other = asking(**{name: value})
        assert content(other) != content(scene)
        same = content(other.for_light) == content(scene.for_light)
        assert same == (name in theirs), name
    tighter = replace(required.triangulation, max_sigma_m=1e-6)
    exact = asking(triangulation=tighter)
    assert content(exact.for_light) == content(scene.for_light)


def test_the_code_of_every_room_that_keeps_answers_counts():
    rooms = Path(contents.__file__).parents[1]
    files = [file for file in rooms.rglob("*.py") if ".recall(" in file.read_text()]
    kept = {file.relative_to(rooms).parts[0] for file in files}
    assert {"report", "steps"} <= kept
    assert kept.isdisjoint(contents._ABOVE)
