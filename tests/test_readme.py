"""The README keeps its promises: its commands are there, its library code runs."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import planning

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_there_is_one_command_for_the_main_job_and_one_for_the_tests():
    lines = [line for line in README.splitlines() if line.startswith("python3 -m venv")]
    main_job, tests = lines
    assert main_job.endswith("plan --mesh face.obj --max-projectors 3")
    assert "pytest" in tests


def test_the_library_code_runs_as_printed(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.S)
    shutil.copy(ROOT / "face.obj", tmp_path)
    home = str(Path(planning.__file__).resolve().parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": home},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "True ()" in done.stdout


def test_every_document_that_is_linked_exists():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).exists(), target
