"""Bodies that turn faster than a person can, and tracks that are tracked again because of them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.output.folder import Recorder
from posefit.progress import Progress
from posefit.silhouette.mask import Silhouette
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_hypotheses
from posefit.tracking.restarts import (
    MAX_TURN_RATE,
    facing_consensus,
    initial_guess,
    retrack_spins,
)
from posefit.tracking.trajectory import Tracked
from posefit.uncertainty.modes import Posterior
from tests.cases import each
from tests.tracking.scenes import walk

FPS = 30.0
# at z = 6 on the z axis: a person of yaw 0 faces it, and yaw t and 180 - t are reflections of each other
CAMERA = Camera.around(np.array([0.0, 1.0, 0.0]), 0.0, 6.0, (16, 12))
WALK = built_in.motion("walk", frames=4)
PLACE = np.array([0.0, 1.0, 0.0])
TASK = Task(Body.of(WALK.skeleton), [CAMERA], 100, None, PLACE, "aligned", FPS, [WALK])
OBSERVATIONS = [Observation([Silhouette.of(np.ones((12, 16), dtype=bool))]) for _ in range(28)]
SPINNING = [150.0] * 8 + [30.0] * 20  # degrees of yaw


def frame(degrees: float, cost: float = 1.0, cameras: int = 1, **more: Any) -> Frame:
    pose = WALK.poses[0].copy()
    pose[0] = np.radians(degrees)
    areas = np.array([[5, 5, 5]] * cameras + [[0, 0, 0]] * (2 - cameras))
    return Frame(pose, PLACE, cost, areas, 10, **more)


def frames_facing(degrees: Sequence[float], cameras: int = 1) -> list[Frame]:
    return [frame(yaw, cameras=cameras) for yaw in degrees]


def consensus(frames: Sequence[Frame], visible: bool = True) -> list[bool]:
    return facing_consensus(frames, [CAMERA, CAMERA], np.full(len(frames), visible), FPS).tolist()


def rows_of(observations: Iterable[Observation]) -> list[int]:
    """Return the numbers of some of the observations."""
    return [next(k for k, other in enumerate(OBSERVATIONS) if other is observation) for observation in observations]


@each(
    ("frames", "agrees"),
    [
        (frames_facing(SPINNING), [False] * 11 + [True] * 17),  # frames of the spin itself have no vote
        (
            frames_facing([30.0] * 10 + [150.0] * 8 + [30.0] * 10),
            [True] * 7 + [False] * 14 + [True] * 7,
        ),
        (frames_facing([0.0] * 5 + [*np.linspace(0.0, 180.0, 30)] + [180.0] * 5), [True] * 40),  # a real turn
    ],
)
def test_most_frames_decide_which_way_the_person_faces(frames: list[Frame], agrees: list[bool]) -> None:
    assert consensus(frames) == agrees


def test_a_frame_has_a_vote_for_each_camera_that_sees_the_person() -> None:
    agrees = consensus([*frames_facing([150.0] * 12, cameras=2), *frames_facing([30.0] * 18)])
    assert all(agrees[:9])
    assert not any(agrees[9:])
    assert consensus(frames_facing([0.0] * 4), visible=False) == [False] * 4


def posterior(offset: float) -> Posterior:
    poses = np.repeat(WALK.poses[:1], 2, axis=0)
    poses[:, 10] += [offset, -offset]
    return Posterior(poses, np.array([[offset, 0.0, 0.0], [-offset, 0.0, 0.0]]), np.ones(2), coherent=True)


def test_a_track_that_spins_is_tracked_again_outside_its_longest_run_without_spins() -> None:
    degrees = [150.0] * 5 + [30.0] * 18 + [150.0] * 5
    frames, calls = [frame(yaw, posterior=posterior(0.2)) for yaw in degrees], list[tuple[Task, list[int]]]()

    def follow(task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        rows = rows_of(observations)
        calls.append((task, rows))
        for row in rows:
            yield frame(30.0 + 0.1 * row, posterior=posterior(0.2 if rows[-1] else -0.2))

    retracked, _, stay = retrack_spins(TASK, OBSERVATIONS, Tracked(frames, []), follow, 0)
    assert stay == (8, 19)  # frames of a spin have no vote
    new = [30.0 if 8 <= k <= 19 else 30.0 + 0.1 * k for k in range(28)]
    assert [np.degrees(f.pose[0]) for f in retracked] == pytest.approx(new)
    (onward, ahead), (back, behind) = calls
    assert (ahead, behind) == (list(range(19, 28)), list(range(8, -1, -1)))
    assert onward.fastest_turn == back.fastest_turn == MAX_TURN_RATE
    assert np.degrees(onward.yaw or 0.0) == pytest.approx(30.0)
    np.testing.assert_array_equal(back.training[0].poses, WALK.poses[::-1])
    assert [f.evaluations for f in retracked] == [10 if 8 <= k <= 19 else 20 for k in range(28)]
    # a trajectory goes on as the nearest one on either side: the first of these is the other's second
    places = [f.posterior.translations[0, 0] for f in retracked if f.posterior is not None]
    np.testing.assert_allclose(places, 0.2)


@each(
    ("degrees", "again", "cost", "tried"),
    [
        (SPINNING, SPINNING, 1.0, True),  # it spins as often
        (SPINNING, [30.0] * 28, 2.6, True),  # it costs too much
        ([30.0] * 28, None, 1.0, False),  # there is no spin
    ],
)
def test_a_track_that_gets_no_better_is_kept(
    degrees: list[float], again: list[float], cost: float, tried: bool
) -> None:
    calls = list[list[int]]()

    def follow(task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        calls.append(rows_of(observations))
        for row in calls[-1]:
            yield frame(again[row], cost)

    frames = frames_facing(degrees)
    kept, _, stay = retrack_spins(TASK, OBSERVATIONS, Tracked(frames, []), follow, 0)
    assert stay is None
    assert [f.pose[0] for f in kept] == [f.pose[0] for f in frames]
    assert calls == ([list(range(11, -1, -1))] if tried else [])  # nothing comes after what stays
    assert [f.evaluations for f in kept] == [20 if tried and k < 11 else 10 for k in range(28)]


def test_footage_is_tracked_from_the_first_frame_that_shows_the_whole_person_first_back_and_then_on() -> None:
    calls = list[tuple[Task, list[int]]]()
    whole = np.zeros((12, 16), dtype=bool)
    whole[3:9, 6:9] = True
    shown = [*OBSERVATIONS[:5], *(Observation([Silhouette.of(whole)]) for _ in range(5))]  # a full picture is cut
    scene = replace(walk(10), truth=None, observations=shown, count=10)

    class Tracker:
        def __init__(self, task: Task) -> None:
            self.task = task

        def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
            rows = [next(k for k, other in enumerate(shown) if other is one) for one in observations]
            calls.append((self.task, rows))
            yield from (frame(float(row), posterior=posterior(0.1)) for row in rows)

    method: Any = SimpleNamespace(
        looks_ahead=True,
        relocalise_gap=0,
        follow=lambda task, observations, rng: Tracker(task).track(observations, rng),
    )
    frames = track_hypotheses(scene, TASK, method, TrackOptions(hypotheses=2), Recorder(), Progress())[0].frames
    (back, behind), (onward, ahead), (again, _), _ = calls
    assert (behind, ahead) == ([5, 4, 3, 2, 1, 0], [5, 6, 7, 8, 9])
    assert back.backwards
    np.testing.assert_array_equal(back.training[0].poses, WALK.poses[::-1])
    assert np.degrees(onward.yaw or 0.0) == pytest.approx(5.0)  # it goes on from where the track back began
    assert [np.degrees(f.pose[0]) for f in frames] == pytest.approx(range(10))
    assert [f.evaluations for f in frames] == [10] * 5 + [20] + [10] * 4  # the frame in the middle is searched twice
    assert again.yaw == initial_guess(1, TASK, None, False, frames[5])[1].yaw  # a guess is of the frame it is for
    calls.clear()
    track_hypotheses(scene, replace(TASK, yaw=0.5), method, TrackOptions(), Recorder(), Progress())
    assert [rows for _, rows in calls] == [list(range(10))]  # what is known of the first frame is kept
