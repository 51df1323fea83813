"""Triangles are the solid that a rig states, or something less is in the way."""

import numpy as np
import pytest
import trimesh

from geometry.shapes import primitives
from planning.verify.audit.devices.solid_claims import lacks_of_solid

SIDES = np.array([0.4, 0.6, 0.2])


def lacks(mesh, sides=SIDES, *, turned=False):
    corners = mesh.vertices[mesh.faces]
    return lacks_of_solid(corners, np.array(mesh.faces), sides, round=turned)


@pytest.fixture
def box():
    return trimesh.creation.box(SIDES)


def of(*parts):
    return trimesh.util.concatenate(parts)


def test_a_box_and_a_prism_are_what_they_say(box):
    assert lacks(box) == lacks(box.subdivide()) == ""
    prism = primitives.cylinder(0.2, 0.3)
    assert lacks(prism, np.array([0.4, 0.4, 0.3]), turned=True) == ""


def test_specks_at_corners_and_sheets_are_no_box(box):
    """Their extent and area are the box's, and light goes through between them."""
    speck = trimesh.creation.box([0.001] * 3)
    ends = 0.5 * (SIDES - 0.001)
    specks = [
        speck.copy().apply_translation((2.0 * np.array(corner) - 1.0) * ends)
        for corner in np.ndindex(2, 2, 2)
    ]
    sheet = trimesh.creation.box([0.4, 0.6, 0.001])
    low = sheet.copy().apply_translation([0.0, 0.0, -0.0995])
    assert "inside it" in lacks(of(*specks))
    assert "inside it" in lacks(of(low, *specks))


def test_an_open_a_folded_and_a_flipped_box_are_none(box):
    hole = box.submesh([np.arange(1, 12)], append=True, repair=False)
    assert "open" in lacks(hole)
    flipped = box.copy()
    flipped.faces = flipped.faces[:, ::-1]
    assert "inside out" in lacks(flipped)
    half = trimesh.creation.box(SIDES * [0.5, 1.0, 1.0])
    left = half.apply_translation([-0.1, 0.0, 0.0])
    assert "inside it" in lacks(of(left, left))


def test_a_prism_of_few_sides_is_no_cylinder():
    sides = np.array([0.4, 0.4, 0.3])
    square = trimesh.creation.cylinder(0.2, 0.3, sections=4)
    assert "inside it" in lacks(square, sides, turned=True)
