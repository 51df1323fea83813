"""Rigs without files: tables in code, and a rig with some of them changed."""

import pytest

from planning import RigError, load_rig


def test_tables_are_a_rig_as_a_file_of_them_is(tmp_path):
    tables = {"base": "default", "name": "near", "placement": {"standoff_mm": 950.0}}
    text = 'base = "default"\nname = "near"\n[placement]\nstandoff_mm = 950.0\n'
    (tmp_path / "near.toml").write_text(text)
    mine, file = load_rig(tables), load_rig(tmp_path / "near.toml")
    assert mine.to_document() == file.to_document()
    assert mine.standoff_m == pytest.approx(0.95)


def test_a_changed_rig_is_that_of_a_file_laid_over_it():
    rig = load_rig("default")
    changed = rig.replace(placement={"standoff_mm": 950.0}, camera={"focal_mm": 10.0})
    assert rig.standoff_m == 1.0
    over = {"placement": {"standoff_mm": 950.0}, "camera": {"focal_mm": 10.0}}
    same = load_rig({"base": "default", **over})
    assert changed.to_document() == same.to_document()
    assert rig.replace().to_document() == rig.to_document()


def test_faults_of_tables_are_those_of_a_file():
    with pytest.raises(RigError, match=r"did you mean standoff_mm"):
        load_rig("default").replace(placement={"standof_mm": 1.0})
    with pytest.raises(RigError, match="base = 'nobody' must name a preset"):
        load_rig({"base": "nobody"})
