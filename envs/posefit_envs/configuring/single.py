"""Configure-v1: dynamic algorithm configuration, with a choice of optimisers, populations, restarts and diffusions."""

from typing import Any, Unpack

from gymnasium import error

from posefit.fitting.check import whole
from posefit_envs.base import SearchEnv
from posefit_envs.configure import ITERATIONS, POPULATION_SIZE
from posefit_envs.configuring.features import State, instance_features, observed_state, space_of_features
from posefit_envs.configuring.herd import LEAST, Herd
from posefit_envs.configuring.orders import order_of, space_of_orders
from posefit_envs.drawing import Picture
from posefit_envs.instance import ArgumentError, Arguments, approved, select
from posefit_envs.scales import gained
from posefit_envs.stage import Stage

EVERY = 5  # iterations a step


class OptimiserEnv(SearchEnv[Herd]):
    """
    ## Description
    A population searches for the pose in one silhouette. Each step is `every` iterations of it, and the action says
    which optimisers move it, how far, how much of it at a time, what is scattered and what begins anew: dynamic
    algorithm configuration with a choice of algorithms. With `posefit_envs.policies.sapso_action` it is SAPSO: its
    proposals are SAPSO's but for rounding, as stride and temperature come back from an action, and cost the same.

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
    | 6 | how much of the population begins anew, anywhere, the worst first | none | all |
    | 7 | standard deviation of a random kick in the root, in half-ranges of the box | 0 | 0.3 |
    | 8, 9 | the same in the first and in the second half of the latents | 0 | 0.3 |

    The shares are e^(5 a) of the first three numbers over their sum. Of the n particles that move at a time the first
    round(n share) are the swarm's, the next round(n share) differential evolution's, the rest are drawn from the normal
    distribution. They stand in the order of their bests where a part of the population moves, those that begin anew
    first, and in an order that never changes where all of it does. Number 3 has come to its ends at -0.5 and 0.5.
    Numbers 6 to 9 stand for nothing from 0 down.

    A step always has `every * population_size` evaluations: so a smaller part moves more often. Stride and
    temperature fall with each iteration of a step as SAPSO's do. The best pose of all is kept, whatever begins
    anew. Actions outside are clipped, with one warning.

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
    ln((1 + best cost before) / (1 + best cost after)), so that the sum over an episode is by what factor it came down.

    ## Starting State
    A first population of `population_size`, drawn uniformly and evaluated; the instance as in `Fit-v0`.

    ## Episode End
    Terminates after `iterations` iterations, `iterations / every` steps. It is never truncated.

    ## Information
    `best_cost`, `evaluations`, `instance`, and unless `errors=False` `error_degrees`, of the best pose against the
    truth; a reset too.

    ## Arguments
    As in `Fit-v0`, with `population_size=40`, 4 or more, `iterations=60` and `every=5`, of which `iterations` must be a
    multiple, instead of `target_cost` and `max_evaluations`.

    ## Version History
    - v1: shares of three optimisers, part of the population, restarts and diffusion by layer; instance features in the
      observation; the reward is a fall of the logarithm; a step is several iterations. Rewards and actions of v0 mean
      something else; the swarm, and SAPSO as a policy, are the same.
    - v0: `posefit/Configure-v0`, which stays as it is.
    """

    def __init__(
        self,
        *,
        population_size: int = POPULATION_SIZE,
        iterations: int = ITERATIONS,
        every: int = EVERY,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_herd(population_size, iterations, every)
        super().__init__(select(**arguments), (space_of_orders(), space_of_features()), render_mode)
        self._sizes = int(population_size), int(iterations) // int(every), int(every)
        self._stage = Stage(self.world, 1)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[State, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        herd = self._search = Herd(self.world, number, self.np_random, *self._sizes)
        self._stage.put(0, herd.episode.scenery, herd.space)
        herd.tell(self._stage.costs(herd.flock.moved[None], self._stage.everyone)[0])
        self._features = instance_features(herd)
        self._show()
        return observed_state(self._features, herd), self._info(herd)

    def step(self, action: Any) -> tuple[State, float, bool, bool, dict[str, Any]]:
        """Search on with one order."""
        herd = self._current()
        if herd.left == 0:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        order = order_of(self._door.proposals(action, self._shape))
        before = herd.best
        herd.follow(order)
        while herd.open:
            herd.tell(self._stage.costs(herd.ask()[None], self._stage.everyone)[0])
        self._show()
        return observed_state(self._features, herd), gained(before, herd.best), herd.left == 0, False, self._info(herd)

    def _info(self, herd: Herd) -> dict[str, Any]:
        info = {"best_cost": herd.best, "evaluations": herd.used, "instance": herd.episode.instance.number}
        if self._selection.errors:
            poses, _ = herd.space.decode(herd.leader[None])
            info |= herd.episode.instance.errors(0, poses[0])
        return info

    def _portrait(self, search: Herd) -> Picture:
        return search.portrait()


def check_herd(population_size: int, iterations: int, every: int) -> None:
    """Return nothing. Raises ArgumentError where a number makes no sense."""
    approved(whole, "population_size", population_size, LEAST)
    approved(whole, "iterations", iterations, 2)
    if iterations % approved(whole, "every", every, 1):
        raise ArgumentError(f"iterations must be a multiple of every {every}, got {iterations}")
