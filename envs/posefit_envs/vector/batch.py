"""What vector environments share: seeds, instances, ends, masks of a reset and of infos."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from gymnasium import Space, error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit.fitting.metrics import pose_error_degrees
from posefit.geometry.skeleton import ANGLES
from posefit.reading import quoted
from posefit_envs.drawing import MODES, Picture, check_mode
from posefit_envs.fit import Episode
from posefit_envs.instance import ArgumentError, Selection, approved, instance_number
from posefit_envs.search import Doorkeeper
from posefit_envs.stage import Stage

Flags = NDArray[np.bool_]  # (n,)
Infos = dict[str, Any]


class HasSpace(Protocol):
    """The state of one environment's episode."""

    @property
    def space(self) -> SearchSpace:
        """The space that is searched."""
        ...


S = TypeVar("S", bound=HasSpace)


class SearchVectorEnv(VectorEnv[Any, Any, Any], ABC, Generic[S]):
    """`num_envs` environments, each with a search and a row of what is drawn together.

    Seeded with s, environment i does what a single one does that is seeded with s + i. The step after an episode's last
    one resets, as `AutoresetMode.NEXT_STEP` says.
    """

    metadata = {  # noqa: RUF012, as Gymnasium has it
        "render_modes": list(MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int,
        selection: Selection,
        spaces: tuple[Space[Any], Space[Any]],
        threads: int,
        render_mode: str | None,
        max_episode_steps: int | None,
    ) -> None:
        approved(whole, "num_envs", num_envs, 1)
        check_mode(render_mode)
        if render_mode == "human":
            raise error.UnsupportedMode("render_mode must be rgb_array for a vector environment, got human")
        self.num_envs, self.render_mode = num_envs, render_mode
        self._selection, self.world = selection, selection.world
        self._stage = Stage(self.world, num_envs, approved(whole, "threads", threads, 1))
        self.single_action_space, self.single_observation_space = spaces
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._shape = self.action_space.shape or ()
        self._door = Doorkeeper(self._shape[1])
        self._longest = np.inf if max_episode_steps is None else max_episode_steps
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._begun = False
        self._numbers = np.zeros(num_envs, dtype=np.int64)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=bool)
        self._searches: list[S | None] = [None] * num_envs
        self._truths = np.empty((num_envs, ANGLES))

    @property
    def search_spaces(self) -> list[SearchSpace]:
        """The space that each environment searches. Raises gymnasium.error.ResetNeeded before the first reset."""
        return [search.space for search in self._current()]

    def render(self) -> Any:
        """Return a tuple of pictures (height, width, 3), one an environment, where `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        return tuple(self._portrait(i, search) for i, search in enumerate(self._current()))

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, Infos]:
        """Begin with an instance each; `options={"instance": 17}` chooses one for all, [17, 18, ...] one for each.

        The option "reset_mask" says which environments begin; the others go on.
        """
        seeds, mask = seeds_of(seed, self.num_envs), mask_of(options, self.num_envs, self._begun)
        numbers = chosen_instances(options, self.num_envs)
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._generators[i] = seeding.np_random(seeds[i])[0]
            self._renew(i, numbers[i])
        self._begun = True
        observations, infos = self._opened(mask)
        return observations, masked(mask, infos)

    def _renew(self, i: int, chosen: int | None) -> None:
        """Begin one environment's next episode, with an instance that is chosen or None."""
        number = self._selection.number({"instance": chosen}, lambda: self._generator(i))
        self._begin(i, number)
        self._numbers[i], self._steps[i], self._ended[i] = number, 0, False

    def _renew_ended(self) -> Flags:
        """Begin the next episodes where one has ended; return which environments (n,) step, the others."""
        self._current()
        stepping = ~self._ended
        for i in np.flatnonzero(self._ended).tolist():
            self._renew(i, None)
        self._steps += stepping
        return stepping

    def _current(self) -> list[S]:
        searches = [search for search in self._searches if search is not None]
        if len(searches) < self.num_envs:
            raise error.ResetNeeded("reset must come before anything else")
        return searches

    def _put(self, i: int, episode: Episode) -> None:
        """Make an episode what environment i sees, and what its errors are told against."""
        self._stage.put(i, episode.scenery, episode.space)
        self._truths[i] = episode.instance.truth.poses[0]

    def _ends(self, stepping: Flags, terminated: Flags, cut: Flags | bool = False) -> Flags:
        """Note whose episode has ended; return whose is cut (n,).

        The time limit of Gymnasium cuts an episode that ends by itself, too.
        """
        truncated = stepping & ((self._steps >= self._longest) | cut)
        self._ended = terminated | truncated
        return truncated

    def _standings(self, best: Array, evaluations: NDArray[np.int64], poses: Callable[[], Array]) -> Infos:
        """Return what is said of all searches; `poses` gives the poses (n, 66) whose errors are told, if any are."""
        infos: Infos = {"best_cost": best, "evaluations": evaluations, "instance": self._numbers.copy()}
        if self._selection.errors:
            infos["error_degrees"] = pose_error_degrees(self._truths, poses())
        return infos

    def _generator(self, i: int) -> np.random.Generator:
        mine = self._generators[i]
        if mine is None:
            mine = self._generators[i] = seeding.np_random(None)[0]
        return mine

    @abstractmethod
    def _begin(self, i: int, number: int) -> None:
        """Make environment i begin with an instance."""

    @abstractmethod
    def _opened(self, begun: Flags) -> tuple[Any, Infos]:
        """Return observations (n, ...) after a reset of some environments, and what is said of those by name."""

    @abstractmethod
    def _portrait(self, i: int, search: S) -> Picture:
        """Return the picture of environment i and its search."""


def masked(mask: Flags, values: Infos, others: Infos | None = None) -> Infos:
    """Return infos as Gymnasium has them: `values` where the mask (n,) is true, zeros elsewhere, and the masks.

    Where it is false there are `others`, of the same names or fewer. A name that nobody has is left out.
    """
    everyone, nobody = bool(mask.all()), not mask.any()
    infos: Infos = {}
    for name, value in values.items():
        if others and name in others:
            infos[name] = value if everyone else np.where(mask, value, others[name])
            infos[f"_{name}"] = np.ones(len(mask), dtype=bool)
        elif not nobody:
            shape = (-1, *[1] * (value.ndim - 1))
            infos[name] = value if everyone else np.where(mask.reshape(shape), value, np.zeros_like(value))
            infos[f"_{name}"] = mask.copy()
    return infos


def seeds_of(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """Return a seed for each environment: s gives s, s + 1, ... Raises gymnasium.error.Error where they are too few."""
    if seed is None:
        return [None] * count
    if isinstance(seed, int | np.integer):
        return [int(seed) + i for i in range(count)]
    if len(seed) != count:
        raise error.Error(f"seed must be one number or {count}, got {len(seed)}")
    return list(seed)


def chosen_instances(options: Mapping[str, Any] | None, count: int) -> list[int | None]:
    """Return the instance that a reset's options choose for each environment: one number is all's, None is no choice.

    Raises ArgumentError where there are too few or too many, or where there is none of such a number.
    """
    chosen = options.get("instance") if options else None
    if chosen is None:
        return [None] * count
    if isinstance(chosen, int | np.integer) or not isinstance(chosen, Sequence | np.ndarray) or isinstance(chosen, str):
        return [instance_number(chosen)] * count
    if (isinstance(chosen, np.ndarray) and chosen.ndim != 1) or len(chosen) != count:
        raise ArgumentError(f"instance must be one number or {count}, one for each environment, got {quoted(chosen)}")
    return [instance_number(one) for one in chosen]


def mask_of(options: Mapping[str, Any] | None, count: int, begun: bool) -> Flags:
    """Return which environments (count,) a reset is for: all, or those of the option "reset_mask".

    Raises gymnasium.error.Error where the mask does not fit, gymnasium.error.ResetNeeded where the others have not
    `begun`.
    """
    if not options or options.get("reset_mask") is None:
        return np.ones(count, dtype=bool)
    mask = np.asarray(options["reset_mask"])
    if mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
        raise error.Error(f"reset_mask must be {count} booleans, at least one of them true, got {mask!r}")
    if not begun and not mask.all():
        raise error.ResetNeeded("the first reset must be of all environments")
    return mask
