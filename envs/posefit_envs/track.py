"""Track-v1: a sequence of silhouettes, several proposals for each."""

from functools import partial
from typing import Any

import numpy as np

from posefit import Problem, Problems
from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit.fitting.metrics import mpjpe_mm, pose_error_degrees
from posefit.fitting.synthesis import Prediction, Predictor
from posefit.geometry.skeleton import ANGLES
from posefit_envs.base import (
    Flags,
    Infos,
    SearchEnv,
    SearchVectorEnv,
    image_spaces,
    infos_before,
    proposal_infos,
    reward_of_cost,
    row_of,
)
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows, SceneRow, Stage
from posefit_envs.world import Image, Instance, World, checked, instance

FRAMES = 20
EVALUATIONS = 100  # per frame


class Sequence:
    """An instance, followed frame by frame.

    Each committed pose moves the next frame's box. SAPSO (6).
    """

    def __init__(
        self, world: World, number: int, frames: int, evaluations: int
    ) -> None:
        self.instance = instance(world, number, frames, evaluations)
        self.frame = 0
        task = self.instance.task
        self._predictor = Predictor(task, world.learned, Prediction(tilt="box"))

    def problem(self) -> Problem:
        """Return the problem of the current frame."""
        observation = self.instance.observations[self.frame]
        space = self._predictor.space(observation)
        cost = self.instance.cost(self.frame, space)
        return Problem(cost, space, self.instance.task.evaluations)

    def scene(self, problem: Problem) -> SceneRow:
        """Return the scene of the current frame's problem."""
        cost: Any = problem.cost
        return SceneRow.of(cost, self.instance.truth.poses[self.frame])

    def commit(self, proposal: Array) -> bool:
        """Commit a proposal (d,) to the frame; return whether it was the last frame."""
        self._predictor.commit(proposal)
        self.frame += 1
        return self.frame == len(self.instance.observations)


class TrackEnv(SearchEnv):
    """
    ## Description
    A person walks by; each frame shows a silhouette. A frame takes several proposals.
    The best of them is committed, the next silhouette appears, and the box of proposals
    moves with the prediction, SAPSO (6).

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal, as in `FitImage-v1`. The yaw and a searched
    translation are relative to the pose that was committed last.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, as in `FitImage-v1`: the silhouette
    of the current frame and of the last proposal. The first picture of a frame shows
    the pose that was committed in the previous frame.

    ## Rewards
    -ln(1 + cost) of the proposal, as in `FitImage-v1`.

    ## Starting State
    The first frame of an instance, as in `FitImage-v1`.

    ## Episode End
    Terminates when the last frame's pose is committed. Only a time limit of Gymnasium
    truncates.

    ## Information
    A step and a reset give `cost`, `best_cost`, `evaluations` of the frame,
    `remaining_steps` of the episode, `areas` (views, 3), `frame`, and `instance`. For
    the pose that the step commits they give `committed_frame`, `committed_cost` and
    `committed_pose` (66,). A step that commits nothing has -1, infinity and zeros.
    After a step that commits, `frame` is the next frame.

    In training they also give `error_degrees` of the proposal,
    `committed_error_degrees` and `committed_mpjpe_mm`, unless `errors=False`; in the
    test only with `evaluate=True`. Before the first proposal, costs and errors are
    infinite.

    ## Arguments
    As in `FitImage-v1`, with `frames=20` and `evaluations_per_frame=100` instead of
    `max_evaluations`.

    ## Version History
    - v1: people are held out by default.
    - v0: `held_out_people=False`.
    """

    metadata = SearchEnv.metadata | {"render_fps": 30}

    def __init__(
        self,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        super().__init__(render_mode, arguments)
        self.frames, self.evaluations_per_frame = _checked(
            frames, evaluations_per_frame
        )
        self.action_space, self.observation_space = image_spaces(self.world)
        self.stage = Stage(self.world, 1)
        self._cost = np.nan  # the last proposal's

    def begin(self, number: int) -> tuple[Image, Infos]:
        """Begin an episode with an instance: return its first observation and infos."""
        self._sequence = Sequence(
            self.world, number, self.frames, self.evaluations_per_frame
        )
        self._begin_frame()
        observation = self.stage.pictures(self.stage.all_rows)[0]
        self._done = 0
        infos = row_of(infos_before(self.stage, self.world.shows_truth), 0)
        self._count(infos)
        return observation, infos | nothing_committed(self.world)

    def _begin_frame(self) -> None:
        self._problem = self._sequence.problem()
        self.stage.set_scene(0, self._sequence.scene(self._problem))

    def step(self, action: Any) -> tuple[Image, float, bool, bool, Infos]:
        """Evaluate a proposal; a frame's last one commits the best of the frame."""
        proposal = self.checked_action(action)[None]
        rows = self.stage.all_rows
        problem = self.problem
        drawn = self.stage.draw(proposal, rows)
        problem.count(proposal, drawn.costs)
        self._cost = float(drawn.costs[0])
        self._done += 1
        observation = drawn.pictures[0]
        reward = float(reward_of_cost(self._cost))
        infos = row_of(proposal_infos(self.stage, drawn, self.world.shows_truth), 0)
        # count before a pose is committed: the counts belong to the proposal's frame
        self._count(infos)
        committed = nothing_committed(self.world)
        if not problem.remaining_evaluations:
            committed = self._commit()
            if not self.ended:
                observation = self.stage.pictures(rows)[0]
        infos["frame"] = self._frame()
        return observation, reward, self.ended, False, infos | committed

    def _commit(self) -> Infos:
        """Commit the best proposal of the frame, and begin the next frame.

        Return the infos of the committed pose.
        """
        problem = self.problem
        sequence = self._sequence
        poses, places = self.stage.decode(problem.best[None, None], self.stage.all_rows)
        committed = committed_infos(
            sequence.instance,
            sequence.frame,
            poses[0, 0],
            places[0, 0],
            problem.best_cost,
            self.world.shows_truth,
        )
        self.ended = sequence.commit(problem.best)
        if not self.ended:
            self._begin_frame()
            self.stage.set_body(0, poses[0, 0], places[0, 0])
        return committed

    def _count(self, infos: Infos) -> None:
        """Add the counts to the infos of the only row."""
        problem = self.problem
        infos["best_cost"] = problem.best_cost
        infos["evaluations"] = problem.evaluations
        infos["remaining_steps"] = self.frames * self.evaluations_per_frame - self._done
        infos["frame"] = self._frame()
        infos["instance"] = self.number

    def _frame(self) -> int:
        # after the last commit, the last frame
        return min(self._sequence.frame, self.frames - 1)

    @property
    def instance(self) -> Instance:
        """The episode's instance."""
        self.check_reset()
        return self._sequence.instance

    def picture(self) -> Picture:
        """Return the picture of the last proposal, or else of the committed pose."""
        problem = self.problem
        label = _label(
            self.number,
            self._sequence.frame,
            self._cost,
            problem.best_cost,
            problem.evaluations,
        )
        return render_frame(problem.cost, self.stage.body(0), label)


class TrackVectorEnv(SearchVectorEnv):
    """A vector of `num_envs` TrackEnv environments."""

    metadata = SearchVectorEnv.metadata | {"render_fps": 30}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        **arguments: Any,
    ) -> None:
        super().__init__(num_envs, **arguments)
        self.frames, self.evaluations_per_frame = _checked(
            frames, evaluations_per_frame
        )
        self.set_spaces(*image_spaces(self.world))
        self.stage = Stage(self.world, num_envs, self.threads)
        self._problems = Problems(num_envs, self.world.dimensions)
        self._sequences: dict[int, Sequence] = {}
        self._costs = np.full(num_envs, np.nan)  # the last proposals'

    def begin(self, rows: Rows) -> None:
        """Begin episodes in some environments, with the instances of `numbers`."""
        for i in rows.tolist():
            self._sequences[i] = Sequence(
                self.world,
                int(self.numbers[i]),
                self.frames,
                self.evaluations_per_frame,
            )
            self._begin_frame(i)

    def _begin_frame(self, i: int) -> None:
        problem = self._sequences[i].problem()
        self._problems.begin(i, partial(Problem, problem.cost, problem.space))
        self.stage.set_scene(i, self._sequences[i].scene(problem))

    def observe(self, rows: Rows) -> Image:
        """Return the current pictures of some environments."""
        return self.stage.pictures(rows)

    def reset_infos(self) -> Infos:
        """Return the infos of a reset, by name."""
        infos = infos_before(self.stage, self.world.shows_truth)
        self._count(infos)
        return infos | self._committed({})

    def step(self, actions: Any) -> tuple[Image, Array, Flags, Flags, Infos]:
        """Evaluate a proposal in each environment; a full frame commits its best."""
        proposals, stepping = self.begin_step(actions)
        rows = np.flatnonzero(stepping)
        problems = self._problems
        drawn = self.stage.draw(proposals, rows)
        problems.count(rows, proposals[rows, None], drawn.costs[rows, None])
        self._costs = drawn.costs
        rewards = reward_of_cost(drawn.costs)
        infos = proposal_infos(self.stage, drawn, self.world.shows_truth)
        # count before poses are committed: the counts belong to the proposals' frames
        self._count(infos)
        full = stepping & (problems.evaluations >= self.evaluations_per_frame)
        terminated, committed = self._commit(np.flatnonzero(full), drawn.pictures)
        infos["frame"] = self._frames()
        infos |= self._committed(committed)
        return self.end_step(stepping, drawn.pictures, rewards, terminated, infos)

    def _count(self, infos: Infos) -> None:
        """Add the counts (n,) of all rows to their infos."""
        problems = self._problems
        infos["best_cost"] = problems.best_costs.copy()
        infos["evaluations"] = problems.evaluations.copy()
        infos["remaining_steps"] = self.frames * self.evaluations_per_frame - self.steps
        infos["frame"] = self._frames()
        infos["instance"] = self.numbers.copy()

    def _committed(self, committed: dict[int, Infos]) -> Infos:
        """Return the infos (n, ...) of the poses that some rows have committed."""
        nothing = nothing_committed(self.world)
        rows = [committed.get(i, nothing) for i in range(self.num_envs)]
        infos: Infos = {}
        for name in nothing:
            infos[name] = np.array([row[name] for row in rows])
        return infos

    def _commit(self, rows: Rows, pictures: Image) -> tuple[Flags, dict[int, Infos]]:
        """Commit the best proposals of some environments, and draw their next frames.

        Return which episodes (n,) end, and the infos of the committed poses by
        environment.
        """
        terminated = np.zeros(self.num_envs, dtype=bool)
        committed: dict[int, Infos] = {}
        if not rows.size:
            return terminated, committed
        poses, places = self.stage.decode(self._problems.best[:, None], rows)
        for i in rows.tolist():
            sequence = self._sequences[i]
            committed[i] = committed_infos(
                sequence.instance,
                sequence.frame,
                poses[i, 0],
                places[i, 0],
                float(self._problems.best_costs[i]),
                self.world.shows_truth,
            )
            terminated[i] = sequence.commit(self._problems.best[i])
            if not terminated[i]:
                self._begin_frame(i)
                self.stage.set_body(i, poses[i, 0], places[i, 0])
        # the pictures still show the previous frames
        continuing = rows[~terminated[rows]]
        pictures[continuing] = self.stage.pictures(continuing)
        return terminated, committed

    def _frames(self) -> Rows:
        """Return the current frame (n,) of each environment."""
        # after the last commit, the last frame
        frames = [self._sequences[i].frame for i in range(self.num_envs)]
        return np.minimum(frames, self.frames - 1)

    def row_attribute(self, name: str, i: int) -> Any:
        """Return an attribute of environment i."""
        if name == "instance":
            self.check_reset()
            return self._sequences[i].instance
        return super().row_attribute(name, i)

    def picture(self, i: int) -> Picture:
        """Return the picture of environment i's last proposal or committed pose."""
        problems = self.problems
        label = _label(
            int(self.numbers[i]),
            self._sequences[i].frame,
            self._costs[i],
            problems.best_costs[i],
            problems.evaluations[i],
        )
        return render_frame(problems[i].cost, self.stage.body(i), label)


def _checked(frames: Any, evaluations_per_frame: Any) -> tuple[int, int]:
    return (
        checked(whole, "frames", frames, 1),
        checked(whole, "evaluations_per_frame", evaluations_per_frame, 2),
    )


def _label(
    number: int | None, frame: int, cost: float, best: float, evaluations: int
) -> str:
    """Return the label below a picture."""
    if not evaluations:
        return f"instance {number}, frame {frame}"
    return f"frame {frame}: cost {cost:.1f}, best {best:.1f}, {evaluations} evaluations"


def nothing_committed(world: World) -> Infos:
    """Return the infos of a step that commits no pose."""
    infos: Infos = {
        "committed_frame": -1,
        "committed_cost": np.inf,
        "committed_pose": np.zeros(ANGLES),
    }
    if world.shows_truth:
        infos["committed_error_degrees"] = np.inf
        infos["committed_mpjpe_mm"] = np.inf
    return infos


def committed_infos(
    instance: Instance, frame: int, pose: Array, place: Array, cost: float, errors: bool
) -> dict[str, Any]:
    """Return the infos of a pose committed in a frame of an instance."""
    infos = {
        "committed_frame": frame,
        "committed_cost": cost,
        "committed_pose": pose.copy(),
    }
    if errors:
        joints = instance.task.body.skeleton.joints(pose[None], place[None])
        infos["committed_error_degrees"] = float(
            pose_error_degrees(instance.truth.poses[frame][None], pose[None])[0]
        )
        infos["committed_mpjpe_mm"] = float(
            mpjpe_mm(instance.joints[frame][None], joints)[0]
        )
    return infos
