"""Configure-v0: dynamic algorithm configuration, with a choice of optimisers, populations, restarts and diffusions."""

from typing import Any

import numpy as np
from gymnasium import spaces

from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.base import Flags, Infos, Outcome, SearchEnv, SearchVectorEnv, log_improvement
from posefit_envs.instance import ArgumentError, Episode, World, checked
from posefit_envs.population import (
    ACTION_NUMBERS,
    INSTANCE_FEATURES,
    MIN_PARTICLES,
    PROGRESS_FEATURES,
    Population,
    State,
    control_of,
    instance_features,
    observed_state,
)
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows

POPULATION_SIZE, ITERATIONS = 40, 60
EVERY = 5  # iterations a step


class ConfigureVectorEnv(SearchVectorEnv):
    """`num_envs` environments as ConfigureEnv; a step of each is one compiled call, or a turn of all their searches."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        population_size: int = POPULATION_SIZE,
        iterations: int = ITERATIONS,
        every: int = EVERY,
        **arguments: Any,
    ) -> None:
        checked(whole, "population_size", population_size, MIN_PARTICLES)
        checked(whole, "iterations", iterations, 2)
        if iterations % checked(whole, "every", every, 1):
            raise ArgumentError(f"iterations must be a multiple of every {every}, got {iterations}")

        def control_spaces(_: World) -> tuple[spaces.Box, spaces.Box]:
            features = INSTANCE_FEATURES + PROGRESS_FEATURES
            action = spaces.Box(-1.0, 1.0, (ACTION_NUMBERS,), np.float32)
            return action, spaces.Box(0.0, 1.0, (features,), np.float32)

        super().__init__(num_envs, control_spaces, **arguments)
        self.population_size, self.every = int(population_size), int(every)
        self._step_count = int(iterations) // self.every
        self._populations: dict[int, Population] = {}
        self._features: list[Array] = [np.empty(0)] * num_envs

    def _begin_search(self, i: int, number: int) -> None:
        population = Population(
            self.world, number, self._generator(i), self.population_size, self._step_count, self.every
        )
        self._populations[i] = population
        self._enter(i, population.episode)

    def _opened(self, begun: Flags) -> tuple[State, Infos]:
        self._evaluate_first(np.flatnonzero(begun).tolist())
        return self._states(), self._infos()

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        if not stepping.all():
            self._evaluate_first(np.flatnonzero(~stepping).tolist())
        populations = list(self._populations.values())
        before = [population.best for population in populations]
        for i in rows.tolist():
            populations[i].begin_step(control_of(actions[i]))
        while open_rows := [i for i, population in enumerate(populations) if population.open]:
            asked = {i: populations[i].ask() for i in open_rows}
            widest = max(len(proposals) for proposals in asked.values())
            # a narrower population is filled up with its first proposal, whose further costs are ignored
            proposals = np.zeros((self.num_envs, widest, populations[0].space.dimensions))
            for i, own in asked.items():
                proposals[i], proposals[i, : len(own)] = own[0], own
            costs = self._stage.costs(proposals, np.array(open_rows))
            for i, own in asked.items():
                populations[i].tell(costs[i, : len(own)])
        rewards = log_improvement(np.array(before), np.array([population.best for population in populations]))
        terminated = stepping & np.array([population.left == 0 for population in populations])
        infos = self._infos()
        return Outcome(self._states(), rewards, terminated, infos, infos)

    def _evaluate_first(self, rows: list[int]) -> None:
        moved = np.stack([population.swarm.moved for population in self._populations.values()])
        costs = self._stage.costs(moved, np.array(rows))
        for i in rows:
            self._populations[i].tell(costs[i])
            self._features[i] = instance_features(self._populations[i])

    def _states(self) -> State:
        pairs = zip(self._features, self._populations.values(), strict=True)
        return np.stack([observed_state(features, population) for features, population in pairs])

    def _infos(self) -> Infos:
        best = np.array([population.best for population in self._populations.values()])
        used = np.array([population.used for population in self._populations.values()])
        leaders = np.stack([population.leader for population in self._populations.values()])
        return self._progress(best, used, self._stage.poses(leaders))

    def _render_row(self, i: int, episode: Episode) -> Picture:
        population = self._populations[i]
        poses, places = episode.problem.decode(population.leader[None])
        label = f"best {population.best:.1f}, {population.used} evaluations"
        return render_frame(episode.problem, poses[0], places[0], label)


class ConfigureEnv(SearchEnv):
    """
    ## Description
    A population searches for the pose in one silhouette. Each step is `every` iterations of it, and the action sets
    which optimisers move it, how far, how much of it at a time, and what is restarted: dynamic algorithm configuration.
    With `posefit_envs.policies.sapso_action` it is SAPSO, but for the rounding of stride and temperature in an action.

    ## Action Space
    `Box(-1, 1, (10,), float32)`

    | Num | Meaning | -1 stands for | 1 stands for |
    |---|---|---|---|
    | 0 | share of the particles that move as a swarm | none, nearly | all, nearly |
    | 1 | share that moves by differential evolution | none, nearly | all, nearly |
    | 2 | share that is drawn from the normal distribution of the better half | none, nearly | all, nearly |
    | 3 | how much of the population moves at a time, the best first, by powers of two | all | a quarter |
    | 4 | stride: inertia of the swarm, weight of differences, width of the draws in 0.6ths | 0 | 1.2 |
    | 5 | temperature at which worse moves are accepted, by powers of ten | 0.001 | 32 |
    | 6 | how much of the population is restarted, anywhere, the worst first | none | all |
    | 7 | standard deviation of a random kick in the root, in half-ranges of the box | 0 | 0.3 |
    | 8, 9 | the same in the first and in the second half of the latents | 0 | 0.3 |

    The shares are e^(5 a) of the first three numbers over their sum. Of the n particles that move at a time the first
    round(n share) are the swarm's, the next round(n share) differential evolution's, the rest are drawn from the normal
    distribution: in the order of their bests where a part of the population moves, restarted ones first, and in an
    order that never changes where all of it does. Number 3 reaches its ends at -0.5 and 0.5. From 0 down, numbers 6
    to 9 mean none.

    A step always has `every * population_size` evaluations, so a smaller part moves more often. Stride and temperature
    fall with each iteration as SAPSO's do. The best pose is kept, whatever is restarted. Actions outside are clipped,
    with one warning.

    ## Observation Space
    `Box(0, 1, (25,), float32)`

    | Num | Meaning |
    |---|---|
    | 0, 1, 2 | of the silhouette, mean over views: share of the picture, height, width |
    | 3, 4 | its share of the box around it, share of its pixels at an edge |
    | 5 | dimensions / 66 |
    | 6, 7 | median and standard deviation of the first population's costs / 100 |
    | 8 | correlation of those costs with the distance to the cheapest, -1 to 1 |
    | 9, 10 | best cost so far, and best that the population knows: ln(1 + cost) / ln 101 |
    | 11, 12, 13 | lowest, mean and standard deviation of the last step's costs, in the same way |
    | 14, 15, 16 | spread of the bests in the root and either half of the latents, 0.001 to 1, by its logarithm |
    | 17 | mean speed of the particles / the largest allowed |
    | 18 | share of moves accepted in the last step |
    | 19, 20 | budget left; steps since the best cost fell / 10 |
    | 21 to 24 | shares and part of the population of the last action |

    ## Rewards
    ln((1 + best cost before) / (1 + best cost after)).

    ## Starting State
    A first population of `population_size`, drawn uniformly and evaluated; the instance as in `FitImage-v0`.

    ## Episode End
    Terminates after `iterations` iterations, `iterations / every` steps. It is never truncated.

    ## Information
    `best_cost`, `evaluations`, `instance`, and unless `errors=False` `error_degrees`, of the best pose against the
    truth; a reset too.

    ## Arguments
    As in `FitImage-v0`, with `population_size=40`, 4 or more, `iterations=60` and `every=5`, of which `iterations`
    must be a multiple, instead of `target_cost` and `max_evaluations`.
    """

    vector = ConfigureVectorEnv
