"""What shares of runs and targets are reached: by a number of evaluations, or within an error.

An anytime trace is evaluations (k,), rising, and the best cost so far (k,) at each, never rising.
"""

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.statistics.pairing import finite

Trace = tuple[Array, Array]


def hits(run: Trace, targets: ArrayLike) -> Array:
    """Return after how many evaluations (targets,) a run had a cost as low as each target; inf where it never had."""
    levels = finite("targets", targets, ("targets",))
    first = np.searchsorted(-run[1], -levels, side="left")
    return np.append(run[0], np.inf)[first]


def attained(hits: ArrayLike, evaluations: ArrayLike) -> Array:
    """Return the share (p,) of hits, of any shape, that are within each of some numbers of evaluations (p,).

    The empirical distribution of running times over runs and targets: Hansen et al., COCO, 2021.
    """
    times = np.sort(np.asarray(hits, dtype=np.float64), axis=None)
    grid = finite("evaluations", evaluations, ("p",))
    if not len(times) or np.isnan(times).any():
        raise InputError(
            f"hits must be numbers or inf, got {np.count_nonzero(np.isnan(times))} nan of {len(times)}"
        )
    return np.searchsorted(times, grid, side="right") / len(times)


def expected_running_time(hits: ArrayLike, evaluations: ArrayLike) -> Array:
    """Return the expected evaluations (targets,) to a target by a method that restarts until it gets there.

    `hits` (runs, targets) as of `hits`, `evaluations` (runs,) what each run used in all. It is what all runs used up
    to their hit, or in all, over the number of runs that hit; inf where none did. Auger and Hansen, 2005.
    """
    times = np.asarray(hits, dtype=np.float64)
    used = finite("evaluations", evaluations, ("runs",))
    if times.ndim != 2 or len(times) != len(used):
        raise InputError(
            f"hits must have shape ({len(used)}, targets), got {times.shape}"
        )
    late = np.isfinite(times) & (times > used[:, None])
    if np.isnan(times).any() or late.any():
        raise InputError(
            "hits must be within a run's evaluations or inf, got "
            + ("a later one" if late.any() else "nan")
        )
    reached = np.isfinite(times)
    used_in_all = np.where(reached, times, used[:, None]).sum(axis=0)
    return np.asarray(
        np.divide(
            used_in_all,
            reached.sum(axis=0),
            out=np.full(len(used_in_all), np.inf),
            where=reached.any(axis=0),
        )
    )


def performance_profile(errors: ArrayLike, levels: ArrayLike) -> Array:
    """Return the share (methods, levels) of each method's runs with an error of at most each level.

    `errors` (methods, instances, seeds), which mean the same on every instance: Agarwal et al., 2021.
    """
    array = finite("errors", errors, ("methods", "instances", "seeds"))
    edges = finite("levels", levels, ("levels",))
    runs = np.sort(array.reshape(len(array), -1), axis=1)
    return np.array(
        [np.searchsorted(row, edges, side="right") / len(row) for row in runs]
    )
