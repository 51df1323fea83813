"""Claims about what becomes of each ring: `ring_shares` of a projector."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.ledger import Ledger, as_number
from planning.verify.audit.predicates.predicates import (
    MEASURED,
    SEEN,
    AuditProjector,
    pair_steps,
    sight_steps,
)
from planning.verify.audit.predicates.recompute import audit_cameras

from .ring_light import RingLight

_SHARES = ("drawn", "on_object", "on_target", "measured")
# What each is a part of.
_WHOLE = {"on_object": "drawn", "on_target": "on_object", "measured": "on_object"}
# Azimuths behind a plan's claims (docs/method/rings.md), and the audit's own.
_CLAIMED_RAYS, _RAYS = 360, 480
# Rays of a ring are told from the next gap by taking them from just inside it.
_INSIDE = 1.0 - 1e-9
_DEVIATIONS = 5.0
_WRITTEN = 1e-4


def audit_ring_shares(
    plan: RigPlan, light: RingLight, seed: int, ledger: Ledger
) -> None:
    """Check the shares of every ring, each against rays of the audit's own.

    A share from n even azimuths is wrong by what happens at the ends of its k arcs.
    Ends fall anywhere between two rays, so its variance is at most k / n^2; were the
    rays independent, k would be n p (1 - p) and that is their variance, too.

    Args:
        plan: The plan.
        light: Its projectors' light.
        seed: Of where the audit's azimuths begin.
        ledger: Takes the false claims.
    """
    rng = np.random.default_rng((seed, _RAYS))
    for entry, lamp in zip(plan.to_document()["projectors"], light.lamps, strict=True):
        claims = entry.get("ring_shares")
        key = f"{entry['id']}.ring_shares"
        if not ledger.holds(isinstance(claims, dict), key, "is missing"):
            continue
        found = _shares(plan, light, lamp, rng.uniform())
        for name in _SHARES:
            _audit_share(f"{key}.{name}", claims.get(name), found[name], ledger)
        _audit_parts(key, claims, ledger)


def _shares(
    plan: RigPlan, light: RingLight, lamp: AuditProjector, start: float
) -> dict[str, NDArray[np.bool_]]:
    """What each ray of each ring does, shape (n_rings, n_rays) each."""
    n = len(lamp.radii)
    azimuths = np.linspace(start, start + 2.0 * np.pi, _RAYS, endpoint=False)
    coordinates = np.repeat(_INSIDE * lamp.radii, _RAYS)
    strikes = light.strike(lamp, coordinates, np.tile(azimuths, n))
    lit = strikes.rays[strikes.lit]
    samples = strikes.samples.take(strikes.lit)
    measured = np.zeros(len(lit), dtype=bool)
    for eye in audit_cameras(plan):
        left = np.flatnonzero(~measured)
        rest = samples.take(left)
        seen = sight_steps(eye, rest, plan.requirements.camera, light.shadow) == SEEN
        steps = pair_steps(lamp, eye, rest.take(seen), plan.requirements.triangulation)
        measured[left[seen]] = steps == MEASURED - SEEN
    chosen = {
        "drawn": np.flatnonzero(strikes.drawn),
        "on_object": strikes.rays,
        "on_target": strikes.rays[strikes.samples.in_target],
        "measured": lit[measured],
    }
    found: dict[str, NDArray[np.bool_]] = {}
    for name, rays in chosen.items():
        mask = np.zeros(n * _RAYS, dtype=bool)
        mask[rays] = True
        found[name] = mask.reshape(n, _RAYS)
    return found


def _audit_share(
    key: str, claimed: object, found: NDArray[np.bool_], ledger: Ledger
) -> None:
    """Compare the shares of all rings; one sentence for the worst of them."""
    n = len(found)
    values = claimed if isinstance(claimed, list) else []
    numbers = [as_number(value) for value in values]
    if not ledger.holds(
        len(numbers) == n and None not in numbers,
        key,
        f"must be a list of {n} shares, one for each ring",
    ):
        return
    shares = np.array(numbers, dtype=np.float64)
    truth = found.mean(axis=1)
    arcs = np.count_nonzero(found & ~np.roll(found, 1, axis=1), axis=1)
    tolerance = _WRITTEN + _DEVIATIONS * np.sqrt(
        (arcs + 1.0) * (1.0 / _CLAIMED_RAYS**2 + 1.0 / _RAYS**2)
    )
    excess = np.abs(shares - truth) - tolerance
    false = np.flatnonzero(~(excess <= 0.0))
    if len(false) == 0:
        return
    worst = int(false[np.argmax(excess[false])])
    more = f"; so are {len(false) - 1} others of {n} rings" if len(false) > 1 else ""
    ledger.fail(
        f"{key}.{worst}",
        f"claimed {100 * shares[worst]:.2f} %, recomputed {100 * truth[worst]:.2f} % "
        f"of the ring's azimuth, tolerance {100 * tolerance[worst]:.2g} %{more}",
    )


def _audit_parts(key: str, claims: Mapping[str, Any], ledger: Ledger) -> None:
    """What is measured, or on the target, lies on the object, and that is drawn."""
    for name, whole in _WHOLE.items():
        part, of = (
            np.array([as_number(value) for value in values], dtype=np.float64)
            if isinstance(values := claims.get(which), list)
            else np.zeros(0)
            for which in (name, whole)
        )
        if part.shape != of.shape:
            continue
        false = np.flatnonzero(part > of + _WRITTEN)
        ledger.holds(
            len(false) == 0,
            f"{key}.{name}",
            f"exceeds {whole}, of which it is a part, on ring {false[:1].tolist()}",
        )
