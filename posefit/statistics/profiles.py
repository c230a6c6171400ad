"""What shares of runs and targets are reached: by a number of evaluations, or within an error.

An anytime trace is evaluations (k,), rising, and the best cost so far (k,) at each, never rising.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.statistics.pairing import finite

TARGETS = 51
LEAST_TARGET = 0.01  # a cost; what is below is a pixel or none

Trace = tuple[Array, Array]


def trace(evaluations: ArrayLike, costs: ArrayLike) -> Trace:
    """Return an anytime trace as two arrays (k,), or raise ValueError where it is none."""
    used, best = finite("evaluations", evaluations, ("k",)), finite("costs", costs, ("k",))
    if used.shape != best.shape:
        raise InputError(f"costs must be one for each of {len(used)} evaluations, got {len(best)}")
    if used[0] < 1.0 or (np.diff(used) <= 0.0).any():
        raise InputError(f"evaluations must rise from at least 1, got {_listed(used)}")
    if (np.diff(best) > 0.0).any():
        raise InputError(f"costs must be the best so far and never rise, got {_listed(best)}")
    return used, best


def costs_at(run: Trace, evaluations: ArrayLike) -> Array:
    """Return the best cost (p,) that a run had after each of some numbers of evaluations (p,).

    Raises ValueError where one of them is before the trace starts.
    """
    grid = finite("evaluations", evaluations, ("p",))
    if grid.min() < run[0][0]:
        raise InputError(f"evaluations must be at least {run[0][0]:g}, where the trace starts, got {grid.min():g}")
    return np.asarray(run[1][np.searchsorted(run[0], grid, side="right") - 1])


def common_grid(traces: Iterable[Trace], points: int = TARGETS) -> Array:
    """Return numbers of evaluations (up to `points`,), evenly on a log scale, from which on every trace has a cost.

    They end where the longest trace does.
    """
    ends = np.array([(used[0], used[-1]) for used, _ in traces])
    if not len(ends) or points < 2:
        raise InputError(f"traces must be at least one and points at least 2, got {len(ends)} and {points}")
    return np.unique(np.rint(np.geomspace(ends[:, 0].max(), max(ends[:, 1].max(), ends[:, 0].max()), points)))


def targets(traces: Iterable[Trace], count: int = TARGETS) -> Array:
    """Return costs (count,) to be reached, falling evenly on a log scale; traces are of one instance.

    They go from the highest first cost to the lowest last one of any run, but not below 0.01.
    """
    ends = np.array([(best[0], best[-1]) for _, best in traces])
    if not len(ends) or count < 1:
        raise InputError(f"traces and targets must be at least one, got {len(ends)} and {count}")
    high, low = max(ends[:, 0].max(), LEAST_TARGET), max(ends[:, 1].min(), LEAST_TARGET)
    costs = np.geomspace(high, low, count)
    costs[-1] = low if count > 1 else high  # to the last bit, so that the best run reaches the last target
    return costs


def hits(run: Trace, targets: ArrayLike) -> Array:
    """Return after how many evaluations (targets,) a run had a cost as low as each target; inf where it never had."""
    wanted = finite("targets", targets, ("targets",))
    first = np.searchsorted(-run[1], -wanted, side="left")
    return np.append(run[0], np.inf)[first]


def attained(hits: ArrayLike, evaluations: ArrayLike) -> Array:
    """Return the share (p,) of hits, of any shape, that are within each of some numbers of evaluations (p,).

    The empirical distribution of running times over runs and targets: Hansen et al., COCO, 2021.
    """
    times, grid = np.sort(np.asarray(hits, dtype=np.float64), axis=None), finite("evaluations", evaluations, ("p",))
    if not len(times) or np.isnan(times).any():
        raise InputError(f"hits must be numbers or inf, got {np.count_nonzero(np.isnan(times))} nan of {len(times)}")
    return np.searchsorted(times, grid, side="right") / len(times)


def expected_running_time(hits: ArrayLike, evaluations: ArrayLike) -> Array:
    """Return the expected evaluations (targets,) to a target by a method that restarts until it gets there.

    `hits` (runs, targets) as of `hits`, `evaluations` (runs,) what each run used in all. It is what all runs used up
    to their hit, or in all, over the number of runs that hit; inf where none did. Auger and Hansen, 2005.
    """
    times, used = np.asarray(hits, dtype=np.float64), finite("evaluations", evaluations, ("runs",))
    if times.ndim != 2 or len(times) != len(used):
        raise InputError(f"hits must have shape ({len(used)}, targets), got {times.shape}")
    late = np.isfinite(times) & (times > used[:, None])
    if np.isnan(times).any() or late.any():
        raise InputError(
            "hits must be within a run's evaluations or inf, got " + ("a later one" if late.any() else "nan")
        )
    reached = np.isfinite(times)
    used_in_all = np.where(reached, times, used[:, None]).sum(axis=0)
    return np.asarray(
        np.divide(used_in_all, reached.sum(axis=0), out=np.full(len(used_in_all), np.inf), where=reached.any(axis=0))
    )


def performance_profile(errors: ArrayLike, levels: ArrayLike) -> Array:
    """Return the share (methods, levels) of each method's runs with an error of at most each level.

    `errors` (methods, instances, seeds). Of `ratios` it is the profile of Dolan and Moré, 2002; of errors that mean
    the same on every instance, that of Agarwal et al., 2021.
    """
    array, edges = finite("errors", errors, ("methods", "instances", "seeds")), finite("levels", levels, ("levels",))
    runs = np.sort(array.reshape(len(array), -1), axis=1)
    return np.array([np.searchsorted(row, edges, side="right") / len(row) for row in runs])


def ratios(errors: ArrayLike) -> Array:
    """Return errors (methods, instances, seeds) over the least of any method on the same instance and seed.

    Raises ValueError where an error is not above 0.
    """
    array = finite("errors", errors, ("methods", "instances", "seeds"))
    if array.min() <= 0.0:
        raise InputError(f"errors must be above 0 to be compared by ratio, got {array.min():g}")
    return np.asarray(array / array.min(axis=0))


def _listed(values: Sequence[float] | Array) -> str:
    return ", ".join(f"{value:g}" for value in values[:4]) + (", ..." if len(values) > 4 else "")
