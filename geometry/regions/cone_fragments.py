"""Fragments that splitting leaves join the piece beside them that they fit best."""

import numpy as np

from geometry.arrays import Array, Ints, Mask, rows_of
from geometry.mesh.tensors import unit

from .cone_sums import CONE_SHARE, Patch

_MAX_ROUNDS = 12
_ROOM = 0.7
_EQUAL = 1e-9


def join_fragments(patch: Patch, piece: Ints) -> Ints:
    """Give connected faces without a piece to adjacent ones; -1 where they fit none.

    No piece takes more area outside its cone than leaves the last of `CONE_SHARE` in.
    """
    if not np.any(piece < 0) or not np.any(piece >= 0):
        return piece
    joined = _join(patch, piece)
    # The axis moved with what joined: what a piece that lost its share took goes back.
    lost = patch.shares(joined) < CONE_SHARE[1]
    return np.where((joined >= 0) & lost[joined], piece, joined)


def _join(patch: Patch, piece: Ints) -> Ints:
    piece = piece.copy()
    sums, areas = patch.sums(piece)
    axis = unit(sums)
    inside = patch.shares(piece)
    # Not all that is free, since the mean moves.
    room = areas * _ROOM * (inside - CONE_SHARE[1])
    # What fits nowhere as one may fit its neighbours face by face.
    for number in (_fragments, _single):
        for _ in range(_MAX_ROUNDS):
            fragment = number(patch, piece)
            owner = _best(patch, fragment, piece, axis)
            if not len(owner):
                return piece
            to = np.where(fragment >= 0, owner[fragment], -1)
            outside = (to >= 0) & (patch.cosines(to, axis) < patch.cos_half)
            out = patch.sums(np.where(outside, fragment, -1), len(owner))[1]
            taken = _within(owner, out, room)
            if not taken.any():
                break
            gained = (fragment >= 0) & taken[fragment]
            piece[gained] = to[gained]
            room -= np.bincount(owner[taken], out[taken], len(room))
    return piece


def _fragments(patch: Patch, piece: Ints) -> Ints:
    """Number connected faces without a piece, -1 for the others."""
    return patch.connected(np.where(piece < 0, 0, -1))


def _single(patch: Patch, piece: Ints) -> Ints:
    """Number the faces without a piece, -1 for the others."""
    free = piece[: patch.n] < 0
    return np.where(free, np.cumsum(free) - 1, -1)


def _best(patch: Patch, fragment: Ints, piece: Ints, axis: Array) -> Ints:
    """The adjacent piece whose axis is nearest to each fragment's mean, else -1."""
    sums, _ = patch.sums(fragment)
    owner = np.full(len(sums), -1, dtype=np.int64)
    a, b = patch.links.T
    free, taken = fragment >= 0, piece >= 0
    forth = rows_of(patch.links, free[a] & taken[b])
    back = rows_of(patch.links, free[b] & taken[a])[:, ::-1]
    both = np.concatenate([forth, back])
    key = np.unique(fragment[both[:, 0]] * len(axis) + piece[both[:, 1]])
    met = np.stack(np.divmod(key, len(axis)), axis=1)
    if len(met):
        fit = np.einsum("ij,ij->i", unit(sums)[met[:, 0]], axis[met[:, 1]])
        order = np.lexsort((met[:, 1], -np.round(fit, 9), met[:, 0]))
        fragments, first = np.unique(met[order, 0], return_index=True)
        owner[fragments] = met[order[first], 1]
    return owner


def _within(owner: Ints, out: Array, room: Array) -> Mask:
    """Which fragments their pieces have room for, the best fitting first."""
    taken = np.zeros(len(owner), dtype=bool)
    waiting = np.flatnonzero(owner >= 0)
    # Equal up to rounding, as on two sides of a mirror: the lowest number goes first.
    rank = np.round(out[waiting] / max(_EQUAL * float(room.max()), 1e-300))
    order = waiting[np.lexsort((waiting, rank, owner[waiting]))]
    total = np.cumsum(out[order])
    start = np.searchsorted(owner[order], owner[order])
    before = np.where(start > 0, total[start - 1], 0.0) if len(order) else total
    used = total - before
    taken[order] = (out[order] <= 0) | (used <= room[owner[order]])
    return taken
