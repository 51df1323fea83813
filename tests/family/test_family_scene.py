"""Members of a family stand before a rig one at a time, and each has its quota."""

import numpy as np
import pytest
from support.factories import make_requirements, make_rig, make_scene

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.errors import InputError
from planning.proofs.quotas import Quotas, RegionFloors
from planning.proofs.selection import CandidateCover
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.family_scene import FamilyScene
from planning.steps.asked.family_request import (
    check_members,
    family_of,
    member_names,
)
from planning.steps.family.left_out import costly_members

SMALL, LARGE = 0.03, 0.1


@pytest.fixture(scope="module")
def family():
    rig, meshes = make_rig(), (sphere(SMALL), sphere(LARGE))
    asked = make_requirements(
        meshes[1],
        rig,
        max_projectors=4,
        coverage=0.8,
        dominant_coverage=0.6,
        region_coverage=0.0,
    )
    return FamilyScene.of([make_scene(mesh, asked) for mesh in meshes])


def test_no_member_hides_another(family):
    samples = family.surface_samples(Draw(500, 7))
    device = np.array([0.0, 0.0, 1.0])
    facing = samples.samples.normals @ device > 0.3
    hidden = family.occlusion.blocked(device, samples.take(facing))
    # The small ball lies inside the large one, and sees the device all the same.
    assert not hidden.any()
    seen = family.occlusion.seen(device[None], samples)
    assert np.array_equal(seen[0, facing], np.ones(facing.sum(), dtype=bool))


def test_each_member_hides_itself(family):
    samples = family.surface_samples(Draw(500, 7))
    device = np.array([0.0, 0.0, 1.0])
    behind = samples.samples.normals @ device < -0.3
    assert family.occlusion.blocked(device, samples.take(behind)).all()


def test_members_get_as_many_samples_on_their_own_faces(family):
    samples = family.surface_samples(Draw(500, 7))
    counts = np.bincount(samples.member)
    assert counts.tolist() == [500, 500]
    radii = np.linalg.norm(samples.samples.points, axis=1)
    assert np.all((radii < 0.05) == (samples.member == 0))
    corners = family.mesh.corners[samples.samples.faces]
    middle = corners.mean(axis=1) - samples.samples.points
    assert np.linalg.norm(middle, axis=1).max() < 0.05 * LARGE + SMALL


def test_many_members_share_the_samples():
    rig, mesh = make_rig(), sphere(SMALL)
    scene = make_scene(mesh, make_requirements(mesh, rig, max_projectors=4))
    family = FamilyScene.of([scene] * 10)
    samples = family.surface_samples(Draw(2000, 7))
    assert np.bincount(samples.member).tolist() == [800] * 10


@pytest.mark.parametrize(("kind", "share"), [("projector", 0.6), ("camera", 0.8)])
def test_each_member_has_the_share_that_is_asked(family, kind, share):
    samples = family.surface_samples(Draw(100, 7))
    floors = RegionFloors.of(family, samples, kind)
    quotas = Quotas.of(floors, np.ones(200, dtype=bool), 0.0)
    assert quotas.floors.tolist() == [0, round(100 * share), round(100 * share)]
    # All of the large member and nothing of the small one isn't enough.
    assert not quotas.enough(samples.member == 1)


def test_without_floors_only_the_whole_counts(family):
    plain = family.without_floors
    assert family.has_floors
    assert not plain.has_floors
    samples = plain.surface_samples(Draw(100, 7))
    assert RegionFloors.of(plain, samples).n_rows == 1
    assert plain.occlusion is family.occlusion


def test_a_small_member_is_no_fragment():
    large = sphere(LARGE)
    aside = TriangleMesh(sphere(1e-3).vertices + [0.3, 0.0, 0.0], sphere(1e-3).faces)
    both = TriangleMesh.joined([large, aside])
    # In one file it would be what a scanner leaves behind.
    assert not TriangleMesh(both.vertices, both.faces).main.all()
    assert both.main.all()
    assert both.radius == pytest.approx(0.5 * (LARGE + 0.3 + 1e-3), rel=1e-3)


def test_members_that_cost_a_device_are_found():
    # Two candidates: the first covers members 0 and 1, the second member 2 alone.
    covers = np.array([[1, 0], [1, 0], [0, 1]], dtype=bool)
    row = np.array([1, 2, 3])
    cover = CandidateCover(covers, 1.0, regions=RegionFloors(row, 4, 1.0))
    assert costly_members(cover, 2, 1) == {2}
    assert costly_members(cover, 2, 0) == frozenset()


def test_names_are_told_apart():
    paths = ["a/head.obj", "b/head.stl", "C\\HEAD.ply", "", "weird name!.obj.gz"]
    assert member_names(paths) == (
        *("head", "head-2", "HEAD-3", "member-4", "weird-name"),
    )


@pytest.mark.parametrize("quantile", [0.0, -1.0, 1.1, float("nan")])
def test_a_share_of_members_must_be_one(quantile):
    with pytest.raises(InputError, match="family_quantile"):
        family_of([sphere(SMALL)] * 2, "given", quantile)


@pytest.mark.parametrize(
    ("quantile", "n_asked"), [(1e-10, 1), (0.5, 1), (0.51, 2), (1.0, 2)]
)
def test_a_rig_serves_one_member_at_least(quantile, n_asked):
    assert family_of([sphere(SMALL)] * 2, "given", quantile).n_asked == n_asked


def test_a_selection_is_of_one_mesh():
    with pytest.raises(InputError, match="selection"):
        check_members(Wishes(max_projectors=1), selected=True)
    with pytest.raises(InputError, match="region_coverage"):
        check_members(Wishes(max_projectors=1, region_coverage=0.5), selected=False)
