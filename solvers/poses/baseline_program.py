"""Slide cameras apart: the largest smallest baseline that coverage allows.

Given cameras that aim at fixed points, seams where their parts meet and points that a
camera must keep, choose centres O_c::

    maximise    t + w mean_pairs |O_a - O_b|
    subject to  |O_a - O_b| >= t                              neighbouring pairs
                phi_s(O_1, O_2) <= phi_max                    seam points, eq. (10)
                N.(O_c - P) >= cos(theta) |O_c - P|           kept points: incidence
                lo <= |O_c - P| <= hi                         range
                a_c.(P - O_c) >= cos(b) |O_c - P|             field
                m.(P - O_c) >= e |O_c - P|                    ring conditioning
                m.r >= q t |v|,  -N.r >= p t |v|              s_N and ring pitch
                O_c in the workspace shell,  |O_c - start| <= step

with a_c the direction from O_c to its aim, r = (P - O_c)/t, t = |P - O_c| and
v = r x (N x m), so that |v|^2 = (r.m)^2 + (r.N)^2 - 2 (r.m)(r.N)(N.m). At a seam point
with its frame (out, on) frozen, angles are signed and smooth: with v_i = O_i - E and
g(v) = atan2(v.on, v.out)::

    iota_1 = -g(v_1),  iota_2 = g(v_2) - delta,  beta_1 = g(-a_1) - g(v_1),
    beta_2 = g(v_2) - g(-a_2),   phi = iota_1 + delta + iota_2

Camera 1 is held at the end of its coverage: with r its smaller margin at the start,
both (theta - iota_1 - r) and (b_1 - beta_1 - r), what camera 1 gains, added to either
theta - iota_2 or b_2 - beta_2, what camera 2 has left, stay >= 0. Where both meet the
incidence limit this reads phi <= 2 theta + delta, and so for the field. What is past a
limit at the start may stay there but gets no worse.

The program is smooth and not convex; IPOPT gives a local optimum from exact
derivatives. What coverage really does is for the caller's rays to say.

Source: Lee and Krim, 2014, eqs. (9)-(10); `docs/method/baselines.md`.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from solvers.status import SolveStatus

from .baseline_nlp import BaselineProgram, build_baseline_program
from .baseline_problem import BaselineProblem, smallest_baseline
from .compiled import SILENT, IpoptRun, local_status, run_solver

_Array = NDArray[np.float64]

# Of programs that are to end at an optimum, and of elastic ones.
_ITERATIONS = (150, 60)
# The monotone barrier is robust but creeps, 300 steps against 10: it comes last.
_BARRIERS = (
    {"ipopt.mu_strategy": "adaptive", "ipopt.mu_oracle": "loqo"},
    {"ipopt.mu_strategy": "monotone"},
)
# How far a camera turns about its axis within one program [rad].
_MAX_TURN = 0.5


@dataclass(frozen=True, eq=False)
class BaselineSolution:
    """Answer to a :class:`BaselineProblem`.

    Attributes:
        problem: The problem this answers.
        status: `LOCALLY_OPTIMAL`; `FEASIBLE` where an elastic program came to no end;
            `UNKNOWN` where IPOPT failed.
        centres: O_c in [m], shape (k, 3); those of the start where it failed.
        aims: Where the cameras look in [m], shape (k, 3).
        rolls: Their turns [rad], shape (k,).
        slack: What limits give way by, shape (m - e,); empty where none may.
    """

    problem: BaselineProblem
    status: SolveStatus
    centres: _Array
    aims: _Array
    rolls: _Array
    slack: _Array

    @property
    def smallest_baseline(self) -> float:
        """Smallest baseline of neighbours in [m], recomputed from the centres."""
        return smallest_baseline(self.centres, self.problem.pairs)


def solve_baseline(problem: BaselineProblem) -> BaselineSolution:
    """Solve a problem with IPOPT (MUMPS), from its centres.

    A local optimum, the same on every run; no clock is consulted.
    """
    program, k = build_baseline_program(problem), len(problem.centres)
    # Where every limit gives way, whatever IPOPT comes by is of use.
    for barrier in _BARRIERS[:1] if problem.elastic else _BARRIERS:
        run = _run_ipopt(problem, program, barrier)
        if (run.success or problem.elastic) and np.all(np.isfinite(run.x)):
            centres, rest = run.x[: 3 * k].reshape(-1, 3), run.x[3 * k + 1 :]
            aims, rolls, slack = problem.aims, problem.rolls, rest
            if problem.weights is not None:
                aims, rolls = rest[: 3 * k].reshape(-1, 3), rest[3 * k : 4 * k]
                slack = rest[4 * k :][: len(problem.weights)]
            ended = local_status(held=True, settled=run.success)
            return BaselineSolution(problem, ended, centres, aims, rolls, slack)
    return BaselineSolution(
        problem,
        SolveStatus.UNKNOWN,
        problem.centres,
        problem.aims,
        problem.rolls,
        np.zeros(0),
    )


def _run_ipopt(
    problem: BaselineProblem, program: BaselineProgram, barrier: dict[str, str]
) -> IpoptRun:
    solver = ca.nlpsol(
        "baseline",
        "ipopt",
        {"x": program.x, "f": program.objective, "g": program.constraints},
        SILENT
        | barrier
        | {
            "ipopt.max_iter": _ITERATIONS[problem.elastic],
            "ipopt.tol": 1e-7,
            "ipopt.acceptable_iter": 0,
            "error_on_fail": False,
            # The gradient by parameters, of which there are none.
            "no_nlp_grad": True,
        }
        | program.derivatives,
    )
    least, most = _bounds(problem, program.start)
    return run_solver(
        solver,
        x0=program.start,
        lbx=least,
        ubx=most,
        lbg=program.low,
        ubg=program.high,
    )


def _bounds(problem: BaselineProblem, start: _Array) -> tuple[_Array, _Array]:
    """How far each variable may go, (n,): slacks are held from below alone."""
    k = len(problem.centres)
    # The step's ball holds these bounds too; they keep iterates from running away.
    moves = np.full(problem.centres.shape, 1.1 * problem.max_step)
    turns = np.full(k, _MAX_TURN)
    moves[list(problem.fixed)] = turns[list(problem.fixed)] = 0.0
    if problem.weights is None:
        reach = np.append(moves, np.inf)
        return np.append((start - reach)[:-1], 0.0), start + reach
    limits = np.full(len(problem.weights), np.inf)
    gains = np.full(len(problem.reserves), np.inf)
    reach = np.concatenate([moves.ravel(), [0.0], moves.ravel(), turns, limits, gains])
    least = start - reach
    least[7 * k + 1 :][: len(limits)] = 0.0
    return least, start + reach
