"""What single environments share: instances, actions that are checked, and the window."""

from abc import ABC, abstractmethod
from typing import Any, Generic, TypeVar

import gymnasium as gym
from gymnasium import Space, error

from posefit_envs.drawing import MODES, Picture, Screen, check_mode
from posefit_envs.instance import Selection
from posefit_envs.search import Doorkeeper

S = TypeVar("S")


class SearchEnv(gym.Env[Any, Any], ABC, Generic[S]):
    """One environment, whose episode is a search: its state is `_search`, None before the first reset."""

    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012, as Gymnasium has it

    def __init__(self, selection: Selection, spaces: tuple[Space[Any], Space[Any]], render_mode: str | None) -> None:
        check_mode(render_mode)
        self.render_mode = render_mode
        self._selection, self.world = selection, selection.world
        self.action_space, self.observation_space = spaces
        self._shape = self.action_space.shape or ()
        self._door = Doorkeeper(self._shape[0])
        self._search: S | None = None
        self._screen = Screen(self.metadata["render_fps"])

    def render(self) -> Any:
        """Return the picture (height, width, 3), or show it, as `render_mode` asks."""
        if self.render_mode is None:
            return None
        picture = self._portrait(self._current())
        return picture if self.render_mode == "rgb_array" else self._screen.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _show(self) -> None:
        """Show the picture where `render_mode` asks for a window."""
        if self.render_mode == "human":
            self.render()

    def _current(self) -> S:
        if self._search is None:
            raise error.ResetNeeded("reset must come before anything else")
        return self._search

    @abstractmethod
    def _portrait(self, search: S) -> Picture:
        """Return the picture of a search."""
