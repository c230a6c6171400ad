"""People whom the library has never seen, followed."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import posefit
from posefit.cli import main
from posefit.fitting.tracker import Observation, Task
from posefit.footage.scene import synthetic
from posefit.geometry.body import Body
from posefit.motion import built_in, recorded
from posefit_exemplars.factory import exemplars


@pytest.fixture(scope="module")
def walker() -> tuple[Task, list[Observation], np.ndarray]:
    """Return a task, what is seen of the built-in walk, and its joints (T, 27, 3)."""
    motion = built_in.motion("walk-a", frames=30)
    scene = synthetic(motion, [45.0], (160, 120), [], (None, None))
    training = [
        built_in.motion("walk-b", frames=60),
        built_in.motion("walk-c", frames=60),
        built_in.motion("run-b", frames=40),
    ]
    yaw = float(motion.poses[0, 0])
    task = Task(Body.of(motion.skeleton), scene.cameras, 2440, yaw, motion.translations[0], training=training)
    return task, list(scene.observations), motion.skeleton.joints(motion.poses, motion.translations)


def away(task: Task, frames: list[Any], joints: np.ndarray) -> np.ndarray:
    """Return the mean distance of joints in each frame (T,), in millimetres."""
    poses, places = (np.array([getattr(frame, name) for frame in frames]) for name in ("pose", "translation"))
    return 1000.0 * np.linalg.norm(task.body.skeleton.joints(poses, places) - joints, axis=-1).mean(axis=1)


def test_somebody_unknown_walks_and_nobody_says_that_it_is_a_walk() -> None:
    track = posefit.track("02_01", train=["library:05,09,16,127"], tracker="exemplars", frames=(0, 30))
    assert track.measures.mpjpe_mm < 60.0  # a swarm in nine components of the same library is 200 mm off
    assert track.measures.lost_rate == 0.0
    assert track.measures.swap_rate == 0.0


def test_who_is_recorded_is_found_again() -> None:
    himself = replace(recorded.clip("16_15").motion(), name="again")  # nobody learns from a clip of the same name
    track = posefit.track(himself, train=["library:16"], tracker="exemplars", frames=(0, 20))
    assert track.measures.mpjpe_mm < 15.0


@pytest.mark.parametrize("lag", [0, 5, 15])
def test_a_pose_is_told_so_many_frames_later(walker: Any, lag: int) -> None:
    task, seen, _ = walker
    taken = 0

    def stream() -> Iterator[Observation]:
        nonlocal taken
        for observation in seen:
            taken += 1
            yield observation

    tracker = exemplars(task, lag=lag)
    assert tracker.lag == lag
    late = [taken - given for given, _ in enumerate(tracker.track(stream(), np.random.default_rng(0)), 1)]
    assert late[0] == lag
    assert len(late) == len(seen)
    assert max(late) == lag


def test_nothing_seen_for_a_while_is_bridged_by_the_motion(walker: Any) -> None:
    task, seen, joints = walker
    gone = [replace(one, usable=not 12 <= k < 20) for k, one in enumerate(seen)]
    frames = list(exemplars(task).track(gone, np.random.default_rng(0)))
    assert [k for k, frame in enumerate(frames) if frame.evaluations == 1] == list(range(12, 20))
    far = away(task, frames, joints)
    assert far[12:20].max() < 120.0
    assert far[20:].max() < 100.0


def test_it_may_have_to_look_all_around(walker: Any) -> None:
    task, seen, joints = walker
    frames = list(exemplars(replace(task, yaw=None)).track(seen, np.random.default_rng(0)))
    assert away(task, frames, joints).max() < 100.0


def test_the_root_is_found_where_nobody_says_where_it_is() -> None:
    known, found = (
        posefit.track(
            "02_01",
            train=["library:05,09,16,127"],
            tracker="exemplars",
            frames=(0, 20),
            view_degrees=90.0,
            translation=translation,
        ).measures.mpjpe_mm
        for translation in ("known", "aligned")
    )
    assert found < known + 15.0


def test_the_budget_holds_and_small_pictures_count_by_their_pixels(walker: Any) -> None:
    task, seen, _ = walker
    for budget in (300, 2440):
        frames = list(exemplars(replace(task, evaluations=budget)).track(seen[:5], np.random.default_rng(0)))
        assert max(frame.evaluations for frame in frames) <= budget


def test_several_cameras_see_better_than_one() -> None:
    errors = [
        posefit.track(
            "09_01", train=["library:16,127"], tracker="exemplars", frames=(0, 20), view_degrees=views
        ).measures
        for views in ((90.0,), (90.0, 0.0))
    ]
    assert errors[1].mpjpe_mm < errors[0].mpjpe_mm


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("spread=0", "spread must be above 0 and finite, got 0"),
        ("turning_degrees=-1", "turning_degrees must be above 0 and finite, got -1"),
        ("temperature=nan", "temperature must be above 0 and finite, got nan"),
        ("jump=-1", "jump must be 0 or more and finite, got -1"),
        ("lag=-1", "lag must be 0 or more, got -1"),
        ("refiner=nobody", "optimiser must be one of"),
        ("transitions=nothing", "transitions must be clips or MODULE:FUNCTION that can be imported, got nothing"),
        ("transitions=math:pi", "transitions must name a function, got math:pi, which is a float"),
    ],
)
def test_settings_that_make_no_sense_are_refused(setting: str, message: str) -> None:
    done = CliRunner().invoke(main, ["track", "walk", "--tracker", "exemplars", "--set", f"exemplars.{setting}"])
    assert done.exit_code == 2
    assert message in done.stderr


def test_the_same_clip_again_is_the_same_track() -> None:
    one, other = (
        posefit.track(recorded.clip("17_03").motion(), train=["library:09"], tracker="exemplars", frames=(0, 5), seed=3)
        for _ in range(2)
    )
    assert one.motion.poses.tobytes() == other.motion.poses.tobytes()
