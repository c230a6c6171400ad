"""Configure-v1 for many environments at once: a turn of all their searches is one compiled call."""

from typing import Any, Unpack

import numpy as np

from posefit.arrays import Array
from posefit_envs.configure import ITERATIONS, POPULATION_SIZE
from posefit_envs.configuring.features import State, instance_features, observed_state, space_of_features
from posefit_envs.configuring.herd import Herd
from posefit_envs.configuring.orders import order_of, space_of_orders
from posefit_envs.configuring.single import EVERY, check_herd
from posefit_envs.drawing import Picture
from posefit_envs.instance import Arguments, select
from posefit_envs.scales import gained
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class OptimiserVectorEnv(SearchVectorEnv[Herd]):
    """`num_envs` environments as `posefit_envs.configuring.single.OptimiserEnv`, with the same arguments.

    So many `threads` draw; it is one unless somebody says otherwise, and changes nothing but the time.
    Seeded with s, environment i does what a single one does that is seeded with s + i. The step after an episode's last
    one resets, as `AutoresetMode.NEXT_STEP` says.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        population_size: int = POPULATION_SIZE,
        iterations: int = ITERATIONS,
        every: int = EVERY,
        threads: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_herd(population_size, iterations, every)
        selection = select(**arguments)
        spaces = space_of_orders(), space_of_features()
        super().__init__(num_envs, selection, spaces, threads, render_mode, max_episode_steps)
        self._sizes = int(population_size), int(iterations) // int(every), int(every)
        self._features: list[Array] = [np.empty(0)] * num_envs

    def step(self, actions: Any) -> tuple[State, Array, Flags, Flags, Infos]:
        """Search on with an order in each environment; one whose episode has ended resets instead."""
        orders = [order_of(action) for action in self._door.proposals(actions, self._shape)]
        stepping = self._renew_ended()
        if not stepping.all():
            self._first(np.flatnonzero(~stepping).tolist())
        herds = self._current()
        before = [herd.best for herd in herds]
        for i in np.flatnonzero(stepping).tolist():
            herds[i].follow(orders[i])
        self._search()
        terminated = stepping & np.array([herd.left == 0 for herd in herds])
        truncated = self._ends(stepping, terminated)
        rewards = np.array([gained(was, herd.best) for was, herd in zip(before, herds, strict=True)])
        infos = masked(np.ones_like(stepping), self._infos())
        return self._states(), np.where(stepping, rewards, 0.0), terminated, truncated, infos

    def _search(self) -> None:
        """Have all searches take their turns, all together, until nothing is open."""
        herds = self._current()
        while open_rows := [i for i, herd in enumerate(herds) if herd.open]:
            asked = {i: herds[i].ask() for i in open_rows}
            widest = max(len(proposals) for proposals in asked.values())
            # a narrower population is filled up with its first proposal, which is evaluated for nothing
            proposals = np.zeros((self.num_envs, widest, herds[0].space.dimensions))
            for i, mine in asked.items():
                proposals[i], proposals[i, : len(mine)] = mine[0], mine
            costs = self._stage.costs(proposals, np.array(open_rows))
            for i, mine in asked.items():
                herds[i].tell(costs[i, : len(mine)])

    def _states(self) -> State:
        return np.stack([observed_state(one, herd) for one, herd in zip(self._features, self._current(), strict=True)])

    def _infos(self) -> Infos:
        herds = self._current()
        best, used = np.array([herd.best for herd in herds]), np.array([herd.used for herd in herds])
        return self._standings(best, used, lambda: self._stage.poses(np.stack([herd.leader for herd in herds])))

    def _begin(self, i: int, number: int) -> None:
        herd = self._searches[i] = Herd(self.world, number, self._generator(i), *self._sizes)
        self._put(i, herd.episode)

    def _opened(self, begun: Flags) -> tuple[State, Infos]:
        self._first(np.flatnonzero(begun).tolist())
        return self._states(), self._infos()

    def _first(self, rows: list[int]) -> None:
        """Evaluate the first populations of some environments."""
        herds = self._current()
        moved = np.stack([herd.flock.moved for herd in herds])
        costs = self._stage.costs(moved, np.array(rows))
        for i in rows:
            herds[i].tell(costs[i])
            self._features[i] = instance_features(herds[i])

    def _portrait(self, i: int, search: Herd) -> Picture:
        return search.portrait()
