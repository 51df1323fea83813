"""What was predicted against what was measured, sample by sample and by region.

A sample counts as measured if a point lies within tau that was seen from its own side.
So may samples in the shade, a little beside what is lit: whether these are says nothing
of the prediction, and they are counted apart.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from geometry.mesh.sampling import SurfaceSamples
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.cloud import Cloud

from .accuracy import Accuracy, nearest_distance


@dataclass(frozen=True, eq=False)
class PredictedSamples:
    """What a plan says of samples of its surface.

    Attributes:
        samples: Points of the whole surface.
        weights: Area that each stands for [m²], shape (n,).
        in_target: Whether each lies in the target, shape (n,).
        region: Dominant region of each, -1 for none, shape (n,).
        centres: Of the cameras [m], shape (n_c, 3).
        claimed: Measurable by each camera within the plan's limits, shape (n_c, n).
        possible: The same at the limits at which light and decoder fail, (n_c, n).
    """

    samples: SurfaceSamples
    weights: Array
    in_target: Mask
    region: Indices
    centres: Array
    claimed: Mask
    possible: Mask

    def widened(self, by_camera: Mask, tau_m: float) -> Mask:
        """Return which samples lie within tau of what a camera would measure, (n,)."""
        cameras, chosen = np.nonzero(by_camera)
        points = self.samples.points[chosen]
        rays = points - self.centres[cameras]
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        ideal = replace(
            Cloud.empty(), points=points, rays=rays, camera=cameras.astype(np.int16)
        )
        return nearest_distance(ideal, self.samples, 1.01 * tau_m) <= tau_m


@dataclass(frozen=True)
class Confusion:
    """Areas by what was predicted and what was measured, as shares of their sum.

    Attributes:
        both: Predicted, and measured.
        missing: Predicted, but not measured.
        unexpected: Measured, though nothing within tau was predicted.
        neither: Not measured, and nothing within tau was predicted.
        beside: Not predicted, but within tau of what was: either may be.
    """

    both: float
    missing: float
    unexpected: float
    neither: float
    beside: float

    @classmethod
    def of(
        cls, predicted: Mask, near: Mask, measured: Mask, weights: Array
    ) -> "Confusion":
        """Count areas; of no area at all, nothing was predicted nor measured.

        Args:
            predicted: Samples predicted measurable, shape (n,).
            near: Samples within tau of predicted ones, shape (n,).
            measured: Samples within tau of a point, shape (n,).
            weights: Area of each [m²], shape (n,).
        """
        total = float(weights.sum())
        if not total > 0.0:
            return cls(0.0, 0.0, 0.0, 1.0, 0.0)
        far = ~predicted & ~near
        cells = (
            predicted & measured,
            predicted & ~measured,
            far & measured,
            far & ~measured,
            ~predicted & near,
        )
        return cls(*(float(weights[cell].sum()) / total for cell in cells))

    @property
    def agreement(self) -> float:
        """Share of which the prediction is right, of all that isn't beside."""
        right, wrong = self.both + self.neither, self.missing + self.unexpected
        return right / (right + wrong) if right > 0.0 else 0.0

    @property
    def trivial(self) -> float:
        """Agreement of the better of two predictors: all, or nothing, is measured."""
        yes, no = self.both + self.unexpected, self.missing + self.neither
        return max(yes, no) / (yes + no) if yes + no > 0.0 else 0.0

    def to_document(self) -> dict[str, float]:
        """Return plain JSON values."""
        derived = {"agreement": self.agreement, "trivial_agreement": self.trivial}
        return asdict(self) | derived


@dataclass(frozen=True, eq=False)
class Comparison:
    """PredictedSamples against measurement, and what every part of the surface got.

    Attributes:
        tables: By `target` and `surface`, then by `limits` (of the plan) and `floors`.
        regions: A row for each dominant region.
        dominant: A row for all of them together; None without any.
        surface: A row for the whole mesh.
    """

    tables: Mapping[str, Mapping[str, Confusion]]
    regions: tuple[dict[str, Any], ...]
    dominant: dict[str, Any] | None
    surface: dict[str, Any]

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "confusion": {
                part: {by: table.to_document() for by, table in tables.items()}
                for part, tables in self.tables.items()
            },
            "by_region": list(self.regions),
            "dominant": self.dominant,
            "whole_surface": self.surface,
        }


def compare(
    prediction: PredictedSamples,
    everything: Cloud,
    accuracy: Accuracy | None,
    face_region: Indices,
    tau_m: float,
) -> Comparison:
    """Return how prediction and measurement compare.

    Args:
        prediction: Of the plan, over samples of the whole surface.
        everything: All points, before redundancy was removed.
        accuracy: Of the merged cloud against the mesh.
        face_region: Dominant region of each face, -1 for none, shape (n_faces,).
        tau_m: One ring gap [m].
    """
    distance = nearest_distance(everything, prediction.samples, 1.01 * tau_m)
    measured = distance <= tau_m
    weights = prediction.weights
    parts = {
        "target": prediction.in_target,
        "surface": np.ones(len(measured), dtype=bool),
    }
    predictions = {
        by: (_by_any(by_camera), prediction.widened(by_camera, tau_m))
        for by, by_camera in (
            ("limits", prediction.claimed),
            ("floors", prediction.possible),
        )
    }
    tables = {
        name: {
            by: Confusion.of(own[part], near[part], measured[part], weights[part])
            for by, (own, near) in predictions.items()
        }
        for name, part in parts.items()
    }

    def row(part: Mask, faces: Mask) -> dict[str, Any]:
        return _row(prediction, measured, part) | _errors(accuracy, faces)

    ids = [int(i) for i in np.unique(face_region[face_region >= 0])]
    dominant = face_region >= 0
    return Comparison(
        tables,
        tuple({"id": i, **row(prediction.region == i, face_region == i)} for i in ids),
        row(prediction.region >= 0, dominant) if ids else None,
        row(parts["surface"], np.ones(len(face_region), dtype=bool)),
    )


def _by_any(by_camera: Mask) -> Mask:
    return np.asarray(by_camera.any(axis=0))


def _row(prediction: PredictedSamples, measured: Mask, part: Mask) -> dict[str, Any]:
    """Shares of a part of the surface; null where nothing of it was sampled."""
    weights = prediction.weights[part]
    claimed = _by_any(prediction.claimed)[part]

    def share(of: Mask, among: Mask) -> float | None:
        total = float(weights[among].sum())
        return float(weights[of & among].sum()) / total if total > 0.0 else None

    whole = np.ones(len(weights), dtype=bool)
    return {
        "predicted": share(claimed, whole),
        "measured": share(measured[part], whole),
        "predicted_missing": share(~measured[part], claimed),
    }


def _errors(accuracy: Accuracy | None, faces: Mask) -> dict[str, Any]:
    """Errors of the points whose nearest face is one of these."""
    nothing = {"n_points": 0, "rms_m": None, "p95_m": None, "bias_m": None}
    if accuracy is None or not np.any(faces[accuracy.faces]):
        return nothing
    here = faces[accuracy.faces]
    near = Accuracy(accuracy.distances[here], accuracy.faces[here])
    values = int(here.sum()), near.rms_m, near.p95_m, near.bias_m
    return dict(zip(nothing, values, strict=True))
