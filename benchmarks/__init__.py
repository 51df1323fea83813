"""Measurements; run from a checkout's root: `python -m benchmarks.plans.main_job`."""

import sys
from pathlib import Path

# What tests and benchmarks share is the package `support` there.
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
