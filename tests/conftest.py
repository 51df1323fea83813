"""Fixtures that several test files share."""

import gc
import importlib
import os
import sys
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from threadpoolctl import threadpool_limits

# Files whose tests plan rigs or take long: begun first, so that no worker ends on one.
_LONGEST = (
    "pipeline",
    "captures",
    "cli",
    "cached_plans",
    "family_plans",
    "held_claims",
    "head_plans",
    "reconstruction_check",
    "obstacles",
    "flips",
    "evaluation",
    "audit_claims",
    "front_plans",
    "cell_bound",
    "camera_routes",
    "ranges",
    "existing",
    "invariance",
    "reconstruction_diagnosis",
    "exact_cover",
    "hollow",
)


def pytest_configure(config: pytest.Config) -> None:
    """Keep the order of the files below, where xdist would sort them by tests.

    And no cache: tests write nothing to a home, and patch what keys know nothing of.
    Workers share the cores already: with threads of their own they wait for each other.
    """
    os.environ["RINGRIG_CACHE"] = ""
    if hasattr(config, "workerinput"):
        vars(os)["sched_getaffinity"] = lambda _: {0}
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False


def pytest_collection_finish() -> None:
    """Look for garbage seldom, and not among modules and tests: those all stay."""
    gc.freeze()
    gc.set_threshold(20_000, 50, 50)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files."""
    places = {f"test_{name}": place for place, name in enumerate(_LONGEST)}
    items.sort(key=lambda item: places.get(item.path.stem, len(places)))


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> Generator[None]:
    """Leave BLAS one thread: workers that share the cores would wait for each other."""
    with threadpool_limits(1, user_api="blas"):
        yield


@pytest.fixture(scope="session", autouse=True)
def _stay() -> Generator[None]:
    """A run that was cut ends itself, not the process of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planning.cli.console.leave", sys.exit)
        yield


@pytest.fixture
def by_threads() -> Callable[[Callable[[], Any]], list[Any]]:
    """What a function returns with one BLAS thread, and with two."""

    def run(solve: Callable[[], Any]) -> list[Any]:
        answers = []
        for threads in (1, 2):
            with threadpool_limits(threads, user_api="blas"):
                answers.append(solve())
        return answers

    return run


@pytest.fixture(scope="session")
def handmade() -> ModuleType:
    """Plans made by hand, whose claims a slow loop over points computes."""
    return _load("handmade")


@pytest.fixture(scope="session")
def rigs() -> ModuleType:
    """Plans made by hand for the check from pixels."""
    return _load("reconstruction_rigs")


@pytest.fixture(scope="session")
def fuzzing() -> ModuleType:
    """Whole mesh files of every format, and how they are damaged."""
    return _load("fuzzing")


@pytest.fixture(scope="session")
def shared_meshes() -> ModuleType:
    """The table of the meshes that lie beside the repository."""
    return _load("shared_meshes")


@pytest.fixture(scope="session")
def set_cover_files() -> ModuleType:
    """The table of the published set covers that lie beside the repository."""
    return _load("set_cover_files")


@pytest.fixture(scope="session")
def curved_shapes() -> ModuleType:
    """Shapes with their exact curvatures."""
    return _load("curved_shapes")


@pytest.fixture(scope="session")
def small_job() -> ModuleType:
    """The main job in this process, with few candidates."""
    return _load("small_job")


@pytest.fixture(scope="session")
def cap_trees() -> ModuleType:
    """Trees of cells on a circle and a sphere, whose optimum is known."""
    return _load("cap_trees")


@pytest.fixture(scope="session")
def benchmark_module() -> Callable[[str], ModuleType]:
    """Loads a benchmark, such as `paper.ring_algebra`."""
    root = str(Path(__file__).resolve().parents[1])

    def load(name: str) -> ModuleType:
        # Behind the installed packages, which are what is tested.
        if root not in sys.path:
            sys.path.append(root)
        return importlib.import_module(f"benchmarks.{name}")

    return load


def _load(name: str) -> ModuleType:
    return importlib.import_module(f"support.{name}")


@pytest.fixture(scope="session")
def with_little_work() -> Callable[..., AbstractContextManager[None]]:
    """Few samples behind claims and confirmations, few poses, rough bounds.

    Other patches go inside: undone after it, they would bring its own back.
    """

    @contextmanager
    def little(*, every_pose: bool = False) -> Generator[None]:
        with pytest.MonkeyPatch.context() as patch:
            _load("little_work").work_little(patch, every_pose=every_pose)
            yield

    return little


@pytest.fixture
def least_work() -> Generator[None]:
    """All on few samples in one test, where plans are compared with each other."""
    with pytest.MonkeyPatch.context() as patch:
        _load("little_work").work_least(patch)
        yield


@pytest.fixture
def little_work(
    with_little_work: Callable[..., AbstractContextManager[None]],
) -> Generator[None]:
    """Little work in one test, where exactness isn't the question."""
    with with_little_work():
        yield
