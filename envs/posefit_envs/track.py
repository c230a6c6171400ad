"""Track-v0: a sequence of silhouettes, some proposals for each."""

from dataclasses import replace
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import error

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.check import whole
from posefit.fitting.tracker import Follower, Prediction
from posefit_envs.drawing import MODES, Screen, check_mode, portray
from posefit_envs.fit import action_shape, check_budget, spaces_of
from posefit_envs.instance import Arguments, Instance, World, approved, errors_in_degrees, instance, select
from posefit_envs.search import Doorkeeper, Evaluated, Image, Scenery, look, look_at

FRAMES = 20
EVALUATIONS = 100  # a frame


class TrackEnv(gym.Env[Image, Any]):
    """
    ## Description
    A person walks by, seen as a silhouette a frame. For each frame some poses may be proposed; the best of them is
    committed, the next silhouette appears, and the box of proposals moves on with the prediction, SAPSO (6).

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal, as in `Fit-v0`. The yaw, and a searched translation, are centred on the
    pose that was committed last.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, as in `Fit-v0`: the silhouette of the current frame, and that of
    the last proposal. The first picture of a frame shows the pose that was committed in the frame before.

    ## Rewards
    Minus the cost of the proposal, 0 to 100; SAPSO (4).

    ## Starting State
    The first frame of an instance, as in `Fit-v0`.

    ## Episode End
    Terminates when the last frame's pose is committed. It is never truncated.

    ## Information
    `cost`, `best_cost`, `evaluations` of the frame, `error_degrees` of the proposal, `areas` (views, 3), `frame`,
    `instance`. The step that commits a pose adds `committed_frame`, `committed_cost`, `committed_pose` (66,),
    `committed_error_degrees` and `committed_mpjpe_mm`; `frame` is then the next one. A reset gives `instance` and
    `frame`.

    ## Arguments
    As in `Fit-v0`, with `frames=20` and `evaluations_per_frame=100` instead of `target_cost` and `max_evaluations`.

    ## Version History
    - v0: first version. Before its release its instances changed: number n is now the motion, speed, phase and view of
      a sweep's instance n, and 0 the motion as it is. Results from before cannot be compared with later ones.
    """

    metadata = {"render_modes": list(MODES), "render_fps": 30}  # noqa: RUF012, as Gymnasium has it

    def __init__(
        self,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_budget(0.0, "evaluations_per_frame", evaluations_per_frame)
        check_mode(render_mode)
        approved(whole, "frames", frames, 1)
        self.render_mode = render_mode
        self._selection = select(**arguments)
        self.world = self._selection.world
        self._frames, self._most = int(frames), int(evaluations_per_frame)
        self.action_space, self.observation_space = spaces_of(self.world)  # type: ignore[assignment]
        self._shape = action_shape(self.world)
        self._door = Doorkeeper(self._shape[0])
        self._course: TrackEpisode | None = None
        self._screen = Screen(self.metadata["render_fps"])

    @property
    def search_space(self) -> SearchSpace:
        """The space of the current frame. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._current().space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Image, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        self._course = TrackEpisode(self.world, number, self._frames, self._most)
        if self.render_mode == "human":
            self.render()
        return self._course.scenery.picture, {"instance": number, "frame": 0}

    def step(self, action: Any) -> tuple[Image, float, bool, bool, dict[str, Any]]:
        """Propose a pose for the current frame."""
        course = self._current()
        if course.ended:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        proposal = self._door.proposals(action, self._shape)
        outcome = look(course.scenery, course.space, proposal[None])
        picture, info = course.take(proposal, outcome, 0)
        if self.render_mode == "human":
            self.render()
        return picture, -info["cost"], course.ended, False, info

    def render(self) -> Any:
        """Return the picture (height, width, 3), or show it, as `render_mode` asks."""
        if self.render_mode is None:
            return None
        course = self._current()
        picture = portray(course.scenery, course.pose, course.place, course.label)
        return picture if self.render_mode == "rgb_array" else self._screen.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _current(self) -> "TrackEpisode":
        if self._course is None:
            raise error.ResetNeeded("reset must come before anything else")
        return self._course


class TrackEpisode:
    """The state of one sequence that is followed."""

    def __init__(self, world: World, number: int, frames: int, evaluations: int) -> None:
        self.instance: Instance = instance(world, number, frames, evaluations)
        self._follower = Follower(self.instance.task, world.learned, Prediction())
        self._frames, self._most, self.frame, self.ended = frames, evaluations, 0, False
        self.pose: Array | None = None
        self.place: Array | None = None
        self.cost = np.inf
        self._enter()

    def _enter(self) -> None:
        """Begin with the current frame."""
        self.scenery = self.instance.scenery(self.frame)
        self.space = self._follower.space(self.instance.observations[self.frame])
        self.best_cost, self.evaluations = np.inf, 0
        self._best: tuple[Array, Array, Array] | None = None

    def take(self, proposal: Array, outcome: Evaluated, row: int) -> tuple[Image, dict[str, Any]]:
        """Remember a proposal's outcome; return the picture to observe and the information."""
        self.cost = float(outcome.costs[row])
        self.pose, self.place = outcome.poses[row], outcome.translations[row]
        self.evaluations += 1
        if self.cost < self.best_cost:
            self.best_cost, self._best = self.cost, (proposal.copy(), self.pose, self.place)
        info = {
            "cost": self.cost,
            "best_cost": self.best_cost,
            "evaluations": self.evaluations,
            "error_degrees": float(errors_in_degrees(self.instance.truth, self.frame, self.pose[None])[0]),
            "areas": outcome.areas[row].copy(),
            "instance": self.instance.number,
        }
        picture = outcome.pictures[row]
        if self.evaluations >= self._most:
            info |= self._commit()
            if not self.ended:
                assert self.pose is not None
                assert self.place is not None
                picture = paint_pose(self.scenery, self.space, self.pose, self.place)
        return picture, info | {"frame": self.frame}

    def _commit(self) -> dict[str, Any]:
        """Commit the best pose and go on to the next frame, if there is one."""
        assert self._best is not None
        proposal, self.pose, self.place = self._best
        truth, frame = self.instance.truth, self.frame
        skeleton = self.instance.task.body.skeleton
        ours = skeleton.joints(self.pose[None], np.asarray(self.place)[None])
        theirs = truth.skeleton.joints(truth.poses[frame][None], truth.translations[frame][None])
        info = {
            "committed_frame": frame,
            "committed_cost": self.best_cost,
            "committed_pose": self.pose.copy(),
            "committed_error_degrees": float(errors_in_degrees(truth, frame, self.pose[None])[0]),
            "committed_mpjpe_mm": float(metrics.mpjpe_mm(theirs, ours)[0]),
        }
        self._follower.commit(proposal)
        self.ended = frame + 1 >= self._frames
        if not self.ended:
            self.frame += 1
            self._enter()
        return info

    @property
    def label(self) -> str:
        """What is written into the picture."""
        if self.pose is None:
            return f"instance {self.instance.number}, frame {self.frame}"
        best = "" if np.isinf(self.best_cost) else f", best {self.best_cost:.1f}"
        return f"frame {self.frame}, cost {self.cost:.1f}{best}"


def paint_pose(scenery: Scenery, space: SearchSpace, pose: Array, place: Array) -> Image:
    """Return the picture (height, width, 2 views) of a frame with a pose that stays where it is."""
    still = scenery.problem(replace(space, translation="known", anchor=place))
    return np.array(look_at(scenery, still, pose[None], place[None]).pictures[0])
