"""Trees of cells made from their leaves, and bounds walked over a whole tree."""

import numpy as np

from solvers.bit_rows import BitSum, words_for
from solvers.cells.cell_problem import whole_rows
from support.array_trees import ArrayTree


def tree_of_leaves(parents, leaf_rows, n_rows):
    """Return a tree whose parents are exactly the union of their children."""
    parents = np.asarray(parents)
    rows = np.zeros((parents.size, words_for(n_rows)), dtype=np.uint64)
    rows[leaves_of(parents)] = leaf_rows
    for cell in range(parents.size - 1, -1, -1):
        if parents[cell] >= 0:
            rows[parents[cell]] |= rows[cell]
    return ArrayTree(parents, rows, n_rows)


def leaves_of(parents):
    """Return the cells that are no one's parent."""
    return np.setdiff1d(np.arange(len(parents)), parents)


def multiplier_bound(problem, tree, multipliers, *, n_poses, largest_cost=0):
    """Return what multipliers prove, whatever made them, from the roots down.

    Cells are split while they cost more than `largest_cost`; 0 goes down to the leaves.
    Returns the poses that are needed at least, and the weight that `n_poses` serve at
    most.
    """
    whole = whole_rows(problem)
    usable = whole.multipliers(multipliers)
    cost = BitSum(usable)
    top, batch = 0, tree.roots()
    while batch.cells.size:
        costs = cost(batch.rows)
        dear = costs > largest_cost
        top = max(top, int(costs[~dear].max(initial=0)))
        cells, costs = batch.cells[dear], costs[dear]
        batch = tree.children(cells)
        leaf = np.bincount(batch.parents, minlength=cells.size) == 0
        top = max(top, int(costs[leaf].max(initial=0)))
    most = whole.in_unit(whole.most(usable, n_poses * top))
    return whole.count_bound(usable, top), min(most, float(problem.weights.sum()))


def rederived(answer):
    """Return an answer's `by_multipliers` and `most_weight`, derived again."""
    return multiplier_bound(
        answer.problem,
        answer.tree,
        answer.multipliers,
        n_poses=answer.count - 1,
        largest_cost=answer.largest_cost,
    )
