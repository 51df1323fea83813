"""Measurements; run from a checkout's root: `python -m benchmarks.plans.main_job`."""

import os
import sys
from pathlib import Path

# What tests and benchmarks share is the package `support` there.
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
# What is timed is computed, and not found where an earlier run left it.
os.environ["RINGRIG_CACHE"] = ""
