"""Each false claim alone turns the audit red, with the sentence that names it."""

import copy
import dataclasses
import json
import math
from functools import partial

import numpy as np
import pytest

from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.verify.audit.audit import audit_plan
from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.overlap_claims import audit_partition

# Parts of a plan that nothing is recomputed from: they are what is held against it.
CLAIMS = (
    "baselines",
    "camera_groups",
    "certificates",
    "cost",
    "firing_schedule",
    "marginal",
    "members",
    "meshes",
    "overlaps",
    "regions",
)


@pytest.fixture(scope="module")
def _cases() -> dict[str, AuditCase]:
    return {}


@pytest.fixture
def _recomputed_once(monkeypatch, _cases):
    """Lies about claims alone share what is recomputed."""

    def examined(plan: RigPlan, **options) -> AuditCase:
        rest = {k: v for k, v in plan.to_document().items() if k not in CLAIMS}
        key = json.dumps([id(plan.surface), rest, options], sort_keys=True)
        if key not in _cases:
            _cases[key] = examine(plan, **options)
        return dataclasses.replace(_cases[key], plan=plan)

    monkeypatch.setattr("planning.verify.audit.audit.examine", examined)


def failures(plan: RigPlan, **options) -> tuple[str, ...]:
    return audit_plan(plan, **options).failures


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(request, handmade) -> RigPlan:
    return handmade.build_plan(request.param)


@pytest.mark.parametrize(
    ("light", "target"),
    [("diverging", "dominant"), ("diverging", "surface"), ("parallel", "dominant")],
)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_true_claims_pass(handmade, light, target, seed):
    audit = audit_plan(handmade.build_plan(light, target), seed=seed)
    assert audit.failures == ()
    assert not audit.failures


def test_the_result_depends_on_the_seed_alone(plan):
    one, two, other = (
        audit_plan(plan, seed=s, n_samples=3000, threads=t)
        for s, t in ((5, 1), (5, 2), (6, 2))
    )
    assert one.areas == two.areas != other.areas
    assert np.array_equal(one.case.actual.measured, two.case.actual.measured)


def test_prediction_and_areas_speak_of_the_same_samples(plan):
    audit = audit_plan(plan, n_samples=3000)
    inside = audit.case.samples.in_target
    samples, predicted = audit.case.samples.take(inside), audit.case.actual.measured
    predicted = predicted[inside]
    measured = audit.areas["target"]["measured_m2"]
    assert samples.weights[predicted].sum() == pytest.approx(measured)
    assert np.ptp(samples.weights) == 0.0
    lit = audit.case.actual.lit[inside]
    assert not np.any(predicted & ~lit)


@pytest.mark.parametrize("points", [4.5, -4.5])
def test_an_area_off_by_more_than_sampling_explains_is_found_in_both_directions(
    plan, handmade, points
):
    """Each claim has a recomputed figure of its own, so all may be false at once."""
    names = (
        "reachable_by_projectors_m2",
        "lit_m2",
        "reachable_by_cameras_m2",
        "measured_m2",
    )

    def change(document):
        for part in ("surface", "target"):
            areas = document["coverage"][part]
            for name in names:
                areas[name] += 0.01 * points * areas["area_m2"]

    found = failures(handmade.tampered(plan, change))
    for key in (f"{part}.{name}" for part in ("surface", "target") for name in names):
        start = f"coverage.{key}: claimed"
        assert any(sentence.startswith(start) for sentence in found), key


def _entry(kind, index, name, value):
    def change(document):
        document[kind][index][name] = value(document[kind][index].get(name))

    return change


LEAVES_OUT = {
    "spacing": "uniform",
    "kept_even": False,
    "n_even": 70,
    "gap_m": None,
    "over_tolerance": 0.0,
    "creases": {"length_m": 0.0, "max_error_m": 0.0},
    "left_out": np.linspace(0.15, 0.2, 40).tolist(),
}


def _at(*path):
    *parents, last, value = path

    def change(document):
        table = document
        for step in parents:
            table = table[step]
        table[last] = value(table[last]) if callable(value) else value

    return change


def _all(*changes):
    def change(document):
        for each in changes:
            each(document)

    return change


def _shift(pose, axis, by):
    pose = copy.deepcopy(pose)
    pose[axis][3] += by
    return pose


def _farther(pose):
    pose = np.array(pose)
    pose[:3, 3] *= 1.4
    return pose.tolist()


def _swapped(split):
    """The same areas under another cause."""
    return {"sigma": sum(split.values())}


def _anywhere(least, **values):
    """A proof over all poses, of the certificate's samples unless they are changed."""

    def proof(_, most=None):
        return {
            "lower_bound": least,
            "status": "proved",
            "proof": "exhausted",
            "occlusion": True,
            "n_samples": 5120,
            "n_reached": 5120,
            "n_cells": 10,
            "one_fewer_upper_bound_m2": most,
        } | values

    return proof


def _of_all_poses(**values):
    return _at("certificates", "projectors", "continuous", _anywhere(1, **values))


CHECKED = dict.fromkeys(
    ("n_points", "n_merged", "redundant_fraction", "predicted_missing"), 0
) | {
    "accuracy_rms_m": None,
    "accuracy_p95_m": None,
    "accuracy_bias_m": None,
    "completeness": [],
    "pixel_noise": None,
    "ambient": None,
    "passed": True,
    "failures": [],
}
FALSE = {
    "area_m2": (_at("coverage", "target", "area_m2", lambda x: x * 1.001), "area_m2: "),
    "order": (
        _at("coverage", "target", "reachable_by_cameras_m2", lambda x: x * 2),
        "must lie between 0 and lit_m2",
    ),
    "samples": (_at("coverage", "samples", 0), "coverage.samples: 0 must"),
    "cause": (
        _at("coverage", "uncovered_by_cause", "projector_incidence", lambda x: x * 1.7),
        "uncovered_by_cause.projector_incidence: claimed",
    ),
    "cause sum": (
        _at(
            "coverage", "uncovered_by_cause", "projector_incidence", lambda x: x * 1.02
        ),
        "uncovered_by_cause (sum): claimed",
    ),
    "unknown cause": (
        _at("coverage", "uncovered_by_cause", lambda x: x | {"gremlins": 0.0}),
        "causes that there are not: gremlins",
    ),
    "unreachable": (
        _at("coverage", "unreachable_by_cause", lambda x: x | {"tangent_angle": 1e-3}),
        "unreachable_by_cause.tangent_angle: claimed",
    ),
    "unmeasurable": (
        _at("coverage", "unmeasurable_by_cause", _swapped),
        "unmeasurable_by_cause.sigma: claimed",
    ),
    "unmeasurable sum": (
        _at("coverage", "unmeasurable_by_cause", {}),
        "unmeasurable_by_cause (sum): claimed",
    ),
    "lit area": (
        _entry("projectors", 0, "lit_area_m2", lambda x: x * 1.2),
        "P1.lit_area",
    ),
    "seen area": (
        _entry("cameras", 1, "seen_area_m2", lambda x: x * 1.3),
        "C2.seen_area",
    ),
    "sole area": (
        _entry("cameras", 0, "sole_area_m2", lambda x: x * 1.5),
        "C1.sole_area",
    ),
    "margin high": (
        _entry("projectors", 0, "min_margin_rad", lambda x: x + 0.1),
        "P1.min_margin_rad: claimed",
    ),
    "margin low": (
        _entry("projectors", 0, "min_margin_rad", lambda x: x - 0.1),
        "a lit sample's is 0 or more",
    ),
    "lit_by": (_entry("regions", 0, "lit_by", lambda x: ["P1"]), "P2 isn't named"),
    "lit_by unknown": (
        _entry("regions", 0, "lit_by", lambda x: ["P9"]),
        "must list ids",
    ),
    "lit_fraction": (
        _entry("regions", 1, "lit_fraction", lambda x: x - 0.12),
        "regions.1.lit_fraction",
    ),
    "region area": (
        _entry("regions", 1, "area_m2", lambda x: x * 1.01),
        "regions.1.area_m2",
    ),
    "region faces": (
        _entry("regions", 1, "n_faces", lambda x: x + 1),
        "regions.1.n_faces",
    ),
    "region ids": (_entry("regions", 1, "id", lambda x: 7), "regions: ids [0, 7]"),
    "ring frame": (
        _entry("projectors", 1, "world_from_ring", lambda x: _shift(x, 2, 1e-3)),
        "P2.world_from_ring: ring frames leave the optical centre",
    ),
    "rig camera": (_at("rig", "camera", "K", 0, 0, 15000.0), "C1.K: claimed"),
    "rig distortion": (_at("rig", "camera", "distortion", 0, 0.0), "C2.distortion: "),
    "rig range": (_at("rig", "projector", "range_m", 1, 2.0), "P1.range_m: claimed"),
    "rig resolution": (_at("rig", "projector", "resolution", 0, 7), "P1.resolution: "),
    "outside": (
        _entry("cameras", 0, "world_from_device", _farther),
        "mm outside requirements.workspace",
    ),
    "floor": (_at("requirements", "workspace", "floor_m", 0.2), "mm outside requ"),
    "cone": (
        _at("requirements", "workspace", "half_angle", 0.4),
        "surface.npz reference_projectors: ",
    ),
    "centre": (
        _at("requirements", "workspace", "centre", 0, 0.01),
        "workspace.centre: ",
    ),
    "size": (
        _at("requirements", "workspace", "object_radius_m", 0.06),
        "object_radius_m: ",
    ),
    "references": (
        _at("requirements", "workspace", "n_reference_cameras", 400),
        "400 reference poses are claimed, surface.npz holds 4",
    ),
    "too many": (_at("requirements", "max_projectors", 1), "max_projectors allows 1"),
    "same id": (_entry("cameras", 1, "id", lambda x: "C1"), "cameras: ids repeat"),
    "count": (_at("certificates", "cameras", "count", 1), "cameras.count: claimed 1"),
    "bound": (
        _at("certificates", "projectors", "candidates", "lower_bound", 3),
        "lower_bound: 3 exceeds the count of 2",
    ),
    "continuous": (
        _at("certificates", "cameras", "continuous", _anywhere(4)),
        "cameras.continuous.lower_bound: 4 exceeds",
    ),
    "continuous beyond candidates": (
        _at("certificates", "projectors", "continuous", _anywhere(2)),
        "2 is claimed over all poses, but only 1 over the candidates",
    ),
    "continuous of cameras beyond candidates": (
        _at("certificates", "cameras", "continuous", _anywhere(2)),
        "cameras.continuous.lower_bound: 2 is claimed over all poses, but only 1 over",
    ),
    "continuous area": (
        _at(
            "certificates",
            "cameras",
            lambda claims: (
                claims
                | {
                    "continuous": _anywhere(1)(None, 0.001)
                    | {"n_samples": claims["n_samples"]},
                    "by_count": [
                        {"count": 1, "value_m2": 0.002, "upper_bound_m2": 0.003},
                        {"count": 2, "value_m2": 0.004, "upper_bound_m2": 0.005},
                    ],
                }
            ),
        ),
        "10.00 cm² is claimed over all poses, but 1 of the candidates cover 20.00 cm²",
    ),
    "optimal": (
        _at("certificates", "projectors", "status", "optimal"),
        "2 devices stand against a bound of 1",
    ),
    "required": (
        _at("certificates", "cameras", "required_m2", lambda x: x * 0.5),
        "cameras.required_m2: claimed",
    ),
    "best area": (
        _at("certificates", "cameras", "best_area", "upper_bound_m2", 1e-6),
        "exceeds upper_bound_m2",
    ),
    "marginal": (
        _at("marginal", 1, "lit_target_m2", lambda x: x * 1.1),
        "marginal.projectors.2.lit_target_m2: claimed",
    ),
    "marginal falls": (
        _all(
            _at("marginal", 2, "measured_target_m2", 0.009),
            _at("requirements", "region_coverage", 0.0),
        ),
        "measured_target_m2 falls from 90.00 cm² with 1 camera to ",
    ),
    "marginal too large": (
        _at("marginal", 0, "lit_surface_m2", 1.0),
        "marginal.projectors.1.lit_surface_m2: 1.0 is claimed, must be an area",
    ),
    "marginal without the plan's own": (
        lambda document: document["marginal"].pop(1),
        "marginal.projectors: rows of [1] devices: each number once, among them",
    ),
    "marginal of one number twice": (
        lambda document: document["marginal"].append(document["marginal"][2]),
        "marginal.cameras: rows of [1, 1, 2] devices",
    ),
    "phi": (_at("baselines", 0, "phi", lambda x: x + 0.01), "C1-C2.phi: claimed"),
    "slack": (_at("baselines", 0, "slack", lambda x: -x), "C1-C2.slack: claimed"),
    "covered": (_at("baselines", 1, "covered", False), "C2-C1.covered: False is"),
    "d": (_at("baselines", 1, "d", lambda x: x + 1e-3), "C2-C1.d: claimed"),
    "lateral": (_at("baselines", 0, "d_lateral", lambda x: x + 1e-3), "C2.d_lateral: "),
    "axial": (_at("baselines", 0, "d_axial", lambda x: x + 1e-3), "C1-C2.d_axial: "),
    "d_max": (_at("baselines", 0, "d_max", lambda x: x - 1e-3), "C1-C2.d_max: claimed"),
    "d_max null": (_at("baselines", 0, "phi_max", 3.5), "must be null: phi_max 3.5"),
    "phi_max": (
        _at("baselines", 1, "phi_max", lambda x: x + 0.01),
        "C1.phi_max: claimed",
    ),
    "normals": (_at("baselines", 0, "normals", 1, [0, 1, 0]), "C1-C2.normals: "),
    "mean normal": (
        _entry("regions", 0, "mean_normal", lambda x: [1, 0, 0]),
        "mean_normal",
    ),
    "cone of a region": (
        _entry("regions", 0, "cone_angle", lambda x: 0.9 * x),
        "cone_angle",
    ),
    "D1": (_at("baselines", 0, "D1", lambda x: x * 1.001), "C1-C2.D1: claimed"),
    "E": (_at("baselines", 0, "E", 2, lambda x: x + 2e-4), "mm off the surface"),
    "one order": (lambda document: document["baselines"].pop(), "not the order C2, C1"),
    "stranger": (
        _at("baselines", 0, "cameras", ["C1", "C9"]),
        "two cameras of the plan",
    ),
    "standoff1": (_at("baselines", 0, "standoff1", lambda x: x + 2e-4), "standoff1: "),
    "standoff2": (_at("baselines", 1, "standoff2", lambda x: x - 2e-4), "standoff2: "),
    "C1": (_at("baselines", 0, "C1", lambda x: x + 2e-4), "C1-C2.C1: claimed"),
    "C2": (_at("baselines", 0, "C2", lambda x: x * 1.1), "C1-C2.C2: claimed"),
    "beta": (_at("baselines", 0, "beta", 1, lambda x: -x), "C1-C2.beta.1: claimed"),
    "iota": (_at("baselines", 1, "iota", 0, lambda x: x + 0.01), "C2-C1.iota.0: "),
    "half_field": (
        _at("baselines", 0, "half_field", 0, lambda x: x + 0.01),
        "C1-C2.half_field.0: claimed",
    ),
    "theta": (_at("baselines", 0, "max_incidence", 1.3), "C2.max_incidence: claimed"),
    "delta_axes": (_at("baselines", 0, "delta_axes", 0.0), "C2.delta_axes: claimed 0"),
    "delta_surface": (_at("baselines", 0, "delta_surface", 0.1), "delta_surface: "),
    "n_seam": (_at("baselines", 0, "n_seam", 0), "C2.n_seam: 0 must be a positive"),
    "limit": (_at("baselines", 0, "limit", "weather"), "'weather' is claimed, it is"),
    "other limit": (
        _at(
            "baselines",
            1,
            "limit",
            lambda x: "camera_field" if x == "camera_incidence" else "camera_incidence",
        ),
        "is claimed, it is camera_",
    ),
    "groups": (
        _at("camera_groups", [["C1"], ["C2"]]),
        "C1 and C2 stand in two groups, but share",
    ),
    "group twice": (
        _at("camera_groups", [["C1", "C2"], ["C2"]]),
        "must name each of C1, C2 exactly once",
    ),
    "no groups": (_at("camera_groups", []), "camera_groups: () must name each"),
    "candidates": (
        _at("certificates", "cameras", "candidates", "n_candidates", 480),
        "n_candidates: claimed 480 poses, recomputed 4 poses",
    ),
    "needed": (
        _at("certificates", "cameras", "needed", "count", 3),
        "needed.count: 3 is claimed for a plan of 2 that is 'feasible'",
    ),
    "needed bound": (
        _at("certificates", "cameras", "needed", "lower_bound", 3),
        "needed.lower_bound: 3 exceeds the count of 2",
    ),
    "best bound": (
        _at("certificates", "projectors", "best_area", "upper_bound_m2", 0.02),
        "best_area.upper_bound_m2: 200.00 cm² exceeds the ",
    ),
    "samples of all poses": (
        _of_all_poses(n_samples=10**6),
        "continuous.n_samples: 1000000 must be some of the certificate's",
    ),
    "reached": (_of_all_poses(n_reached=2000), "continuous.n_reached: claimed 2000 s"),
    "reached by more": (_of_all_poses(n_samples=5000), "n_reached: 5120 of 5000"),
    "survived": (
        _of_all_poses(lower_bound=2, status="survived"),
        "continuous.status: 'survived' is claimed of 2, and 2 are needed",
    ),
    "greedy few": (
        _at("certificates", "projectors", "greedy_count", 0),
        "projectors.greedy_count: 0 must lie between 1, which are needed, and 38",
    ),
    "greedy many": (
        _at("certificates", "projectors", "greedy_count", 60),
        "projectors.greedy_count: 60 must lie between",
    ),
    "one fewer": (
        _at(
            "certificates",
            "projectors",
            "candidates",
            lambda bound: bound | {"lower_bound": 2, "for_total": 2},
        ),
        "2 are claimed to be the fewest",
    ),
    "light": (_at("rig", "light", "parallel"), "but rig.light is 'parallel'"),
    "limits": (_at("rig", "limits", {}), "but rig.limits.noise_px is None"),
    "incidence limit": (
        _at("rig", "limits", "projector_max_incidence_deg", 50.0),
        "requirements.projector.max_incidence: claimed",
    ),
    "tangent limit": (
        _at("rig", "limits", "min_tangent_angle_deg", 41.0),
        "requirements.projector.min_tangent_angle: claimed",
    ),
    "camera limit": (
        _at("rig", "limits", "camera_max_incidence_deg", 60.0),
        "requirements.camera.max_incidence: claimed",
    ),
    "conditioning limit": (
        _at("rig", "limits", "min_conditioning", 0.2),
        "requirements.triangulation.min_conditioning: claimed",
    ),
    "noise": (
        _at("rig", "limits", "noise_px", 0.2),
        "requirements.triangulation.noise_px: claimed",
    ),
    "pitch limit": (
        _at("rig", "limits", "min_ring_pitch_px", None),
        "requirements.triangulation.min_ring_pitch_px: claimed 7.0, but",
    ),
    "up": (
        _at("requirements", "workspace", "up", [0, 2, 0]),
        "workspace.up: [0.0, 2.0",
    ),
    "axis": (
        _at("requirements", "workspace", "axis", [0, 0, 2]),
        "workspace.axis: [0.0, 0.0, 2.0] must be a unit vector",
    ),
    "half_angle": (
        _at("requirements", "workspace", "half_angle", 4.0),
        "workspace.half_angle: 4 rad must lie in (0, pi]",
    ),
    "shell": (
        _at("requirements", "workspace", "camera_radius_m", [1.1, 0.9]),
        "workspace.camera_radius_m: [1.1, 0.9] m must be positive and rise",
    ),
    "scale": (_at("meshes", 0, "scale_to_m", 0.0), "scale_to_m: 0.0 must be positive"),
    "scale of unit": (
        _at("meshes", 0, "unit", "mm"),
        "meshes.0.scale_to_m: claimed 1 m (mm), recomputed 0.001 m (mm)",
    ),
    "unit": (_at("meshes", 0, "unit", "cubit"), "meshes.0.unit: 'cubit' isn't one of"),
    "last ring": (
        _at("requirements", "workspace", "reference_ring_radius", 0.2),
        "P1.ring_radii (last): claimed",
    ),
    "C": (_at("cost", "C", 5.0), "cost.C: claimed 5.0, but the sum of its terms is"),
    "C before": (_at("cost", "C_before", 5.0), "cost.C_before: claimed 5.0, but"),
    "C of all rings": (_at("cost", "C_all_rings", 5.0), "cost.C_all_rings: claimed 5"),
    "C without the rings left out": (
        _at("projectors", 0, "rings", LEAVES_OUT),
        "cost.C_all_rings: claimed",
    ),
    "cameras before": (_at("cost", "n_cameras_before", 4), "greedy_count is 3"),
    "greedy": (_at("certificates", "cameras", "greedy_count", 2), "n_cameras_before"),
    "C without a term": (_at("cost", "t3", None), "the sum of its terms is None"),
    "t4": (_at("cost", "t4", -1.0), "cost.t4: -1.0 s is no time"),
    "frames": (_at("cost", "n_frames", 30), "cost.n_frames: claimed 30, recomputed 3"),
    "frame time": (_at("cost", "frame_s", 0.025), "rig.*.figures is 0.0333"),
    "t1": (_at("cost", "t1", lambda t1: 0.9 * t1), "cost.t1: claimed"),
    "exposure": (
        _at("rig", "camera", "figures", "exposure_ms", 40.0),
        "cost.frame_s: claimed 0.033",
    ),
    "no rate": (
        _at("rig", "projector", "figures", "frame_rate_hz", None),
        "rig.*.figures is None",
    ),
    "pixels": (_at("cost", "pixels", 12), "cost.pixels: claimed 12"),
    "share": (_at("surface", "dominant_share", 0.5), "surface.dominant_share: claimed"),
    "mesh area": (_at("meshes", 0, "area_m2", 0.04), "meshes.area_m2 (sum): claimed"),
    "member": (
        _at("members", 0, "coverage", lambda x: x | {"samples": 1}),
        "members.0.coverage: differs",
    ),
    "member mesh": (_at("members", 0, "mesh", 1), "members.0.mesh: differs"),
    "member regions": (
        _at("members", 0, "regions", lambda x: [*x, 99]),
        "members.0.regions: differs",
    ),
    "member check": (
        _at("members", 0, "reconstruction", CHECKED),
        "members.0.reconstruction: differs",
    ),
}
MALFORMED = {
    "missing": (_at("coverage", "surface", {}), "coverage.surface.lit_m2 is missing"),
    "nan": (_at("coverage", "target", "lit_m2", math.nan), "lit_m2 = nan should be"),
    "no rig": (_at("rig", "camera", None), "rig.camera = None should be"),
    "status": (_at("certificates", "cameras", "status", "great"), "'great' should be"),
    "status of all poses": (_of_all_poses(status="great"), "'great' should be"),
    "cells": (_of_all_poses(n_cells=-1), "n_cells = -1 should be"),
    "reached": (_of_all_poses(n_reached=-1), "n_reached = -1 should be"),
    "samples": (_at("certificates", "cameras", "n_samples", -1), "-1 should be"),
    "greedy": (_at("certificates", "cameras", "greedy_count", -1), "-1 should be"),
    "beta list": (_at("baselines", 0, "beta", 0.1), "baselines.0.beta = 0.1 should be"),
    "no groups": (_at("camera_groups", None), "camera_groups = None should be"),
    "no limits": (_at("rig", "limits", None), "rig.limits = None should be"),
    "no rotation": (
        _at("cameras", 0, "world_from_device", 0, 0, 0.5),
        "cameras.0.world_from_device = .* must hold a rotation",
    ),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_claim_that_is_no_claim_breaks_the_plan(handmade, name):
    change, sentence = MALFORMED[name]
    with pytest.raises(PlanFileError, match=sentence):
        handmade.tampered(handmade.build_plan(), change)


@pytest.mark.usefixtures("_recomputed_once")
@pytest.mark.parametrize("name", FALSE)
def test_a_false_claim_is_named(handmade, name):
    change, sentence = FALSE[name]
    found = failures(handmade.tampered(handmade.build_plan(), change))
    assert any(sentence in failure for failure in found), found


@pytest.mark.parametrize(
    ("overlap", "groups", "sentence"),
    [
        (0.030, [["A", "B", "C"]], None),
        (0.030, [["A", "C", "B"]], None),
        (0.030, [["A", "B"], ["C"]], "B and C stand in two groups"),
        (0.010, [["A", "B", "C"]], None),
        (0.010, [["A", "B"], ["C"]], None),
        (0.001, [["A", "B"], ["C"]], None),
        (0.001, [["A", "B", "C"]], "C stand in the group of A, but"),
        (0.001, [["A", "B"], []], "must name each of A, B, C exactly once"),
    ],
)
def test_groups_hang_together_by_overlaps_of_one_percent(overlap, groups, sentence):
    """A and B share a tenth of the target, B and C the given share, A and C nothing."""
    n = 10_000
    place = np.arange(n) / n
    measured = np.stack(
        [place < 0.4, (place >= 0.3) & (place < 0.7), place >= 0.7 - overlap]
    )
    findings = AuditFindings()
    audit_partition(groups, list("ABC"), measured, 12_000, findings)
    assert [sentence in failure for failure in findings.failures] == (
        [] if sentence is None else [True]
    )


def test_one_device_more_may_add_less_to_the_surface(handmade):
    """Covers are chosen for the target; on it alone must more devices do more."""

    def change(document):
        rows = document["marginal"]
        more = {**rows[3], "n_cameras": 3}
        more["measured_surface_m2"] = 0.5 * rows[3]["measured_surface_m2"]
        rows.append(more)

    assert failures(handmade.tampered(handmade.build_plan(), change)) == ()


def test_a_region_in_the_dark_is_lit_by_nobody(handmade):
    plan = handmade.build_plan()
    region = plan.surface.region.copy()
    region[plan.surface.mesh.face_centroids[:, 2] < -0.03] = 2
    dark = {
        "id": 2,
        "area_m2": 0.0,
        "n_faces": 0,
        "lit_by": ["P2"],
        "lit_fraction": 0.0,
        "mean_normal": [0.0, 0.0, 1.0],
        "cone_angle": 1.0,
        "mean_curvedness": 20.0,
    }
    document = plan.to_document() | {"regions": [*plan.to_document()["regions"], dark]}
    surface = dataclasses.replace(plan.surface, region=region)
    found = failures(RigPlan.from_document(document, surface))
    key = "regions.2.lit_by: P2 is named, but can light no part"
    assert any(sentence.startswith(key) for sentence in found)


@pytest.mark.parametrize("name", ["pixel_pitch_m", "beam_radius"])
def test_a_parallel_model_must_be_the_rigs(handmade, name):
    plan = handmade.build_plan("parallel")
    found = failures(handmade.tampered(plan, _at("rig", "projector", name, 0.5)))
    assert any(f"P1.{name}: claimed" in failure for failure in found)


def test_a_parallel_ring_frame_must_keep_the_axis_of_the_light(handmade):
    def change(document):
        document["projectors"][0]["world_from_ring"] = (
            np.array(document["projectors"][0]["world_from_ring"]) @ turn
        ).tolist()

    c, s = math.cos(0.02), math.sin(0.02)
    turn = np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])
    found = failures(handmade.tampered(handmade.build_plan("parallel"), change))
    assert any("the axis of the light by up to 0.02" in f for f in found)


def test_a_pose_with_a_projective_row_is_named(handmade):
    change = _at("cameras", 0, "world_from_device", 3, 2, 0.1)
    found = failures(handmade.tampered(handmade.build_plan(), change))
    assert any("C1.world_from_device" in f and "rigid last row" in f for f in found)


def test_what_other_numbers_cover_is_held_against_the_table(handmade):
    """Claims for one, two and three candidates: true ones pass, each false is named."""

    def planted(*, best=0.0, fewer=0.0, value=0.0, table=0.0):
        def change(document):
            areas = document["coverage"]["target"]
            proof = document["certificates"]["projectors"]
            marginal = {
                row["n_projectors"]: row["lit_target_m2"]
                for row in document["marginal"]
                if "n_projectors" in row
            }
            most = {1: marginal[1], 2: areas["reachable_by_projectors_m2"]}
            proof["by_count"] = [
                {
                    "count": n,
                    "value_m2": marginal[n] * (1.0 + value),
                    "upper_bound_m2": most[n] * (1.0 - table * (n == 1)),
                }
                for n in (1, 2)
            ]
            if table:
                proof["by_count"][0]["value_m2"] = 0.0
            proof["best_area"]["upper_bound_m2"] = most[2] * (1.0 - best)
            if best:
                proof["best_area"]["value_m2"] = 0.0
            least = proof["by_count"][0]["upper_bound_m2"]
            proof["one_fewer"] = {"upper_bound_m2": least * (1.0 - fewer)}

        return failures(handmade.tampered(handmade.build_plan(), change))

    assert planted() == ()
    (line,) = planted(best=0.01)
    assert "best_area.upper_bound_m2: claimed" in line
    (line,) = planted(fewer=0.01)
    assert "one_fewer.upper_bound_m2: claimed" in line
    assert "by_count: for 1: value_m2" in planted(value=0.01)[0]
    (line,) = planted(table=0.5)
    assert "are claimed for 1, but marginal has" in line


def test_a_superfluous_device_refutes_the_bound(handmade):
    def change(document):
        document["requirements"]["region_coverage"] = 0.0
        for kind in ("projectors", "cameras"):
            document["certificates"][kind]["floors"] = 0
            document["certificates"][kind]["candidates"]["for_total"] = None
        for region in document["regions"]:
            region["coverage"]["floor"] = None
        document["certificates"]["projectors"]["candidates"]["lower_bound"] = 2
        document["certificates"]["projectors"]["status"] = "optimal"
        document["certificates"]["projectors"]["one_fewer"]["upper_bound_m2"] = 0.0
        document["requirements"]["dominant_coverage"] = 0.1
        document["certificates"]["projectors"]["required_m2"] = (
            0.1 * document["coverage"]["target"]["reachable_by_projectors_m2"]
        )

    found = failures(handmade.tampered(handmade.build_plan(), change))
    assert len(found) == 1
    assert (
        "certificates.projectors.candidates.lower_bound: 2 is claimed, but 1"
        in found[0]
    )


@pytest.mark.parametrize(
    ("spacing", "holds"), [("uniform", False), ("curvature", True)]
)
def test_cameras_may_have_reached_more_before_rings_were_spaced(
    handmade, spacing, holds
):
    """Finer rings pass less: what was asked is of all that is lit at most."""

    def change(document):
        proof = document["certificates"]["cameras"]
        n, areas = proof["n_samples"], document["coverage"]["target"]
        proof["continuous"] = _anywhere(1, n_samples=n, n_reached=n)(None)
        share = document["requirements"]["coverage"]
        proof["required_m2"] = share * areas["lit_m2"]
        for projector in document["projectors"]:
            projector["rings"] = LEAVES_OUT | {"spacing": spacing}

    found = failures(handmade.tampered(handmade.build_plan(), change))
    named = "cameras.continuous.n_reached", "cameras.required_m2"
    told = [any(name in line for line in found) for name in named]
    assert told == [not holds] * 2


def test_reference_poses_outside_the_workspace_are_counted(handmade):
    plan = handmade.build_plan()
    poses = plan.surface.reference_cameras.copy()
    poses[0, :3, 3] *= 2.0
    surface = dataclasses.replace(plan.surface, reference_cameras=poses)
    found = failures(RigPlan.from_document(plan.to_document(), surface))
    assert any("reference_cameras: 1 of 4 poses lie outside" in f for f in found)


def test_reference_rings_must_share_the_optical_centre(handmade):
    plan = handmade.build_plan()
    rings = plan.surface.reference_rings.copy()
    rings[3, :3, 3] += 0.01
    surface = dataclasses.replace(plan.surface, reference_rings=rings)
    found = failures(RigPlan.from_document(plan.to_document(), surface))
    assert any(
        "reference_rings: ring frames leave the optical centre" in f for f in found
    )


def test_fewer_reference_poses_change_what_is_reachable(handmade):
    plan = handmade.build_plan()
    poses = plan.surface.reference_projectors[:1]
    surface = dataclasses.replace(
        plan.surface,
        reference_projectors=poses,
        reference_rings=plan.surface.reference_rings[:1],
    )
    found = failures(RigPlan.from_document(plan.to_document(), surface))
    assert any(
        "coverage.target.reachable_by_projectors_m2: claimed" in f for f in found
    )


@pytest.mark.parametrize(
    ("name", "shape"),
    [("reference_cameras", (4, 3)), ("reference_rings", (2, 4, 4)), ("steep", (5, 3))],
)
@pytest.mark.parametrize("value", [0.0, math.nan])
def test_arrays_of_the_wrong_shape_break_the_surface(handmade, name, shape, value):
    surface = handmade.build_plan().surface
    if value != value:
        shape = getattr(surface, name).shape
    with pytest.raises(PlanFileError, match="plan again"):
        dataclasses.replace(surface, **{name: np.full(shape, value)})


def test_an_empty_target_breaks_the_plan(handmade):
    plan = handmade.build_plan()
    surface = dataclasses.replace(
        plan.surface, region=np.full(len(plan.surface.region), -1)
    )
    with pytest.raises(PlanFileError, match="the target has no area"):
        audit_plan(RigPlan.from_document(plan.to_document(), surface))


def test_floors_of_regions_may_cost_area_from_one_number_to_the_next(handmade):
    """One camera may measure more than the two that measure enough of each region."""

    def fewer_measure_more(document: dict, needed: int) -> None:
        _at("marginal", 2, "measured_target_m2", 0.009)(document)
        # Also where more are needed than there may be.
        document["certificates"]["cameras"]["needed"]["count"] = needed

    for needed in (2, 5):
        change = partial(fewer_measure_more, needed=needed)
        found = failures(handmade.tampered(handmade.build_plan(), change))
        assert not any("falls from" in failure for failure in found)


def test_an_unmet_requirement_is_no_false_claim(handmade):
    change = _at("requirements", "min_reachable", 0.999)
    audit = audit_plan(handmade.tampered(handmade.build_plan(), change))
    assert not audit.failures
    assert [sentence.split()[1] for sentence in audit.unmet] == [
        "reachable_by_projectors_m2",
        "reachable_by_cameras_m2",
    ]


def _mirrored(project):
    def wrong(camera, local):
        return project(camera, [-local[0], local[1], local[2]])

    return wrong


def _shining_back(light_steps):
    def wrong(entry, p, n, steep, limits):
        return light_steps(entry, p, [-x for x in n], steep, limits)

    return wrong


PLANNER_ERRORS = {
    "projection": ("project", _mirrored),
    "visibility": ("light_steps", _shining_back),
}


@pytest.mark.parametrize(
    ("light", "name"), [("diverging", "projection"), ("parallel", "visibility")]
)
def test_a_wrong_sign_in_the_planner_shows_as_areas(handmade, monkeypatch, name, light):
    function, wrong = PLANNER_ERRORS[name]
    monkeypatch.setattr(handmade, function, wrong(getattr(handmade, function)))
    found = failures(handmade.make_plan(light))
    assert any("coverage." in failure for failure in found)


def test_a_wrong_sign_in_the_ring_normal_shows_as_areas(handmade, monkeypatch):
    monkeypatch.setattr(handmade, "RING_SIGN", 1.0)
    found = failures(handmade.make_plan("diverging"))
    assert any("coverage.target.measured_m2: claimed" in failure for failure in found)


@pytest.mark.parametrize(("fraction", "holds"), [(4 / 11, True), (1.0, False)])
def test_a_region_of_few_samples_is_judged_by_its_few_samples(
    handmade, fraction, holds
):
    plan = handmade.build_plan()
    z = plan.surface.mesh.face_centroids[:, 2]
    # Three faces out of the light: about a dozen samples of either side.
    few = np.isin(np.arange(len(z)), np.argsort(np.abs(z + 0.02))[:3])
    region = np.where(few, 2, plan.surface.region)
    few_claims = {"id": 2, "lit_by": [], "lit_fraction": fraction, "n_faces": 3}
    few_claims |= {"mean_normal": [0.0, 0.0, 1.0], "cone_angle": 1.0}
    few_claims["mean_curvedness"] = 20.0
    few_claims["area_m2"] = float(plan.surface.mesh.face_areas[few].sum())
    document = plan.to_document() | {
        "regions": [*plan.to_document()["regions"], few_claims]
    }
    surface = dataclasses.replace(plan.surface, region=region)
    found = audit_plan(
        RigPlan.from_document(document, surface), n_samples=2000
    ).failures
    named = any(f.startswith("regions.2.lit_fraction: claimed") for f in found)
    assert named is not holds
