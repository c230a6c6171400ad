"""Configure-v0: dynamic algorithm configuration. The action steers a swarm that searches for the pose."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Unpack

import numpy as np
from gymnasium import error, spaces
from numpy.typing import NDArray

from posefit import PoseProblem
from posefit.arrays import Array
from posefit.fitting.box import sample_normal
from posefit.fitting.check import whole
from posefit_envs.base import SearchEnv
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import Episode
from posefit_envs.instance import Arguments, World, approved, select
from posefit_envs.scales import scaled
from posefit_swarm.swarm import SwarmState, speed_limits

POPULATION_SIZE, ITERATIONS = 40, 60
ACCELERATION, ALPHA, REDRAWS = 2.0, 0.15, 20  # as SAPSO's, but for fewer redraws
FIRST = 1.0  # the temperature at which a first population is settled, where nothing is refused
INERTIA = (0.0, 1.2)  # what the first number of an action stands for
LOG_TEMPERATURE = (-3.0, 1.5)  # the second: powers of ten
SPREAD = (0.0, 0.3)  # the third: standard deviations in half-ranges of the box

State = NDArray[np.float32]


class ConfigureEnv(SearchEnv["SteeredSwarm"]):
    """
    ## Description
    A swarm searches for the pose in one silhouette. Each step is one iteration of the swarm, and the action sets how it
    flies: for people who learn to control optimisers. With the action held at SAPSO's own schedule it is SAPSO.

    ## Action Space
    `Box(-1, 1, (3,), float32)`

    | Num | Meaning | -1 stands for | 1 stands for |
    |---|---|---|---|
    | 0 | inertia omega of SAPSO (1) | 0 | 1.2 |
    | 1 | temperature at which worse moves are accepted, by powers of ten | 0.001 | 32 |
    | 2 | standard deviation of a random kick to every particle, in half-ranges of the box | 0 | 0.3 |

    Actions outside are clipped, with one warning.

    ## Observation Space
    `Box(0, 1, (8,), float32)`

    | Num | Meaning |
    |---|---|
    | 0 | best cost so far / 100 |
    | 1 | lowest cost of the last iteration / 100 |
    | 2 | mean cost of the last iteration / 100 |
    | 3 | standard deviation of its costs / 100 |
    | 4 | spread of the particles' bests: mean standard deviation, in half-ranges |
    | 5 | mean speed of the particles / the largest allowed |
    | 6 | share of moves accepted in the last iteration |
    | 7 | budget left |

    ## Rewards
    By how much the best cost fell in this iteration, 0 to 100.

    ## Starting State
    A first population of `population_size`, drawn uniformly and evaluated; the instance as in `Fit-v0`.

    ## Episode End
    Terminates after `iterations` iterations. It is never truncated.

    ## Information
    `best_cost`, `evaluations`, `instance`, and unless `errors=False` `error_degrees`, of the best pose against the
    truth; a reset too.

    ## Arguments
    As in `Fit-v0`, with `population_size=40` and `iterations=60` instead of `target_cost` and `max_evaluations`.

    ## Version History
    - v0: first version. Before its release its instances changed: number n is now the motion, speed, phase and view of
      a sweep's instance n, and 0 the motion as it is. Results from before cannot be compared with later ones.
      Its vector form and `errors` came later, before its release as well, and change nothing by default.
    """

    def __init__(
        self,
        *,
        population_size: int = POPULATION_SIZE,
        iterations: int = ITERATIONS,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_swarm(population_size, iterations)
        super().__init__(select(**arguments), spaces_of_swarm(), render_mode)
        self._population_size, self._iterations = int(population_size), int(iterations)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[State, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        search = self._search = SteeredSwarm(
            self.world, number, self.np_random, self._population_size, self._iterations
        )
        search.settle(search.problem.evaluate(search.flock.moved), FIRST)
        self._show()
        return standings([search]).states[0], self._info(search)

    def step(self, action: Any) -> tuple[State, float, bool, bool, dict[str, Any]]:
        """Fly one iteration."""
        search = self._current()
        if search.left == 0:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        (inertia,), (temperature,), (spread,) = steering(self._door.proposals(action, self._shape)[None])
        before = search.best
        search.fly(inertia)
        flock, space = search.flock, search.space
        if spread > 0.0:
            flock.moved = sample_normal(space, search.rng, flock.moved, np.full(space.dimensions, spread))
        search.settle(search.problem.evaluate(flock.moved), temperature)
        self._show()
        return standings([search]).states[0], before - search.best, search.left == 0, False, self._info(search)

    def _info(self, search: "SteeredSwarm") -> dict[str, Any]:
        info = {"best_cost": search.best, "evaluations": search.used, "instance": search.episode.instance.number}
        if self._selection.errors:
            poses, _ = search.space.decode(search.leader[None])
            info |= search.episode.instance.errors(0, poses[0])
        return info

    def _portrait(self, search: "SteeredSwarm") -> Picture:
        return search.portrait()


class SteeredSwarm:
    """A swarm in the middle of its search: whoever holds it has its moves evaluated, and settles them."""

    def __init__(
        self, world: World, number: int, generator: np.random.Generator, population_size: int, iterations: int
    ) -> None:
        self.episode = Episode(world, number, population_size * (iterations + 1))
        self.rng = np.random.default_rng(int(generator.integers(2**63)))
        space = self.space = self.episode.space
        self.flock = SwarmState(
            space, self.rng, population_size, speed_limits(space, ALPHA, "symmetric"), REDRAWS, "dimension"
        )
        self.left, self.used, self._iterations = iterations, 0, iterations

    def portrait(self) -> Picture:
        """Return the picture (height, width, 3) of the best pose."""
        poses, places = self.problem.decode(self.leader[None])
        return portray(self.episode.scenery, poses[0], places[0], f"best {self.best:.1f}, {self.used} evaluations")

    @property
    def problem(self) -> PoseProblem:
        """The problem that is searched."""
        return self.episode.scenery.problem(self.space)

    @property
    def best(self) -> float:
        """The lowest cost so far."""
        return float(self.flock.best_cost.min())

    @property
    def leader(self) -> Array:
        """The proposal (d,) that costs so little."""
        return np.array(self.flock.best[self.flock.best_cost.argmin()])

    @property
    def budget(self) -> float:
        """The share of the iterations that is left."""
        return self.left / self._iterations

    def fly(self, inertia: float) -> None:
        """Move every particle, for another iteration."""
        self.flock.move(inertia, ACCELERATION, self.leader)
        self.left -= 1

    def settle(self, costs: Array, temperature: float) -> None:
        """Accept or refuse each particle's move, which has these costs (particles,)."""
        self.costs = costs
        self.accepted, _ = self.flock.accept(self.flock.moved, costs, temperature)
        self.used += len(costs)


def steering(actions: Array) -> tuple[list[float], list[float], list[float]]:
    """Return the inertias, temperatures and deviations of kicks that actions (n, 3) in [-1, 1] stand for."""
    columns = zip((INERTIA, LOG_TEMPERATURE, SPREAD), actions.T, strict=True)
    inertias, powers, spreads = (scaled(bounds, column).tolist() for bounds, column in columns)
    return inertias, [10.0**power for power in powers], spreads


class Standings(NamedTuple):
    """How far swarms have come."""

    best: Array  # (n,) lowest costs so far
    leaders: Array  # (n, d) the proposals that cost so little
    states: State  # (n, 8) observations


def standings(swarms: Sequence[SteeredSwarm]) -> Standings:
    """Return how far swarms have come that have equally many particles."""
    flocks, n = [swarm.flock for swarm in swarms], len(swarms)
    costs, bests = _stacked([swarm.costs for swarm in swarms]) / 100.0, _stacked([flock.best for flock in flocks])
    best_costs = _stacked([flock.best_cost for flock in flocks])
    leading = best_costs.argmin(axis=1)
    best = best_costs[np.arange(n), leading]
    values = [
        best / 100.0,
        costs.min(axis=1),
        costs.mean(axis=1),
        costs.std(axis=1),
        bests.std(axis=1).mean(axis=1),
        np.abs(_stacked([flock.velocity for flock in flocks])).reshape(n, -1).mean(axis=1) / ALPHA,
        _stacked([swarm.accepted for swarm in swarms]).mean(axis=1),
        [swarm.budget for swarm in swarms],
    ]
    states = np.clip(np.array(values, dtype=np.float32).T, 0.0, 1.0)
    return Standings(best, bests[np.arange(n), leading], states)


def _stacked(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """Return equal arrays (n, ...) as one; of a single one no copy is made, as its view takes a tenth of the time."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)


def spaces_of_swarm() -> tuple[spaces.Box, spaces.Box]:
    """Return the action space and the observation space."""
    return spaces.Box(-1.0, 1.0, (3,), np.float32), spaces.Box(0.0, 1.0, (8,), np.float32)


def check_swarm(population_size: int, iterations: int) -> None:
    """Return nothing. Raises ArgumentError where a number makes no sense."""
    for name, value in (("population_size", population_size), ("iterations", iterations)):
        approved(whole, name, value, 2)
