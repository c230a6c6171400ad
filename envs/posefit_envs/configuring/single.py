"""Configure-v1: dynamic algorithm configuration, with a choice of optimisers, populations, restarts and diffusions."""

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import error

from posefit.fitting.check import whole
from posefit_envs.configure import ITERATIONS, PARTICLES
from posefit_envs.configuring.features import State, instance_features, shown, space_of_features
from posefit_envs.configuring.herd import LEAST, Herd
from posefit_envs.configuring.orders import NUMBERS, order_of, space_of_orders
from posefit_envs.drawing import MODES, Screen, check_mode, portray
from posefit_envs.instance import Arguments, ArgumentError, approved, select
from posefit_envs.search import Doorkeeper
from posefit_envs.stage import Stage

EVERY = 5  # iterations a step


class OptimiserEnv(gym.Env[State, Any]):
    """DOC"""

    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012, as Gymnasium has it

    def __init__(
        self,
        *,
        particles: int = PARTICLES,
        iterations: int = ITERATIONS,
        every: int = EVERY,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_mode(render_mode)
        check_herd(particles, iterations, every)
        self.render_mode = render_mode
        self._selection = select(**arguments)
        self.world = self._selection.world
        self._sizes = int(particles), int(iterations) // int(every), int(every)
        self.action_space, self.observation_space = space_of_orders(), space_of_features()  # type: ignore[assignment]
        self._door = Doorkeeper(NUMBERS)
        self._stage = Stage(self.world, 1)
        self._herd: Herd | None = None
        self._screen = Screen(self.metadata["render_fps"])

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[State, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        herd = self._herd = Herd(self.world, number, self.np_random, *self._sizes)
        self._stage.put(0, herd.episode.scenery, herd.space)
        herd.tell(self._stage.costs(herd.flock.moved[None], self._stage.everyone)[0])
        self._features = instance_features(herd)
        if self.render_mode == "human":
            self.render()
        return shown(self._features, herd), self._info(herd)

    def step(self, action: Any) -> tuple[State, float, bool, bool, dict[str, Any]]:
        """Search on with one order."""
        herd = self._current()
        if herd.left == 0:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        order = order_of(self._door.proposals(action, (NUMBERS,)))
        before = herd.best
        herd.follow(order)
        while herd.open:
            herd.tell(self._stage.costs(herd.ask()[None], self._stage.everyone)[0])
        if self.render_mode == "human":
            self.render()
        return shown(self._features, herd), gained(before, herd.best), herd.left == 0, False, self._info(herd)

    def _info(self, herd: Herd) -> dict[str, Any]:
        info = {"best_cost": herd.best, "evaluations": herd.used, "instance": herd.episode.instance.number}
        if self._selection.errors:
            poses, _ = herd.space.decode(herd.leader[None])
            info |= herd.episode.instance.errors(0, poses[0])
        return info

    def render(self) -> Any:
        """Return the picture (height, width, 3) of the best pose, or show it, as `render_mode` asks."""
        if self.render_mode is None:
            return None
        herd = self._current()
        poses, places = herd.episode.scenery.problem(herd.space).decode(herd.leader[None])
        picture = portray(herd.episode.scenery, poses[0], places[0], f"best {herd.best:.1f}, {herd.used} evaluations")
        return picture if self.render_mode == "rgb_array" else self._screen.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _current(self) -> Herd:
        if self._herd is None:
            raise error.ResetNeeded("reset must come before anything else")
        return self._herd


def gained(before: float, after: float) -> float:
    """Return the reward of a best cost that falls: ln((1 + before) / (1 + after))."""
    return float(np.log1p(before) - np.log1p(after))


def check_herd(particles: int, iterations: int, every: int) -> None:
    """Return nothing. Raises ArgumentError where a number makes no sense."""
    approved(whole, "particles", particles, LEAST)
    approved(whole, "iterations", iterations, 2)
    if iterations % approved(whole, "every", every, 1):
        raise ArgumentError(f"iterations must be a multiple of every {every}, got {iterations}")
