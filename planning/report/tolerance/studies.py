"""Drawn rigs that are kept in a file, so that a longer study goes on from a shorter.

A study is one question: a plan, how its devices are mounted and calibrated, and a seed.
A file holds the studies of one plan; those of a plan before it leave the file.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from math import isfinite
from pathlib import Path
from typing import Any

from planning.model.devices.calibration_errors import CalibrationErrors, Mounting
from planning.model.errors import InputError
from planning.model.files import reading, write_atomically

from .asked import Figures
from .sensitivities import Sensitivity

FILE = "tolerance.json"
_FORMAT, _VERSION = "ringrig-tolerance", 1


@dataclass(frozen=True)
class Question:
    """What a study is about: a plan by its digest, and what is drawn."""

    plan: str
    mounting: Mounting
    calibration: CalibrationErrors
    seed: int


@dataclass(frozen=True)
class Study:
    """Figures of drawn rigs from the first on, and those of one device at a time."""

    rigs: tuple[Figures, ...] = ()
    sensitivities: tuple[Sensitivity, ...] = ()


class StudyFile:
    """The studies of one plan.

    Raises:
        InputError: If the file is there and isn't one of studies.
    """

    def __init__(self, path: Path, question: Question) -> None:
        self._path, self._key = path, asdict(question)
        self._others: list[Mapping[str, Any]] = []
        self.study = Study()
        if not path.exists():
            return
        with reading(path, InputError):
            content = path.read_bytes()
        try:
            entries = _entries(content)
            for entry in entries:
                if entry["question"] == self._key:
                    self.study = _read(entry)
                elif entry["question"]["plan"] == question.plan:
                    self._others.append(entry)
        except (ValueError, TypeError, KeyError, RecursionError):
            raise InputError(
                f"{path}: not a file of drawn rigs; move it, or choose another folder "
                f"with -o"
            ) from None

    def save(self, study: Study) -> None:
        """Write the study beside the others of its plan."""
        self.study = study
        entry = {
            "question": self._key,
            "columns": [field.name for field in fields(Figures)],
            "rigs": [list(asdict(rig).values()) for rig in study.rigs],
            "sensitivities": [asdict(one) for one in study.sensitivities],
        }
        document = {
            "format": _FORMAT,
            "version": _VERSION,
            "studies": [*self._others, entry],
        }
        text = json.dumps(document, allow_nan=False) + "\n"
        write_atomically(self._path, lambda file: file.write(text.encode()))


def _entries(content: bytes) -> Sequence[Mapping[str, Any]]:
    document = json.loads(content)
    if (document["format"], document["version"]) != (_FORMAT, _VERSION):
        raise ValueError
    return document["studies"]


def _read(entry: Mapping[str, Any]) -> Study:
    columns, rows = entry["columns"], entry["rigs"]
    for value in (each for row in rows for each in row if each is not None):
        if not isinstance(value, int | float) or not isfinite(value):
            raise ValueError
    return Study(
        tuple(Figures(**dict(zip(columns, row, strict=True))) for row in rows),
        tuple(Sensitivity(**one) for one in entry["sensitivities"]),
    )
