"""Claims of what is left of the target after the loss of any one device.

`docs/reference/semantics.md`, "Survival". What each pair measures is the audit's own,
device by device; so are reference cameras, of which several may be needed for a sample.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Ints, Mask
from planning.model.devices.calibration_errors import Survival
from planning.model.document.survival_records import (
    LossRecord,
    SurvivalRecord,
    SurvivingCountRecord,
)
from planning.model.plan import RigPlan
from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT, ROUNDING, share_error
from planning.verify.audit.predicates.audit_devices import audit_projectors
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import (
    Reachable,
    Recomputed,
    pairs_with,
)
from planning.verify.audit.predicates.reference_devices import reference_cameras

from .floor_claims import region_parts

# Standard errors that two shares of a region may lie apart: there are hundreds.
_ERRORS = 4.0
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class _Rest:
    """What is left without a device, (n,) each."""

    lit: Mask
    measured: Mask
    cameras: Mask


def audit_survival(case: AuditCase, findings: AuditFindings) -> None:
    """Check what each loss leaves, and the numbers of devices, if that is claimed."""
    record, asked = case.plan.document.survival, case.plan.requirements.survival
    below = findings.at("survival")
    if record is None and asked is None:
        return
    if record is None or asked is None or not asked.asks:
        below.fail(
            "", "there without the other: `survival` and `requirements.survival`"
        )
        return
    names = _names(case.plan, asked)
    told = [loss.lost for loss in record.losses]
    if not below.holds(
        told == names, "losses", f"{told} must be {names}, each device after none"
    ):
        return
    rests = _rests(case, case.actual, asked)
    for loss, rest in zip(record.losses, rests, strict=True):
        _audit_loss(case, loss, rest, below.at(f"losses.{loss.lost or 'none'}"))
    _audit_floors(case, record, asked, below)
    for kind in case.kinds:
        count = getattr(record, f"{kind.name}s")
        if count is not None:
            _audit_count(kind, count, asked, below.at(f"{kind.name}s"))


def unmet_after_losses(plan: RigPlan) -> Iterator[str]:
    """Yield a sentence for each requirement that isn't met after a loss, as claimed."""
    record, limits = plan.document.survival, plan.requirements
    for loss in record.losses if record is not None else ():
        by_cameras = loss.reachable_by_cameras_m2
        rules = (
            (
                loss.lit_m2,
                limits.dominant_coverage,
                loss.reachable_by_projectors_m2,
                "dominant_coverage",
            ),
            (loss.measured_m2, limits.coverage, by_cameras, "coverage"),
            (by_cameras, limits.min_reachable, loss.lit_m2, "min_reachable"),
        )
        for part, share, whole, name in rules:
            if not (whole > 0.0 and part >= share * whole * (1.0 - _SLACK)):
                yield (
                    f"requirements.{name} without {loss.lost or 'any loss'}: "
                    f"{part:.6g} m² is less than {share:g} x {whole:.6g} m²"
                )
        if loss.floors_missed:
            yield (
                f"requirements.region_coverage without {loss.lost or 'any loss'}: "
                f"regions {loss.floors_missed} fall below"
            )


def _names(plan: RigPlan, asked: Survival) -> list[str | None]:
    devices = (*plan.projectors, *plan.cameras) if asked.survive else ()
    return [None, *(device.id for device in devices)]


def _rests(case: AuditCase, actual: Recomputed, asked: Survival) -> Iterator[_Rest]:
    """Yield what is left with all there, then without each of the devices."""
    pairs, lit_by = actual.pairs == MEASURED, actual.lit_by
    reached = _reached(case.plan, actual, case.shadow, asked, case.seed)
    n_projectors, n_cameras = pairs.shape[:2]

    def fold(left: Mask) -> Mask:
        return left.reshape(-1, left.shape[-1]).sum(axis=0) >= asked.views

    yield _Rest(actual.lit, fold(pairs), reached[0])
    if not asked.survive:
        return
    for p in range(n_projectors):
        others = np.arange(n_projectors) != p
        lit = np.any(lit_by[others], axis=0)
        yield _Rest(lit, fold(pairs[others]), reached[1 + p])
    for c in range(n_cameras):
        others = np.arange(n_cameras) != c
        yield _Rest(actual.lit, fold(pairs[:, others]), reached[0])


def _reached(
    plan: RigPlan, actual: Recomputed, shadow: Shadow, asked: Survival, seed: int
) -> list[Mask]:
    """Return what could be measured as often as asked: in full, without each projector.

    Pairs of the plan count, and those of its projectors with reference cameras, taken
    in a random order as long as a sample lacks any.
    """
    counts = (actual.pairs == MEASURED).sum(axis=1)
    n_projectors = len(counts)
    gone = range(n_projectors) if asked.survive else ()
    sets = [np.arange(n_projectors)]
    sets += [np.delete(np.arange(n_projectors), p) for p in gone]
    projectors = audit_projectors(plan)
    cameras = reference_cameras(plan)

    def lacking() -> Mask:
        return np.any(
            [
                (counts[left].sum(axis=0) < asked.views)
                & actual.lit_by[left].any(axis=0)
                for left in sets
            ],
            axis=0,
        )

    for index in np.random.default_rng(seed).permutation(len(cameras)):
        waiting: Ints = np.flatnonzero(lacking())
        if not len(waiting):
            break
        steps = pairs_with(
            cameras[index],
            projectors,
            actual.samples.take(waiting),
            actual.lit_by[:, waiting],
            plan.requirements,
            shadow,
        )
        counts[:, waiting] += steps == MEASURED
    return [counts[left].sum(axis=0) >= asked.views for left in sets]


def _audit_loss(
    case: AuditCase, loss: LossRecord, rest: _Rest, findings: AuditFindings
) -> None:
    """Check the areas of a loss, and that they are parts of each other."""
    audit = case.estimator.audit
    audit("lit_m2", loss.lit_m2, rest.lit, findings)
    audit("measured_m2", loss.measured_m2, rest.measured, findings)
    audit(
        "reachable_by_cameras_m2", loss.reachable_by_cameras_m2, rest.cameras, findings
    )
    findings.same(
        "reachable_by_projectors_m2",
        loss.reachable_by_projectors_m2,
        case.plan.coverage.target.reachable_by_projectors_m2,
        "coverage.target",
        ROUNDING * case.estimator.target_m2,
    )
    slack = ROUNDING * case.estimator.target_m2
    findings.holds(
        0.0 <= loss.measured_m2 <= loss.reachable_by_cameras_m2 + slack
        and loss.reachable_by_cameras_m2 <= loss.lit_m2 + slack
        and loss.lit_m2 <= case.plan.coverage.target.lit_m2 + slack,
        "",
        f"measured {loss.measured_m2:.6g} m², measurable "
        f"{loss.reachable_by_cameras_m2:.6g} m², lit {loss.lit_m2:.6g} m² and lit with "
        f"all there {case.plan.coverage.target.lit_m2:.6g} m² must each be part of the "
        f"next",
    )


def _audit_floors(
    case: AuditCase,
    record: SurvivalRecord,
    asked: Survival,
    findings: AuditFindings,
) -> None:
    """Check which regions are said to fall below their floor, more than by chance."""
    share = case.plan.requirements.region_coverage
    unknown = {r for loss in record.losses for r in loss.floors_missed}
    unknown -= case.large_regions if share > 0.0 else set()
    findings.holds(not unknown, "losses", f"regions {unknown} have no floor")
    if not share > 0.0:
        return
    parts = [
        (actual, reachable, list(_rests(case, actual, asked)))
        for actual, reachable in region_parts(case)
    ]
    for k, loss in enumerate(record.losses):
        for region in sorted(case.large_regions):
            shares = [
                _share(parts, k, region, "lit", "projectors"),
                _share(parts, k, region, "measured", "cameras"),
            ]
            room = [_ERRORS * float(error) + POINT for _, error in shares]
            missed = any(s < share - r for (s, _), r in zip(shares, room, strict=True))
            held = all(s > share + r for (s, _), r in zip(shares, room, strict=True))
            told = region in loss.floors_missed
            findings.holds(
                not (missed and not told) and not (held and told),
                f"losses.{loss.lost or 'none'}.floors_missed",
                f"region {region} is {'' if told else 'not '}said to fall below "
                f"{share:g}, recomputed lit {shares[0][0]:.4g} and measured "
                f"{shares[1][0]:.4g} of what can be",
            )


def _share(
    parts: list[tuple[Recomputed, Reachable, list[_Rest]]],
    k: int,
    region: int,
    done: str,
    of: str,
) -> tuple[float, float]:
    """Share of a region that a loss leaves lit or measured, and its standard error."""
    n_done = n_whole = 0
    for actual, reachable, rests in parts:
        inside = actual.samples.region == region
        whole = reachable.projectors if of == "projectors" else rests[k].cameras
        n_whole += int((inside & whole).sum())
        n_done += int((inside & whole & getattr(rests[k], done)).sum())
    if not n_whole:
        return 1.0, 1.0
    error = share_error(np.array(float(n_done)), n_whole, n_whole)
    return n_done / n_whole, float(error)


def _audit_count(
    kind: DeviceKind,
    claims: SurvivingCountRecord,
    asked: Survival,
    findings: AuditFindings,
) -> None:
    """Check numbers of devices against each other and against the certificate.

    Whatever is lost, what is left is a cover: so of covers the bound is one less.
    """
    findings.number("count", claims.count, len(kind.devices), 0.0, "")
    # More are needed than are planned only where no more may be, or are in stock.
    stopped = kind.most in (None, claims.count) or kind.is_counted
    findings.holds(
        claims.lower_bound <= claims.needed
        and claims.count <= claims.needed
        and (claims.count == claims.needed or stopped),
        "needed",
        f"{claims.needed} suffice beside at least {claims.lower_bound}, and "
        f"{claims.count} in the plan",
    )
    once = kind.proof.needed.lower_bound
    findings.holds(
        claims.without >= (once if kind.name == "projector" else 0),
        "without",
        f"{claims.without} do without, but at least {once} are needed",
    )
    spare = asked.survive
    by_itself = kind.name == "projector" or asked.views == 1
    if kind.name == "projector":
        most = min(once + spare, claims.needed)
        findings.holds(
            claims.lower_bound <= most,
            "lower_bound",
            f"{claims.lower_bound} is claimed, but a cover and {spare} more are {most}",
        )
    bound = kind.proof.continuous
    if claims.everywhere is None:
        return
    least = None if bound is None else bound.lower_bound + spare
    existing = all(device.existing for device in kind.devices)
    findings.holds(
        least is not None and (claims.everywhere <= least or existing),
        "everywhere",
        f"{claims.everywhere} is claimed over all poses, the certificate's bound and "
        f"{spare} more are {least}",
    )
    findings.holds(
        not by_itself or claims.everywhere <= claims.needed,
        "everywhere",
        f"{claims.everywhere} is claimed, but {claims.needed} suffice",
    )
