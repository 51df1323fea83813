"""Claims of the tables: marginal gains, shares and members."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from planning.model.plan import RigPlan
from planning.verify.audit.coverage.area_claims import ROUNDING
from planning.verify.audit.estimates import POINT, Estimator
from planning.verify.audit.ledger import Ledger, as_number, entries, square_centimetres
from planning.verify.audit.predicates.recompute import Recomputed


def audit_marginal(own: Recomputed, estimator: Estimator, ledger: Ledger) -> None:
    """Check that tables rise on the target, and at the plan's count say its area.

    Devices are chosen for the target, so on the surface one more may well add less.
    """
    target = own.samples.in_target
    everything = np.ones_like(target)
    wholes = (("target", target), ("surface", everything))
    for kind, verb, mask, count in (
        ("projectors", "lit", own.lit, len(own.light)),
        ("cameras", "measured", own.measured, len(own.measured_by)),
    ):
        rows = marginal_rows(ledger.read("marginal"), kind)
        ledger.holds(len(rows) > 0, f"marginal.{kind}", "is missing")
        for part, within in wholes:
            whole = estimator.target_m2 if part == "target" else estimator.area_m2
            chosen = mask & within
            _audit_column(
                f"marginal.{kind}",
                f"n_{kind}",
                f"{verb}_{part}_m2",
                rows,
                _Column(
                    kind,
                    count,
                    estimator.area(chosen),
                    estimator.tolerance(chosen, whole),
                    whole,
                ),
                ledger,
            )


def marginal_rows(marginal: object, kind: str) -> list[Mapping[str, Any]]:
    """Return the rows of a kind: from a table for each, or from one common list."""
    table = marginal.get(kind) if isinstance(marginal, dict) else marginal
    return [
        row for row in entries(table) if as_number(row.get(f"n_{kind}")) is not None
    ]


@dataclass(frozen=True)
class _Column:
    """The plan's own entry in a column: kind and count of devices, areas in [m²]."""

    kind: str
    count: int
    area: float
    tolerance: float
    whole: float


def _audit_column(
    key: str,
    count_name: str,
    name: str,
    rows: list[Mapping[str, Any]],
    plan: _Column,
    ledger: Ledger,
) -> None:
    on_target = name.endswith("target_m2")
    table: list[tuple[int, float]] = []
    for row in rows:
        if name not in row:
            continue
        number, value = row[count_name], as_number(row[name])
        row_key = f"{key}.{number}.{name}"
        if number == plan.count:
            ledger.number(row_key, row[name], plan.area, plan.tolerance)
        elif value is None or not 0.0 <= value <= plan.whole * (1.0 + ROUNDING):
            ledger.fail(
                row_key,
                f"{row[name]!r} is claimed, must be an area of at most "
                f"{square_centimetres(plan.whole)}",
            )
        if value is not None:
            table.append((number, value))
    if on_target and rows:
        ledger.holds(table, key, f"{name} is missing")
    if not on_target:
        return
    for (fewer, less), (number, more) in pairwise(sorted(table)):
        ledger.holds(
            more >= less - plan.tolerance,
            key,
            f"{name} falls from {square_centimetres(less)} with {fewer} "
            f"{plan.kind[: -1 if fewer == 1 else None]} to "
            f"{square_centimetres(more)} with {number}, more than sampling explains "
            f"({square_centimetres(plan.tolerance)})",
        )


def audit_rest(plan: RigPlan, ledger: Ledger) -> None:
    """Check the dominant share, the mesh areas, and members of a single mesh."""
    document, surface = plan.to_document(), plan.surface
    share = float(
        surface.mesh.face_areas[surface.in_dominant].sum() / surface.mesh.area
    )
    ledger.number(
        "surface.dominant_share",
        ledger.read("surface", "dominant_share"),
        share,
        ROUNDING,
        "",
    )
    areas = [as_number(mesh.get("area_m2")) or 0.0 for mesh in document["meshes"]]
    total = surface.mesh.area
    ledger.number("meshes.area_m2 (sum)", sum(areas), total, POINT * 1e-2 * total)
    members = entries(document["members"])
    if len(document["meshes"]) == 1 and members:
        ledger.holds(
            len(members) == 1
            and members[0].get("coverage") in (document["coverage"], None),
            "members.0.coverage",
            "differs from coverage, of which it is the only member",
        )
        ledger.holds(
            members[0].get("reconstruction") in (document["reconstruction"], None),
            "members.0.reconstruction",
            "differs from reconstruction, of which it is the only member",
        )
