"""Whole tracks: how they are begun, what they cost, which one is kept, and that all of them are counted."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from click.testing import CliRunner

import posefit
from posefit.arrays import Array
from posefit.cli import main
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import synthetic
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.drawn import PoseCount
from posefit.tracking.restarts import SEARCHED_AGAIN, SYMMETRIC_POSES, initial_guess, stream
from posefit.tracking.trajectory import (
    MIN_TYPICAL_SPEED,
    WALKING_SPEED,
    trajectory_cost,
    typical_speed,
    with_total_effort,
)
from tests.testing import planted

WALK = built_in.motion("walk", frames=30)
SKELETON = WALK.skeleton
QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 400}


def frames_of(poses: Array, costs: Sequence[float]) -> list[Frame]:
    """Return frames of some poses and costs."""
    nothing = np.zeros((1, 3), dtype=np.int64)
    return [
        Frame(pose, np.zeros(3), cost, nothing, 10, 0.5, np.array([cost]), spent=np.array([10]), cpu_seconds=0.25)
        for pose, cost in zip(poses, costs, strict=True)
    ]


def cost_of(poses: Array, costs: Sequence[float], fps: float = 30.0) -> float:
    """Return the whole cost of a track."""
    return trajectory_cost(frames_of(poses, costs), [True] * len(poses), SKELETON, fps, typical_speed([WALK])).total


def test_of_two_tracks_that_fit_alike_the_one_that_does_not_jump_is_right() -> None:
    right, jumps = WALK.poses, WALK.poses.copy()
    jumps[10:20] = mirrored_poses(SKELETON, jumps[10:20])  # the legs trade places, and trade back
    fits = [2.0] * len(right)
    assert cost_of(right, fits) < cost_of(jumps, fits) - 0.05


def test_of_two_tracks_that_move_alike_the_one_that_fits_is_right() -> None:
    wrong = mirrored_poses(SKELETON, WALK.poses)  # which is as smooth
    assert cost_of(WALK.poses, [2.05] * 30) < cost_of(wrong, [3.35] * 30)
    assert cost_of(wrong, [2.05] * 30) == pytest.approx(cost_of(WALK.poses, [2.05] * 30), abs=0.01)


def test_a_whole_cost_by_hand() -> None:
    # a straight body turns to and fro on the spot, each joint as far back as it came
    poses = np.zeros((4, 66))
    poses[:, 0] = [0.0, 0.1, 0.0, 0.1]
    joints = SKELETON.joints(poses)
    steps = 30.0 * (joints[1] - joints[0])  # metres a second
    change = 4.0 * (steps**2).sum(axis=1).mean()
    found = trajectory_cost(frames_of(poses, [1.0, 2.0, 3.0, 6.0]), [True] * 4, SKELETON, 30.0, 0.8)
    assert found.cost == 3.0
    assert found.motion == pytest.approx(0.5 * change / (2.0 * 0.8) ** 2)
    assert found.total == found.cost + found.motion


def test_a_jump_is_a_jump_however_far() -> None:
    def jump(yaw: float, usual: float) -> float:
        poses = np.zeros((9, 66))
        poses[4, 0] = yaw
        return trajectory_cost(frames_of(poses, [0.0] * 9), [True] * 9, SKELETON, 30.0, usual).motion

    assert jump(0.1, 1.0) < jump(2.0, 1.0) == jump(3.0, 1.0)
    assert jump(2.0, 1.0) == pytest.approx(3 * 0.5 * (5.0 / 2.0) ** 2 / 7)  # of three changes among seven


def test_turning_around_at_the_usual_speed_costs_a_half() -> None:
    poses = np.zeros((3, 66))
    poses[1, 0] = 0.4
    joints = SKELETON.joints(poses)
    usual = 30.0 * float(np.sqrt(((joints[1] - joints[0]) ** 2).sum(axis=1).mean()))
    assert trajectory_cost(frames_of(poses, [0.0] * 3), [True] * 3, SKELETON, 30.0, usual).motion == pytest.approx(0.5)


def test_constant_speed_costs_nothing_and_a_track_of_two_frames_has_no_motion() -> None:
    still = np.zeros((5, 66))
    assert cost_of(still, [1.0] * 5) == 1.0
    assert cost_of(WALK.poses[:2], [1.0, 2.0]) == 1.5
    assert cost_of(WALK.poses[:1], [1.0]) == 1.0


def test_frames_that_were_held_count_for_nothing() -> None:
    poses = WALK.poses.copy()
    poses[12] = 0.0
    costs = np.full(30, 2.0)
    costs[12] = 90.0
    seen = np.arange(30) != 12
    found = trajectory_cost(frames_of(poses, costs.tolist()), seen.tolist(), SKELETON, 30.0, 1.0)
    assert found.cost == 2.0
    assert found.motion < 0.1
    assert trajectory_cost(frames_of(poses, costs.tolist()), [False] * 30, SKELETON, 30.0, 1.0).cost == costs.mean()


def test_jitter_counts_alike_at_any_rate() -> None:
    def jitter(fps: float) -> float:
        motion = built_in.motion("walk", frames=round(8 * fps), fps=fps)
        noise = np.random.default_rng(0).normal(0.0, 0.02, (len(motion), 63))
        poses = motion.poses + np.pad(noise, ((0, 0), (3, 0)))
        found = trajectory_cost(frames_of(poses, [0.0] * len(poses)), [True] * len(poses), SKELETON, fps, 1.0)
        return found.motion

    assert jitter(60.0) == pytest.approx(jitter(30.0), rel=0.15)
    assert jitter(120.0) == pytest.approx(jitter(30.0), rel=0.15)


def test_the_usual_speed_is_that_of_the_training_motions() -> None:
    joints = SKELETON.joints(WALK.poses)
    steps = 30.0 * np.diff(joints - joints[:, :1], axis=0)
    assert typical_speed([WALK]) == pytest.approx(np.sqrt((steps**2).sum(axis=2).mean()))
    fast = built_in.motion("walk", frames=120, fps=120.0)
    assert typical_speed([fast]) == pytest.approx(typical_speed([WALK]), rel=0.1)
    still = Motion("still", SKELETON, np.zeros((9, 66)), np.zeros((9, 3)), 30.0)
    assert typical_speed([still]) == MIN_TYPICAL_SPEED
    assert typical_speed([still.frames(0, 1)]) == typical_speed([]) == WALKING_SPEED


def begun(
    count: int, view_degrees: float, yaw: float | None = None, pose_known: bool = False
) -> tuple[Task, list[tuple[str, Task]]]:
    """Return a task, and how `count` tracks after the first are begun."""
    scene = synthetic(WALK, [view_degrees], (120, 90), [], (None, None))
    task = Task(scene.body, scene.cameras, 400, scene.yaw, scene.anchor)
    (first,) = frames_of(WALK.poses[:1], [1.0])
    first = replace(first, translation=WALK.translations[0])
    return task, [initial_guess(number, task, yaw, pose_known, first) for number in range(1, count + 1)]


def test_tracks_begin_with_poses_that_look_alike_and_anew() -> None:
    task, found = begun(8, 90.0)
    assert [name for name, _ in found[:3]] == ["mirrored", "reflected", SEARCHED_AGAIN]
    assert {name for name, _ in found} == {*SYMMETRIC_POSES, SEARCHED_AGAIN}
    mirror = mirrored_poses(SKELETON, WALK.poses[:1])[0]
    told = found[0][1]
    assert told.yaw == mirror[0]
    np.testing.assert_array_equal(told.first_pose, mirror[3:])
    np.testing.assert_array_equal(told.anchor, WALK.translations[0])
    assert [mine is task for name, mine in found] == [name == SEARCHED_AGAIN for name, _ in found]


def test_what_is_known_is_not_contradicted() -> None:
    yaw = float(WALK.poses[0, 0])
    from_front = [name for name, _ in begun(12, 0.0, yaw)[1]]
    assert {"mirrored", "legs exchanged", "arms exchanged", SEARCHED_AGAIN} == set(from_front)
    assert "reflected" in [name for name, _ in begun(12, 90.0, yaw)[1]]  # who faces across stays as he is
    task, given = begun(5, 90.0, yaw, True)
    assert given == [(SEARCHED_AGAIN, task)] * 5


def test_the_first_track_is_the_only_one_of_a_seed_and_others_are_their_own() -> None:
    assert stream(3, "hypothesis", 1).random() == np.random.default_rng([3, 2005, 1]).random()
    assert len({stream(seed, "hypothesis", number).random() for seed in range(3) for number in range(3)}) == 9


def test_what_all_tracks_spent_is_said_of_the_one_that_is_kept() -> None:
    one, two = (frames_of(WALK.poses[:2], costs) for costs in ([1.0, 2.0], [3.0, 4.0]))
    two = [replace(frame, evaluations=30, spent=np.array([15, 30])) for frame in two]
    found = with_total_effort([one, two], 1)
    assert [(f.cost, f.evaluations, f.seconds, f.cpu_seconds) for f in found] == [
        (3.0, 40, 1.0, 0.5),
        (4.0, 40, 1.0, 0.5),
    ]
    np.testing.assert_array_equal(found[0].spent, [20, 40])
    one[0] = replace(one[0], cpu_seconds=None)
    assert with_total_effort([one, two], 0)[0].cpu_seconds is None


@pytest.mark.parametrize("method", [{}, {"method": "vsmm"}, {"method": "exemplars"}, {"method": "annealed"}])
def test_the_evaluations_of_all_tracks_are_counted(method: dict[str, Any]) -> None:
    drawn = PoseCount()
    with drawn.counting():
        result = posefit.track("walk", hypotheses=3, view_degrees=90.0, **method, **QUICK)
    summary = result.summary
    alone = posefit.track("walk", view_degrees=90.0, **method, **QUICK).summary["evaluations"]
    assert summary["warnings"] == []
    assert summary["evaluations"] == sum(row["evaluations"] for row in result.frames) <= drawn.poses
    assert summary["evaluations"] > 2 * alone
    assert summary["evaluations_per_frame"] == 400
    assert len(summary["hypotheses"]) == 3
    assert [one["kept"] for one in summary["hypotheses"]].count(True) == 1
    kept = next(one for one in summary["hypotheses"] if one["kept"])
    assert kept["cost"] == pytest.approx(summary["cost"])
    assert kept["cost"] + kept["motion"] == min(one["cost"] + one["motion"] for one in summary["hypotheses"])


class Told(planted.Holds):
    """Holds a pose, and remembers how it was begun."""

    tasks: ClassVar[list[Task]] = []

    def track(self, observations: Any, rng: Any) -> Iterator[Frame]:
        self.tasks.append(self.task)
        return super().track(observations, rng)


def test_a_tracker_gets_the_beginnings_as_tasks() -> None:
    Told.tasks.clear()
    result = posefit.track("walk", method=Told, hypotheses=3, view_degrees=90.0, **QUICK)
    first, mirror, reflection = Told.tasks[-3:]
    assert first.first_pose is None
    assert mirror.first_pose is not None
    assert reflection.first_pose is not None
    assert [one["guess"] for one in result.summary["hypotheses"]] == ["searched", "mirrored", "reflected"]
    assert result.summary["hypotheses"][0]["kept"]  # which all cost the same


def test_one_track_is_what_it_was() -> None:
    one, same = (posefit.track("walk", seed=4, **given, **QUICK) for given in ({}, {"hypotheses": 1}))
    np.testing.assert_array_equal(one.motion.poses, same.motion.poses)
    assert one.summary["hypotheses"] == []


def test_tracks_that_begin_alike_are_no_worse_than_the_first() -> None:
    first, kept = (posefit.track("walk", hypotheses=tracks, seed=2, view_degrees=90.0, **QUICK) for tracks in (1, 4))
    costs = [one["cost"] + one["motion"] for one in kept.summary["hypotheses"]]
    assert costs[0] >= min(costs)
    assert kept.summary["hypotheses"][0]["cost"] == pytest.approx(first.summary["cost"])


def test_tracks_that_are_no_number_are_a_mistake() -> None:
    for tracks in [0, -1, 1.5, "2"]:
        with pytest.raises(ValueError, match=f"hypotheses must be .* got {tracks!r}"):
            posefit.track("walk", hypotheses=tracks, **QUICK)


def stopping(after: int) -> Any:
    """Return a progress that ends the program after some frames, of all tracks together."""
    seen = iter(range(after))

    def progress(steps: Iterator[Any], _count: int) -> Iterator[Any]:
        for step in steps:
            if next(seen, None) is None:
                raise KeyboardInterrupt
            yield step

    return progress


def test_tracks_that_were_interrupted_go_on_where_they_were(tmp_path: Path) -> None:
    options: dict[str, Any] = {"hypotheses": 3, "seed": 1, "view_degrees": 90.0, **QUICK}
    whole = posefit.track("walk", **options)
    for after in [1, 3, 4, 7]:
        asked: dict[str, Any] = {**options, "out": tmp_path / f"walk-{after}"}
        with pytest.raises(KeyboardInterrupt):
            posefit.track("walk", progress=stopping(after), **asked)
        with pytest.raises(ValueError, match="hypotheses must be 3, as before, to resume, got 2"):
            posefit.track("walk", resume=True, **{**asked, "hypotheses": 2})
        told: list[str] = []
        again = posefit.track("walk", resume=True, say=told.append, **asked)
        assert len(again.summary["hypotheses"]) == 3
        done, frames = divmod(after, 3)
        names = ("searched", "mirrored", "reflected")
        anew = [f"track {k + 1} of 3: {names[k]}" for k in range(-(-after // 3), 3)]
        assert [
            line for line in told if line.startswith("track ")
        ] == anew  # what was found before is not searched again
        going = [f"going on from frame {frames} of 3 of track {done + 1} of 3, {names[done]}"] if frames else []
        assert [line for line in told if line.startswith("going on")] == going
        costs = [[one["cost"] for one in result.summary["hypotheses"]][:done] for result in (whole, again)]
        assert costs[0] == costs[1]
        assert again.summary["evaluations"] == whole.summary["evaluations"]


def test_the_command_says_which_track_was_kept(tmp_path: Path) -> None:
    words = [
        "track",
        "walk",
        "--hypotheses",
        "2",
        "--view-degrees",
        "90",
        "--frames",
        ":2",
        "--size",
        "120x90",
        "--evaluations",
        "400",
    ]
    shown = CliRunner().invoke(main, [*words, "--out", str(tmp_path / "walk")])
    assert shown.exit_code == 0, shown.output
    assert "track 2 of 2: mirrored" in shown.stderr
    (line,) = [line for line in shown.stdout.splitlines() if line.startswith("kept track")]
    assert "of 2; trajectory cost by initial guess: searched " in line
    assert "800 of 800 evaluations" in shown.stdout
    summary = json.loads((tmp_path / "walk" / "summary.json").read_text("utf-8"))
    assert [one["guess"] for one in summary["hypotheses"]] == ["searched", "mirrored"]
    wrong = CliRunner().invoke(main, ["track", "walk", "--hypotheses", "0"])
    assert (wrong.exit_code, wrong.stderr) == (2, "posefit: hypotheses must be at least 1, got 0\n")


@pytest.mark.slow
def test_four_tracks_halve_what_is_swapped_from_the_side(cmu: Path) -> None:
    def swapped(tracks: int) -> float:
        told = [
            posefit.track(
                cmu / "16" / "16_17.amc",
                train=[cmu / "16" / "16_15.amc"],
                view_degrees=90.0,
                frames=(0, 60),
                hypotheses=tracks,
                seed=seed,
            ).summary
            for seed in range(5)
        ]
        return float(np.mean([one["swap_rate"] for one in told]))

    assert swapped(4) <= 0.5 * swapped(1)
