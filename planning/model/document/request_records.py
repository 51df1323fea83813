"""`request` of a plan file: what was asked, beside `requirements`, what was used.

Both are the plan's own words, and so is the digest over them in every part that was
derived from them: who loosens a limit afterwards has to edit each of them.
"""

import hashlib
import json
from typing import Annotated, Any, Literal

from pydantic import Field

from planning.model.requirements import Requirements

from .certificates import CamerasBy
from .input_records import RigRecord
from .part import Part
from .ring_records import RingAxis

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Number = Annotated[int, Field(ge=0)]
# What has a default; numbers of projectors and the pattern are stated always.
Given = (
    Literal["max_cameras", "max_heads", "target", "dominant_coverage", "coverage"]
    | Literal["min_reachable", "region_coverage", "accuracy_mm", "accuracy_of", "up"]
    | Literal["ring_axis", "robust", "views", "survive", "joint"]
)


class RequestRecord(Part):
    """What was asked of a plan, defaults included.

    Attributes:
        given: Keys that the user stated; the others are as the rig has them, or as
            nothing else was said.
        max_cameras: None: as many as the coverage needs.
        accuracy_mm: Largest standard deviation along the normal; None: none is asked.
        ring_axis: None: the pattern has no rings.
        robust: None: no rig is drawn.
        views: None: the fewest that measure.
    """

    given: tuple[Given, ...]
    max_projectors: Number
    max_cameras: Number | None
    max_heads: Number | None
    target: Literal["dominant", "surface", "outside"]
    pattern: Literal["rings", "dense", "none"]
    dominant_coverage: Share
    coverage: Share
    min_reachable: Share
    region_coverage: Share
    accuracy_mm: float | None
    accuracy_of: Literal["noise", "total"]
    up: Literal["x", "y", "z", "-x", "-y", "-z"]
    ring_axis: RingAxis | None
    robust: Share | None
    views: Number | None
    survive: Number
    joint: bool
    cameras_by: CamerasBy


def asked_digest(
    request: RequestRecord | None, requirements: Requirements, rig: RigRecord
) -> str:
    """Return the SHA-256 of what was asked, used, and available, hexadecimal."""
    stated: dict[str, Any] = {
        "request": None if request is None else request.to_document(),
        "requirements": requirements.to_document(),
        "rig": rig.to_document(),
    }
    return hashlib.sha256(json.dumps(stated).encode()).hexdigest()
