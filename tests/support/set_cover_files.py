"""The ten set covers beside the repository: how to read them, and what is known."""

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "setcover"


@dataclass(frozen=True)
class SetCoverFile:
    """One published instance.

    Attributes:
        name: As the literature has it.
        file: File name.
        rows: Elements, all to be covered.
        columns: Sets.
        fewest: Best known with all costs 1.
        proved: Whether that is known to be the optimum.
        cheapest: Best known with the file's costs; None where it gives none but 1.
    """

    name: str
    file: str
    rows: int
    columns: int
    fewest: int
    proved: bool
    cheapest: int | None = None

    @property
    def path(self) -> Path:
        return FOLDER / self.file

    def read(self) -> tuple[sparse.csr_array, NDArray[np.float64]]:
        """Return what covers what, shape (rows, columns), and the file's costs."""
        if self.file.startswith("viewpoints"):
            sets, costs = _viewpoints(self.path)
            names = np.unique(np.concatenate(sets))
            sets = [np.searchsorted(names, s) for s in sets]
        elif self.file.startswith("stn"):
            sets, costs = _triples(self.path)
        else:
            sets, costs = _library(self.path)
        within = np.concatenate(sets)
        ends = np.concatenate([[0], np.cumsum([len(s) for s in sets])])
        ones = np.ones(within.size, dtype=bool)
        covers = sparse.csc_array((ones, within, ends), shape=(self.rows, self.columns))
        return sparse.csr_array(covers), costs


INSTANCES = (
    SetCoverFile("map1", "viewpoints_map1_900x900.txt", 900, 900, 25, proved=True),
    SetCoverFile("map2", "viewpoints_map2_600x4760.txt", 4760, 600, 70, proved=True),
    SetCoverFile("stn27", "stn27.gz", 117, 27, 18, proved=True),
    SetCoverFile("stn45", "stn45.gz", 330, 45, 30, proved=True),
    SetCoverFile("scpe1", "scpe1.txt.gz", 50, 500, 5, proved=True),
    SetCoverFile("scpclr10", "scpclr10.txt.gz", 511, 210, 25, proved=True),
    SetCoverFile("scp41", "scp41.txt.gz", 200, 1000, 38, False, 429),
    SetCoverFile("scp61", "scp61.txt.gz", 200, 1000, 21, False, 138),
    SetCoverFile("scpa1", "scpa1.txt.gz", 300, 3000, 38, False, 253),
    SetCoverFile("scpcyc06", "scpcyc06.txt.gz", 240, 192, 60, proved=False),
)
BY_NAME = {instance.name: instance for instance in INSTANCES}


def _viewpoints(path: Path) -> tuple[list[NDArray[np.int64]], NDArray[np.float64]]:
    """A line a set: id, position, quaternion, then what it covers."""
    lines = [line.split() for line in path.read_text().splitlines() if line.strip()]
    sets = [np.array(line[8:], dtype=np.int64) for line in lines]
    return sets, np.ones(len(sets))


def _triples(path: Path) -> tuple[list[NDArray[np.int64]], NDArray[np.float64]]:
    """Points, triples, then the triples; a point covers the triples that it is in."""
    numbers = _numbers(path)
    points, n = int(numbers[0]), int(numbers[1])
    triples = numbers[2:].reshape(n, 3)
    sets = [np.flatnonzero((triples == p + 1).any(axis=1)) for p in range(points)]
    return sets, np.ones(points)


def _library(path: Path) -> tuple[list[NDArray[np.int64]], NDArray[np.float64]]:
    """Rows, columns, costs, then for each row how many cover it, and which."""
    numbers = _numbers(path)
    rows, columns = int(numbers[0]), int(numbers[1])
    at = 2 + columns
    members: list[list[int]] = [[] for _ in range(columns)]
    for row in range(rows):
        n = int(numbers[at])
        for s in numbers[at + 1 : at + 1 + n]:
            members[s - 1].append(row)
        at += 1 + n
    if at != numbers.size:
        raise ValueError(f"{path.name}: {numbers.size - at} numbers are left over")
    sets = [np.array(m, dtype=np.int64) for m in members]
    return sets, numbers[2 : 2 + columns].astype(np.float64)


def _numbers(path: Path) -> NDArray[np.int64]:
    return np.array(gzip.decompress(path.read_bytes()).split(), dtype=np.int64)
