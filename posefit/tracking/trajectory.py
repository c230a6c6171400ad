"""What a whole trajectory costs, which of two is kept, and the effort of several together.

A frame does not distinguish a stride from its mirror image, but a clip does: a wrong initial guess fits a little worse
in most frames, or has to jump. So a trajectory that is judged as a whole is right more often than each of its frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.driving import with_evaluations
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import Skeleton, root_centred
from posefit.motion.motion import Motion

# how often velocities are compared, so that the jitter of a search counts the same at
# any rate
VELOCITY_RATE = 30.0
# metres a second, of the joints about the root: the typical speed where nothing is
# learned from
WALKING_SPEED = 1.0
MIN_TYPICAL_SPEED = 0.25  # metres a second
# typical speeds, which a joint's velocity changes by when it turns around on the spot
TURN_AROUND_SPEED = 2.0
# typical speeds: where the velocities of all joints change by more, the body is
# somewhere else
JUMP_SPEED = 5.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A track from one initial guess: what that is called, what is known at the start, and the frames so far."""

    guess: str
    task: Task
    rng: np.random.Generator
    frames: Sequence[Frame] = ()


class Tracked(NamedTuple):
    """The track that is kept of several, with the effort of all."""

    frames: list[Frame]
    # of each of several: its initial guess, cost and motion term, and whether kept
    hypotheses: list[dict[str, Any]]
    # the first and last frame that stayed where the others were tracked again because the body spun
    stay: tuple[int, int] | None = None


@dataclass(frozen=True)
class TrajectoryCost:
    """What a whole trajectory costs."""

    # mean silhouette mismatch of the frames that show enough, 0 to 100. SAPSO (4)
    cost: float
    # half the mean squared change of velocity, over that of turning around
    motion: float

    @property
    def total(self) -> float:
        """By which trajectories are compared: lower is better."""
        return self.cost + self.motion


def cheapest_sequence(costs: Array, steps: Array) -> NDArray[np.int64]:
    """Return the cheapest sequence (n,) of states, by their costs (n, S) and those of steps (n - 1, S, S). Viterbi."""
    totals = costs[0]
    parents = []
    for cost, step in zip(costs[1:], steps, strict=True):
        paths = totals[:, None] + step
        parents.append(paths.argmin(axis=0))
        totals = paths.min(axis=0) + cost
    states = [int(totals.argmin())]
    for parent in reversed(parents):
        states.append(int(parent[states[-1]]))
    return np.array(states[::-1])


def mean_cost(frames: Sequence[Frame], usable: NDArray[np.bool_]) -> float:
    """Return the mean cost of the frames that show enough of the person; of all frames where none does."""
    costs = np.array([frame.cost for frame in frames])
    return float(costs[usable].mean() if usable.any() else costs.mean())


def with_effort_of(frame: Frame, together: Sequence[Frame]) -> Frame:
    """Return a frame with the evaluations and the time of several together.

    The course of its search is given as if all went on abreast: its evaluations are stretched to those of all.
    """
    seconds, cpu_seconds = (
        sum(getattr(each, name) for each in together)
        for name in ("seconds", "cpu_seconds")
    )
    frame = with_evaluations(frame, sum(each.evaluations for each in together))
    return replace(frame, seconds=seconds, cpu_seconds=cpu_seconds)


def with_total_effort(tracks: Sequence[Sequence[Frame]], best: int) -> list[Frame]:
    """Return the frames of the track that is kept, with the evaluations and the time of all tracks."""
    return [
        with_effort_of(together[best], together)
        for together in zip(*tracks, strict=True)
    ]


def cheapest(
    scene: Scene, hypotheses: Sequence[Hypothesis], training: Sequence[Motion]
) -> Tracked:
    """Return the hypothesis whose trajectory costs least."""
    if len(hypotheses) == 1:
        return Tracked(list(hypotheses[0].frames), [])
    usable = [observation.usable for observation in scene.observations]
    speed = typical_speed(training)
    tracks = [hypothesis.frames for hypothesis in hypotheses]
    costs = [
        trajectory_cost(frames, usable, scene.body.skeleton, scene.fps, speed)
        for frames in tracks
    ]
    best = min(range(len(costs)), key=lambda k: costs[k].total)
    table = [
        {
            "guess": hypothesis.guess,
            "cost": cost.cost,
            "motion": cost.motion,
            "kept": k == best,
        }
        for k, (hypothesis, cost) in enumerate(zip(hypotheses, costs, strict=True))
    ]
    return Tracked(with_total_effort(tracks, best), table)


def typical_speed(training: Sequence[Motion]) -> float:
    """Return the root mean square speed of joints about the root in some motions, in metres a second."""
    squares = [
        _mean_squares(_velocities(motion.skeleton.joints(motion.poses), motion.fps))
        for motion in training
    ]
    each = np.concatenate(squares) if squares else np.empty(0)
    return (
        max(float(np.sqrt(each.mean())), MIN_TYPICAL_SPEED)
        if len(each)
        else WALKING_SPEED
    )


def trajectory_cost(
    frames: Sequence[Frame],
    usable: Sequence[bool],
    skeleton: Skeleton,
    fps: float,
    speed: float,
) -> TrajectoryCost:
    """Return what a whole trajectory costs; held frames count for nothing, unless all are held.

    The motion term is half the squared change of a joint's velocity about the root, from one thirtieth of a second to
    the next, over the square of twice the typical `speed`: a joint that turns around on the spot at that speed costs a
    half. It is the mean over joints and frames, and is added to the mean silhouette cost as it is. A frame counts for
    five typical speeds at most: a body that jumped has jumped, however far.
    """
    shown = np.asarray(usable, dtype=bool)
    velocities = _velocities(
        skeleton.joints(np.array([frame.pose for frame in frames])), fps
    )
    step = _step(fps)
    changes = _mean_squares(velocities[step:] - velocities[:-step])
    # of each change, its three frames
    counted = shown[: -2 * step] & shown[step:-step] & shown[2 * step :]
    terms = (
        0.5
        * np.minimum(changes[counted], (JUMP_SPEED * speed) ** 2)
        / (TURN_AROUND_SPEED * speed) ** 2
    )
    return TrajectoryCost(
        mean_cost(frames, shown), float(terms.mean()) if len(terms) else 0.0
    )


def _step(fps: float) -> int:
    """Return how many frames a thirtieth of a second is, one at least."""
    return max(round(fps / VELOCITY_RATE), 1)


def _velocities(joints: Array, fps: float) -> Array:
    """Return the velocities (T - step, 27, 3) of joints (T, 27, 3) about the root, in metres a second."""
    step = _step(fps)
    rooted = root_centred(joints)
    return np.asarray((rooted[step:] - rooted[:-step]) * (fps / step))


def _mean_squares(velocities: Array) -> Array:
    return np.asarray((velocities**2).sum(axis=2).mean(axis=1))
