"""How well a plan's rig must be mounted and calibrated: Monte Carlo over drawn rigs."""

import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from geometry.parallel import mapped, n_threads
from planning.model.devices.calibration_errors import (
    AS_PLANNED,
    PERFECT,
    CalibrationErrors,
    Mounting,
)
from planning.model.plan import RigPlan
from planning.model.progress import Report
from planning.rig.rig_tables import MountingTable

from .asked import Asked, Figures
from .built_case import BuiltCase
from .drawn_rigs import DRAWN, Deviates
from .loosest import Loosest, loosest
from .sensitivities import FirstOrder, Sensitivity, first_order, sensitivities
from .studies import Question, Study, StudyFile

QUANTILES = (0.05, 0.5, 0.95)
# Figures of which quantiles are told.
TOLD = ("lit", "coverage", "worst_region", "completeness", "rms_m", "p95_m")
# The loosest mounting is sought over so many of the rigs at most.
_MOST_SOUGHT = 200
# What is drawn is kept, and told, so often [s].
_EVERY_S = 5.0


@dataclass(frozen=True, eq=False)
class Tolerance:
    """What was found of a plan.

    Attributes:
        question: What was drawn.
        quantile: Share of drawn rigs that must meet what is asked.
        asked: That.
        planned: What the plan reaches as planned; errors are none.
        rigs: What each drawn rig reaches.
        sensitivities: Of each device and direction; none: the run was interrupted.
        first_order: What these let expect.
        loosest: None: nothing of the mounting is stated, or the run was interrupted.
        interrupted: Whether there would be more.
    """

    question: Question
    quantile: float
    asked: Asked
    planned: Figures
    rigs: tuple[Figures, ...]
    sensitivities: tuple[Sensitivity, ...] = ()
    first_order: FirstOrder | None = None
    loosest: Loosest | None = None
    interrupted: bool = False

    @property
    def n_met(self) -> int:
        """How many rigs meet all that is asked."""
        return sum(not self.asked.missed(rig) for rig in self.rigs)

    @property
    def passed(self) -> bool:
        """Whether enough of them do."""
        return bool(self.rigs) and self.n_met >= ceil(self.quantile * len(self.rigs))

    def missing(self) -> dict[str, int]:
        """Return how many rigs miss each figure that is asked for."""
        names = [name for rig in self.rigs for name in self.asked.missed(rig)]
        return {name: names.count(name) for name in dict.fromkeys(names)}

    def quantiles(self, name: str) -> list[float | None]:
        """Return a figure at `QUANTILES` over the rigs; None where there is none."""
        values = [getattr(rig, name) for rig in self.rigs]
        some = [value for value in values if value is not None]
        if not some:
            return [None] * len(QUANTILES)
        return np.quantile(some, QUANTILES).tolist()

    def mean_square_m(self) -> float | None:
        """Return the root mean square of the errors over rigs and points [m]."""
        squares = [rig.rms_m**2 for rig in self.rigs if rig.rms_m is not None]
        return float(np.sqrt(np.mean(squares))) if squares else None

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values; metres and radians."""
        return {
            **asdict(self.question),
            "quantile": self.quantile,
            "asked": asdict(self.asked),
            "as_planned": asdict(self.planned),
            "n_drawn": len(self.rigs),
            "n_met": self.n_met,
            "passed": self.passed,
            "interrupted": self.interrupted,
            "missed_by": self.missing(),
            "quantiles": {
                name: dict(zip(map(str, QUANTILES), self.quantiles(name), strict=True))
                for name in TOLD
            },
            "drawn_rms_m": self.mean_square_m(),
            "first_order": None
            if self.first_order is None
            else asdict(self.first_order),
            "loosest": None if self.loosest is None else asdict(self.loosest),
            "sensitivities": [asdict(one) for one in self.sensitivities],
        }


def question_of(
    plan: RigPlan,
    mounting: Mounting | None,
    calibration: CalibrationErrors | None,
    seed: int | None,
) -> Question:
    """Return what is drawn; None: as the plan's rig states it, and its own seed."""
    if mounting is None:
        mounting = MountingTable(**plan.document.rig.mounting).bounds()
    stated = plan.requirements.triangulation.calibration or PERFECT
    return Question(
        plan.digest,
        mounting,
        stated if calibration is None else calibration,
        plan.document.seed if seed is None else seed,
    )


def tolerance_of(
    plan: RigPlan,
    question: Question,
    *,
    n: int = 200,
    quantile: float = 0.95,
    file: StudyFile | None = None,
    threads: int | None = None,
    report: Report = lambda line: None,
) -> Tolerance:
    """Draw rigs and say what becomes of a plan's claims.

    Args:
        plan: The plan.
        question: How its devices are mounted and calibrated.
        n: Rigs to draw, those of the file included.
        quantile: Share of them that must meet what is asked.
        file: Where they are kept; None: nowhere.
        threads: Worker threads; no result depends on them. None: all cores.
        report: Receives lines of progress.
    """
    threads = threads or n_threads()
    report("coverage as planned, on the samples of the plan's claims")
    case = BuiltCase.of(plan, question.calibration, threads=threads).shared()
    asked = Asked.of(plan.requirements)
    study = Study() if file is None else file.study
    found = Tolerance(question, quantile, asked, as_planned(case), study.rigs[:n])
    try:
        for rigs in _drawn(case, question, study.rigs, n, threads, report, asked):
            found = replace(found, rigs=rigs[:n])
            study = replace(study, rigs=rigs)
            if file is not None:
                file.save(study)
        mounting = question.mounting
        if not study.sensitivities:
            single = sensitivities(case, mounting, threads=threads, report=report)
            study = replace(study, sensitivities=single)
            if file is not None:
                file.save(study)
        single = study.sensitivities
        found = replace(
            found,
            sensitivities=single,
            first_order=first_order(case, single, mounting),
        )
        if mounting != AS_PLANNED:
            best = loosest(
                case,
                asked,
                mounting,
                quantile,
                n=min(n, _MOST_SOUGHT),
                seed=question.seed,
                threads=threads,
                report=report,
            )
            found = replace(found, loosest=best)
    except KeyboardInterrupt:
        return replace(found, interrupted=True)
    return found


def as_planned(case: BuiltCase) -> Figures:
    """Return what the plan reaches where all is exact."""
    figures = case.figures(case.planned, np.zeros(len(case.target)))
    return replace(figures, completeness=1.0, rms_m=None, p95_m=None)


def draw(
    case: BuiltCase,
    question: Question,
    rigs: Iterable[int],
    *,
    threads: int,
    stream: int = DRAWN,
) -> list[Figures]:
    """Return what rigs of these indices reach."""
    sizes = len(case.rig.devices), len(case.target)

    def one(index: int) -> Figures:
        deviates = Deviates.drawn(
            *sizes, seed=question.seed, stream=stream, index=index
        )
        return case.drawn(question.mounting, deviates)

    _ = case.planned
    return mapped(one, rigs, threads)


def _drawn(
    case: BuiltCase,
    question: Question,
    rigs: tuple[Figures, ...],
    n: int,
    threads: int,
    report: Report,
    asked: Asked,
) -> Iterable[tuple[Figures, ...]]:
    """Yield all drawn rigs, from time to time and in the end, or when interrupted."""
    if rigs:
        report(f"{len(rigs)} drawn rigs are kept already")
    kept, told = len(rigs), time.monotonic()
    try:
        while len(rigs) < n:
            more = range(len(rigs), min(n, len(rigs) + 4 * threads))
            rigs += tuple(draw(case, question, more, threads=threads))
            if time.monotonic() - told >= _EVERY_S or len(rigs) == n:
                kept, told = len(rigs), time.monotonic()
                met = sum(not asked.missed(rig) for rig in rigs)
                report(f"{kept} of {n} rigs drawn, {met} meet all that is asked")
                yield rigs
    except KeyboardInterrupt:
        if len(rigs) > kept:
            yield rigs
        raise
