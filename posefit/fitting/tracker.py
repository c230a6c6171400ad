"""Tracking by synthesis: predict, search, commit, frame by frame. SAPSO section 4."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol, cast

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Start, displacement
from posefit.fitting.carried import (
    CARRIED,
    OptimiserMaker,
    carried,
    plugin_of,
    revived,
    with_carried,
)
from posefit.fitting.check import at_least, between, choices, one_of, positive, whole
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.optimiser import Filter, NextFrame, Optimiser
from posefit.fitting.prior import Latents, Tilt
from posefit.fitting.problem import Problem, minimise
from posefit.fitting.race import cheapest, race
from posefit.fitting.space import ROOT_RANGE_DEGREES, SearchSpace, Translation
from posefit.fitting.start import modes_apart, posterior_of, start_in
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA
from posefit.silhouette.drawn import PoseCount, uncounted
from posefit.silhouette.mask import Areas, Silhouette
from posefit.uncertainty.modes import Mode, Posterior

# k of Interpretation S5: Sigma's standard deviations, as multiples of the predicted
# step
SPREAD = 1.0
HISTORY_FRAMES = 3  # how far back a prediction looks
TILT_SHARE = 0.99  # ours: of the training poses, whose tilt is searched
TILT_MARGIN_DEGREES = 5.0  # ours: people's own ways to stand differ by about as much
RELOCALISE_GAP = 5  # frames without the person, about a sixth of a second. Ours
# in the details of a frame: (d,) of its pose in the search space
COORDINATES = "coordinates"
# Interpretation S5: their floor, in half-ranges of the box, so that a still subject
# keeps some spread
FLOOR = 0.05
# of a frame: with fewer, a guess would leave too few for a search. Ours
MIN_GUESSED_EVALUATIONS = 100


@dataclass(frozen=True)
class Observation:
    """What is known of one frame: a silhouette a camera, and the root's translation where that is known."""

    silhouettes: Sequence[Silhouette] = field(repr=False)
    translation: Array | None = None  # (3,) metres
    # False: it shows too little to learn from, and a tracker holds its pose
    usable: bool = True
    # radians: about which way the person faces; None where it is unknown
    yaw: float | None = None
    # (V, 27, 3) of joints: column and row, pixels, and confidence, 0 to 1, 0 for an unknown joint; None for none at all
    landmarks: Array | None = field(default=None, repr=False)
    # of an earlier track, to be tried among others: the pose (66,) and the root's place (3,) metres
    estimate: tuple[Array, Array] | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Frame:
    """What a tracker estimates in one frame; the time it took is measured where the tracker is driven."""

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,) metres
    cost: float
    areas: Areas = field(repr=False)  # (views, 3): R, B, Y
    evaluations: int
    # (k, 2) the evaluations at which the cost fell, and the last one; with the best cost at each
    trace: Array = field(default_factory=lambda: np.empty((0, 2)), repr=False)
    # what else it may be, where a tracker reports it
    posterior: Posterior | None = field(default=None, repr=False)
    # how likely it is that the frame is lost, 0 to 1, where a tracker reports it
    lost: float | None = None
    # what the person does, such as "walk", where a tracker reports it
    activity: str | None = None
    # whatever else a tracker reports
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)
    seconds: float = 0.0
    # of all threads of the process: unlike `seconds` it does not grow on a busy machine
    cpu_seconds: float = 0.0

    @property
    def modes(self) -> Sequence[Mode]:
        """The modes of the posterior, the likeliest first."""
        return () if self.posterior is None else self.posterior.modes

    def __post_init__(self) -> None:
        if self.lost is not None and not 0.0 <= self.lost <= 1.0:
            raise InputError(f"lost of a frame must lie in 0 to 1, got {self.lost}")


@dataclass(frozen=True, eq=False)
class Task:
    """What a tracker knows before the first frame."""

    body: Body
    cameras: Sequence[Camera]
    evaluations: int  # the budget of a frame
    # radians: about where the person faces in the first frame; None for anywhere
    yaw: float | None
    # (3,) metres: about where the person's root is in the first frame, unless
    # observations tell
    anchor: Array
    translation: Translation = "known"  # Interpretation S4
    fps: float = 30.0
    # what may be learned from
    training: Sequence[Motion] = field(default=(), repr=False)
    # (63,) joint angles in the first frame, where they are known
    first_pose: Array | None = None
    # what the first frame may show, where it was guessed: modes with their weights, see `posefit.fitting.start`
    modes: Sequence[tuple[float, Posterior]] = field(default=(), repr=False)
    # guesses them; None for a blind search
    start: "InitialiserFactory | None" = field(default=None, repr=False)
    # earlier ones, where an interrupted track goes on
    before: Sequence[Frame] = field(default=(), repr=False)
    # whether frames hold what a filter carries, so that another process can go on
    resumable: bool = False
    threads: int = 1
    # whether observations and training come in reverse, the last one first
    backwards: bool = False
    # radians a second that the yaw turns at most; None where it is unknown
    fastest_turn: float | None = None

    def __post_init__(self) -> None:
        """Count the angles of all training about the axes of the body's skeleton: turns in space stay what they are."""
        training = [
            motion.about_axes_of(self.body.skeleton) for motion in self.training
        ]
        object.__setattr__(self, "training", training)

    @property
    def angles(self) -> Array:
        """The joint angles (T, 63) of all motions that may be learned from."""
        return np.concatenate([motion.poses[:, 3:] for motion in self.training])


class Tracker(Protocol):
    """Follows a person through a sequence; nothing to inherit.

    It takes one observation before it yields a frame, unless it is registered as one that looks ahead.
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
    """Guesses which poses an observation may show; nothing to inherit."""

    def posterior(self, observation: Observation) -> Posterior | None:
        """Return weighted poses with their translations; None where it knows of none, and the search is blind."""
        ...


# Builds an initialiser, as `factory(task, **settings)`: a Task and keyword-only settings.
InitialiserFactory = Callable[..., Initialiser]


def guessed_modes(
    task: Task, observation: Observation
) -> Sequence[tuple[float, Posterior]]:
    """Return the modes of what an observation may show; none where nothing guesses them, or the pose is known.

    A very small budget is for the search alone.
    """
    if task.start is None or task.first_pose is not None or not observation.usable:
        return ()
    if task.evaluations < MIN_GUESSED_EVALUATIONS:
        return ()
    posterior = task.start(task).posterior(observation)
    return () if posterior is None else modes_apart(task.body.skeleton, posterior)


@dataclass(frozen=True, eq=False, kw_only=True)
class Prediction:
    """Where the next frame's pose is sought, where the search starts, and what a pose costs. SAPSO (4), (6), (7).

    Settings:
        spread (k): standard deviations of the start, as multiples of the predicted step, 0 or more. Interpretation S5.
        floor: the least they are, in half-ranges of the box, above 0: a still subject keeps some. Interpretation S5.
        root_range_degrees: yaw, pitch and roll that are searched, to either side of the last ones. Ours.
        tilt: pitch and roll are "learned" with the latents, or a "box" around upright; by default learned, and a box
            to the letter of the paper. Interpretation S16.
        beta: what the missed share counts, 0 to 1, and 1 - beta the spilled one. SAPSO (4).
        start: what guesses the first pose where the yaw is unknown, by name, "blind" for nothing; by default "lookup".
        relocalise_gap: in footage, frames of a gap after which several starts look all around; 0 never. Ours.
        variant: "paper" is the letter of SAPSO's paper: the step before the latest (Interpretation S12), a box of tilts
            (S16), and a root that turns about x, then y, then z (S3).
    """

    spread: float = SPREAD
    floor: float = FLOOR
    root_range_degrees: tuple[float, float, float] = ROOT_RANGE_DEGREES
    tilt: Literal["learned", "box"] | None = None
    beta: float = BETA
    start: str | None = None
    relocalise_gap: int = RELOCALISE_GAP
    variant: Literal["default", "paper"] = "default"

    def __post_init__(self) -> None:
        # 1 is 1.0, to compiled loops and in a summary
        object.__setattr__(self, "beta", float(self.beta))
        choices(Prediction, vars(self))
        one_of("tilt", self.tilt or "learned", ("learned", "box"))
        positive("floor", self.floor)
        between("beta", self.beta, 0.0, 1.0)
        for name in ("spread", "root_range_degrees"):
            for value in np.atleast_1d(getattr(self, name)):
                at_least(name, value, 0.0)
        whole("relocalise_gap", self.relocalise_gap, 0)

    def tilted(self, prior: Latents, training: Sequence[Motion]) -> Tilt | None:
        """Return the tilt that goes with a prior's latents in the training motions; None where nothing is learned."""
        if (
            self.tilt or ("box" if self.variant == "paper" else "learned")
        ) == "box" or not training:
            return None
        return Tilt.of(
            prior, training, TILT_SHARE, float(np.radians(TILT_MARGIN_DEGREES))
        )


class Predictor:
    """Goes from frame to frame: gives the space of the next one, and takes the best proposal in it.

    A `tilt` that was learned from the task's training before is not learned again.
    """

    def __init__(
        self,
        task: Task,
        prior: Latents,
        prediction: Prediction,
        tilt: Tilt | None = None,
    ) -> None:
        self._task = task
        self._prior = prior
        self._prediction = prediction
        self._tilt = tilt or prediction.tilted(prior, task.training)
        reach = np.radians(prediction.root_range_degrees)
        if task.yaw is None:
            reach[0] = np.pi
        centre = np.array([task.yaw or 0.0, 0.0, 0.0])
        if self._tilt is not None:  # the first frame looks at all tilts
            centre[1:], reach[1:] = self._tilt.around(np.zeros(2), np.full(2, np.inf))
        self._space = SearchSpace(
            prior,
            centre,
            reach,
            task.anchor,
            task.translation,
            tilt=self._tilt,
            root_order="xyz" if prediction.variant == "paper" else "yaw_first",
        )
        earlier = [
            frame.details[COORDINATES]
            for frame in task.before
            if COORDINATES in frame.details
        ]
        # coordinates of the latest gbest, the newest last
        self._latest: list[Array] = earlier[-HISTORY_FRAMES:]
        self.guess_evaluations = 0  # that the guess of the latest start took

    def space(self, observation: Observation) -> SearchSpace:
        """Return the box of the next frame, centred on the last result, and where to start in it. SAPSO (6), (7)."""
        self.guess_evaluations = 0
        self._space = (
            self._next_space(observation.translation)
            if self._latest
            else self._first_space(observation)
        )
        return self._space

    def commit(self, proposal: Array) -> None:
        """Take the best proposal (d,) of the latest space."""
        self._latest = [*self._latest, self._space.coordinates(proposal)][
            -HISTORY_FRAMES:
        ]

    def _first_space(self, observation: Observation) -> SearchSpace:
        """Return the box of the first frame: it starts around guessed modes, a known pose, or anywhere."""
        task = self._task
        space = self._space
        if observation.translation is not None:
            space = space.around(space.centre, anchor=observation.translation)
        start, self.guess_evaluations = self._guessed_start(space, observation)
        if start is not None:
            return replace(space, start=start)
        if task.first_pose is not None:
            return replace(
                space, start=self._start_at_known_pose(space, task.first_pose)
            )
        return space

    def _guessed_start(
        self, space: SearchSpace, observation: Observation
    ) -> tuple[Start | None, int]:
        """Return the start around guessed modes, if there are any, and the evaluations that the guess took.

        An initialiser is a plugin, and counts nothing: the poses that it draws are counted.
        """
        task = self._task
        drawn = PoseCount()
        start = None
        with drawn.counting():
            if modes := task.modes or guessed_modes(task, observation):
                cost = SilhouetteCost(
                    task.body,
                    task.cameras,
                    observation.silhouettes,
                    space,
                    beta=self._prediction.beta,
                    blank=True,
                )
                start = start_in(cost, modes)
        return start, math.ceil(drawn.poses / len(task.cameras))

    def _next_space(self, anchor: Array | None) -> SearchSpace:
        """Return the box around the last result, whose start is spread as wide as the last step."""
        latest = self._latest
        space = self._space
        # only the first frame looks all around
        if self._task.yaw is None or self._tilt is not None:
            reach = np.radians(self._prediction.root_range_degrees)
            if self._tilt is not None:
                reach[1:] = self._tilt.around(space.root_centre[1:], reach[1:])[1]
            space = replace(space, root_range=reach)
        space = space.around(latest[-1], anchor=anchor)
        # Interpretation S12: v_pred = gbest_t - gbest_{t-1}, and zero where there is no such pair
        back = 2 if self._prediction.variant == "paper" else 1
        step = np.zeros(space.dimensions)
        if len(latest) > back:
            # as in proposals: 0 where nothing is searched
            half = np.where(space.half > 0.0, space.half, 1.0)
            step = displacement(space, latest[-back - 1] / half, latest[-back] / half)
        mean = space.proposals(latest[-1])
        # Interpretation S5
        spread = np.maximum(
            self._prediction.spread * np.abs(step), self._prediction.floor
        )
        return space.around(latest[-1], Start(mean, spread, step), anchor)

    def _start_at_known_pose(self, space: SearchSpace, angles: Array) -> Start:
        """Return the start of a first frame whose joint angles are about known; its root need not be."""
        latents = self._prior.transform(np.asarray(angles, dtype=np.float64)[None])[0]
        first = space.dimensions - len(latents)
        root = space.centre[:first].copy()
        root[1:3] = 0.0  # upright, or tilted as the pose predicts
        away = space.proposals(np.concatenate([root, latents]))
        spread = np.full(space.dimensions, self._prediction.floor)
        if self._task.yaw is None:
            spread[0] = 1.0
        return Start(away, spread, np.zeros(space.dimensions))


@dataclass(frozen=True, eq=False)
class SynthesisTracker:
    """Follows a person by a search a frame, started around a prediction. SAPSO section 4.

    `make` builds an optimiser from a space, a generator and the evaluations of its search; `next_frame` says what
    becomes of it in the next frame.
    """

    task: Task
    prior: Latents
    make: OptimiserMaker
    next_frame: NextFrame = "start"
    prediction: Prediction = field(default_factory=Prediction)
    # of the prior and the training, where it was learned before
    tilt: Tilt | None = field(default=None, repr=False)

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; at any time only a few frames are held in memory."""
        task = self.task
        predictor = Predictor(self.task, self.prior, self.prediction, self.tilt)
        optimiser: Optimiser | None = None
        latest: Frame | None = task.before[-1] if task.before else None
        for observation in observations:
            space = predictor.space(observation)
            if not observation.usable:
                latest = self._held(latest, space, observation)
                yield latest
                continue
            budget = task.evaluations - predictor.guess_evaluations
            # of a single picture, which nothing that follows can correct: a track goes on from one swarm as well
            alone = self.next_frame == "start" and len(task.modes) > 1
            if alone and space.start is not None and space.start.others:
                searches = self._raced(space, observation, budget, rng)
                best = cheapest(searches[0])
                predictor.commit(best.best)
                latest = _frame(best, searches, predictor.guess_evaluations)
                yield latest
                continue
            if self.next_frame == "carry" and optimiser is None:
                optimiser = self._revived(space, rng)
            if self.next_frame == "carry" and optimiser is not None:
                cast(Filter, optimiser).advance(space)
            else:
                known = replace(space, start=None)
                around = known if self.next_frame == "forget" else space
                optimiser = self.make(around, rng, budget)
            problem = self.problem(space, observation, budget)
            minimise(problem, optimiser, budget_known=True)
            predictor.commit(problem.best)
            latest = _frame(problem, [[problem]], predictor.guess_evaluations)
            if self.next_frame == "carry" and task.resumable:
                state = carried(plugin_of(optimiser), space, rng)
                latest = with_carried(latest, state)
            yield latest

    def _revived(
        self, space: SearchSpace, rng: np.random.Generator
    ) -> Optimiser | None:
        """Return the filter that the frames before this track held; None if they held none."""
        for frame in reversed(self.task.before):
            if state := frame.details.get(CARRIED):
                evaluations = self.task.evaluations
                return revived(state, space, rng, evaluations, self.make)
        return None

    def _raced(
        self,
        space: SearchSpace,
        observation: Observation,
        budget: int,
        rng: np.random.Generator,
    ) -> list[list[Problem]]:
        """Return the searches from each of the modes that a frame may show, the best first."""
        assert space.start is not None

        def search(start: Start, evaluations: int) -> Problem:
            around = replace(space, start=replace(start, others=()))
            problem = self.problem(around, observation, evaluations)
            optimiser = self.make(around, rng, evaluations)
            return minimise(problem, optimiser, budget_known=True)

        starts = [replace(space.start, others=()), *space.start.others]
        return race(starts, search, budget)

    def _held(
        self, latest: Frame | None, space: SearchSpace, observation: Observation
    ) -> Frame:
        """Return the latest frame once more, at no evaluation; before the first one, the middle of the box."""
        poses, places = space.decode(np.zeros((1, space.dimensions)))
        if latest is not None:
            poses = latest.pose[None]
            places = latest.translation[None]
        if observation.translation is not None:
            places = np.array(observation.translation, dtype=np.float64)[None]
        problem = self.problem(space, observation, self.task.evaluations)
        with uncounted():
            costs, areas = problem.cost_and_areas(poses, places)
        return Frame(poses[0], places[0], float(costs[0]), areas[:, 0], 0)

    def problem(
        self, space: SearchSpace, observation: Observation, budget: int
    ) -> Problem:
        """Return the problem that a frame is: its pose in a space, within a budget."""
        task = self.task
        cost = SilhouetteCost(
            task.body,
            task.cameras,
            observation.silhouettes,
            space,
            beta=self.prediction.beta,
            threads=task.threads,
            blank=True,
        )
        return Problem(cost, space, budget, id="a frame")


def _frame(
    best: Problem, searches: Sequence[Sequence[Problem]], guess_evaluations: int
) -> Frame:
    """Return the frame of the best of some searches, with the evaluations of all and of the guess before them.

    Several modes of what the frame may show are its posterior.
    """
    poses, translations = best.decode(best.best[None])
    with uncounted():  # its result drawn again is no evaluation
        areas = best.cost_and_areas(poses, translations)[1][:, 0]
    problems = [problem for mode in searches for problem in mode]
    evaluations = guess_evaluations + sum(each.evaluations for each in problems)
    used, costs = best.trace
    # the course of the best search, behind all that went on beside it
    trace = np.column_stack([used + (evaluations - best.evaluations), costs])
    return Frame(
        poses[0],
        translations[0],
        best.best_cost,
        areas,
        evaluations,
        trace,
        posterior=_posterior(searches) if len(searches) > 1 else None,
        details={COORDINATES: cast(SearchSpace, best.space).coordinates(best.best)},
    )


def _posterior(searches: Sequence[Sequence[Problem]]) -> Posterior:
    """Return what a frame may show, by the poses at which the searches of its modes ended."""
    bests = [cheapest(problems) for problems in searches]
    decoded = [best.decode(best.best[None]) for best in bests]
    poses = np.concatenate([poses for poses, _ in decoded])
    places = np.concatenate([places for _, places in decoded])
    return posterior_of(poses, places, np.array([best.best_cost for best in bests]))
