"""Base classes: searches side by side, a single environment as a vector of one, checked actions, scales."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from gymnasium import Env, Space, error, logger
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from posefit import Problem
from posefit.arrays import Array
from posefit.fitting.check import one_of, whole
from posefit.fitting.dlpack import as_numpy
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES
from posefit.reading import quoted, suggestion
from posefit_envs.instance import (
    ArgumentError,
    Episode,
    Instance,
    World,
    checked,
    instance_number,
    world_of,
)
from posefit_envs.rendering import MODES, Picture, check_mode
from posefit_envs.stage import Rows, Stage, values_of

Flags = NDArray[np.bool_]  # (n,)
Infos = dict[str, Any]
Number = TypeVar("Number", float, Array)

LOG_HIGHEST_COST = np.log1p(100.0)
NOT_BEGUN = "reset must come before anything else"
_ONE = np.ones(1, dtype=bool)
_NONE = np.zeros(1, dtype=bool)
_FIRST = np.zeros(1, dtype=np.int64)
ENDED = "the episode has ended: reset before the next step"


class Outcome(NamedTuple):
    """The results of one step of n environments; rows of those that reset in this step need not mean anything."""

    observations: NDArray[Any]  # (n, ...)
    rewards: Array  # (n,)
    terminated: Flags
    infos: Infos  # (n, ...) by name
    reset_infos: Infos  # those that a reset gives too
    truncated: Flags = _NONE  # (n,) or (1,), by a budget of the environment's own
    row_infos: Mapping[int, Infos] = {}  # further ones of some rows

    def infos_of(self, i: int) -> Infos:
        """Return the infos of environment i, as a single one has them."""
        return _infos_of(self.infos, i) | self.row_infos.get(i, {})


class SearchVectorEnv(VectorEnv[Any, Any, Any], ABC):
    """`num_envs` environments side by side: a proposal in each is one compiled call, whatever their instances.

    The arguments are those of the single environment, and `threads`, the number that draw, which changes nothing but
    the time. Seeded with s, environment i does what a single one does that is seeded with s + i. `autoreset_mode` is
    Gymnasium's `AutoresetMode`: by NEXT_STEP the step after an episode's last one resets, by SAME_STEP the last one
    does, whose own observation and infos are then the infos `final_obs` and `final_info`.
    """

    metadata = {  # noqa: RUF012, as Gymnasium has it
        "render_modes": list(MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int,
        spaces: Callable[[World], tuple[Box, Space[Any]]],
        *,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        checked(whole, "num_envs", num_envs, 1)
        parameters = inspect.signature(type(self)).parameters.values()
        self.world = world_of(
            [each.name for each in parameters if each.kind is each.KEYWORD_ONLY],
            **arguments,
        )
        checked(lambda: self.world.learned)  # names motions and priors that are unknown
        check_mode(render_mode)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        checked(
            one_of,
            "autoreset_mode",
            mode,
            [AutoresetMode.NEXT_STEP.value, AutoresetMode.SAME_STEP.value],
        )
        self._same_step = mode == AutoresetMode.SAME_STEP.value
        self.metadata = {**self.metadata, "autoreset_mode": AutoresetMode(mode)}
        self.num_envs = num_envs
        self.render_mode = render_mode
        self._stage = Stage(self.world, num_envs, checked(whole, "threads", threads, 1))
        self.single_action_space, self.single_observation_space = spaces(self.world)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._shape = self.action_space.shape or ()
        self._warned = False  # that an action is clipped
        self._longest = np.inf if max_episode_steps is None else max_episode_steps
        # with their seeds
        self._generators: dict[int, tuple[np.random.Generator, int]] = {}
        self._ended = np.zeros(num_envs, dtype=bool)
        self._numbers = np.zeros(num_envs, dtype=np.int64)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        # those that nobody asked for are not made
        self._episodes: dict[int, Episode | partial[Episode]] = {}
        self._truths = np.empty((num_envs, ANGLES))

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random generator of each environment."""
        return tuple(self._generator(i) for i in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment's generator."""
        assert self.np_random
        return tuple(self._generators[i][1] for i in range(self.num_envs))

    @property
    def episodes(self) -> list[Episode]:
        """What each environment searches. Raises gymnasium.error.ResetNeeded before the first reset."""
        self._check_reset()
        return [self._episode(i) for i in range(self.num_envs)]

    @property
    def problems(self) -> list[Problem]:
        """The problem of each environment's proposals. Raises gymnasium.error.ResetNeeded before the first reset."""
        return [episode.problem for episode in self.episodes]

    def render(self) -> Any:
        """Return a tuple of pictures (height, width, 3), one an environment, where `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        return tuple(
            self._render_row(i, episode) for i, episode in enumerate(self.episodes)
        )

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, Infos]:
        """Begin with an instance each; `options={"instance": 17}` chooses one for all, [17, 18, ...] one for each.

        The option "reset_mask" selects the environments that begin; the others go on.
        """
        check_options(options, ("instance", "reset_mask"))
        running = len(self._episodes) == self.num_envs
        seeds = _seeds(seed, self.num_envs)
        mask = _reset_mask(options, self.num_envs, running)
        numbers = _chosen_instances(options, self.num_envs)
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._generators[i] = seeding.np_random(seeds[i])
            self._begin(i, numbers[i])
        observations, infos = self._opened(mask)
        return observations, self._with_started(_masked_infos(mask, infos, {}), mask)

    def step(self, actions: Any) -> tuple[Any, Array, Flags, Flags, Infos]:
        """Step each environment; one whose episode has ended resets instead, or at once by SAME_STEP."""
        actions = self._checked(actions, self._shape)
        self._check_reset()
        stepping = ~self._ended
        for i in np.flatnonzero(self._ended).tolist():
            self._begin(i, None)
        self._steps += stepping
        outcome = self._advance(actions, stepping, np.flatnonzero(stepping))
        # the time limit of Gymnasium cuts an episode that ends by itself, too
        truncated = stepping & (outcome.truncated | (self._steps >= self._longest))
        ended = outcome.terminated | truncated
        observations = outcome.observations
        going = stepping
        begun_infos = outcome.reset_infos
        final: Infos = {}
        if self._same_step and ended.any():
            going = ~ended
            for i in np.flatnonzero(ended).tolist():
                last = {
                    "final_obs": observations[i].copy(),
                    "final_info": outcome.infos_of(i),
                }
                final = self._add_info(final, last, i)
                self._begin(i, None)
            fresh, begun_infos = self._opened(ended)
            observations = mixed(ended, fresh, observations)
        else:
            self._ended = ended
        infos = _masked_infos(going, outcome.infos, begun_infos) | final
        for i, row in outcome.row_infos.items():
            if going[i]:
                infos = self._add_info(infos, row, i)
        rewards = np.where(stepping, outcome.rewards, 0.0)
        return (
            observations,
            rewards,
            outcome.terminated,
            truncated,
            self._with_started(infos, ~going),
        )

    def _checked(self, actions: object, shape: tuple[int, ...]) -> Array:
        """Return actions of that shape as float64, which does not round them; what is not in [-1, 1] is clipped.

        Raises gymnasium.error.InvalidAction where they have another shape, or are not finite numbers.
        """
        try:
            values = np.array(as_numpy("actions", actions)[0], dtype=np.float64)
        except (TypeError, ValueError) as mistake:
            raise error.InvalidAction(
                f"an action must be {shape[-1]} numbers, got {actions!r}"
            ) from mistake
        if values.shape != shape:
            raise error.InvalidAction(
                f"actions must have shape {shape}, got {values.shape}"
            )
        largest = np.abs(values).max(initial=0.0)
        if not np.isfinite(largest):
            raise error.InvalidAction("actions must be finite, got nan or infinity")
        if largest > 1.0 and not self._warned:
            logger.warn(
                f"actions must lie in [-1, 1], got {largest:.6g} from 0; it is clipped, as all others will be"
            )
            self._warned = True
        return np.clip(values, -1.0, 1.0, out=values) if largest > 1.0 else values

    def _begin(self, i: int, chosen: int | None) -> None:
        """Begin the next episode of environment i, with a chosen instance or another."""
        number = (
            self.world.next_instance(self._generator(i)) if chosen is None else chosen
        )
        self._numbers[i], self._steps[i], self._ended[i] = number, 0, False
        self._begin_search(i, number)

    def _generator(self, i: int) -> np.random.Generator:
        if i not in self._generators:
            self._generators[i] = seeding.np_random(None)
        return self._generators[i][0]

    def _check_reset(self) -> None:
        if len(self._episodes) < self.num_envs:
            raise error.ResetNeeded(NOT_BEGUN)

    def _episode(self, i: int) -> Episode:
        """Return what environment i searches."""
        episode = self._episodes[i]
        if isinstance(episode, partial):
            episode = self._episodes[i] = episode()
        return episode

    def _enter(self, i: int, episode: Episode) -> None:
        self._episodes[i] = episode
        self._stage.set_values(i, values_of(episode.problem))
        self._truths[i] = episode.instance.truth.poses[episode.frame]

    def _progress(
        self,
        best: Array,
        evaluations: NDArray[np.int64],
        poses: Array,
        **more: NDArray[Any],
    ) -> Infos:
        """Return the infos that all searches have, beside an environment's own; poses (n, 66) are compared."""
        infos = more | {
            "best_cost": best.copy(),
            "evaluations": evaluations.copy(),
            "instance": self._numbers.copy(),
        }
        if self.world.errors:
            infos["error_degrees"] = np.degrees(
                np.abs(wrapped(self._truths - poses))
            ).mean(axis=1)
        return infos

    def _with_started(self, infos: Infos, started: Flags) -> Infos:
        """Return infos with those that only the environments have whose episode has just started."""
        for i in np.flatnonzero(started).tolist():
            infos = self._add_info(infos, self._begun_infos(i), i)
        return infos

    def _begun_infos(self, i: int) -> Infos:
        """Return what only the first infos of an episode of environment i hold."""
        return {}

    @abstractmethod
    def _begin_search(self, i: int, number: int) -> None:
        """Make environment i begin with an instance."""

    @abstractmethod
    def _opened(self, started: Flags) -> tuple[Any, Infos]:
        """Return observations (n, ...) after a reset of some environments, and the infos (n, ...) of those by name."""

    @abstractmethod
    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        """Return the outcome of actions (n, ...) in [-1, 1].

        `rows` are the environments that step, where `stepping` (n,) is true; the others have just started.
        """

    @abstractmethod
    def _render_row(self, i: int, episode: Episode) -> Picture:
        """Return the picture of environment i."""


class SearchEnv(Env[Any, Any]):
    """A single environment: a vector of one, whose rows are taken out, and which does not reset by itself."""

    vector: ClassVar[type[SearchVectorEnv]]
    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012, as Gymnasium has it

    def __init__(self, *, render_mode: str | None = None, **arguments: Any) -> None:
        check_mode(render_mode)
        self.render_mode = render_mode
        self._vector = self.vector(1, **arguments)  # type: ignore[call-arg, arg-type]
        self.world = self._vector.world
        self.action_space = self._vector.single_action_space
        self.observation_space = self._vector.single_observation_space
        self._shape = self.action_space.shape or ()

    @property
    def instance(self) -> Instance:
        """The current instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._vector.episodes[0].instance

    @property
    def problem(self) -> Problem:
        """The problem that proposals are evaluated on. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._vector.episodes[0].problem

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, Infos]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        check_options(options, ("instance",))
        super().reset(seed=seed)
        self._vector._generators[0] = self.np_random, self.np_random_seed
        chosen = options.get("instance") if options else None
        self._vector._begin(0, None if chosen is None else instance_number(chosen))
        observations, infos = self._vector._opened(_ONE)
        return observations[0], _infos_of(infos, 0) | self._vector._begun_infos(0)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, Infos]:
        """Make one step. Raises gymnasium.error.ResetNeeded where the episode has ended."""
        vector = self._vector
        if not vector._episodes:
            raise error.ResetNeeded(NOT_BEGUN)
        if vector._ended[0]:
            raise error.ResetNeeded(ENDED)
        action = vector._checked(action, self._shape)
        vector._steps += 1
        outcome = vector._advance(action[None], _ONE, _FIRST)
        terminated = bool(outcome.terminated[0])
        truncated = bool(outcome.truncated[0])
        vector._ended[0] = terminated or truncated
        reward = float(outcome.rewards[0])
        infos = outcome.infos_of(0)
        return outcome.observations[0], reward, terminated, truncated, infos

    def render(self) -> Any:
        """Return the picture (height, width, 3) where `render_mode` is "rgb_array"."""
        return (
            None
            if self.render_mode is None
            else self._vector._render_row(0, self._vector.episodes[0])
        )


def image_spaces(world: World) -> tuple[Box, Box]:
    """Return the space of a world's proposals, and that of its pictures."""
    width, height = world.size
    return (
        Box(-1.0, 1.0, (world.dimensions,), np.float32),
        Box(0, 255, (height, width, 2 * len(world.view_degrees)), np.uint8),
    )


def mixed(mask: Flags, chosen: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
    """Return values (n, ...): those chosen where the mask (n,) is true, others elsewhere."""
    return np.where(mask.reshape(-1, *[1] * (chosen.ndim - 1)), chosen, others)


def _infos_of(infos: Infos, i: int) -> Infos:
    """Return the infos of environment i, of infos (n, ...) by name."""
    return {
        name: values[i].item() if values.ndim == 1 else values[i].copy()
        for name, values in infos.items()
    }


def check_options(options: Mapping[str, Any] | None, known: Sequence[str]) -> None:
    """Raise ArgumentError where a reset has an option that is not known."""
    for name in options or {}:
        if name not in known:
            came = f"{quoted(name)}{suggestion(str(name), known)}"
            raise ArgumentError(
                f"an option of reset must be one of {', '.join(known)}, got {came}"
            )


def _masked_infos(mask: Flags, values: Infos, others: Infos) -> Infos:
    """Return infos as Gymnasium has them: `values` where the mask (n,) is true, zeros elsewhere, and the masks.

    A name that `others` has too has those values where the mask is false.
    """
    everywhere = bool(mask.all())
    somewhere = bool(mask.any())
    infos: Infos = {}
    for name, value in values.items():
        if name not in others and not somewhere:
            continue
        infos[f"_{name}"] = np.ones_like(mask) if name in others else mask.copy()
        other = others.get(name, 0)
        if everywhere or other is value:
            infos[name] = value
        else:
            infos[name] = mixed(mask, value, other)
    return infos


def _seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """Return a seed for each environment: s gives s, s + 1, ... Raises gymnasium.error.Error for a wrong count."""
    if seed is None:
        return [None] * count
    if isinstance(seed, int | np.integer):
        return [int(seed) + i for i in range(count)]
    if len(seed) != count:
        raise error.Error(f"seed must be one number or {count}, got {len(seed)}")
    return list(seed)


def _chosen_instances(
    options: Mapping[str, Any] | None, count: int
) -> list[int | None]:
    """Return the instance that a reset's options choose for each environment, None where they choose none.

    One number is for all. Raises ArgumentError where the count is wrong, or there is no such instance.
    """
    chosen = options.get("instance") if options else None
    if chosen is None:
        return [None] * count
    if not isinstance(chosen, Sequence | np.ndarray) or isinstance(chosen, str):
        return [instance_number(chosen)] * count
    if (isinstance(chosen, np.ndarray) and chosen.ndim != 1) or len(chosen) != count:
        raise ArgumentError(
            f"instance must be one number or {count}, one for each environment, got {quoted(chosen)}"
        )
    return [instance_number(number) for number in chosen]


def _reset_mask(options: Mapping[str, Any] | None, count: int, running: bool) -> Flags:
    """Return which environments (count,) a reset is for: all, or those of the option "reset_mask".

    Raises gymnasium.error.Error where the mask does not fit, gymnasium.error.ResetNeeded where the others have not
    `running`.
    """
    if not options or options.get("reset_mask") is None:
        return np.ones(count, dtype=bool)
    mask = np.asarray(options["reset_mask"])
    if mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
        raise error.Error(
            f"reset_mask must be {count} booleans, at least one of them true, got {mask!r}"
        )
    if not running and not mask.all():
        raise error.ResetNeeded("the first reset must be of all environments")
    return mask


def log_cost(cost: Number) -> Number:
    """Return a cost of 0 to 100 on a logarithmic scale of 0 to 1: ln(1 + cost) / ln 101."""
    shown: Number = np.log1p(cost) / LOG_HIGHEST_COST
    return shown


def log_improvement(before: Array, after: Array) -> Array:
    """Return the rewards of best costs that fall: ln((1 + before) / (1 + after))."""
    return np.log1p(before) - np.log1p(after)
