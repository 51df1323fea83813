"""What the two routes to the cameras found, and which was taken."""

from dataclasses import dataclass
from typing import Any, Literal

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
        rival: As many cameras of the paper's route as the cover has, slid apart.
    """

    asked: CamerasBy
    cover: int | None
    paper: int | None
    taken: Literal["cover", "paper"]
    why: str
    rival: tuple[PlannedCamera, ...] = ()

    def entry(self) -> dict[str, Any]:
        """Return the plan's `routes` of the cameras' certificate."""
        return {
            "asked": self.asked,
            "cover": self.cover,
            "paper": self.paper,
            "taken": self.taken,
            "why": self.why,
        }


def routes_entry(routes: Routes | None) -> dict[str, Any]:
    """Return what the cameras' certificate gains; nothing where no route was told."""
    return {} if routes is None else {"routes": routes.entry()}
