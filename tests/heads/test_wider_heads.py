"""Heads moved by the pose program: over a plate there is a best place for one."""

from dataclasses import replace

import numpy as np
import pytest
from support.group_rigs import egg, head_rig

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from planning.cameras.stations.heads.head_cover import HeadCover, HeadSets
from planning.cameras.stations.heads.head_poses import HeadSource, widened
from planning.cameras.stations.heads.wider_heads import wider_heads
from planning.model.progress import Stopwatch
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS
from planning.steps.prepare import prepared

_UP = np.array([0.0, 0.0, 1.0])


def _plate(side=0.1, n=12):
    """A square of the plane z = 0 that faces up."""
    line = np.linspace(-0.5 * side, 0.5 * side, n)
    x, y = np.meshgrid(line, line)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    quads = np.column_stack([a, a + 1, a + n + 1, a + n])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return TriangleMesh(vertices, faces)


def _source(mesh, **asked):
    rig = head_rig(**asked)
    wishes = Wishes(max_projectors=1, max_heads=9, target="surface", pattern="dense")
    ready = prepared(PlanRequest(mesh, rig, wishes, threads=1), Stopwatch())
    space = ready.scene.requirements.workspace
    scene = ready.scene.within(widened(space, rig.head))
    return HeadSource(scene, rig.head, space, ready.templates, ready.cameras)


def _at(source, place, aim=(0.0, 0.0, 0.0)):
    (pose,) = look_at(np.array([place]), np.array([aim]), np.array([0.0, 1.0, 0.0]))
    return source.at(pose)


def _steepest(head, points):
    """Largest angle to the upright of lines from a head to points [rad]."""
    ways = head.world_from_head[:3, 3] - points
    return np.arccos((ways @ _UP / np.linalg.norm(ways, axis=1)).min())


def test_a_head_comes_to_stand_over_the_middle_of_a_plate():
    """Where it is farthest, the corner's incidence is least: atan(70.7 mm / height)."""
    source = _source(_plate(), requirements={"coverage": 1.0, "region_coverage": 0.0})
    target = source.scene.target_samples(replace(DRAWS.cameras, count=500))
    start = _at(source, (0.15, -0.1, 0.57))
    cover = HeadCover.of(source.scene, HeadSets.of(source.scene, [start], target))
    assert cover.sets.measured.all()
    (head,) = wider_heads(source, cover, cover, [start])
    points = target.samples.points
    highest = source.workspace.camera_radius_m[1]
    reach = np.linalg.norm(points[:, :2], axis=1).max()
    assert _steepest(head, points) < _steepest(start, points) - np.radians(8.0)
    assert _steepest(head, points) == pytest.approx(
        np.arctan2(reach, highest), abs=0.01
    )
    assert cover.lacking(np.array([0])) == 0
    # It stays one rigid body.
    for placed, device in zip(
        (*head.projectors, *head.cameras), source.head.devices, strict=True
    ):
        truth = head.world_from_head @ device.head_from_device
        assert placed.world_from_device == pytest.approx(truth, abs=1e-12)


def test_heads_about_an_egg_measure_no_less_and_what_counts_more_squarely():
    source = _source(egg())
    target = source.scene.target_samples(replace(DRAWS.cameras, count=800))
    places = [(0.6, 0.1, 0.1), (-0.6, 0.2, 0.0), (0.0, -0.6, 0.15), (0.1, 0.6, -0.1)]
    starts = [_at(source, place) for place in places]
    every = HeadSets.of(source.scene, starts, target)
    cover = HeadCover.of(source.scene, every)
    heads = wider_heads(source, cover, cover, starts)
    assert any(a is not b for a, b in zip(heads, starts, strict=True))
    moved = replace(cover, sets=HeadSets.of(source.scene, heads, target))
    chosen = np.arange(len(starts))
    assert moved.lacking(chosen) <= cover.lacking(chosen)
    squarely = [
        np.sort(_facing(some, placed, target))[-cover.asked[1]]
        for some, placed in ((every, starts), (moved.sets, heads))
    ]
    assert squarely[1] > squarely[0]


def test_what_fresh_samples_deny_is_not_done():
    """All that is asked of them only the beginning measures."""
    source = _source(_plate(), requirements={"coverage": 1.0, "region_coverage": 0.0})
    target = source.scene.target_samples(replace(DRAWS.cameras, count=2000))
    start = _at(source, (0.15, -0.1, 0.57))
    few = target.take(np.arange(200))
    cover = HeadCover.of(source.scene, HeadSets.of(source.scene, [start], few))
    (moved,) = wider_heads(source, cover, cover, [start])
    assert moved is not start
    wide = replace(target.samples, points=5.0 * target.samples.points)
    both = HeadSets.of(source.scene, [start, moved], replace(target, samples=wide))
    lost = np.flatnonzero(both.measured[:, 0] & ~both.measured[:, 1])
    assert len(lost) > 20
    seen = HeadSets.of(source.scene, [start], both.target.take(lost))
    fresh = HeadCover.of(source.scene, seen)
    assert wider_heads(source, cover, fresh, [start]) == (start,)


def _facing(sets, heads, target):
    """The largest cosine at each sample of those that measure it."""
    samples, best = target.samples, np.full(len(target), -np.inf)
    for k, head in enumerate(heads):
        ways = head.world_from_head[:3, 3] - samples.points
        cosine = np.sum(ways * samples.normals, axis=1) / np.linalg.norm(ways, axis=1)
        best = np.maximum(best, np.where(sets.measured[:, k], cosine, -np.inf))
    return best


def test_housings_in_each_others_way_keep_heads_where_they_are():
    body = {"size_mm": [420.0, 100.0, 80.0], "centre_mm": [0.0, 0.0, -30.0]}
    source = _source(egg(), head={"body": body})
    target = source.scene.target_samples(replace(DRAWS.cameras, count=300))
    starts = [_at(source, (0.6, 0.0, 0.0)), _at(source, (0.6, 0.02, 0.0))]
    assert source.colliding(starts) is not None
    cover = HeadCover.of(source.scene, HeadSets.of(source.scene, starts, target))
    assert wider_heads(source, cover, cover, starts) == tuple(starts)
