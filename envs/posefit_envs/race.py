"""Race-v0: searches of one silhouette share a budget; an action says which of them goes on, or begins another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import draw_population, repair
from posefit.fitting.check import whole
from posefit.reading import quoted
from posefit_envs.base import Flags, Infos, Outcome, SearchEnv, SearchVectorEnv, log_cost, log_improvement
from posefit_envs.instance import ArgumentError, Episode, World, checked, first_episode
from posefit_envs.kernels import Swarms, move_swarms, teach_swarms
from posefit_envs.population import MAX_SPREAD, MIN_SPREAD, State
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows
from posefit_swarm.pso import constriction

SEARCHES, POPULATION_SIZE = 8, 8
GENERATIONS = (100, 220)  # the least and the most that an episode has
PHI = 4.1  # Clerc and Kennedy's usual sum of the two accelerations
OMEGA = constriction(PHI)  # as PSO's
ACCELERATION = OMEGA * PHI / 2.0
MAX_SPEED = 0.5  # of particles, in half-ranges a generation
SEARCH_FEATURES, COMMON_FEATURES = 4, 3
SMOOTHING = 0.2  # weight of the last generation in a slope
MAX_SLOPE = 0.1  # in ln(1 + cost) a generation, that shows as 1, and that a search begins with


class RaceVectorEnv(SearchVectorEnv):
    """`num_envs` environments as RaceEnv; moves and costs of all their searches are compiled calls."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        searches: int = SEARCHES,
        population_size: int = POPULATION_SIZE,
        generations: Sequence[int] = GENERATIONS,
        **arguments: Any,
    ) -> None:
        k = int(checked(whole, "searches", searches, 2))
        self.population_size = int(checked(whole, "population_size", population_size, 2))
        self._least, self._most = _bounds(generations)

        def race_spaces(_: World) -> tuple[spaces.Box, spaces.Box]:
            features = SEARCH_FEATURES * k + COMMON_FEATURES
            return spaces.Box(-1.0, 1.0, (k + 1,), np.float32), spaces.Box(0.0, 1.0, (features,), np.float32)

        super().__init__(num_envs, race_spaces, **arguments)
        points = num_envs, k, self.population_size, self.world.dimensions
        self._swarms = Swarms(
            np.zeros(points),
            np.zeros(points),
            np.zeros(points),
            np.full(points[:3], np.inf),
            np.zeros(points[:2], dtype=np.int64),
            np.full(points[:2], np.inf),
            np.zeros(points[:2]),
        )
        self._slopes, self._used = np.zeros(points[:2]), np.zeros(points[:2], dtype=np.int64)
        self._budgets, self._left, self._evaluations = np.zeros((3, num_envs), dtype=np.int64)
        self._best, self._leaders = np.full(num_envs, np.inf), np.zeros((num_envs, points[3]))
        self._rngs = [np.random.default_rng(0)] * num_envs
        self._draws = np.zeros((num_envs, 2, *points[2:]))
        self._spare = np.zeros(points)  # first populations of searches that may begin, the last ones first
        self._spares = np.zeros(num_envs, dtype=np.int64)

    def _begin_search(self, i: int, number: int) -> None:
        self._enter(i, first_episode(self.world, number, self.population_size * (self._most + self._spare.shape[1])))
        self._rngs[i] = rng = np.random.default_rng(int(self._generator(i).integers(2**63)))
        self._budgets[i] = self._left[i] = rng.integers(self._least, self._most, endpoint=True)
        self._best[i], self._evaluations[i], self._spares[i] = np.inf, 0, 0
        self._clear(i)
        self._swarms.positions[i] = self._first_populations(i)

    def _first_populations(self, i: int) -> Array:
        """Return first populations (searches, particles, d) of an environment, drawn uniformly."""
        shape = self._spare.shape[1:]
        return draw_population(self._episodes[i].problem.space, self._rngs[i], shape[0] * shape[1]).reshape(shape)

    def _clear(self, i: int, search: int | slice = slice(None)) -> None:
        swarms = self._swarms
        swarms.velocities[i, search], swarms.best_costs[i, search], swarms.costs[i, search] = 0.0, np.inf, np.inf
        self._slopes[i, search], self._used[i, search] = MAX_SLOPE, 0

    def _opened(self, begun: Flags) -> tuple[State, Infos]:
        self._evaluate_first(np.flatnonzero(begun))
        return self._states(), self._infos()

    def _evaluate_first(self, rows: Rows) -> None:
        """Evaluate the first population of every search of some environments."""
        first = self._swarms.positions.copy()
        n, k, size, d = first.shape
        costs = self._stage.costs(first.reshape(n, k * size, d), rows).reshape(n, k, size)
        for search in range(k):
            self._teach(rows, np.full(n, search), first[:, search].copy(), costs[:, search].copy())

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        if len(rows) < self.num_envs:
            self._evaluate_first(np.flatnonzero(~stepping))
        before = self._best.copy()
        chosen = actions.argmax(axis=1)
        another = chosen == actions.shape[1] - 1
        chosen[another] = self._swarms.costs[another].argmax(axis=1)
        proposals = self._moved(rows, chosen, stepping & another)
        self._teach(rows, chosen, proposals, self._stage.costs(proposals, rows))
        self._left[rows] -= 1
        infos = self._infos()
        rewards = log_improvement(before, self._best)
        return Outcome(self._states(), rewards, stepping & (self._left == 0), infos, infos)

    def _moved(self, rows: Rows, chosen: NDArray[np.int64], another: Flags) -> Array:
        """Return the next proposals (n, particles, d) of the chosen searches; where `another` is true they begin."""
        for i in rows.tolist():
            self._rngs[i].random(out=self._draws[i])
        swarms, space = self._swarms, self._episodes[0].problem.space  # whose box and prior are those of all
        proposals = np.zeros((self.num_envs, *self._spare.shape[2:]))
        move_swarms(rows, chosen, self._draws, OMEGA, ACCELERATION, MAX_SPEED, space.periodic, swarms, proposals)
        feasible = space.feasible(proposals.reshape(-1, space.dimensions)).reshape(proposals.shape[:2])
        feasible[another] = True
        at, particles = np.nonzero(~feasible[rows])
        at = rows[at]
        if len(at):
            own = at, chosen[at], particles
            proposals[at, particles] = repair(space, proposals[at, particles], swarms.bests[own])
            swarms.velocities[own] = 0.0
        for i in np.flatnonzero(another).tolist():
            self._clear(i, chosen[i])
            if not self._spares[i]:
                self._spare[i], self._spares[i] = self._first_populations(i), self._spare.shape[1]
            self._spares[i] -= 1
            proposals[i] = self._spare[i, self._spares[i]]
        return proposals

    def _teach(self, rows: Rows, chosen: NDArray[np.int64], proposals: Array, costs: Array) -> None:
        """Give the chosen searches of some environments their proposals (n, particles, d) and costs (n, particles)."""
        swarms, at = self._swarms, (rows, chosen[rows])
        before, begun = swarms.costs[at], self._used[at] > 0
        teach_swarms(rows, chosen, proposals, costs, swarms)
        after = swarms.costs[at]
        falls = log_improvement(np.where(begun, before, after), after)
        self._slopes[at] = np.where(begun, self._slopes[at] + SMOOTHING * (falls - self._slopes[at]), MAX_SLOPE)
        self._used[at] += 1
        self._evaluations[rows] += self.population_size
        better = rows[after < self._best[rows]]
        own = better, chosen[better]
        self._best[better], self._leaders[better] = swarms.costs[own], swarms.bests[*own, swarms.leaders[own]]

    def _states(self) -> State:
        swarms, budgets = self._swarms, self._budgets[:, None]
        spreads = np.log(np.maximum(swarms.spreads / MIN_SPREAD, 1.0)) / np.log(MAX_SPREAD / MIN_SPREAD)
        each = log_cost(swarms.costs), self._slopes / MAX_SLOPE, spreads, self._used / budgets
        common = log_cost(self._best)[:, None], self._left[:, None] / budgets, budgets / self._most
        return np.asarray(np.minimum(np.concatenate([*each, *common], axis=1), 1.0), dtype=np.float32)

    def _infos(self) -> Infos:
        poses = self._stage.poses(self._leaders)
        return self._progress(self._best, self._evaluations, poses, proposal=self._leaders.copy())

    def _render_row(self, i: int, episode: Episode) -> Picture:
        poses, places = episode.problem.decode(self._leaders[i : i + 1])
        label = f"best {self._best[i]:.1f}, {self._left[i]} of {self._budgets[i]} generations left"
        return render_frame(episode.problem, poses[0], places[0], label)


class RaceEnv(SearchEnv):
    """
    ## Description
    Several searches look for the pose in one silhouette, each a particle swarm of its own from a first population of
    its own. They share a budget of generations, which is too small for all of them, and many get stuck. Each step is
    one generation of one search, and the action chooses which; or another search begins in the place of the worst.

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

    A slope is 1 at first; a generation counts 0.2, and those before it 0.8.

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
    As in `FitImage-v0`, with `searches=8`, 2 or more, `population_size=8` of each, 2 or more, and
    `generations=(100, 220)`, the least and the largest budget, instead of `target_cost` and `max_evaluations`.

    ## Searches
    Particle swarms with Clerc and Kennedy's constriction, as the optimiser `pso`. Particles begin at rest, move at most
    0.5 half-ranges a generation, and stop at the border of the box; what the prior refuses goes back on the line to the
    particle's best.
    """

    vector = RaceVectorEnv


def _bounds(generations: Any) -> tuple[int, int]:
    """Return the least and the largest budget. Raises ArgumentError where they are not two numbers in this order."""
    several = isinstance(generations, Sequence) and not isinstance(generations, str) and len(generations) == 2
    if not several:
        raise ArgumentError(f"generations must be two whole numbers such as (100, 220), got {quoted(generations)}")
    least, most = (int(checked(whole, "generations", number, 1)) for number in generations)
    if least > most:
        raise ArgumentError(f"generations must be the least and the largest, got {least} and {most}")
    return least, most
