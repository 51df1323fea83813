"""Bounds over all poses: derived again from the plan, its mesh and `proof.npz`.

The multipliers alone are taken from the file. Samples are drawn again, what candidates
and existing devices cover of them is the audit's own, and so are the cells of poses.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Ints
from planning.model.document.certificates import ContinuousProof
from planning.model.proofs import PoseProof
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.proofs.frozen_samples import (
    covered_by_candidates,
    drawn_again,
)
from planning.verify.audit.proofs.refutation import RefutedProofError

from .device_cells import DeviceCells, device_cells, free_of_existing, lit_by_plan
from .too_few import Outcome, Question, most_of_one

# Share of the samples by which lit ones may differ from those that were planned.
_LIT = 0.01
_EVERY_S = 5.0


@dataclass(frozen=True)
class PoseBound:
    """What became of a bound over all poses.

    Attributes:
        line: It, in words.
        derived: Whether all that the plan says of it was derived again.
    """

    line: str
    derived: bool


def audit_pose_proofs(
    case: AuditCase, findings: AuditFindings, say: Callable[[str], None]
) -> tuple[PoseBound, ...]:
    """Derive every bound over all poses again.

    A certificate that isn't of what the plan claims is a false claim. What cells of the
    smallest size leave open is no such thing, and called claimed.
    """
    record, bounds = case.plan.document.certificates.proof, list[PoseBound]()
    file = case.plan.proof if record is not None else None
    for kind in case.kinds:
        table, name = kind.proof.continuous, f"{kind.name}s"
        if table is None:
            continue
        told = f"{name}: at least {table.lower_bound} over all poses is"
        given = len(case.plan.requirements.existing_of(kind.name))
        if table.lower_bound <= given:
            bounds.append(PoseBound(f"{told} proved: so many stand already", True))
            continue
        if table.certificate != "proved":
            words = f"{told} claimed, without a certificate"
            bounds.append(PoseBound(words, False))
            continue
        below = findings.at(f"certificates.{name}.continuous.certificate")
        if record is None:
            below.fail("", "'proved' is claimed, and no proof is named")
            continue
        if file is None:
            words = f"{told} claimed: {record.path} isn't beside the plan"
            bounds.append(PoseBound(words, False))
            continue
        begun = time.perf_counter()
        try:
            proof = _of_claim(file.over_poses.get(kind.name), table, given)
            found = _derived(case, kind, table, proof, given, say)
        except RefutedProofError as error:
            least = table.lower_bound
            below.fail("", f"{least} are claimed to be proved, but {error}")
            continue
        how = "claimed"
        if found[0]:
            how = f"proved, derived again in {time.perf_counter() - begun:.1f} s"
        bounds.append(PoseBound(f"{told} {how}: {found[1]}", found[2]))
    return tuple(bounds)


def _of_claim(
    proof: PoseProof | None, table: ContinuousProof, given: int
) -> PoseProof:
    if proof is None:
        raise RefutedProofError("the file has no certificate of it")
    if proof.n_devices + 1 + given < table.lower_bound:
        raise RefutedProofError(f"the certificate is of {proof.n_devices + 1 + given}")
    return proof


def _derived(
    case: AuditCase,
    kind: DeviceKind,
    table: ContinuousProof,
    proof: PoseProof,
    given: int,
    say: Callable[[str], None],
) -> tuple[bool, str, bool]:
    """Return whether the bound was derived, how, and whether its area was as well."""
    every = drawn_again(case, proof.draws, proof.faces)
    n = len(proof.multipliers)
    lit_by = lit_by_plan(case, kind.name, every)
    spoken_of = np.any(lit_by, axis=0)
    n_samples = int(spoken_of[:n].sum())
    if abs(n_samples - table.n_samples) > _LIT * n:
        raise RefutedProofError(
            f"it is of {n_samples} samples, and {table.n_samples} are claimed"
        )
    samples, lit_by = every.take(np.arange(n)), lit_by[:, :n]
    reached = covered_by_candidates(case, kind.name, samples).any(axis=1)
    free = reached & free_of_existing(case, kind.name, samples)
    required = int(np.ceil(kind.share * int(reached.sum()) - 1e-9)) - int(free.sum())
    wanted = np.flatnonzero(reached & ~free)
    search = _Search(
        device_cells(case, kind.name, samples, lit_by, shadows=table.occlusion),
        proof.multipliers,
        wanted,
        lambda line: say(f"proofs: {kind.name}s: {line}"),
    )
    n_devices = table.lower_bound - given - 1
    outcome = search.too_few(n_devices, required)
    if not outcome.too_few:
        return False, outcome.how, False
    words = (
        f"no {n_devices} anywhere serve {required} of {len(wanted)} samples "
        f"({outcome.how})"
    )
    if table.one_fewer_upper_bound_m2 is None:
        return True, words, True
    # Area that a sample stands for, and how many are claimed to be served at most.
    shares = float(spoken_of.sum()) / len(every) / max(n_samples, 1)
    area = case.estimator.target_m2 * shares
    most = round(table.one_fewer_upper_bound_m2 / area) - int(free.sum())
    fewer = kind.proof.needed.count - given - 1
    known = fewer <= n_devices and most + 1 >= required
    if known or most >= len(wanted) or search.too_few(fewer, most + 1).too_few:
        return True, words, True
    return True, f"{words}; what one fewer than needed serves is claimed", False


@dataclass(frozen=True, eq=False)
class _Search:
    """Asks about so many devices: without shadows first, which takes no maps."""

    cells: DeviceCells
    multipliers: Ints
    wanted: Ints
    say: Callable[[str], None]

    def too_few(self, n_devices: int, least: int) -> Outcome:
        """Return whether so many devices serve fewer than so many samples."""
        if n_devices == 0 or least <= 0 or least > len(self.wanted):
            return Outcome(least > 0, "one is needed")
        multipliers = self.multipliers[self.wanted]
        most = most_of_one(n_devices, least, multipliers)
        # What costs nothing closes no cell.
        paying = multipliers > 0
        outcome = Outcome(False, "")
        for shadows in self.cells.stages:
            asked = self._question(self.wanted[paying], shadows=shadows)
            outcome = asked.by_multipliers(most, multipliers[paying])
            if not outcome.too_few and n_devices == 2:
                outcome = self._question(self.wanted, shadows=shadows).by_pairs(least)
            if outcome.too_few:
                break
        return outcome

    def _question(self, some: Ints, *, shadows: bool) -> Question:
        made = self.cells.of(some, self.say, shadows=shadows)
        told = _Told(self.say)
        return Question(self.cells.roots, made, len(some), self.cells.object_m, told)


class _Told:
    """Says how many cells were looked at, every few seconds."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._next = say, time.perf_counter() + _EVERY_S

    def __call__(self, looked_at: int) -> None:
        if time.perf_counter() >= self._next:
            self._next += _EVERY_S
            self._say(f"{looked_at} cells looked at")
