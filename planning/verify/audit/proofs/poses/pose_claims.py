"""Bounds over all poses: derived again from the plan, its mesh and `proof.npz`.

The multipliers alone are taken from the file. Samples are drawn again, what candidates
and existing devices cover of them is the audit's own, and so are the cells of poses.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Ints, Mask
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
from .skies import SkyMaps
from .too_few import Outcome, Question, most_of_one

# Share of the samples by which lit ones may differ from those that were planned.
_LIT = 0.01
_EVERY_S = 5.0
# Attempts where pairs of cells are looked at, too: with the finest maps it would be
# minutes.
_PAIRED = 3


@dataclass(frozen=True)
class PoseBound:
    """What became of a bound over all poses.

    Attributes:
        line: It, in words.
        trusted: What of it wasn't derived again; "": nothing.
    """

    line: str
    trusted: str = ""


def audit_pose_proofs(
    case: AuditCase, findings: AuditFindings, say: Callable[[str], None]
) -> tuple[PoseBound, ...]:
    """Derive every bound over all poses again.

    A certificate that isn't of what the plan claims is a false claim. What cells of the
    smallest size leave open is no such thing, and called claimed.
    """
    bounds = [_bound_of(case, kind, findings, say) for kind in case.kinds]
    return tuple(bound for bound in bounds if bound is not None)


def _bound_of(
    case: AuditCase,
    kind: DeviceKind,
    findings: AuditFindings,
    say: Callable[[str], None],
) -> PoseBound | None:
    """Return what became of a kind's bound; None: it has none, or a false one."""
    table, name = kind.proof.continuous, f"{kind.name}s"
    if table is None:
        return None
    told = f"{name}: at least {table.lower_bound} over all poses is"
    trusted = f"the bound on {name} over all poses: claimed"
    if table.lower_bound <= _given(case, kind):
        return PoseBound(f"{told} proved: so many stand already")
    if table.certificate == "none":
        return PoseBound(f"{told} claimed, without a certificate", trusted)
    record = case.plan.document.certificates.proof
    below = findings.at(f"certificates.{name}.continuous.certificate")
    if record is None:
        below.fail("", "'offered' is claimed, and no proof is named")
        return None
    if case.plan.proof is None:
        return PoseBound(
            f"{told} claimed: {record.path} isn't beside the plan", trusted
        )
    begun = time.perf_counter()
    try:
        proof = case.plan.proof.over_poses.get(kind.name)
        outcome, only_count = _derived(case, kind, table, proof, say)
    except RefutedProofError as error:
        below.fail("", f"{table.lower_bound} at least is claimed, but {error}")
        return None
    if not outcome.too_few:
        return PoseBound(f"{told} claimed: {outcome.how}", trusted)
    took = time.perf_counter() - begun
    line = f"{told} proved, derived again in {took:.1f} s: {outcome.how}"
    if only_count:
        trusted = (
            f"what one of the {name} fewer covers at most, over all poses: claimed"
        )
        return PoseBound(f"{line}; what one fewer covers is claimed", trusted)
    return PoseBound(line)


def _given(case: AuditCase, kind: DeviceKind) -> int:
    return len(case.plan.requirements.existing_of(kind.name))


def _derived(
    case: AuditCase,
    kind: DeviceKind,
    table: ContinuousProof,
    proof: PoseProof | None,
    say: Callable[[str], None],
) -> tuple[Outcome, bool]:
    """Return whether the bound follows and how, and whether its area doesn't.

    Raises:
        RefutedProofError: If the certificate is of something else.
    """
    given = _given(case, kind)
    if proof is None:
        raise RefutedProofError("the file has no certificate of it")
    if proof.n_devices + 1 + given < table.lower_bound:
        raise RefutedProofError(f"the certificate is of {proof.n_devices + 1 + given}")
    every = drawn_again(case, kind.name, proof.draws, proof.faces)
    n = len(proof.multipliers)
    if not proof.is_of_whole_draws:
        raise RefutedProofError(
            f"of its {n} samples {proof.n_whole} are of whole draws"
        )
    lit_by = lit_by_plan(case, kind.name, every)
    lit = np.any(lit_by, axis=0)
    n_samples = int(lit[:n].sum())
    if abs(n_samples - table.n_samples) > _LIT * n:
        raise RefutedProofError(
            f"it is of {n_samples} samples, and {table.n_samples} are claimed"
        )
    # The rest of a draw lies on a part of the surface, which would count for more.
    whole = proof.n_whole
    lit_by, n_samples = lit_by[:, :whole], int(lit[:whole].sum())
    samples = every.take(np.arange(whole))
    reached = covered_by_candidates(case, kind.name, samples).any(axis=1)
    free = reached & free_of_existing(case, kind.name, samples)
    required = int(np.ceil(kind.share * int(reached.sum()) - 1e-9)) - int(free.sum())
    search = _Search(
        device_cells(case, kind.name, samples, lit_by, shadows=table.occlusion),
        proof.multipliers[:whole],
        np.flatnonzero(reached & ~free),
        lambda line: say(f"proofs: {kind.name}s: {line}"),
    )
    few = table.lower_bound - given - 1
    found = search.too_few(few, required)
    if not found.too_few:
        return found, True
    more = f"{few} more" if given else str(few)
    words = f"no {more} anywhere cover {required} of {n_samples} samples ({found.how})"
    if few == 0:
        words = f"{required} of {n_samples} samples are left to cover"
    found = Outcome(True, words)
    if table.one_fewer_upper_bound_m2 is None:
        return found, False
    # Area that a sample stands for, and how many are claimed to be covered at most.
    area = case.estimator.target_m2 * float(lit.mean()) / max(n_samples, 1)
    # More than all of them is no more.
    share = min(table.one_fewer_upper_bound_m2 / area, float(n_samples))
    most = round(share) - int(free.sum())
    fewer = kind.proof.needed.count - given - 1
    known = (fewer <= few and most + 1 >= required) or most >= len(search.wanted)
    return found, not (known or search.too_few(fewer, most + 1).too_few)


@dataclass(frozen=True, eq=False)
class _Search:
    """Asks about so many devices: without shadows first, then by ever finer maps.

    Multipliers that suffice look at fewest cells; pairs take maps, where there are any.
    """

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
        pairs = n_devices == 2
        for maps in self.cells.stages[: _PAIRED if pairs else None]:
            asked = self._question(self.wanted[paying], maps)
            outcome = asked.by_multipliers(most, multipliers[paying])
            if pairs and not outcome.too_few and self.cells.counts(maps):
                outcome = self._question(self.wanted, maps).by_pairs(least)
            if outcome.too_few:
                break
            # Pairs may yet do what multipliers can't.
            if not pairs and self._in_vain(outcome, paying, most):
                how = f"{outcome.how}, and a pose there costs more than that"
                return Outcome(False, how)
        return outcome

    def _in_vain(self, outcome: Outcome, paying: Mask, most: int) -> bool:
        """Return whether single poses cost too much, so that no map is fine enough."""
        if outcome.left is None:
            return False
        served = self.cells.at_middles(outcome.left, self.wanted[paying])
        multipliers = self.multipliers[self.wanted][paying]
        return bool(np.any(served @ multipliers > most))

    def _question(self, some: Ints, maps: SkyMaps | None) -> Question:
        made = self.cells.of(some, self.say, maps)
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
