"""The cost of a whole trajectory, the choice between several, and their total effort.

A frame does not distinguish a stride from its mirror image, but a clip does: a wrong
initial guess fits a little worse in most frames, or has to jump. So a trajectory judged
as a whole is right more often than each of its frames.
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

# Comparisons of velocities a second. It does not depend on the frame rate, so that the
# jitter of a search counts the same at any rate.
VELOCITY_RATE = 30.0
# Metres a second, of joints about the root: the typical speed without training motions.
WALKING_SPEED = 1.0
MIN_TYPICAL_SPEED = 0.25  # metres a second
# Change of velocity of a joint that turns around on the spot, in typical speeds.
TURN_AROUND_SPEED = 2.0
# Larger changes of the velocities of all joints are jumps, in typical speeds.
JUMP_SPEED = 5.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A track from one initial guess."""

    guess: str  # its name
    task: Task  # what is known at the start
    rng: np.random.Generator
    frames: Sequence[Frame] = ()  # the frames so far


class Tracked(NamedTuple):
    """The track that is kept of several, with the effort of all."""

    frames: list[Frame]
    # a row for each of several hypotheses: guess, cost, motion term, whether it is kept
    hypotheses: list[dict[str, Any]]
    # the first and last frame that were kept when a spin was tracked again, see
    # `retrack_spins`
    kept_run: tuple[int, int] | None = None


@dataclass(frozen=True)
class TrajectoryCost:
    """The cost of a whole trajectory."""

    # mean silhouette mismatch of the frames that show enough, 0 to 100. SAPSO (4)
    cost: float
    # half the mean squared change of velocity, over that of turning around
    motion: float

    @property
    def total(self) -> float:
        """The measure that compares trajectories: lower is better."""
        return self.cost + self.motion


def cheapest_sequence(costs: Array, steps: Array) -> NDArray[np.int64]:
    """Return the cheapest sequence (n,) of states, by the Viterbi algorithm.

    Args:
        costs: (n, S) the costs of the states.
        steps: (n - 1, S, S) the costs of the steps between them.
    """
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
    """Return the mean cost of the usable frames, or of all frames if none is usable."""
    costs = np.array([frame.cost for frame in frames])
    return float(costs[usable].mean() if usable.any() else costs.mean())


def with_effort_of(frame: Frame, together: Sequence[Frame]) -> Frame:
    """Return a frame with the evaluations and the time of several together.

    The evaluations in the trace of its search are stretched to the total, as if all
    searches ran in parallel.
    """
    frame = with_evaluations(frame, sum(each.evaluations for each in together))
    return replace(
        frame,
        seconds=sum(each.seconds for each in together),
        cpu_seconds=sum(each.cpu_seconds for each in together),
    )


def with_total_effort(tracks: Sequence[Sequence[Frame]], best: int) -> list[Frame]:
    """Return the frames of the best track, with the effort of all tracks."""
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
    table = list[dict[str, Any]]()
    for k, (hypothesis, cost) in enumerate(zip(hypotheses, costs, strict=True)):
        row = {
            "guess": hypothesis.guess,
            "cost": cost.cost,
            "motion": cost.motion,
            "kept": k == best,
        }
        table.append(row)
    return Tracked(with_total_effort(tracks, best), table)


def typical_speed(training: Sequence[Motion]) -> float:
    """Return the root mean square speed of joints about the root, metres a second."""
    squares = [
        _mean_squares(_velocities(motion.skeleton.joints(motion.poses), motion.fps))
        for motion in training
    ]
    each = np.concatenate(squares) if squares else np.empty(0)
    if not len(each):
        return WALKING_SPEED
    return max(float(np.sqrt(each.mean())), MIN_TYPICAL_SPEED)


def trajectory_cost(
    frames: Sequence[Frame],
    usable: Sequence[bool],
    skeleton: Skeleton,
    fps: float,
    speed: float,
) -> TrajectoryCost:
    """Return the cost of a whole trajectory.

    The motion term is half the squared change of a joint's velocity about the root,
    from one thirtieth of a second to the next, over the square of twice the typical
    speed. A joint that turns around on the spot at the typical speed costs a half. The
    term is the mean over joints and frames, and is added to the mean silhouette cost as
    it is. The change in a frame counts as five typical speeds at most, so a longer
    jump costs no more.

    Args:
        frames: The frames of the trajectory.
        usable: Whether each shows enough of the person. The others are held, and count
            only if no frame is usable.
        skeleton: The person's skeleton.
        fps: Frames a second.
        speed: The typical speed, metres a second.
    """
    shown = np.asarray(usable, dtype=bool)
    joints = skeleton.joints(np.array([frame.pose for frame in frames]))
    velocities = _velocities(joints, fps)
    step = _step(fps)
    changes = _mean_squares(velocities[step:] - velocities[:-step])
    # a change counts if all of its three frames do
    counted = shown[: -2 * step] & shown[step:-step] & shown[2 * step :]
    squares = np.minimum(changes[counted], (JUMP_SPEED * speed) ** 2)
    terms = 0.5 * squares / (TURN_AROUND_SPEED * speed) ** 2
    motion = float(terms.mean()) if len(terms) else 0.0
    return TrajectoryCost(mean_cost(frames, shown), motion)


def _step(fps: float) -> int:
    """Return the number of frames in a thirtieth of a second, at least one."""
    return max(round(fps / VELOCITY_RATE), 1)


def _velocities(joints: Array, fps: float) -> Array:
    """Return velocities (T - step, 27, 3) of joints (T, 27, 3) about the root, m/s."""
    step = _step(fps)
    rooted = root_centred(joints)
    return np.asarray((rooted[step:] - rooted[:-step]) * (fps / step))


def _mean_squares(velocities: Array) -> Array:
    return np.asarray((velocities**2).sum(axis=2).mean(axis=1))
