"""What a check found, and why edges gave no point, in words."""

from dataclasses import dataclass
from functools import cached_property

from planning.verify.reconstruction.arrays import Mask
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import PairCount
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.scanner import Scanner

from .supposed import Supposed

REJECTED = {
    "labels": "the codes contradict the patterns: frames out of order or of another "
    "projector, or two projectors on at once",
    "unconfirmed": "other pairs contradict the points, or have surer ones there",
    "off_prior": "no ring meets the rays near the prior mesh",
    "ambiguous": "several rings meet the rays near the prior mesh: fewer rings or a "
    "better prior would tell them apart",
    "no_intersection": "the rays miss the rings: a pose isn't that of the plan",
    "root": "the root disc was drawn for another place of the camera",
    "conditioning": "the rays run along the rings' cones, where the two roots meet",
    "outside_panel": "the points lie outside the projector's image",
    "isolated": "the edges are scattered: little light, or nearly hidden",
    "depth_step": "the edges hang between surfaces, or the surface is too slanted",
}


def rejection(pairs: tuple[PairCount, ...]) -> str | None:
    """Return in words what most edges of pairs were left out for, None without any."""
    count = {cause: sum(p.rejected.get(cause, 0) for p in pairs) for cause in REJECTED}
    cause = max(REJECTED, key=lambda name: count[name])
    if not count[cause]:
        return None
    n_edges = sum(pair.n_edges for pair in pairs)
    return f"{count[cause]} of {n_edges} edges left out as `{cause}`, {REJECTED[cause]}"


@dataclass(frozen=True, eq=False)
class MeasuredClouds:
    """What a check found, for the search for causes.

    Attributes:
        counts: What was decoded, in numbers.
        cloud: All points, before redundancy was removed.
        missing: Which of the expected samples have no point, shape (n,).
    """

    plan: Scanner
    decoded: Pairs
    counts: tuple[PairCount, ...]
    cloud: Cloud
    expected: Expected
    missing: Mask

    @cached_property
    def supposed(self) -> Supposed:
        """How everything stands by the plan."""
        return Supposed.of(self.plan)
