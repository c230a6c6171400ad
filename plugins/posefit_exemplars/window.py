"""The frames of the lag window: the likeliest path through them, weights of states, and paths drawn at random.

A hidden Markov model: the states of a beam, steps between them, and costs of silhouettes over a temperature. The path
is Viterbi's, and the weights are those of the forward-backward algorithm over the window. Paths are drawn from the
posterior of the whole clip: the backward messages of the later frames weigh the states that a step may reach.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton, joint_distances
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.exemplars import Codes, Rows

SIMILAR = 0.06  # metres: standard deviation of the codes of states that are averaged
SIMILAR_YAW = np.radians(20.0)
MODE = 0.12  # metres, root mean square over joints: samples that are nearer are of the reported pose's mode
HIGHEST = 80.0  # cost of a step beyond which its likelihood would be 0, and so the sum of all might be

Kernel = NDArray[np.float32]


class States(Protocol):
    """What a frame may be: states of a beam, or hypotheses. A dataclass."""

    @property
    def totals(self) -> Array:
        """What the likeliest way to each state costs (n,)."""

    @property
    def parents(self) -> Rows:
        """The state (n,) of the frame before from which it comes, or -1."""

    def __len__(self) -> int: ...


S = TypeVar("S", bound=States)


@dataclass(frozen=True, eq=False)
class FrameStates(Generic[S]):
    """The states of a frame, with their likelihoods by the frames so far."""

    beam: S  # totals and parents are those of the likeliest ways
    likelihoods: Array = field(repr=False)  # (n,) of the silhouettes, the greatest 1
    kernel: Kernel | None = field(repr=False)  # (m, n) likelihoods of steps from the frame before
    forward: Array = field(repr=False)  # (n,) weights by all frames so far, which sum to 1


def frame_states(beam: S, fits: Array, before: FrameStates[S] | None, steps: Array | None) -> FrameStates[S]:
    """Return a frame whose states have costs of fit (n,), to which steps from the frame before cost (m, n)."""
    likelihoods = np.exp(fits.min() - fits)  # TOYAMA2001 (likelihood)
    if before is None or steps is None:
        totals = fits - fits.min()
        beam = _replaced(beam, totals=totals, parents=np.full(len(beam), -1))
        return FrameStates(beam, likelihoods, None, likelihoods / likelihoods.sum())
    ways = before.beam.totals[:, None] + steps
    parents = ways.argmin(axis=0)
    totals = ways[parents, np.arange(len(beam))] + fits  # RABINER1989 (Viterbi)
    kernel = np.exp(-np.minimum(steps, HIGHEST)).astype(np.float32)
    forward = (before.forward @ kernel) * likelihoods  # RABINER1989 (forward)
    beam = _replaced(beam, totals=totals - totals.min(), parents=parents)
    return FrameStates(beam, likelihoods, kernel, forward / forward.sum())


def _replaced(states: S, **changes: Any) -> S:
    return replace(states, **changes)  # type: ignore[type-var, no-any-return]


def viterbi_state(window: Sequence[FrameStates[S]]) -> int:
    """Return the state of the first frame on the likeliest path to the last one."""
    row = int(window[-1].beam.totals.argmin())
    for frame in window[:0:-1]:
        row = int(frame.beam.parents[row])
    return row


def state_weights(window: Sequence[FrameStates[S]]) -> Array:
    """Return the weights (n,) of the states of the first frame, given all frames up to the last; they sum to 1."""
    backward = np.ones(len(window[-1].beam))
    for frame in window[:0:-1]:
        assert frame.kernel is not None
        backward = frame.kernel @ (backward * frame.likelihoods)  # RABINER1989 (backward)
        backward /= backward.max()
    products = window[0].forward * backward
    return np.asarray(products / products.sum())


def squares_apart(codes: Codes, code: Codes, turns: Array) -> Array:
    """Return the squared distances (n,) of codes (n, D) from one, and of turns (n,) from 0, in standard deviations."""
    return np.asarray(((codes - code) ** 2).sum(axis=1) / SIMILAR**2 + (wrapped(turns) / SIMILAR_YAW) ** 2)


def mean_near(row: int, weights: Array, squares: Array, poses: Array, places: Array) -> tuple[Array, Array]:
    """Return the mean pose (66,) and place (3,) of the states similar to one of them, by weights (n,).

    `squares` (n,) are their squared distances from it, in standard deviations. The mean of all would be between a
    stride and its mirrored half-cycle where both are likely.
    """
    share = weights * np.exp(-0.5 * squares)
    share[row] += np.finfo(np.float64).tiny
    share /= share.sum()
    return poses[row] + share @ wrapped(poses - poses[row]), places[row] + share @ (places - places[row])


def backward_messages(window: Sequence[FrameStates[S]], power: float) -> Array:
    """Return the likelihood (n,) of the later frames given each state of the first, up to a factor.

    `power` is what the likelihoods of silhouettes are raised to: below 1, the posterior is wider.
    """
    backward = np.ones(len(window[-1].beam), dtype=np.float32)
    for frame in window[:0:-1]:
        assert frame.kernel is not None
        likely = backward * frame.likelihoods**power
        backward = frame.kernel @ (likely / likely.max()).astype(np.float32)  # GODSILL2004 (messages)
    return np.asarray(backward, dtype=np.float64)


def sample_states(
    window: Sequence[FrameStates[S]], rows: Rows | None, count: int, power: float, rng: np.random.Generator
) -> Rows:
    """Return states (count,) of the first frame, drawn given the states `rows` (count,) of the frame before it.

    Without `rows` paths begin there, independently.
    """
    first = window[0]
    likely = np.broadcast_to(first.likelihoods**power * backward_messages(window, power), (count, len(first.beam)))
    if rows is not None and first.kernel is not None:
        likely = first.kernel[rows] * likely  # GODSILL2004 (step)
    ends = likely.cumsum(axis=1)
    drawn = ends[:, -1:] * rng.random((count, 1))
    return np.asarray((ends <= drawn).sum(axis=1), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class SampledPaths:
    """The poses of sampled paths in one frame."""

    poses: Array = field(repr=False)  # (K, 66)
    places: Array = field(repr=False)  # (K, 3) metres
    like: NDArray[np.bool_] = field(repr=False)  # (K,) which are similar to the reported pose

    @classmethod
    def of(cls, skeleton: Skeleton, poses: Array, places: Array, reported: Array) -> Self:
        """Return sampled poses (K, 66) at places (K, 3), of which those near the reported one (66,) are like it."""
        apart = joint_distances(skeleton.joints(poses), skeleton.joints(reported))
        return cls(poses, places, (apart**2).mean(axis=1) <= MODE**2)

    def about(self, pose: Array, place: Array) -> Posterior:
        """Return the posterior in which the mean of the paths similar to the likeliest is the reported pose.

        Refinement is relative to the likeliest path; for other paths it is unknown.
        """
        poses, places = self.poses.copy(), self.places.copy()
        if self.like.any():
            apart = wrapped(poses[self.like] - pose)
            poses[self.like] = pose + apart - apart.mean(axis=0)
            places[self.like] += place - places[self.like].mean(axis=0)
        return Posterior(poses, places, np.ones(len(poses)), coherent=True)


class Sampler:
    """Draws `count` paths through the frames, one frame after the other."""

    def __init__(self, count: int, power: float, rng: np.random.Generator) -> None:
        self._count, self._power, self._rng = count, power, rng
        self._rows: Rows | None = None

    def draw(self, window: Sequence[FrameStates[S]]) -> Rows | None:
        """Return the states (count,) of the first frame that the paths go through; None for no paths."""
        if self._count:
            self._rows = sample_states(window, self._rows, self._count, self._power, self._rng)
        return self._rows
