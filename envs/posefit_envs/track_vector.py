"""Track-v0 for many environments at once: all that are in the same frame of the same instance are one kernel call."""

from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from gymnasium import error
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit_envs.batch import mask_of, seeds_of
from posefit_envs.drawing import MODES, check_mode, portray
from posefit_envs.fit import action_shape, check_budget, spaces_of
from posefit_envs.instance import Arguments, approved, select
from posefit_envs.search import Doorkeeper, Image, distinct, look_at
from posefit_envs.track import EVALUATIONS, FRAMES, TrackEpisode

Infos = dict[str, Any]


class TrackVectorEnv(VectorEnv[Image, Any, Array]):
    """`num_envs` environments as `posefit_envs.track.TrackEnv`, with the same arguments.

    Seeded with s, environment i does what a single one does that is seeded with s + i. The step after an episode's last
    one resets, as `AutoresetMode.NEXT_STEP` says.
    """

    metadata = {  # noqa: RUF012, as Gymnasium has it
        "render_modes": list(MODES),
        "render_fps": 30,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        approved(whole, "num_envs", num_envs, 1)
        check_budget(0.0, "evaluations_per_frame", evaluations_per_frame)
        check_mode(render_mode)
        if render_mode == "human":
            raise error.UnsupportedMode("render_mode must be rgb_array for a vector environment, got human")
        approved(whole, "frames", frames, 1)
        self.num_envs, self.render_mode = num_envs, render_mode
        self._selection = select(**arguments)
        self.world = self._selection.world
        self._frames, self._most, self._longest = int(frames), int(evaluations_per_frame), max_episode_steps
        self.single_action_space, self.single_observation_space = spaces_of(self.world)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._shape = (num_envs, *action_shape(self.world))
        self._door = Doorkeeper(self._shape[1])
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._courses: list[TrackEpisode] = []
        self._steps, self._ended = np.zeros(num_envs, dtype=np.int64), np.zeros(num_envs, dtype=bool)

    @property
    def search_spaces(self) -> list[SearchSpace]:
        """The space of each environment's frame. Raises gymnasium.error.ResetNeeded before the first reset."""
        return [course.space for course in self._current()]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Image, Infos]:
        """Begin with an instance each; `options={"instance": 17}` chooses one for all, "reset_mask" some to begin."""
        seeds, mask = seeds_of(seed, self.num_envs), mask_of(options, self.num_envs, bool(self._courses))
        if not self._courses:
            self._courses = [None] * self.num_envs  # type: ignore[list-item]
        infos: Infos = {}
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._generators[i] = seeding.np_random(seeds[i])[0]
            infos = self._add_info(infos, self._begin(i, options), i)
        return np.stack([course.scenery.picture for course in self._courses]), infos

    def step(self, actions: Any) -> tuple[Image, Array, Any, Any, Infos]:
        """Propose a pose in each environment; one whose episode has ended resets instead."""
        courses, n = self._current(), self.num_envs
        proposals = self._door.proposals(actions, self._shape)
        pictures = np.empty(self.observation_space.shape or (), dtype=np.uint8)
        rewards, terminated, truncated = np.zeros(n), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        given: list[dict[str, Any]] = [{} for _ in range(n)]
        for i in np.flatnonzero(self._ended).tolist():
            given[i] = self._begin(i, None)
            pictures[i] = self._courses[i].scenery.picture
        stepping = [i for i in range(n) if not given[i]]
        for group in distinct([course.scenery for course in courses], stepping).values():
            decoded = [courses[i].space.decode(proposals[i : i + 1]) for i in group]
            poses, places = (np.concatenate(parts) for parts in zip(*decoded, strict=True))
            first = courses[group[0]]
            outcome = look_at(first.scenery, first.scenery.problem(first.space), poses, places)
            for row, i in enumerate(group):
                pictures[i], given[i] = courses[i].take(proposals[i], outcome, row)
                self._steps[i] += 1
                rewards[i], terminated[i] = -given[i]["cost"], courses[i].ended
                truncated[i] = self._longest is not None and not terminated[i] and self._steps[i] >= self._longest
        self._ended = terminated | truncated
        infos: Infos = {}
        for i, info in enumerate(given):
            infos = self._add_info(infos, info, i)
        return pictures, rewards, terminated, truncated, infos

    def _generator(self, i: int) -> np.random.Generator:
        mine = self._generators[i]
        if mine is None:
            mine = self._generators[i] = seeding.np_random(None)[0]
        return mine

    def _begin(self, i: int, options: Mapping[str, Any] | None) -> dict[str, Any]:
        number = self._selection.number(options, lambda: self._generator(i))
        self._courses[i] = TrackEpisode(self.world, number, self._frames, self._most)
        self._steps[i], self._ended[i] = 0, False
        return {"instance": number, "frame": 0}

    def render(self) -> Any:
        """Return a tuple of pictures (height, width, 3), one an environment, where `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        return tuple(portray(one.scenery, one.pose, one.place, one.label) for one in self._current())

    def _current(self) -> list[TrackEpisode]:
        if not self._courses:
            raise error.ResetNeeded("reset must come before anything else")
        return self._courses
