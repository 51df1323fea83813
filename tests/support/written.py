"""Values as a plan file gives them back."""

import json
from typing import Any

from pydantic import TypeAdapter

from planning.model.requirements import Requirements

_REQUIREMENTS = TypeAdapter(Requirements)


def requirements_of(document: dict[str, Any]) -> Requirements:
    """Read the plain values of a plan's `requirements`, as a plan is read."""
    return _REQUIREMENTS.validate_json(json.dumps(document), strict=True)
