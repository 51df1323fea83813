"""What each single limit of the cameras must be: no more than it takes, and no less."""

import re
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from support.factories import make_requirements, make_scene
from support.plain_shapes import grid

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.cameras.camera_cover import CameraCover
from planning.cameras.proved_cameras import CameraStage
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.plan import RigPlan
from planning.report.advice import camera_relaxations
from planning.report.advice.camera_relaxations import (
    SPARE,
    for_so_many,
    least_demands,
    out_of_reach,
)
from planning.report.advice.demands import Demands, demands
from planning.report.advice.least_changes import Share, least_changes, least_enough
from planning.report.advice.least_changes import relaxations_of_cameras as ways
from planning.report.claims.claims import make_claims
from planning.report.claims.judged import Devices
from planning.report.summary.shortfall import shortfalls
from planning.rig import optics
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes
from planning.scene.draws import Draw
from planning.scene.lights import ring_frame
from planning.scene.limits.pair_limits import CAUSES, MEASURED
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import furthest_failure, lit_samples, measured_by
from planning.scene.workspace.candidates import aimed_poses
from planning.verify.audit.audit import audit_plan

FEW = """
base = "default"
name = "fixed gap"
[rings]
gap_mm = 2.0
[limits]
max_sample_distance_mm = 0.5
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "few.toml"
    path.write_text(FEW)
    return load_rig(path)


@pytest.fixture(scope="module")
def world(rig):
    """A ball under two projectors, seen by cameras that hold it, nearly or not."""
    ball = sphere(0.1, subdivisions=3)
    required = make_requirements(ball, rig, max_projectors=1)
    scene = make_scene(ball, required)
    up = np.array([0.0, 0.0, 1.0])
    device = rig.projector_device()
    stands = np.array([[0.0, -1.1, 0.1], [0.5, -1.0, -0.2]])
    lights = aimed_poses(stands, np.zeros(3), up, device)
    radii = np.linspace(0.004, 0.3, 75)
    projector, second = (
        PlannedProjector(
            "P1",
            "diverging",
            light,
            ring_frame(light, device, 0.1, -1.5),
            device,
            radii,
        )
        for light in lights
    )
    rows = lit_samples(scene, [projector, second], scene.target_samples(Draw(400, 7)))
    places = [(0.6, -0.9, 0.1), (-0.4, -1.0, 0.6), (0.6, -0.9, -0.3)]
    aims = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.1), (0.25, 0.165, 0.0)]
    assert len(rows.target) > 60
    cameras = [
        PlannedCamera("", look_at(np.array(p), np.array(a), up), rig.camera_device())
        for p, a in zip(places, aims, strict=True)
    ]
    return scene, projector, rows, cameras


def turned_to(name, value, scene, rows, camera):
    """The world with one limit at a value, by what a rig file would change."""
    required, device = scene.requirements, camera.device
    view, pair = required.camera, required.triangulation
    match name:
        case "incidence":
            view = replace(view, max_incidence=np.radians(value))
        case "sampling":
            view = replace(view, max_sample_distance_m=1e-3 * value)
        case "conditioning":
            pair = replace(pair, min_conditioning=-value)
        case "sigma":
            pair = replace(pair, max_sigma_m=1e-3 * value)
        case "pitch":
            pair = replace(pair, min_ring_pitch_px=-value)
        case "gap":
            wider = tuple(
                replace(rings, spacing=rings.spacing * value / 2.0)
                for rings in rows.surfaces
            )
            rows = replace(rows, surfaces=wider)
        case "blur":
            sharp = optics.depth_of_field(0.012, 11.0, value * 3.45e-6, 1.15)
            device = replace(device, range_m=sharp)
        case "near":
            device = replace(device, range_m=(-1e-3 * value, device.range_m[1]))
        case "far":
            device = replace(device, range_m=(device.range_m[0], 1e-3 * value))
        case "both":
            low, high = device.range_m
            device = replace(device, range_m=(low - 1e-3 * value, high + 1e-3 * value))
    scene = replace(
        scene, requirements=replace(required, camera=view, triangulation=pair)
    )
    return scene, rows, replace(camera, device=device)


def tightened(scene, **changes):
    required = scene.requirements
    parts = {name: replace(getattr(required, name), **c) for name, c in changes.items()}
    return replace(scene, requirements=replace(required, **parts))


def asked_and_checked(name, knob, scene, rows, cameras):
    """Samples that a knob helps: measured at what they ask, and at no less."""
    helped = 0
    for camera in cameras:
        found = demands(scene, camera, rows, (knob,))
        now = measured_by(scene, [camera], rows)[:, 0]
        assert np.array_equal(np.isneginf(found.demanded[0]), now)
        assert np.array_equal(found.furthest == MEASURED, now)
        asks = found.demanded[0][np.isfinite(found.demanded[0])]
        for value in np.unique(np.quantile(asks, [0.1, 0.5, 0.9])) if len(asks) else ():
            value = asks[np.argmin(np.abs(asks - value))]
            rest = 1e-7 * abs(value)
            least, under = (
                measured_by(world[0], [world[2]], world[1])[:, 0]
                for world in (
                    turned_to(name, value + rest, scene, rows, camera),
                    turned_to(name, value - rest, scene, rows, camera),
                )
            )
            exact = found.demanded[0] == value
            assert least[exact].all()
            assert not under[exact].any()
            assert np.array_equal(least, found.demanded[0] <= value)
            helped += int(exact.sum())
    return helped


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("incidence", "camera_max_incidence_deg"),
        ("sampling", "max_sample_distance_mm"),
        ("conditioning", "min_conditioning"),
        ("sigma", "--accuracy"),
        ("pitch", "min_ring_pitch_px"),
        ("gap", "rings.gap_mm"),
    ],
)
def test_a_sample_is_measured_from_exactly_what_it_asks_on(rig, world, name, says):
    scene, _, rows, cameras = world
    alone = {
        "incidence": {"camera": {"max_incidence": np.radians(30.0)}},
        "sampling": {"camera": {"max_sample_distance_m": 0.00033}},
        "conditioning": {"triangulation": {"min_conditioning": 0.4}},
        "sigma": {"triangulation": {"max_sigma_m": 3e-5}},
        "pitch": {"triangulation": {"min_ring_pitch_px": 12.0}},
        "gap": {"triangulation": {"min_ring_pitch_px": 12.0}},
    }[name]
    scene = tightened(scene, **alone)
    (knob,) = (k for k in ways(rig, scene.requirements) if says in k.say(1.0))
    assert asked_and_checked(name, knob, scene, rows, cameras) > 0


@pytest.mark.parametrize(
    ("name", "says"), [("near", "from 1 mm"), ("far", "to 1 mm"), ("both", " to ")]
)
def test_ends_of_a_range_of_its_own_give_way(world, name, says, tmp_path):
    path = tmp_path / "range.toml"
    path.write_text(
        'base = "default"\nname = "n"\n[camera]\nname = "c"\nresolution_px = [2048, '
        "1536]\nfocal_px = [3478.0, 3478.0]\nrange_mm = [990.0, 1040.0]\n"
        "[placement]\nstandoff_mm = 1000.0\n"
    )
    scene, _, rows, cameras = world
    own = load_rig(path)
    cameras = [replace(camera, device=own.camera_device()) for camera in cameras]
    turned = ways(own, scene.requirements)
    value = -1.0 if name == "near" else 1.0
    knob = [k for k in turned if "sharp" in k.say(value) and says in k.say(value)][
        -1 if name == "both" else 0
    ]
    assert asked_and_checked(name, knob, scene, rows, cameras) > 0


def test_a_lens_asks_for_the_blur_that_makes_it_sharp(world, tmp_path):
    path = tmp_path / "focus.toml"
    path.write_text(
        'base = "default"\nname = "n"\n[camera.focus]\ndistance_mm = 1150.0\n'
        "f_number = 11.0\nblur_px = 0.4\n[placement]\nstandoff_mm = 1100.0\n"
    )
    scene, _, rows, cameras = world
    own = load_rig(path)
    cameras = [replace(camera, device=own.camera_device()) for camera in cameras]
    turned = [k for k in ways(own, scene.requirements) if "focus" in k.say(0.6)]
    assert len(turned) == 1
    assert asked_and_checked("blur", turned[0], scene, rows, cameras) > 0
    # Twice the blur is half the aperture.
    assert turned[0].say(0.8) == (
        "camera.focus.blur_px = 0.8 (now 0.4) or camera.focus.f_number = 22 (now 11)"
    )
    assert not any("sharp" in k.say(1.0) for k in ways(own, scene.requirements)[2:])


def test_an_image_asks_for_the_angle_off_its_middle(rig, world):
    scene, _, rows, cameras = world
    (knob,) = (k for k in ways(rig, scene.requirements) if "off its middle" in k.say(1))
    camera = cameras[2]
    found = demands(scene, camera, rows, (knob,))
    helped = np.isfinite(found.demanded[0])
    assert helped.any()
    pose = camera.world_from_device
    ray = rows.target.samples.points[helped] - pose[:3, 3]
    cosine = ray @ pose[:3, 2] / np.linalg.norm(ray, axis=1)
    assert found.demanded[0][helped] == pytest.approx(np.degrees(np.arccos(cosine)))
    assert set(found.furthest[helped]) == {CAUSES.index("camera_field")}


def test_the_limit_at_which_a_sample_comes_furthest_is_that_of_its_views(rig, world):
    scene, _, rows, cameras = world
    scene = tightened(
        scene,
        camera={"max_incidence": np.radians(45.0), "max_sample_distance_m": 0.00035},
        triangulation={"min_conditioning": 0.4, "min_ring_pitch_px": 12.0},
    )
    near, _, aside = cameras
    near = replace(near, device=replace(near.device, range_m=(1.02, 1.06)))
    aside = replace(aside, device=replace(aside.device, range_m=(1.0, 1.05)))
    causes = set()
    for camera in (near, *cameras, aside):
        found = demands(scene, camera, rows, ways(rig, scene.requirements))
        assert np.array_equal(found.furthest, furthest_failure(scene, [camera], rows))
        causes |= set(found.furthest.tolist())
    assert len(causes) >= 7


def test_two_limits_that_forbid_a_sample_are_helped_by_neither(rig, world):
    scene, _, rows, cameras = world
    required = scene.requirements
    none = tightened(
        scene,
        camera={"max_incidence": np.radians(1e-3)},
        triangulation={"min_conditioning": 1.0},
    )
    found = demands(none, cameras[0], rows, ways(rig, required))
    assert np.all(np.isposinf(found.demanded))


@pytest.mark.parametrize("seed", range(8))
def test_the_least_value_with_which_so_many_are_enough_is_that_of_every_choice(seed):
    rng = np.random.default_rng(seed)
    asked = np.where(
        rng.random((12, 5)) < 0.7, rng.integers(1, 30, (12, 5)).astype(float), np.inf
    )
    asked[rng.random((12, 5)) < 0.2] = -np.inf
    knob = ways(load_rig("default"), _requirements())[0]

    def enough(seen):
        need = 0.9 * seen.any(axis=1).sum()
        most = max(
            seen[:, list(pair)].any(axis=1).sum() for pair in combinations(range(5), 2)
        )
        return bool(most >= need)

    values = np.unique(asked[np.isfinite(asked)])
    least = least_enough(replace(knob, say=float), asked, enough)
    if least is None:
        assert not enough(asked <= values[-1])
    else:
        assert enough(asked <= least)
        below = values[values < least]
        assert not len(below) or not enough(asked <= below[-1])


def _requirements():
    return load_rig("default").requirements(
        np.zeros(3), 0.1, Wishes(max_projectors=1), tau_m=0.004
    )


def test_changes_that_gain_less_than_a_point_are_left_out():
    share = Share(1000, 500, 0.9)
    assert share.wanted == 403
    gained = share.gains({"a": 400, "b": 9, "c": 10})
    told = [(entry.change, entry.reachable_share) for entry in gained]
    assert told == [("c", 0.51), ("a", 0.9)]


def test_a_change_reaches_what_it_says_and_a_step_less_reaches_too_little(rig, world):
    """Reached shares are those that claims of the changed world make."""
    scene, projector, _, cameras = world
    up = np.array([0.0, 0.0, 1.0])
    ring = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    places = [(0.5 * np.cos(a), -1.0, 0.5 * np.sin(a)) for a in ring]
    reference = tuple(
        replace(cameras[0], world_from_device=look_at(np.array(p), np.zeros(3), up))
        for p in places
    )
    devices = Devices((projector,), reference[:1], (projector,), reference)
    scene = tightened(scene, camera={"max_incidence": np.radians(20.0)})
    claims = make_claims(scene, devices)
    areas = claims.coverage.target
    by_cause, relaxations = out_of_reach(scene, rig, devices, claims)
    beyond = areas.lit_m2 - areas.reachable_by_cameras_m2
    assert sum(by_cause.values()) == pytest.approx(beyond)
    target = claims.target_samples
    missed = target.take(~claims.measured_by.any(axis=1))
    rows = lit_samples(scene, [projector], missed)
    furthest = furthest_failure(scene, reference, rows)
    assert by_cause == {
        cause: pytest.approx(target.samples.weight * np.sum(furthest == stage))
        for stage, cause in enumerate(CAUSES)
        if np.any(furthest == stage)
    }
    assert len(by_cause) >= 2
    (told,) = (
        entry for entry in relaxations if "camera_max_incidence_deg" in entry.change
    )
    value = int(re.search(r"= (\d+) \(now 20\)", told.change)[1])
    shares = []
    for degrees in (value, value - 1):
        other = tightened(scene, camera={"max_incidence": np.radians(degrees)})
        areas = make_claims(other, devices).coverage.target
        shares.append(areas.reachable_by_cameras_m2 / areas.lit_m2)
    assert shares[0] == pytest.approx(told.reachable_share)
    assert shares[1] < scene.requirements.min_reachable <= shares[0]


def test_one_camera_is_enough_at_what_is_told_and_not_below(rig, world):
    scene, _, rows, cameras = world
    scene = tightened(scene, camera={"max_incidence": np.radians(40.0)})
    scene = replace(scene, requirements=replace(scene.requirements, coverage=0.6))
    offered = CandidateViews(scene, cameras)
    measured = measured_by(scene, cameras, rows)
    cover = CameraCover(offered, rows, measured, None)
    stage = CameraStage({}, {}, tuple(cameras[:1]), cover)
    told = " ".join(for_so_many(scene, rig, stage, 1))
    value = int(re.search(r"camera_max_incidence_deg = (\d+) \(now 40\)", told)[1])

    def enough(degrees):
        other = tightened(scene, camera={"max_incidence": np.radians(degrees)})
        seen = measured_by(other, cameras, rows)
        need = (scene.requirements.coverage + SPARE) * seen.any(axis=1).sum()
        return seen.sum(axis=0).max() >= need

    assert not enough(40)

    assert enough(value)
    assert not enough(value - 1)


def test_a_limit_gives_way_as_far_as_the_share_asks_or_as_it_helps(rig, monkeypatch):
    """Ten of twenty samples ask 1, 2, ... 10 degrees; two are measured as it is.

    The share is reached with 0.3 % to spare: 7.06 of the samples are 8.
    """
    asked = np.full((1, 20), np.inf)
    asked[0, :10] = np.arange(1.0, 11.0) - 0.5
    asked[0, 18:] = -np.inf
    furthest = np.where(np.isneginf(asked[0]), MEASURED, 2).astype(np.int8)
    found = Demands(furthest, asked)
    monkeypatch.setattr(camera_relaxations, "demands", lambda *_: found)
    monkeypatch.setattr(camera_relaxations, "taken", lambda rows, *_: rows)
    (knob,) = ways(rig, _requirements())[:1]
    samples = SimpleNamespace(lit=None, target=range(20))
    table = least_demands(None, [None], samples, (knob,))
    asks = table.demanded[:, table.furthest < MEASURED]
    for least, degrees, gained in ((0.35, 6, 6), (0.9, 10, 10), (0.05, None, None)):
        changes = least_changes((knob,), asks, Share(20, 2, least).wanted)
        want = {} if degrees is None else {knob.say(degrees): gained}
        assert changes == want


def two_floors():
    """Plates of 36 cm², the one 0.2 m deeper than the other."""
    top = grid(0.06, 0.06, divisions=(3, 3))
    n = len(top.vertices)
    high, deep = np.array([-0.05, 0.0, 0.1]), np.array([0.05, 0.0, -0.1])
    return TriangleMesh(
        np.concatenate([top.vertices + high, top.vertices + deep]),
        np.concatenate([top.faces, top.faces + n]),
    )


def plan(small_job, tmp_path, monkeypatch, rig, words=()):
    mesh = two_floors()
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in 1e3 * mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path = tmp_path / "floors.obj"
    path.write_text("\n".join(lines) + "\n")
    cone = '[workspace]\nshape = "cone"\naxis = [0, 0, 1]\nhalf_angle_deg = 30.0\n'
    monkeypatch.setattr(small_job, "RIG", small_job.RIG + cone + rig)
    target = ["--target", "surface", "--unit", "mm"]
    return small_job.run(path, tmp_path, [*target, *words])


@pytest.mark.usefixtures("little_work")
def test_an_accuracy_that_no_pose_reaches_exits_4_and_says_which_would_do(
    small_job, tmp_path, monkeypatch
):
    ended = plan(small_job, tmp_path, monkeypatch, "", ["--accuracy", "0.001"])
    assert ended.code == 4
    assert ended.plan is None
    assert re.search(r"sigma 100 % \(\d\d\.\d cm²\)", ended.message)
    told = re.search(
        r"--accuracy ([\d.]+) \(now 0.001 mm\) would make (\S+) %", ended.message
    )
    assert 0.01 < float(told[1]) < 0.3
    assert float(told[2]) >= 90.0


@pytest.mark.usefixtures("little_work")
@pytest.mark.long
def test_a_depth_of_field_that_holds_half_is_told_by_cause_and_audited(
    small_job, tmp_path, monkeypatch
):
    rig = (
        '[camera]\nname = "shallow"\nresolution_px = [2048, 1536]\n'
        "focal_px = [3478.0, 3478.0]\nrange_mm = [900.0, 1120.0]\n"
    )
    ended = plan(small_job, tmp_path, monkeypatch, rig)
    assert ended.code == 1
    written = RigPlan.load(tmp_path / "plan" / "plan.json")
    areas, coverage = ended.plan["coverage"]["target"], ended.plan["coverage"]
    beyond = areas["lit_m2"] - areas["reachable_by_cameras_m2"]
    # The deep floor.
    assert beyond == pytest.approx(0.0036, rel=0.1)
    assert coverage["unmeasurable_by_cause"]["camera_range"] > 0.99 * beyond
    missed = " ".join(shortfalls(written))
    of = f"{1e4 * beyond:.1f} cm² of {1e4 * areas['lit_m2']:.1f} cm² can't be"
    assert of in missed
    assert "out of the cameras' depth of field" in missed
    told = re.search(r"sharp to (\d+) mm \(now 1120\) would reach (\S+) %", missed)
    # From the middle of the shell, 1 m beyond the ball, straight on or from 30 degrees.
    assert 1120 < int(told[1]) < 1300
    assert float(told[2]) >= 90.0
    audit = audit_plan(written, n_samples=1500)
    assert not audit.failures
    assert any("reachable_by_cameras_m2 " in sentence for sentence in audit.unmet)


def test_too_few_cameras_say_why_how_many_and_which_limit(handmade):
    document = handmade.build_plan().to_document()
    document["certificates"]["cameras"] |= {
        "count": 1,
        "needed": {"count": 3, "lower_bound": 2, "relaxations": ["a = 2 (now 1)"]},
    }
    document["certificates"]["cameras"]["candidates"]["for_total"] = 2
    document["coverage"]["uncovered_by_cause"] = {
        "projector_beam": 9e-4,
        "sigma": 2e-4,
        "camera_occlusion": 5e-4,
        "pitch": 1e-6,
    }
    document["requirements"] |= {
        "coverage": 0.99,
        "max_cameras": 1,
        "min_reachable": 0,
    }
    plan = RigPlan.from_document(document, handmade.build_plan().surface)
    (line,) = (s for s in shortfalls(plan) if "camera" in s.split(",")[0])
    assert (
        "Of the lit target: 5.0 cm² hidden from every camera that faces it; 2.0 cm² "
        "measured with too large a deviation. What would help: --max-cameras 3 (at "
        "least 2 claimed over the candidates), a = 2 (now 1), or --coverage 0." in line
    )
