"""In which order stations are gone to: the shortest way that visits each once.

Exact for few (Held and Karp 1962: the least way over a set S that ends at j is
``min over i of way(S - j, i) + |P_i - P_j|``); for more, exchanges of two legs.
"""

import numpy as np

from geometry.arrays import Array

_EXACT = 12


def shortest_way(places: Array) -> tuple[list[int], float]:
    """Return an open way over places (n, 3) as their indices, and its length [m]."""
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    order = _held_karp(gaps) if len(places) <= _EXACT else _two_opt(gaps)
    return order, float(gaps[order[:-1], order[1:]].sum())


def _held_karp(gaps: Array) -> list[int]:
    n = len(gaps)
    least = np.full((1 << n, n), np.inf)
    before = np.zeros((1 << n, n), dtype=np.int64)
    least[1 << np.arange(n), np.arange(n)] = 0.0
    for visited in range(1 << n):
        for j in range(n):
            rest = visited & ~(1 << j)
            if visited & (1 << j) and rest:
                ways = least[rest] + gaps[:, j]
                before[visited, j] = int(np.argmin(ways))
                least[visited, j] = ways[before[visited, j]]
    visited = (1 << n) - 1
    order = [int(np.argmin(least[visited]))]
    while visited & (visited - 1):
        last = order[-1]
        order.append(int(before[visited, last]))
        visited &= ~(1 << last)
    return order[::-1]


def _two_opt(gaps: Array) -> list[int]:
    """From nearest neighbours, reversals of parts as long as one is shorter."""
    n = len(gaps)
    order, left = [0], set(range(1, n))
    while left:
        order.append(min(left, key=lambda k: (gaps[order[-1], k], k)))
        left.remove(order[-1])

    def length(way: list[int]) -> float:
        return float(gaps[way[:-1], way[1:]].sum())

    best, improved = length(order), True
    while improved:
        improved = False
        for i in range(n - 1):
            for j in range(i + 2, n + 1):
                other = order[:i] + order[i:j][::-1] + order[j:]
                if (shorter := length(other)) < best - 1e-12:
                    order, best, improved = other, shorter, True
    return order
