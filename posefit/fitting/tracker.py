"""What a tracker gets and what it returns: tasks, observations and frames.

The trackers themselves are plugins. `posefit.fitting.synthesis` is the one that makes a
tracker of an optimiser and a prior.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.space import Translation
from posefit.fitting.start import modes_apart
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Areas, Silhouette
from posefit.uncertainty.modes import Mode, Posterior

# Evaluations of a frame. With fewer, a guess would leave too few for a search. Ours.
MIN_GUESSED_EVALUATIONS = 100


@dataclass(frozen=True)
class Observation:
    """The evidence of one frame: one silhouette per camera, and what else is known.

    Attributes:
        silhouettes: One for each camera.
        translation: The position (3,) of the root in metres, or None if unknown.
        usable: False if the frame shows too little of the person. A tracker then
            repeats its last pose.
        yaw: Roughly the direction in which the person faces, in radians, or None if
            unknown.
        landmarks: Column and row in pixels, and confidence, of each joint in each view
            (views, 27, 3). The confidence is 0 to 1, and 0 for an unknown joint. None
            without a detector of joints.
        estimate: The pose (66,) and the root (3,) in metres of an earlier track, which
            a tracker may consider; or None.

    Example:
        >>> import numpy as np
        >>> from posefit import Observation, Silhouette
        >>> Observation([Silhouette.of(np.ones((4, 4), dtype=bool))]).usable
        True
    """

    silhouettes: Sequence[Silhouette] = field(repr=False)
    translation: Array | None = None  # (3,)
    usable: bool = True
    yaw: float | None = None
    landmarks: Array | None = field(default=None, repr=False)  # (views, 27, 3)
    estimate: tuple[Array, Array] | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Frame:
    """The estimate of a tracker in one frame.

    Attributes:
        pose: The pose (66,) in radians.
        translation: The position (3,) of the root in metres.
        cost: The cost of the pose, 0 to 100.
        areas: R, B, Y (views, 3) of the pose, in pixels, as `areas` counts them.
        evaluations: The number of poses that were evaluated for the frame.
        trace: The evaluations at which the cost fell, and the last one, each with the
            best cost (k, 2).
        posterior: The distribution of poses, or None if the tracker reports none.
        lost: The probability that the tracker has lost the person, or None if it
            reports none.
        activity: What the person does, such as "walk", or None if the tracker does not
            report it.
        details: Anything else that the tracker reports.
        seconds: Wall-clock time of the frame. A tracker leaves it at 0: the loop that
            drives it measures the time.
        cpu_seconds: CPU time of all threads, measured by the same loop. It does not
            grow on a busy machine.

    Raises:
        InputError: `lost` is not in 0 to 1.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import Frame
        >>> areas = np.zeros((1, 3), dtype=np.int64)  # of one view
        >>> frame = Frame(np.zeros(66), np.zeros(3), 0.0, areas, evaluations=1)
        >>> frame.modes
        ()
    """

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,)
    cost: float
    areas: Areas = field(repr=False)  # (views, 3)
    evaluations: int
    trace: Array = field(  # (k, 2)
        default_factory=lambda: np.empty((0, 2)), repr=False
    )
    posterior: Posterior | None = field(default=None, repr=False)
    lost: float | None = None
    activity: str | None = None
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)
    seconds: float = 0.0
    cpu_seconds: float = 0.0

    @property
    def modes(self) -> Sequence[Mode]:
        """The modes of the posterior, the likeliest first."""
        if self.posterior is None:
            return ()
        return self.posterior.modes

    def __post_init__(self) -> None:
        if self.lost is not None and not 0.0 <= self.lost <= 1.0:
            raise InputError(f"lost of a frame must lie in 0 to 1, got {self.lost}")


@dataclass(frozen=True, eq=False)
class Task:
    """What a tracker knows before the first frame.

    Attributes:
        body: The person's body.
        cameras: One or several.
        evaluations: The budget of a frame.
        yaw: Roughly the direction in which the person faces in the first frame, in
            radians, or None if unknown.
        anchor: Roughly the position (3,) of the root in the first frame, in metres. It
            is used if the observations do not have it.
        translation: Whether the position is "known", "searched" or "aligned".
            Interpretation S4.
        fps: Frames per second.
        training: Motions to learn from. Their angles are expressed about the axes of
            the body's skeleton; the rotations in space are the same.
        first_pose: The joint angles (63,) in the first frame, or None if unknown.
        modes: Guessed modes of the first frame with their weights, see
            `posefit.fitting.start`.
        start: Builds the initialiser that guesses the modes, or None for a search
            without a guess.
        before: The earlier frames of a track that is continued.
        resumable: Whether frames keep the state of a filter, so that another process
            can continue the track.
        threads: Number of threads. Does not change the result.
        backwards: Whether observations and training are in reverse order.
        fastest_turn: The fastest turn of the yaw, in radians a second, or None if
            unknown.

    Example:
        >>> from posefit import Body, Camera, Task, load_motion
        >>> walk = load_motion("walk")
        >>> place = walk.translations[0]
        >>> camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(320, 240))
        >>> task = Task(
        ...     Body.of(walk.skeleton), [camera], 400, None, place, training=[walk]
        ... )
        >>> task.angles.shape[1]
        63
    """

    body: Body
    cameras: Sequence[Camera]
    evaluations: int
    yaw: float | None
    anchor: Array  # (3,)
    translation: Translation = "known"
    fps: float = 30.0
    training: Sequence[Motion] = field(default=(), repr=False)
    first_pose: Array | None = None  # (63,)
    modes: Sequence[tuple[float, Posterior]] = field(default=(), repr=False)
    start: "InitialiserFactory | None" = field(default=None, repr=False)
    before: Sequence[Frame] = field(default=(), repr=False)
    resumable: bool = False
    threads: int = 1
    backwards: bool = False
    fastest_turn: float | None = None

    def __post_init__(self) -> None:
        training = [
            motion.about_axes_of(self.body.skeleton) for motion in self.training
        ]
        object.__setattr__(self, "training", training)

    @property
    def angles(self) -> Array:
        """The joint angles (T, 63) of all training motions."""
        return np.concatenate([motion.poses[:, 3:] for motion in self.training])


class Tracker(Protocol):
    """Follows a person through a sequence.

    A class need not inherit from it: this method makes it a tracker. It takes one
    observation before it yields a frame, unless it is registered with `looks_ahead`.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> from posefit.plugin import Frame, areas, mismatch
        >>> class Still:
        ...     def __init__(self, task):
        ...         self.task = task
        ...
        ...     def track(self, observations, rng):
        ...         pose = self.task.training[0].poses[0]
        ...         for seen in observations:
        ...             view = self.task.body, self.task.cameras[0], seen.silhouettes[0]
        ...             place = np.array(seen.translation)
        ...             counts = areas(*view, pose[None], place[None])
        ...             cost = float(mismatch(counts)[0])
        ...             yield Frame(pose, place, cost, counts, evaluations=1)
        >>> posefit.track("walk", method=Still, frames=(0, 2)).joints.shape
        (2, 27, 3)
    """

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, as it comes."""


# Builds a tracker, as `factory(task, **settings)`: a Task and keyword-only settings.
TrackerFactory = Callable[..., Tracker]
# Yields a frame for each observation of a task, as a method's tracker estimates it.
Follow = Callable[[Task, Iterable[Observation], np.random.Generator], Iterator[Frame]]


class Initialiser(Protocol):
    """Guesses which poses an observation may show.

    A class need not inherit from it: this method makes it an initialiser.

    Example:
        >>> from posefit.plugin import Posterior
        >>> from posefit.testing.tracker_rules import scene
        >>> class First:
        ...     def __init__(self, task):
        ...         self.task = task
        ...
        ...     def posterior(self, observation):
        ...         pose = self.task.training[0].poses[:1]
        ...         place = self.task.training[0].translations[:1]
        ...         return Posterior(pose, place, [1.0])
        >>> task, _, observations = scene()
        >>> First(task).posterior(observations[0]).poses.shape
        (1, 66)
    """

    def posterior(self, observation: Observation) -> Posterior | None:
        """Return weighted poses with translations, or None for a blind search."""
        ...


# Builds an initialiser, as `factory(task, **settings)`, with keyword-only settings.
InitialiserFactory = Callable[..., Initialiser]


def guessed_modes(
    task: Task, observation: Observation
) -> Sequence[tuple[float, Posterior]]:
    """Return the guessed modes of the poses that an observation may show.

    There are none if the pose is known, if the task has no initialiser, or if the
    budget is so small that the search needs all of it.
    """
    if task.start is None or task.first_pose is not None or not observation.usable:
        return ()
    if task.evaluations < MIN_GUESSED_EVALUATIONS:
        return ()
    posterior = task.start(task).posterior(observation)
    if posterior is None:
        return ()
    return modes_apart(task.body.skeleton, posterior)
