"""Maps and cells twice as fine are asked where known poses leave room for a proof."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene
from support.plain_shapes import box, grid, joined

from geometry.mesh.mesh import TriangleMesh
from planning.proofs import projector_bound
from planning.proofs.all_poses import BoundQuestion, Effort
from planning.proofs.projector_bound import bound_projectors
from planning.rig.rig import load_rig
from planning.scene.draws import Draw

COARSE = Effort(finest=5, maps=4, budget=1e9, shadows=np.inf)
FINER = replace(COARSE, finer_budget=1e9)
N, SHARE = 400, 0.9


@pytest.fixture(scope="module")
def least():
    """Projectors that a box over a plate takes at least; the plate sees out beside."""
    shade = box((0.05, 0.04, 0.03))
    shade = TriangleMesh(shade.vertices + [0.0, 0.0, 0.05], shade.faces)
    mesh, rig = joined(grid(0.2, 0.2, divisions=(3, 3)), shade), load_rig("default")
    scene = make_scene(mesh, make_requirements(mesh, rig, max_projectors=9))
    template = make_projector(rig, np.array([0.1, 0.45]))
    rows = scene.target_samples(Draw(N, 3))

    def bound(effort, count, known=None, unshadowed=None):
        asked = BoundQuestion(int(SHARE * N), count, N, 1e-6)
        given = (scene, (template,), rows, asked, effort)
        return bound_projectors(*given, known, unshadowed).proof().lower_bound

    return bound


def test_what_coarse_maps_leave_open_finer_ones_prove(least):
    finest = replace(COARSE, finest=6, maps=5)
    assert (least(COARSE, 3), least(finest, 3), least(FINER, 3)) == (1, 2, 2)


@pytest.mark.parametrize(("lit", "proved"), [(0.4, 2), (0.85, 1)])
def test_none_are_asked_where_known_poses_may_nearly_be_enough(least, lit, proved):
    """Of all 0.9 is asked: poses that light 0.4 each leave room, 0.85 don't."""
    known = np.random.default_rng(0).random((40, N)) < lit
    assert least(FINER, 2, known) == proved


@pytest.mark.parametrize(("lit", "proved"), [(0.4, 2), (0.85, 1)])
def test_what_is_spent_where_known_poses_leave_room(least, lit, proved):
    known = np.random.default_rng(0).random((40, N)) < lit
    roomy = replace(COARSE, where_room=replace(COARSE, finest=6, maps=5))
    assert least(roomy, 2, known) == proved
    assert least(roomy, 2) == least(COARSE, 2)


def test_the_finest_maps_alone_draw_what_cells_are_held_against(least, monkeypatch):
    drawn, real = [], projector_bound.open_samples

    def noted(scene, limits, *given, **options):
        drawn.append((limits.closely, limits.min_tangent_angle > 0.0))
        return real(scene, limits, *given, **options)

    monkeypatch.setattr(projector_bound, "open_samples", noted)
    assert least(FINER, 3) == 2
    assert drawn == [(False, False), (False, False), (True, True)]


def test_none_are_asked_where_the_work_ended_first(least):
    assert least(replace(FINER, budget=1e5), 3) == 1


def test_maps_that_would_be_too_large_arent_made(least, monkeypatch):
    monkeypatch.setattr(projector_bound, "_MAP_BYTES", 1e5)
    assert least(FINER, 3) == 1


def test_poses_enough_without_shadows_leave_it_to_the_search_among_them(least):
    """One pose that would light all shows that nothing is proved without shadows."""
    every = np.ones((1, N), dtype=bool)
    assert least(FINER, 3, None, every) == 2
