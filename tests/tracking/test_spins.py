"""Bodies that turn faster than anybody does, and tracks that are followed again because of them."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.mask import Silhouette
from posefit.tracking.restarts import in_reverse, retrack_spins
from posefit.tracking.spins import MAX_TURN_RATE, anchor_frame, facing_consensus, spin_mask
from posefit.uncertainty.modes import Posterior

FPS = 30.0
# at z = 6 on the z axis: whoever has yaw 0 faces it, and yaw t and 180 - t are reflections of each other
CAMERA = Camera.around(np.array([0.0, 1.0, 0.0]), 0.0, 6.0, (16, 12))
WALK = built_in.motion("walk", frames=4)
PLACE = np.array([0.0, 1.0, 0.0])


def frame(degrees: float, cost: float = 1.0, cameras: int = 1, **more: Any) -> Frame:
    pose = WALK.poses[0].copy()
    pose[0] = np.radians(degrees)
    areas = np.array([[5, 5, 5]] * cameras + [[0, 0, 0]] * (2 - cameras))
    return Frame(pose, PLACE, cost, areas, 10, 0.1, np.array([cost]), **more)


def facing(degrees: list[float], **more: Any) -> list[Frame]:
    return [frame(one, **more) for one in degrees]


def agreed(degrees: list[float], usable: Any = None, **more: Any) -> list[bool]:
    frames = facing(degrees, **more)
    seen = np.ones(len(frames), dtype=bool) if usable is None else np.array(usable, dtype=bool)
    return list(facing_consensus(frames, [CAMERA, CAMERA], seen, FPS).tolist())


def test_a_body_whirls_where_it_turns_by_more_than_60_degrees_in_a_tenth_of_a_second() -> None:
    every = np.ones(12, dtype=bool)
    jump = np.radians([0.0] * 6 + [70.0] * 6)
    assert np.flatnonzero(spin_mask(jump, every, FPS)).tolist() == [3, 4, 5, 6, 7, 8]
    assert not spin_mask(np.radians(15.0 * np.arange(12)), every, FPS).any()  # 450 degrees a second
    assert spin_mask(np.radians(25.0 * np.arange(12)), every, FPS).all()
    assert not spin_mask(np.radians([179.0] * 6 + [-179.0] * 6), every, FPS).any()
    unseen = every.copy()
    unseen[6:] = False
    assert not spin_mask(jump, unseen, FPS).any()
    assert np.flatnonzero(spin_mask(jump, every, 10.0)).tolist() == [5, 6]


def test_most_frames_say_which_way_somebody_faces_all_along() -> None:
    found = agreed([150.0] * 8 + [30.0] * 20)
    # the frames of the whirl itself say nothing
    assert found == [False] * 11 + [True] * 17
    assert agreed([30.0] * 10 + [150.0] * 8 + [30.0] * 10) == [True] * 7 + [False] * 14 + [True] * 7


def test_who_really_turns_round_in_his_own_time_agrees_throughout() -> None:
    turning = list(np.linspace(0.0, 180.0, 30))
    assert agreed([0.0] * 5 + turning + [180.0] * 5) == [True] * 40


def test_a_frame_has_a_vote_for_each_camera_that_sees_it() -> None:
    few, many = facing([150.0] * 12, cameras=2), facing([30.0] * 18)
    found = facing_consensus([*few, *many], [CAMERA, CAMERA], np.ones(30, dtype=bool), FPS)
    assert found[:9].all()
    assert not found[9:].any()


def test_where_nothing_is_seen_nothing_agrees() -> None:
    assert agreed([0.0] * 4, usable=[False] * 4) == [False] * 4
    assert anchor_frame(facing([0.0] * 4), np.zeros(4, dtype=bool)) is None


def test_the_surest_frame_is_of_the_longest_run_and_seen_by_most_cameras_at_least_cost() -> None:
    frames = [frame(0.0, cost) for cost in (0.1, 0.1, 9.0, 5.0, 2.0, 3.0, 0.1)]
    flags = np.array([True, False, True, True, True, True, True])
    assert anchor_frame(frames, flags) == 4
    frames[5] = frame(0.0, 3.0, cameras=2)
    assert anchor_frame(frames, flags) == 5
    assert anchor_frame(frames[:2], np.array([True, False])) == 0


def task() -> Task:
    return Task(Body.of(WALK.skeleton), [CAMERA], 100, None, PLACE, "aligned", FPS, [WALK])


def observations(count: int) -> list[Observation]:
    return [Observation([Silhouette.of(np.ones((12, 16), dtype=bool))]) for _ in range(count)]


def posterior(offset: float) -> Posterior:
    poses = np.repeat(WALK.poses[:1], 2, axis=0)
    poses[:, 10] += [offset, -offset]
    return Posterior(poses, np.array([[offset, 0.0, 0.0], [-offset, 0.0, 0.0]]), np.ones(2), coherent=True)


def test_a_track_that_whirls_is_followed_again_both_ways_from_the_surest_frame() -> None:
    found = facing([150.0] * 8 + [30.0] * 20)
    found[20] = frame(30.0, 0.5)
    seen, asked = observations(28), list[tuple[Task, list[int]]]()

    def follow(mine: Task, coming: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        rows = [next(k for k, one in enumerate(seen) if one is each) for each in coming]
        asked.append((mine, rows))
        way = 1.0 if rows[-1] else -1.0
        for row in rows:
            yield frame(30.0 + 0.1 * row, posterior=posterior(way * 0.2))

    told = retrack_spins(task(), seen, found, follow, 0)
    assert told.start == 20
    assert [np.degrees(one.pose[0]) for one in told.frames] == pytest.approx([30.0 + 0.1 * k for k in range(28)])
    (onward, ahead), (back, until) = asked
    assert (ahead, until) == (list(range(20, 28)), list(range(20, -1, -1)))
    assert onward.fastest_turn == back.fastest_turn == MAX_TURN_RATE
    assert np.degrees(onward.yaw or 0.0) == pytest.approx(30.0)
    np.testing.assert_array_equal(back.training[0].poses, WALK.poses[::-1])
    assert {one.evaluations for one in told.frames} == {20}
    # a drawn track goes on backwards as the one that is where it is: the first of these is the other's second
    places = [one.posterior.translations[0, 0] for one in told.frames if one.posterior is not None]
    np.testing.assert_allclose(places, 0.2)


@pytest.mark.parametrize(
    ("again", "cost"),
    [
        ([150.0] * 8 + [30.0] * 20, 1.0),  # it whirls as often
        ([30.0] * 28, 1.6),  # nobody looks like that
    ],
)
def test_a_track_that_is_no_better_is_kept_as_it_was(again: list[float], cost: float) -> None:
    found, seen = facing([150.0] * 8 + [30.0] * 20), observations(28)

    def follow(mine: Task, coming: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        for each in coming:
            yield frame(again[next(k for k, one in enumerate(seen) if one is each)], cost)

    told = retrack_spins(task(), seen, found, follow, 0)
    assert told.start is None
    assert [one.pose[0] for one in told.frames] == [one.pose[0] for one in found]
    assert {one.evaluations for one in told.frames} == {20}


def test_a_track_that_does_not_whirl_is_not_followed_again() -> None:
    def follow(mine: Task, coming: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        raise AssertionError

    found = facing([30.0] * 10)
    told = retrack_spins(task(), observations(10), found, follow, 0)
    assert told.start is None
    assert told.frames == found


def test_a_motion_that_goes_backwards_ends_where_it_began() -> None:
    back: Array = in_reverse(WALK).translations
    np.testing.assert_array_equal(back[0], WALK.translations[-1])
    np.testing.assert_array_equal(in_reverse(in_reverse(WALK)).poses, WALK.poses)
