"""The README keeps its promises; `test_pipeline` runs its library code."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_there_is_one_command_for_the_main_job_and_one_for_the_tests():
    lines = [line for line in README.splitlines() if line.startswith("python3 -m venv")]
    main_job, tests = lines
    assert main_job.endswith("plan --mesh face.obj --max-projectors 3")
    assert "pytest" in tests


def test_every_document_that_is_linked_exists():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).exists(), target
