"""A time limit cuts whatever the main thread does, but for what must stay whole."""

import signal
import sys
import time

import pytest

from geometry.parallel import abandonable, abandoned, mapped
from planning.model.errors import TimeLimitError
from planning.model.progress import Cut, Stopwatch, untimed

pytestmark = pytest.mark.skipif(
    not hasattr(signal, "setitimer"), reason="no timers there"
)


def spin(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


def cut(work, time_limit=0.3):
    """Seconds until work is cut."""
    clock = Stopwatch(time_limit=time_limit)
    begin = time.monotonic()
    with pytest.raises(TimeLimitError), clock.ticking():
        work(clock)
    return time.monotonic() - begin


def test_what_never_looks_at_the_clock_is_cut():
    before = signal.getsignal(signal.SIGALRM)
    assert 0.3 <= cut(lambda _: spin(20.0)) < 5.0
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_cut_that_is_swallowed_comes_again():
    def swallows(_):
        try:
            spin(20.0)
        except Cut:
            spin(20.0)

    assert cut(swallows) < 8.0


def test_a_handler_of_errors_takes_no_cut_for_one_of_them():
    """A reader that calls whatever goes wrong a damaged file, say."""

    def reads(_):
        try:
            spin(20.0)
        except Exception as error:
            raise ValueError("damaged") from error

    assert cut(reads) < 5.0


def test_a_reserve_ends_planning_earlier_and_is_given_back():
    def plans(clock):
        clock.reserve(100.0)
        try:
            spin(20.0)
        except Cut:
            clock.extend()
            raise TimeLimitError(f"{clock.remaining:.0f} s left") from None

    clock = Stopwatch(time_limit=101.0)
    with pytest.raises(TimeLimitError, match=r"(9\d|100) s left"), clock.ticking():
        plans(clock)


def test_what_must_stay_whole_is_cut_afterwards():
    done = []

    def exchanges(_):
        with untimed():
            spin(1.0)
            done.append(True)
        spin(20.0)

    assert 1.0 <= cut(exchanges) < 6.0
    assert done == [True]


@pytest.mark.parametrize("reserved", [0.0, 100.0])
def test_imports_stay_whole_while_a_plan_is_to_be_written(
    tmp_path, monkeypatch, reserved
):
    """Without a reserve nothing follows a cut, and nothing waits for an import."""
    name = f"slow_to_import_{reserved:.0f}"
    (tmp_path / f"{name}.py").write_text(
        "import time\nend = time.monotonic() + 2.0\n"
        "while time.monotonic() < end:\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def imports(clock):
        clock.reserve(reserved)
        __import__(name)
        spin(20.0)

    spent = cut(imports, time_limit=reserved + 0.3)
    assert (spent >= 2.0) == (name in sys.modules) == (reserved > 0.0)


@pytest.mark.parametrize("name", ["concurrent/futures/thread.py", "casadi.py"])
def test_threads_and_solvers_are_left_whole(name):
    """A thread that its pool doesn't know of would be waited for without end."""
    code = "def busy():\n    spin(1.5)\n    done.append(True)\n"
    world = {"spin": spin, "done": []}
    exec(compile(code, f"/lib/{name}", "exec"), world)

    def begins(_):
        world["busy"]()
        spin(20.0)

    assert 1.5 <= cut(begins) < 6.0
    assert world["done"] == [True]


def test_without_a_limit_nothing_ticks():
    clock = Stopwatch()
    with clock.ticking():
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    clock.check()
    assert clock.remaining is None


@pytest.mark.long
def test_nobody_waits_for_work_that_was_cut():
    begin = time.monotonic()

    def fails():
        with abandonable(2) as pool:
            pool.submit(time.sleep, 2.0)
            raise TimeLimitError

    with pytest.raises(TimeLimitError):
        fails()
    assert time.monotonic() - begin < 1.5
    assert abandoned()
    with abandonable(2) as pool:
        assert list(pool.map(abs, [-1, -2])) == [1, 2]
    time.sleep(2.5)
    assert not abandoned()


def test_a_failure_begins_no_more_work():
    begun = []

    def work(item):
        begun.append(item)
        time.sleep(0.05)
        if item == 0:
            raise ValueError("first")

    with pytest.raises(ValueError, match="first"):
        mapped(work, range(200), threads=2)
    assert len(begun) < 20
