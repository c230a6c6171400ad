"""Race-v1: searches share a budget; an action continues one, or starts a new one."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from posefit import Optimiser, Problem, Problems
from posefit.arrays import Array
from posefit.fitting.check import pair, whole
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import planned, settings_of
from posefit_envs.base import (
    Flags,
    Infos,
    SearchEnv,
    SearchVectorEnv,
    error_degrees,
    log_cost,
    log_improvement,
    row_of,
)
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows, Stage, first_scene
from posefit_envs.world import (
    ArgumentError,
    World,
    checked,
    first_problem,
)

OPTIMISER = "pso"
SEARCHES = 8
POPULATION_SIZE = 8
# smallest and largest budget of an episode
GENERATIONS = (100, 220)
SEARCH_FEATURES = 4
COMMON_FEATURES = 3
# weight of the latest generation in a slope
SMOOTHING = 0.2
# the slope that is observed as 1, in ln(1 + cost) per generation; a new search has it
MAX_SLOPE = 0.1
# the spreads that are observed as 0 and 1, in half-ranges
MIN_SPREAD = 1e-3
MAX_SPREAD = 1.0


class Races:
    """n races side by side, one row each: their searches and observed features."""

    def __init__(
        self,
        world: World,
        rows: int,
        *,
        optimiser: str = OPTIMISER,
        searches: int = SEARCHES,
        population_size: int = POPULATION_SIZE,
        generations: Sequence[int] = GENERATIONS,
        threads: int = 1,
    ) -> None:
        self.world = world
        self.searches = checked(whole, "searches", searches, 2)
        self.population_size = checked(whole, "population_size", population_size, 2)
        self._least, self._most = _bounds(generations)
        self._name = optimiser
        self._factory = checked(registry().optimiser, optimiser)
        sizes = {"population_size": self.population_size}
        names = [setting.name for setting in settings_of(self._factory)]
        # one more generation than the largest budget: the first population is free
        self._settings = planned(
            self._factory,
            sizes if "population_size" in names else {},
            self.population_size * (self._most + 1),
        )
        self.stage = Stage(world, rows, threads)
        self.problems = Problems(rows, world.dimensions)
        self._rngs = [np.random.default_rng(0)] * rows
        self._optimisers: list[dict[int, Optimiser]] = [{} for _ in range(rows)]
        self.budgets = np.zeros(rows, dtype=np.int64)  # generations
        self.left = np.zeros(rows, dtype=np.int64)
        particles = (rows, self.searches, self.population_size)
        # the best proposal of each particle, and its cost
        self.bests = np.zeros((*particles, world.dimensions))
        self.best_costs = np.full(particles, np.inf)
        self.costs = np.zeros((rows, self.searches))  # the best of each search
        self.slopes = np.zeros((rows, self.searches))
        self.spreads = np.zeros((rows, self.searches))
        self.used = np.zeros((rows, self.searches), dtype=np.int64)  # generations

    @property
    def spaces(self) -> tuple[Box, Box]:
        """The spaces of the actions and the observations of one race."""
        features = SEARCH_FEATURES * self.searches + COMMON_FEATURES
        return (
            Box(-1.0, 1.0, (self.searches + 1,), np.float32),
            Box(0.0, 1.0, (features,), np.float32),
        )

    def begin(self, row: int, number: int, seed: int) -> None:
        """Begin a race on an instance. `evaluate_first` evaluates its populations."""
        self.stage.set_scene(row, first_scene(self.world, number))
        self.problems.begin(row, partial(first_problem, self.world, number))
        rng = np.random.default_rng(seed)
        self._rngs[row] = rng
        self.budgets[row] = rng.integers(self._least, self._most, endpoint=True)
        self.left[row] = self.budgets[row]
        for search in range(self.searches):
            self._begin_search(row, search)

    def _begin_search(self, row: int, search: int) -> None:
        """Replace one of a race's searches by a new one."""
        space = self.stage.space(row)
        # a separate generator, so that the draws of one search do not affect the others
        rng = np.random.default_rng(int(self._rngs[row].integers(2**63)))
        self._optimisers[row][search] = checked(
            lambda: self._factory(space, rng, **self._settings)
        )
        self.best_costs[row, search] = np.inf
        self.costs[row, search] = np.inf
        self.slopes[row, search] = MAX_SLOPE
        self.used[row, search] = 0

    def evaluate_first(self, rows: Rows) -> None:
        """Evaluate the first population of every search of some races."""
        for search in range(self.searches):
            self._generation(rows, np.full(len(rows), search))

    def advance(self, rows: Rows, actions: Array) -> Array:
        """Run the generations that actions (m, searches + 1) choose in some races.

        Return the rewards (m,).
        """
        before = self.problems.best_costs[rows]
        chosen = actions.argmax(axis=1)
        # the last choice is a new search, which replaces the worst one
        for k in np.flatnonzero(chosen == self.searches).tolist():
            row = int(rows[k])
            chosen[k] = self.costs[row].argmax()
            self._begin_search(row, int(chosen[k]))
        self._generation(rows, chosen)
        self.left[rows] -= 1
        return log_improvement(before, self.problems.best_costs[rows])

    def _generation(self, rows: Rows, chosen: NDArray[np.int64]) -> None:
        """Run one generation of the chosen search (m,) of some races (m,)."""
        pairs = list(zip(rows.tolist(), chosen.tolist(), strict=True))
        count = self.population_size
        # the stage takes a population for every race; those left out remain 0
        proposals = np.zeros((len(self.problems), count, self.world.dimensions))
        for row, search in pairs:
            population = self._optimisers[row][search].ask()
            if population.shape != proposals[row].shape:
                raise ArgumentError(
                    f"optimiser must propose {count} poses at a time, "
                    f"got {len(population)} of {quoted(self._name)}"
                )
            proposals[row] = population
        costs = self.stage.costs(proposals, rows)
        self.problems.count(rows, proposals[rows], costs[rows])
        # copies, because an optimiser may keep or change what it is told
        for row, search in pairs:
            costs_of_search = costs[row].copy()
            self._optimisers[row][search].tell(proposals[row].copy(), costs_of_search)
        self._remember((rows, chosen), proposals[rows], costs[rows])

    def _remember(
        self,
        at: tuple[Rows, NDArray[np.int64]],
        proposals: Array,
        costs: Array,
    ) -> None:
        """Update the features of searches from proposals (m, k, d) and costs (m, k)."""
        before = self.costs[at]
        searched = self.used[at] > 0
        bests = self.bests[at]
        best_costs = self.best_costs[at]
        better = costs < best_costs
        bests[better] = proposals[better]
        best_costs[better] = costs[better]
        after = best_costs.min(axis=1)
        # a search without an earlier cost has no fall yet, and keeps the first slope
        falls = log_improvement(np.where(searched, before, after), after)
        slopes = self.slopes[at] + SMOOTHING * (falls - self.slopes[at])
        self.bests[at] = bests
        self.best_costs[at] = best_costs
        self.costs[at] = after
        self.slopes[at] = np.where(searched, slopes, MAX_SLOPE)
        self.spreads[at] = bests.std(axis=1).mean(axis=1)
        self.used[at] += 1

    def observations(self) -> NDArray[np.float32]:
        """Return the features (n, 4 searches + 3) of the races."""
        budgets = self.budgets[:, None]
        # a search shrinks by factors, so the scale of spreads is logarithmic
        widths = np.maximum(self.spreads / MIN_SPREAD, 1.0)
        features = [
            log_cost(self.costs),
            self.slopes / MAX_SLOPE,
            np.log(widths) / np.log(MAX_SPREAD / MIN_SPREAD),
            self.used / budgets,
            log_cost(self.problems.best_costs)[:, None],
            self.left[:, None] / budgets,
            budgets / self._most,
        ]
        shown = np.minimum(np.concatenate(features, axis=1), 1.0)
        return np.asarray(shown, dtype=np.float32)

    def infos(self, numbers: NDArray[np.int64]) -> Infos:
        """Return the infos (n, ...) of the races on these instances, by name."""
        problems = self.problems
        infos = {
            "best_cost": problems.best_costs.copy(),
            "proposal": problems.best.copy(),
            "evaluations": problems.evaluations.copy(),
            "remaining_steps": self.left.copy(),
            "instance": numbers.copy(),
        }
        if self.world.shows_truth:
            # alignment would move the body without changing the pose: align no row
            no_rows = self.stage.all_rows[:0]
            poses, _ = self.stage.decode(problems.best[:, None], no_rows)
            poses = poses[:, 0]
            infos["error_degrees"] = error_degrees(self.stage.truths, poses)
        return infos

    def picture(self, row: int) -> Picture:
        """Return the picture of the best proposal of a race."""
        frame = self.problems[row]
        poses, places = frame.decode(self.problems.best[row][None])
        best = self.problems.best_costs[row]
        label = (
            f"best {best:.1f}, {self.left[row]} of {self.budgets[row]} generations left"
        )
        return render_frame(frame.cost, (poses[0], places[0]), label)


class RaceEnv(SearchEnv):
    """
    ## Description
    Several searches look for the pose in one silhouette. Each has a separate optimiser
    of the same kind, and a separate first population. They share a budget of
    generations that is too small for all of them, and many get stuck. Each step is one
    generation of one search, which the action chooses. The action may also replace the
    worst search by a new one.

    ## Action Space
    `Box(-1, 1, (searches + 1,), float32)`: the largest number is the choice; of equal
    ones, the first.

    | Num | Meaning |
    |---|---|
    | 0 to searches - 1 | this search runs its next generation |
    | searches | the search with the highest best cost is replaced by a new one |

    The first generation of a new search is its first population. Actions outside the
    box are clipped, with one warning.

    ## Observation Space
    `Box(0, 1, (4 searches + 3,), float32)`, with k searches:

    | Num | Meaning |
    |---|---|
    | 0 to k - 1 | best cost of each search: ln(1 + cost) / ln 101 |
    | k to 2 k - 1 | its slope: moving mean of ln(1 + cost)'s fall; 0.1 or more is 1 |
    | 2 k to 3 k - 1 | spread of its particles' bests: 0.001 to 1 half-ranges, log |
    | 3 k to 4 k - 1 | its generations, including the first, / the budget |
    | 4 k | best cost of all searches, including replaced ones: ln(1 + cost) / ln 101 |
    | 4 k + 1 | generations left / the budget |
    | 4 k + 2 | the budget / the largest budget |

    A slope is 1 at first. A generation's weight is 0.2, that of the earlier ones 0.8.
    Particle j of a search is proposal j of every population of its optimiser.

    ## Rewards
    ln((1 + best cost before) / (1 + best cost after)).

    ## Starting State
    The first population of each search, drawn uniformly and evaluated; the budget does
    not include it. The instance is chosen as in `FitImage-v1`. The budget is drawn from
    `generations`.

    ## Episode End
    Terminates when the budget is used up. Only a time limit of Gymnasium truncates.

    ## Information
    A step and a reset give `best_cost`, the `proposal` (d,) with that cost,
    `evaluations`, `remaining_steps`, and `instance`. In training they also give
    `error_degrees`, the best pose's error against the truth, unless `errors=False`; in
    the test only with `evaluate=True`.

    ## Arguments
    As in `FitImage-v1`, without `max_evaluations`, and with:

    - `optimiser="pso"`: any optimiser of posefit or a plugin that takes a
      `population_size`.
    - `searches=8`: 2 or more.
    - `population_size=8`: of each search, 2 or more.
    - `generations=(100, 220)`: the smallest and the largest budget.

    ## Searches
    An optimiser has its default settings. If its schedule follows from a budget, it is
    planned for the largest budget.

    ## Version History
    - v1: people are held out by default.
    - v0: `held_out_people=False`.
    """

    def __init__(
        self,
        *,
        optimiser: str = OPTIMISER,
        searches: int = SEARCHES,
        population_size: int = POPULATION_SIZE,
        generations: Sequence[int] = GENERATIONS,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        super().__init__(render_mode, arguments)
        self.races = Races(
            self.world,
            1,
            optimiser=optimiser,
            searches=searches,
            population_size=population_size,
            generations=generations,
        )
        self.action_space, self.observation_space = self.races.spaces

    def begin(self, number: int) -> tuple[Any, Infos]:
        """Begin an episode with an instance: return its first observation and infos."""
        # only one draw from the environment's generator, however many a race needs
        self.races.begin(0, number, int(self.np_random.integers(2**63)))
        self.races.evaluate_first(np.array([0]))
        return self.races.observations()[0], self._infos()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, Infos]:
        """Run one generation. Raises ResetNeeded if the episode has ended."""
        action = self.checked_action(action)[None]
        reward = self.races.advance(np.array([0]), action)[0]
        self.ended = bool(self.races.left[0] == 0)
        observation = self.races.observations()[0]
        return observation, float(reward), self.ended, False, self._infos()

    def _infos(self) -> Infos:
        return row_of(self.races.infos(np.array([self.number])), 0)

    @property
    def problem(self) -> Problem:
        """The episode's problem, independent of the race's searches.

        Raises gymnasium.error.ResetNeeded before the first reset.
        """
        self.check_reset()
        return self.races.problems[0]

    def picture(self) -> Picture:
        """Return the picture of the best proposal."""
        return self.races.picture(0)


class RaceVectorEnv(SearchVectorEnv):
    """A vector of `num_envs` RaceEnv environments.

    The populations of their chosen searches are evaluated in one call.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        optimiser: str = OPTIMISER,
        searches: int = SEARCHES,
        population_size: int = POPULATION_SIZE,
        generations: Sequence[int] = GENERATIONS,
        **arguments: Any,
    ) -> None:
        super().__init__(num_envs, **arguments)
        self.races = Races(
            self.world,
            num_envs,
            optimiser=optimiser,
            searches=searches,
            population_size=population_size,
            generations=generations,
            threads=self.threads,
        )
        self.set_spaces(*self.races.spaces)
        self._problems = self.races.problems

    def begin(self, rows: Rows) -> None:
        """Begin episodes in some environments, with the instances of `numbers`."""
        for i in rows.tolist():
            seed = int(self.generator(i).integers(2**63))
            self.races.begin(i, int(self.numbers[i]), seed)
        self.races.evaluate_first(rows)

    def observe(self, rows: Rows) -> NDArray[np.float32]:
        """Return the current observations of some environments."""
        return self.races.observations()[rows]

    def reset_infos(self) -> Infos:
        """Return the infos of a reset, by name."""
        return self.races.infos(self.numbers)

    def step(self, actions: Any) -> tuple[Any, Array, Flags, Flags, Infos]:
        """Run one generation in each environment; ended episodes reset."""
        actions, stepping = self.begin_step(actions)
        rows = np.flatnonzero(stepping)
        rewards = np.zeros(self.num_envs)
        rewards[rows] = self.races.advance(rows, actions[rows])
        terminated = self.races.left == 0
        infos = self.races.infos(self.numbers)
        observations = self.races.observations()
        return self.end_step(stepping, observations, rewards, terminated, infos)

    def picture(self, i: int) -> Picture:
        """Return the picture of the best proposal in environment i."""
        return self.races.picture(i)


def _bounds(generations: Any) -> tuple[int, int]:
    """Return the smallest and the largest budget.

    Raises ArgumentError unless they are two whole numbers in this order.
    """
    ends = checked(
        pair, "generations", generations, "two whole numbers such as (100, 220)"
    )
    least = checked(whole, "generations", ends[0], 1)
    most = checked(whole, "generations", ends[1], 1)
    if least > most:
        raise ArgumentError(
            "generations must be the smallest and the largest budget, "
            f"got {least} and {most}"
        )
    return least, most
