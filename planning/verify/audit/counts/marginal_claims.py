"""Claims of what other numbers of devices cover, where the plan says where they stand.

They stand at reference poses, whose places a row names.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.arrays import Mask
from planning.model.document.coverage_records import CameraMarginal, ProjectorMarginal
from planning.model.document.ring_records import RingsRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.predicates import LIT, MEASURED, light_steps
from planning.verify.audit.predicates.recompute import pairs_with
from planning.verify.audit.predicates.reference_devices import (
    reference_cameras,
    reference_projectors,
)


def audit_marginal(case: AuditCase, findings: AuditFindings) -> None:
    """Check both areas of each row of `marginal` that says where its devices stand."""
    document, least = case.plan.document, dict[str, tuple[float, float]]()
    light, last = _Light(case), dict[str, int]()
    for row in document.marginal:
        (kind, number), areas = row.number, _areas(row)
        below = findings.at(f"marginal.{kind}s.{number}")
        planned = len(getattr(document, f"{kind}s"))
        below.holds(
            number <= planned or last.get(kind) == number - 1,
            "",
            f"no row of {number - 1} stands before it, which it adds one to",
        )
        places = row.reference
        if places is not None and below.holds(
            number != planned and len(set(places)) == len(places) <= number,
            "reference",
            f"{list(places)} must be {number} poses at most, none twice, and no row of "
            f"the plan's own {planned} has any",
        ):
            covered = light.lit(places) if kind == "projector" else light.seen(places)
            # A device added to the planned ones can't cover less than they do.
            before = least.get(kind, (0.0, 0.0)) if number > planned else (0.0, 0.0)
            for part, claimed, floor in zip(
                ("target", "surface"), areas, before, strict=True
            ):
                within, whole = case.estimator.wholes()[part]
                chosen = covered & within
                slack = case.estimator.tolerance(chosen, whole)
                truth = max(case.estimator.area(chosen), floor)
                below.number(f"{part}_m2", claimed, truth, slack)
        if number >= planned:
            least[kind], last[kind] = areas, number


def _areas(row: ProjectorMarginal | CameraMarginal) -> tuple[float, float]:
    if isinstance(row, ProjectorMarginal):
        return row.lit_target_m2, row.lit_surface_m2
    return row.measured_target_m2, row.measured_surface_m2


class _Light:
    """What reference devices light and measure of the audit's samples."""

    def __init__(self, case: AuditCase) -> None:
        self._case = case
        self._projectors = reference_projectors(case.plan)
        self._cameras = reference_cameras(case.plan)

    def lit(self, places: Sequence[int]) -> Mask:
        """Return what projectors at reference poses light, shape (n,)."""
        case, limits = self._case, self._case.plan.requirements.projector
        return np.any(
            [
                light_steps(self._projectors[k], case.samples, limits, case.shadow)
                == LIT
                for k in places
            ],
            axis=0,
        )

    def seen(self, places: Sequence[int]) -> Mask:
        """Return what cameras there measure with evenly ringed projectors, (n,)."""
        case, limits = self._case, self._case.plan.requirements
        evenly = [
            _evenly(projector, record.rings)
            for projector, record in zip(
                case.projectors, case.plan.document.projectors, strict=True
            )
        ]
        measured = np.zeros(len(case.samples), dtype=bool)
        for k in places:
            # What one camera measures needn't be asked of the others.
            rest = np.flatnonzero(case.actual.lit & ~measured)
            samples, by = case.samples.take(rest), case.actual.lit_by[:, rest]
            steps = pairs_with(
                self._cameras[k], evenly, samples, by, limits, case.shadow
            )
            measured[rest] = np.any(steps == MEASURED, axis=0)
        return measured


def _evenly(projector: AuditProjector, rings: RingsRecord | None) -> AuditProjector:
    """A projector with as many rings at equal steps as there were at first."""
    if rings is None or rings.n_even < 2:
        return projector
    outer, n = max(*projector.radii.tolist(), *rings.left_out), rings.n_even
    return replace(projector, radii=outer * np.arange(1, n + 1) / n)
