"""What all environments share: arguments, actions, rewards, infos, episode ends."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from gymnasium import Env, error, logger
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from posefit import Problem, Problems
from posefit.arrays import Array
from posefit.fitting.check import one_of, whole
from posefit.fitting.dlpack import as_numpy
from posefit.geometry.rotation import wrapped
from posefit.reading import quoted, suggestion
from posefit_envs.rendering import MODES, Picture, check_mode
from posefit_envs.stage import Drawn, Rows, Stage
from posefit_envs.world import ArgumentError, Instance, World, checked, world_of

Flags = NDArray[np.bool_]  # (n,)
Infos = dict[str, Any]
Number = TypeVar("Number", float, Array)

LOG_HIGHEST_COST = np.log1p(100.0)
NOT_BEGUN = "reset must come before anything else"
ENDED = "the episode has ended: reset before the next step"


def image_spaces(world: World) -> tuple[Box, Box]:
    """Return the space of a world's proposals and the space of its pictures."""
    width, height = world.size
    views = len(world.view_degrees)
    return (
        Box(-1.0, 1.0, (world.dimensions,), np.float32),
        Box(0, 255, (height, width, 2 * views), np.uint8),
    )


def checked_world(env: object, arguments: Mapping[str, Any]) -> World:
    """Return the world that an environment's arguments describe.

    Keyword-only parameters of the class belong to the environment and are left out.
    Raises ArgumentError or TypeError if an argument is wrong.
    """
    parameters = inspect.signature(type(env)).parameters.values()
    own = [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]
    world = world_of(own, **arguments)
    # fitted now, so that an unknown motion or prior is reported before the first reset
    checked(lambda: world.learned)
    return world


def checked_actions(
    env: "SearchEnv | SearchVectorEnv", actions: object, shape: tuple[int, ...]
) -> Array:
    """Return actions of that shape as float64, without rounding.

    Values outside [-1, 1] are clipped, and the environment warns about it once.

    Raises:
        gymnasium.error.InvalidAction: If the shape is wrong, or a value is not a finite
            number.
    """
    try:
        given = np.asarray(as_numpy("actions", actions)[0])
        if given.dtype.kind == "c":
            raise TypeError("complex numbers")
        # not to float32: the costs would differ from the library's in the last digits
        values = np.array(given, dtype=np.float64)
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
    if largest <= 1.0:
        return values
    if not env.warned:
        logger.warn(
            "actions must lie in [-1, 1], "
            f"got one of size {largest:.6g}: actions are clipped from now on"
        )
        env.warned = True
    return np.clip(values, -1.0, 1.0, out=values)


def reward_of_cost(cost: Number) -> Number:
    """Return the reward of a proposal: -ln(1 + cost)."""
    reward: Number = -np.log1p(cost)
    return reward


def log_cost(cost: Number) -> Number:
    """Return ln(1 + cost) / ln 101: a cost of 0 to 100 on a scale of 0 to 1."""
    shown: Number = np.log1p(cost) / LOG_HIGHEST_COST
    return shown


def log_improvement(before: Number, after: Number) -> Number:
    """Return ln((1 + before) / (1 + after)), the reward of an improved best cost."""
    fall: Number = np.log1p(before) - np.log1p(after)
    return fall


def error_degrees(truth: Array, pose: Array) -> Any:
    """Return the mean error of poses (..., 66) from the truth (...), in degrees."""
    return np.degrees(np.abs(wrapped(truth - pose))).mean(axis=-1)


def proposal_infos(stage: Stage, drawn: Drawn, shows_truth: bool) -> Infos:
    """Return the infos (n, ...) of evaluated proposals by name."""
    infos: Infos = {"cost": drawn.costs.copy(), "areas": drawn.areas}
    if shows_truth:
        infos["error_degrees"] = error_degrees(stage.truths, drawn.poses)
    return infos


def infos_before(stage: Stage, shows_truth: bool) -> Infos:
    """Return the infos (n, ...) of `proposal_infos` before the first proposal.

    Cost and error are infinite, and every pixel of the silhouettes is missed.
    """
    totals = stage.totals
    nothing = np.full(len(totals), np.inf)
    areas = np.zeros((*totals.shape, 3), dtype=np.int64)
    areas[..., 0] = totals
    infos: Infos = {"cost": nothing, "areas": areas}
    if shows_truth:
        infos["error_degrees"] = nothing.copy()
    return infos


def checked_options(
    options: Mapping[str, Any] | None, known: Sequence[str]
) -> Mapping[str, Any]:
    """Return a reset's options. Raises ArgumentError if a name is unknown."""
    for name in options or {}:
        if name not in known:
            came = f"{quoted(name)}{suggestion(str(name), known)}"
            raise ArgumentError(
                f"an option of reset must be one of {', '.join(known)}, got {came}"
            )
    return options or {}


class SearchEnv(Env[Any, Any], ABC):
    """A single environment. Each episode is one instance of its world."""

    # a plain dictionary, as Gymnasium declares it
    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012
    action_space: Box

    def __init__(self, render_mode: str | None, arguments: Mapping[str, Any]) -> None:
        check_mode(render_mode)
        self.render_mode = render_mode
        self.world = checked_world(self, arguments)
        # whether the user has been warned that actions are clipped
        self.warned = False
        # the number of the instance; None before the first reset
        self.number: int | None = None
        self.ended = False
        self._problem: Problem | None = None

    @property
    def problem(self) -> Problem:
        """The problem that counts the steps' evaluations.

        Raises gymnasium.error.ResetNeeded before the first reset.
        """
        self.check_reset()
        assert self._problem is not None
        return self._problem

    @property
    def instance(self) -> Instance:
        """The episode's instance. Raises ResetNeeded before the first reset."""
        instance: Instance = self.problem.instance
        return instance

    def __getstate__(self) -> dict[str, Any]:
        """Return the state, with the problem as a plain dictionary.

        A Problem cannot be pickled alone, because its count of evaluations would be
        lost. Here the whole environment is pickled, and with it the count.
        """
        return {**vars(self), "_problem": self._problem and vars(self._problem)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        if self._problem is not None:
            self._problem = object.__new__(Problem)
            vars(self._problem).update(state["_problem"])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, Infos]:
        """Begin an episode; `options={"instance": 17}` chooses the instance."""
        chosen = checked_options(options, ("instance",)).get("instance")
        super().reset(seed=seed)
        if chosen is None:
            self.number = self.world.next_instance(self.np_random)
        else:
            self.number = self.world.numbered(chosen)
        self.ended = False
        return self.begin(self.number)

    def checked_action(self, action: object) -> Array:
        """Return an action as float64. Raises ResetNeeded if the episode has ended."""
        self.check_reset()
        if self.ended:
            raise error.ResetNeeded(ENDED)
        return checked_actions(self, action, self.action_space.shape)

    def check_reset(self) -> None:
        """Raise gymnasium.error.ResetNeeded before the first reset."""
        if self.number is None:
            raise error.ResetNeeded(NOT_BEGUN)

    def render(self) -> Any:
        """Return the picture (height, width, 3), or None without a render mode."""
        if self.render_mode is None:
            return None
        self.check_reset()
        return self.picture()

    @abstractmethod
    def begin(self, number: int) -> tuple[Any, Infos]:
        """Begin an episode with an instance: return its first observation and infos."""

    @abstractmethod
    def picture(self) -> Picture:
        """Return the picture of the latest proposal."""


class SearchVectorEnv(VectorEnv[Any, Any, Any], ABC):
    """`num_envs` environments side by side, evaluated in one compiled call.

    The arguments are those of the single environment, and `threads`: the number of
    rasterising threads, which changes only the time. Seeded with s, environment i
    behaves like a single one seeded with s + i.

    `autoreset_mode` is Gymnasium's `AutoresetMode`:

    - NEXT_STEP: the step after an episode's last step resets.
    - SAME_STEP: the last step resets. The episode's last observation and infos are in
      the infos `final_obs` and `final_info`.
    - DISABLED: the caller resets, with the option "reset_mask".
    """

    # a plain dictionary, as Gymnasium declares it
    metadata = {  # noqa: RUF012
        "render_modes": list(MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    single_action_space: Box
    _problems: Problems

    def __init__(
        self,
        num_envs: int,
        *,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        self.world = checked_world(self, arguments)
        check_mode(render_mode)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        checked(one_of, "autoreset_mode", mode, [each.value for each in AutoresetMode])
        self.autoreset_mode = AutoresetMode(mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.num_envs = checked(whole, "num_envs", num_envs, 1)
        self.threads = checked(whole, "threads", threads, 1)
        self.render_mode = render_mode
        # whether the user has been warned that actions are clipped
        self.warned = False
        self.steps = np.zeros(num_envs, dtype=np.int64)  # taken in each episode
        self.ended = np.zeros(num_envs, dtype=bool)
        self._longest = np.inf
        if max_episode_steps is not None:
            self._longest = checked(whole, "max_episode_steps", max_episode_steps, 1)
        # random generators with their seeds, made when first used
        self._generators: dict[int, tuple[np.random.Generator, int]] = {}
        # the number of each instance; -1 before the first reset
        self.numbers = np.full(num_envs, -1)
        # attributes that a user has added, by their names: a value for each environment
        self._own: dict[str, tuple[Any, ...]] = {}

    def set_spaces(self, action_space: Box, observation_space: Box) -> None:
        """Set the spaces of one environment, and the batched spaces of all."""
        self.single_action_space = action_space
        self.single_observation_space = observation_space
        self.action_space = batch_space(action_space, self.num_envs)
        self.observation_space = batch_space(observation_space, self.num_envs)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random generator of each environment."""
        return tuple(self.generator(i) for i in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment's generator."""
        assert self.np_random
        return tuple(self._generators[i][1] for i in range(self.num_envs))

    def generator(self, i: int) -> np.random.Generator:
        """Return the random generator of environment i."""
        # not in __init__: seeding takes longer than a step, and reset may bring seeds
        if i not in self._generators:
            self._generators[i] = seeding.np_random(None)
        return self._generators[i][0]

    def check_reset(self) -> None:
        """Raise gymnasium.error.ResetNeeded before the first reset."""
        if (self.numbers < 0).any():
            raise error.ResetNeeded(NOT_BEGUN)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, Infos]:
        """Begin episodes; `options={"instance": 17}` chooses one instance for all.

        A list, [17, 18, ...], chooses one for each environment. The option "reset_mask"
        selects the environments that begin; the others continue, and their observations
        stay the same.
        """
        options = dict(checked_options(options, ("instance", "reset_mask")))
        mask = checked_mask(options.get("reset_mask"), self.num_envs)
        if not mask.all() and (self.numbers < 0).any():
            raise error.ResetNeeded("the first reset must be of all environments")
        # check everything before any episode begins, so that an error changes nothing
        seeds = _seeds(seed, self.num_envs)
        numbers = self._instances(options.get("instance"))
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._generators[i] = seeding.np_random(seeds[i])
        self.restart(mask, numbers)
        observations = self.observe(np.arange(self.num_envs))
        return observations, masked_infos(mask, self.reset_infos(), {})

    def _instances(self, chosen: Any) -> list[int | None]:
        """Return the instance of each environment, or None to draw one.

        One number applies to all. Raises ArgumentError if the count is wrong, or an
        instance does not exist or is of the other split.
        """
        count = self.num_envs
        if chosen is None:
            return [None] * count
        if not isinstance(chosen, Sequence | np.ndarray) or isinstance(chosen, str):
            return [self.world.numbered(chosen)] * count
        if np.ndim(chosen) != 1 or len(chosen) != count:
            raise ArgumentError(
                f"instance must be one number or {count}, one for each environment, "
                f"got {quoted(chosen)}"
            )
        return [self.world.numbered(number) for number in chosen]

    def restart(self, mask: Flags, numbers: Sequence[int | None] | None = None) -> None:
        """Begin episodes in some environments, with chosen or random instances."""
        for i in np.flatnonzero(mask).tolist():
            number = None if numbers is None else numbers[i]
            if number is None:
                number = self.world.next_instance(self.generator(i))
            self.numbers[i] = number
        self.steps[mask] = 0
        self.ended[mask] = False
        self.begin(np.flatnonzero(mask))

    def begin_step(self, actions: Any) -> tuple[Array, Flags]:
        """Return the actions as float64, and which environments (n,) step.

        The episodes of the other environments have ended. Under NEXT_STEP these
        environments begin new episodes instead.
        """
        proposals = checked_actions(self, actions, self.action_space.shape or ())
        self.check_reset()
        stepping = ~self.ended
        if self.ended.any():
            if self.autoreset_mode is AutoresetMode.DISABLED:
                raise error.ResetNeeded(
                    f'{ENDED}, with the option "reset_mask"; ended environments: '
                    f"{np.flatnonzero(self.ended).tolist()}"
                )
            self.restart(self.ended.copy())
        self.steps += stepping
        return proposals, stepping

    def end_step(
        self,
        stepping: Flags,
        observations: NDArray[Any],
        rewards: Array,
        terminated: Flags,
        infos: Infos,
    ) -> tuple[Any, Array, Flags, Flags, Infos]:
        """Return what a step returns.

        Environments that began an episode instead of stepping have the infos of a
        reset. Under SAME_STEP, environments whose episode has ended begin again at
        once.

        Args:
            stepping: Which environments (n,) stepped.
            observations: Observations (n, ...) after the step.
            rewards: Rewards (n,).
            terminated: Which episodes have used up their proposals. Only the time limit
                of Gymnasium truncates.
            infos: Infos (n, ...) by name.
        """
        terminated = stepping & terminated
        truncated = stepping & (self.steps >= self._longest)
        self.ended = terminated | truncated
        # a row has the infos of its step, unless a reset replaced it (NEXT_STEP) or
        # followed it (SAME_STEP): then it has the infos of the reset
        has_step_infos = stepping
        begun_infos: Infos = self.reset_infos() if not stepping.all() else {}
        final: Infos = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self.ended.any():
            ended = self.ended.copy()
            has_step_infos = ~ended
            for i in np.flatnonzero(ended).tolist():
                last_infos = row_of(infos, i)
                last = {"final_obs": observations[i].copy(), "final_info": last_infos}
                final = self._add_info(final, last, i)
            self.restart(ended)
            observations[ended] = self.observe(np.flatnonzero(ended))
            begun_infos = self.reset_infos()
        step_infos = masked_infos(has_step_infos, infos, begun_infos) | final
        # Gymnasium's vectors give a reset the reward 0
        rewards = np.where(stepping, rewards, 0.0)
        return observations, rewards, terminated, truncated, step_infos

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each environment, as Gymnasium's vectors do."""
        if name in ("action_space", "observation_space"):
            return (getattr(self, f"single_{name}"),) * self.num_envs
        if name == "np_random_seed":
            return self.np_random_seed
        if name == "np_random":
            return self.np_random
        if name in self._own:
            return self._own[name]
        if name in self.row_attributes:
            return tuple(self.row_attribute(name, i) for i in range(self.num_envs))
        return (getattr(self, name),) * self.num_envs

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return a method's result, or an attribute, once for each environment."""
        if name == "render":
            return self.render() or (None,) * self.num_envs
        method = getattr(self, name, None)
        if callable(method):
            return (method(*args, **kwargs),) * self.num_envs
        return self.get_attr(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each environment, as Gymnasium's own vectors do.

        Args:
            name: Any name. An attribute that all environments share, such as `world`,
                stays shared.
            values: A list or a tuple with a value for each environment, or one value
                for all.

        Raises:
            gymnasium.error.Error: If the number of values is wrong, values of a shared
                attribute differ, or `reset` sets the attribute, such as `number`.
        """
        if not isinstance(values, list | tuple):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            raise error.Error(
                f"values must be one for each of the {self.num_envs} environments, "
                f"got {len(values)}"
            )
        if name in self.row_attributes:
            raise error.Error(f"{name} must be set by the options of reset")
        # a new attribute, such as a user's label, may differ between environments
        if name in self._own or not hasattr(self, name):
            self._own[name] = tuple(values)
            return
        first, *others = values
        for other in others:
            if not np.array_equal(first, other):
                raise error.Error(
                    f"{name} must be the same in all environments, got different values"
                )
        setattr(self, name, first)

    # attributes that differ between the environments
    row_attributes: tuple[str, ...] = ("instance", "number", "problem")

    def row_attribute(self, name: str, i: int) -> Any:
        """Return an attribute of environment i."""
        self.check_reset()
        if name == "number":
            return int(self.numbers[i])
        problem = self.problems[i]
        return problem if name == "problem" else getattr(problem, name)

    @property
    def problems(self) -> Problems:
        """The problems that count the steps' evaluations.

        Raises gymnasium.error.ResetNeeded before the first reset.
        """
        self.check_reset()
        return self._problems

    @abstractmethod
    def begin(self, rows: Rows) -> None:
        """Begin episodes in some environments, with the instances of `numbers`."""

    @abstractmethod
    def observe(self, rows: Rows) -> NDArray[Any]:
        """Return the current observations (m, ...) of some environments."""

    @abstractmethod
    def reset_infos(self) -> Infos:
        """Return the infos (n, ...) of a reset, by name."""

    @abstractmethod
    def picture(self, i: int) -> Picture:
        """Return the picture of the latest proposal in environment i."""

    def render(self) -> Any:
        """Return a picture (height, width, 3) for each environment.

        Return None without a render mode.
        """
        if self.render_mode is None:
            return None
        self.check_reset()
        return tuple(self.picture(i) for i in range(self.num_envs))


def row_of(infos: Infos, i: int) -> Infos:
    """Return the infos of environment i from infos (n, ...) by name."""
    row = {}
    for name, values in infos.items():
        row[name] = values[i].item() if values.ndim == 1 else values[i].copy()
    return row


def mixed(mask: Flags, chosen: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
    """Return values (n, ...): `chosen` where the mask (n,) is true, else `others`."""
    return np.where(mask.reshape(-1, *[1] * (chosen.ndim - 1)), chosen, others)


def masked_infos(mask: Flags, values: Infos, others: Infos) -> Infos:
    """Return infos in Gymnasium's form: values by name, with a mask for each name.

    A value is from `values` where the mask (n,) is true. Elsewhere it is from `others`,
    or zero if `others` lacks the name.
    """
    everywhere = bool(mask.all())
    somewhere = bool(mask.any())
    infos: Infos = {}
    for name, value in values.items():
        if name not in others and not somewhere:
            continue
        infos[f"_{name}"] = np.ones_like(mask) if name in others else mask.copy()
        if everywhere:
            infos[name] = value
        else:
            other = others.get(name, np.zeros_like(value))
            infos[name] = mixed(mask, value, other)
    return infos


def checked_mask(mask: Any, count: int) -> Flags:
    """Return the option "reset_mask" (count,), or True for all environments.

    Raises:
        TypeError: If it is not an array of booleans.
        ValueError: If its shape is wrong, or it selects no environment.
    """
    if mask is None:
        return np.ones(count, dtype=bool)
    if not isinstance(mask, np.ndarray):
        raise TypeError(
            f"`options['reset_mask']` must be a numpy array, got {type(mask)}"
        )
    if mask.shape != (count,):
        raise ArgumentError(
            f"`options['reset_mask']` must have shape `({count},)`, got {mask.shape}"
        )
    if mask.dtype != np.bool_:
        raise TypeError(
            f"`options['reset_mask']` must have `dtype=np.bool_`, got {mask.dtype}"
        )
    if not mask.any():
        raise ArgumentError(
            f"`options['reset_mask']` must contain at least one True, got {mask}"
        )
    return mask.copy()


def _seeds(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """Return a seed for each environment; one number s gives s, s + 1, ...

    Raises ArgumentError if a seed is not a whole number.
    """
    if seed is None:
        return [None] * count
    if not isinstance(seed, Sequence | np.ndarray) or isinstance(seed, str):
        first = checked(whole, "seed", seed, 0)
        return list(range(first, first + count))
    if len(seed) != count:
        raise ArgumentError(
            f"seed must be one number or {count} numbers, got {len(seed)}"
        )
    seeds: list[int | None] = []
    for each in seed:
        # None leaves the environment's generator as it is
        seeds.append(None if each is None else checked(whole, "seed", each, 0))
    return seeds
