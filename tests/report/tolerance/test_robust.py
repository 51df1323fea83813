"""Plans that are tightened until enough drawn rigs meet what was asked."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom, norm

from planning.model.devices.calibration_errors import Mounting, Robust
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.report.partial_plan import PlanRequest
from planning.report.summary.brief import brief
from planning.report.summary.shortfall import shortfalls
from planning.report.tolerance import robust as robust_module
from planning.report.tolerance.asked import Asked, Figures, as_asked
from planning.report.tolerance.robust import least_met, robustly
from planning.report.tolerance.robust_lines import robust_lines
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes

_GOOD = Figures(1.0, 1.0, 1.0, 1.0, 0.0, 0.0)


@pytest.mark.parametrize("quantile", [0.5, 0.9, 0.95, 0.99])
def test_so_many_rigs_leave_little_doubt(quantile):
    for n in (60, 400):
        least = least_met(quantile, n)
        assert binom.sf(least - 1, n, quantile) <= 0.05 or least == n
        assert binom.sf(least - 2, n, quantile) > 0.05


def test_tightened_requirements_don_t_change_what_was_asked(handmade):
    required = handmade.build_plan().requirements
    asked = Asked.of(required)
    robust = Robust(
        *(0.9, Mounting(), required.dominant_coverage, required.coverage),
        *(required.region_coverage, required.triangulation.max_sigma_m),
    )
    limits = replace(required.triangulation, max_sigma_m=1e-6)
    tight = replace(
        required, coverage=0.99, dominant_coverage=0.99, triangulation=limits
    )
    assert Asked.of(tight) != asked
    assert Asked.of(replace(tight, robust=robust)) == asked
    assert as_asked(replace(tight, robust=robust)).triangulation.max_sigma_m == (
        required.triangulation.max_sigma_m
    )


class _Planner:
    """Plans whose rigs' figures follow what they are planned for."""

    def __init__(self, plan, patch, figures):
        self.plan, self.wishes, self.cut_at = plan, [], 0
        patch.setattr(robust_module, "BuiltCase", self)
        patch.setattr(robust_module, "draw", self._draw)
        patch.setattr(robust_module, "surer", self._surer)
        patch.setattr(robust_module, "larger", lambda *_: None)
        patch.setattr(robust_module, "write_plan", lambda partial, clock: partial.plan)
        self._figures, self.aims, self.drawn = figures, [], []

    def of(self, plan, **_):
        return SimpleNamespace(shared=lambda: plan)

    def _draw(self, plan, question, rigs, **_):
        self.drawn.append(rigs)
        deviates = [np.random.default_rng(k).standard_normal() for k in rigs]
        aim = self.aims[-1] if self.aims else None
        return [self._figures(plan.requirements, aim, u) for u in deviates]

    def _surer(self, partial, aim, clock):
        if self.aims and aim == self.aims[-1]:
            return None
        self.aims.append(aim)
        return partial

    def __call__(self, request, clock, keep):
        self.wishes.append(wishes := request.wishes)
        required = self.plan.requirements
        changes = {
            name: value
            for name in ("coverage", "dominant_coverage", "region_coverage")
            if (value := getattr(wishes, name)) is not None
        }
        if wishes.accuracy_mm is not None:
            sigma = 1e-3 * wishes.accuracy_mm
            limits = replace(required.triangulation, max_sigma_m=sigma)
            changes["triangulation"] = limits
        if self.cut_at == len(self.wishes):
            changes["max_cameras"] = 7
        if (wishes.dominant_coverage or 0.0) > 0.98 and not self.cut_at:
            raise InfeasibleLimitsError("there is no such place")
        document = self.plan.document.changed(
            requirements=replace(required, **changes),
            truncated=self.cut_at == len(self.wishes),
        )
        plan = replace(self.plan, document=document)
        request = replace(request, threads=1)
        # No cover has one projector more, unless a test says so.
        stage = SimpleNamespace(projectors=plan.projectors)
        return plan, SimpleNamespace(request=request, plan=plan, stage=stage)

    def made(self, **wishes):
        rig, asked = load_rig("default"), Wishes(max_projectors=2, **wishes)
        request = PlanRequest(self.plan.surface.mesh, rig, asked)
        return robustly(self)(request, Stopwatch(), None)[0]


@pytest.fixture
def plan(handmade):
    return handmade.build_plan()


def test_cameras_are_aimed_lower_until_the_quantile_holds(plan, monkeypatch):
    sigma = plan.requirements.triangulation.max_sigma_m
    # Of the plans one after the other: what is predicted, and how much is measured.
    predicted, seen = [sigma], [0.0]

    def figures(required, aim, u):
        if aim is not None and len(predicted) == len(planner.aims):
            scale = predicted[-1] / aim.drawn_m
            predicted.append(aim.rms_m * scale if aim.drawn_m > sigma else sigma)
            seen.append(seen[-1] + aim.more)
        # Drawn errors are a tenth larger than predicted.
        rms = 1.1 * predicted[-1] * (1.0 + 0.03 * u)
        return replace(
            _GOOD, rms_m=rms, coverage=required.coverage + 0.01 * u + seen[-1]
        )

    planner = _Planner(plan, monkeypatch, figures)
    made = planner.made(robust=0.9)
    record = made.document.robust
    assert record.n_met >= record.least == least_met(0.9, 1200)
    assert record.n_met_without < 0.9 * record.n_drawn
    assert 1 <= record.rounds == len(planner.aims) <= 5
    assert len(planner.wishes) == 1
    assert planner.aims[0].quantile == record.least / 1200
    assert all(aim.rms_m == sigma for aim in planner.aims)
    assert 0.85 * sigma < predicted[-1] < sigma / 1.1
    assert 0.01 < seen[-1] < 0.04
    # No rig confirms a plan that was made for it.
    assert len({k for rigs in planner.drawn for k in rigs}) == 1200 * len(planner.drawn)
    assert record.missed_by_without["coverage"] > 300
    lines = " ".join(robust_lines(made))
    met = f"{record.n_met} of 1200 drawn rigs meet what is asked"
    assert met in lines
    assert f"ROBUST   {met}" in brief(made, (), ())
    assert "no device more" in lines
    assert "miss measured / reachable by cameras" in lines


def test_what_projectors_light_is_required_tighter(plan, monkeypatch):
    planner = _Planner(
        plan,
        monkeypatch,
        lambda required, aim, u: replace(
            _GOOD, lit=required.dominant_coverage + 0.01 * u
        ),
    )
    made = planner.made(robust=0.9)
    record, required = made.document.robust, made.requirements
    assert record.n_met >= record.least
    assert 1 <= record.rounds == len(planner.wishes) - 1
    before = plan.requirements
    more = required.dominant_coverage - before.dominant_coverage
    assert more == pytest.approx(0.01 * norm.ppf(record.least / 1200), abs=0.002)
    assert Asked.of(required) == Asked.of(before)
    assert shortfalls(made) == shortfalls(plan)
    assert "planned for lit" in " ".join(robust_lines(made))


def test_a_projector_more_where_cameras_cost_much(plan, monkeypatch):
    sigma = plan.requirements.triangulation.max_sigma_m
    least, cameras, n = [], 2 * len(plan.cameras), len(plan.projectors)

    def figures(required, aim, u):
        # The projectors' errors, which a camera doesn't average.
        return replace(_GOOD, rms_m=sigma * (0.5 if least[-1] else 1.1))

    planner = _Planner(plan, monkeypatch, figures)

    def planned(request, clock, keep):
        least.append(request.least_projectors)
        return planner(request, clock, keep)

    def surer(partial, aim, clock):
        return SimpleNamespace(**(vars(partial) | {"cameras": (None,) * cameras}))

    def larger(stage, present, allowed):
        return stage if allowed > len(present) else None

    monkeypatch.setattr(robust_module, "surer", surer)
    monkeypatch.setattr(robust_module, "larger", larger)
    rig, wishes = load_rig("default"), Wishes(max_projectors=n + 1, robust=0.9)
    request = PlanRequest(plan.surface.mesh, rig, wishes)
    few, _ = robustly(planned)(request, Stopwatch(), None)
    assert (few.document.robust.n_met, least) == (0, [0])
    cameras += 1
    made, _ = robustly(planned)(request, Stopwatch(), None)
    record = made.document.robust
    assert (record.n_met, record.rounds, least) == (1200, 1, [0, 0, n + 1])
    none_left = replace(request, wishes=replace(wishes, max_projectors=n))
    robustly(planned)(none_left, Stopwatch(), None)
    assert not least[-1]


def test_a_robust_plan_is_left_as_it_is(plan, monkeypatch):
    planner = _Planner(plan, monkeypatch, lambda required, aim, u: _GOOD)
    made = planner.made(robust=0.95)
    assert len(planner.wishes) == 1
    assert made.document.robust.rounds == 0
    assert made.requirements.coverage == plan.requirements.coverage
    assert not planner.made().document.robust


def test_a_round_that_is_cut_leaves_the_plan_before_it(plan, monkeypatch):
    planner = _Planner(
        plan, monkeypatch, lambda required, aim, u: replace(_GOOD, lit=0.1)
    )
    planner.cut_at = 2
    made = planner.made(robust=0.95)
    assert made.document.truncated
    assert made.requirements.max_cameras == plan.requirements.max_cameras
    assert len(planner.wishes) == 2


def test_what_can_t_be_tightened_is_told(plan, monkeypatch):
    def figures(required, aim, u):
        return replace(_GOOD, lit=0.5 * required.dominant_coverage)

    planner = _Planner(plan, monkeypatch, figures)
    made = planner.made(robust=0.95)
    assert made.document.robust.n_met == 0
    (sentence,) = set(shortfalls(made)) - set(shortfalls(plan))
    assert "drawn rigs meet what is asked" in sentence


def test_a_rig_must_state_what_is_drawn(tmp_path):
    path = tmp_path / "rig.toml"
    wishes = Wishes(max_projectors=1, robust=0.95)
    perfect = "[calibration]\nangle_deg = 0.0\nposition_mm = 0.0\n"
    for more, words in (
        (perfect, "states neither"),
        (perfect + "[mounting]\nangle_deg = 0.1", ""),
    ):
        path.write_text(f'base = "default"\nname = "R"\n{more}\n')
        rig = load_rig(path)
        if words:
            with pytest.raises(ValueError, match=words):
                rig.requirements(np.zeros(3), 0.1, wishes, tau_m=1e-3)
        else:
            rig.requirements(np.zeros(3), 0.1, wishes, tau_m=1e-3)
            assert rig.table.mounting.bounds().angle == pytest.approx(np.radians(0.1))
            assert rig.to_document()["mounting"]["angle_deg"] == 0.1
