"""What a status claims, and that budgets count."""

import contextlib
import signal

import pytest

from solvers.status import SolveStatus, WorkBudget, interruptible


def test_only_points_that_hold_count_as_points():
    assert {s for s in SolveStatus if s.has_point} == {
        SolveStatus.OPTIMAL,
        SolveStatus.LOCALLY_OPTIMAL,
        SolveStatus.FEASIBLE,
    }


def test_every_status_is_also_a_sentence():
    sentences = [s.value for s in SolveStatus]
    assert len(set(sentences)) == len(sentences)
    assert all(len(s.split()) >= 2 for s in sentences)


def test_work_of_a_part_counts_for_the_whole():
    whole = WorkBudget(100.0)
    part = whole.part(60.0)
    part.spend(59.0)
    assert not part.exhausted
    part.spend(1.0)
    assert part.exhausted
    assert whole.remaining == 40.0
    assert whole.part(1e9).units == 40.0
    assert whole.reason == "work budget"


def test_clock_cuts_parts_too():
    whole = WorkBudget(1e9, time_limit=0.0)
    assert whole.part(10.0).exhausted
    assert whole.reason == "time limit"
    assert whole.time_left <= 0.0


@pytest.mark.parametrize("bad", [-1.0, float("nan")])
def test_bad_limits_are_refused(bad):
    with pytest.raises(ValueError, match="work budget is"):
        WorkBudget(bad)
    with pytest.raises(ValueError, match="time limit is"):
        WorkBudget(1.0, time_limit=bad)


def test_a_ctrl_c_that_casadi_took_is_raised_again():
    """Swallowed inside, as CasADi does, it comes out at the end."""

    def solve(interrupted):
        with interruptible(), contextlib.suppress(KeyboardInterrupt):
            if interrupted:
                signal.raise_signal(signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        solve(interrupted=False)
        with pytest.raises(KeyboardInterrupt):
            solve(interrupted=True)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
