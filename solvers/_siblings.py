"""Refuse to run against a stranger's package under one of our names.

The three top-level packages carry generic names, so another distribution can shadow or
overwrite one of them silently. The same file stands in two packages, because
``geometry`` and ``solvers`` may not import each other.
"""

from importlib.util import find_spec
from pathlib import Path

_HOME = Path(__file__).resolve().parent.parent


def check_siblings(
    names: tuple[str, ...] = ("geometry", "solvers", "planning"),
) -> None:
    """Raise ImportError if a sibling package is not the one shipped with us."""
    for name in names:
        spec = find_spec(name)
        origin = None if spec is None else spec.origin
        if origin is None or Path(origin).resolve().parent.parent != _HOME:
            raise ImportError(
                f"'{name}' would be imported from {origin}, not from ringrig in "
                f"{_HOME}: another '{name}' shadows or overwrote ours. Leave that "
                f"directory, run python -P, or install ringrig into an environment of "
                f"its own.",
                name=name,
            )
