"""Rules of a start: weighted poses or None, repetition, and a gain for the search."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from posefit.fitting.box import draw_population
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.space import SearchSpace
from posefit.fitting.start import modes_apart, start_in
from posefit.fitting.tracker import Initialiser, Observation, Task
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.testing import common
from posefit.testing.common import PluginCase, check_speed, unchanged
from posefit.testing.problem import SIZE, principal, walking_angles
from posefit.testing.results import SkippedError, expect
from posefit.testing.tracker_rules import scene
from posefit.uncertainty.modes import Posterior

# frames of the walk, and the camera's distance in metres
FRAMES = (0, 4, 8)
DISTANCE = 5.0
POPULATION = 40
MAX_SECONDS = 2.0  # for a frame


@lru_cache(maxsize=1)
def images() -> tuple[Task, Sequence[Observation]]:
    """Return a task of unknown first yaw, and three frames of the walk in one view."""
    task, motion, _ = scene()
    camera = Camera.around(motion.translations[0], 0.8, DISTANCE, SIZE)
    observations = []
    for k in FRAMES:
        mask = project(task.body, camera, motion.poses[k], motion.translations[k])
        observations.append(Observation([Silhouette.of(mask)]))
    return replace(
        task, cameras=[camera], yaw=None, translation="aligned"
    ), observations


@dataclass(frozen=True)
class Case(PluginCase):
    """A start's factory with its settings."""

    arguments = ("task",)

    def build(self, task: Task | None = None, **more: Any) -> Initialiser:
        """Return a new start of the task."""
        start: Initialiser = self.factory(
            task or images()[0], **{**self.settings, **more}
        )
        return start

    def use(self, **more: Any) -> object:
        """Guess the poses of a frame."""
        return self.build(**more).posterior(images()[1][0])

    @cached_property
    def first(self) -> list[Posterior | None]:
        """The guess for each frame. All rules share it."""
        start = self.build()
        return [start.posterior(observation) for observation in images()[1]]


def _check_guess(guess: Posterior | None) -> None:
    expect(
        guess is None or isinstance(guess, Posterior),
        f"it must be a Posterior or None, got {type(guess).__name__}",
    )
    if guess is not None:
        finite = (
            np.isfinite(guess.poses).all() and np.isfinite(guess.translations).all()
        )
        expect(finite, "poses and translations must be finite, got nan or infinity")


def posterior(case: Case) -> str:
    """A frame gives a Posterior of finite poses, or None."""
    for guess in case.first:
        _check_guess(guess)
    counts = []
    for guess in case.first:
        counts.append("none" if guess is None else str(len(guess)))
    return f"{', '.join(counts)} poses of a frame"


def several_views(case: Case) -> None:
    """A start survives several cameras, and views of a part of the person or none."""
    task, (observation, *_) = images()
    # in this view the feet are below the image
    near_task, _, near_observations = scene()
    (near,) = near_task.cameras
    parts = near_observations[0].silhouettes
    whole = observation.silhouettes
    empty = [Silhouette.of(np.zeros(SIZE[::-1], dtype=bool))]
    for cameras, shown in (
        ([near], parts),
        ([*task.cameras, near], [*whole, *parts]),
        ([near, near], [*parts, *empty]),
    ):
        _check_guess(
            case.build(replace(task, cameras=cameras)).posterior(Observation(shown))
        )


def same_again(case: Case) -> None:
    """The same frame gives the same poses and weights, after any other frames."""
    start = case.build()
    for observation in [images()[1][-1], *images()[1]]:
        guess = start.posterior(observation)
    again = guess
    first = case.first[-1]
    same = again is first is None or (
        again is not None
        and first is not None
        and np.array_equal(again.poses, first.poses)
        and np.array_equal(again.weights, first.weights)
    )
    expect(same, "two starts must guess the same poses for a frame, got others")


def inputs(case: Case) -> None:
    """The start does not modify observations or task."""
    task, (observation, *_) = images()
    same = unchanged(observation.silhouettes[0].mask, task.anchor)
    case.build().posterior(observation)
    expect(same(), "the start must not modify observations or task, but did")


def gain(case: Case) -> str:
    """Populations sampled from its modes have a lower best cost than uniform ones."""
    task, observations = images()
    prior = principal(walking_angles())
    space = SearchSpace(
        prior, np.zeros(3), np.radians([180.0, 15.0, 15.0]), task.anchor, "aligned"
    )
    costs = []
    for guess, observation in zip(case.first, observations, strict=True):
        if guess is not None:
            cost = SilhouetteCost(
                task.body, task.cameras, observation.silhouettes, space
            )
            start = start_in(cost, modes_apart(task.body.skeleton, guess))
            costs_of_frame = []
            for each in (replace(space, start=start), space):
                drawn = draw_population(each, np.random.default_rng(0), POPULATION)
                costs_of_frame.append(cost(drawn).min())
            costs.append(costs_of_frame)
    if not costs:
        raise SkippedError("it knows no pose of the built-in walk")
    guided, blind = np.mean(costs, axis=0)
    expect(
        guided < blind,
        f"the best of a population must cost less than {blind:.1f}, without a start, "
        f"got {guided:.1f}",
    )
    return f"cost {guided:.1f}, without a start {blind:.1f}"


def speed(case: Case) -> str:
    """A frame takes less than two seconds."""
    start = case.build()
    observation = images()[1][0]
    return check_speed(
        "a frame", MAX_SECONDS, lambda _: len([start.posterior(observation)])
    )


RULES = [
    common.construction,
    posterior,
    several_views,
    same_again,
    inputs,
    common.global_randomness,
    gain,
    common.silence,
    common.nonsense_settings,
    common.unknown_setting,
    speed,
]
