"""Plan files that no reader could compute with, or that two would read otherwise."""

import json

import pytest
from click.testing import CliRunner

from planning.cli.main import commands
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan


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
        ("surface.path", "a\0b", "must hold no control character"),
        ("surface.path", "a\nplan: fine", "must hold no control character"),
    ],
)
def test_what_none_can_compute_with_is_refused_in_a_line(
    plan, folder, tmp_path, place, value, fault
):
    assert fault in refused(folder, tmp_path, edited(plan, place, value))


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
