"""What was predicted against what was measured, sample by sample and by region.

A sample counts as measured if a point lies within tau that was seen from its own side.
So may samples in the shade, a little beside what is lit: whether these are says nothing
of the prediction, and they are counted apart.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geometry.arrays import lengths
from geometry.mesh.sampling import SurfaceSamples
from planning.model.document.check_records import (
    ConfusionPair,
    ConfusionRecord,
    ConfusionRecords,
    SurfaceShare,
)
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

from .accuracy import Accuracy, nearest_distance


@dataclass(frozen=True, eq=False)
class PredictedSamples:
    """What a plan says of samples of its surface.

    Attributes:
        samples: Points of the whole surface.
        weights: Area that each stands for [m²], shape (n,).
        claimed: Measurable by each camera within the plan's limits, shape (n_c, n).
        possible: The same at the limits at which light and decoder fail, (n_c, n).
    """

    samples: SurfaceSamples
    weights: Array
    claimed: Mask
    possible: Mask


@dataclass(frozen=True, eq=False)
class Comparison:
    """Prediction against measurement, as a plan file records it.

    Attributes:
        confusion: Of target and surface, by the plan's limits and by the floors.
        by_region: What each dominant region got.
        dominant: What all of them together got; None without any.
        whole_surface: What the whole mesh got.
    """

    confusion: ConfusionRecords
    by_region: tuple[SurfaceShare, ...]
    dominant: SurfaceShare | None
    whole_surface: SurfaceShare


def compare(
    plan: Scanner,
    prediction: PredictedSamples,
    everything: Cloud,
    accuracy: Accuracy | None,
) -> Comparison:
    """Return how prediction and measurement compare.

    Args:
        plan: Of which the prediction is.
        prediction: Over samples of the whole surface.
        everything: All points, before redundancy was removed.
        accuracy: Of the merged cloud.
    """
    samples, tau_m = prediction.samples, plan.limits.check.tau_m
    measured = nearest_distance(everything, samples, 1.01 * tau_m) <= tau_m
    everywhere = np.ones(len(measured), dtype=bool)
    by_limits, by_floors = (
        (np.any(by_camera, axis=0), _widened(by_camera, samples, plan))
        for by_camera in (prediction.claimed, prediction.possible)
    )

    def tables(area: Mask) -> ConfusionPair:
        limits, floors = (
            confusion(
                predicted[area], near[area], measured[area], prediction.weights[area]
            )
            for predicted, near in (by_limits, by_floors)
        )
        return ConfusionPair(limits=limits, floors=floors)

    def share(area: Mask, faces: Mask, **region: int) -> SurfaceShare:
        shares = _shares(prediction, measured, area)
        return SurfaceShare(**region, **shares, **_errors(accuracy, faces))

    dominant, region = plan.region >= 0, plan.region[samples.faces]
    ids = [int(i) for i in np.unique(plan.region[dominant])]
    return Comparison(
        ConfusionRecords(
            target=tables(plan.target[samples.faces]), surface=tables(everywhere)
        ),
        tuple(share(region == i, plan.region == i, id=i) for i in ids),
        share(region >= 0, dominant) if ids else None,
        share(everywhere, np.ones(len(dominant), dtype=bool)),
    )


def confusion(
    predicted: Mask, near: Mask, measured: Mask, weights: Array
) -> ConfusionRecord:
    """Return areas by prediction and measurement, as shares of their sum.

    What isn't predicted, but within tau of what was (`near`), is `beside`: either may
    be. `agreement` is the share of the rest of which the prediction is right, and
    `trivial_agreement` that of the better of two predictors: all, or nothing, is
    measured. Of no area at all, nothing was predicted nor measured.

    Args:
        predicted: Samples predicted measurable, shape (n,).
        near: Those within tau of such, (n,).
        measured: Those within tau of a point, (n,).
        weights: Area of each [m²], (n,).
    """
    total, far = float(weights.sum()), ~predicted & ~near
    cells = {
        "both": predicted & measured,
        "missing": predicted & ~measured,
        "unexpected": far & measured,
        "neither": far & ~measured,
        "beside": ~predicted & near,
    }
    if total > 0.0:
        shares = {
            name: float(weights[cell].sum()) / total for name, cell in cells.items()
        }
    else:
        shares = dict.fromkeys(cells, 0.0) | {"neither": 1.0}
    both, missing, unexpected, neither, _ = shares.values()
    right, wrong = both + neither, missing + unexpected
    yes, no = both + unexpected, missing + neither
    return ConfusionRecord(
        **shares,
        agreement=right / (right + wrong) if right > 0.0 else 0.0,
        trivial_agreement=max(yes, no) / (yes + no) if yes + no > 0.0 else 0.0,
    )


def _widened(by_camera: Mask, samples: SurfaceSamples, plan: Scanner) -> Mask:
    """Which samples lie within tau of what a camera would measure, shape (n,)."""
    cameras, chosen = np.nonzero(by_camera)
    tau_m, points = plan.limits.check.tau_m, samples.points[chosen]
    rays = points - np.array([camera.centre for camera in plan.cameras])[cameras]
    rays /= lengths(rays)[:, None]
    ideal = replace(
        Cloud.empty(), points=points, rays=rays, camera=cameras.astype(np.int16)
    )
    return nearest_distance(ideal, samples, 1.01 * tau_m) <= tau_m


def _shares(
    prediction: PredictedSamples, measured: Mask, area: Mask
) -> dict[str, float | None]:
    """Shares of a part of the surface; None where nothing of it was sampled."""
    weights = prediction.weights[area]
    claimed = np.any(prediction.claimed, axis=0)[area]

    def share(of: Mask, among: Mask) -> float | None:
        total = float(weights[among].sum())
        return float(weights[of & among].sum()) / total if total > 0.0 else None

    whole = np.ones(len(weights), dtype=bool)
    return {
        "predicted": share(claimed, whole),
        "measured": share(measured[area], whole),
        "predicted_missing": share(~measured[area], claimed),
    }


def _errors(accuracy: Accuracy | None, faces: Mask) -> dict[str, Any]:
    """Errors of the points whose nearest face is one of these."""
    near = None if accuracy is None else accuracy.take(faces[accuracy.faces])
    if near is None or not len(near):
        return {"n_points": 0, "rms_m": None, "p95_m": None, "bias_m": None}
    errors = {"rms_m": near.rms_m, "p95_m": near.p95_m, "bias_m": near.bias_m}
    return {"n_points": len(near), **errors}
