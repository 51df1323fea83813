"""Formulas on columns: every instance as by itself, to the last digit."""

import casadi as ca
import numpy as np
import pytest

from solvers.poses import baseline_formulas as formulas
from solvers.poses.baseline_rows import kind_of
from solvers.poses.row_columns import InColumns, in_slots


def one_by_one(function, inputs):
    rows = (function(*row).full() for row in zip(*inputs, strict=True))
    return np.array([row.ravel(order="F") for row in rows])


def together(columns, inputs):
    m = len(inputs[0])
    given = [ca.DM(in_slots(each)) for each in inputs]
    return ca.evalf(columns(m, *given)).full().reshape(m, -1)


@pytest.mark.parametrize("m", [1, 64, 130])
@pytest.mark.parametrize(
    ("formula", "n", "n_data"),
    [(formulas.view, 7, 16), (formulas.ring, 3, 13), (formulas.shared_margins, 6, 20)],
)
def test_every_instance_is_what_it_is_by_itself(formula, n, n_data, m):
    rng, kind = np.random.default_rng(m), kind_of(formula, n, n_data)
    inputs = [rng.standard_normal((m, size)) for size in (n, n_data, kind.n_values)]
    # An incline that unit vectors could have, so that no root is of less than nothing.
    inputs[1][:, 9] = np.clip(inputs[1][:, 9], -0.9, 0.9)
    for derivative in (kind.values, kind.slopes, kind.bends):
        given = inputs[: derivative.function.n_in()]
        expected = one_by_one(derivative.function, given)
        assert np.all(np.isfinite(expected))
        np.testing.assert_array_equal(together(derivative, given), expected)


def test_results_that_depend_on_nothing_are_those_of_every_instance():
    v = ca.SX.sym("v", 2)
    columns = InColumns(ca.Function("f", [v], [ca.densify(ca.vertcat(3.0, v[1]))]))
    values = np.arange(6.0).reshape(3, 2)
    np.testing.assert_array_equal(
        together(columns, [values]), [[3.0, 1.0], [3.0, 3.0], [3.0, 5.0]]
    )
