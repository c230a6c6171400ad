"""Pairing of runs: every method on the same instances with the same seeds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError

# A method takes part only if at least this share of the others' runs remains shared.
MIN_SHARE = 0.5


def finite(
    name: str,
    values: ArrayLike,
    dimensions: tuple[str, ...],
    least: tuple[int, ...] | None = None,
) -> Array:
    """Return values as an array after checking them.

    Args:
        name: The name of the values in messages.
        values: The values.
        dimensions: The names of the array's dimensions.
        least: The shortest length of each dimension, by default 1.

    Returns:
        The array.

    Raises:
        ValueError: The values are not finite or have another shape.
    """
    array = np.asarray(values, dtype=np.float64)
    least = least or (1,) * len(dimensions)
    has_shape = array.ndim == len(dimensions)
    if has_shape:
        has_shape = not any(np.array(array.shape) < least)
    if not has_shape:
        needed = f", at least {least}" if max(least) > 1 else ""
        raise InputError(
            f"{name} must have shape ({', '.join(dimensions)}){needed}, "
            f"got {array.shape}"
        )
    not_finite = np.count_nonzero(~np.isfinite(array))
    if not_finite:
        raise InputError(f"{name} must be finite, got {not_finite} that are not")
    return array


@dataclass(frozen=True, eq=False)
class Shared:
    """The runs that some methods share, in blocks: an instance with a seed each.

    Attributes:
        methods: The methods that take part, in ascending order.
        blocks: The row of each run (methods, blocks), by instance, then by seed.
        instance: The instance of each block (blocks,).
        left_out: The number of these methods' runs that not all of them have.
        missing: Each instance without a shared run, with the methods that have no run
            of it.
    """

    methods: tuple[int, ...]
    blocks: Array
    instance: Array
    left_out: int
    missing: tuple[tuple[int, tuple[int, ...]], ...]


def most_shared(
    method: Array, instance: Array, seed: Array, error: Array
) -> Shared | None:
    """Return the shared runs of the methods that share enough.

    A method does not take part if it would leave less than half of the runs that the
    others share.

    Args:
        method: The index of each run's method (n,).
        instance: The index of its instance (n,).
        seed: The index of its seed (n,).
        error: Its error (n,), nan if it has none.

    Returns:
        The shared runs, or None if no run has an error.
    """
    finished = np.flatnonzero(np.isfinite(error))
    runs = np.stack([finished, method[finished], instance[finished], seed[finished]])
    counts = np.bincount(runs[1])
    most_first = sorted(np.flatnonzero(counts).tolist(), key=lambda m: (-counts[m], m))
    # usually all methods share enough
    every = _shared(runs, most_first) if most_first else None
    if every is not None and every.blocks.shape[1] >= MIN_SHARE * counts.max():
        return every
    # the method with the most runs first, so that one with few runs cannot drive out
    # others
    best: Shared | None = None
    accepted: list[int] = []
    for m in most_first:
        candidate = _shared(runs, [*accepted, m])
        if candidate is None:
            continue
        count = candidate.blocks.shape[1]
        if best is None or count >= MIN_SHARE * best.blocks.shape[1]:
            best = candidate
            accepted.append(m)
    return best


def _shared(runs: Array, methods: list[int]) -> Shared | None:
    """Return the runs that some methods share, or None if there are none.

    `runs` (4, n) are rows, methods, instances and seeds.
    """
    methods = sorted(methods)
    row, method, instance, seed = runs[:, np.isin(runs[1], methods)]
    seeds = seed.max() + 1
    # one number for each pair of instance and seed
    names, block = np.unique(instance * seeds + seed, return_inverse=True)
    # the row of each method's run of each block, -1 if there is none
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
    missing = []
    for k in np.flatnonzero(~np.isin(all_instances, instance_of_block)).tolist():
        absent_methods = np.array(methods)[absent[:, k]].tolist()
        missing.append((int(all_instances[k]), tuple(absent_methods)))
    return Shared(
        methods=tuple(methods),
        blocks=blocks,
        instance=instance_of_block,
        left_out=len(row) - blocks.size,
        missing=tuple(missing),
    )
