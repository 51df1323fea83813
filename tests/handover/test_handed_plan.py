"""A plan in a designer's hands: tables, figures, itself in a notebook, errors."""

import ast
import builtins
import html
from dataclasses import fields, replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import planning
from planning.handover import plan_tables
from planning.handover.handed_plan import HandedPlan
from planning.handover.plots import PLOTS
from planning.model.plan import RequirementError, RigPlan
from planning.model.proofs import ProofFile

ROOT = Path(planning.__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def plan(handmade):
    return HandedPlan.of(handmade.build_plan())


@pytest.fixture
def rows(monkeypatch):
    """Tables as they are without pandas."""
    monkeypatch.setattr(plan_tables, "find_spec", lambda _: None)


def test_nothing_of_a_plan_is_lost_on_the_way(handmade):
    member = replace(handmade.build_plan(), proof=ProofFile.of({}))
    family = replace(member, members=(member,))
    handed = HandedPlan.of(family)
    for field in fields(RigPlan):
        if field.name != "members":
            assert getattr(handed, field.name) is getattr(family, field.name)
    assert handed.members[0].proof is member.proof


def test_devices_are_where_the_plan_has_them(plan, rows):
    every = (*plan.projectors, *plan.cameras)
    assert [row["id"] for row in plan.devices] == [device.id for device in every]
    for row, device in zip(plan.devices, every, strict=True):
        place = 1e-3 * np.array([row["x_mm"], row["y_mm"], row["z_mm"]])
        assert place == pytest.approx(device.world_from_device[:3, 3])
    assert plan.devices[0]["area_cm2"] == pytest.approx(
        1e4 * plan.document.projectors[0].lit_area_m2
    )


def test_coverage_and_regions_are_those_of_the_document(plan, rows):
    target, surface = plan.coverage_table
    assert target["measured_cm2"] == 1e4 * plan.coverage.target.measured_m2
    assert surface["area_cm2"] == 1e4 * plan.coverage.surface.area_m2
    assert [row["id"] for row in plan.regions_table] == [
        region.id for region in plan.document.regions
    ]
    areas = plan.document.regions[0].coverage
    lit = areas.lit_m2 / areas.reachable_by_projectors_m2
    assert plan.regions_table[0]["lit"] == pytest.approx(lit)


def test_tables_are_frames_where_pandas_is_there(plan):
    pandas = pytest.importorskip("pandas")
    assert isinstance(plan.devices, pandas.DataFrame)
    assert list(plan.devices["id"]) == [
        row.id for row in (*plan.projectors, *plan.cameras)
    ]


def test_it_shows_its_report_in_a_notebook_and_a_browser(plan, tmp_path, monkeypatch):
    shown, opened = plan._repr_html_(), []
    assert shown.startswith("<iframe ")
    page = html.unescape(shown.split('srcdoc="')[1].split('"')[0])
    monkeypatch.setattr("webbrowser.open", opened.append)
    path = plan.show(tmp_path / "mine.html")
    assert path.read_text(encoding="utf-8") == page
    assert opened == [path.as_uri()]


@pytest.mark.parametrize("what", PLOTS)
def test_every_figure_draws_on_the_axes_it_is_given(plan, what):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    axes = pyplot.figure().add_subplot()
    assert plan.plot(what, axes) is axes
    assert axes.get_xlabel()
    pyplot.close("all")


def test_figures_without_matplotlib_say_how_to_get_it(plan, monkeypatch):
    def missing(name, *args, **options):
        if name.startswith("matplotlib"):
            raise ImportError("No module named 'matplotlib'")
        return import_module(name)

    monkeypatch.setattr("planning.handover.plots.import_module", missing)
    with pytest.raises(ImportError, match=r"pip install 'ringrig\[plot\]'"):
        plan.plot()
    with pytest.raises(ValueError, match="plot 'nothing' is none of marginal"):
        plan.plot("nothing")


def test_plans_that_are_raised_or_loaded_are_in_this_form(
    plan, handmade, monkeypatch, tmp_path
):
    path = handmade.save(plan, tmp_path)
    assert type(planning.RigPlan.load(path)) is HandedPlan
    again = planning.RigPlan.load(path.parent)
    assert again.to_document() == planning.RigPlan.load(path).to_document()
    from planning.handover.planner import _handing

    def short():
        raise RequirementError(handmade.build_plan(), ("too little",))

    with pytest.raises(RequirementError, match="too little") as caught:
        _handing(short)()
    assert isinstance(caught.value.plan, planning.RigPlan)
    made = _handing(handmade.build_plan)()
    assert isinstance(made, planning.RigPlan)
    assert isinstance(made, RigPlan)


def test_numbers_of_arrays_are_plain_in_the_plan(handmade):
    from planning.handover.planner import _handing

    asked = {}
    _handing(lambda **options: asked.update(options) or handmade.build_plan())(
        max_projectors=np.arange(3)[2], coverage=np.float32(0.5), joint=np.False_
    )
    assert {type(value) for value in asked.values()} == {int, float, bool}


def test_every_error_that_planning_raises_is_exported():
    """But for those that say more of an exported one."""
    known = {name for name in dir(planning) if name.endswith("Error")}
    raised = set()
    for path in (ROOT / "planning").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                name = getattr(node.exc.func, "id", "")
                if name.endswith("Error") and not hasattr(builtins, name):
                    raised.add(name)
    special = {"NothingMeasuredError", "NothingLitError", "DarkError"}
    special |= {"MissingRendererError", "SceneError", "FrameError"}
    # The audit makes a finding of it.
    special |= {"RefutedProofError"}
    assert raised - known <= special
    for name in known:
        assert issubclass(getattr(planning, name), Exception)
