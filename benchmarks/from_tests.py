"""Modules of the tests that benchmarks share: tables and shapes with known truth."""

import importlib
import sys
from pathlib import Path
from types import ModuleType

TESTS = Path(__file__).resolve().parents[1] / "tests"


def load(name: str) -> ModuleType:
    """Return a module of `tests/support`, or a test file, by its name."""
    folder = "support"
    if name.startswith("test_"):
        folder = next(TESTS.rglob(f"{name}.py")).parent.relative_to(TESTS).as_posix()
    if str(TESTS) not in sys.path:
        sys.path.insert(0, str(TESTS))
    return importlib.import_module(f"{folder.replace('/', '.')}.{name}")
