"""Runs side by side: every method on the same instances with the same seeds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError

# of the runs of all methods but one, that are shared with it; below, it does not take
# part
MIN_SHARE = 0.5


def finite(
    name: str,
    values: ArrayLike,
    dimensions: tuple[str, ...],
    least: tuple[int, ...] | None = None,
) -> Array:
    """Return finite numbers of that many dimensions, each at least 1 long or as `least` says, or raise ValueError."""
    array = np.asarray(values, dtype=np.float64)
    least = least or (1,) * len(dimensions)
    if array.ndim != len(dimensions) or any(
        n < m for n, m in zip(array.shape, least, strict=True)
    ):
        needed = f", at least {least}" if max(least) > 1 else ""
        raise InputError(
            f"{name} must have shape ({', '.join(dimensions)}){needed}, got {array.shape}"
        )
    if not np.isfinite(array).all():
        raise InputError(
            f"{name} must be finite, got {np.count_nonzero(~np.isfinite(array))} that are not"
        )
    return array


@dataclass(frozen=True, eq=False)
class Shared:
    """The runs that some methods share, paired by instance and seed: each pair is a block."""

    methods: tuple[int, ...]  # that take part
    blocks: Array  # (methods, blocks) which row each is; by instance, then by seed
    instance: Array  # (blocks,)
    left_out: int  # runs of these methods that not all of them have
    # instances without a shared run, and the methods without any there
    missing: tuple[tuple[int, tuple[int, ...]], ...]


def most_shared(
    method: Array, instance: Array, seed: Array, error: Array
) -> Shared | None:
    """Return the runs of as many methods as share enough; None where no run has an error.

    Of each run (n,) there are its method, instance and seed as indices, and its error, nan where it has none. A method
    with which less than half of the runs that the others share would be left does not take part.
    """
    finished = np.flatnonzero(np.isfinite(error))
    runs = np.stack([finished, method[finished], instance[finished], seed[finished]])
    counts = np.bincount(runs[1])
    most_first = sorted(np.flatnonzero(counts).tolist(), key=lambda m: (-counts[m], m))
    every = _shared(runs, most_first) if most_first else None
    if every is not None and every.blocks.shape[1] >= MIN_SHARE * counts.max():
        return every
    best: Shared | None = None
    accepted: list[int] = []
    for m in most_first:
        candidate = _shared(runs, [*accepted, m])
        if candidate is not None and (
            best is None
            or candidate.blocks.shape[1] >= MIN_SHARE * best.blocks.shape[1]
        ):
            best = candidate
            accepted.append(m)
    return best


def _shared(runs: Array, methods: list[int]) -> Shared | None:
    """Return what some methods share of runs (4, n), which are rows, methods, instances and seeds; None if nothing."""
    methods = sorted(methods)
    row, method, instance, seed = runs[:, np.isin(runs[1], methods)]
    seeds = seed.max() + 1
    names, block = np.unique(instance * seeds + seed, return_inverse=True)
    table = np.full((len(methods), len(names)), -1)
    table[np.searchsorted(methods, method), block] = row
    present = table >= 0
    everywhere = present.all(axis=0)
    if not everywhere.any():
        return None
    blocks = table.compress(everywhere, axis=1)
    instance_of_block = names[everywhere] // seeds
    all_instances, start = np.unique(names // seeds, return_index=True)
    absent = ~np.logical_or.reduceat(present, start, axis=1)
    missing = np.flatnonzero(~np.isin(all_instances, instance_of_block))
    return Shared(
        methods=tuple(methods),
        blocks=blocks,
        instance=instance_of_block,
        left_out=len(row) - blocks.size,
        missing=tuple(
            (int(all_instances[k]), tuple(np.array(methods)[absent[:, k]].tolist()))
            for k in missing.tolist()
        ),
    )
