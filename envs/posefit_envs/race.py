"""Race-v0: searches of one silhouette share a budget; an action says which of them goes on, or begins another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from posefit import Optimiser
from posefit.arrays import Array
from posefit.fitting.check import pair, whole
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import planned, settings_of
from posefit_envs.base import (
    Flags,
    Infos,
    Outcome,
    SearchEnv,
    SearchVectorEnv,
    log_cost,
    log_improvement,
)
from posefit_envs.instance import ArgumentError, Episode, World, checked, first_episode
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows

OPTIMISER = "pso"
SEARCHES = 8
POPULATION_SIZE = 8
GENERATIONS = (100, 220)  # the least and the most that an episode has
SEARCH_FEATURES = 4
COMMON_FEATURES = 3
SMOOTHING = 0.2  # weight of the last generation in a slope
# in ln(1 + cost) a generation, that shows as 1, and that a search begins with
MAX_SLOPE = 0.1
# in half-ranges, that show as 0 and 1
MIN_SPREAD = 1e-3
MAX_SPREAD = 1.0


class RaceVectorEnv(SearchVectorEnv):
    """`num_envs` environments as RaceEnv; the populations of their chosen searches are evaluated in one call."""

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
        k = int(checked(whole, "searches", searches, 2))
        self.population_size = int(
            checked(whole, "population_size", population_size, 2)
        )
        self._least, self._most = _bounds(generations)
        self._optimiser, self._factory = (
            optimiser,
            checked(registry().optimiser, optimiser),
        )
        size = {"population_size": self.population_size}
        sized = any(setting.name in size for setting in settings_of(self._factory))
        self._settings = planned(
            self._factory,
            size if sized else {},
            self.population_size * (self._most + 1),
        )

        def race_spaces(_: World) -> tuple[spaces.Box, spaces.Box]:
            features = SEARCH_FEATURES * k + COMMON_FEATURES
            return spaces.Box(-1.0, 1.0, (k + 1,), np.float32), spaces.Box(
                0.0, 1.0, (features,), np.float32
            )

        super().__init__(num_envs, race_spaces, **arguments)
        n = num_envs
        m = self.population_size
        d = self.world.dimensions
        self._rngs = [np.random.default_rng(0)] * n
        self._budgets, self._left, self._evaluations = np.zeros((3, n), dtype=np.int64)
        # of all searches, those that ended too
        self._best, self._leaders = np.full(n, np.inf), np.zeros((n, d))
        self._searches: list[dict[int, Optimiser]] = [{} for _ in range(n)]
        # of each particle
        self._bests, self._best_costs = (
            np.zeros((n, k, m, d)),
            np.full((n, k, m), np.inf),
        )
        self._costs, self._slopes, self._spreads = np.zeros((3, n, k))  # of each search
        self._used = np.zeros((n, k), dtype=np.int64)

    def _begin_search(self, i: int, number: int) -> None:
        self._enter(
            i,
            first_episode(
                self.world,
                number,
                self.population_size * (self._most + self._used.shape[1]),
            ),
        )
        self._rngs[i] = rng = np.random.default_rng(
            int(self._generator(i).integers(2**63))
        )
        self._budgets[i] = self._left[i] = rng.integers(
            self._least, self._most, endpoint=True
        )
        self._best[i], self._evaluations[i] = np.inf, 0
        for search in range(self._used.shape[1]):
            self._begin_another(i, search)

    def _begin_another(self, i: int, search: int) -> None:
        """Begin another search in the place of one of an environment's."""
        space = self._episode(i).problem.space
        rng = np.random.default_rng(int(self._rngs[i].integers(2**63)))
        self._searches[i][search] = checked(
            lambda: self._factory(space, rng, **self._settings)
        )
        self._best_costs[i, search] = self._costs[i, search] = np.inf
        self._slopes[i, search], self._used[i, search] = MAX_SLOPE, 0

    def _opened(self, started: Flags) -> tuple[NDArray[np.float32], Infos]:
        self._evaluate_first(np.flatnonzero(started))
        return self._states(), self._infos()

    def _evaluate_first(self, rows: Rows) -> None:
        """Evaluate the first population of every search of some environments."""
        for search in range(self._used.shape[1]):
            self._advance_searches(rows, np.full(len(rows), search))

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        if len(rows) < self.num_envs:
            self._evaluate_first(np.flatnonzero(~stepping))
        before = self._best.copy()
        searches = self._used.shape[1]
        chosen = actions.argmax(axis=1)
        for i in np.flatnonzero(stepping & (chosen == searches)).tolist():
            chosen[i] = self._costs[i].argmax()
            self._begin_another(i, int(chosen[i]))
        self._advance_searches(rows, chosen[rows])
        self._left[rows] -= 1
        infos = self._infos()
        rewards = log_improvement(before, self._best)
        return Outcome(
            self._states(), rewards, stepping & (self._left == 0), infos, infos
        )

    def _advance_searches(self, rows: Rows, chosen: NDArray[np.int64]) -> None:
        """Make one generation of the chosen search (k,) of some environments (k,)."""
        proposals = np.zeros(
            (self.num_envs, self.population_size, self.world.dimensions)
        )
        searches = [
            (i, self._searches[i][search])
            for i, search in zip(rows.tolist(), chosen.tolist(), strict=True)
        ]
        for i, search in searches:
            asked = search.ask()
            if asked.shape != proposals[i].shape:
                raise ArgumentError(
                    f"optimiser must propose {self.population_size} poses at a time, "
                    f"got {len(asked)} of {quoted(self._optimiser)}"
                )
            proposals[i] = asked
        costs = self._stage.costs(proposals, rows)
        for i, search in searches:
            search.tell(proposals[i].copy(), costs[i].copy())
        self._evaluations[rows] += self.population_size
        self._remember(rows, chosen, proposals[rows], costs[rows])

    def _remember(
        self, rows: Rows, chosen: NDArray[np.int64], proposals: Array, costs: Array
    ) -> None:
        """Update what is observed of chosen searches (k,) by their proposals (k, m, d) and costs (k, m)."""
        at = (rows, chosen)
        each = np.arange(len(rows))
        before = self._costs[at]
        searched = self._used[at] > 0
        bests = self._bests[at]
        best_costs = self._best_costs[at]
        better = costs < best_costs
        bests[better], best_costs[better] = proposals[better], costs[better]
        after = best_costs.min(axis=1)
        leaders = bests[each, best_costs.argmin(axis=1)]
        falls = log_improvement(np.where(searched, before, after), after)
        slopes = self._slopes[at] + SMOOTHING * (falls - self._slopes[at])
        self._bests[at], self._best_costs[at], self._costs[at] = (
            bests,
            best_costs,
            after,
        )
        self._slopes[at] = np.where(searched, slopes, MAX_SLOPE)
        self._spreads[at] = bests.std(axis=1).mean(axis=1)
        self._used[at] += 1
        better = after < self._best[rows]
        self._best[rows[better]], self._leaders[rows[better]] = (
            after[better],
            leaders[better],
        )

    def _states(self) -> NDArray[np.float32]:
        budgets = self._budgets[:, None]
        spreads = np.log(np.maximum(self._spreads / MIN_SPREAD, 1.0)) / np.log(
            MAX_SPREAD / MIN_SPREAD
        )
        each = (
            log_cost(self._costs),
            self._slopes / MAX_SLOPE,
            spreads,
            self._used / budgets,
        )
        common = (
            log_cost(self._best)[:, None],
            self._left[:, None] / budgets,
            budgets / self._most,
        )
        return np.asarray(
            np.minimum(np.concatenate([*each, *common], axis=1), 1.0), dtype=np.float32
        )

    def _infos(self) -> Infos:
        poses = self._stage.poses(self._leaders)
        return self._progress(
            self._best, self._evaluations, poses, proposal=self._leaders.copy()
        )

    def _render_row(self, i: int, episode: Episode) -> Picture:
        poses, places = episode.problem.decode(self._leaders[i : i + 1])
        label = f"best {self._best[i]:.1f}, {self._left[i]} of {self._budgets[i]} generations left"
        return render_frame(episode.problem, poses[0], places[0], label)


class RaceEnv(SearchEnv):
    """
    ## Description
    Several searches look for the pose in one silhouette, each with an optimiser of its own, of the same kind, and a
    first population of its own. They share a budget of generations, which is too small for all of them, and many get
    stuck. Each step is one generation of one search, and the action chooses which; or another search begins in the
    place of the worst.

    ## Action Space
    `Box(-1, 1, (searches + 1,), float32)`: the largest number is the choice, the first of several that are equal.

    | Num | Meaning |
    |---|---|
    | 0 to searches - 1 | this search has its next generation |
    | searches | the search whose best cost is the highest ends, and another begins in its place |

    The generation of a search that begins is its first population. Actions outside are clipped, with one warning.

    ## Observation Space
    `Box(0, 1, (4 searches + 3,), float32)`, with k searches:

    | Num | Meaning |
    |---|---|
    | 0 to k - 1 | best cost of each search: ln(1 + cost) / ln 101 |
    | k to 2 k - 1 | its slope: a moving average of the fall of ln(1 + cost) a generation, of which 0.1 or more is 1 |
    | 2 k to 3 k - 1 | spread of its particles' bests, 0.001 to 1 half-ranges, by its logarithm |
    | 3 k to 4 k - 1 | its generations, the first too, / the budget |
    | 4 k | best cost of all, those that ended too: ln(1 + cost) / ln 101 |
    | 4 k + 1 | generations left / the budget |
    | 4 k + 2 | the budget / the largest budget |

    A slope is 1 at first; a generation counts 0.2, and those before it 0.8. Particle j of a search is proposal j of
    every population of its optimiser.

    ## Rewards
    ln((1 + best cost before) / (1 + best cost after)).

    ## Starting State
    The first population of each search, drawn uniformly and evaluated, which the budget does not count; the instance as
    in `FitImage-v0`. The budget is drawn from `generations`.

    ## Episode End
    Terminates when the budget is used. It is never truncated.

    ## Information
    `best_cost`, `proposal` (d,) that costs it, `evaluations`, `instance`, and unless `errors=False` `error_degrees`, of
    the best pose against the truth; a reset too.

    ## Arguments
    As in `FitImage-v0`, with `optimiser="pso"`, any optimiser of posefit or a plugin that takes a `population_size`,
    `searches=8`, 2 or more, `population_size=8` of each, 2 or more, and `generations=(100, 220)`, the least and the
    largest budget, instead of `max_evaluations`.

    ## Searches
    An optimiser has its default settings, and where its schedule follows from a budget, that of the largest.

    ## Version History
    - v0: not released yet; until then a version changes without a number.
    """

    vector = RaceVectorEnv


def _bounds(generations: Any) -> tuple[int, int]:
    """Return the least and the largest budget. Raises ArgumentError where they are not two numbers in this order."""
    ends = checked(
        pair, "generations", generations, "two whole numbers such as (100, 220)"
    )
    least, most = (checked(whole, "generations", number, 1) for number in ends)
    if least > most:
        raise ArgumentError(
            f"generations must be the least and the largest, got {least} and {most}"
        )
    return least, most
