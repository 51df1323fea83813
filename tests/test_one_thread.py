"""BLAS keeps to one thread while a solver runs, and gets its own back after."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from solvers import CoverProblem, counts, solve_cover
from solvers.one_thread import on_one_thread


def blas_threads():
    return {
        lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"
    }


def test_one_thread_inside_and_as_many_as_before_after():
    with threadpool_limits(2, user_api="blas"):
        # A library that knows no threads keeps to one.
        before = blas_threads()
        assert 2 in before
        assert on_one_thread(blas_threads)() == {1}
        assert blas_threads() == before
        with pytest.raises(ZeroDivisionError):
            on_one_thread(lambda: 1 // 0)()
        assert blas_threads() == before


def test_covers_are_solved_on_one(monkeypatch):
    seen = []
    plain = counts.greedy

    def noting(*given, **named):
        seen.append(blas_threads())
        return plain(*given, **named)

    monkeypatch.setattr(counts, "greedy", noting)
    with threadpool_limits(2, user_api="blas"):
        solve_cover(CoverProblem(np.eye(4, dtype=bool), min_coverage=0.5))
    assert seen
    assert all(threads == {1} for threads in seen)
