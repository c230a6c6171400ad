"""Which runs of a sweep with gaps its methods share, so that they can be held against each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posefit.arrays import Array
from posefit.statistics.pairing import complete, paired, shared

LEAST_SHARE = 0.5  # of the runs of all methods but one, that are shared with it; below, it does not take part


@dataclass(frozen=True, eq=False)
class Rows:
    """All runs of a sweep: of each (n,) its method, instance and seed as indices, and its error; lower is better."""

    method: Array
    instance: Array
    seed: Array
    error: Array  # nan where a run has none, so that it is shared by nobody


@dataclass(frozen=True, eq=False)
class Shared:
    """The runs that some methods share, paired by instance and seed.

    Means and intervals need as many seeds of every instance and have `rows`; tests work on blocks, an instance with a
    seed, and have all `blocks` that every method has finished.
    """

    methods: tuple[int, ...]  # that take part
    instances: tuple[int, ...]
    rows: Array  # (methods, instances, seeds) which row each is
    blocks: Array  # (methods, blocks) the same of each block; these are more where instances differ in their seeds
    left_out: int  # runs of these methods that not all of them have


def most_shared(rows: Rows) -> Shared | None:
    """Return the runs of as many methods as share enough; None where no run has an error.

    A method with which less than half of the runs that the others share would be left does not take part.
    """
    finished = np.isfinite(rows.error)
    counts = np.bincount(rows.method[finished]) if finished.any() else np.zeros(0, dtype=int)
    taking = sorted(np.flatnonzero(counts).tolist(), key=lambda m: (-counts[m], m))
    every = _of(rows, taking) if taking else None
    if every is not None and every.rows[0].size >= LEAST_SHARE * counts.max():
        return every
    best: Shared | None = None
    accepted: list[int] = []
    for m in taking:
        found = _of(rows, [*accepted, m])
        if found is not None and (best is None or found.rows[0].size >= LEAST_SHARE * best.rows[0].size):
            best = found
            accepted.append(m)
    return best


def gaps(rows: Rows, methods: Sequence[int], instances: Sequence[int]) -> list[tuple[int, list[int]]]:
    """Return the instances that are none of these though a method has runs there, and the methods that have none.

    Where every method has one, they have no seed in common there.
    """
    finished = np.isfinite(rows.error)
    found = []
    for instance in np.unique(rows.instance[finished & np.isin(rows.method, methods)]).tolist():
        if instance not in instances:
            there = set(rows.method[finished & (rows.instance == instance)].tolist())
            found.append((instance, [m for m in methods if m not in there]))
    return found


def _of(rows: Rows, methods: Sequence[int]) -> Shared | None:
    chosen = np.isin(rows.method, methods) & np.isfinite(rows.error)
    index = {
        (int(m), int(i), int(s)): int(k)
        for k, m, i, s in zip(
            np.flatnonzero(chosen), rows.method[chosen], rows.instance[chosen], rows.seed[chosen], strict=True
        )
    }
    listed = sorted((str(m), i, s, float(rows.error[k])) for (m, i, s), k in index.items())
    try:
        kept, _ = shared(listed)
    except ValueError:  # they have nothing in common
        return None
    block = paired(kept)
    order = np.argsort([int(name) for name in block.methods])
    instances = [int(str(one)) for one in block.instances]
    table = [
        [[index[int(block.methods[m]), i, s] for s in seeds] for i, seeds in zip(instances, block.seeds, strict=True)]
        for m in order
    ]
    named = tuple(int(block.methods[m]) for m in order)
    blocks = np.array([[index[m, int(str(i)), s] for i, s in complete(listed)] for m in named])
    return Shared(named, tuple(instances), np.array(table), blocks, len(listed) - blocks.size)
