"""A particle filter with backward smoothing: later frames correct earlier ones.

P. Peursum, S. Venkatesh, G. West, A study on smoothing for particle-filtered 3D human
body tracking, International Journal of Computer Vision 87, 2010. This is the first of
its three smoothed inferences, particle-filtered backwards smoothing. A filter runs
forwards; then particles are weighted again from the last frame to the first. According
to its abstract, smoothing hardly improves the filtered estimate.

Interpretations: the backward weights follow Doucet, Godsill and Andrieu (2000).
The publication's motion model is replaced by a random walk of the pose's principal
components, as wide as training poses change from frame to frame. Only a frame's
heaviest particles are smoothed. A frame's pose is the weighted mean, with the filter's
weights if `backwards` is off.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from posefit.plugin import (
    Array,
    Frame,
    Observation,
    Task,
    at_least,
    positive,
    systematic_rows,
    weigh,
)
from posefit_related.frames import costs_of, first_poses, frame_of
from posefit_related.training import training_poses

HEAVIEST = 600  # ours: number of particles of a frame that are smoothed
# ours: smallest standard deviations per frame, of yaw and place
MIN_STEPS = np.array([np.radians(2.0), 0.005, 0.005, 0.005])


class Smoothing:
    """A bootstrap filter over all frames, and a backward pass over its weights.

    Settings:
        components: Number of principal components of the pose, 1 or more. Ours.
        sharpness: How fast the likelihood exp(-sharpness cost) falls, above 0.
            Ours.
        spread: Width of the motion, as a multiple of the change of training poses
            from frame to frame, above 0. Ours.
        backwards: Whether weights are smoothed; if not, the filter's are used.
    """

    def __init__(
        self,
        task: Task,
        *,
        components: int = 8,
        sharpness: float = 1.0,
        spread: float = 1.5,
        backwards: bool = True,
    ) -> None:
        at_least("components", components, 1)
        positive("sharpness", sharpness)
        positive("spread", spread)
        self.task = task
        self.sharpness = sharpness
        self.backwards = backwards
        poses = training_poses(task)[:, 1:]
        self.mean = poses.mean(axis=0)
        self.axes = np.linalg.svd(poses - self.mean, full_matrices=False)[2][
            :components
        ]
        self.steps = spread * self._training_steps()

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a frame for each observation, after all of them are filtered."""
        sequence = list(observations)
        states = list[Array]()
        weights = list[Array]()
        # one evaluation of a frame is left for the pose that is reported
        count = max(self.task.evaluations - 1, 1)
        poses = first_poses(self.task, rng, count)
        where = np.tile(self.task.anchor, (count, 1))
        particles = np.column_stack(
            [poses[:, 0], where, (poses[:, 1:] - self.mean) @ self.axes.T]
        )
        likelihood = np.full(count, 1.0 / count)
        for observation in sequence:
            if states:
                rows = systematic_rows(likelihood, rng.random(), len(likelihood))
                particles = particles[rows] + self.steps * rng.standard_normal(
                    (count, len(self.steps))
                )
            if observation.translation is not None:
                particles[:, 1:4] = observation.translation
            costs = np.zeros(count)
            if observation.usable:
                costs = costs_of(
                    self.task, observation, self._poses(particles), particles[:, 1:4]
                )
            likelihood = weigh(costs, self.sharpness)
            heaviest = np.argsort(-likelihood, kind="stable")[:HEAVIEST]
            states.append(particles[heaviest])
            weights.append(likelihood[heaviest] / likelihood[heaviest].sum())
        if self.backwards:
            weights = smoothed(states, weights, self.steps)
        for observation, particles, weight in zip(
            sequence, states, weights, strict=True
        ):
            # a mean of differences from one particle, because yaws wrap around
            leading = particles[weight.argmax()]
            mean = leading + weight @ differences(particles, leading)
            evaluations = count if observation.usable else 0
            yield frame_of(
                self.task,
                observation,
                self._poses(mean[None])[0],
                mean[1:4],
                evaluations,
            )

    def _poses(self, states: Array) -> Array:
        """Return the poses (n, 66) of states (n, 4 + m): yaw, place and components."""
        return np.column_stack([states[:, 0], self.mean + states[:, 4:] @ self.axes])

    def _training_steps(self) -> Array:
        """Return the root mean square change (4 + m,) of training states in a frame."""
        squares = []
        for motion in self.task.training:
            moved = np.column_stack(
                [
                    motion.poses[:, 0],
                    motion.translations,
                    motion.poses[:, 1:] @ self.axes.T,
                ]
            )
            squares.append(
                (differences(moved[1:], moved[:-1]) * motion.fps / self.task.fps) ** 2
            )
        steps = np.sqrt(np.concatenate(squares).mean(axis=0))
        steps[:4] = np.maximum(steps[:4], MIN_STEPS)
        return np.asarray(np.maximum(steps, 1e-6))


def differences(states: Array, origin: Array) -> Array:
    """Return states (..., 4 + m) minus an origin, the shorter way in yaw."""
    away = states - origin
    away[..., 0] = (away[..., 0] + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(away)


def smoothed(states: list[Array], weights: list[Array], steps: Array) -> list[Array]:
    """Return the weights (n,) of each frame's states (n, D), given all frames.

    Steps between frames are normal, with standard deviations `steps` (D,).
    """
    after = weights[-1:]
    for now, later, weight in reversed(
        list(zip(states, states[1:], weights, strict=False))
    ):
        moves = differences(later[None], now[:, None]) / steps
        logs = -0.5 * (moves**2).sum(axis=2)
        # (now, later), each column up to a factor that cancels
        likelihoods = np.exp(logs - logs.max(axis=0))
        reached = likelihoods / np.maximum(weight @ likelihoods, 1e-300)
        backward = weight * (reached @ after[0])  # PEURSUM2010 (backward)
        after.insert(0, backward / backward.sum())
    return after
