"""Runs side by side: every method on the same instances with the same seeds.

Everything that compares methods takes errors (methods, instances, seeds), or one more block of them: what a run is
judged by, an angle, a distance or a cost; lower is better.
"""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError

Row = tuple[str, Hashable, int, float]  # method, instance, seed, error
MIN_SHARE = 0.5  # of the runs of all methods but one, that are shared with it; below, it does not take part


@dataclass(frozen=True, eq=False)
class Paired:
    """Errors in which entry [:, i, s] is what all methods made of one instance with one seed."""

    methods: tuple[str, ...]
    instances: tuple[Hashable, ...]
    seeds: tuple[tuple[int, ...], ...]  # of each instance; another instance may have others, but as many
    errors: Array  # (methods, instances, seeds)


def paired(rows: Iterable[Row]) -> Paired:
    """Return runs as one block; methods and instances as they come, seeds in rising order.

    Raises ValueError where there is no run, where one comes twice, is missing or is not finite.
    """
    table, methods = _table(rows)
    seeds_of: dict[Hashable, set[int]] = {}
    for _, instance, seed in table:
        seeds_of.setdefault(instance, set()).add(seed)
    instances, seeds = tuple(seeds_of), {one: tuple(sorted(seeds_of[one])) for one in seeds_of}
    missing = [
        (method, one, seed)
        for one in instances
        for seed in seeds[one]
        for method in methods
        if (method, one, seed) not in table
    ]
    if missing:
        raise InputError(
            f"runs must be there of every method, instance and seed, got none of {_named(missing[0])} "
            f"({len(missing)} missing in all)"
        )
    counts = {one: len(seeds[one]) for one in instances}
    if len(set(counts.values())) > 1:
        few, many = min(counts, key=lambda one: counts[one]), max(counts, key=lambda one: counts[one])
        raise InputError(
            f"instances must have the same number of seeds, got {counts[few]} of {few} and {counts[many]} of {many}"
        )
    for key, error in table.items():
        if not np.isfinite(error):
            raise InputError(f"errors must be finite, got {error} of {_named(key)}")
    errors = [[[table[method, one, seed] for seed in seeds[one]] for one in instances] for method in methods]
    return Paired(methods, instances, tuple(seeds.values()), np.array(errors))


def shared(rows: Iterable[Row]) -> tuple[list[Row], int]:
    """Return the runs that `paired` takes of a sweep that has gaps, and how many runs were left out.

    Of every instance the same number of lowest seeds is kept, of those that all methods have finished with a finite
    error. An instance that no seed of is shared is left out whole. Raises ValueError where nothing is shared.
    """
    table, methods = _table(rows)
    finished: dict[Hashable, list[int]] = {}
    for instance, seed in _complete(table, methods):
        finished.setdefault(instance, []).append(seed)
    count = min(map(len, finished.values()))
    chosen = [
        (method, instance, seed, table[method, instance, seed])
        for method in methods
        for instance, seeds in finished.items()
        for seed in sorted(seeds)[:count]
    ]
    return chosen, len(table) - len(chosen)


def complete(rows: Iterable[Row]) -> list[tuple[Hashable, int]]:
    """Return every block, an instance with a seed, that all methods have finished with a finite error.

    Instances come as they do in the rows and may have different numbers of seeds, which a test that works on blocks
    can use though `paired` cannot. Raises ValueError where nothing is shared.
    """
    return _complete(*_table(rows))


def _complete(table: Mapping[tuple[str, Hashable, int], float], methods: Sequence[str]) -> list[tuple[Hashable, int]]:
    blocks = [
        (instance, seed)
        for method, instance, seed in table
        if method == methods[0] and all(np.isfinite(table.get((one, instance, seed), np.nan)) for one in methods)
    ]
    if not blocks:
        raise InputError(f"methods must share an instance and a seed to be compared, got none of {', '.join(methods)}")
    return blocks


def finite(name: str, values: ArrayLike, dimensions: tuple[str, ...], least: tuple[int, ...] | None = None) -> Array:
    """Return finite numbers of that many dimensions, each at least 1 long or as `least` says, or raise ValueError."""
    array = np.asarray(values, dtype=np.float64)
    least = least or (1,) * len(dimensions)
    if array.ndim != len(dimensions) or any(n < m for n, m in zip(array.shape, least, strict=True)):
        needed = f", at least {least}" if max(least) > 1 else ""
        raise InputError(f"{name} must have shape ({', '.join(dimensions)}){needed}, got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{name} must be finite, got {np.count_nonzero(~np.isfinite(array))} that are not")
    return array


def _table(rows: Iterable[Row]) -> tuple[dict[tuple[str, Hashable, int], float], tuple[str, ...]]:
    table: dict[tuple[str, Hashable, int], float] = {}
    for method, instance, seed, error in rows:
        if (method, instance, seed) in table:
            twice = _named((method, instance, seed))
            raise InputError(f"runs must differ in method, instance or seed, got two of {twice}")
        table[method, instance, seed] = float(error)
    if not table:
        raise InputError("runs must be at least one, got none")
    return table, tuple(dict.fromkeys(method for method, _, _ in table))


def _named(key: tuple[str, Hashable, int]) -> str:
    return f"{key[0]} on {key[1]}, seed {key[2]}"


@dataclass(frozen=True, eq=False)
class Rows:
    """All runs of a sweep: of each (n,) its method, instance and seed as indices, and its error; lower is better."""

    method: Array
    instance: Array
    seed: Array
    error: Array  # nan where a run has none, and then it is not shared


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
    if every is not None and every.rows[0].size >= MIN_SHARE * counts.max():
        return every
    best: Shared | None = None
    accepted: list[int] = []
    for m in taking:
        candidate = _of(rows, [*accepted, m])
        if candidate is not None and (best is None or candidate.rows[0].size >= MIN_SHARE * best.rows[0].size):
            best = candidate
            accepted.append(m)
    return best


def gaps(rows: Rows, methods: Sequence[int], instances: Sequence[int]) -> list[tuple[int, list[int]]]:
    """Return the instances that are none of these though a method has runs there, and the methods that have none.

    Where every method has one, they have no seed in common there.
    """
    finished = np.isfinite(rows.error)
    missing = []
    for instance in np.unique(rows.instance[finished & np.isin(rows.method, methods)]).tolist():
        if instance not in instances:
            there = set(rows.method[finished & (rows.instance == instance)].tolist())
            missing.append((instance, [m for m in methods if m not in there]))
    return missing


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
