"""What the two routes to the cameras found, and which was taken."""

from dataclasses import dataclass
from typing import Literal

from planning.model.document.certificates import RouteCounts
from planning.model.planned import PlannedCamera

CamerasBy = Literal["cover", "paper", "both"]


@dataclass(frozen=True, eq=False)
class Routes:
    """Counts of both routes for the same projectors and ring axes.

    Attributes:
        asked: What `--cameras-by` says.
        cover: Cameras of the smallest cover; None: it wasn't solved for its own sake.
        paper: Cameras that the paper's route needs; None: it wasn't taken, or ended
            short of what is required.
        taken: Whose cameras stand.
        why: A sentence: what decided, and where the counts come from if they differ.
        rival: As many cameras of the paper's route as the cover has, at their largest
            baselines.
    """

    asked: CamerasBy
    cover: int | None
    paper: int | None
    taken: Literal["cover", "paper"]
    why: str
    rival: tuple[PlannedCamera, ...] = ()

    def counts(self) -> RouteCounts:
        """Return the plan's `routes` of the cameras' certificate."""
        return RouteCounts(
            asked=self.asked,
            cover=self.cover,
            paper=self.paper,
            taken=self.taken,
            why=self.why,
        )
