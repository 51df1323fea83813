"""IPOPT as the smooth programs run it: exact derivatives, strict limits, silent."""

from typing import Any, Protocol

import casadi as ca


class Nlp(Protocol):
    """A program in CasADi: minimise f(x, p) subject to limits on g(x, p)."""

    @property
    def x(self) -> Any:  # noqa: ANN401
        """Variables."""
        ...

    @property
    def p(self) -> Any:  # noqa: ANN401
        """Parameters."""
        ...

    @property
    def f(self) -> Any:  # noqa: ANN401
        """What is minimised."""
        ...

    @property
    def g(self) -> Any:  # noqa: ANN401
        """What is limited."""
        ...


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
