"""How a projector answers grey levels, `response` of `[projector]`."""

from itertools import pairwise
from typing import Annotated

from pydantic import AfterValidator, Field


def _check_response(response: float | list[float] | None) -> float | list[float] | None:
    if not isinstance(response, list):
        return response
    steps = [after - before for before, after in pairwise(response)]
    if len(response) < 2 or min(steps) < 0.0 or not response[-1] > response[0]:
        raise ValueError(
            f"response of {len(response)} levels must be measured light from black to "
            f"white at 2 or more evenly spaced grey levels, never falling; or write "
            f"one number, the gamma: 1 is linear"
        )
    return response


Response = Annotated[
    Annotated[float, Field(gt=0.0, le=10.0)]
    | Annotated[list[Annotated[float, Field(ge=0.0)]], Field(max_length=4096)]
    | None,
    AfterValidator(_check_response),
]
