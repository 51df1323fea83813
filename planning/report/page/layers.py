"""What the surface may be coloured by: codes of each face, and what they mean."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.curvature.curvature import principal_curvatures
from planning.model.plan import RigPlan
from planning.report.summary.cause_words import CAUSE_WORDS
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.view_pairs import CAUSES
from planning.verify.reconstruction.check.cloud_file import BLUE_TO_RED, VIRIDIS

from .payload import quantised
from .per_face import PerFace

# Colours of categories, told apart by lightness as well as by hue: M. Okabe, K. Ito,
# "Color universal design", 2008, and greys.
_APART = (
    *("d55e00", "f0e442", "0072b2", "cc79a7", "009e73", "e69f00", "5d3a9b"),
    *("8c510a", "01665e", "404040"),
)
_MEASURED = "9fc8e8"
_NONE = "b9b2aa"
# Values beyond these quantiles take the colours of the ends.
_ENDS = (0.02, 0.98)
_TERMS = {
    "edges": "noise in the image",
    "matches": "noise of matches",
    "light": "noise of the light",
    "phase": "noise of the phase",
    "rings": "ring placement",
    "linearity": "the panel's pixels",
    "camera": "calibration of the camera",
    "projector": "calibration of the projector",
}


@dataclass(frozen=True, eq=False)
class Layer:
    """One way to colour the surface.

    Attributes:
        codes: One number a face, of one or two bytes, (n,).
        about: What the viewer needs to know: `id`, `label`, `unit`, `kind` and, of a
            `scale`, the values at both ends of codes and of colours with the palette,
            or else `classes`: code, words, colour and share of the area of each.
    """

    codes: NDArray[Any]
    about: dict[str, Any]


def layers(
    plan: RigPlan, samples: AuditSamples, facts: PerFace, error_m: Array | None
) -> Iterator[Layer]:
    """Yield the ways to colour a surface, that by the number of pairs first.

    Args:
        plan: The plan.
        samples: Centroids of all faces.
        facts: What the plan does there.
        error_m: Mean signed distance of the points measured on each face, NaN where
            there are none, (n,) [m]; None: no check was made in this run.
    """
    areas = samples.weights
    yield _counts(facts, areas, alone=plan.cameras_alone)
    yield _causes(facts.cause(samples), areas)
    yield from _scales(facts)
    if (curved := _curvedness(plan)) is not None:
        yield _scale("curved", "curvedness", "1/mm", 1e-3 * curved)
    yield _regions(plan, samples.region, areas)
    if error_m is not None and np.isfinite(error_m).any():
        label = "measured error, outside positive"
        yield _scale("error", label, "mm", 1e3 * error_m, signed=True)


def _scales(facts: PerFace) -> Iterator[Layer]:
    label = "predicted sigma of the best pair, along the normal"
    yield _scale("sigma", label, "mm", 1e3 * facts.sigma)
    for name, values in facts.terms.items():
        about = f"sigma by {_TERMS.get(name, name)}"
        yield _scale(f"sigma.{name}", about, "mm", 1e3 * values)
    label = "triangulation angle of the best pair"
    yield _scale("angle", label, "degrees", np.degrees(facts.angle))


def _scale(
    name: str, label: str, unit: str, values: Array, *, signed: bool = False
) -> Layer:
    known = values[np.isfinite(values)]
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    first, last = np.quantile(known, _ENDS) if len(known) else (0.0, 1.0)
    if signed:
        last = max(abs(first), abs(last))
        first = -last
        # Codes reach twice as far: a single false point mustn't coarsen all others.
        low, high = max(low, 2.0 * first), min(high, 2.0 * last)
    return Layer(
        quantised(values, float(low), float(high)),
        {
            **{"id": name, "label": label, "unit": unit, "kind": "scale"},
            **{"low": float(low), "high": float(high)},
            **{"first": float(first), "last": float(last)},
            "palette": (BLUE_TO_RED if signed else VIRIDIS).split(),
        },
    )


def _counts(facts: PerFace, areas: Array, *, alone: bool) -> Layer:
    """By how many pairs measure a face."""
    counts = np.minimum(facts.n_pairs, 254)
    most = int(counts.max(initial=0))
    # Without the darkest, on which no shape shows.
    shades = VIRIDIS.split()[4:]

    def colour(count: int) -> str:
        return shades[(count - 1) * (len(shades) - 1) // max(most - 1, 1)]

    classes = [
        (k, f"{k} pair{'s' * (k != 1)}" if k else "none", colour(k) if k else _NONE)
        for k in range(most + 1)
    ]
    whose = "pairs of cameras" if alone else "pairs of projector and camera"
    label = f"{whose} that measure it"
    return _classes("pairs", label, counts.astype(np.uint8), classes, areas)


def _causes(cause: NDArray[np.int64], areas: Array) -> Layer:
    """By the limit that forbids a face, as the audit names it."""
    codes = np.where(cause < 0, 255, cause).astype(np.uint8)
    taken = np.bincount(cause[cause >= 0], areas[cause >= 0], len(CAUSES))
    ranked = [k for k in np.argsort(-taken, kind="stable").tolist() if taken[k] > 0.0]
    classes = [(255, "measured", _MEASURED)]
    for rank, k in enumerate(ranked):
        words = f"{CAUSE_WORDS.get(CAUSES[k], CAUSES[k])} ({CAUSES[k]})"
        classes.append((k, words, _APART[min(rank, len(_APART) - 1)]))
    label = "the limit that keeps it from being measured"
    return _classes("cause", label, codes, classes, areas)


def _regions(plan: RigPlan, region: NDArray[np.int64], areas: Array) -> Layer:
    """By dominant region."""
    codes = np.where(region < 0, 65535, region).astype(np.uint16)
    classes = [(65535, "no region", _NONE)]
    for record in plan.document.regions:
        colour = _APART[record.id % len(_APART)]
        classes.append((record.id, f"region {record.id}", colour))
    return _classes("region", "region", codes, classes, areas)


def _classes(
    name: str,
    label: str,
    codes: NDArray[Any],
    classes: list[tuple[int, str, str]],
    areas: Array,
) -> Layer:
    whole = max(float(areas.sum()), 1e-300)
    by_code = np.bincount(codes, areas, int(codes.max(initial=0)) + 1) / whole
    rows = [
        {
            **{"code": code, "words": words, "colour": colour},
            "share": float(by_code[code]) if code < len(by_code) else 0.0,
        }
        for code, words, colour in classes
    ]
    about = {"id": name, "label": label, "unit": "", "kind": "classes"}
    return Layer(codes, about | {"classes": rows})


def _curvedness(plan: RigPlan) -> Array | None:
    """Root mean square of both curvatures on faces [1/m], NaN where not trusted.

    At the scale that regions were found at; None where the plan doesn't state one.
    """
    mesh = plan.surface.mesh
    if not plan.document.surface.curvature_radius_m > 0.0:
        return None
    field = principal_curvatures(mesh)
    curved = np.where(field.valid, field.curvedness, np.nan)
    return curved[mesh.faces].mean(axis=1)
