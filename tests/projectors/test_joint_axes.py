"""Devices planned together have ring axes of one kind, the two stages'."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.factories import make_projector, make_rig, make_scene

from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.model.devices.device_poses import moved_to
from planning.model.progress import Stopwatch
from planning.rig.wishes import Wishes
from planning.rings.ring_radii import uniform_radii
from planning.steps import stages
from planning.steps.joint import joining
from planning.steps.joint.offer import with_axes

RADIUS, UP = 0.1, np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def offered(request):
    """A scene of a ball, and a candidate whose axis stands aside of it."""
    rig = make_rig(request.param)
    wishes = Wishes(max_projectors=1, target="surface")
    required = rig.requirements(np.zeros(3), RADIUS, wishes, tau_m=0.004)
    aside = {"diverging": 0.15, "parallel": 0.17}[request.param]
    projector = make_projector(rig, uniform_radii(2.0 * aside, 0.004), (aside, 0.0))
    pose = look_at(np.array([0.0, -1.1, 0.0]), np.zeros(3), UP)
    scene = make_scene(sphere(RADIUS, subdivisions=4), required)
    return scene, moved_to(projector, pose)


def of_axes(axes, scene=None):
    request = SimpleNamespace(ring_margin=0.0)
    return SimpleNamespace(axes=axes, scene=scene, request=request)


@pytest.mark.parametrize("axes", ["free", None])
def test_beside_free_axes_no_rings_are_cut(offered, axes):
    """The outermost ring of a plan with free axes is the reference's."""
    scene, projector = offered
    assert with_axes(of_axes(axes, scene), [projector]) == (projector,)


def test_beside_centred_axes_all_are_centred(offered):
    scene, projector = offered
    (centred,) = with_axes(of_axes("centred", scene), [projector])
    assert len(centred.ring_radii) < len(projector.ring_radii)
    moved = np.abs(centred.world_from_ring - projector.world_from_ring)
    assert moved.max() > 0.05


@pytest.mark.parametrize("axes", ["free", "centred", None])
def test_a_device_more_keeps_the_kind_of_axes(handmade, monkeypatch, axes):
    """`auto` might choose anew, and what is on offer has axes of the other kind."""
    placed = []

    def dark(document):
        document["coverage"]["target"]["lit_m2"] = 0.0

    plan = handmade.tampered(handmade.build_plan(), dark)
    partial = of_axes(axes)
    partial.surviving, partial.projectors, partial.cameras = None, (), ()
    partial.ready = partial.stage = None
    monkeypatch.setattr(stages, "_one_projector_more", lambda stage, most: "more")
    monkeypatch.setattr(stages, "placed", lambda *given: placed.append(given[3]))
    monkeypatch.setattr(joining, "devices_of", lambda *_: ((), ()))
    monkeypatch.setattr(joining, "within_stock", lambda *_: True)
    monkeypatch.setattr(joining, "with_cameras_for", lambda *_: partial)
    monkeypatch.setattr(joining, "polished", lambda partial, clock: partial)
    joint = SimpleNamespace(
        two_stage=SimpleNamespace(cost=2.0),
        plan=None,
        partial=partial,
        costs=SimpleNamespace(both=lambda *_: 1.0),
        clock=Stopwatch(),
        _take=lambda partial, found: plan,
    )
    joint.plan = SimpleNamespace(requirements=SimpleNamespace(stock_of=str))
    none = np.zeros(0, dtype=np.int64)
    answer = SimpleNamespace(cost=1.0, projectors=none, cameras=none)

    joining._Joint._by_candidates(joint, SimpleNamespace(tables=None), answer)

    assert placed == [axes]
