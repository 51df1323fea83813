"""Two plans side by side: what is the same, what isn't, and what only one says."""

import json

import pytest
from click.testing import CliRunner

from planning.cli.lines.comparison import compared, comparison_lines
from planning.cli.main import commands


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


def _by_name(rows):
    return {row.what: row for row in rows}


def test_a_plan_differs_in_nothing_from_itself(plan):
    rows = compared(plan, plan)
    assert not any(row.differs for row in rows)
    n_devices = len(plan.projectors) + len(plan.cameras)
    assert _by_name(rows)["devices at the same place"].first == str(n_devices)
    assert len({row.what for row in rows}) == len(rows)


def test_what_was_changed_is_what_is_marked(plan, handmade):
    def change(document):
        document["cameras"][0]["world_from_device"][0][3] += 1e-4
        document["requirements"]["coverage"] = 0.7
        document["coverage"]["target"]["measured_m2"] *= 0.9

    rows = _by_name(compared(plan, handmade.tampered(plan, change)))
    marked = {name for name, row in rows.items() if row.differs}
    assert {"measured, asked", "measured of the target"} <= marked
    assert not marked & {"mesh", "projectors", "cameras", "lit of what can be"}
    n_devices = len(plan.projectors) + len(plan.cameras)
    assert rows["devices at the same place"].first == str(n_devices - 1)
    areas = plan.coverage.target
    share = 90.0 * areas.measured_m2 / areas.area_m2
    assert rows["measured of the target"].second == f"{share:.1f} %"


def test_what_only_one_says_stands_beside_a_dash(plan, handmade):
    def unlimited(document):
        document["requirements"]["triangulation"]["max_sigma_m"] = None
        document["cost"]["frame_s"] = None

    rows = _by_name(compared(plan, handmade.tampered(plan, unlimited)))
    for name in ("sigma, asked [mm]", "seconds of a scan"):
        assert rows[name].second == "-"
        assert rows[name].differs


def test_the_table_lines_up_and_marks(plan, handmade):
    other = handmade.tampered(
        plan, lambda document: document["requirements"].update(coverage=0.7)
    )
    lines = comparison_lines(compared(plan, other), ("one", "two"))
    column = lines[0].index("one")
    assert all(line[column] != " " and line[column - 1] == " " for line in lines)
    assert [line for line in lines if line.startswith("*")]


def test_the_command_prints_both_and_refuses_what_is_no_plan(plan, handmade, tmp_path):
    sides = [str(tmp_path / name) for name in "ab"]

    def told(*words):
        return CliRunner().invoke(commands, ["compare", *sides, *words])

    for name in "ab":
        (tmp_path / name).mkdir()
        handmade.save(plan, tmp_path / name)
    assert "devices at the same place" in told().output
    found = json.loads(told("--json").output)
    assert len(found["plans"]) == 2
    assert {row["differs"] for row in found["rows"]} == {False}
    (tmp_path / "b" / "plan.json").write_text("{}")
    assert told().exit_code == 3
