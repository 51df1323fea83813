"""Plan files that no reader could compute with, or that two would read otherwise."""

import json

import pytest
from click.testing import CliRunner

from planning.cli.main import commands
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.verify.verification import verify_plan


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


@pytest.fixture(scope="module")
def folder(plan, handmade, tmp_path_factory):
    return handmade.save(plan, tmp_path_factory.mktemp("whole")).parent


def refused(folder, tmp_path, text):
    """Return the one line with which a plan of this text is refused."""
    (tmp_path / "surface.npz").write_bytes((folder / "surface.npz").read_bytes())
    path = tmp_path / "plan.json"
    path.write_text(text)
    with pytest.raises(PlanFileError) as caught:
        RigPlan.load(path)
    result = CliRunner().invoke(commands, ["verify", str(path)])
    assert result.exit_code == 3
    (line,) = str(caught.value).splitlines()
    return line


def edited(plan, place, value):
    document = part = plan.to_document()
    *way, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    for key in way:
        part = part[key]
    part[last] = value
    return json.dumps(document)


@pytest.mark.parametrize(
    ("place", "value", "fault"),
    [
        ("coverage.samples", 10**400, "should be 2^53 in size at most"),
        ("certificates.cameras.needed.count", 2**64, "should be 2^53 in size"),
        ("regions.0.n_faces", 2**53 + 1, "should be 2^53 in size at most"),
        ("cameras.0.resolution.0", -(2**60), "should be 2^53 in size at most"),
        ("cameras.0.resolution.0", 2**40, "less than or equal to 100000"),
        ("cameras.0.resolution", [100_000, 4_001], "must be 400000000 pixels at most"),
        ("requirements.coverage", 1e308, "should be 1e+100 in size at most"),
        ("requirements.coverage", -1e308, "should be 1e+100 in size at most"),
        ("regions.0.area_m2", 1e101, "should be 1e+100 in size at most"),
        ("cameras.0.K.0.0", 1e308, "should be 1e+100 in size at most"),
        ("cameras.0.K.0.0", -900.0, "must hold focal lengths above 0"),
        ("cameras.0.distortion.0", 1e308, "should be 1e+100 in size at most"),
        ("rig.notes", [1e308], "rig.notes.0 = 1e+308 should be 1e+100 in size"),
        ("coverage.target.lit_m2", float("inf"), "should be a finite number"),
        ("regions.0.mean_curvedness", -0.5, "greater than or equal to 0"),
        ("regions.0.lit_fraction", -1e-3, "greater than or equal to 0"),
        ("surface.curvature_radius_m", -0.01, "greater than or equal to 0"),
        ("version", True, "version True, this program reads 1"),
        ("version", 1.0, "version 1.0, this program reads 1"),
        ("members.0.path", "a\0b", "must hold no control character"),
        ("members.0.path", "a\nplan: fine", "must hold no control character"),
        ("surface.path", "../surface.npz", "should be 'surface.npz'"),
        ("surface.path", "/etc/passwd", "should be 'surface.npz'"),
        ("members.0.name", "..", "must be the name of a folder"),
        ("members.0.name", "../../head", "must be the name of a folder"),
        ("members.0.name", "a\\b", "must be the name of a folder"),
    ],
)
def test_what_none_can_compute_with_is_refused_in_a_line(
    plan, folder, tmp_path, place, value, fault
):
    assert fault in refused(folder, tmp_path, edited(plan, place, value))


def test_a_family_among_its_own_members_is_refused_when_it_is_met(
    plan, handmade, tmp_path
):
    """Its folder leads back to it, as a link does: it would be read 2^40 times."""
    bound = {"member": 0, "count": 1, "lower_bound": 1}
    count = {"count": 1, "needed": 1, "lower_bound": 1, "n_candidates": 1}
    count |= {"n_samples": 1, "proof": "", "hardest": bound}
    family = {"align": "given", "quantile": 1.0, "n_asked": 2, "worst": 0}
    family |= {"projectors": count, "cameras": count}

    def of_itself(document):
        (member,) = document["members"]
        named = {name: f"members/{name}/plan.json" for name in ("a", "b")}
        document["members"] = [
            member | {"name": name, "path": path} for name, path in named.items()
        ]
        document["family"] = family

    handmade.save(handmade.tampered(plan, of_itself), tmp_path)
    (tmp_path / "members").mkdir()
    for name in ("a", "b"):
        (tmp_path / "members" / name).symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(PlanFileError, match=r"a/plan\.json: a member is a family"):
        RigPlan.load(tmp_path / "plan.json")


ZONE = {"name": "press", "centre_mm": [0, 0, 0], "turn_deg": [0, 0, 0]}
PLANE = {"name": "wall", "centre_mm": [0, 0, 0], "normal": [0, 0, 1]}
PLANE |= {"extent_mm": [1, 1], "thickness_mm": 10}
CODE = {"shifts": 4, "period_px": 16, "phase_noise_deg": 1}


@pytest.mark.parametrize(
    ("table", "value", "fault"),
    [
        ("dense", [1], "rig.dense = [1] should be an object"),
        ("dense", {"shifts": 4}, "dense.period_px is missing"),
        ("dense", CODE | {"phase_noise_deg": "1"}, "'1' should be a valid number"),
        ("dense", CODE | {"period_px": 17}, "period_px = 17 must be a power of two"),
        ("photometry", {"gain_db": "3"}, "photometry.quantum_efficiency is missing"),
        ("calibration", {"angle_deg": True}, "angle_deg = True should be a valid"),
        ("rings", {"margin_m": None}, "rings.margin_m = None should be a valid"),
        ("workspace", {"axis": [0, 0, 0]}, "axis = [0, 0, 0] should be a direction"),
        ("workspace", {"keep_out": 5}, "keep_out = 5 should be a valid array"),
        ("workspace", {"keep_out": [ZONE]}, "keep_out.0.size_mm is missing"),
        ("workspace", {"min_mm": [0, 0, 0]}, "should have min_mm and max_mm"),
        ("workspace", {"mounting": "x"}, "mounting = 'x' should be a valid array"),
        ("workspace", {"mounting": [{}]}, "mounting.0.name is missing"),
        (
            "workspace",
            {"mounting": [PLANE | {"along": "abc"}]},
            "mounting.0.along = 'abc' should be a valid array",
        ),
        (
            "workspace",
            {"mounting": [PLANE | {"normal": [0, 0, 0]}]},
            "mounting.0.normal = [0, 0, 0] should be a direction",
        ),
    ],
)
def test_rig_tables_that_none_can_compute_with_are_refused_in_a_line(
    plan, folder, tmp_path, table, value, fault
):
    line = refused(folder, tmp_path, edited(plan, f"rig.{table}", value))
    assert fault in line


@pytest.mark.parametrize("kind", ["projectors", "cameras"])
def test_a_plan_of_no_device_is_not_verified(plan, handmade, kind):
    bare = handmade.tampered(plan, lambda document: document.update({kind: []}))
    with pytest.raises(PlanFileError, match=rf"{kind} = \[\]: nothing can be"):
        verify_plan(bare, check_pixels=False)


def test_many_even_rings_are_refused_before_they_fill_the_memory(plan, handmade):
    rings = {"spacing": "uniform", "kept_even": False, "gap_m": None}
    rings |= {"over_tolerance": 0.0, "creases": {"length_m": 0.0, "max_error_m": 0.0}}

    def ringed(n):
        return lambda d: d["projectors"][0].update(rings=rings | {"n_even": n})

    assert handmade.tampered(plan, ringed(10_000)).document.projectors[0].rings
    with pytest.raises(PlanFileError, match=r"rings\.n_even = 10001 should be less"):
        handmade.tampered(plan, ringed(10_001))


@pytest.mark.parametrize("key", ["seed", "projectors"])
def test_a_key_that_stands_twice_is_refused(plan, folder, tmp_path, key):
    text = json.dumps(plan.to_document())
    twice = text.replace(f'"{key}": ', f'"{key}": 99, "{key}": ', 1)
    assert f"key '{key}' stands twice" in refused(folder, tmp_path, twice)


def test_a_seed_may_be_of_any_size(plan, handmade):
    seeded = handmade.tampered(plan, lambda d: d.update(seed=2**70))
    assert seeded.document.seed == 2**70
