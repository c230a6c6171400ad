"""Runs side by side: every method on the same instances with the same seeds.

Everything that compares methods takes errors (methods, instances, seeds), or one more block of them: what a run is
judged by, an angle, a distance or a cost; lower is better.
"""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array

Row = tuple[str, Hashable, int, float]  # method, instance, seed, error


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
    found: dict[Hashable, set[int]] = {}
    for _, instance, seed in table:
        found.setdefault(instance, set()).add(seed)
    instances, seeds = tuple(found), {one: tuple(sorted(found[one])) for one in found}
    missing = [
        (method, one, seed)
        for one in instances
        for seed in seeds[one]
        for method in methods
        if (method, one, seed) not in table
    ]
    if missing:
        raise ValueError(
            f"runs must be there of every method, instance and seed, got none of {_named(missing[0])} "
            f"({len(missing)} missing in all)"
        )
    counts = {one: len(seeds[one]) for one in instances}
    if len(set(counts.values())) > 1:
        few, many = min(counts, key=lambda one: counts[one]), max(counts, key=lambda one: counts[one])
        raise ValueError(
            f"instances must have the same number of seeds, got {counts[few]} of {few} and {counts[many]} of {many}"
        )
    for key, error in table.items():
        if not np.isfinite(error):
            raise ValueError(f"errors must be finite, got {error} of {_named(key)}")
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
    found = [
        (instance, seed)
        for method, instance, seed in table
        if method == methods[0] and all(np.isfinite(table.get((one, instance, seed), np.nan)) for one in methods)
    ]
    if not found:
        raise ValueError(f"methods must share an instance and a seed to be compared, got none of {', '.join(methods)}")
    return found


def finite(name: str, values: ArrayLike, dimensions: tuple[str, ...], least: tuple[int, ...] | None = None) -> Array:
    """Return finite numbers of that many dimensions, each at least 1 long or as `least` says, or raise ValueError."""
    found = np.asarray(values, dtype=np.float64)
    least = least or (1,) * len(dimensions)
    if found.ndim != len(dimensions) or any(n < m for n, m in zip(found.shape, least, strict=True)):
        needed = f", at least {least}" if max(least) > 1 else ""
        raise ValueError(f"{name} must have shape ({', '.join(dimensions)}){needed}, got {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"{name} must be finite, got {np.count_nonzero(~np.isfinite(found))} that are not")
    return found


def _table(rows: Iterable[Row]) -> tuple[dict[tuple[str, Hashable, int], float], tuple[str, ...]]:
    table: dict[tuple[str, Hashable, int], float] = {}
    for method, instance, seed, error in rows:
        if (method, instance, seed) in table:
            twice = _named((method, instance, seed))
            raise ValueError(f"runs must differ in method, instance or seed, got two of {twice}")
        table[method, instance, seed] = float(error)
    if not table:
        raise ValueError("runs must be at least one, got none")
    return table, tuple(dict.fromkeys(method for method, _, _ in table))


def _named(key: tuple[str, Hashable, int]) -> str:
    return f"{key[0]} on {key[1]}, seed {key[2]}"
