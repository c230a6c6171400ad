"""Tracking by synthesis: predict, search, commit, frame by frame. SAPSO section 4."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol, cast

import numpy as np

from posefit.fitting.box import Space, Start
from posefit.fitting.optimiser import Filter, Minimum, NextFrame, Optimiser, minimise
from posefit.fitting.prior import Prior
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import ROOT_RANGE_DEGREES, TRANSLATION_RANGE, SearchSpace, Translation
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA, Areas
from posefit.silhouette.mask import Silhouette

SPREAD = 1.0  # k of Reading S5: Sigma's standard deviations, as multiples of the predicted step
FLOOR = 0.05  # Reading S5: their floor, in half-ranges of the box, so that a still subject keeps some spread


@dataclass(frozen=True)
class Observation:
    """What is known of one frame: a silhouette a camera, and the root's translation where that is known."""

    silhouettes: Sequence[Silhouette] = field(repr=False)
    translation: Array | None = None  # (3,) metres


@dataclass(frozen=True, eq=False)
class Frame:
    """What a tracker found in one frame."""

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,) metres
    cost: float
    areas: Areas = field(repr=False)  # (views, 3): R, B, Y
    evaluations: int
    seconds: float
    history: Array = field(repr=False)  # (populations,) best cost after each


@dataclass(frozen=True, eq=False)
class Task:
    """What a tracker is told before the first frame."""

    body: Body
    cameras: Sequence[Camera]
    evaluations: int  # the budget of a frame
    yaw: float | None  # radians: about where the person faces in the first frame; None for anywhere
    anchor: Array  # (3,) metres: about where the person's root is in the first frame, unless observations tell
    translation: Translation = "known"  # Reading S4
    fps: float = 30.0
    training: Sequence[Motion] = field(default=(), repr=False)  # what may be learned from
    first_pose: Array | None = None  # (63,) joint angles in the first frame, where somebody knows them
    threads: int = 1


class Tracker(Protocol):
    """Follows a person through a sequence; nothing to inherit."""

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, as it comes."""
        ...


# Builds a tracker, as `factory(task, **settings)`: a Task and keyword-only settings.
TrackerFactory = Callable[..., Tracker]


@dataclass(frozen=True, eq=False)
class SynthesisTracker:
    """Follows a person by a search a frame, started around a prediction. SAPSO section 4.

    `make` builds an optimiser from a space and a generator; `next_frame` says what becomes of it in the next frame.
    Readings: `spread` and `floor` (S5), `prediction` from the "latest" step or the "literal" one before it (S12).
    """

    task: Task
    prior: Prior
    make: Callable[[Space, np.random.Generator], Optimiser]
    next_frame: NextFrame = "start"
    root_range_degrees: tuple[float, float, float] = ROOT_RANGE_DEGREES
    translation_range: tuple[float, float, float] = TRANSLATION_RANGE
    spread: float = SPREAD
    floor: float = FLOOR
    prediction: Literal["latest", "literal"] = "latest"
    beta: float = BETA

    def __post_init__(self) -> None:
        if not self.floor > 0.0:
            raise ValueError(f"floor must be above 0, got {self.floor}")
        if not self.spread >= 0.0:
            raise ValueError(f"spread must be 0 or more, got {self.spread}")
        if self.prediction not in ("latest", "literal"):
            raise ValueError(f"prediction must be one of latest, literal, got {self.prediction!r}")

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; at any time only a few frames are held in memory."""
        task, space = self.task, self._first_space()
        found: list[Array] = []  # coordinates of the latest gbest, the newest last
        optimiser: Optimiser | None = None
        for observation in observations:
            began = time.perf_counter()
            space = self._next_space(space, found, observation)
            optimiser = self._ready(optimiser, space, rng)
            problem = PoseProblem(
                task.body, task.cameras, observation.silhouettes, space, beta=self.beta, threads=task.threads
            )
            best = minimise(problem.evaluate, optimiser, task.evaluations)
            found = [*found[-2:], space.coordinates(best.proposal)]
            yield _frame(problem, best, time.perf_counter() - began)

    def _ready(self, optimiser: Optimiser | None, space: SearchSpace, rng: np.random.Generator) -> Optimiser:
        """Return the optimiser of the next frame, as `next_frame` asks."""
        if self.next_frame == "carry" and optimiser is not None:
            cast(Filter, optimiser).advance(space)
            return optimiser
        return self.make(replace(space, start=None) if self.next_frame == "forget" else space, rng)

    def _first_space(self) -> SearchSpace:
        task, reach = self.task, np.radians(self.root_range_degrees)
        if task.yaw is None:
            reach[0] = np.pi
        centre = np.array([task.yaw or 0.0, 0.0, 0.0])
        return SearchSpace(self.prior, centre, reach, task.anchor, task.translation, np.array(self.translation_range))

    def _next_space(self, space: SearchSpace, found: list[Array], observation: Observation) -> SearchSpace:
        """Return the box of the next frame, centred on the last result, and where to start in it. SAPSO (6), (7)."""
        anchor = observation.translation
        if not found:
            space = space if anchor is None else space.around(space.centre, anchor=anchor)
            return space if self.task.first_pose is None else replace(space, start=self._given(space))
        if self.task.yaw is None:  # only the first frame looks all around
            space = self._narrowed(space)
        space = space.around(found[-1], anchor=anchor)
        # Reading S12: v_pred = gbest_t - gbest_{t-1}, and zero where there is no such pair
        back = 1 if self.prediction == "latest" else 2
        step = np.zeros(space.dimensions)
        if len(found) > back:
            step = space.towards(found[-back - 1] / space.half, found[-back] / space.half)
        mean = space.proposals(found[-1])
        spread = np.maximum(self.spread * np.abs(step), self.floor)  # Reading S5
        return space.around(found[-1], Start(mean, spread, step), anchor)

    def _given(self, space: SearchSpace) -> Start:
        """Return the start of a first frame whose joint angles are about known; its root need not be."""
        away = np.zeros(space.dimensions)
        latents = self.prior.transform(np.asarray(self.task.first_pose, dtype=np.float64)[None])[0]
        first = space.dimensions - len(latents)
        away[first:] = space.proposals(np.concatenate([space.centre[:first], latents]))[first:]
        spread = np.full(space.dimensions, self.floor)
        if self.task.yaw is None:
            spread[0] = 1.0
        return Start(away, spread, np.zeros(space.dimensions))

    def _narrowed(self, space: SearchSpace) -> SearchSpace:
        reach = np.radians(self.root_range_degrees)
        return SearchSpace(
            self.prior, space.root_centre, reach, space.anchor, self.task.translation, space.translation_range
        )


def _frame(problem: PoseProblem, best: Minimum, seconds: float) -> Frame:
    poses, translations = problem.decode(best.proposal[None])
    counts = np.stack([areas[0] for areas in problem.areas(poses, translations)])
    return Frame(poses[0], translations[0], best.cost, counts, best.evaluations, seconds, best.history)
