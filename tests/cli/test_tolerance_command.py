import json
from dataclasses import replace

import pytest
from click.testing import CliRunner
from support.little_work import draw_fewer

from planning.cli.declared.tolerance_declared import Quantities, tolerance
from planning.cli.main import commands
from planning.model.plan import RigPlan

_BOUND = {"member": 0, "count": 2, "lower_bound": 2}
_COUNT = {"count": 2, "needed": 2, "lower_bound": 2, "n_candidates": 9, "n_samples": 9}
_COUNT |= {"proof": "", "hardest": _BOUND}
FAMILY = {"align": "given", "quantile": 1.0, "n_asked": 2, "worst": 0}
FAMILY |= {"projectors": _COUNT, "cameras": _COUNT}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--mount", "2"], "has no unit"),
        (["--mount", "2mm,0.2"], "'0.2' has no unit, must be one of um, mm"),
        (["--mount", "2inch"], "the unit 'inch'"),
        (["--mount", "-2mm"], "'-2mm' must be 0 or more"),
        (["--mount", "nanmm"], "isn't a number with a unit"),
        (["--mount", "1e999mm"], "must be 0 or more"),
        (["--mount", "1mm,2um"], "says position twice"),
        (["--mount", "0.5%"], "the unit '%'"),
        (["--mount", ""], "write 2mm,0.2deg"),
        (["--focal", "1mm"], "write 0.5%"),
        (["--focal", "150%"], "'150%' must be at most 10 %"),
        (["--calibrated", "0.05mm,"], "write 0.05mm,0.01deg"),
        (["--draws", "0"], "0 is not in the range"),
        (["--quantile", "95"], "did you mean 95%?"),
    ],
)
def test_values_without_a_meaning_are_refused(options, words):
    result = CliRunner().invoke(tolerance, ["plan.json", *options])
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())


def test_quantities_are_in_metres_radians_and_shares():
    kinds = {"position": {"mm": 1e-3, "um": 1e-6}, "angle": {"deg": 0.5}}
    read = Quantities("", **kinds).convert("0.1deg, 20 um", None, None)
    assert read == {"angle": pytest.approx(0.05), "position": pytest.approx(2e-5)}
    assert Quantities("", **kinds).convert("1e-1mm", None, None) == {"position": 1e-4}


def test_a_plan_file_becomes_a_verdict(handmade, tmp_path, monkeypatch):
    draw_fewer(monkeypatch, region_claims=30)

    def few(document):
        document["coverage"]["samples"] = 100

    plan = handmade.tampered(handmade.build_plan(), few)
    path = handmade.save(plan, tmp_path)
    options = ["--mount", "0.5mm,0.05deg", "--draws", "3", "--json"]
    words = ["tolerance", str(path), *options, "--threads", "1", "--quiet"]
    results = [CliRunner().invoke(commands, words) for _ in range(2)]
    found = json.loads(results[0].stdout)
    assert results[0].stdout == results[1].stdout
    assert results[0].exit_code == (0 if found["passed"] else 1)
    assert found["n_drawn"] == 3
    assert found["mounting"]["position_m"] == 5e-4
    assert (tmp_path / "tolerance.json").exists()
    rig = CliRunner().invoke(commands, ["tolerance", str(tmp_path / "no.json")])
    assert rig.exit_code == 3


def test_a_family_is_refused_and_its_members_named(handmade, tmp_path, monkeypatch):
    """Rigs were drawn for the worst member, and "every requirement" was said of it."""
    plan = handmade.build_plan()
    family = replace(plan, document=plan.document.changed(family=FAMILY))
    monkeypatch.setattr(RigPlan, "load", lambda path: family)
    ended = CliRunner().invoke(commands, ["tolerance", str(tmp_path), "--draws", "3"])
    assert ended.exit_code == 3
    (line,) = ended.stderr.splitlines()
    assert "(members/NAME)" in line
    assert not [*tmp_path.iterdir()]
