"""Shares: of targets reached within some evaluations, of runs within an error.

An anytime trace consists of increasing evaluations (k,) and the best cost so far (k,)
at each, which never rises.
"""

import numpy as np
from numpy.typing import ArrayLike

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.statistics.pairing import finite

Trace = tuple[Array, Array]


def hits(run: Trace, targets: ArrayLike) -> Array:
    """Return the evaluations (targets,) after which a run first reached each target.

    Args:
        run: The anytime trace of the run.
        targets: Costs (targets,). A cost reaches a target if it is not above it.

    Returns:
        The evaluations, inf for a target that was never reached.

    Raises:
        ValueError: Targets are not finite or have another shape.
    """
    levels = finite("targets", targets, ("targets",))
    first = np.searchsorted(-run[1], -levels, side="left")
    return np.append(run[0], np.inf)[first]


def attained(hits: ArrayLike, evaluations: ArrayLike) -> Array:
    """Return the share of hits within each of some numbers of evaluations.

    It is the empirical distribution of running times over runs and targets: Hansen et
    al., COCO, 2021.

    Args:
        hits: Evaluations of any shape, inf for never, as `hits` returns them.
        evaluations: Numbers of evaluations (p,).

    Returns:
        The shares (p,).

    Raises:
        ValueError: There are no hits, one is nan, or `evaluations` are not finite.
    """
    times = np.sort(np.asarray(hits, dtype=np.float64), axis=None)
    grid = finite("evaluations", evaluations, ("p",))
    if not len(times) or np.isnan(times).any():
        unknown = np.count_nonzero(np.isnan(times))
        raise InputError(
            f"hits must be numbers or inf, got {unknown} nan of {len(times)}"
        )
    return np.searchsorted(times, grid, side="right") / len(times)


def expected_running_time(hits: ArrayLike, evaluations: ArrayLike) -> Array:
    """Return the expected evaluations of restarts until a run reaches a target.

    They are the evaluations of all runs until their hit, or until their end if they
    have none, divided by the number of runs with a hit. Auger and Hansen, 2005.

    Args:
        hits: Evaluations (runs, targets), inf for never, as `hits` returns them.
        evaluations: All evaluations of each run (runs,).

    Returns:
        The expected evaluations (targets,), inf for a target that no run reached.

    Raises:
        ValueError: The shapes do not agree, or a hit is nan or after the run's end.
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
    reached = np.isfinite(times)  # (runs, targets)
    total = np.where(reached, times, used[:, None]).sum(axis=0)  # (targets,)
    expected = np.divide(
        total,
        reached.sum(axis=0),
        out=np.full(len(total), np.inf),
        where=reached.any(axis=0),
    )
    return np.asarray(expected)


def performance_profile(errors: ArrayLike, levels: ArrayLike) -> Array:
    """Return the share of each method's runs with an error of at most each level.

    Errors must have the same meaning on every instance. Agarwal et al., 2021.

    Args:
        errors: Finite numbers (methods, instances, seeds).
        levels: Errors (levels,).

    Returns:
        The shares (methods, levels).

    Raises:
        ValueError: Errors or levels are not finite or have another shape.
    """
    array = finite("errors", errors, ("methods", "instances", "seeds"))
    edges = finite("levels", levels, ("levels",))
    runs = np.sort(array.reshape(len(array), -1), axis=1)  # (methods, runs)
    shares = np.empty((len(runs), len(edges)))
    for k, row in enumerate(runs):
        shares[k] = np.searchsorted(row, edges, side="right") / len(row)
    return shares
