"""Each false claim about rings turns the audit red, with the sentence that names it.

The claims are the planner's; the audit shares no code with it.
"""

import copy
import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from geometry.mesh.mesh import TriangleMesh
from planning.model.plan import RigPlan
from planning.report.claims import Devices
from planning.report.entries.ring_entries import lost_to_rings_m2
from planning.rings.ring_creases import find_creases
from planning.rings.ring_limits import ring_beam
from planning.rings.ring_shares import ring_shares
from planning.rings.ring_stage import RingStage, _report
from planning.scene.measured import lit_samples, measured_by
from planning.scene.scene import Scene
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_samples import draw_samples
from planning.verify.audit.estimates import Estimator
from planning.verify.audit.ledger import Ledger
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import AuditProjector
from planning.verify.audit.predicates.recompute import recompute
from planning.verify.audit.rings.chords import random_beam
from planning.verify.audit.rings.ring_claims import audit_rings
from planning.verify.audit.rings.ring_gaps import audit_gaps
from planning.verify.audit.rings.ring_light import RingLight, ring_spacing

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
    stage = RingStage(
        plan.projectors,
        tuple(p.ring_radii for p in even),
        tuple(
            {"spacing": "curvature", "kept_even": False}
            | _report(scene, ring_beam(scene, old, creases), new, creases)
            for old, new in zip(even, plan.projectors, strict=True)
        ),
    )
    devices = Devices(plan.projectors, plan.cameras, (), ())
    rows = lit_samples(scene, plan.projectors, scene.target_samples(4000, 1))
    claims = SimpleNamespace(
        target_samples=rows.target, measured_by=measured_by(scene, plan.cameras, rows)
    )
    document = plan.to_document()
    document["rig"]["rings"] = {"spacing": "curvature"}
    for p, projector in enumerate(plan.projectors):
        shares = ring_shares(scene, projector, plan.cameras)
        document["projectors"][p] |= {
            "rings": stage.reports[p],
            "ring_shares": shares.to_document(),
        }
    document["coverage"]["lost_to_rings_m2"] = lost_to_rings_m2(
        scene, devices, stage, claims
    )
    document["members"][0]["coverage"] = document["coverage"]
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
    samples = draw_samples(surface, "dominant", 4000, 0)
    shadow = Shadow(mesh, threads=1)
    areas = mesh.face_areas
    estimator = Estimator(
        samples, 4000, areas.sum(), areas[surface.target_faces("dominant")].sum()
    )
    return plan, recompute(plan, samples, shadow), shadow, estimator


def failures(drum, change=None, seed=0):
    plan, own, shadow, estimator = drum
    document = plan.to_document()
    if change is not None:
        change(document)
    ledger = Ledger(document)
    plan = RigPlan.from_document(document, plan.surface)
    audit_rings(plan, own, shadow, estimator, ledger, seed=seed)
    return ledger.failures


@pytest.mark.parametrize("seed", [0, 1])
def test_what_the_planner_says_of_rings_holds(drum, seed):
    assert failures(drum, seed=seed) == ()
    rings = [entry["rings"] for entry in drum[0].to_document()["projectors"]]
    assert all(r["creases"]["length_m"] > 0.01 for r in rings)
    assert all(r["error_p99_m"] > 1e-6 for r in rings)
    light = drum[0].projectors[0].light
    assert (drum[0].to_document()["coverage"]["lost_to_rings_m2"] > 0.0) is (
        light == "parallel"
    )


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


def _lost(document):
    document["coverage"]["lost_to_rings_m2"] += (
        0.05 * document["coverage"]["target"]["area_m2"]
    )


def _cut(document):
    document["projectors"][0]["rings"] = None


@pytest.mark.parametrize("place", [0, 1])
def test_a_gap_that_only_a_sliver_has_is_looked_for_before_it_is_called_false(
    drum, place
):
    plan, _, shadow, _ = drum
    light, claims = (
        RingLight(plan, shadow),
        plan.to_document()["projectors"][1]["rings"],
    )
    lamp, rng = light.lamps[1], np.random.default_rng(0)
    even = float(lamp.radii[-1]) * np.arange(1, claims["n_even"] + 1) / claims["n_even"]
    strikes = random_beam(light, lamp, 0.5 * even[0], rng).strikes
    gaps = ring_spacing(lamp, strikes.samples.points)
    extreme = claims["gap_m"][place]
    # As if no ray had met the part of the surface with the extreme gaps.
    apart = gaps < 0.85 * extreme if place == 1 else gaps > 1.2 * extreme
    missed = dataclasses.replace(strikes, lit=strikes.lit & apart)
    assert 0 < missed.lit.sum() < strikes.lit.sum()
    audited = []
    for factor in (1.0, 1.2 if place == 1 else 0.8):
        rings = copy.deepcopy(claims)
        rings["gap_m"][place] *= factor
        ledger = Ledger(plan.to_document())
        audit_gaps("P2.rings", rings, lamp, even, missed, ledger, light, rng)
        audited.append([f for f in ledger.failures if f"gap_m.{place}" in f])
    assert audited[0] == []
    assert "claimed" in audited[1][0]


# Each round is one document with several false claims, none in the way of another.
FALSE = [
    [
        (_share("drawn", lambda x: x - 0.08), "P1.ring_shares.drawn."),
        (_share("on_object", lambda x: x - 0.08), "P1.ring_shares.on_object."),
        (_share("on_target", lambda x: x + 0.08), "P1.ring_shares.on_target."),
        (_share("measured", lambda x: x + 0.08), "P1.ring_shares.measured."),
        (_rings("spacing", lambda x: "even"), "P2.rings.spacing: 'even' must"),
        (_rings("kept_even", lambda x: True), "P2.rings.kept_even: True is"),
        (_rings("gap_m", 0, lambda x: 0.8 * x), "P2.rings.gap_m.0: claimed"),
        (_rings("gap_m", 1, lambda x: 1.2 * x), "P2.rings.gap_m.1: claimed"),
        (_rings("error_p99_m", lambda x: 0.7 * x), "P2.rings.error_p99_m: claimed"),
        (_rings("error_p99_even_m", lambda x: 0.7 * x), "P2.rings.error_p99_even_m: "),
        (_rings("over_tolerance", lambda x: x + 0.1), "P2.rings.over_tolerance: cl"),
        (_rings("creases", "length_m", lambda x: 1.3 * x), "P2.rings.creases.length"),
        (
            _rings("creases", "max_slope_jump", lambda x: 1.2 * x),
            "P2.rings.creases.max_slope_jump: claimed",
        ),
        (
            _rings("creases", "max_error_m", lambda x: 0.8 * x),
            "P2.rings.creases.max_error_m: claimed",
        ),
        (_lost, "coverage.lost_to_rings_m2: claimed"),
    ],
    [
        (_share("measured", lambda x: 0.99), "exceeds on_object, of which it is a"),
        (
            lambda d: d["projectors"][0]["ring_shares"]["drawn"].pop(),
            "P1.ring_shares.drawn: must be a list of",
        ),
        (_rings("spacing", lambda x: "uniform"), "P2.rings.n_even: the "),
        (_rings("gap_m", 0, lambda x: 1.2 * x), "P2.rings.gap_m.0: claimed"),
        (_rings("gap_m", 1, lambda x: 0.6 * x), "P2.rings.gap_m.1: claimed"),
        (_rings("error_tolerance_m", lambda x: 2.0 * x), "error_tolerance_m: claimed"),
        (_rings("error_p99_m", lambda x: 2.0 * x), "P2.rings.error_p99_m: claimed"),
        (_rings("limits_cross", lambda x: 0.9), "limits_cross: 0.9 is claimed"),
        (
            _rings("creases", "max_slope_jump", lambda x: 0.8 * x),
            "P2.rings.creases.max_slope_jump: claimed",
        ),
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
        (_rings("gap_m", lambda x: None), "P2.rings.gap_m.0: None is claimed"),
        (_rings("n_even", lambda x: x * 2), "P2.rings.n_even: "),
        (_rings("creases", lambda x: None), "P2.rings.creases: is missing"),
    ],
    [(_rings("n_even", lambda x: 1), "n_even: 1 must be a number of rings")],
]


@pytest.mark.parametrize("number", range(len(FALSE)))
def test_false_claims_about_rings_are_named(drum, number):
    def change(document):
        for apply, _ in FALSE[number]:
            apply(document)

    found = failures(drum, change)
    for _, sentence in FALSE[number]:
        assert any(sentence in failure for failure in found), (sentence, found)


def test_a_run_that_was_cut_needs_no_report_on_rings(drum):
    def change(document):
        document["truncated"] = True
        _cut(document)

    assert not any("P1.rings" in failure for failure in failures(drum, change))


@pytest.mark.parametrize("light", LIGHTS)
def test_the_audit_of_a_plan_looks_at_its_rings(handmade, light):
    plan = with_claims(handmade.build_plan(light), light)
    assert audit_plan(plan, n_samples=6000).failures == ()
    false = handmade.tampered(plan, _rings("error_p99_m", lambda x: 0.7 * x))
    (found,) = audit_plan(false, n_samples=6000).failures
    assert found.startswith("P2.rings.error_p99_m: claimed")
    plain = handmade.build_plan(light)
    assert not any("rings" in f for f in audit_plan(plain, n_samples=3000).failures)


@pytest.mark.parametrize(("light", "expected"), [("diverging", 0.2), ("parallel", 0.1)])
def test_rings_stand_apart_along_their_normal(handmade, light, expected):
    """Cones of tangents 0.9 and 1 at R = 1, z = 2 sqrt 2: 0.1 z / sqrt(1 + R^2)."""
    device = handmade.build_plan(light).projectors[0].device
    lamp = AuditProjector(device, np.eye(4), np.eye(4), np.array([0.9, 1.0]))
    z = 2.0 * np.sqrt(2.0)
    point = [[z, 0.0, z] if light == "diverging" else [0.6, 0.8, z]]
    assert ring_spacing(lamp, np.array(point)) == pytest.approx(expected)
