"""Claims about models: how many devices of each, and who is a reference pose."""

from collections import Counter

import numpy as np

from planning.verify.audit.audit_case import AuditCase, DeviceKind
from planning.verify.audit.audit_findings import AuditFindings

# Of an equal share of the reference poses.
_LEAST_SHARE = 0.25


def audit_stock(case: AuditCase, findings: AuditFindings) -> None:
    """Check that no more devices of a model are taken than there are."""
    stated: dict[tuple[str, str], int] = {}
    for kind in case.kinds:
        # Before a turntable the same devices measure at every step.
        first = kind.devices[0].station if kind.devices else ""
        at_once = [device for device in kind.devices if device.station == first]
        taken = Counter(device.model for device in at_once)
        several = len(kind.models) > 1
        for model in kind.models:
            if model.count is None:
                continue
            if several:
                stated[kind.name, model.name] = model.count
            n = taken[model.name] if several else len(at_once)
            findings.holds(
                n <= model.count,
                f"{kind.name}s",
                f"{n} are of {model.name!r}, of which rig.{kind.name} counts "
                f"{model.count}",
            )
        names = [model.name for model in kind.models]
        findings.holds(
            len(set(names)) == len(names), f"rig.{kind.name}", f"names repeat: {names}"
        )
        _audit_references(kind, case, findings)
    claimed = {(s.kind, s.model): s.count for s in case.plan.requirements.stock}
    findings.holds(
        claimed == stated,
        "requirements.stock",
        f"holds {claimed}, but the rig counts {stated}",
    )


def _audit_references(
    kind: DeviceKind, case: AuditCase, findings: AuditFindings
) -> None:
    """Every model is among the reference poses, of which each is of a model."""
    of, n = case.plan.surface.models_of(kind.name), len(kind.models)
    key = f"surface.npz reference_{kind.name}_models"
    there = np.bincount(of, minlength=n).tolist()
    # As many poses are tried of each; clearance may cost some.
    findings.holds(
        len(there) == n and min(there) >= _LEAST_SHARE * len(of) / n,
        key,
        f"{there} poses are of each model, of {n} in the rig",
    )
