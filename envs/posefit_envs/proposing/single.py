"""Fit-v1: one silhouette, an episode of proposals, and an observation that says what was proposed before."""

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import Space, error, spaces

from posefit import SearchSpace
from posefit.fitting.check import whole
from posefit_envs.drawing import MODES, Screen, check_mode, portray
from posefit_envs.fit import MAX_EVALUATIONS, Episode, action_shape, spaces_of
from posefit_envs.instance import Arguments, ArgumentError, World, approved, select
from posefit_envs.proposing.memory import Memory, seen_with, space_of_memory
from posefit_envs.search import Doorkeeper
from posefit_envs.stage import Stage


class ProposalEnv(gym.Env[Any, Any]):
    """DOC"""

    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012, as Gymnasium has it

    def __init__(
        self,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        image: bool = False,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_mode(render_mode)
        check_proposing(max_evaluations, image)
        self.render_mode = render_mode
        self._selection = select(**arguments)
        self.world = self._selection.world
        self._most, self._image = int(max_evaluations), image
        self.action_space, self.observation_space = spaces_of_proposing(self.world, image)
        self._dimensions = action_shape(self.world)[0]
        self._door = Doorkeeper(self._dimensions + 1)
        self._stage = Stage(self.world, 1)
        self._episode: Episode | None = None
        self._screen = Screen(self.metadata["render_fps"])

    @property
    def search_space(self) -> SearchSpace:
        """The space of the current instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._current().space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        episode = self._episode = Episode(self.world, number, self._most)
        self._stage.put(0, episode.scenery, episode.space)
        outcome = self._stage.look(np.zeros((1, self._dimensions)), self._stage.everyone)
        info = episode.take(outcome, self._selection.errors)
        self._memory = Memory(self._dimensions, episode.cost, self._most)
        if self.render_mode == "human":
            self.render()
        return seen_with(self._memory.state(), outcome.pictures[0], self._image), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Propose a pose."""
        episode = self._current()
        if episode.ended:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        proposal = self._memory.proposal(self._door.proposals(action, (self._dimensions + 1,)))
        outcome = self._stage.look(proposal[None], self._stage.everyone)
        info = episode.take(outcome, self._selection.errors)
        reward = self._memory.take(proposal, episode.cost)
        episode.ended = episode.evaluations >= self._most
        if self.render_mode == "human":
            self.render()
        seen = seen_with(self._memory.state(), outcome.pictures[0], self._image)
        return seen, reward, episode.ended, False, info

    def render(self) -> Any:
        """Return the picture (height, width, 3), or show it, as `render_mode` asks."""
        if self.render_mode is None:
            return None
        episode = self._current()
        picture = portray(episode.scenery, episode.pose, episode.translation, episode.label)
        return picture if self.render_mode == "rgb_array" else self._screen.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _current(self) -> Episode:
        if self._episode is None:
            raise error.ResetNeeded("reset must come before anything else")
        return self._episode


def spaces_of_proposing(world: World, image: bool) -> tuple[spaces.Box, Space[Any]]:
    """Return the action space and the observation space of a world, with the picture or without."""
    d = action_shape(world)[0]
    shown = space_of_memory(d)
    seen = spaces.Dict({"search": shown, "image": spaces_of(world)[1]}) if image else shown
    return spaces.Box(-1.0, 1.0, (d + 1,), np.float32), seen


def check_proposing(max_evaluations: Any, image: Any) -> None:
    """Return nothing. Raises ArgumentError where an argument makes no sense."""
    approved(whole, "max_evaluations", max_evaluations, 2)
    if not isinstance(image, bool):
        raise ArgumentError(f"image must be true or false, got {image!r}")
