"""Pages of docs/ that are made of the program, or name all of something, do so."""

import json
import re
import subprocess
import sys
from pathlib import Path

import planning
from planning import load_rig
from planning.model.document.plan_document import plan_schema

DOCS = Path(__file__).resolve().parents[2] / "docs"


def _page(name):
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_first_page_names_every_page():
    named = set(re.findall(r"\]\(([\w/-]+\.md)\)", _page("README.md")))
    assert {page.relative_to(DOCS).as_posix() for page in DOCS.glob("*/*.md")} <= named


def test_command_reference_is_what_help_says():
    # In a process of its own: click keeps a command's first `--help`, whoever asked.
    check = ["-m", "benchmarks.house.command_reference", "--check"]
    assert subprocess.run([sys.executable, *check], cwd=DOCS.parent).returncode == 0


def test_library_reference_names_all_that_is_public():
    named = re.findall(r":: planning\.(\w+)", _page("reference/library.md"))
    assert sorted(named) == dir(planning)


def test_plan_reference_names_every_key_once():
    rows = re.findall(r"^\| (`.+?) \|", _page("reference/plan-file.md"), re.M)
    named = re.findall(r"`(\w+)`", " ".join(rows))
    assert sorted(named) == sorted(json.loads(plan_schema())["properties"])


def test_room_of_the_how_to_loads(tmp_path):
    example = _page("howto/my-room.md").split("```toml\n")[1].split("```")[0]
    path = tmp_path / "room.toml"
    path.write_text(example)
    assert load_rig(path).name == "corner of the lab"
