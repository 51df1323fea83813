"""What the simulated reconstruction takes from a plan's document."""

from typing import Any

import numpy as np
import pytest
from support.reconstruction_rigs import changed

from geometry.shapes.primitives import sphere
from planning.verify.reconstruction.scanner import BaselineLimit, Scanner


def baseline(cameras: tuple[str, str], d: float, d_max: float | None) -> dict[str, Any]:
    """A row of `baselines`; what the scanner doesn't read is zero."""
    zeros = ("standoff1", "standoff2", "C1", "C2", "D1", "D2", "phi", "phi_max")
    zeros += ("d_lateral", "d_axial", "slack", "max_incidence")
    zeros += ("delta_axes", "delta_surface")
    none = [0.0, 0.0, 0.0]
    return {
        **dict.fromkeys(zeros, 0.0),
        **{key: [0.0, 0.0] for key in ("beta", "iota", "half_field")},
        "cameras": list(cameras),
        "E": none,
        "d": d,
        "d_max": d_max,
        "covered": True,
        "limit": "none",
        "normals": [none, none],
        "onward": none,
        "shares_border": True,
        "n_seam": 1,
    }


@pytest.fixture(scope="module")
def plan(rigs):
    return rigs.small_rig(sphere(0.04, subdivisions=2))


def test_a_plan_without_schedule_and_baselines_has_neither_groups_nor_limits(plan):
    scanner = Scanner.of(plan)
    assert (scanner.groups, scanner.baselines) == ((), ())
    assert scanner.shining_with("P1") == frozenset()
    assert [one.id for one in scanner.projectors] == [p.id for p in plan.projectors]


def test_exposure_groups_say_which_projectors_shine_together(plan):
    def together(document: dict[str, Any]) -> None:
        document["firing_schedule"] = {
            "groups": [["P2", "P1"]],
            "n_groups": 1,
            "lower_bound": 1,
            "proof": "clique",
            "clique": ["P1"],
        }

    scanner = Scanner.of(changed(plan, together))
    assert scanner.groups == (frozenset({"P1", "P2"}),)
    assert scanner.shining_with("P1") == {"P2"}
    assert scanner.shining_with("P2") == {"P1"}


def test_baselines_keep_length_and_limit_and_only_those_that_have_one(plan):
    def rows(document: dict[str, Any]) -> None:
        document["baselines"] = [
            baseline(("C1", "C2"), 0.12, 0.3),
            baseline(("C2", "C3"), 0.2, None),
        ]

    scanner = Scanner.of(changed(plan, rows))
    assert scanner.baselines == (BaselineLimit(frozenset({"C1", "C2"}), 0.12, 0.3),)


def test_limits_and_target_are_those_of_the_requirements(plan):
    scanner, wanted = Scanner.of(plan), plan.requirements
    limits = scanner.limits
    assert limits.check == wanted.check
    assert limits.min_conditioning == wanted.triangulation.min_conditioning
    assert limits.max_lit == wanted.projector.max_incidence
    assert limits.max_seen == wanted.camera.max_incidence
    assert np.array_equal(scanner.target, plan.surface.target_faces(wanted.target))
