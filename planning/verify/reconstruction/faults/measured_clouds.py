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
# Of coded pixels; what has the same name as of edges means the same.
CODES_REJECTED = {
    "mixed": "the pixels show several codes at once: blurred stripes, steps, or frames "
    "out of order",
    "modulation": "the sinusoids hardly stand out: little light, or defocus",
    "partly_lit": "the pixels lie on the border of the light",
    "residual": "the rays of both devices pass each other: a pose or lens isn't that "
    "of the plan",
    "angle": "the triangulation angle is outside its limits",
    "unsure": "noise moves the points too far",
    "other_camera": "no other camera shows their codes, or its rays meet theirs beyond "
    "the limits",
}


def rejection(pairs: tuple[PairCount, ...]) -> str | None:
    """Return in words what most edges of pairs were left out for, None without any."""
    words = REJECTED | CODES_REJECTED
    count = {cause: sum(p.rejected.get(cause, 0) for p in pairs) for cause in words}
    cause = max(words, key=lambda name: count[name])
    if not count[cause]:
        return None
    n_edges, what = sum(pair.n_edges for pair in pairs), "edges"
    if any("mixed" in pair.rejected for pair in pairs):
        what = "pixels"
    return f"{count[cause]} of {n_edges} {what} left out as `{cause}`, {words[cause]}"


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
