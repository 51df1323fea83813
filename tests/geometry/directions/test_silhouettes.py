"""Silhouettes against a loop over all edges, those through the horizon among them."""

import itertools

import numpy as np
import pytest
from support.plain_shapes import box, grid, joined

from geometry.directions.silhouettes import Silhouettes
from geometry.mesh.mesh import TriangleMesh


def turned(mesh, angle, by):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return TriangleMesh(mesh.vertices @ turn.T + np.array(by), mesh.faces)


# A floor, a box that reaches through it, and an open wall that does.
SCENE = joined(
    grid(0.2, 0.2, divisions=(3, 3)),
    turned(box((0.04, 0.05, 0.06)), 0.3, (0.15, 0.02, 0.005)),
    turned(grid(0.08, 0.06, divisions=(1, 1)), np.pi / 2, (-0.15, 0.0, 0.01)),
)


def edges_with_faces(mesh):
    found = {}
    for f, face in enumerate(mesh.faces.tolist()):
        for k in range(3):
            ends = tuple(sorted((face[k], face[(k + 1) % 3])))
            found.setdefault(ends, []).append(f)
    return found


def expected(mesh, point, normal):
    """Edges that bound what the point sees, with an end above its horizon."""
    kept = []
    for (a, b), faces in edges_with_faces(mesh).items():
        rise = (mesh.vertices[[a, b]] - point) @ normal
        sides = [
            (point - mesh.vertices[mesh.faces[f][0]]) @ mesh.face_normals[f]
            for f in faces
        ]
        alone = len(faces) != 2
        if rise.max() > 1e-9 and (alone or sides[0] * sides[1] < -1e-12):
            kept.append(((a, b), alone, rise.min() < -1e-9))
    return kept


@pytest.mark.parametrize("half_angle", [0.5 * np.pi, 1.2])
def test_no_silhouette_above_the_horizon_is_left_out(half_angle):
    mesh, edges = SCENE, Silhouettes(SCENE)
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-0.09, 0.09, (40, 2)), np.zeros(40)])
    normals = np.tile([0.0, 0.0, 1.0], (40, 1))
    owner, begin, end = edges.seen_from(edges.sides(points, normals), half_angle)
    through = {True: 0, False: 0}
    for i, (point, normal) in enumerate(zip(points, normals, strict=True)):
        mine = owner == i
        both = np.stack([begin[mine], end[mine]], axis=1) + point
        for (a, b), alone, crosses in expected(mesh, point, normal):
            ends = mesh.vertices[[a, b]]
            steps = np.linspace(0.0, 1.0, 400)[:, None]
            rays = ends[0] + steps * (ends[1] - ends[0]) - point
            off = rays @ normal / np.linalg.norm(rays, axis=1)
            if off.max() < np.cos(half_angle):
                continue
            gaps = [
                np.abs(both - ends[list(order)]).max(axis=(1, 2))
                for order in itertools.permutations((0, 1))
            ]
            assert min(gap.min(initial=1.0) for gap in gaps) < 1e-12
            through[alone] += crosses
    # The upright edges of the box and of the wall go through the floor's plane.
    assert min(through.values()) >= (40 if half_angle > 1.5 else 1)
