"""What is claimed and said of regions: areas, floors, places, remedies, numbers."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from support.factories import (
    make_camera,
    make_projector,
    make_requirements,
    make_rig,
    make_scene,
)

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning.cli.main import commands
from planning.model.document.coverage_records import RegionRecord
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.projectors.candidate_set import CandidateSet
from planning.report.advice import floor_relaxations
from planning.report.advice.floor_relaxations import (
    with_floor_relaxations,
    with_small_floor,
)
from planning.report.claims.claims import make_claims
from planning.report.claims.judged import Devices
from planning.report.drawing.panel import Panel
from planning.report.drawing.picture_view import fitted
from planning.report.drawing.region_numbers import direction_of_unseen, region_spots
from planning.report.summary.region_lines import (
    region_lines,
    region_table,
    region_words,
)
from planning.report.summary.shortfall import shortfalls
from planning.scene.draws import DRAWS
from planning.steps import stages
from solvers.status import SolveStatus

BALL = sphere(0.1, subdivisions=4)
# Degrees of each face's normal off the light.
OFF = np.degrees(np.arccos(np.clip(BALL.face_normals[:, 2], -1.0, 1.0)))
# A bright cap, a sliver of it, a band that light grazes, and the far side.
REGION = np.select([OFF < 8, OFF < 50, (OFF < 80), (OFF > 120)], [1, 0, 2, 3], -1)
FLOOR = 0.7
RIG = make_rig("parallel")


@pytest.fixture(scope="module")
def world():
    """The ball under parallel light along -z, in which only incidence decides."""
    required = make_requirements(BALL, RIG, max_projectors=1, region_coverage=FLOOR)
    required = replace(required, target="dominant", region_share=0.005)
    scene = make_scene(BALL, required, region=REGION)
    up = np.array([0.0, 1.0, 0.0])
    down, aside, beyond = (
        look_at(np.array(place), np.zeros(3), up=up)
        for place in ([0.0, 0.0, 1.1], [0.9, 0.0, 0.6], [-0.9, 0.0, 0.6])
    )
    light = {"world_from_device": down, "world_from_ring": down}
    projector = make_projector(RIG, np.linspace(0.002, 0.3, 100), **light)
    tilted = look_at(np.array([1.1, 0.0, 0.0]), np.zeros(3), up=up)
    other = replace(projector, world_from_device=tilted, world_from_ring=tilted)
    camera = make_camera(RIG, id="C1", world_from_device=aside)
    mirrored = replace(camera, world_from_device=beyond)
    devices = Devices(
        (replace(projector, id="P1"),),
        (camera,),
        (projector, other),
        (camera, mirrored),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(vars(DRAWS), "claims", replace(DRAWS.claims, count=2000))
        claims = make_claims(scene, devices)
    return scene, devices, claims


def _area(faces):
    return float(BALL.face_areas[faces].sum())


def test_areas_of_regions_are_those_of_their_faces(world):
    scene, _, claims = world
    facing = BALL.face_normals @ [1.0, 0.0, 0.0] > 0.5
    for number, claim in enumerate(claims.regions):
        inside, areas = REGION == number, claim.coverage
        lit = _area(inside & (OFF < 60)) / _area(inside)
        reached = _area(inside & ((OFF < 60) | facing)) / _area(inside)
        slack = 4.0 * np.sqrt(0.25 / areas.samples)
        assert areas.samples >= DRAWS.region_claims.count
        assert claim.lit_fraction == pytest.approx(lit, abs=slack)
        assert areas.lit_m2 == pytest.approx(claim.lit_fraction * _area(inside))
        assert areas.reachable_by_projectors_m2 == pytest.approx(
            reached * _area(inside), abs=slack * _area(inside)
        )
        assert sum(areas.uncovered_by_cause.values()) == pytest.approx(
            _area(inside) - areas.measured_m2
        )
        assert areas.measured_by.get("C1", 0.0) == areas.measured_m2
        met = areas.lit_m2 >= FLOOR * areas.reachable_by_projectors_m2
        met &= areas.measured_m2 >= FLOOR * areas.reachable_by_cameras_m2
        assert (areas.floor == "met") is met
    # All of the cap is lit, but the camera stands aside.
    floors = [claim.coverage.floor for claim in claims.regions]
    assert floors == ["missed", "met", "missed", "missed"]
    # The far side isn't lit at all, and the sliver has samples of its own.
    assert claims.region_samples.worst(claims.region_samples.lit) == (3, 0.0)
    of_sliver = claims.region_samples.target.samples.faces
    assert np.all(scene.region[of_sliver] == claims.region_samples.region)


def test_small_regions_have_no_floor_and_no_samples_of_their_own(world):
    scene, *_ = world
    required = replace(scene.requirements, region_share=0.02)
    assert _area(REGION == 1) < 0.02 * _area(REGION >= 0)
    assert make_scene(BALL, required, region=REGION).large_regions.tolist() == [0, 2, 3]
    assert scene.large_regions.tolist() == [0, 1, 2, 3]


def _records(claims):
    return tuple(
        RegionRecord(
            id=number,
            area_m2=_area(REGION == number),
            n_faces=1,
            mean_normal=(0.0, 0.0, 1.0),
            cone_angle=1.0,
            mean_curvedness=1.0,
            lit_by=claim.lit_by,
            lit_fraction=claim.lit_fraction,
            coverage=claim.coverage,
        )
        for number, claim in enumerate(claims.regions)
    )


def test_of_the_largest_dark_region_without_a_floor_one_is_priced(world, monkeypatch):
    scene, devices, claims = world
    up = np.array([0.0, 1.0, 0.0])
    below = look_at(np.array([0.0, 0.0, -1.1]), np.zeros(3), up=up)
    beneath = {"world_from_device": below, "world_from_ring": below}
    poses = (*devices.reference_projectors, replace(devices.projectors[0], **beneath))
    required = replace(scene.requirements, region_share=0.5, dominant_coverage=0.6)
    scene = make_scene(BALL, required, region=REGION)
    samples = scene.target_samples(replace(DRAWS.claims, count=1000))
    # No region is half of all; the grazed band and the far side are lit too little.
    records = tuple(
        record.changed(coverage=record.coverage.changed(floor=None))
        for record in _records(claims)
    )
    told = with_small_floor(records, CandidateSet.over(scene, samples, poses))
    assert [bool(record.coverage.relaxations) for record in told] == [False] * 3 + [
        True
    ]
    share = int(1e4 * _area(REGION == 3) / _area(REGION >= 0)) / 1e4
    # Light from below reaches the far side, but not three fifths of all.
    assert told[3].coverage.relaxations == (
        f"[requirements] region_share = {share:g} gives it a floor and takes "
        f"2 projectors of the candidates",
    )
    # Where fewer weren't refuted, that so many are enough is all that is said.
    found = SimpleNamespace(status=SolveStatus.FEASIBLE, selected=np.arange(2))
    monkeypatch.setattr(floor_relaxations, "fewest_of", lambda *_, **__: found)
    cut = with_small_floor(records, CandidateSet.over(scene, samples, poses))
    assert "takes at most 2 projectors" in cut[3].coverage.relaxations[0]


def test_a_relaxation_meets_the_floor_and_less_of_it_does_not(world):
    _, devices, claims = world
    records = with_floor_relaxations(
        _records(claims), claims.region_samples, RIG, devices
    )
    assert [bool(r.coverage.relaxations) for r in records] == [False] * 2 + [
        True,
        False,
    ]
    (words,) = (w for w in records[2].coverage.relaxations if "incidence" in w)
    value = float(re.search(r"max_incidence_deg = (\d+) \(now 60\)", words)[1])
    samples = claims.region_samples
    inside = samples.region == 2
    off = OFF[samples.target.samples.faces[inside]]
    reached = samples.by_projectors[inside].sum()
    assert (off <= value).sum() >= FLOOR * reached > (off <= value - 1.0).sum()


@pytest.fixture(scope="module")
def plan(handmade):
    """The plan of hand with a floor that region 0 misses; `up` is +y."""
    document = handmade.build_plan().to_document()
    document["requirements"]["region_coverage"] = 0.69
    document["regions"][0]["coverage"] |= {"floor": "missed", "relaxations": ["A = 3"]}
    document["certificates"]["projectors"]["needed"] = {"count": 5, "lower_bound": 4}
    return RigPlan.from_document(document, handmade.build_plan().surface)


def test_a_missed_floor_names_the_region_by_size_and_place(plan):
    (line,) = (one for one in shortfalls(plan) if "--region-coverage" in one)
    assert line.startswith("region 0 (65.1 cm², bottom third, towards +z, ")
    assert "mm above the lowest point, facing +z down) is lit 67.9 %" in line
    assert "69.0 % is required of each region" in line
    assert "Of it: 18.6 cm² outside the beam" in line
    for remedy in (
        "--max-projectors 5 (at least 4 claimed",
        "or with these projectors A = 3",
        "or --region-coverage 0.67 accepts this plan",
    ):
        assert remedy in line
    # What keeps cameras away isn't why it is dark.
    assert "sigma" not in line
    floor, worst = region_lines(plan)
    assert "1 of 2 meet the floor, 69.0 % of what can be lit" in floor
    assert "worst: region 0 (" in worst


def test_a_region_too_small_for_a_floor_that_would_miss_it_is_named(plan, handmade):
    small = handmade.tampered(
        plan,
        lambda document: document["requirements"].update(region_share=1.0),
    )
    (line,) = region_lines(small)
    assert "2 of 2 regions under 100.0 % of the target" in line
    assert "would miss it; the largest: region 0 (65.1 cm²" in line


def test_places_follow_up_and_the_axes_of_the_mesh(plan, handmade):
    up = handmade.tampered(
        plan,
        lambda document: document["requirements"]["workspace"].update(up=[0, 0, -1]),
    )
    words = region_words(up, up.document.regions[1])
    assert ", bottom third, towards +y, " in words
    assert words.endswith("facing down +y)")
    above = re.search(r"(\d+) mm above the lowest point", words)
    height = 1e3 * (0.05 - up.document.regions[1].centre_m[2])
    assert float(above[1]) == pytest.approx(height, abs=1.0)


def test_a_flat_object_has_no_thirds(plan):
    mesh = plan.surface.mesh
    level = TriangleMesh(mesh.vertices * [1.0, 0.0, 1.0], mesh.faces)
    flat = replace(plan, surface=replace(plan.surface, mesh=level))
    words = region_words(flat, plan.document.regions[0])
    assert words == "region 0 (65.1 cm², towards +z, facing +z down)"


def test_every_region_is_shown_on_demand(plan, handmade, tmp_path):
    path = handmade.save(plan, tmp_path)
    shown = CliRunner().invoke(commands, ["show", str(path), "--regions"])
    assert shown.exit_code == 0
    heading, *lines = shown.stdout.rstrip("\n").splitlines()
    assert heading.startswith("REGIONS: every region")
    assert lines == region_table(plan)
    first, second = lines[-2:]
    assert first.split()[:3] == ["0", "65.11", "72"]
    assert "missed" in first
    assert " met " in second
    as_json = CliRunner().invoke(commands, ["show", str(path), "--regions", "--json"])
    regions = json.loads(as_json.stdout)["regions"]
    assert regions == plan.to_document()["regions"]


def test_numbers_stand_on_their_regions_where_a_view_shows_them(plan):
    mesh, region = plan.surface.mesh, plan.surface.region
    caster = RayCaster(mesh)
    front, back = np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, -1.0])
    spots = region_spots(plan, caster, front)
    assert set(spots) == {0, 1}
    for number, points in spots.items():
        faces = [np.argmin(np.abs(mesh.face_centroids - p).sum(axis=1)) for p in points]
        assert set(region[faces]) == {number}
    assert region_spots(plan, caster, back) == {}
    assert direction_of_unseen(plan, spots) is None
    unseen = direction_of_unseen(plan, [0])
    assert unseen is not None
    assert np.allclose(
        unseen / np.linalg.norm(unseen), plan.document.regions[1].mean_normal
    )
    view = fitted(mesh.vertices, front, [0.0, 1.0, 0.0], (300, 300), margin_px=20.0)
    panel = Panel(Image.new("RGB", (300, 300)), view)
    panel.mark(spots[0], "7", size=9.0)
    panel.mark(spots[0], "8", size=9.0)
    (left, top, right, bottom), (a, b, c, d) = panel.taken
    assert right <= a or c <= left or bottom <= b or d <= top
    spot = view.project(spots[0][0])
    assert left <= spot[0] <= right
    assert top <= spot[1] <= bottom


@pytest.mark.parametrize(
    ("lit", "measured", "asked"),
    [(0.6, 1.0, "projector"), (1.0, 0.6, "camera"), (1.0, 1.0, None)],
)
def test_a_floor_that_fresh_samples_miss_asks_for_one_device_more(
    handmade, monkeypatch, lit, measured, asked
):
    def change(document):
        limits = document["requirements"]
        limits |= {"region_coverage": 0.7, "coverage": 0.1, "dominant_coverage": 0.1}
        areas = document["regions"][1]["coverage"]
        areas |= {"lit_m2": 0.006 * lit, "reachable_by_projectors_m2": 0.006}
        areas |= {"measured_m2": 0.003 * measured, "reachable_by_cameras_m2": 0.003}
        areas["floor"] = "met" if asked is None else "missed"

    plan = handmade.tampered(handmade.build_plan(), change)
    wanted: list[str] = []

    def larger(stage, *_):
        wanted.append(stage.kind)

    monkeypatch.setattr(stages, "larger", larger)
    partial = SimpleNamespace(
        surviving=None,
        stage=SimpleNamespace(kind="projector", projectors=()),
        camera_stage=SimpleNamespace(kind="camera"),
        cameras=(),
    )
    assert stages.one_device_more(partial, plan, Stopwatch()) is None
    assert wanted == ([] if asked is None else [asked])
