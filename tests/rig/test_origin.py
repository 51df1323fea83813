"""Places that count from the origin of the mesh are the same places."""

from dataclasses import replace

import numpy as np
import pytest
from support.plain_shapes import box as plate_of
from support.written import requirements_of

from geometry.mesh.mesh import TriangleMesh
from planning import RequirementError, load_rig, plan_rig
from planning.model.errors import InfeasibleLimitsError, RigError
from planning.model.plan import RigPlan
from planning.rig.wishes import Wishes
from planning.verify.audit.audit import audit_plan

# The middle of the plate [mm].
CENTRE = np.array([300.0, -200.0, 500.0])
PLACED = """
[workspace]
{origin}
shape = "box"
min_mm = {low}
max_mm = {high}
floor_mm = {floor}
[[workspace.keep_out]]
name = "press"
centre_mm = {press}
size_mm = [900, 700, 800]
turn_deg = [10, 20, 30]
[[workspace.mounting]]
name = "ceiling"
centre_mm = {ceiling}
normal = [0, 0, -2]
extent_mm = [1500, 1500]
[[existing]]
name = "old"
kind = "projector"
position_mm = {old}
aim_mm = {aim}
[[existing]]
name = "posed"
kind = "camera"
pose_mm = [[1, 0, 0, {x}], [0, -1, 0, {y}], [0, 0, -1, {z}], [0, 0, 0, 1]]
[[obstacle]]
name = "clamp"
shape = "box"
centre_mm = {clamp}
size_mm = [20, 30, 40]
[[obstacle]]
name = "bench"
shape = "table"
size_mm = [900, 700, 30]
[[obstacle]]
name = "shelf"
shape = "table"
centre_mm = {shelf}
size_mm = [300, 300, 30]
"""
SMALL = (
    "[requirements]\ncoverage = 0.7\ndominant_coverage = 0.7\nmin_reachable = 0.1\n"
    "[placement]\nn_candidate_projectors = 600\nn_reference_projectors = 600\n"
    "n_candidate_cameras = 400\nn_reference_cameras = 400\n"
)
OFFSETS = {
    "low": (-2000, -1500, -500),
    "high": (2000, 2000, 1400),
    "press": (900, 0, 200),
    "ceiling": (0, 0, 1000),
    "old": (100, -200, 980),
    "aim": (0, 20, 10),
    "clamp": (60, 0, 20),
    "shelf": (0, 0, -150),
}


def plate():
    flat = plate_of((0.1, 0.1, 0.01), divisions=4)
    return TriangleMesh(flat.vertices + 1e-3 * CENTRE, flat.faces)


def text_of(origin, shift, floor=-300, **changes):
    places = {
        key: (np.array(offset) + shift).tolist()
        for key, offset in (OFFSETS | changes).items()
    }
    x, y, z = np.array([50, 0, 990]) + shift
    return 'base = "default"\n' + PLACED.format(
        origin=origin, floor=floor + shift[2], x=x, y=y, z=z, **places
    )


FROM_CENTRE = text_of("", np.zeros(3))
FROM_MESH = text_of('origin = "mesh"', CENTRE)


@pytest.fixture
def rig_of(tmp_path):
    def build(text):
        path = tmp_path / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return load_rig(path)

    return build


def required(rig):
    mesh = plate()
    asked = Wishes(max_projectors=3)
    return rig.requirements(mesh.centre, mesh.radius, asked, tau_m=0.003)


def test_zones_floor_devices_and_obstacles_are_the_same_places(rig_of):
    one, two = (rig_of(text) for text in (FROM_CENTRE, FROM_MESH))
    spaces = [required(rig).workspace for rig in (one, two)]
    assert spaces[1].origin == "mesh"
    for name in ("box", "press", "ceiling"):
        a, b = (
            {zone.name: zone for zone in (s.box, *s.keep_out, *s.mounting)}[name]
            for s in spaces
        )
        assert a.centre_m == pytest.approx(b.centre_m, abs=1e-12)
        assert replace(a, centre_m=b.centre_m) == b
    assert spaces[0].floor_m == pytest.approx(spaces[1].floor_m)
    assert spaces[0].floor_m == pytest.approx(-0.3)
    for a, b in zip(required(one).existing, required(two).existing, strict=True):
        assert np.allclose(a.world_from_device, b.world_from_device, atol=1e-9)
    solids = [r.obstacles(s, plate()) for r, s in zip((one, two), spaces, strict=True)]
    for a, b in zip(*solids, strict=True):
        assert a.name == b.name
        assert np.allclose(a.mesh.vertices, b.mesh.vertices, atol=1e-12)


def test_the_plan_says_where_places_count_from_only_if_asked(rig_of):
    one, two = (rig_of(text) for text in (FROM_CENTRE, FROM_MESH))
    assert "origin" not in one.to_document()["workspace"]
    assert two.to_document()["workspace"]["origin"] == "mesh"
    assert "origin" not in required(one).to_document()["workspace"]
    asked = required(two)
    assert requirements_of(asked.to_document()) == asked


def test_another_origin_is_refused(rig_of):
    with pytest.raises(RigError, match="'centre' or 'mesh'"):
        rig_of(text_of('origin = "file"', CENTRE))


def test_messages_speak_of_places_as_they_were_written(rig_of):
    far = text_of('origin = "mesh"', CENTRE, ceiling=(0, 0, 3000))
    with pytest.raises(InfeasibleLimitsError, match=r"at \[300, -200, 3500\] mm"):
        required(rig_of(far))
    high = text_of('origin = "mesh"', CENTRE, floor=2500)
    with pytest.raises(InfeasibleLimitsError, match=r"floor_mm = 3000 lies above"):
        required(rig_of(high))
    room = text_of('origin = "mesh"', CENTRE, low=(1500, -1, -1), high=(1600, 1, 1))
    with pytest.raises(InfeasibleLimitsError, match=r"min_mm = \[1800, -201, 499\]"):
        required(rig_of(room))


@pytest.fixture(scope="module")
def planned(tmp_path_factory, with_little_work):
    path = tmp_path_factory.mktemp("rig") / "mesh.toml"
    path.write_text(FROM_MESH + SMALL)
    try:
        with with_little_work():
            return plan_rig(
                plate(),
                load_rig(path),
                max_projectors=2,
                target="surface",
                cameras_by="cover",
                check=False,
            )
    except RequirementError as missed:
        return missed.plan


def test_the_audit_agrees_and_counts_by_itself(planned):
    assert audit_plan(planned, n_samples=3000).failures == ()
    document = planned.to_document()
    del document["rig"]["workspace"]["origin"]
    found = audit_plan(
        RigPlan.from_document(document, planned.surface), n_samples=500
    ).failures
    for words in (
        "origin: 'mesh', but rig.workspace states None",
        "floor_m: -0.3 m, but rig.workspace states 0.2",
        "'box' differs from rig.workspace's by",
        "'press' differs from rig.workspace's by",
        "mounting.0.centre_m: claimed",
        "stands 616 mm from where rig.existing has 'old'",
        "stands 616 mm from where rig.existing has 'posed'",
        "obstacle 'clamp': differs from the rig's by",
        "obstacle 'shelf': differs from the rig's by",
    ):
        assert any(words in sentence for sentence in found), (words, found)
    assert not any("'bench'" in sentence for sentence in found)
