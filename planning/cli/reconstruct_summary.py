"""What `plan reconstruct` prints for people."""

from pathlib import Path

from planning.model.plan import RigPlan
from planning.verify.reconstruction.check.result import PairCount, Reconstruction
from planning.verify.reconstruction.cloud_file import CloudFile

_MM = 1e3


def summary(
    plan: RigPlan, found: Reconstruction, file: CloudFile | None, path: Path
) -> str:
    """Return the result in a few lines; the verdict is the last."""
    lines = [_pair_line(pair) for pair in found.pairs]
    lines += _figures(plan, found)
    if file is None:
        lines.append("cloud    none was written")
    else:
        lines += [
            f"cloud    {path}: {len(file.rows)} points, positions in {file.unit.name}",
            f"colours  sigma along the normal: {file.legend}",
        ]
    lines += [f"not met: {sentence}" for sentence in found.failures]
    n = len(found.failures)
    lines.append(
        "reconstructed: every limit of the check is kept"
        if found.passed
        else f"NOT reconstructed as planned: {n} failure{'s' * (n > 1)}"
    )
    return "\n".join(lines)


def _pair_line(pair: PairCount) -> str:
    left_out = sum(pair.rejected.values())
    return (
        f"{pair.projector} with {pair.camera}: {pair.n_points} points of "
        f"{pair.n_edges} edges, {left_out} left out, {pair.lit_pixels} pixels lit"
    )


def _figures(plan: RigPlan, found: Reconstruction) -> list[str]:
    limits = plan.requirements.check
    if found.accuracy is None:
        return []
    accuracy, complete = found.accuracy, found.completeness
    near = ", ".join(
        f"{share:.1%} within {_MM * tau:.1f} mm"
        for tau, share in zip(complete.thresholds_m, complete.fractions, strict=True)
    )
    missing = complete.predicted_missing
    lines = [
        f"merged   {found.n_merged} points of {found.n_points}, "
        f"{found.redundant_fraction:.1%} redundant",
        f"accuracy against the mesh: rms {_MM * accuracy.rms_m:.3f} mm (limit "
        f"{_MM * limits.max_rms_m:g}), p95 {_MM * accuracy.p95_m:.3f} "
        f"({_MM * limits.max_p95_m:g}), bias {_MM * accuracy.bias_m:+.3f} "
        f"({_MM * limits.max_bias_m:g}), max {_MM * accuracy.max_m:.3f}",
        f"completeness of the target predicted measured: {near}",
    ]
    if missing is not None:
        lines[-1] += f"; {missing:.2%} missing ({limits.max_predicted_missing:.0%})"
    return lines
