"""Several hypotheses: their initial guesses, what trajectories cost, which is kept, and that all are counted."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.progress import Progress
from posefit.silhouette.drawn import PoseCount
from posefit.tracking.restarts import GUESSES, SEARCHED_AGAIN, initial_guess
from posefit.tracking.trajectory import (
    MIN_TYPICAL_SPEED,
    WALKING_SPEED,
    TrajectoryCost,
    trajectory_cost,
    typical_speed,
)
from tests.cases import each
from tests.tracking.scenes import stopping, walk

WALK = built_in.motion("walk", frames=30)
SKELETON = WALK.skeleton
QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 400}


def frames_of(poses: Array, costs: Sequence[float]) -> list[Frame]:
    nothing = np.zeros((1, 3), dtype=np.int64)
    return [
        Frame(pose, np.zeros(3), cost, nothing, 10, np.array([[10, cost]]), seconds=0.5, cpu_seconds=0.25)
        for pose, cost in zip(poses, costs, strict=True)
    ]


def cost_of(
    poses: Array, costs: Sequence[float], speed: float | None = None, usable: Any = True, fps: float = 30.0
) -> TrajectoryCost:
    speed = typical_speed([WALK]) if speed is None else speed
    shown = np.broadcast_to(usable, len(poses)).tolist()
    return trajectory_cost(frames_of(poses, costs), shown, SKELETON, fps, speed)


def test_the_right_trajectory_costs_less_than_one_that_jumps_or_one_that_fits_worse() -> None:
    mirrored = mirrored_poses(SKELETON, WALK.poses)  # which is as smooth
    jumping = WALK.poses.copy()
    jumping[10:20] = mirrored[10:20]  # the legs trade places, and trade back
    assert cost_of(WALK.poses, [2.0] * 30).total < cost_of(jumping, [2.0] * 30).total - 0.05
    assert cost_of(WALK.poses, [2.05] * 30).total < cost_of(mirrored, [3.35] * 30).total
    assert cost_of(mirrored, [2.05] * 30).total == pytest.approx(cost_of(WALK.poses, [2.05] * 30).total, abs=0.01)


def test_a_trajectory_cost_by_hand() -> None:
    # a straight body turns to and fro on the spot, each joint as far back as it came
    poses = np.zeros((4, 66))
    poses[:, 0] = [0.0, 0.1, 0.0, 0.1]
    joints = SKELETON.joints(poses)
    squares = ((30.0 * (joints[1] - joints[0])) ** 2).sum(axis=1).mean()
    cost = cost_of(poses, [1.0, 2.0, 3.0, 6.0], 0.8)
    assert cost.cost == 3.0
    assert cost.motion == pytest.approx(0.5 * 4.0 * squares / (2.0 * 0.8) ** 2)
    assert cost.total == cost.cost + cost.motion
    # to turn around at the typical speed costs a half
    assert cost_of(poses[:3], [0.0] * 3, float(np.sqrt(squares))).motion == pytest.approx(0.5)
    assert cost_of(np.zeros((5, 66)), [1.0] * 5).total == 1.0
    assert cost_of(WALK.poses[:2], [1.0, 2.0]).total == 1.5  # two frames have no change of velocity
    assert cost_of(WALK.poses[:1], [1.0]).total == 1.0


def test_a_jump_costs_the_same_however_far() -> None:
    def jump(yaw: float) -> float:
        poses = np.zeros((9, 66))
        poses[4, 0] = yaw
        return cost_of(poses, [0.0] * 9, 1.0).motion

    assert jump(0.1) < jump(2.0) == jump(3.0)
    assert jump(2.0) == pytest.approx(3 * 0.5 * (5.0 / 2.0) ** 2 / 7)  # of three changes among seven


def test_held_frames_count_for_nothing() -> None:
    poses, costs = WALK.poses.copy(), np.full(30, 2.0)
    poses[12], costs[12] = 0.0, 90.0
    cost = cost_of(poses, costs.tolist(), 1.0, np.arange(30) != 12)
    assert cost.cost == 2.0
    assert cost.motion < 0.1
    assert cost_of(poses, costs.tolist(), 1.0, False).cost == costs.mean()


def test_jitter_costs_the_same_at_any_rate() -> None:
    def jitter(fps: float) -> float:
        motion = built_in.motion("walk", frames=round(8 * fps), fps=fps)
        noise = np.random.default_rng(0).normal(0.0, 0.02, (len(motion), 63))
        return cost_of(motion.poses + np.pad(noise, ((0, 0), (3, 0))), [0.0] * len(motion), 1.0, fps=fps).motion

    assert [jitter(60.0), jitter(120.0)] == pytest.approx([jitter(30.0)] * 2, rel=0.15)


def test_the_typical_speed_is_that_of_the_training_motions() -> None:
    joints = SKELETON.joints(WALK.poses)
    steps = 30.0 * np.diff(joints - joints[:, :1], axis=0)
    assert typical_speed([WALK]) == pytest.approx(np.sqrt((steps**2).sum(axis=2).mean()))
    fast = built_in.motion("walk", frames=120, fps=120.0)
    assert typical_speed([fast]) == pytest.approx(typical_speed([WALK]), rel=0.1)
    still = Motion("still", SKELETON, np.zeros((9, 66)), np.zeros((9, 3)), 30.0)
    assert typical_speed([still]) == MIN_TYPICAL_SPEED
    assert typical_speed([still.frames(0, 1)]) == typical_speed([]) == WALKING_SPEED


def guesses(
    count: int, view_degrees: float, yaw: float | None = None, pose_known: bool = False
) -> tuple[Task, list[tuple[str, Task]]]:
    """Return a task, and the guesses of `count` hypotheses after the first."""
    scene = walk(30, [view_degrees], (120, 90))
    task = Task(scene.body, scene.cameras, 400, scene.yaw, scene.anchor)
    first = replace(frames_of(WALK.poses[:1], [1.0])[0], translation=WALK.translations[0])
    return task, [initial_guess(number, task, yaw, pose_known, first) for number in range(1, count + 1)]


def test_hypotheses_begin_with_symmetric_poses_and_new_searches() -> None:
    task, named = guesses(8, 90.0)
    assert [name for name, _ in named[:3]] == ["mirrored", "reflected", SEARCHED_AGAIN]
    assert {name for name, _ in named} == {*GUESSES}
    mirror, guess = mirrored_poses(SKELETON, WALK.poses[:1])[0], named[0][1]
    assert guess.yaw == mirror[0]
    np.testing.assert_array_equal(guess.first_pose, mirror[3:])
    np.testing.assert_array_equal(guess.anchor, WALK.translations[0])
    assert [guess is task for _, guess in named] == [name == SEARCHED_AGAIN for name, _ in named]


def test_guesses_do_not_contradict_what_is_known() -> None:
    yaw = float(WALK.poses[0, 0])
    from_front = {name for name, _ in guesses(12, 0.0, yaw)[1]}
    assert from_front == {"mirrored", "legs exchanged", "arms exchanged", SEARCHED_AGAIN}
    assert "reflected" in [name for name, _ in guesses(12, 90.0, yaw)[1]]  # a person who faces across stays so
    task, given = guesses(5, 90.0, yaw, True)
    assert given == [(SEARCHED_AGAIN, task)] * 5


@each("method", [{}, {"method": "vsmm"}, {"method": "exemplars", "evaluations": 800}, {"method": "annealed"}])
def test_the_evaluations_of_all_hypotheses_are_counted(method: dict[str, Any]) -> None:
    drawn, options = PoseCount(), {**QUICK, **method}
    with drawn.counting():
        track = posefit.track("walk", hypotheses=3, view_degrees=90.0, **options)
    single = posefit.track("walk", view_degrees=90.0, **options)
    summary, hypotheses = track.summary, track.summary["hypotheses"]
    assert summary["warnings"] == []
    assert summary["evaluations"] == track.table["evaluations"].sum() <= drawn.poses
    assert summary["evaluations"] > 2 * single.summary["evaluations"]
    assert summary["evaluations_per_frame"] == options["evaluations"]
    totals = [hypothesis["cost"] + hypothesis["motion"] for hypothesis in hypotheses]
    assert [hypothesis["kept"] for hypothesis in hypotheses] == [k == np.argmin(totals) for k in range(3)]
    assert hypotheses[int(np.argmin(totals))]["cost"] == pytest.approx(summary["cost"])
    assert hypotheses[0]["cost"] == pytest.approx(single.summary["cost"])  # the first is the track without others
    assert single.summary["hypotheses"] == []


def test_interrupted_hypotheses_go_on_where_they_were(tmp_path: Path) -> None:
    options: dict[str, Any] = {"hypotheses": 3, "seed": 1, "view_degrees": 90.0, **QUICK}
    whole, names = posefit.track("walk", **options), ("searched", "mirrored", "reflected")
    for after in [1, 3, 4, 7]:
        written: dict[str, Any] = {**options, "out": tmp_path / f"walk-{after}"}
        with pytest.raises(KeyboardInterrupt):
            posefit.track("walk", progress=stopping(after), **written)
        with pytest.raises(ValueError, match="hypotheses must be 3, as before, to resume, got 2"):
            posefit.track("walk", resume=True, **{**written, "hypotheses": 2})
        log: list[str] = []
        resumed = posefit.track("walk", resume=True, progress=Progress(log.append), **written)
        done, frames = divmod(after, 3)
        new = [f"track {k + 1} of 3: {names[k]}" for k in range(-(-after // 3), 3)]
        assert [line for line in log if line.startswith("track ")] == new
        going_on = [f"going on from frame {frames} of 3 of track {done + 1} of 3, {names[done]}"] if frames else []
        assert [line for line in log if line.startswith("going on")] == going_on
        costs = [[row["cost"] for row in track.summary["hypotheses"]] for track in (whole, resumed)]
        assert len(costs[1]) == 3
        assert costs[0][:done] == costs[1][:done]
        assert resumed.summary["evaluations"] == whole.summary["evaluations"]
