"""Skies of samples on which what is closed is known in closed form."""

import numpy as np
import pytest
from support.plain_shapes import grid

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.proofs.poses.outlines import Outlines
from planning.verify.audit.proofs.poses.skies import Skies, SkyMaps

_CAP, _TANGENT = np.radians(65.0), np.radians(80.0)
_FINENESS = pytest.mark.parametrize("pixels", [100, 200])


def _sky(
    mesh: TriangleMesh,
    steep: tuple[float, float, float],
    tangent: float,
    pixels: int = 100,
) -> Skies:
    """Of the origin, which lies on the first face of a mesh, normal to z."""
    one = np.zeros(1, dtype=np.int64)
    samples = AuditSamples(
        np.zeros((1, 3)),
        np.array([[0.0, 0.0, 1.0]]),
        one,
        np.array([steep]),
        one,
        np.ones(1, dtype=bool),
        np.ones(1),
    )
    shadow = Shadow(mesh, threads=1)
    angles = _CAP, tangent
    maps = SkyMaps(samples, shadow.caster, *angles, 2.0 * shadow.slack_m, pixels)
    return maps.of(one, lambda _: None)


def _within_cap(n: int) -> Array:
    rng = np.random.default_rng(1)
    off, turn = _CAP * rng.random(n), 2.0 * np.pi * rng.random(n)
    across = np.sin(off)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), np.cos(off)])


def _ground() -> TriangleMesh:
    flat = grid(0.4, 0.4, divisions=(1, 1))
    return TriangleMesh(flat.vertices + [0.05, -0.02, 0.0], flat.faces)


@_FINENESS
def test_a_belt_stays_open_as_far_as_it_is_and_no_farther(pixels: int) -> None:
    # All is closed but what is ten degrees or less from the plane across T1.
    towards = _within_cap(40_000)
    sky = _sky(_ground(), (1.0, 0.0, 0.0), _TANGENT, pixels)
    none = np.zeros(len(towards), dtype=np.int64)
    margin = np.abs(np.arcsin(towards[:, 0])) - np.radians(10.0)
    nearest = towards * [0.0, 1.0, 1.0]
    # Where the nearest of the belt is in the cap.
    held = (margin > 0.0) & (
        nearest[:, 2] > np.cos(0.97 * _CAP) * np.hypot(*nearest.T[1:])
    )
    assert held.sum() > 10_000
    assert not sky.closed(none, towards, 1.001 * np.abs(margin) + 1e-6)[held].any()
    # The map stretches by 1.25 at most, and a few pixels are lost at the edge.
    pixel = _CAP / pixels
    inner = held & (margin > 6.0 * pixel)
    assert sky.closed(none, towards, 0.75 * margin - 4.0 * pixel)[inner].all()
    assert inner.sum() > 1000


@_FINENESS
def test_a_wall_closes_what_is_behind_it(pixels: int) -> None:
    # A wall at x = 1 from y = -1 to 1, without end in z: its sides are planes by y.
    ground, wall = _ground(), grid(40.0, 2.0, divisions=(1, 1))
    upright = np.column_stack(
        [np.ones(len(wall.vertices)), wall.vertices[:, 1], wall.vertices[:, 0]]
    )
    mesh = TriangleMesh.joined([ground, TriangleMesh(upright, wall.faces)])
    sky = _sky(mesh, (0.0, 0.0, 0.0), 0.0, pixels)
    towards = _within_cap(40_000)
    none = np.zeros(len(towards), dtype=np.int64)
    x, y, z = towards.T
    behind = (x > 0.0) & (np.abs(y) < x) & (z < 20.0 * x)
    shut = sky.closed(none, towards, np.zeros(len(towards)))
    assert not (shut & ~behind).any()
    # Angles to both sides, y = x and y = -x, and to the top, z = 20 x.
    sides = np.arcsin((x - np.abs(y)) / 2.0**0.5)
    margin = np.minimum(sides, np.arcsin((20.0 * x - z) / 401.0**0.5))
    assert shut[margin > 5.0 * _CAP / pixels].all()
    assert shut.sum() > 4000


@pytest.mark.parametrize("back", [[[3, 2, 4], [3, 4, 5]], [[3, 4, 2], [3, 5, 4]]])
def test_a_ridge_is_an_outline_however_its_faces_are_wound(back) -> None:
    # A wall at x = 1, 20 high, and a slope behind it from its top down to x = 5.
    ends = [-1.0, 1.0]
    front = [(1.0, y, 0.0) for y in ends] + [(1.0, y, 20.0) for y in ends[::-1]]
    corners = np.array([*front, *((5.0, y, 0.0) for y in ends[::-1])])
    faces = np.array([[0, 1, 2], [0, 2, 3], *back])
    sky = _sky(
        TriangleMesh.joined([_ground(), TriangleMesh(corners, faces)]),
        (0.0, 0.0, 0.0),
        0.0,
    )
    towards = _within_cap(40_000)
    none, (x, y, z) = np.zeros(len(towards), dtype=np.int64), towards.T
    behind = (x > 0.0) & (np.abs(y) < x) & (z < 20.0 * x)
    shut = sky.closed(none, towards, np.zeros(len(towards)))
    assert not (shut & ~behind).any()
    assert shut.sum() > 4000


def test_a_face_of_three_at_an_edge_has_a_border_of_its_own() -> None:
    corners = np.array(
        [[0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0], [0.0, -1, 0], [0.0, 0, 1]]
    )
    mesh = TriangleMesh(corners, np.array([[0, 1, 2], [0, 4, 1], [0, 3, 1]]))
    outlines = Outlines(mesh)
    sides = outlines.sides(np.array([0.3, 0.4, 2.0]))
    for face in range(3):
        alone = outlines.of_faces(sides, np.arange(3) == face)
        assert set(alone) == set(mesh.edges.of_face[face])


def test_a_face_that_touches_the_sample_blocks_nothing() -> None:
    # A lid a little above the ground: the audit's rays leave out what is so near.
    # Within their slack it is or isn't in the way as the ray is slanted.
    slack_m = Shadow(_ground(), threads=1).slack_m
    for height, blocks in ((0.9 * slack_m, False), (1e-3, True)):
        lid = grid(0.2, 0.2, divisions=(1, 1))
        lid = TriangleMesh(lid.vertices + [0.0, 0.0, height], lid.faces)
        sky = _sky(TriangleMesh.joined([_ground(), lid]), (0.0, 0.0, 0.0), 0.0)
        up = np.array([[0.0, 0.0, 1.0]])
        closed = sky.closed(np.zeros(1, dtype=np.int64), up, np.array([0.3]))
        assert bool(closed[0]) == blocks
