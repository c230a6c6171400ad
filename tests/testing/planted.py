"""Optimisers, priors, trackers and starts that each break one rule on purpose. The kit has to find every one of them."""

import os
import signal
import sys
import threading
import time
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from posefit import Body, Camera, Frame, SearchSpace, Task, areas, mismatch, project
from posefit.motion import built_in
from posefit.plugin import Array, Posterior, draw_population, sample_normal
from posefit_filters.annealed import Annealed
from posefit_priors.pca import PCA

Rng = np.random.Generator


class Planted:
    """A plugin, and what is wrong with it: which checks it breaks, or how it ends a process of its own."""

    breaks: ClassVar[tuple[str, ...]]
    ends: ClassVar[str]

    def __init_subclass__(cls, breaks: str = "", ends: str = "") -> None:
        cls.breaks = tuple(breaks.split())
        cls.ends = ends


class Sound(Planted):
    """Shrinks a cloud around the best point; nothing is wrong with it, and the others each spoil one thing."""

    def __init__(
        self,
        space: SearchSpace,
        rng: Rng,
        *,
        population_size: int = 40,
        shrink: float = 0.9,
    ) -> None:
        if population_size < 1:
            raise ValueError(
                f"population_size must be at least 1, got {population_size}"
            )
        self.space = space
        self.rng = rng
        self.shrink = shrink
        self.population = draw_population(space, rng, population_size)
        self.best = self.population[0].copy()
        self.cost = np.inf
        self.width = 0.5

    def ask(self) -> Array:
        return self.population.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        costs = np.where(np.isnan(costs), np.inf, costs)
        if costs.min() < self.cost:
            self.best, self.cost = proposals[costs.argmin()].copy(), float(costs.min())
        self.width *= self.shrink
        spread = np.full(self.space.dimensions, self.width)
        self.population = sample_normal(
            self.space, self.rng, np.tile(self.best, (len(self.population), 1)), spread
        )


class SwallowsSettings(Sound, breaks="construction unknown_setting"):
    def __init__(self, space: SearchSpace, rng: Rng, **settings: Any) -> None:
        super().__init__(space, rng)


class AsksOneRow(Sound, breaks="shape"):
    def ask(self) -> Array:
        return super().ask()[0]


class AsksFloat32(Sound, breaks="dtype"):
    def ask(self) -> Any:
        return super().ask().astype(np.float32)


class LeavesTheBox(Sound, breaks="box"):
    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        self.population = self.best + 0.6 * self.rng.standard_normal(
            self.population.shape
        )


class ForgetsFeasible(Sound, breaks="feasible"):
    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        self.population = np.clip(
            self.best + 0.3 * self.rng.standard_normal(self.population.shape), -1.0, 1.0
        )


class WaitsForFeasible(Sound, breaks="hardly_feasible"):
    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        while True:
            self.population = self.rng.uniform(-1.0, 1.0, self.population.shape)
            if self.space.feasible(self.population).all():
                return


class DividesByTheRange(Sound, breaks="costs"):
    def tell(self, proposals: Array, costs: Array) -> None:
        rank = (costs - costs.min()) / (costs.max() - costs.min())
        assert not np.isnan(rank).any(), "costs are all equal"
        super().tell(proposals, costs)


class AsksForMore(Sound, breaks="budget"):
    """Has a second population so large that most of a budget is left over."""

    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        self.population = np.tile(self.population[:1], (1000, 1))


class FailsLate(Sound, breaks="late"):
    """Has room for 25 populations."""

    count = 0

    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        self.count += 1
        np.zeros(25)[self.count]


class LeavesTheBoxLate(Sound, breaks="late"):
    count = 0

    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        self.count += 1
        if self.count > 20:
            self.population[0, 0] = 1.5


class KeepsOffTheSides(Sound, breaks="sides"):
    """Never proposes what is near a side of the box."""

    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        self.population = np.clip(self.population, -0.6, 0.6)


class DrawsInSecret(Sound, breaks="evaluations"):
    """Draws poses of its own in every tell, which no budget counts."""

    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        if isinstance(self.space, SearchSpace):
            poses, places = self.space.decode(proposals)
            project(
                Body.of(built_in.average_skeleton()),
                Camera.around(places[0], 0.0, 3.0),
                poses[0],
                places[0],
            )


class HasUntypedSettings(Sound, breaks="construction"):
    def __init__(self, space: SearchSpace, rng: Rng, *, shrink=0.9) -> None:  # type: ignore[no-untyped-def]
        super().__init__(space, rng, shrink=shrink)


class MixesRows(Sound, breaks="order"):
    """Hands the rows out in another order than it keeps them in."""

    def ask(self) -> Array:
        return self.population[::-1].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(self.population, costs)


class Maximises(Sound, breaks="sphere_problem real_problem"):
    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, -costs)


class KnowsItsRows(Sound):
    """Looks up what it is told among what it asked; it is right, as it gets exactly that population back."""

    def ask(self) -> Array:
        proposals = super().ask()
        self.rows = {row.tobytes() for row in proposals}
        return proposals

    def tell(self, proposals: Array, costs: Array) -> None:
        for row in proposals:
            if row.tobytes() not in self.rows:
                raise KeyError("a row that was never asked for")
        super().tell(proposals, costs)


class LeavesAThread(Sound):
    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, rng)
        threading.Thread(target=time.sleep, args=(120.0,), name="planted").start()


class Talks(Sound, breaks="silence"):
    """Prints whatever it does, by Python and past it."""

    def ask(self) -> Array:
        print("asked", flush=True)
        os.write(1, b"asked, too\n")
        return super().ask()


class WrongSignature(Sound, breaks="construction shape"):
    def __init__(self, space: SearchSpace) -> None:
        super().__init__(space, np.random.default_rng(0))


class ExitsInTell(Sound, breaks="dtype box"):
    def tell(self, proposals: Array, costs: Array) -> None:
        sys.exit(0)


class EndsTheProcess(Sound, ends="it must not end the program, got exit status 0"):
    def tell(self, proposals: Array, costs: Array) -> None:
        os._exit(0)


class Crashes(Sound, ends="it must not end the program, got SIGSEGV"):
    def tell(self, proposals: Array, costs: Array) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)


class NeverReturns(Sound, ends="it must end within 1 s, and did not"):
    """Swallows whatever would end it."""

    def tell(self, proposals: Array, costs: Array) -> None:
        while True:
            try:
                time.sleep(60.0)
            except BaseException:
                continue


class FillsTheMemory(
    Sound, ends="it must not fail, got MemoryError: Unable to allocate"
):
    def tell(self, proposals: Array, costs: Array) -> None:
        self.hoard = np.ones((10**11,))


class FewDimensionsOnly(Sound, breaks="dimensions"):
    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, rng)
        self.corners = np.zeros((9, 9))[
            : space.dimensions, : space.dimensions
        ] + np.eye(space.dimensions)


class UsesGlobalNumpy(Sound, breaks="global_randomness"):
    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        np.random.rand()  # noqa: NPY002


class UsesTheClock(Sound, breaks="seeds"):
    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, np.random.default_rng(time.perf_counter_ns()))


class IgnoresTheSeed(Sound, breaks="seeds"):
    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, np.random.default_rng(0))


class HashesNames(Sound, breaks="new_process"):
    """Depends on the order of a set of words, which every process shuffles again."""

    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        shuffled = abs(hash("posefit"))
        super().__init__(space, np.random.default_rng(shuffled))
        self.population = draw_population(
            space, np.random.default_rng([shuffled, int(rng.integers(9**9))]), 40
        )


class SortsInPlace(Sound, breaks="inputs"):
    def tell(self, proposals: Array, costs: Array) -> None:
        super().tell(proposals, costs)
        costs.sort()


class HoldsALock(Sound, breaks="copies"):
    """Cannot be copied."""

    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, rng)
        self.lock = threading.Lock()


class SharesItsGenerator(Sound, breaks="copies"):
    """Keeps its generator outside itself, so that copies draw from one."""

    generators: dict[int, np.random.Generator] = {}  # noqa: RUF012

    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, rng)
        self.key = id(rng)
        SharesItsGenerator.generators[self.key], self.rng = rng, rng

    def tell(self, proposals: Array, costs: Array) -> None:
        self.rng = SharesItsGenerator.generators[self.key]
        super().tell(proposals, costs)


class IgnoresTheStart(Sound, breaks="start"):
    def __init__(self, space: SearchSpace, rng: Rng) -> None:
        super().__init__(space, rng)
        drawn = rng.uniform(-1.0, 1.0, (2000, space.dimensions))
        allowed = drawn[space.feasible(drawn)][:40]
        self.population = allowed if len(allowed) == 40 else self.population


class Slow(Sound, breaks="speed"):
    def ask(self) -> Array:
        time.sleep(0.06 * len(self.population))
        return super().ask()


class HangsOnNonsense(Sound, breaks="nonsense_settings"):
    def __init__(
        self, space: SearchSpace, rng: Rng, *, population_size: int = 40, tries: int = 5
    ) -> None:
        super().__init__(space, rng, population_size=population_size)
        while tries != 0:
            tries -= 1
            if tries < -10:
                raise OverflowError("tries went below 0")


class ForgetsParticles(Annealed):
    """Starts every frame anew, though it is registered to carry."""

    def advance(self, space: Any) -> None:
        super().advance(space)
        self._particles = draw_population(space, self._rng, len(self._particles))


class Learned(Planted, PCA):
    """A prior with which nothing is wrong; each below spoils one thing."""


class ShiftsWithTheCompany(Learned, breaks="same_bits"):
    """Centres what it gets by its mean, so that a row depends on the others."""

    def inverse_transform(self, latents: Array) -> Array:
        return super().inverse_transform(latents) + 1e-9 * np.mean(latents)


class NarrowRange(Learned, breaks="training_in_range"):
    def fit(self, angles: Array, skeleton: Any = None) -> Any:
        super().fit(angles)
        self.low = 0.5 * self.low
        self.high = 0.5 * self.high
        return self


class RefusesAll(Learned, breaks="training_feasible"):
    def feasible(self, latents: Array) -> Any:
        return np.zeros(len(latents), dtype=bool)


class Reversed(Learned, breaks="ranges"):
    def fit(self, angles: Array, skeleton: Any = None) -> Any:
        super().fit(angles)
        self.low, self.high = self.high, self.low
        return self


class Unhurried(Learned):
    """Counts how often it learns, as that may take minutes; nothing is wrong with it."""

    fits = 0

    def fit(self, angles: Array, skeleton: Any = None) -> Any:
        Unhurried.fits += 1
        return super().fit(angles, skeleton)


class ReturnsNone(Learned, breaks="fit"):
    def fit(self, angles: Array, skeleton: Any = None) -> Any:
        super().fit(angles)


class MovesFixedAxes(Learned, breaks="fixed_axes"):
    """Adds 0.01 radians to all angles, also to those about axes that a joint has not."""

    def inverse_transform(self, latents: Array) -> Array:
        return super().inverse_transform(latents) + 0.01


class TakesNan(Learned, breaks="bad_input"):
    def fit(self, angles: Array, skeleton: Any = None) -> Any:
        return super().fit(np.nan_to_num(np.asarray(angles)))


class Holds(Planted):
    """A tracker that gives the first training pose in every frame; each below spoils one thing."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.pose = np.concatenate([np.zeros(3), task.training[0].poses[0, 3:]])

    def frame(self, observation: Any) -> Frame:
        where = observation.translation
        counts = areas(
            self.task.body,
            self.task.cameras[0],
            observation.silhouettes[0],
            self.pose[None],
            where[None],
        )
        return Frame(self.pose, where, float(mismatch(counts)[0]), counts, 1)

    def draw(self, observation: Any, poses: int) -> None:
        """Draw so many poses, for nothing."""
        many = np.tile(self.pose, (poses, 1))
        places = np.tile(observation.translation, (poses, 1))
        areas(
            self.task.body,
            self.task.cameras[0],
            observation.silhouettes[0],
            many,
            places,
        )

    def track(self, observations: Any, rng: Any) -> Any:
        for observation in observations:
            yield self.frame(observation)


class LosesThePerson(Holds, breaks="follows"):
    """Is some 300 mm off."""

    def frame(self, observation: Any) -> Frame:
        self.pose = self.pose.copy()
        self.pose[:2] = 2.0, 1.0
        return super().frame(observation)


class ReadsAhead(Holds, breaks="as_they_come"):
    def track(self, observations: Any, rng: Any) -> Any:
        yield from super().track(list(observations), rng)


class DropsFrames(Holds, breaks="one_frame_each"):
    def track(self, observations: Any, rng: Any) -> Any:
        yield from list(super().track(observations, rng))[::2]


class SpendsAndSaysSo(Holds, breaks="audit"):
    """Spends 20,000 evaluations of any budget."""

    def frame(self, observation: Any) -> Frame:
        self.draw(observation, 20_000)
        return replace(super().frame(observation), evaluations=20_000)


class SpendsInSecret(Holds, breaks="audit"):
    """Says 100 evaluations and spends 20,000."""

    def frame(self, observation: Any) -> Frame:
        self.draw(observation, 20_000)
        return replace(super().frame(observation), evaluations=100)


class ChangesTheMask(Holds, breaks="one_frame_each"):
    """Makes the mask what it has drawn."""

    def frame(self, observation: Any) -> Frame:
        observation.silhouettes[0].mask[:] = True
        return super().frame(observation)


class GivesFramesTwice(Holds, breaks="one_frame_each"):
    def track(self, observations: Any, rng: Any) -> Any:
        for frame in super().track(observations, rng):
            yield frame
            yield frame


class ExitsInTrack(Holds, breaks="one_frame_each"):
    def frame(self, observation: Any) -> Frame:
        sys.exit(0)


class YieldsADict(Holds, breaks="one_frame_each"):
    def frame(self, observation: Any) -> Any:
        return vars(super().frame(observation))


class MovesFixedAxesOfAPose(Holds, breaks="one_frame_each"):
    def frame(self, observation: Any) -> Frame:
        return replace(super().frame(observation), pose=self.pose + 0.01)


class Remembers(Holds, breaks="used_twice"):
    count = 0

    def track(self, observations: Any, rng: Any) -> Any:
        self.count += 1
        self.pose = self.pose.copy()
        self.pose[0] += 0.01 * self.count
        yield from super().track(observations, rng)


class Guesses(Planted):
    """A start that guesses the first training pose, which faces right; each below spoils one thing."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.pose = np.concatenate([np.zeros(3), task.training[0].poses[0, 3:]])

    def posterior(self, observation: Any) -> Any:
        return Posterior(self.pose[None], np.zeros((1, 3)), np.ones(1))


class GivesAPose(Guesses, breaks="posterior"):
    def posterior(self, observation: Any) -> Any:
        return self.pose


class NeedsTheWholePerson(Guesses, breaks="several_views"):
    def posterior(self, observation: Any) -> Any:
        if not np.isfinite(observation.silhouettes[0].extent).all():
            raise IndexError("no border")
        return super().posterior(observation)


class TurnsAfterEach(Guesses, breaks="same_again"):
    def posterior(self, observation: Any) -> Any:
        self.pose = self.pose + 0.01
        return super().posterior(observation)


class DrawsGlobally(Guesses, breaks="global_randomness"):
    def posterior(self, observation: Any) -> Any:
        np.random.random()  # noqa: NPY002
        return super().posterior(observation)


class FacesTheSide(Guesses, breaks="gain"):
    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.pose[0] += 0.5 * np.pi


RIGHT: tuple[type, ...] = (Sound, KnowsItsRows)
OPTIMISERS, PRIORS, TRACKERS, STARTS = (
    [kind for kind in base.__subclasses__() if kind.breaks]
    for base in (Sound, Learned, Holds, Guesses)
)
# what only a process of its own survives
APART = [kind for kind in Sound.__subclasses__() if kind.ends]
