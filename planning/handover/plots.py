"""Figures of a plan on Matplotlib axes, which are the caller's."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from planning.model.document.coverage_records import CameraMarginal, ProjectorMarginal
from planning.model.plan import RigPlan

from .plan_tables import region_rows

# `matplotlib.axes.Axes`, of a package that needn't be there.
Axes = Any


def new_axes() -> Axes:
    """Return axes of a figure of their own.

    Raises:
        ImportError: If Matplotlib is missing.
    """
    try:
        pyplot = import_module("matplotlib.pyplot")
    except ImportError as error:
        raise ImportError(f"{error}; pip install 'ringrig[plot]'") from None
    return pyplot.figure(figsize=(7.0, 3.6)).add_subplot()


def plot_marginal(plan: RigPlan, ax: Axes) -> None:
    """Draw the covered share of the target by the number of devices."""
    whole = plan.coverage.target.area_m2
    lit = {
        row.n_projectors: 100.0 * row.lit_target_m2 / whole
        for row in plan.document.marginal
        if isinstance(row, ProjectorMarginal)
    }
    measured = {
        row.n_cameras: 100.0 * row.measured_target_m2 / whole
        for row in plan.document.marginal
        if isinstance(row, CameraMarginal)
    }
    for label, shares, planned in (
        ("lit, by projectors", lit, len(plan.projectors)),
        ("measured, by cameras", measured, len(plan.cameras)),
    ):
        (line,) = ax.plot(list(shares), list(shares.values()), "o-", label=label)
        if planned in shares:
            ax.plot(planned, shares[planned], "s", ms=11, color=line.get_color())
    ax.set(xlabel="devices (square: as planned)", ylabel="of the target [%]")
    ax.set_xticks(range(1, 1 + max([1, *lit, *measured])))
    ax.set_ylim(0.0, 105.0)
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right")


def plot_regions(plan: RigPlan, ax: Axes) -> None:
    """Draw lit and measured shares of every region, of what can be reached of it."""
    rows = region_rows(plan)
    for shift, key in ((-0.2, "lit"), (0.2, "measured")):
        places = [row["id"] + shift for row in rows]
        shares = [100.0 * (row.get(key) or 0.0) for row in rows]
        ax.bar(places, shares, 0.38, label=key)
    if floor := plan.requirements.region_coverage:
        ax.axhline(100.0 * floor, color="0.3", ls="--", label="floor")
    ax.set(xlabel="region", ylabel="of what can be [%]", ylim=(0.0, 105.0))
    ax.legend()


def plot_sigma(plan: RigPlan, ax: Axes) -> None:
    """Draw the terms of the error budget: rms over what is measured [mm]."""
    sigma, limit = plan.coverage.sigma, plan.requirements.triangulation.max_sigma_m
    terms = {} if sigma is None else sigma.terms_rms_m
    ax.barh(list(terms), [1e3 * value for value in terms.values()])
    if limit is not None:
        ax.axvline(1e3 * limit, color="0.3", ls="--", label="asked of all together")
        ax.legend()
    ax.set(xlabel="rms along the normal [mm]")


PLOTS: dict[str, Callable[[RigPlan, Axes], None]] = {
    "marginal": plot_marginal,
    "regions": plot_regions,
    "sigma": plot_sigma,
}
