"""The main job in this process with few candidates: exit code, messages, plan."""

import json
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner

from planning.cli.main import commands
from planning.cli.plans import saved_plans
from planning.report.drawing.rig_picture import draw_rig

RIG = """
base = "default"
name = "few candidates"
[calibration]
angle_deg = 0.0
position_mm = 0.0
[placement]
n_candidate_projectors = 40
n_candidate_cameras = 40
n_reference_projectors = 600
n_reference_cameras = 400
"""

# The smallest there is: these runs are of plans.
_PICTURE = (800, 500)


@dataclass(frozen=True)
class Ended:
    """How a run ended.

    Attributes:
        code: Exit code.
        message: Standard error, in one line.
        lines: Lines of it.
        plan: Parsed plan.json; None if none was written.
    """

    code: int
    message: str
    lines: int
    plan: dict | None


def run(mesh: Path, folder: Path, words: Sequence[str] = ()) -> Ended:
    """Plan a mesh without the check from pixels; write into a folder."""
    rig = folder / "few.toml"
    rig.write_text(RIG)
    out = folder / "plan"
    command = ["--mesh", str(mesh), "--max-projectors", "3", "--rig", str(rig)]
    command += [
        "--no-check",
        "--no-report",
        "--no-patterns",
        "--quiet",
        "--threads",
        "1",
        "-o",
        str(out),
    ]
    # The paper's route takes a third of the time: where a test asks for it.
    command += [] if "--cameras-by" in words else ["--cameras-by", "cover"]
    command += words
    before = signal.getsignal(signal.SIGINT)
    try:
        # A bug would be reported as one line and 70: with --debug it is raised.
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(saved_plans, "draw_rig", partial(draw_rig, size=_PICTURE))
            result = CliRunner().invoke(commands, command)
    finally:
        signal.signal(signal.SIGINT, before)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    written = out / "plan.json"
    plan = json.loads(written.read_text()) if written.exists() else None
    said = result.stderr.strip()
    lines = len(said.splitlines())
    return Ended(result.exit_code, " ".join(said.split()), lines, plan)
