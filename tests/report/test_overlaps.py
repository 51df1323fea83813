"""Light of two projectors on one surface: areas of closed form, and who fires when."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_requirements, make_scene
from support.plain_shapes import box, grid, joined

from geometry.devices import ParallelModel
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.model.plan import RigPlan
from planning.report.entries.overlaps import overlap_records, shared_areas
from planning.report.summary.coverage_lines import schedule_lines
from planning.rig.rig import load_rig
from planning.scene.draws import Draw
from planning.scene.lights import ring_frame
from planning.scene.workspace.candidates import aimed_poses
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.counts.overlap_claims import (
    audit_overlaps,
    audit_schedule,
    light_falls,
)
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.occlusion import Shadow

# A panel of 0.4 m a side.
WIDE = ParallelModel((2000, 2000), 2e-4, (0.8, 1.2))


def scene_of(mesh, light="parallel"):
    rig = load_rig("default", light=light)
    required = make_requirements(mesh, rig, max_projectors=9)
    return make_scene(mesh, required)


def beams(*positions, device=WIDE, aims=None, light="parallel"):
    """Projectors at positions, aimed at the origin, their rings about the axis."""
    made = []
    for k, at in enumerate(positions):
        aim = np.zeros(3) if aims is None else np.array(aims[k], dtype=float)
        up = np.array([0.0, 1.0, 0.0]) if abs(at[1]) < 0.5 else np.array([0, 0, 1.0])
        pose = aimed_poses(np.array([at], dtype=float), aim, up, device)[0]
        radii = np.array([0.1, 0.3])
        ring = ring_frame(pose, device, 0.0, 0.0)
        made.append(PlannedProjector(f"P{k + 1}", light, pose, ring, device, radii))
    return made


def groups(scene, projectors):
    return overlaps_of(scene, projectors)["firing_schedule"]["groups"]


def overlaps_of(scene, projectors):
    """As the plan's JSON says it."""
    overlaps, schedule = overlap_records(scene, projectors)
    return {
        "overlaps": [overlap.to_document() for overlap in overlaps],
        "firing_schedule": schedule.to_document(),
    }


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_plates_back_to_back_are_lit_together(light):
    front = grid(0.1, 0.1, divisions=(4, 4))
    back = TriangleMesh(front.vertices - [0, 0, 0.01], front.faces[:, ::-1])
    device = load_rig("default", light=light).projector_device()
    scene = scene_of(joined(front, back), light)
    projectors = beams((0.1, 0, 1), (0.1, 0, -1), device=device, light=light)
    found = overlaps_of(scene, projectors)
    (pair,) = found["overlaps"]
    assert (pair["target_m2"], pair["surface_m2"]) == (0.0, 0.0)
    schedule = found["firing_schedule"]
    assert schedule["groups"] == [["P1", "P2"]]
    assert (schedule["n_groups"], schedule["proof"]) == (1, "clique")
    # Each does put light on its own side.
    areas = shared_areas(scene, projectors, scene.surface_samples(Draw(2000, 0)))
    assert np.diag(areas) == pytest.approx([0.01, 0.01], rel=0.03)


def test_opposite_sides_of_a_ball_share_nothing_and_three_around_it_a_lune_each():
    """Light from two directions 120 degrees apart: lunes of 60 degrees, a sixth."""
    scene = scene_of(sphere(0.1, subdivisions=4))
    assert groups(scene, beams((1, 0, 0), (-1, 0, 0))) == [["P1", "P2"]]
    around = [(np.cos(a), 0.0, np.sin(a)) for a in np.radians([0, 120, 240])]
    found = overlaps_of(scene, beams(*around))
    assert found["firing_schedule"]["groups"] == [["P1"], ["P2"], ["P3"]]
    assert found["firing_schedule"]["clique"] == ["P1", "P2", "P3"]
    for pair in found["overlaps"]:
        for part in ("target_m2", "surface_m2"):
            share = pair[part] / scene.mesh.area
            # Light over 89 degrees is left out: 2 degrees of the lune's 60.
            assert share == pytest.approx(58 / 360, abs=0.008)


def test_three_on_one_plate_fire_one_after_the_other_however_poor_their_light():
    """At 80 degrees, or out of range, nothing is lit, and codes are spoilt."""
    scene = scene_of(grid(0.1, 0.1, divisions=(4, 4)))
    grazing = (np.sin(np.radians(80)), 0.0, np.cos(np.radians(80)))
    projectors = beams((0, 0, 1), grazing, (0, 0, 3))
    found = overlaps_of(scene, projectors)
    assert found["firing_schedule"]["n_groups"] == 3
    for pair in found["overlaps"]:
        assert pair["target_m2"] == pytest.approx(0.01, rel=1e-9)
    # Even steep sides: the light runs along them.
    steep = replace(scene, steep=np.tile([1.0, 0.0, 0.0], (len(scene.mesh.faces), 1)))
    assert overlaps_of(steep, projectors)["overlaps"] == found["overlaps"]


def test_narrow_beams_share_a_lens_and_the_outer_two_of_three_fire_together():
    """Circles of radius r, d apart: 2 r^2 acos(d / 2r) - d / 2 sqrt(4 r^2 - d^2)."""
    scene = scene_of(grid(0.16, 0.16, divisions=(4, 4)))
    r, d = 0.03, 0.04
    at = [(k * d, 0.0, 1.0) for k in (-1, 0, 1)]
    aims = [(k * d, 0.0, 0.0) for k in (-1, 0, 1)]
    found = overlaps_of(
        scene, beams(*at, aims=aims, device=replace(WIDE, beam_radius=r))
    )
    lens = 2 * r**2 * np.arccos(d / (2 * r)) - d / 2 * np.sqrt(4 * r**2 - d**2)
    areas = {tuple(p["projectors"]): p["surface_m2"] for p in found["overlaps"]}
    assert areas["P1", "P2"] == pytest.approx(lens, rel=0.1)
    assert areas["P2", "P3"] == pytest.approx(lens, rel=0.1)
    assert areas["P1", "P3"] == 0.0
    assert found["firing_schedule"]["groups"] == [["P1", "P3"], ["P2"]]
    assert found["firing_schedule"]["clique"] == ["P2", "P3"]


def test_what_is_drawn_beyond_the_last_ring_spoils_codes_too():
    """Last rings of 20 mm, a gap of 10: light falls within 30 mm; axes are 50 apart."""
    scene = scene_of(grid(0.16, 0.16, divisions=(4, 4)))
    r, d = 0.03, 0.05
    at = [(k * d, 0.0, 1.0) for k in (0, 1)]
    aims = [(k * d, 0.0, 0.0) for k in (0, 1)]
    rings = np.array([0.01, 0.02])
    pair = [replace(p, ring_radii=rings) for p in beams(*at, aims=aims)]
    (entry,) = overlaps_of(scene, pair)["overlaps"]
    lens = 2 * r**2 * np.arccos(d / (2 * r)) - d / 2 * np.sqrt(4 * r**2 - d**2)
    assert entry["surface_m2"] == pytest.approx(lens, rel=0.15)
    # The audit's own predicate says the same.
    own = scene.surface_samples(Draw(20_000, 2)).samples
    n = len(own.points)
    steep, ones = np.zeros((n, 3)), np.ones(n)
    samples = AuditSamples(
        own.points, own.normals, own.faces, steep, ones.astype(int), ones > 0, ones
    )
    lamps = [
        AuditProjector(p.device, p.world_from_device, p.world_from_ring, p.ring_radii)
        for p in pair
    ]
    shadow = Shadow(scene.mesh, threads=2)
    both = [light_falls(lamp, samples, shadow) for lamp in lamps]
    found = scene.mesh.area * float(np.all(both, axis=0).mean())
    assert found == pytest.approx(lens, rel=0.15)


def test_shadow_is_no_light():
    """From above, a box hides as much of the plate as its top catches."""
    lifted = box((0.05, 0.04, 0.03))
    lifted = TriangleMesh(lifted.vertices + [0, 0, 0.05], lifted.faces)
    plate = grid(0.2, 0.2, divisions=(3, 3))
    scene = scene_of(joined(plate, lifted))
    (above,) = beams((0, 0, 1))
    samples = scene.surface_samples(Draw(12_000, 0))
    assert shared_areas(scene, [above], samples)[0, 0] == pytest.approx(0.04, rel=0.01)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(request, handmade) -> RigPlan:
    return handmade.build_plan(request.param)


@pytest.fixture(scope="module")
def failures(plan):
    """What the audit of these two claims says of a document."""
    case = examine(plan, seed=0, n_samples=20_000, threads=2)

    def failures_of(document):
        findings = AuditFindings()
        changed = RigPlan.from_document(document, plan.surface)
        audit_overlaps(replace(case, plan=changed), findings)
        audit_schedule(replace(case, plan=changed), findings)
        return findings.failures

    return failures_of


def test_the_whole_audit_looks_at_both_claims(plan):
    document = plan.to_document()
    _area(document)
    document["firing_schedule"]["n_groups"] = 3
    found = audit_plan(RigPlan.from_document(document, plan.surface)).failures
    keys = [failure.split(":")[0] for failure in found]
    assert keys == ["overlaps.P1 + P2.target_m2", "firing_schedule.n_groups"]


def _area(document):
    document["overlaps"][0]["target_m2"] *= 0.8


def _surface_area(document):
    document["overlaps"][0]["surface_m2"] *= 1.25


def _together(document):
    document["firing_schedule"] |= {"groups": [["P1", "P2"]], "n_groups": 1}
    document["firing_schedule"] |= {"lower_bound": 1, "clique": ["P1"]}


def _together_and_nothing_shared(document):
    _together(document)
    document["overlaps"][0] |= {"target_m2": 0.0, "surface_m2": 0.0}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (_area, "overlaps.P1 + P2.target_m2: claimed"),
        (_surface_area, "overlaps.P1 + P2.surface_m2: claimed"),
        (_together, "by the plan's own overlaps they light a surface in common"),
        (_together_and_nothing_shared, "fire together, but light of both falls on"),
        (lambda d: d.pop("overlaps"), "must name each of the 1 pairs of P1, P2"),
        (
            lambda d: d["overlaps"].append(d["overlaps"][0]),
            "must name each of the 1 pairs",
        ),
        (lambda d: d.pop("firing_schedule"), "firing_schedule: is missing"),
        (
            lambda d: d["firing_schedule"].update(groups=[["P1"], []]),
            "must name each of P1, P2 exactly once",
        ),
        (
            lambda d: d["firing_schedule"].update(n_groups=3),
            "n_groups: claimed 3, but the number of groups is 2",
        ),
        (
            lambda d: d["firing_schedule"].update(clique=["P1"]),
            "proof: 'clique' doesn't prove that 2 groups are needed",
        ),
        (
            lambda d: d["firing_schedule"].update(clique=["P1", "P7"]),
            "must be projectors that overlap pairwise",
        ),
        (
            lambda d: d["firing_schedule"].update(lower_bound=3),
            "lower_bound: 3 for 2 groups",
        ),
    ],
)
def test_each_false_claim_alone_turns_the_audit_red(plan, failures, change, sentence):
    document = plan.to_document()
    assert failures(document) == ()
    change(document)
    found = failures(document)
    assert any(sentence in failure for failure in found), found
    assert len(found) <= 3


def test_exhaustion_is_tried_again_by_the_audit(plan, failures):
    """One group is enough for two that share nothing, whatever was tried."""
    document = plan.to_document()
    document["firing_schedule"] |= {"proof": "exhaustion"}
    assert failures(document) == ()
    document["overlaps"][0] |= {"target_m2": 0.0, "surface_m2": 0.0}
    found = failures(document)
    assert any("'exhaustion' doesn't prove that 2" in failure for failure in found)


def test_the_line_says_who_fires_when_and_why_not_in_fewer(plan):
    (line,) = schedule_lines(plan.document)
    assert line.startswith("FIRING   P1, then P2: 2 groups, fewer won't do: any two of")
    share = plan.to_document()["overlaps"][0]["target_m2"]
    share /= plan.to_document()["coverage"]["target"]["area_m2"]
    assert f"most shared: P1 and P2, {100 * share:.1f} % of the target" in line
    document = plan.to_document()
    document["firing_schedule"] |= {"groups": [["P1", "P2"]], "n_groups": 1}
    alone = RigPlan.from_document(document, plan.surface).document
    assert "all projectors together" in schedule_lines(alone)[0]
    assert schedule_lines(alone.changed(overlaps=())) == []
