"""Plans that are tightened until enough drawn rigs meet what was asked."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from planning.model.calibration_errors import Mounting, Robust
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.report.partial_plan import PlanRequest
from planning.report.summary.robust_lines import robust_lines
from planning.report.summary.shortfall import shortfalls
from planning.report.tolerance import robust as robust_module
from planning.report.tolerance.asked import Asked, Figures, as_asked
from planning.report.tolerance.robust import least_met, robustly
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
        self._figures = figures

    def of(self, plan, **_):
        return SimpleNamespace(shared=lambda: plan)

    def _draw(self, plan, question, rigs, **_):
        deviates = [np.random.default_rng(k).standard_normal() for k in rigs]
        return [self._figures(plan.requirements, u) for u in deviates]

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
        if wishes.coverage is not None and wishes.coverage > 0.98:
            raise InfeasibleLimitsError("there is no such place")
        document = self.plan.document.changed(
            requirements=replace(required, **changes),
            truncated=self.cut_at == len(self.wishes),
        )
        return replace(self.plan, document=document), SimpleNamespace(
            request=SimpleNamespace(threads=1)
        )

    def made(self, **wishes):
        rig, asked = load_rig("default"), Wishes(max_projectors=2, **wishes)
        request = PlanRequest(self.plan.surface.mesh, rig, asked)
        return robustly(self)(request, Stopwatch(), None)[0]


@pytest.fixture
def plan(handmade):
    return handmade.build_plan()


def test_accuracy_and_shares_are_tightened_until_the_quantile_holds(plan, monkeypatch):
    def figures(required, u):
        sigma = required.triangulation.max_sigma_m
        return replace(
            _GOOD, rms_m=sigma * (0.9 + 0.1 * u), coverage=required.coverage + 0.01 * u
        )

    planner = _Planner(plan, monkeypatch, figures)
    made = planner.made(robust=0.9)
    record, required = made.document.robust, made.requirements
    assert record.n_met >= record.least == least_met(0.9, 400)
    assert record.n_met_without < 0.9 * record.n_drawn
    assert 1 <= record.rounds == len(planner.wishes) - 1 <= 5
    before = plan.requirements
    assert required.coverage - before.coverage == pytest.approx(0.019, abs=0.005)
    ratio = required.triangulation.max_sigma_m / before.triangulation.max_sigma_m
    assert 0.85 < ratio < 0.97
    assert Asked.of(required) == Asked.of(before)
    assert shortfalls(made) == shortfalls(plan)
    lines = " ".join(robust_lines(made))
    assert f"{record.n_met} of 400 drawn rigs meet what is asked" in lines
    assert "no device more" in lines


def test_a_robust_plan_is_left_as_it_is(plan, monkeypatch):
    planner = _Planner(plan, monkeypatch, lambda required, u: _GOOD)
    made = planner.made(robust=0.95)
    assert len(planner.wishes) == 1
    assert made.document.robust.rounds == 0
    assert made.requirements.coverage == plan.requirements.coverage
    assert not planner.made().document.robust


def test_a_round_that_is_cut_leaves_the_plan_before_it(plan, monkeypatch):
    planner = _Planner(
        plan, monkeypatch, lambda required, u: replace(_GOOD, coverage=0.1)
    )
    planner.cut_at = 2
    made = planner.made(robust=0.95)
    assert made.document.truncated
    assert made.requirements.max_cameras == plan.requirements.max_cameras
    assert len(planner.wishes) == 2


def test_what_can_t_be_tightened_is_told(plan, monkeypatch):
    def figures(required, u):
        return replace(_GOOD, coverage=0.5 * required.coverage)

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
