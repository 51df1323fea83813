"""Claims about what other numbers of devices cover: values, bounds and the table."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from planning.verify.audit.coverage.area_claims import ROUNDING
from planning.verify.audit.estimates import POINT
from planning.verify.audit.ledger import Ledger, as_number, entries, square_centimetres

from .table_claims import marginal_rows

# Covers are chosen on fewer samples than areas are claimed from.
FEWEST_ROWS = 1000


def audit_counts(
    key: str,
    claims: Mapping[str, Any],
    kind: str,
    whole: float,
    ledger: Ledger,
) -> None:
    """Check `by_count` against itself, `best_area`, `one_fewer` and the marginal table.

    What a number of candidates covers at most bounds what they were found to cover,
    and, but for sampling, what the marginal table says of as many: its rows for other
    counts than the plan's speak of candidates, too.

    Args:
        key: Of the certificate.
        claims: The certificate.
        kind: `projectors` or `cameras`.
        whole: Area of the target [m²].
        ledger: Takes the false claims.
    """
    bounds: dict[int, float] = {}
    for entry in entries(claims.get("by_count")):
        count, value, upper = (
            as_number(entry.get(k)) for k in ("count", "value_m2", "upper_bound_m2")
        )
        name = f"{key}.by_count"
        if count is None or value is None or upper is None:
            ledger.fail(name, f"{entry!r} must hold count, value_m2, upper_bound_m2")
            return
        ledger.holds(
            0.0 <= value <= upper * (1.0 + ROUNDING),
            name,
            f"for {count:g}: value_m2 {square_centimetres(value)} exceeds "
            f"upper_bound_m2 {square_centimetres(upper)}",
        )
        bounds[int(count)] = upper
    count = as_number(claims.get("count"))
    if not bounds or count is None:
        return
    for field, at in (("best_area", int(count)), ("one_fewer", int(count) - 1)):
        table = claims.get(field)
        if not isinstance(table, Mapping):
            continue
        upper = as_number(table.get("upper_bound_m2"))
        if upper is not None and at in bounds:
            ledger.number(
                f"{key}.{field}.upper_bound_m2",
                upper,
                bounds[at],
                ROUNDING * whole,
            )
    _audit_table(key, claims, kind, whole, bounds, ledger)


def _audit_table(
    key: str,
    claims: Mapping[str, Any],
    kind: str,
    whole: float,
    bounds: Mapping[int, float],
    ledger: Ledger,
) -> None:
    """No row of the marginal table for other counts exceeds the bound for as many."""
    verb = "lit" if kind == "projectors" else "measured"
    n_rows = max(as_number(claims.get("n_samples")) or 0.0, FEWEST_ROWS)
    for row in marginal_rows(ledger.read("marginal"), kind):
        number = as_number(row.get(f"n_{kind}"))
        area = as_number(row.get(f"{verb}_target_m2"))
        if number is None or area is None or number == claims.get("count"):
            continue
        upper = bounds.get(int(number))
        if upper is None:
            continue
        share = min(max(upper / whole, 1.0 / n_rows), 1.0 - 1.0 / n_rows)
        noise = 3.0 * float(np.sqrt(share * (1.0 - share) / n_rows))
        slack = whole * (POINT + noise)
        ledger.holds(
            area <= upper + slack,
            f"{key}.by_count",
            f"at most {square_centimetres(upper)} are claimed for {number:g}, but "
            f"marginal has {square_centimetres(area)} (tolerance "
            f"{square_centimetres(slack)})",
        )
