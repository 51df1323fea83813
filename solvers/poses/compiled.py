"""Programs compiled once for each kind of light and size, and IPOPT on them.

IPOPT has exact derivatives and strict limits, and says nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

Light = Literal["diverging", "parallel"]

# MUMPS is the only linear solver that is safe in a process with others.
SILENT: dict[str, Any] = {
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.linear_solver": "mumps",
}


def check_program(
    program: object, light: str, shapes: Mapping[str, tuple[int, ...]]
) -> None:
    """Refuse a program's data.

    Args:
        program: Has the arrays as attributes.
        light: Must be a kind of light.
        shapes: Of each array by its name; all must be finite.

    Raises:
        ValueError: If something can't be used.
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


def strict_solver(name: str, nlp: Nlp, max_iterations: int) -> Any:  # noqa: ANN401
    """Return the compiled program.

    Args:
        name: For CasADi's own messages.
        nlp: The program.
        max_iterations: Limit of a run.
    """
    import casadi as ca

    options = SILENT | {
        "ipopt.max_iter": max_iterations,
        "ipopt.tol": 1e-9,
        "ipopt.constr_viol_tol": 1e-9,
        "ipopt.bound_relax_factor": 0.0,
        "ipopt.mu_strategy": "adaptive",
    }
    parts = {"x": nlp.x, "p": nlp.p, "f": nlp.f, "g": nlp.g}
    return ca.nlpsol(name, "ipopt", parts, options)
