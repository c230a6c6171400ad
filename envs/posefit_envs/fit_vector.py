"""Fit-v0 for many environments at once: a population of proposals is one call of the kernel."""

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from gymnasium import error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from posefit import PoseProblem, SearchSpace
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.batch import mask_of, seeds_of
from posefit_envs.drawing import MODES, check_mode, portray
from posefit_envs.fit import MAX_EVALUATIONS, TARGET_COST, Episode, action_shape, check_budget, spaces_of
from posefit_envs.instance import Arguments, approved, errors_in_degrees, select
from posefit_envs.search import Doorkeeper, Evaluated, Image, distinct, look

Infos = dict[str, Any]


class FitVectorEnv(VectorEnv[Image, Any, Array]):
    """`num_envs` environments as `posefit_envs.fit.FitEnv`, with the same arguments.

    Environments that fit the same instance, as all do where `instance` is given, are one call of the kernel. Seeded
    with s, environment i does what a single one does that is seeded with s + i. The one after an episode's last step
    resets, as `AutoresetMode.NEXT_STEP` says.
    """

    metadata = {  # noqa: RUF012, as Gymnasium has it
        "render_modes": list(MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        target_cost: float = TARGET_COST,
        max_evaluations: int = MAX_EVALUATIONS,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        approved(whole, "num_envs", num_envs, 1)
        check_budget(target_cost, "max_evaluations", max_evaluations)
        check_mode(render_mode)
        if render_mode == "human":
            raise error.UnsupportedMode("render_mode must be rgb_array for a vector environment, got human")
        self.num_envs, self.render_mode = num_envs, render_mode
        self._selection = select(**arguments)
        self.world = self._selection.world
        self._target, self._most = float(target_cost), int(max_evaluations)
        self._longest = max_episode_steps
        self.single_action_space, self.single_observation_space = spaces_of(self.world)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._shape = (num_envs, *action_shape(self.world))
        self._door = Doorkeeper(self._shape[1])
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._episodes: list[Episode] = []
        self._best, self._used = np.full(num_envs, np.inf), np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=bool)
        self._alike = False  # whether all environments share one instance

    @property
    def search_spaces(self) -> list[SearchSpace]:
        """The space of each environment's instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return [episode.space for episode in self._current()]

    @property
    def problems(self) -> list[PoseProblem]:
        """The problem that each environment's proposals are evaluated on."""
        return [episode.scenery.problem(episode.space) for episode in self._current()]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Image, Infos]:
        """Begin with an instance each; `options={"instance": 17}` chooses one for all, "reset_mask" some to begin."""
        seeds, mask = seeds_of(seed, self.num_envs), mask_of(options, self.num_envs, bool(self._episodes))
        if not self._episodes:
            self._episodes = [None] * self.num_envs  # type: ignore[list-item]
        for i in np.flatnonzero(mask):
            if seeds[i] is not None:
                self._generators[i] = seeding.np_random(seeds[i])[0]
            self._begin(int(i), options)
        self._alike = self._one_instance()
        return self._pictures(), self._numbers(mask)

    def step(self, actions: Any) -> tuple[Image, Array, Any, Any, Infos]:
        """Propose a pose in each environment; one whose episode has ended resets instead."""
        episodes, n = self._current(), self.num_envs
        proposals = self._door.proposals(actions, self._shape)
        if self._alike and not self._ended.any():
            outcome = look(episodes[0].scenery, episodes[0].space, proposals)
            return self._answer(outcome, np.ones(n, dtype=bool), outcome.pictures)
        stepping = ~self._ended
        for i in np.flatnonzero(self._ended):
            self._begin(int(i), None)
        pictures = self._pictures()
        outcome = self._look(proposals, np.flatnonzero(stepping).tolist(), pictures)
        self._alike = self._one_instance()
        return self._answer(outcome, stepping, pictures)

    def _look(self, proposals: Array, rows: list[int], pictures: Image) -> Evaluated:
        """Return the outcomes of some rows, in their order, one kernel call an instance; write their pictures."""
        n, views = self.num_envs, len(self.world.view_degrees)
        poses, places = np.zeros((n, 66)), np.zeros((n, 3))
        costs, areas = np.zeros(n), np.zeros((n, views, 3), dtype=np.int64)
        for group in distinct([episode.instance for episode in self._episodes], rows).values():
            first = self._episodes[group[0]]
            part = look(first.scenery, first.space, proposals[group])
            poses[group], places[group], costs[group] = part.poses, part.translations, part.costs
            areas[group], pictures[group] = part.areas, part.pictures
        return Evaluated(poses, places, costs, areas, pictures)

    def _answer(
        self, outcome: Evaluated, stepping: NDArray[np.bool_], pictures: Image
    ) -> tuple[Image, Array, NDArray[np.bool_], NDArray[np.bool_], Infos]:
        self._used += stepping
        np.minimum(self._best, outcome.costs, out=self._best, where=stepping)
        terminated = stepping & (self._best <= self._target)
        most = self._most if self._longest is None else min(self._most, self._longest)
        truncated = stepping & ~terminated & (self._used >= most)
        self._ended = terminated | truncated
        self._last = outcome
        infos: Infos = {
            "cost": np.where(stepping, outcome.costs, 0.0),
            "best_cost": np.where(stepping, self._best, 0.0),
            "evaluations": np.where(stepping, self._used, 0),
            "error_degrees": np.where(stepping, self._errors(outcome), 0.0),
            "areas": outcome.areas,
        }
        infos |= {f"_{key}": stepping.copy() for key in tuple(infos)} if stepping.any() else {}
        if not stepping.any():
            infos = {}
        infos |= self._numbers(np.ones(self.num_envs, dtype=bool))
        return pictures, np.where(stepping, -outcome.costs, 0.0), terminated, truncated, infos

    def _errors(self, outcome: Evaluated) -> Array:
        if self._alike:
            return errors_in_degrees(self._episodes[0].instance.truth, 0, outcome.poses)
        truths = [one.instance.truth for one in self._episodes]
        return np.array([errors_in_degrees(truth, 0, outcome.poses[i : i + 1])[0] for i, truth in enumerate(truths)])

    def _generator(self, i: int) -> np.random.Generator:
        mine = self._generators[i]
        if mine is None:
            mine = self._generators[i] = seeding.np_random(None)[0]
        return mine

    def _begin(self, i: int, options: Mapping[str, Any] | None) -> None:
        number = self._selection.number(options, lambda: self._generator(i))
        self._episodes[i] = Episode(self.world, number, self._most)
        self._best[i], self._used[i], self._ended[i] = np.inf, 0, False

    def _one_instance(self) -> bool:
        return all(episode.instance is self._episodes[0].instance for episode in self._episodes)

    def _pictures(self) -> Image:
        return np.stack([episode.scenery.picture for episode in self._episodes])

    def _numbers(self, mask: NDArray[np.bool_]) -> Infos:
        numbers = np.array([episode.instance.number for episode in self._episodes])
        return {"instance": np.where(mask, numbers, 0), "_instance": mask.copy()}

    def render(self) -> Any:
        """Return a tuple of pictures (height, width, 3), one an environment, where `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        shown = []
        for i, episode in enumerate(self._current()):
            if self._used[i]:
                label = f"cost {self._last.costs[i]:.1f}, best {self._best[i]:.1f}, {self._used[i]} evaluations"
                shown.append(portray(episode.scenery, self._last.poses[i], self._last.translations[i], label))
            else:
                shown.append(portray(episode.scenery, None, None, episode.label))
        return tuple(shown)

    def _current(self) -> list[Episode]:
        if not self._episodes:
            raise error.ResetNeeded("reset must come before anything else")
        return self._episodes
