"""Ways through the states, drawn as likely as they are: the posterior of a clip, a frame at a time.

Forward filtering, backward messages, forward sampling: when a frame is told, the messages of the frames after it that
were seen say how well each of its states goes on, and every way that is drawn steps to a state as likely as the step,
the silhouette and what comes after make it. A way is one and the same in all frames, and no frame is held for it that
does not wait to be told anyway.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.codes import Rows
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.window import ALIKE, ALIKE_YAW, Seen

OF_THE_PATH = 2.0  # standard deviations within which a state is like the one on the path


def messages(window: Sequence[Seen], power: float) -> Array:
    """Return how likely what comes after is from each state of the first frame (n,), up to a factor.

    `power` is what the likelihoods of silhouettes are raised to: below 1, a posterior that is less sure.
    """
    backward = np.ones(len(window[-1].beam), dtype=np.float32)
    for one in window[:0:-1]:
        assert one.kernel is not None
        likely = backward * one.likelihoods**power
        backward = one.kernel @ (likely / likely.max()).astype(np.float32)  # GODSILL2004 (messages)
    return np.asarray(backward, dtype=np.float64)


def onward(window: Sequence[Seen], rows: Rows | None, count: int, power: float, rng: np.random.Generator) -> Rows:
    """Return the states (count,) of the first frame that ways step to from `rows` (count,) of the frame before it.

    Without `rows` ways begin there, each on its own.
    """
    first = window[0]
    likely = np.broadcast_to(first.likelihoods**power * messages(window, power), (count, len(first.beam)))
    if rows is not None and first.kernel is not None:
        likely = first.kernel[rows] * likely  # GODSILL2004 (step)
    ends = likely.cumsum(axis=1)
    drawn = ends[:, -1:] * rng.random((count, 1))
    return np.asarray((ends <= drawn).sum(axis=1), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Ways:
    """The states that ways have in one frame."""

    poses: Array = field(repr=False)  # (K, 66)
    places: Array = field(repr=False)  # (K, 3) metres
    like: NDArray[np.bool_] = field(repr=False)  # (K,) whether they are like the one on the path

    def about(self, pose: Array, place: Array) -> Posterior:
        """Return the posterior whose ways that are like the path have what was told for their mean.

        What refinement found is the person's own way to be where the path is; of what is unlike nobody knows it.
        """
        poses, places = self.poses.copy(), self.places.copy()
        if self.like.any():
            apart = wrapped(poses[self.like] - pose)
            poses[self.like] = pose + apart - apart.mean(axis=0)
            places[self.like] += place - places[self.like].mean(axis=0)
        return Posterior(poses, places, np.ones(len(poses)), coherent=True)


class Sampler:
    """Draws `count` ways through the frames as they are told."""

    def __init__(self, exemplars: Exemplars, count: int, power: float, rng: np.random.Generator) -> None:
        self._exemplars, self._count, self._power = exemplars, count, power
        self._rng = rng.spawn(1)[0]  # of its own: what is told is the same however many ways are drawn
        self._rows: Rows | None = None

    def drawn(self, window: Sequence[Seen], path: int) -> Ways | None:
        """Return where ways are in the first frame of a window, in which the path is at a state; None for no ways."""
        if not self._count:
            return None
        self._rows = onward(window, self._rows, self._count, self._power, self._rng)
        beam = window[0].beam
        states, yaws = beam.states[self._rows], beam.yaws[self._rows]
        poses = self._exemplars.poses[states]
        poses[:, 0] = yaws
        codes = self._exemplars.codes
        apart = ((codes[states] - codes[beam.states[path]]) ** 2).sum(axis=1) / ALIKE**2
        apart += (wrapped(yaws - beam.yaws[path]) / ALIKE_YAW) ** 2
        return Ways(poses, beam.places[self._rows], apart <= OF_THE_PATH**2)
