"""A tracker that searches every frame, and tells what else the frame may show."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Self, cast

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.optimiser import Filter, Optimiser
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Frame, Observation, SynthesisTracker
from posefit.searching.doubt import lost_at
from posefit.searching.modes import KEPT, MakeOptimiser, further, gathered, told
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.searches import Searched, boltzmann_weights
from posefit.uncertainty.smc import systematic_rows


@dataclass(frozen=True, eq=False)
class WeighingTracker:
    """Follows as the tracker does that it is given, and adds a posterior to every frame in which somebody is seen.

    The track is the same as without. Beside the tracker's own search come others, `prediction.modes` in all, that look
    anywhere in the same space; they and the weighing have `prediction.modes_share` of its evaluations. Where `modes` is
    1 and the optimiser a filter, its last particles are weighed as they are. All evaluations are told, those of a
    frame that are beyond the budget too. Each frame says how likely it is lost.
    """

    tracker: SynthesisTracker

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation."""
        record = _Record(self.tracker.make)
        following = replace(self.tracker, make=record.begin)
        for frame in following.track(record.noted(observations), rng):
            assert record.observation is not None
            yield self._with_posterior(frame, record, rng) if record.observation.usable else frame

    def _with_posterior(self, frame: Frame, record: "_Record", rng: np.random.Generator) -> Frame:
        began, begun = time.perf_counter(), time.process_time()
        posterior, more = self._posterior(record, rng)
        seconds = frame.seconds + time.perf_counter() - began
        cpu_seconds = None if frame.cpu_seconds is None else frame.cpu_seconds + time.process_time() - begun
        return replace(
            frame,
            posterior=posterior,
            lost=float(lost_at(np.array(frame.cost))),
            evaluations=frame.evaluations + more,
            seconds=seconds,
            cpu_seconds=cpu_seconds,
        )

    def _posterior(self, record: "_Record", rng: np.random.Generator) -> tuple[Posterior, int]:
        """Return what else a frame may show, and how many evaluations it took."""
        how, evaluations = self.tracker.prediction, self.tracker.task.evaluations
        assert record.observation is not None
        problem = self.tracker.problem(cast(SearchSpace, record.space), record.observation)
        if how.modes == 1 and self.tracker.next_frame == "carry":
            particles, costs = record.found[-1]
            weights = boltzmann_weights(costs, how.posterior_temperature)
            return told(problem, *_few(particles, weights)), 0
        own = beside(rng)  # the track itself is what it is without
        first, more = gathered(record.found), round(how.modes_share * evaluations)
        return further(problem, self.tracker.make, first, more, own, how.modes - 1, how.posterior_temperature)


def _few(particles: Array, weights: Array) -> tuple[Array, Array]:
    """Return weighted particles as they are, or where they are many, some of equal weight."""
    if len(particles) <= KEPT:
        return particles, weights
    return particles[systematic_rows(weights, 0.5, KEPT)], np.full(KEPT, 1.0 / KEPT)


def beside(rng: np.random.Generator) -> np.random.Generator:
    """Return a generator that is seeded by what another one would draw next, which stays as it is."""
    bits = type(rng.bit_generator)(0)
    bits.state = rng.bit_generator.state
    return np.random.default_rng(np.random.Generator(bits).integers(0, 2**63, 4))


class _Record:
    """An optimiser, and what it was told: the space of its latest frame, and all that was evaluated there."""

    def __init__(self, make: MakeOptimiser) -> None:
        self._make = make
        self.observation: Observation | None = None

    def noted(self, observations: Iterable[Observation]) -> Iterator[Observation]:
        """Yield the observations, and keep the latest."""
        for observation in observations:
            self.observation = observation
            yield observation

    def begin(self, space: Space, rng: np.random.Generator) -> Self:
        """Build the optimiser of a search, and stand for it."""
        self._open(space)
        self._optimiser: Optimiser = self._make(space, rng)
        return self

    def advance(self, space: Space) -> None:
        """Pass the next frame's space on."""
        self._open(space)
        cast(Filter, self._optimiser).advance(space)

    def ask(self) -> Array:
        """Return the optimiser's next population."""
        return self._optimiser.ask()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Keep the costs, and pass them on."""
        self.found.append((np.array(proposals), np.array(costs)))
        self._optimiser.tell(proposals, costs)

    def _open(self, space: Space) -> None:
        self.space, self.found = space, list[Searched]()
