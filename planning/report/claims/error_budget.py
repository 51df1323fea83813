"""What is predicted of the errors of measured points, term by term."""

import numpy as np

from planning.model.document.coverage_records import PredictedSigma
from planning.scene.limits.pair_quality import NOISE_TERMS
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.camera_views import view_of
from planning.scene.measuring.measured import LitSamples, pairs_of
from planning.scene.scene import Scene

from .judged import Devices, Judged


def error_budget(
    scene: Scene, devices: Devices, target: Judged
) -> PredictedSigma | None:
    """Return the deviation of each measured sample's best pair; None: none is."""
    chosen = np.flatnonzero(target.measured)
    if not len(chosen):
        return None
    some = target.target.take(chosen)
    lit = LitSamples.of(devices.projectors, some, target.first[chosen] == LIT)
    limits = scene.requirements.triangulation
    least = np.full(len(chosen), np.inf)
    variance = {}
    for camera in devices.cameras:
        for pair in pairs_of(limits, lit, view_of(scene, camera, some)):
            total = np.where(pair.measured, pair.quality.total, np.inf)
            better = np.flatnonzero(total < least[pair.samples])
            rows = pair.samples[better]
            least[rows] = total[better]
            for name, term in pair.quality.terms.items():
                of_name = variance.setdefault(name, np.zeros(len(chosen)))
                of_name[rows] = term[better] ** 2
    noise = np.sqrt(sum(variance.get(name, 0.0) for name in NOISE_TERMS))
    (median, p95), (noise_median, noise_p95) = (
        np.quantile(values, (0.5, 0.95)).tolist() for values in (least, noise)
    )
    return PredictedSigma(
        median_m=median,
        p95_m=p95,
        noise_median_m=noise_median,
        noise_p95_m=noise_p95,
        terms_rms_m={k: float(np.sqrt(v.mean())) for k, v in variance.items()},
    )
