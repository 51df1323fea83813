"""IPOPT, silent, on programs that are compiled once for each kind of light and size."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from solvers.status import SolveStatus, interruptible

Light = Literal["diverging", "parallel"]

# MUMPS is the only linear solver that is safe in a process with others.
SILENT: dict[str, Any] = {
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.linear_solver": "mumps",
    # Approximate minimum degree: MUMPS spends a third less on these small systems.
    "ipopt.mumps_pivot_order": 0,
    # Permuted, a matrix of duals that diverge fills up: gigabytes, minutes.
    "ipopt.mumps_permuting_scaling": 0,
}


def check_program(
    program: object, light: str, shapes: Mapping[str, tuple[int, ...]]
) -> None:
    """Refuse an unknown light, and arrays that aren't finite or of these shapes.

    Raises:
        ValueError: With the name of what can't be used.
    """
    for name, shape in shapes.items():
        value = np.asarray(getattr(program, name), dtype=np.float64)
        if value.shape != shape or not np.all(np.isfinite(value)):
            raise ValueError(f"{name} must be finite and {shape}")
    if light not in get_args(Light):
        raise ValueError(f"light is {light!r}, not diverging or parallel")


def slots_for(n: int, sizes: Sequence[int]) -> int:
    """Return the smallest size that holds n; n itself beyond the largest, and for 0."""
    return n if n == 0 else next((m for m in sizes if m >= n), n)


@dataclass(frozen=True, eq=False)
class Nlp:
    """A program as CasADi expressions: minimise f(x, p) subject to g(x, p) >= 0."""

    x: Any
    p: Any
    f: Any
    g: Any


@lru_cache(maxsize=32)
def strict_solver(
    build: Callable[..., Nlp], light: Light, *sizes: int, max_iterations: int
) -> Any:  # noqa: ANN401
    """Return the compiled program that is built for a kind of light and these sizes."""
    import casadi as ca

    nlp = build(light, *sizes)
    options = SILENT | {
        "ipopt.max_iter": max_iterations,
        "ipopt.tol": 1e-9,
        "ipopt.constr_viol_tol": 1e-9,
        "ipopt.bound_relax_factor": 0.0,
        "ipopt.mu_strategy": "adaptive",
    }
    parts = {"x": nlp.x, "p": nlp.p, "f": nlp.f, "g": nlp.g}
    return ca.nlpsol("strict", "ipopt", parts, options)


def local_status(*, held: bool, settled: bool) -> SolveStatus:
    """Return what an answer is whose limits are held, and that IPOPT settled on."""
    if not held:
        return SolveStatus.UNKNOWN
    return SolveStatus.LOCALLY_OPTIMAL if settled else SolveStatus.FEASIBLE


@dataclass(frozen=True, eq=False)
class IpoptRun:
    """What IPOPT left, unchecked.

    Attributes:
        x: Variables at the end.
        success: Whether IPOPT reports a local optimum.
        multipliers: Of g, as CasADi signs them: df/dx + (dg/dx)^T multipliers = 0 where
            no bound on x holds, and 0 or less where a lower bound on g does.
    """

    x: NDArray[np.float64]
    success: bool
    multipliers: NDArray[np.float64]


def run_solver(solver: Any, **arguments: object) -> IpoptRun:  # noqa: ANN401
    """Run a compiled program; it never raises but on Ctrl-C, so check what it left."""
    with interruptible():
        result = solver(**arguments)
    x, multipliers = (
        np.asarray(result[name], dtype=np.float64).ravel() for name in ("x", "lam_g")
    )
    return IpoptRun(x, bool(solver.stats()["success"]), multipliers)
