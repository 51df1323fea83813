"""Mathematical programs over plain arrays; no meshes, no devices."""

from importlib import import_module
from typing import TYPE_CHECKING

from ._siblings import check_siblings

if TYPE_CHECKING:
    from solvers.cells.cell_bound import bound_count as bound_count
    from solvers.cells.cell_problem import CellProblem as CellProblem
    from solvers.covers.cover import CoverSolution as CoverSolution
    from solvers.covers.cover import solve_cover as solve_cover
    from solvers.covers.cover import solve_max_coverage as solve_max_coverage
    from solvers.covers.cover_problem import CoverProblem as CoverProblem
    from solvers.covers.paired.pair_cover import solve_pair_cover as solve_pair_cover
    from solvers.covers.paired.pair_problem import PairCoverProblem as PairCoverProblem

    from .status import SolveStatus as SolveStatus

# Imported on first use (PEP 562), so that `plan --help` stays cheap.
_EXPORTS = {
    "CellProblem": "cells.cell_problem",
    "CoverProblem": "covers.cover_problem",
    "CoverSolution": "covers.cover",
    "PairCoverProblem": "covers.paired.pair_problem",
    "SolveStatus": "status",
    "bound_count": "cells.cell_bound",
    "solve_cover": "covers.cover",
    "solve_max_coverage": "covers.cover",
    "solve_pair_cover": "covers.paired.pair_cover",
}


def __getattr__(name: str) -> object:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_EXPORTS[name]}", __name__), name)


def __dir__() -> list[str]:
    return list(_EXPORTS)


check_siblings()
