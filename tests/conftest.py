"""Fixtures that several test files share."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def handmade() -> ModuleType:
    """Plans made by hand, whose claims a slow loop over points computes."""
    path = Path(__file__).with_name("handmade.py")
    spec = importlib.util.spec_from_file_location("ringrig_tests_handmade", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
