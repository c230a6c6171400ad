"""Configure-v0: dynamic algorithm configuration. The action steers a swarm that searches for the pose."""

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import error, spaces
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.drawing import MODES, Screen, check_mode, portray
from posefit_envs.fit import Episode
from posefit_envs.instance import Arguments, approved, errors_in_degrees, select
from posefit_envs.search import Doorkeeper
from posefit_swarm.flock import Flock, speed_limits

PARTICLES, ITERATIONS = 40, 60
ACCELERATION, ALPHA, REDRAWS = 2.0, 0.15, 20  # as SAPSO's, but for fewer redraws
INERTIA = (0.0, 1.2)  # what the first number of an action stands for
LOG_TEMPERATURE = (-3.0, 1.5)  # the second: powers of ten
SPREAD = (0.0, 0.3)  # the third: standard deviations in half-ranges of the box

State = NDArray[np.float32]


class ConfigureEnv(gym.Env[State, Any]):
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
    A first population of `particles`, drawn uniformly and evaluated; the instance as in `Fit-v0`.

    ## Episode End
    Terminates after `iterations` iterations. It is never truncated.

    ## Information
    `best_cost`, `evaluations`, `error_degrees` of the best pose against the truth, and `instance`; a reset too.

    ## Arguments
    As in `Fit-v0`, with `particles=40` and `iterations=60` instead of `target_cost` and `max_evaluations`.

    ## Version History
    - v0: first version. Before its release its instances changed: number n is now the motion, speed, phase and view of
      a sweep's instance n, and 0 the motion as it is. Results from before cannot be compared with later ones.
    """

    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012, as Gymnasium has it

    def __init__(
        self,
        *,
        particles: int = PARTICLES,
        iterations: int = ITERATIONS,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_mode(render_mode)
        for name, value in (("particles", particles), ("iterations", iterations)):
            approved(whole, name, value, 2)
        self.render_mode = render_mode
        self._selection = select(**arguments)
        self.world = self._selection.world
        self._particles, self._iterations = int(particles), int(iterations)
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = spaces.Box(0.0, 1.0, (8,), np.float32)
        self._door = Doorkeeper(3)
        self._search: _Search | None = None
        self._screen = Screen(self.metadata["render_fps"])

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[State, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        episode = Episode(self.world, number, self._particles * (self._iterations + 1))
        rng = np.random.default_rng(int(self.np_random.integers(2**63)))
        self._search = _Search(episode, rng, self._particles, self._iterations)
        if self.render_mode == "human":
            self.render()
        return self._search.state(), self._search.info()

    def step(self, action: Any) -> tuple[State, float, bool, bool, dict[str, Any]]:
        """Fly one iteration."""
        search = self._current()
        if search.left == 0:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        share = 0.5 * (self._door.proposals(action, (3,)) + 1.0)
        inertia, power, spread = (
            low + float(part) * (high - low)
            for part, (low, high) in zip(share, (INERTIA, LOG_TEMPERATURE, SPREAD), strict=True)
        )
        before = search.best
        search.fly(inertia, 10.0**power, spread)
        if self.render_mode == "human":
            self.render()
        return search.state(), before - search.best, search.left == 0, False, search.info()

    def render(self) -> Any:
        """Return the picture (height, width, 3) of the best pose, or show it, as `render_mode` asks."""
        if self.render_mode is None:
            return None
        search = self._current()
        poses, places = search.problem.decode(search.leader[None])
        label = f"best {search.best:.1f}, {search.used} evaluations"
        picture = portray(search.episode.scenery, poses[0], places[0], label)
        return picture if self.render_mode == "rgb_array" else self._screen.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _current(self) -> "_Search":
        if self._search is None:
            raise error.ResetNeeded("reset must come before anything else")
        return self._search


class _Search:
    """A swarm in the middle of its search."""

    def __init__(self, episode: Episode, rng: np.random.Generator, particles: int, iterations: int) -> None:
        self.episode, self._rng = episode, rng
        self.problem = episode.scenery.problem(episode.space)
        limits = speed_limits(episode.space, ALPHA, "symmetric")
        self._flock = Flock(episode.space, rng, particles, limits, REDRAWS, "dimension")
        self._iterations, self.left, self.used = iterations, iterations, 0
        self._evaluate(1.0)

    @property
    def best(self) -> float:
        return float(self._flock.best_cost.min())

    @property
    def leader(self) -> Array:
        return np.array(self._flock.best[self._flock.best_cost.argmin()])

    def _evaluate(self, temperature: float) -> None:
        self._costs = self.problem.evaluate(self._flock.moved)
        self._accepted, _ = self._flock.settle(self._flock.moved, self._costs, temperature)
        self.used += len(self._costs)

    def fly(self, inertia: float, temperature: float, spread: float) -> None:
        flock, space = self._flock, self.episode.space
        flock.fly(inertia, ACCELERATION, self.leader)
        if spread > 0.0:
            flock.moved = space.scatter(self._rng, flock.moved, np.full(space.dimensions, spread))
        self._evaluate(temperature)
        self.left -= 1

    def state(self) -> State:
        flock, costs = self._flock, self._costs / 100.0
        values = [
            self.best / 100.0,
            costs.min(),
            costs.mean(),
            costs.std(),
            flock.best.std(axis=0).mean(),
            np.abs(flock.velocity).mean() / ALPHA,
            self._accepted.mean(),
            self.left / self._iterations,
        ]
        return np.clip(np.array(values, dtype=np.float32), 0.0, 1.0)

    def info(self) -> dict[str, Any]:
        poses, _ = self.problem.decode(self.leader[None])
        return {
            "best_cost": self.best,
            "evaluations": self.used,
            "error_degrees": float(errors_in_degrees(self.episode.instance.truth, 0, poses)[0]),
            "instance": self.episode.instance.number,
        }
