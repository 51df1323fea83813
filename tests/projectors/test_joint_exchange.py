"""Devices of both kinds under exchange, against tables written by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from planning.proofs.quotas import Quotas, RegionFloors
from planning.steps.joint.exchange import Exchange
from planning.steps.joint.offer import several_covers
from planning.steps.joint.slack import pair_slack, slack_at_share
from planning.steps.joint.tables import JointTables

_N = 8


def quota(total):
    return Quotas(total, RegionFloors.none(_N), np.zeros(1, dtype=np.int64))


def tables_of(lit, slack, projector_models=None, camera_models=None):
    n_p, n_c = lit.shape[1], slack.shape[1]
    scene = SimpleNamespace(check_cancelled=lambda: None)
    projectors = [SimpleNamespace(model=m) for m in projector_models or [""] * n_p]
    cameras = [SimpleNamespace(model=m) for m in camera_models or [""] * n_c]
    return JointTables(
        scene, None, tuple(projectors), tuple(cameras), lit, slack.astype(np.float32)
    )


def random_tables(seed):
    rng = np.random.default_rng(seed)
    lit = rng.random((_N, 4)) < 0.6
    slack = np.where(rng.random((_N, 5, 4)) < 0.5, rng.random((_N, 5, 4)), -np.inf)
    return tables_of(lit, np.where(lit[:, None], slack, -np.inf))


def two_that_need_each_other():
    """No exchange of one device helps; of a projector and a camera at once one does."""
    lit = np.ones((_N, 2), dtype=bool)
    slack = np.full((_N, 2, 2), -np.inf)
    slack[:4, 0, 0] = 0.5
    slack[:, 1, 1] = 0.25
    return tables_of(lit, slack)


def test_a_pair_goes_for_another_pair_where_neither_gains_alone():
    exchange = Exchange(two_that_need_each_other(), quota(8), quota(8), [0], [0])
    assert exchange.score[0] == 4

    exchange.run()

    assert (exchange.projectors, exchange.cameras) == ([1], [1])
    assert exchange.score == (0, -0.25)


@pytest.mark.parametrize("seed", range(6))
def test_what_it_ends_with_is_scored_as_the_tables_say(seed):
    tables = random_tables(seed)
    exchange = Exchange(tables, quota(7), quota(6), [0, 1], [0, 1])
    before = exchange.score

    exchange.run()

    lit = tables.lit[:, exchange.projectors].any(axis=1).sum()
    best = np.array(
        [
            max(
                tables.slack[e, c, p]
                for c in exchange.cameras
                for p in exchange.projectors
            )
            for e in range(_N)
        ]
    )
    lacking = max(0, 7 - lit) + max(0, 6 - np.isfinite(best).sum())
    assert exchange.score[0] == lacking
    assert exchange.score[1] == pytest.approx(-np.sort(best)[::-1][5])
    assert exchange.score <= before
    assert len(set(exchange.projectors)) == len(set(exchange.cameras)) == 2


@pytest.mark.parametrize("seed", range(6))
def test_no_exchange_of_one_device_is_left_that_helps(seed):
    tables = random_tables(seed)
    exchange = Exchange(tables, quota(7), quota(6), [0, 1], [0, 1])
    exchange.run()
    for kind, n in (("projectors", 4), ("cameras", 5)):
        for k in range(2):
            for new in range(n):
                chosen = {
                    "projectors": [*exchange.projectors],
                    "cameras": [*exchange.cameras],
                }
                if new in chosen[kind]:
                    continue
                chosen[kind][k] = new
                other = Exchange(tables, quota(7), quota(6), **chosen)
                assert other.score[0] >= exchange.score[0]
                if other.score[0] == exchange.score[0] == 0:
                    assert other.score[1] >= exchange.score[1] - 2e-3


def test_a_device_goes_for_one_of_its_own_model():
    lit = np.ones((_N, 2), dtype=bool)
    lit[4:, 0] = False
    slack = np.where(lit[:, None], 0.5, -np.inf)
    alike, different = (
        Exchange(tables_of(lit, slack, models), quota(8), quota(8), [0], [0])
        for models in (["a", "a"], ["a", "b"])
    )
    alike.run()
    different.run()
    assert alike.projectors == [1]
    assert different.projectors == [0]


def test_slack_at_a_share_is_what_so_many_samples_have():
    slack = np.array([0.1, 0.4, -np.inf, 0.2])
    assert [slack_at_share(slack, n) for n in (1, 2, 3)] == [0.4, 0.2, 0.1]
    assert slack_at_share(slack, 4) == slack_at_share(slack, 5) == -np.inf


def test_candidates_come_cover_by_cover():
    covers = np.zeros((4, 5), dtype=bool)
    covers[:, 0] = True
    covers[:3, 1] = covers[3:, 2] = covers[0, 3] = True
    assert several_covers(covers, 9).tolist() == [0, 1, 2, 3]
    assert several_covers(covers, 2).tolist() == [0, 1]


def quality(**figures):
    """A pair on one sample, as far from every limit as can be but for figures."""
    given = {
        "conditioning": 1e9,
        "sigma": 0.0,
        "facing": 1.0,
        "light_cos": None,
    } | figures
    arrays = {k: v if v is None else np.array([v]) for k, v in given.items()}
    facing = arrays.pop("facing")
    return SimpleNamespace(view=SimpleNamespace(facing=facing), **arrays)


@pytest.mark.parametrize(
    ("figures", "share"),
    [
        ({}, 1.0),
        ({"conditioning": 0.4}, 0.75),
        ({"sigma": 0.75e-3}, 0.25),
        ({"facing": np.cos(0.6)}, 0.4),
        ({"light_cos": np.cos(0.5)}, 0.5),
        ({"light_cos": np.cos(1.9)}, 0.1),
        ({"sigma": 0.5e-3, "conditioning": 0.2}, 0.5),
    ],
)
def test_slack_of_a_pair_is_the_least_share_of_its_limits(figures, share):
    limits = SimpleNamespace(min_conditioning=0.1, max_sigma_m=1e-3, angles=(0.0, 2.0))
    found = pair_slack(quality(**figures), limits, SimpleNamespace(max_incidence=1.0))
    # Half of what lies between both angles is 1 rad.
    assert found[0] == pytest.approx(share)


def test_what_isnt_limited_has_no_share():
    limits = SimpleNamespace(min_conditioning=0.0, max_sigma_m=None, angles=(0.0, 2.0))
    found = pair_slack(quality(sigma=1.0), limits, SimpleNamespace(max_incidence=1.0))
    assert found[0] == 1.0
