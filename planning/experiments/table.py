"""What an experiment gave, as lines to read and as plain values."""

from collections.abc import Sequence
from dataclasses import astuple
from typing import Any

import numpy as np

from planning.verify.reconstruction.calibration import DeviceCalibration
from planning.verify.reconstruction.check.accuracy import share_of

from .ground_truth import Errors, LabelCount, MeasuredErrors
from .paper_devices import CAMERA_PX, PROJECTOR_PX
from .run import Outcome
from .setups import Experiment

_MM = 1e3
_NUMBERS = (
    f"{'points':>8s}{'rms':>8s}{'p95':>8s}{'bias':>9s}{'> 1 mm':>9s}{'rest rms':>10s}"
)


def setup_lines(experiment: Experiment) -> list[str]:
    """Return what is set up: numbers of the paper, then ours."""
    optics, scanner = experiment.optics, experiment.scanner
    width, height = (_MM * side for side in optics.field_m)
    radii = ", ".join(f"{_MM * radius:.4g}" for radius in experiment.radii_m)
    u, v = optics.centre_px
    sides = np.ptp(experiment.mesh.bounds, axis=0)
    extent = " x ".join(f"{_MM * side:.0f}" for side in sides)
    panel, image = (f"{w} x {h} px" for w, h in (PROJECTOR_PX, CAMERA_PX))
    lens = f", k1 = {optics.distortion:g}" if optics.distortion else ""
    return [
        f"{experiment.name}, {extent} mm; {experiment.light} light",
        f"{len(scanner.projectors)} projectors of {panel}, "
        f"{len(experiment.radii_m)} circles: {radii} mm",
        f"{len(scanner.cameras)} cameras of {image}, about 1 m; "
        f"f = {optics.focal_px:g} px, centre ({u:g}, {v:g}){lens}: {width:.0f} x "
        f"{height:.0f} mm at 1 m",
    ]


def cloud_lines(clouds: Sequence[MeasuredErrors]) -> list[str]:
    """Return a table of errors, a row for each cloud."""
    lines = [f"{'points of':24s}{_NUMBERS}{'half gap':>10s}{'one gap':>9s}"]
    for one in clouds:
        half, whole = one.complete
        lines.append(f"{one.name:24s}{_numbers(one.errors)}{half:10.3f}{whole:9.3f}")
    return lines


def ring_lines(outcome: Outcome) -> list[str]:
    """Return a table with a row for each ring of each projector.

    Shares are of the circumference; errors of all points of the ring.
    """
    cameras = [camera.id for camera in outcome.experiment.scanner.cameras]
    shown = "".join(f"{'seen ' + name:>9s}" for name in cameras)
    got = "".join(f"{'got ' + name:>9s}" for name in cameras)
    lines = [
        f"{'ring':10s}{'mm':>7s}{'landed':>9s}{shown}{got}{'got any':>9s}{_NUMBERS}"
    ]
    for ring in outcome.outcomes:
        seen = "".join(f"{ring.seen[name]:9.3f}" for name in cameras)
        measured = "".join(f"{ring.measured[name]:9.3f}" for name in cameras)
        radius = _MM * outcome.experiment.radii_m[ring.ring]
        lines.append(
            f"{ring.projector + ' ' + str(ring.ring + 1):10s}{radius:7.1f}"
            f"{ring.on_object:9.3f}{seen}{measured}{ring.measured_by_any:9.3f}"
            f"{_numbers(outcome.errors_of(ring))}"
        )
    return lines


def label_line(labels: LabelCount) -> str:
    """Return how labels of single images compare with the truth."""
    n, *counts = astuple(labels)
    right, wrong, stray, off, unsure = (100.0 * count / max(n, 1) for count in counts)
    return (
        f"labels by the prior mesh: {n} points of lines; right {right:.1f} %, "
        f"wrong {wrong:.2f} %, on no ring {stray:.2f} %, left out "
        f"{off + unsure:.1f} % ({unsure:.1f} ambiguous, {off:.1f} off the prior)"
    )


def outcome_lines(outcome: Outcome, both: MeasuredErrors | None = None) -> list[str]:
    """Return all that there is to read; `both`: with a second sequence, if any."""
    return [
        *setup_lines(outcome.experiment),
        f"{100 * outcome.visible:.1f} % of the surface is inside the outermost ring, "
        f"lit and seen; completeness is of it, at half a ring gap and one, "
        f"{_MM * outcome.experiment.gap_m:.1f} mm; lengths in mm",
        "",
        *cloud_lines(outcome.clouds),
        f"merged: {outcome.reconstruction.merging}",
        "",
        *ring_lines(outcome),
        *([] if outcome.labels is None else ["", label_line(outcome.labels)]),
        *([] if both is None else ["", *cloud_lines((outcome.union, both))]),
    ]


def outcome_document(
    outcome: Outcome, both: MeasuredErrors | None = None
) -> dict[str, Any]:
    """Return the same as plain values, in metres."""
    experiment = outcome.experiment
    scanner = experiment.scanner
    second = {}
    if both is not None:
        clouds = {"first": outcome.union, "both": both}
        second["second_sequence"] = {k: _cloud_document(v) for k, v in clouds.items()}
    return {
        "experiment": experiment.name,
        "variant": experiment.variant,
        "light": experiment.light,
        "focal_px": experiment.optics.focal_px,
        "centre_px": list(experiment.optics.centre_px),
        "distortion_k1": experiment.optics.distortion,
        "ambient": outcome.photometry.ambient,
        "radii_m": experiment.radii_m.tolist(),
        "ring_gap_m": experiment.gap_m,
        "projectors": [
            {
                **_device_document(one),
                "light": one.light.name,
                "world_from_ring": one.world_from_ring.tolist(),
                "ring_radii": one.pattern.radii.tolist(),
            }
            for one in scanner.projectors
        ],
        "cameras": [
            {**_device_document(one), "distortion": list(one.distortion)}
            for one in scanner.cameras
        ],
        "observable_share": outcome.visible,
        "labels": None if outcome.labels is None else vars(outcome.labels),
        "clouds": [_cloud_document(one) for one in outcome.clouds],
        "overlap_share": share_of(outcome.reconstruction.merged.shared),
        "step_share": outcome.reconstruction.step_fraction,
        "rings": [
            vars(ring) | {"errors": vars(outcome.errors_of(ring))}
            for ring in outcome.outcomes
        ],
        **second,
    }


def _device_document(device: DeviceCalibration) -> dict[str, Any]:
    """Pose and interior; of parallel light, pixels a metre on the diagonal of K."""
    return {
        "id": device.id,
        "world_from_device": device.world_from_device.tolist(),
        "K": device.matrix.tolist(),
        "resolution": list(device.resolution),
    }


def _cloud_document(one: MeasuredErrors) -> dict[str, Any]:
    return {
        "name": one.name,
        "errors": vars(one.errors),
        "completeness_half_gap": one.complete[0],
        "completeness_one_gap": one.complete[1],
    }


def _numbers(errors: Errors) -> str:
    """Columns: points, rms, p95, bias in mm, share of outliers, rms of the rest."""
    if errors.n == 0:
        return f"{errors.n:8d}{'-':>8s}{'-':>8s}{'-':>9s}{'-':>9s}{'-':>10s}"
    rms, p95, bias, outliers, rest = (value or 0.0 for value in astuple(errors)[1:])
    return (
        f"{errors.n:8d}{_MM * rms:8.3f}{_MM * p95:8.3f}{_MM * bias:+9.4f}"
        f"{100 * outliers:8.2f}%{_MM * rest:10.3f}"
    )
