"""Claims about how a projector's rings are spaced."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.coverage.area_claims import ROUNDING
from planning.verify.audit.estimates import POINT
from planning.verify.audit.ledger import Ledger
from planning.verify.audit.predicates.audit_optics import in_frame
from planning.verify.audit.predicates.predicates import AuditProjector

from .extremes import audit_extreme
from .ring_light import RingLight, Strikes, ring_spacing

# Rays of a closer look, and how many times it is taken before a claim is false.
_RAYS = 60_000
_LOOKS = 8


def audit_spacing(
    key: str,
    rings: Mapping[str, Any],
    lamp: AuditProjector,
    wish: object,
    ledger: Ledger,
) -> NDArray[np.float64] | None:
    """Check `spacing`, `kept_even` and `n_even` against the radii.

    Args:
        key: Of the claims.
        rings: What is claimed of a projector's rings.
        lamp: The projector.
        wish: `rings.spacing` of the rig.
        ledger: Takes the false claims.

    Returns:
        Radii of the even rings; None if the plan doesn't say how many there were.
    """
    spacing, kept, count = (rings.get(k) for k in ("spacing", "kept_even", "n_even"))
    ledger.holds(
        spacing in ("uniform", "curvature"),
        f"{key}.spacing",
        f"{spacing!r} must be 'uniform' or 'curvature'",
    )
    ledger.holds(
        spacing == "uniform" or wish != "uniform",
        f"{key}.spacing",
        f"{spacing!r} is claimed, but rig.rings.spacing is 'uniform'",
    )
    ledger.holds(
        kept is (spacing == "uniform" and wish == "curvature"),
        f"{key}.kept_even",
        f"{kept!r} is claimed where rings are {spacing!r} and rig.rings.spacing is "
        f"{wish!r}",
    )
    if not isinstance(count, int) or isinstance(count, bool) or count < 2:
        ledger.fail(f"{key}.n_even", f"{count!r} must be a number of rings, at least 2")
        return None
    even = float(lamp.radii[-1]) * np.arange(1, count + 1) / count
    ledger.holds(
        spacing != "uniform"
        or (
            len(even) == len(lamp.radii)
            and np.allclose(lamp.radii, even, rtol=0.0, atol=ROUNDING * even[-1])
        ),
        f"{key}.n_even",
        f"the {len(lamp.radii)} ring_radii aren't {count} at equal steps, but "
        f"'uniform' is claimed",
    )
    return even


def audit_gaps(
    key: str,
    rings: Mapping[str, Any],
    lamp: AuditProjector,
    even: NDArray[np.float64],
    strikes: Strikes,
    ledger: Ledger,
    light: RingLight,
    rng: np.random.Generator,
) -> None:
    """Check `gap_m`, the least and largest distance of rings on lit surface.

    No gap there is wider than an even one: that bounds `n_even`. A lit sliver that the
    plan met and these rays didn't is looked for before its gap is called false.

    Args:
        key: Of the claims.
        rings: What is claimed of a projector's rings.
        lamp: The projector.
        even: Radii of the even rings.
        strikes: Random rays of its light.
        ledger: Takes the false claims.
        light: Casts the rays of a closer look.
        rng: Draws them.
    """
    points = strikes.samples.points[strikes.lit]
    found, claimed = ring_spacing(lamp, points), rings.get("gap_m")
    if len(found) == 0:
        # A sliver may be lit that no ray of the audit met.
        return
    ends = claimed if isinstance(claimed, list) and len(claimed) == 2 else [None, None]
    weights = np.ones(len(found))
    for place, largest in ((0, False), (1, True)):
        audit_extreme(
            f"{key}.gap_m.{place}",
            ends[place],
            found,
            weights,
            ledger,
            largest=largest,
            unit="m",
            closer=partial(_closer, light, lamp, rng.spawn(1)[0], largest),
        )
    allowed = ring_spacing(replace(lamp, radii=even), points)
    share = float(np.mean(found > allowed * (1.0 + ROUNDING)))
    ledger.holds(
        share <= POINT,
        f"{key}.n_even",
        f"{len(even)} even rings stand closer than the plan's on {100 * share:.3g} % "
        f"of its light on the surface, nowhere may they",
    )


def _closer(
    light: RingLight,
    lamp: AuditProjector,
    rng: np.random.Generator,
    largest: bool,
    bound: float,
) -> NDArray[np.float64]:
    """Return ring distances on lit surface where they may reach a bound [m].

    Rays through those annuli alone whose rings stand that far apart (or that close) at
    the farthest (nearest) vertex; as many times as it takes to meet one.
    """
    inner, outer = np.append(0.0, lamp.radii[:-1]), lamp.radii
    gap = outer - inner
    gap[0] = gap[1]
    if lamp.diverging:
        depth = in_frame(lamp.world_from_ring, light.mesh.vertices)[:, 2]
        slope = np.hypot(1.0, inner if largest else outer)
        gap = gap * (depth.max() if largest else depth.min()) / slope
    may = np.flatnonzero(gap >= bound if largest else gap <= bound)
    found = np.empty(0)
    for _ in range(_LOOKS if len(may) else 0):
        width = (outer - inner)[may]
        ring = may[rng.choice(len(may), size=_RAYS, p=width / width.sum())]
        coordinates = rng.uniform(inner[ring], outer[ring])
        met = light.strike(lamp, coordinates, rng.uniform(0.0, 2.0 * np.pi, _RAYS))
        found = ring_spacing(lamp, met.samples.points[met.lit])
        if np.any(found >= bound if largest else found <= bound):
            break
    return found
