"""Where devices may stand and how many poses are tried, `[placement]`."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from planning.model.table_types import Positive, Table

# Far beyond any table of poses and samples that memory holds.
MOST_POSES = 100_000
# Play of a head where the file states none, as a share of its volume's depth.
_PLAY_OF_DEPTH = 0.25


class PlacementTable(Table):
    """Where devices may stand and how many poses are tried, `[placement]`."""

    standoff_mm: Positive = 1000.0
    standoff_play_mm: Annotated[float, Field(ge=0.0)] = 50.0
    clearance_mm: Annotated[float, Field(ge=0.0)] = 0.0
    n_candidate_projectors: Annotated[int, Field(ge=1, le=MOST_POSES)] = 640
    n_candidate_cameras: Annotated[int, Field(ge=1, le=MOST_POSES)] = 480
    n_reference_projectors: Annotated[int, Field(ge=600, le=MOST_POSES)] = 640
    n_reference_cameras: Annotated[int, Field(ge=400, le=MOST_POSES)] = 480

    @model_validator(mode="after")
    def _check_play(self) -> Self:
        if not self.standoff_play_mm < self.standoff_mm:
            raise ValueError(
                f"standoff_play_mm = {self.standoff_play_mm} must be less than "
                f"standoff_mm = {self.standoff_mm}"
            )
        return self

    def at_head(self, working_mm: float, depths_mm: tuple[float, float]) -> Self:
        """Return the placement of a head: what isn't written follows from the head.

        The standoff is its working distance, the play a quarter of its volume's depth
        and at most what it is by default.

        Args:
            working_mm: From the head's origin to the surface.
            depths_mm: Nearest and farthest depth of its volume.

        Raises:
            ValueError: If the play isn't less than the standoff.
        """
        values, written = self.model_dump(), self.model_fields_set
        if "standoff_mm" not in written:
            values["standoff_mm"] = working_mm
        if "standoff_play_mm" not in written:
            depth = _PLAY_OF_DEPTH * (depths_mm[1] - depths_mm[0])
            values["standoff_play_mm"] = min(values["standoff_play_mm"], depth)
        placed = type(self).model_validate(values)
        # What follows from the head isn't written: another head may replace it.
        return type(self).model_construct(_fields_set=set(written), **dict(placed))
