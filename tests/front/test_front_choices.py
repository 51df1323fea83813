"""What a front refuses, and how it stays no worse with more devices."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.plain_shapes import box

from planning import load_rig
from planning.model.errors import InputError
from planning.report.partial_plan import PlanRequest
from planning.rig.wishes import Wishes
from planning.scene.draws import DRAWS, Draw
from planning.steps.front.front_points import _at_most, _no_worse
from planning.steps.front.front_refused import check_front

_BODY = {"size_mm": [90.0, 90.0, 150.0], "centre_mm": [0.0, 0.0, -80.0]}


@dataclass(frozen=True)
class Rig:
    """A choice that measures so many of ten samples."""

    name: str
    measures: int


def judged(choice):
    return SimpleNamespace(measured=np.arange(10) < choice.measures)


def larger(kind, gain):
    return lambda rig: Rig(f"{rig.name} and a {kind}", rig.measures + gain)


def taken(**measures):
    """Figures of smaller rigs, by `p1c2` and so on."""
    rigs = {(int(k[1]), int(k[3])): Rig(k, n) for k, n in measures.items()}
    return {count: (rig, judged(rig)) for count, rig in rigs.items()}


def no_worse(own, gains=(0, 0), **measures):
    chooser = SimpleNamespace(
        with_projector=larger("projector", gains[0]),
        with_camera=larger("camera", gains[1]),
    )
    fresh = SimpleNamespace(of=judged)
    smaller = taken(**measures)
    return _no_worse(chooser, fresh, Rig("own", own), (2, 2), smaller)[0].name


def test_a_rig_that_measures_most_is_taken_as_it_was_chosen():
    assert no_worse(7, p1c2=6, p2c1=7) == "own"
    assert no_worse(7) == "own"


def test_a_smaller_rig_that_measures_more_gets_one_device():
    assert no_worse(5, p1c2=6, p2c1=4) == "p1c2 and a projector"
    assert no_worse(5, p1c2=4, p2c1=6) == "p2c1 and a camera"
    # Of two such the one that measures more with it.
    assert no_worse(5, (0, 0), p1c2=6, p2c1=7) == "p2c1 and a camera"
    assert no_worse(5, (2, 0), p1c2=6, p2c1=7) == "p1c2 and a projector"


def test_the_bound_is_the_less_of_what_is_lit_and_what_is_seen():
    lit = {n: SimpleNamespace(bound=10 * n) for n in (1, 2)}
    seen = {n: SimpleNamespace(bound=12 * n) for n in (1, 2)}
    assert _at_most(lit, seen, (1, 2)) == 10
    assert _at_most(lit, seen, (2, 1)) == 12
    # Where fewer cameras see all, more see no more.
    assert _at_most(lit, seen, (2, 5)) == 20


def test_figures_are_of_a_stream_that_nothing_else_draws():
    every = {name: d for name, d in vars(DRAWS).items() if isinstance(d, Draw)}
    own = every.pop("front")
    # Rounds go a few streams further on.
    others = {draw.later(k).stream for draw in every.values() for k in range(10)}
    assert not others & {own.stream, own.later(1).stream}


def asked(rig=None, *, cameras_by="both", **wishes):
    wishes = Wishes(**{"max_projectors": 2} | wishes)
    rig = rig or load_rig()
    return PlanRequest(box((0.1, 0.1, 0.1)), rig, wishes, cameras_by=cameras_by)


def test_what_points_arent_planned_with_is_refused_by_name():
    check_front(asked())
    for request, words in (
        (asked(survive=1), "survive = 1"),
        (asked(views=2), "views = 2"),
        (asked(robust=0.9), "robust"),
        (asked(joint=True), "joint"),
        (asked(pattern="none", max_projectors=0), "pattern 'none'"),
        (asked(cameras_by="paper"), "cameras_by = 'paper'"),
        (replace(asked(), ranges=(None, None)), "ranges"),
    ):
        with pytest.raises(InputError, match=f"a front with {words}") as caught:
            check_front(request)
        assert "\n" not in str(caught.value)


def test_bodies_heads_and_turntables_are_refused():
    rig = load_rig()
    for kind in ("projector", "camera"):
        with pytest.raises(InputError, match=f"gives a {kind} a body"):
            check_front(asked(rig.replace(**{kind: {"body": _BODY}})))
    table = {"point_mm": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "steps": 24}
    with pytest.raises(InputError, match=r"a front with a \[turntable\]"):
        check_front(asked(rig.replace(turntable=table), pattern="dense"))
