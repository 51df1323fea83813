"""Floors of regions are asked for where all alone leaves no room for a proof."""

from dataclasses import dataclass

import numpy as np
import pytest
from support.array_trees import ArrayTree
from support.leaf_trees import tree_of_leaves

from planning.proofs.all_poses import BoundQuestion
from solvers.bit_rows import pack_rows
from solvers.cells.cell_bound import CellStatus

N = 10
REGIONS = np.repeat([0, 1], [8, 2])
LARGE, SMALL = REGIONS == 0, REGIONS == 1
PLENTY = 1e9


@dataclass
class Counted:
    """A tree that counts the searches over it."""

    tree: ArrayTree
    searches: int = 0

    def __getattr__(self, name):
        return getattr(self.tree, name)

    def roots(self):
        """Return the tree's roots."""
        self.searches += 1
        return self.tree.roots()


def question(required, floors=(0, 2)):
    return BoundQuestion(required, 2, N, 1.0, floors=floors, regions=REGIONS)


def test_floors_prove_what_all_alone_does_not():
    """The large region alone is enough of all, and nothing of the small one."""
    poses = np.array([LARGE, SMALL])
    tree = tree_of_leaves(np.array([-1, -1]), pack_rows(poses), N)
    floored = question(8).searched(tree, PLENTY, poses)
    alone = question(8, ()).searched(tree, PLENTY, poses)
    assert (alone.lower_bound, floored.lower_bound) == (1, 2)


@pytest.mark.parametrize(("known", "searches"), [(LARGE, 1), (LARGE | SMALL, 2)])
def test_none_are_asked_where_known_poses_leave_room(known, searches):
    """The cell serves all, so nothing is proved; poses that don't leave it to work."""
    rows = pack_rows(np.ones((1, N), dtype=bool))
    tree = Counted(ArrayTree(np.array([-1]), rows, N))
    found = question(9).searched(tree, PLENTY, np.array([known, SMALL]))
    assert (found.status, tree.searches) == (CellStatus.SURVIVED, searches)
