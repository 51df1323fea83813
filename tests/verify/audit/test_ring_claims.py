"""Each false claim about rings turns the audit red, with the sentence that names it.

The claims are the planner's; the audit shares no code with it.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from geometry.mesh.mesh import TriangleMesh
from planning.model.plan import RigPlan
from planning.rings.ring_creases import find_creases
from planning.rings.ring_limits import ring_beam
from planning.rings.ring_shares import ring_shares
from planning.rings.ring_stage import rings_record
from planning.scene.scene import Scene
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.rings.axis_claims import audit_centred, audit_ring_axes
from planning.verify.audit.rings.ring_claims import audit_rings

LIGHTS = ["diverging", "parallel"]
# So many that none stands closer than the plan's where anything is lit.
N_EVEN = {"diverging": 45, "parallel": 13}


def with_claims(plan: RigPlan, light: str) -> RigPlan:
    """Return a plan with what the planner says of its rings."""
    surface = plan.surface
    scene = Scene(
        surface.mesh,
        surface.region,
        surface.steep,
        plan.requirements,
        seed=0,
        threads=1,
    )
    n = N_EVEN[light]
    even = [
        dataclasses.replace(p, ring_radii=p.ring_radii[-1] * np.arange(1, n + 1) / n)
        for p in plan.projectors
    ]
    creases = find_creases(surface.mesh, 0.5 * surface.mesh.mean_edge)
    document = plan.to_document()
    document["rig"]["rings"] = {"spacing": "curvature"}
    for entry, old, new in zip(
        document["projectors"], even, plan.projectors, strict=True
    ):
        beam = ring_beam(scene, old, creases)
        record = rings_record(scene, beam, new, creases, kept_even=False)
        entry["rings"] = record.to_document()
        shares = ring_shares(scene, new, plan.cameras)
        entry["ring_shares"] = shares.to_document()
    return RigPlan.from_document(document, surface)


@pytest.fixture(scope="module", params=LIGHTS)
def drum(request, handmade):
    """Plan on a drum that turns one of its ends to the light, rims and all."""
    turned = trimesh.transformations.rotation_matrix(-0.6, [1.0, 0.0, 0.0])
    made = trimesh.creation.cylinder(0.035, 0.05, sections=48, transform=turned)
    made = made.subdivide()
    mesh = TriangleMesh(np.array(made.vertices), np.array(made.faces))
    plan = handmade.build_plan(request.param)
    surface = dataclasses.replace(
        plan.surface,
        mesh=mesh,
        region=np.where(mesh.face_centroids[:, 0] < 0.02, 0, -1),
        steep=np.zeros((len(mesh.faces), 3)),
        member=np.zeros(len(mesh.faces), dtype=np.int64),
    )
    plan = with_claims(
        RigPlan.from_document(plan.to_document(), surface), request.param
    )
    return examine(plan, seed=0, n_samples=1000, threads=1)


def failures(drum, change=None, audited=audit_rings):
    document = drum.plan.to_document()
    if change is not None:
        change(document)
    findings = AuditFindings()
    plan = RigPlan.from_document(document, drum.plan.surface)
    audited(dataclasses.replace(drum, plan=plan), findings)
    return findings.failures


def test_what_the_planner_says_of_rings_holds(drum):
    assert failures(drum) == ()
    rings = [record.rings for record in drum.plan.document.projectors]
    assert all(r.creases.length_m > 0.01 for r in rings)
    assert any(0.0 < r.over_tolerance < 1.0 for r in rings)


def _rings(*path_and_change):
    *path, last, change = path_and_change

    def apply(document):
        table = document["projectors"][1]["rings"]
        for step in path:
            table = table[step]
        table[last] = change(table[last])

    return apply


def _share(name, change):
    def apply(document):
        shares = document["projectors"][0]["ring_shares"]
        ring = int(np.argmax(np.array(shares[name]) * (np.array(shares[name]) < 0.9)))
        shares[name][ring] = change(shares[name][ring])

    return apply


def _cut(document):
    document["projectors"][0]["rings"] = None


# Each round is one document with several false claims, none in the way of another.
FALSE = [
    [
        (_share("on_object", lambda x: x - 0.08), "P1.ring_shares.on_object: claimed"),
        (_share("on_target", lambda x: x + 0.08), "P1.ring_shares.on_target: claimed"),
        (_share("measured", lambda x: x + 0.08), "P1.ring_shares.measured: claimed"),
        (_rings("kept_even", lambda x: True), "P2.rings.kept_even: True is"),
        (_rings("gap_m", 0, lambda x: 0.8 * x), "P2.rings.gap_m.0: claimed"),
        (_rings("gap_m", 1, lambda x: 1.2 * x), "P2.rings.gap_m.1: claimed"),
        (_rings("over_tolerance", lambda x: x + 0.1), "P2.rings.over_tolerance: cl"),
        (_rings("creases", "length_m", lambda x: 1.3 * x), "P2.rings.creases.length"),
        (
            _rings("creases", "max_error_m", lambda x: 0.8 * x),
            "P2.rings.creases.max_error_m: claimed",
        ),
    ],
    [
        (
            lambda d: d["projectors"][0]["ring_shares"]["on_object"].pop(),
            "P1.ring_shares.on_object: claimed",
        ),
        (_rings("spacing", lambda x: "uniform"), "P2.rings.n_even: the "),
        (_rings("gap_m", 0, lambda x: 1.2 * x), "P2.rings.gap_m.0: claimed"),
        (_rings("gap_m", 1, lambda x: 0.6 * x), "P2.rings.gap_m.1: claimed"),
        (
            _rings("creases", "max_error_m", lambda x: 1.2 * x),
            "P2.rings.creases.max_error_m: claimed",
        ),
        (
            lambda d: d["rig"]["rings"].update(spacing="uniform"),
            "'curvature' is claimed, but rig.rings.spacing is 'uniform'",
        ),
    ],
    [
        (lambda d: d["projectors"][0].pop("ring_shares"), "P1.ring_shares: is missing"),
        (_cut, "P1.rings: is missing"),
        (_rings("gap_m", lambda x: None), "P2.rings.gap_m: is missing"),
        (_rings("n_even", lambda x: x * 2), "P2.rings.n_even: "),
    ],
    [(_rings("n_even", lambda x: 1), "n_even: 1 must be at least 2 rings")],
]


@pytest.mark.parametrize("number", range(len(FALSE)))
def test_false_claims_about_rings_are_named(drum, number):
    def change(document):
        for apply, _ in FALSE[number]:
            apply(document)

    found = failures(drum, change)
    for _, sentence in FALSE[number]:
        assert any(sentence in failure for failure in found), (sentence, found)


def test_rings_left_out_and_shown_are_held_against_rays(drum):
    def told(left_out, margin, more=()):
        def change(document):
            document["rig"]["rings"]["margin_m"] = margin
            document["projectors"][1]["rings"]["left_out"] = left_out
            document["projectors"][1]["ring_radii"] += more

        return " ".join(failures(drum, change))

    shares = drum.plan.document.projectors[1].ring_shares
    radii = drum.plan.projectors[1].ring_radii
    middle = radii[len(radii) // 2]
    assert shares.on_object[len(radii) // 2] > 0.0
    words = "1 rings light the object and are left out"
    assert words in told([middle * 1.001], 0.1 * middle)
    beyond, words = [2.0, 2.5, 3.0], "light nothing of the object and are shown"
    assert words in told([], 0.0, beyond)
    assert words not in told([], 9.0, beyond)


def test_false_claims_about_ring_axes_are_named(drum):
    plan = drum.plan
    ids = [projector.id for projector in plan.projectors]
    same = [
        {"id": p.id}
        | {k: getattr(p, k).tolist() for k in ("world_from_ring",)}
        | {"ring_radii": p.ring_radii.tolist()}
        for p in plan.projectors
    ]
    area = drum.estimator.area(drum.actual.measured & drum.samples.in_target)
    other = {"axis": "centred", "projectors": same, "measured_m2": area}

    def told(**axes):
        table = {"asked": "auto", "taken": "free", "other": other} | axes
        return failures(drum, lambda d: d.update(ring_axes=table), audit_ring_axes)

    assert told() == ()
    assert "'free' is claimed where 'centred' was" in told(asked="centred")[0]
    assert "is claimed to be centred" in told(taken="centred")[0]
    (found,) = told(other=other | {"measured_m2": 0.5 * area})
    assert found.startswith("ring_axes.other.measured_m2: claimed")
    (found,) = told(other=other | {"projectors": same[::-1]})
    assert str(ids[::-1]) in found


def lit_at(coordinates):
    """Return a case whose one projector lights points so far from its axis."""
    light = SimpleNamespace(narrowest_ring=lambda points: 1.0)
    record = SimpleNamespace(id="P1", rings=None)
    return SimpleNamespace(
        plan=SimpleNamespace(document=SimpleNamespace(projectors=[record])),
        projectors=[
            SimpleNamespace(light=light, ring_coordinate=lambda points: points[:, 0])
        ],
        samples=SimpleNamespace(points=np.outer(coordinates, [1.0, 0.0, 0.0])),
        actual=SimpleNamespace(lit_by=np.ones((1, len(coordinates)), dtype=bool)),
    )


@pytest.mark.parametrize(
    ("n_lit", "n_far", "n_false"), [(500, 10, 0), (500, 11, 1), (9, 9, 0)]
)
def test_few_samples_far_out_dont_make_an_axis_stand_aside(n_lit, n_far, n_false):
    """Another draw may have missed them; of so few no ring is told at all."""
    case = lit_at(np.where(np.arange(n_lit) < n_far, 1.2, 0.9))
    findings = AuditFindings()
    audit_centred(((case,),), findings)
    assert len(findings.failures) == n_false


def test_an_axis_is_in_the_middle_of_one_group_of_members():
    """Members left out may have been so before axes were chosen, or since."""
    near, far = lit_at(np.full(500, 0.9)), lit_at(np.full(500, 1.2))
    for groups, n_false in (
        (((near,), (near, far)), 0),
        (((far,), (near, far)), 1),
        (((near, far), (near,)), 0),
    ):
        findings = AuditFindings()
        audit_centred(groups, findings)
        assert len(findings.failures) == n_false


def test_a_run_that_was_cut_needs_no_report_on_rings(drum):
    def change(document):
        document["truncated"] = True
        _cut(document)

    assert not any("P1.rings" in failure for failure in failures(drum, change))


@pytest.mark.parametrize("light", LIGHTS)
def test_the_audit_of_a_plan_looks_at_its_rings(handmade, light):
    plan = with_claims(handmade.build_plan(light), light)
    assert audit_plan(plan, n_samples=6000).failures == ()
    false = handmade.tampered(plan, _rings("over_tolerance", lambda x: x + 0.1))
    (found,) = audit_plan(false, n_samples=6000).failures
    assert found.startswith("P2.rings.over_tolerance: claimed")
    plain = handmade.build_plan(light)
    assert not any("rings" in f for f in audit_plan(plain, n_samples=3000).failures)


@pytest.mark.parametrize(("light", "expected"), [("diverging", 0.2), ("parallel", 0.1)])
def test_rings_stand_apart_along_their_normal(handmade, light, expected):
    """Cones of tangents 0.9 and 1 at R = 1, z = 2 sqrt 2: 0.1 z / sqrt(1 + R^2)."""
    device = handmade.build_plan(light).projectors[0].device
    projector = AuditProjector(device, np.eye(4), np.eye(4), np.array([0.9, 1.0]))
    z = 2.0 * np.sqrt(2.0)
    point = [[z, 0.0, z] if light == "diverging" else [0.6, 0.8, z]]
    assert projector.ring_spacing(np.array(point)) == pytest.approx(expected)
