"""Track-v0: a sequence of silhouettes, some proposals for each."""

from typing import Any, Unpack

import numpy as np
from gymnasium import error

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.check import whole
from posefit.fitting.tracker import Follower, Prediction
from posefit_envs.base import SearchEnv
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import check_budget, spaces_of
from posefit_envs.instance import Arguments, Instance, World, approved, instance, select
from posefit_envs.search import Image
from posefit_envs.stage import Evaluated, Stage

FRAMES = 20
EVALUATIONS = 100  # a frame


class TrackEnv(SearchEnv["TrackEpisode"]):
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
    `cost`, `best_cost`, `evaluations` of the frame, `areas` (views, 3), `frame`, `instance`, and unless `errors=False`
    `error_degrees` of the proposal. The step that commits a pose adds `committed_frame`, `committed_cost`,
    `committed_pose` (66,), and unless `errors=False` `committed_error_degrees` and `committed_mpjpe_mm`; `frame` is
    then the next one. A reset gives `instance` and `frame`.

    ## Arguments
    As in `Fit-v0`, with `frames=20` and `evaluations_per_frame=100` instead of `target_cost` and `max_evaluations`.

    ## Version History
    - v0: first version. Before its release its instances changed: number n is now the motion, speed, phase and view of
      a sweep's instance n, and 0 the motion as it is. Results from before cannot be compared with later ones.
      `errors` came later, before its release as well, and changes nothing by default.
    """

    metadata = SearchEnv.metadata | {"render_fps": 30}

    def __init__(
        self,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_budget(0.0, "evaluations_per_frame", evaluations_per_frame)
        approved(whole, "frames", frames, 1)
        selection = select(**arguments)
        super().__init__(selection, spaces_of(selection.world), render_mode)
        self._frames, self._most = int(frames), int(evaluations_per_frame)
        self._stage = Stage(self.world, 1)

    @property
    def instance(self) -> Instance:
        """The instance of this episode. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._current().passage.instance

    @property
    def search_space(self) -> SearchSpace:
        """The space of the current frame. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self._current().passage.space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Image, dict[str, Any]]:
        """Begin with an instance; `options={"instance": 17}` chooses it."""
        super().reset(seed=seed)
        number = self._selection.number(options, lambda: self.np_random)
        passage = Passage(self.world, number, self._frames, self._most)
        self._search = TrackEpisode(passage, self._most, self._selection.errors)
        self._stage.put(0, passage.scenery, passage.space)
        self._show()
        return passage.scenery.picture, {"instance": number, "frame": 0}

    def step(self, action: Any) -> tuple[Image, float, bool, bool, dict[str, Any]]:
        """Propose a pose for the current frame."""
        episode, stage = self._current(), self._stage
        passage, frame = episode.passage, episode.passage.frame
        if passage.ended:
            raise error.ResetNeeded("the episode has ended: reset before the next step")
        proposal = self._door.proposals(action, self._shape)
        outcome = stage.look(proposal[None], stage.everyone)
        info = episode.take(proposal, outcome)
        if passage.frame != frame:
            assert episode.pose is not None
            assert episode.place is not None
            stage.put(0, passage.scenery, passage.space)
            stage.show(episode.pose[None], episode.place[None], stage.everyone, outcome.pictures)
        self._show()
        return outcome.pictures[0], -info["cost"], passage.ended, False, info

    def _portrait(self, search: "TrackEpisode") -> Picture:
        return portray(search.passage.scenery, search.pose, search.place, search.label)


class Passage:
    """A sequence that is followed, as far as it has come: the frame, its scenery, and the space of its pose."""

    def __init__(self, world: World, number: int, frames: int, evaluations: int) -> None:
        self.instance: Instance = instance(world, number, frames, evaluations)
        self._follower = Follower(self.instance.task, world.learned, Prediction(tilt="box"))
        self._frames, self.frame, self.ended = frames, 0, False
        self._enter()

    def _enter(self) -> None:
        """Begin with the current frame."""
        self.scenery = self.instance.scenery(self.frame)
        self.space = self._follower.space(self.instance.observations[self.frame])

    def commit(self, proposal: Array, pose: Array, place: Array, cost: float, errors: bool) -> dict[str, Any]:
        """Commit the best pose, go on to the next frame, if there is one, and return what is said of it."""
        info = committed(self.instance, self.frame, pose, place, cost, errors)
        self._follower.commit(proposal)
        self.ended = self.frame + 1 >= self._frames
        if not self.ended:
            self.frame += 1
            self._enter()
        return info


def committed(made: Instance, frame: int, pose: Array, place: Array, cost: float, errors: bool) -> dict[str, Any]:
    """Return what is said of the pose that is committed in a frame of an instance."""
    info = {"committed_frame": frame, "committed_cost": cost, "committed_pose": pose.copy()}
    if errors:
        ours = made.task.body.skeleton.joints(pose[None], place[None])
        info |= {f"committed_{name}": error for name, error in made.errors(frame, pose).items()}
        info["committed_mpjpe_mm"] = float(metrics.mpjpe_mm(made.joints[frame][None], ours)[0])
    return info


class TrackEpisode:
    """The state of one sequence that is followed."""

    def __init__(self, passage: Passage, evaluations: int, errors: bool) -> None:
        self.passage, self._most, self._errors = passage, evaluations, errors
        self.pose: Array | None = None
        self.place: Array | None = None
        self.cost = np.inf
        self._enter()

    def _enter(self) -> None:
        self.best_cost, self.evaluations = np.inf, 0
        self._best: tuple[Array, Array, Array] | None = None

    def take(self, proposal: Array, outcome: Evaluated) -> dict[str, Any]:
        """Remember a proposal's outcome and return its information; commit the best where the frame's budget ends."""
        passage = self.passage
        self.cost = float(outcome.costs[0])
        self.pose, self.place = outcome.poses[0], outcome.translations[0]
        self.evaluations += 1
        if self.cost < self.best_cost:
            self.best_cost, self._best = self.cost, (proposal.copy(), self.pose, self.place)
        info = {
            "cost": self.cost,
            "best_cost": self.best_cost,
            "evaluations": self.evaluations,
            "areas": outcome.areas[0],
            "instance": passage.instance.number,
        }
        if self._errors:
            info |= passage.instance.errors(passage.frame, self.pose)
        if self.evaluations >= self._most:
            assert self._best is not None
            best, self.pose, self.place = self._best
            info |= passage.commit(best, self.pose, self.place, self.best_cost, self._errors)
            if not passage.ended:
                self._enter()
        return info | {"frame": passage.frame}

    @property
    def label(self) -> str:
        """What is written into the picture."""
        return track_label(self.passage, None if self.pose is None else self.cost, self.best_cost)


def track_label(passage: Passage, cost: float | None, best_cost: float) -> str:
    """Return what is written into a picture, where the last proposal's cost is None before the first one."""
    if cost is None:
        return f"instance {passage.instance.number}, frame {passage.frame}"
    best = "" if np.isinf(best_cost) else f", best {best_cost:.1f}"
    return f"frame {passage.frame}, cost {cost:.1f}{best}"
