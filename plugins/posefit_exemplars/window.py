"""The frames that wait to be told: the likeliest way through them, and how likely every state of one is.

A hidden Markov model: the states of a beam, steps between them, and costs of silhouettes over a temperature. The way is
Viterbi's, the weights are those of the forward-backward algorithm, over the frames that were seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars.beam import Beam
from posefit_exemplars.codes import Codes

ALIKE = 0.06  # metres: how near the codes of states are that are averaged, a standard deviation
ALIKE_YAW = np.radians(20.0)
HIGHEST = 80.0  # cost of a step beyond which its likelihood would be 0, and so the sum of all might be

Kernel = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Seen:
    """The states of a frame, and what they know of the frames before."""

    beam: Beam  # totals and parents are those of the likeliest ways
    likelihoods: Array = field(repr=False)  # (n,) of the silhouettes, the greatest 1
    kernel: Kernel | None = field(repr=False)  # (m, n) likelihoods of steps from the frame before
    forward: Array = field(repr=False)  # (n,) weights by all frames so far, which sum to 1


def seen(beam: Beam, fits: Array, before: Seen | None, steps: Array | None) -> Seen:
    """Return a frame whose states have costs of fit (n,), to which steps from the frame before cost (m, n)."""
    likelihoods = np.exp(fits.min() - fits)  # TOYAMA2001 (likelihood)
    if before is None or steps is None:
        totals = fits - fits.min()
        beam = replace(beam, totals=totals, parents=np.full(len(beam), -1))
        return Seen(beam, likelihoods, None, likelihoods / likelihoods.sum())
    ways = before.beam.totals[:, None] + steps
    parents = ways.argmin(axis=0)
    totals = ways[parents, np.arange(len(beam))] + fits  # RABINER1989 (Viterbi)
    kernel = np.exp(-np.minimum(steps, HIGHEST)).astype(np.float32)
    forward = (before.forward @ kernel) * likelihoods  # RABINER1989 (forward)
    beam = replace(beam, totals=totals - totals.min(), parents=parents)
    return Seen(beam, likelihoods, kernel, forward / forward.sum())


def likeliest(window: Sequence[Seen]) -> int:
    """Return the state of the first frame from which the likeliest way to the last one goes."""
    row = int(window[-1].beam.totals.argmin())
    for one in window[:0:-1]:
        row = int(one.beam.parents[row])
    return row


def weights(window: Sequence[Seen]) -> Array:
    """Return how likely each state of the first frame is (n,), by all frames up to the last; they sum to 1."""
    backward = np.ones(len(window[-1].beam))
    for one in window[:0:-1]:
        assert one.kernel is not None
        backward = one.kernel @ (backward * one.likelihoods)  # RABINER1989 (backward)
        backward /= backward.max()
    found = window[0].forward * backward
    return np.asarray(found / found.sum())


def mean_around(row: int, found: Array, codes: Codes, poses: Array, places: Array) -> tuple[Array, Array, Codes]:
    """Return the mean pose (66,), place (3,) and code (D,) of the states that are like one of them, by weights (n,).

    The mean of all would be between a stride and its mirrored half-cycle where both are likely.
    """
    apart = ((codes - codes[row]) ** 2).sum(axis=1) / ALIKE**2
    turned = wrapped(poses[:, 0] - poses[row, 0]) / ALIKE_YAW
    share = found * np.exp(-0.5 * (apart + turned**2))
    share[row] += np.finfo(np.float64).tiny
    share /= share.sum()
    pose = poses[row] + share @ wrapped(poses - poses[row])
    return pose, places[row] + share @ (places - places[row]), np.asarray(share @ codes, dtype=np.float32)
