"""Tracking by synthesis: predict, search, commit, frame by frame. SAPSO section 4.

observation --> Predictor.space --> minimise --> Predictor.commit --> frame
the box around      the best     becomes the centre
the prediction      pose in it   of the next box
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, cast

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
from posefit.fitting.space import ROOT_RANGE_DEGREES, SearchSpace
from posefit.fitting.start import posterior_of, start_in
from posefit.fitting.tracker import Frame, Observation, Task, guessed_modes
from posefit.motion.motion import Motion
from posefit.silhouette.cost import BETA
from posefit.silhouette.drawn import PoseCount, uncounted
from posefit.uncertainty.modes import Posterior

# k of Interpretation S5: Sigma's standard deviations, as multiples of the predicted
# step.
SPREAD = 1.0
# Interpretation S5: the floor of these deviations, in half-ranges of the box, so that a
# person who stands still keeps some spread.
FLOOR = 0.05
HISTORY_FRAMES = 3  # frames that a prediction looks back
TILT_SHARE = 0.99  # ours: the search covers the tilts of this share of training poses
TILT_MARGIN_DEGREES = 5.0  # ours: about the difference between standing people
RELOCALISE_GAP = 5  # frames without the person, about a sixth of a second. Ours
# Key in the details of a frame: the coordinates (d,) of its pose in the search space.
COORDINATES = "coordinates"
# The share of a frame's evaluations that compare guessed poses, at most: in pictures of
# less than 80 rows each comparison is a whole evaluation. Ours.
GUESS_SHARE = 0.25


@dataclass(frozen=True, eq=False, kw_only=True)
class Prediction:
    """The box of a search, its start, and the cost of a pose. SAPSO (4), (6), (7).

    Settings:
        spread (k): Standard deviations of the start, as multiples of the predicted
            step, 0 or more. Interpretation S5.
        floor: The least standard deviation of the start, in half-ranges of the box,
            above 0, so that a person who stands still keeps some spread. Interpretation
            S5.
        root_range_degrees: Range of yaw, pitch and roll to either side of the last
            frame's. Ours.
        tilt: Pitch and roll are "learned" with the latents, or a "box" around upright.
            Default: learned; a box with variant "paper". Interpretation S16.
        beta: Weight of the missed share, 0 to 1; the spilled share has 1 - beta. SAPSO
            (4).
        start: Name of the start that guesses the first pose if the yaw is unknown,
            "blind" for none. Default: "lookup".
        relocalise_gap: In footage, number of frames without the person after which
            several starts search all yaws; 0 for never. Ours.
        variant: "paper" follows SAPSO's paper to the letter: the step before the latest
            (Interpretation S12), a box of tilts (S16), and a root that turns about x,
            then y, then z (S3).
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
        # so that 1 and 1.0 are the same to compiled loops and in a summary
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
        """Return the tilt learned with the latents, or None for a box of tilts."""
        tilt = self.tilt
        if tilt is None:
            tilt = "box" if self.variant == "paper" else "learned"
        if tilt == "box" or not training:
            return None
        margin = float(np.radians(TILT_MARGIN_DEGREES))
        return Tilt.of(prior, training, TILT_SHARE, margin)


class Predictor:
    """Predicts the space of the next frame, and takes the best proposal in it.

    Args:
        task: The task.
        prior: The fitted prior.
        prediction: The settings.
        tilt: The tilt, if it has been learned from the task's training already.
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
        # the first frame searches all tilts
        if self._tilt is not None:
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
        earlier = []
        for frame in task.before:
            if COORDINATES in frame.details:
                earlier.append(frame.details[COORDINATES])
        # coordinates of the latest gbest, the newest last
        self._latest: list[Array] = earlier[-HISTORY_FRAMES:]
        self.guess_evaluations = 0  # evaluations of the guess of the latest start

    def space(self, observation: Observation) -> SearchSpace:
        """Return the box of the next frame, with the start in it. SAPSO (6), (7).

        It is centred on the last result.
        """
        self.guess_evaluations = 0
        if self._latest:
            self._space = self._next_space(observation.translation)
        else:
            self._space = self._first_space(observation)
        return self._space

    def commit(self, proposal: Array) -> None:
        """Take the best proposal (d,) of the latest space."""
        latest = [*self._latest, self._space.coordinates(proposal)]
        self._latest = latest[-HISTORY_FRAMES:]

    def _first_space(self, observation: Observation) -> SearchSpace:
        """Return the box of the first frame.

        The search starts around guessed modes or a known pose, or anywhere.
        """
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
        """Return the start around guessed modes, or None, and the guess's evaluations.

        An initialiser is a plugin and does not count its evaluations. So the poses that
        it rasterises are counted.
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
                start = start_in(cost, modes, GUESS_SHARE * task.evaluations)
        return start, math.ceil(drawn.poses / len(task.cameras))

    def _next_space(self, anchor: Array | None) -> SearchSpace:
        """Return the box around the last result, with the last step as its spread."""
        latest = self._latest
        space = self._space
        # only the first frame searches all yaws
        if self._task.yaw is None or self._tilt is not None:
            reach = np.radians(self._prediction.root_range_degrees)
            if self._tilt is not None:
                reach[1:] = self._tilt.around(space.root_centre[1:], reach[1:])[1]
            space = replace(space, root_range=reach)
        space = space.around(latest[-1], anchor=anchor)
        # Interpretation S12: v_pred = gbest_t - gbest_{t-1}, zero without such a pair
        back = 2 if self._prediction.variant == "paper" else 1
        step = np.zeros(space.dimensions)
        if len(latest) > back:
            # avoids a division by 0 in coordinates that are not searched
            half = np.where(space.half > 0.0, space.half, 1.0)
            step = displacement(space, latest[-back - 1] / half, latest[-back] / half)
        mean = space.proposals(latest[-1])
        # Interpretation S5
        spread = np.maximum(
            self._prediction.spread * np.abs(step), self._prediction.floor
        )
        return space.around(latest[-1], Start(mean, spread, step), anchor)

    def _start_at_known_pose(self, space: SearchSpace, angles: Array) -> Start:
        """Return the start of a first frame with roughly known joint angles (63,).

        The root need not be known.
        """
        latents = self._prior.transform(np.asarray(angles, dtype=np.float64)[None])[0]
        first = space.dimensions - len(latents)
        root = space.centre[:first].copy()
        root[1:3] = 0.0  # upright, or tilted as the pose predicts
        mean = space.proposals(np.concatenate([root, latents]))
        spread = np.full(space.dimensions, self._prediction.floor)
        if self._task.yaw is None:
            spread[0] = 1.0
        return Start(mean, spread, np.zeros(space.dimensions))


@dataclass(frozen=True, eq=False)
class SynthesisTracker:
    """Follows a person by one search per frame, around a prediction. SAPSO section 4.

    Attributes:
        task: What is known before the first frame.
        prior: The fitted prior.
        make: Builds an optimiser from a space, a generator and the number of
            evaluations of its search.
        next_frame: The optimiser of the next frame: a new one around the prediction
            ("start"), the same one ("carry"), or a new one without a start ("forget").
        prediction: The box of a search, its start, and the cost of a pose.
        tilt: The tilt, if it has been learned from the prior and the training already.

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> from posefit import SynthesisTracker
        >>> from posefit.testing.tracker_rules import scene
        >>> task, _, observations = scene()
        >>> prior = posefit.prior("pca")().fit(task.angles)
        >>> pso = posefit.optimiser("pso")
        >>> def make(space, rng, evaluations):
        ...     return pso(space, rng, population_size=20)
        >>> tracker = SynthesisTracker(task, prior, make)
        >>> frames = tracker.track(observations[:2], np.random.default_rng(0))
        >>> [frame.pose.shape for frame in frames]
        [(66,), (66,)]
    """

    task: Task
    prior: Latents
    make: OptimiserMaker
    next_frame: NextFrame = "start"
    prediction: Prediction = field(default_factory=Prediction)
    tilt: Tilt | None = field(default=None, repr=False)

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; only a few are in memory at a time.

        Raises:
            InputError: The budget is smaller than one population of the optimiser, or
                guessing the first pose took all of it.
        """
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
            if budget < 1:
                raise InputError(
                    f"evaluations must be more than the {predictor.guess_evaluations} "
                    f"that the start took to guess the pose, got {task.evaluations}"
                )
            # Only for a single picture, because later frames cannot correct it. A track
            # recovers from the wrong mode with one swarm as well.
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
        """Return the filter whose state the earlier frames carry, or None."""
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
        """Return the searches from each mode of a frame, the best mode first."""
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
        """Return the latest frame again, without evaluations.

        Before the first frame it is the middle of the box.
        """
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
        """Return the problem of a frame: its pose in a space, within a budget."""
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
    """Return the frame of the best search, with the evaluations of all and the guess.

    If several modes were searched, they are its posterior.
    """
    poses, translations = best.decode(best.best[None])
    # rasterising the result again is not an evaluation
    with uncounted():
        areas = best.cost_and_areas(poses, translations)[1][:, 0]
    evaluations = guess_evaluations
    for problems in searches:
        for problem in problems:
            evaluations += problem.evaluations
    used, costs = best.trace
    # the trace of the best search, as if it had been the last
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
    """Return the posterior of a frame, from the results of searching its modes."""
    poses = []
    places = []
    costs = []
    for problems in searches:
        best = cheapest(problems)
        pose, place = best.decode(best.best[None])
        poses.append(pose)
        places.append(place)
        costs.append(best.best_cost)
    return posterior_of(np.concatenate(poses), np.concatenate(places), np.array(costs))
