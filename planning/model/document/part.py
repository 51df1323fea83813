"""What every part of a plan file is: frozen, and written with the keys it was given.

Fields stand in the order in which they are written. A field with a default may be
absent from a file, and is then absent from the file that is written again.
"""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from planning.model.table_types import fits_memory

# A number of devices, poses, samples or cells.
Count = Annotated[int, Field(ge=0)]
# A length, an area, an error or a share of which a negative one means nothing.
Size = Annotated[float, Field(ge=0.0)]
Vector3 = tuple[float, float, float]
Interval = tuple[float, float]
# Of images that fit into memory.
_Pixels = Annotated[int, Field(ge=1, le=100_000)]
Resolution = Annotated[tuple[_Pixels, _Pixels], AfterValidator(fits_memory)]
Row4 = tuple[float, float, float, float]
_Rows3 = tuple[Vector3, Vector3, Vector3]


def _is_printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must hold no control character")
    return text


def _is_folder(text: str) -> str:
    if {"/", "\\"} & set(text) or text in (".", ".."):
        raise ValueError("must be the name of a folder")
    return text


# Of a file beside the plan; what errors say of it stays one line.
FileName = Annotated[str, AfterValidator(_is_printable)]
# Of a folder; none leads out of the one that it is in.
FolderName = Annotated[str, AfterValidator(_is_folder)]


class Part(BaseModel):
    """A part of a plan file; keys that aren't known are kept and not looked at."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    def to_document(self) -> dict[str, Any]:
        """Return fresh plain JSON values, with the keys that were given."""
        return self.model_dump(mode="json", exclude_unset=True)

    def changed(self, **values: object) -> Self:
        """Return a copy with other values, validated.

        Raises:
            ValueError: If a value isn't of its field's type.
        """
        present = {name: getattr(self, name) for name in self.model_fields_set}
        return type(self)(**(present | values))


def _is_pose(rows: tuple[Row4, Row4, Row4, Row4]) -> tuple[Row4, Row4, Row4, Row4]:
    turn = np.array(rows)[:3, :3]
    if not np.allclose(turn.T @ turn, np.eye(3), atol=1e-6) or np.linalg.det(turn) < 0:
        raise ValueError("must hold a rotation")
    return rows


# b_from_a, rows of a 4 x 4 matrix; its last column in [m].
Pose = Annotated[tuple[Row4, Row4, Row4, Row4], AfterValidator(_is_pose)]


def _is_camera_matrix(rows: _Rows3) -> _Rows3:
    if not (rows[0][0] > 0.0 and rows[1][1] > 0.0):
        raise ValueError("must hold focal lengths above 0")
    return rows


Matrix3 = Annotated[_Rows3, AfterValidator(_is_camera_matrix)]
