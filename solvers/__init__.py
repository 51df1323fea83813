"""Mathematical programs over plain arrays; no meshes, no devices."""

from importlib import import_module
from typing import TYPE_CHECKING

from ._siblings import check_siblings

if TYPE_CHECKING:
    from .cover import CoverSolution as CoverSolution
    from .cover import solve_cover as solve_cover
    from .cover_problem import CoverProblem as CoverProblem
    from .status import SolveStatus as SolveStatus

# Imported on first use (PEP 562), so that `plan --help` stays cheap.
_EXPORTS = {
    "CoverProblem": "cover_problem",
    "CoverSolution": "cover",
    "SolveStatus": "status",
    "solve_cover": "cover",
}
__all__ = [
    "CoverProblem",
    "CoverSolution",
    "SolveStatus",
    "solve_cover",
]


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_EXPORTS[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__


check_siblings()
