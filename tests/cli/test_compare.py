"""Two plans side by side: what is the same, what isn't, and what only one says."""

import json

import pytest
from click.testing import CliRunner

from planning.cli.lines.comparison import compared, comparison_lines
from planning.cli.main import commands
from planning.model.document.request_records import RequestRecord


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


REQUEST = {
    "given": [],
    "max_projectors": 4,
    "max_cameras": None,
    "max_heads": None,
    "target": "dominant",
    "pattern": "rings",
    "dominant_coverage": 0.9,
    "coverage": 0.95,
    "min_reachable": 0.9,
    "region_coverage": 0.0,
    "accuracy_mm": None,
    "accuracy_of": "total",
    "up": "z",
    "ring_axis": "centred",
    "robust": None,
    "views": None,
    "survive": 0,
    "joint": False,
    "cameras_by": "both",
}
# What may be asked otherwise, and how it is told beside what `REQUEST` says.
OTHERWISE = {
    "max_projectors": (6, "projectors, at most", "4", "6"),
    "max_cameras": (8, "cameras, at most", "-", "8"),
    "max_heads": (2, "heads, at most", "-", "2"),
    "min_reachable": (0.5, "reachable, asked", "90 %", "50 %"),
    "region_coverage": (0.8, "of each region, asked", "0 %", "80 %"),
    "accuracy_of": ("noise", "sigma, asked of", "total", "noise"),
    "up": ("-x", "up", "z", "-x"),
    "ring_axis": ("free", "ring axis, asked", "centred", "free"),
    "robust": (0.8, "drawn rigs that meet it, asked", "-", "80 %"),
    "views": (3, "views, asked", "-", "3"),
    "survive": (1, "losses, asked", "0", "1"),
    "joint": (True, "sought jointly", "no", "yes"),
    "cameras_by": ("paper", "cameras by", "both", "paper"),
}


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


@pytest.mark.parametrize("key", OTHERWISE)
def test_what_else_was_asked_is_told_where_it_differs(plan, handmade, key):
    value, name, first, second = OTHERWISE[key]
    sides = [
        handmade.tampered(plan, lambda document, asked=asked: document.update(asked))
        for asked in ({"request": REQUEST}, {"request": REQUEST | {key: value}})
    ]
    rows = compared(*sides)
    (row,) = [row for row in rows if row.differs]
    assert (row.what, row.first, row.second) == (name, first, second)
    # Nothing is said of what neither plan's command changed.
    assert len(rows) == len(compared(plan, plan)) + 1


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("coverage", (0.9496, 0.9504), ("94.96 %", "95.04 %")),
        ("dominant_coverage", (0.57, 0.5701), ("57 %", "57.01 %")),
        ("max_sigma_m", (3.001e-4, 3.004e-4), ("0.3001", "0.3004")),
    ],
)
def test_what_is_asked_otherwise_doesn_t_look_alike(plan, handmade, name, values, told):
    def asked(value):
        def change(document):
            table = document["requirements"]
            table = table["triangulation"] if name == "max_sigma_m" else table
            table[name] = value

        return handmade.tampered(plan, change)

    rows = compared(*map(asked, values))
    assert told in [(row.first, row.second) for row in rows if row.differs]


def test_all_that_was_asked_is_told():
    """A new key of `request` has a row, or one of `requirements` that says the same."""
    elsewhere = {"given", "target", "pattern", "dominant_coverage", "coverage"}
    assert {*RequestRecord.model_fields} == {*OTHERWISE, *elsewhere, "accuracy_mm"}


def test_the_other_light_is_told(plan, handmade):
    rows = compared(plan, handmade.build_plan(light="parallel"))
    (row,) = [row for row in rows if row.what == "light"]
    assert (row.first, row.second) == ("diverging", "parallel")


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


def test_no_name_of_a_plan_wipes_out_lines(handmade, tmp_path):
    wiping = "cell\x1b[1A\x1b[2K\nnothing\x9b2K"
    plan = handmade.tampered(
        handmade.build_plan(), lambda d: d["rig"].update(name=wiping)
    )
    path = str(handmade.save(plan, tmp_path))
    ended = CliRunner().invoke(commands, ["compare", path, path])
    assert ended.exit_code == 0
    assert r"cell\x1b[1A" in ended.stdout
    assert all(line.isprintable() for line in ended.stdout.splitlines())
