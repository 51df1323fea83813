"""BLAS keeps to one thread while a solver runs, and gets its own back after."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from solvers import CoverProblem, solve_cover
from solvers.covers import counts
from solvers.one_thread import on_one_thread


def blas_threads():
    """Of the libraries that solvers use; another test may have loaded OpenCV's."""
    return {
        lib["num_threads"]
        for lib in threadpool_info()
        if lib["user_api"] == "blas" and "opencv" not in lib["filepath"]
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


_OVERLAPPING = """
from threading import Barrier, Event, Thread
import numpy
from threadpoolctl import threadpool_info
from solvers.one_thread import on_one_thread

def blas_threads():
    return {i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas"}

began, ended, seen = Barrier(2), Event(), [blas_threads()]

def first():
    began.wait()

def second():
    began.wait()
    ended.wait()
    seen.append(blas_threads())

threads = [Thread(target=on_one_thread(run)) for run in (first, second)]
for thread in threads:
    thread.start()
threads[0].join()
ended.set()
threads[1].join()
print(seen, seen[0] == blas_threads())
"""


def test_overlapping_solvers_leave_what_they_found():
    """The first to begin ends before the other: it must not reset the number."""
    done = subprocess.run(
        [sys.executable, "-c", _OVERLAPPING],
        cwd=Path(__file__).resolve().parents[2],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "[{2}, {1}] True"


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
