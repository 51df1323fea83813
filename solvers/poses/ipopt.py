"""IPOPT as the smooth programs run it: exact derivatives, strict limits, silent."""

from dataclasses import dataclass
from typing import Any

import casadi as ca


@dataclass(frozen=True, eq=False)
class Nlp:
    """A program as CasADi expressions: minimise f(x, p) subject to g(x, p) >= 0."""

    x: Any
    p: Any
    f: Any
    g: Any


def strict_solver(name: str, nlp: Nlp, max_iterations: int) -> Any:  # noqa: ANN401
    """Return the compiled program; the linear solver is MUMPS, the only safe one.

    Args:
        name: For CasADi's own messages.
        nlp: The program.
        max_iterations: Limit of a run.
    """
    options = {
        "print_time": False,
        "show_eval_warnings": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.linear_solver": "mumps",
        "ipopt.max_iter": max_iterations,
        "ipopt.tol": 1e-9,
        "ipopt.constr_viol_tol": 1e-9,
        "ipopt.bound_relax_factor": 0.0,
        "ipopt.mu_strategy": "adaptive",
    }
    parts = {"x": nlp.x, "p": nlp.p, "f": nlp.f, "g": nlp.g}
    return ca.nlpsol(name, "ipopt", parts, options)
