"""Configure-v0 for many environments at once: what their swarms propose is one compiled call."""

from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import MANY, REDRAWS, fold
from posefit_envs.configure import (
    FIRST,
    ITERATIONS,
    POPULATION_SIZE,
    State,
    SteeredSwarm,
    check_swarm,
    spaces_of_swarm,
    standings,
    steering,
)
from posefit_envs.drawing import Picture
from posefit_envs.instance import Arguments, select
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class ConfigureVectorEnv(SearchVectorEnv[SteeredSwarm]):
    """`num_envs` environments as `posefit_envs.configure.ConfigureEnv`, with the same arguments.

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
        threads: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_swarm(population_size, iterations)
        selection = select(**arguments)
        super().__init__(num_envs, selection, spaces_of_swarm(), threads, render_mode, max_episode_steps)
        self.population_size, self._iterations = int(population_size), int(iterations)

    def step(self, actions: Any) -> tuple[State, Array, Flags, Flags, Infos]:
        """Fly one iteration in each environment; one whose episode has ended resets instead."""
        inertias, temperatures, kicks = steering(self._door.proposals(actions, self._shape))
        stepping = self._renew_ended()
        swarms, before = self._current(), self._reached.best
        for i in np.flatnonzero(stepping).tolist():
            swarms[i].fly(inertias[i])
        deviations = np.where(stepping, kicks, 0.0)
        self._kick(np.flatnonzero(deviations > 0.0), deviations)
        self._settle(np.where(stepping, temperatures, FIRST), self._stage.everyone)
        terminated = stepping & np.array([swarm.left == 0 for swarm in swarms])
        truncated = self._ends(stepping, terminated)
        best = self._reached.best
        rewards = np.where(stepping, before - best, 0.0)
        infos = masked(np.ones_like(stepping), self._infos())
        return self._reached.states, rewards, terminated, truncated, infos

    def _kick(self, rows: NDArray[np.int64], deviations: Array) -> None:
        """Scatter the moves of some swarms, by so many half-ranges (n,): `box.scatter` for all of them together."""
        if not len(rows):
            return
        swarms = self._current()
        flocks, space = [swarms[i].flock for i in rows.tolist()], swarms[0].space
        means = np.stack([flock.moved for flock in flocks])
        shape, spread = means.shape, deviations[rows]
        noise = np.stack([swarms[i].rng.standard_normal(shape[1:]) for i in rows.tolist()])
        drawn = fold(space, means + spread[:, None, None] * noise)
        # of each swarm (m,) in turn, the particles that are not feasible
        owners, which = np.nonzero(~self._stage.feasible(drawn, rows))
        left = REDRAWS - 1
        while left > 0 and len(owners):
            many = min(left, MANY)
            counts = np.bincount(owners, minlength=len(rows))
            noise = np.concatenate(
                [
                    swarms[i].rng.standard_normal((count, many, shape[2]))
                    for i, count in zip(rows.tolist(), counts.tolist(), strict=True)
                    if count
                ]
            )
            again = fold(space, means[owners, which][:, None] + spread[owners][:, None, None] * noise)
            works = self._stage.feasible(again, rows[owners])
            mended = works.any(axis=1)
            drawn[owners[mended], which[mended]] = again[mended, works[mended].argmax(axis=1)]
            owners, which, left = owners[~mended], which[~mended], left - many
        drawn[owners, which] = means[owners, which]
        for flock, moved in zip(flocks, drawn, strict=True):
            flock.moved = moved

    def _settle(self, temperatures: Array, rows: NDArray[np.int64]) -> None:
        """Evaluate the moves of some swarms, settle them at temperatures (n,), and see how far all have come."""
        swarms = self._current()
        costs = self._stage.costs(np.stack([swarm.flock.moved for swarm in swarms]), rows)
        for i, temperature in zip(rows.tolist(), temperatures[rows].tolist(), strict=True):
            swarms[i].settle(costs[i], temperature)
        self._reached = standings(swarms)

    def _infos(self) -> Infos:
        used = np.array([swarm.used for swarm in self._current()])
        return self._standings(self._reached.best, used, lambda: self._stage.poses(self._reached.leaders))

    def _begin(self, i: int, number: int) -> None:
        swarm = SteeredSwarm(self.world, number, self._generator(i), self.population_size, self._iterations)
        self._searches[i] = swarm
        self._put(i, swarm.episode)

    def _opened(self, begun: Flags) -> tuple[State, Infos]:
        self._settle(np.full(self.num_envs, FIRST), np.flatnonzero(begun))
        return self._reached.states, self._infos()

    def _portrait(self, i: int, search: SteeredSwarm) -> Picture:
        return search.portrait()
