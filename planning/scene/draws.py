"""How many samples each question looks at, and which random streams are its own.

A sample that one question was fitted to can't confirm the answer, so no two questions
share a stream.
"""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Draw:
    """So many area-true samples, of a stream; the whole surface has the next one."""

    count: int
    stream: int

    def of(self, count: int) -> "Draw":
        """Return the draw with so many samples."""
        return replace(self, count=count)

    def later(self, streams: int) -> "Draw":
        """Return the draw from a stream so many further on."""
        return replace(self, stream=self.stream + streams)


@dataclass(frozen=True)
class Draws:
    """Every draw of a plan, and how many of drawn samples slower steps look at.

    Fresh samples confirm a cover, a stream further on each round, and a region by at
    least as many as `fresh_regions`; rounds of ring spacing go two streams further.
    Areas of the plan are computed from `claims`, those
    of a region from at least as many as `region_claims`. Mere
    numbers are samples at most: `dark` where nothing at all is lit, `fewer_devices` for
    what would let fewer be enough.
    """

    site: Draw = Draw(2000, 50)
    projectors: Draw = Draw(2000, 100)
    fresh_projectors: Draw = Draw(12_000, 100)
    fresh_regions: Draw = Draw(400, 910)
    cameras: Draw = Draw(2000, 200)
    fresh_cameras: Draw = Draw(4000, 200)
    axes: Draw = Draw(4000, 250)
    surer: Draw = Draw(4000, 270)
    surviving_projectors: Draw = Draw(12_000, 150)
    surviving_regions: Draw = Draw(400, 920)
    surviving_cameras: Draw = Draw(4000, 230)
    surviving_rings: Draw = Draw(6000, 420)
    baselines: Draw = Draw(6000, 300)
    confirming_baselines: Draw = Draw(16_000, 301)
    joint: Draw = Draw(1000, 600)
    joint_margins: Draw = Draw(6000, 610)
    front: Draw = Draw(12_000, 660)
    rings: Draw = Draw(6000, 400)
    claims: Draw = Draw(12_000, 900)
    region_claims: Draw = Draw(400, 904)
    overlaps: Draw = Draw(12_000, 902)
    relaxations: Draw = Draw(800, 950)
    dark: int = 400
    fewer_devices: int = 2000
    paper_route: int = 1500
    axis_program: int = 250


DRAWS = Draws()
