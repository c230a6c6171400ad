"""A hidden Markov model over the frames of the lag window.

The cost of a state is its silhouette's cost over a temperature; steps between the
states of successive frames have costs too. The Viterbi algorithm finds the likeliest
path, and the forward-backward algorithm the weights of states. Sampled paths are drawn
from the posterior of the whole clip: the backward messages of the later frames weigh
the states that a step may reach.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton, joint_distances
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.kernels import Rows

# Metres, root mean square over joints. Samples nearer to the reported pose than this
# belong to its mode.
MODE_DISTANCE = 0.12
# The cost of a step is at most this in the kernel. In single precision the likelihoods
# of costlier steps may be 0, and if all were, their sum would be 0 too.
MAX_KERNEL_COST = -np.log(np.finfo(np.float32).tiny)

T = TypeVar("T")


class LikeliestPaths(NamedTuple):
    """The likeliest path to each of a frame's states, given the frames so far."""

    totals: Array  # (n,) costs of the paths, the least 0
    parents: Rows  # (n,) the previous state on the path, or -1


def likeliest_paths(
    costs: Array, before: LikeliestPaths | None = None, steps: Array | None = None
) -> LikeliestPaths:
    """Return the likeliest paths to the states of a frame.

    Args:
        costs: (n,) the costs of the states.
        before: The likeliest paths of the frame before, or None in the first frame.
        steps: (m, n) the costs of the steps from each state before.
    """
    if before is None or steps is None:
        return LikeliestPaths(costs - costs.min(), np.full(len(costs), -1))
    paths = before.totals[:, None] + steps
    parents = paths.argmin(axis=0)
    totals = paths[parents, np.arange(len(costs))] + costs  # RABINER1989 (Viterbi)
    return LikeliestPaths(totals - totals.min(), parents)


class FrameStates(NamedTuple):
    """The likeliest paths to a frame's states, and the weights of the states."""

    paths: LikeliestPaths
    likelihoods: Array  # (n,) of the silhouettes, the greatest 1
    # (m, n) likelihoods of steps from the frame before
    kernel: NDArray[np.float32] | None
    forward: Array  # (n,) weights given the frames so far, which sum to 1


def frame_states(
    costs: Array, before: FrameStates | None = None, steps: Array | None = None
) -> FrameStates:
    """Return the states of a frame, with the arguments of `likeliest_paths`."""
    likelihoods = np.exp(costs.min() - costs)  # TOYAMA2001 (likelihood)
    if before is None or steps is None:
        forward = likelihoods / likelihoods.sum()
        return FrameStates(likeliest_paths(costs), likelihoods, None, forward)
    paths = likeliest_paths(costs, before.paths, steps)
    kernel = np.exp(-np.minimum(steps, MAX_KERNEL_COST)).astype(np.float32)
    forward = (before.forward @ kernel) * likelihoods  # RABINER1989 (forward)
    return FrameStates(paths, likelihoods, kernel, forward / forward.sum())


def windows(frames: Iterable[T], delay: int) -> Iterator[Sequence[T]]:
    """Yield a window for each frame: the frame and up to `delay` later ones.

    A window is yielded as soon as it is complete. All windows are one sequence, which
    changes before the next one is yielded.
    """
    waiting: deque[T] = deque()
    for frame in frames:
        waiting.append(frame)
        if len(waiting) > delay:
            yield waiting
            waiting.popleft()
    while waiting:
        yield waiting
        waiting.popleft()


def viterbi_state(window: Sequence[LikeliestPaths]) -> int:
    """Return the state of the first frame on the likeliest path to the last one."""
    row = int(window[-1].totals.argmin())
    for frame in window[:0:-1]:
        row = int(frame.parents[row])
    return row


def state_weights(window: Sequence[FrameStates]) -> Array:
    """Return the weights (n,) of the first frame's states, given the whole window.

    They sum to 1.
    """
    backward = np.ones(len(window[-1].likelihoods))
    for frame in window[:0:-1]:
        assert frame.kernel is not None
        # RABINER1989 (backward)
        backward = frame.kernel @ (backward * frame.likelihoods)
        backward /= backward.max()
    products = window[0].forward * backward
    return np.asarray(products / products.sum())


def mean_near(
    row: int, weights: Array, squares: Array, poses: Array, places: Array
) -> tuple[Array, Array]:
    """Return the mean pose (66,) and place (3,) of the states similar to one of them.

    The mean of all states would lie between a stride and its mirrored half-cycle if
    both are likely.

    Args:
        row: The state whose similar states are averaged.
        weights: (n,) the weights of the states.
        squares: (n,) their squared distances from that state, in standard deviations.
        poses: (n, 66) their poses.
        places: (n, 3) their places.
    """
    shares = weights * np.exp(-0.5 * squares)
    shares[row] += np.finfo(np.float64).tiny
    shares /= shares.sum()
    pose = poses[row] + shares @ wrapped(poses - poses[row])
    place = places[row] + shares @ (places - places[row])
    return pose, place


def backward_messages(window: Sequence[FrameStates], power: float) -> Array:
    """Return the likelihood (n,) of the later frames given each state of the first.

    It is determined up to a factor. The likelihoods of silhouettes are raised to
    `power`: below 1, the posterior is wider.
    """
    backward = np.ones(len(window[-1].likelihoods), dtype=np.float32)
    for frame in window[:0:-1]:
        assert frame.kernel is not None
        likelihoods = backward * frame.likelihoods**power
        # GODSILL2004 (messages)
        backward = frame.kernel @ (likelihoods / likelihoods.max()).astype(np.float32)
    return np.asarray(backward, dtype=np.float64)


class Sampling(NamedTuple):
    """How paths are sampled."""

    paths: int  # how many are drawn
    # The likelihoods of silhouettes are raised to it: the costs of hypotheses are over
    # one temperature, and those of the reported posterior over another, higher one.
    power: float


def sample_states(
    window: Sequence[FrameStates],
    rows: Rows | None,
    sampling: Sampling,
    rng: np.random.Generator,
) -> Rows:
    """Return states (K,) of the first frame, drawn from the posterior.

    Args:
        window: The first frame and the later ones that are known.
        rows: (K,) the states of the paths in the frame before, or None if the paths
            begin in the first frame, independently.
        sampling: The number of paths K, and the power of likelihoods.
        rng: The random numbers.
    """
    first = window[0]
    paths, power = sampling
    weights = np.broadcast_to(
        first.likelihoods**power * backward_messages(window, power),
        (paths, len(first.likelihoods)),
    )
    if rows is not None and first.kernel is not None:
        weights = first.kernel[rows] * weights  # GODSILL2004 (step)
    ends = weights.cumsum(axis=1)
    drawn = ends[:, -1:] * rng.random((paths, 1))
    return np.asarray((ends <= drawn).sum(axis=1), dtype=np.int64)


class SampledPaths(NamedTuple):
    """The poses of sampled paths in one frame."""

    poses: Array  # (K, 66)
    places: Array  # (K, 3) metres
    similar: NDArray[np.bool_]  # (K,) whether in the mode of the reported pose

    @classmethod
    def of(
        cls, skeleton: Skeleton, poses: Array, places: Array, reported: Array
    ) -> Self:
        """Return poses (K, 66) at places (K, 3), compared to the reported one (66,)."""
        distances = joint_distances(skeleton.joints(poses), skeleton.joints(reported))
        return cls(poses, places, (distances**2).mean(axis=1) <= MODE_DISTANCE**2)

    def about(self, pose: Array, place: Array) -> Posterior:
        """Return the posterior around the reported pose (66,) at `place` (3,).

        The paths similar to the reported pose are shifted until it is their mean.
        """
        poses = self.poses.copy()
        places = self.places.copy()
        if self.similar.any():
            differences = wrapped(poses[self.similar] - pose)
            poses[self.similar] = pose + differences - differences.mean(axis=0)
            places[self.similar] += place - places[self.similar].mean(axis=0)
        return Posterior(poses, places, np.ones(len(poses)), coherent=True)
