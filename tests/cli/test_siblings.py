"""A stranger's package under one of our names is refused, and named."""

import itertools
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ["geometry", "solvers", "planning"]


def run(code, cwd):
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def plant(folder, name):
    stranger = folder / name / "__init__.py"
    stranger.parent.mkdir()
    stranger.write_text("")
    return stranger


@pytest.mark.parametrize("name", PACKAGES)
def test_our_own_siblings_pass(name, tmp_path):
    done = run(
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import {name}", tmp_path
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("importer", "shadowed"), list(itertools.permutations(PACKAGES, 2))
)
def test_stranger_in_the_current_folder_is_named(importer, shadowed, tmp_path):
    """``python -c`` puts the current folder first, as a user's scripts folder does."""
    stranger = plant(tmp_path, shadowed)
    code = f"import sys; sys.path.append({str(ROOT)!r}); import {importer}"
    done = run(code, tmp_path)
    assert done.returncode != 0
    assert f"'{shadowed}' would be imported from {stranger}" in done.stderr
    assert "environment of its own" in done.stderr


def test_namespace_package_without_a_file_is_no_excuse(tmp_path):
    """A bare folder called geometry has no origin; a later regular package wins."""
    (tmp_path / "geometry").mkdir()
    code = f"import sys; sys.path.append({str(ROOT)!r}); import solvers"
    assert run(code, tmp_path).returncode == 0


def test_missing_sibling_is_named():
    from solvers._siblings import check_siblings

    with pytest.raises(
        ImportError, match="'no_such_sibling' would be imported from None"
    ):
        check_siblings(("no_such_sibling",))


def test_the_check_is_the_same_file_in_both_packages():
    files = sorted(ROOT.glob("*/_siblings.py"))
    assert [file.parent.name for file in files] == ["geometry", "solvers"]
    texts = {file.read_text() for file in files}
    assert len(texts) == 1


def test_importing_solvers_loads_no_modelling_library(tmp_path):
    heavy = "{'cvxpy', 'casadi', 'highspy', 'scipy', 'numpy'}"
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import solvers; "
        f"print(sorted({heavy} & set(sys.modules)))"
    )
    assert run(code, tmp_path).stdout.strip() == "[]"
