"""Legs that a film by one camera exchanges: their sequence by trying all, and walks whose legs come back."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.symmetry import exchanged_limbs
from posefit.silhouette.cost import BETA
from posefit.tracking.smoothing.legs import (
    doubtful,
    in_doubt,
    legs_exchanged,
    with_cheapest_legs,
)
from posefit.tracking.smoothing.smooth import smooth
from posefit.tracking.trajectory import cheapest_sequence
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior, unknown_sides
from tests.tracking.scenes import exact_frames, tracked, walk

# of a walk from its side, and the one in which legs pass each other
FRAMES = 24
PASSING = 11
ALL = np.ones(FRAMES, dtype=bool)


@pytest.fixture(scope="module")
def film() -> tuple[Scene, list[Frame]]:
    """A film, and the frames of its truth."""
    scene = walk(FRAMES, (90.0,), (160, 160))
    frames = exact_frames(scene)
    observations = [
        Observation(list(observation.silhouettes)) for observation in scene.observations
    ]
    return replace(scene, truth=None, observations=observations), frames


def exchanged(scene: Scene, frames: list[Frame], which: range) -> list[Frame]:
    poses = exchanged_limbs(
        scene.body.skeleton, np.array([frame.pose for frame in frames]), "legs"
    )
    return [
        replace(frame, pose=poses[k]) if k in which else frame
        for k, frame in enumerate(frames)
    ]


def found(scene: Scene, frames: list[Frame], threads: int = 2) -> NDArray[np.bool_]:
    """Return in which frames (T,) legs should be exchanged."""
    smoothed = smooth(scene, frames, None, BETA)
    return legs_exchanged(smoothed, frames, ALL, BETA, threads)


def changes(flags: NDArray[np.bool_]) -> list[int]:
    return (np.flatnonzero(np.diff(flags)) + 1).tolist()


def test_the_cheapest_sequence_is_that_of_trying_all() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        costs = rng.normal(0.0, 2.0, (6, 2))
        steps = rng.normal(1.0, 2.0, (5, 2, 2))

        def total(
            states: tuple[int, ...], costs: Array = costs, steps: Array = steps
        ) -> float:
            of_steps = sum(steps[k, states[k], states[k + 1]] for k in range(5))
            return float(
                sum(costs[k, state] for k, state in enumerate(states)) + of_steps
            )

        best = min(product((0, 1), repeat=6), key=total)
        assert cheapest_sequence(costs, steps).tolist() == list(best)


def test_legs_that_pass_are_doubtful(film: tuple[Scene, list[Frame]]) -> None:
    scene, frames = film
    here, there = (
        scene.motion(each) for each in (frames, exchanged(scene, frames, range(FRAMES)))
    )
    assert doubtful(here, there, np.ones(FRAMES), ALL) == [PASSING]
    costs = np.ones(FRAMES)
    costs[4] = 2.0  # legs are far apart there: nothing is tried however much it costs
    assert doubtful(here, there, costs, ALL) == [PASSING]


@pytest.mark.parametrize(
    "wrong", [range(PASSING, FRAMES), range(PASSING), range(16, 19)]
)
def test_legs_that_went_back_pass(
    film: tuple[Scene, list[Frame]], wrong: range
) -> None:
    """Which of the two goes ahead is not known from the side: all may be exchanged. Where they pass is, to a frame."""
    scene, frames = film
    which = found(scene, exchanged(scene, frames, wrong))
    expected = np.isin(np.arange(FRAMES), wrong)
    assert changes(which) == pytest.approx(changes(expected), abs=1)


def test_right_legs_stay(film: tuple[Scene, list[Frame]]) -> None:
    scene, frames = film
    assert not changes(found(scene, frames))


def test_only_stretches_that_may_cost_less_are_in_doubt() -> None:
    costs = np.ones(12)
    costs[4] = 3.0
    added = np.full(12, 1.0)
    every = np.ones(12, dtype=bool)
    # two frames with exchanged legs cost as much as the frame that costs more
    assert in_doubt([4, 6, 10], 1, costs, added, every) == ([], False)
    added[5] = 0.5
    assert in_doubt([4, 6, 10], 1, costs, added, every) == ([4, 6], True)


def test_doubtful_stretches_equal_a_search_of_all_pairs_of_edges() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
        frames = int(rng.integers(8, 60))
        count = int(rng.integers(0, 8))
        edges = np.sort(rng.choice(np.arange(1, frames), count, replace=False)).tolist()
        reach = int(rng.integers(1, 5))
        # whole numbers, so that no sum is rounded; the median is 10
        costs = rng.choice([10.0, 10.0, 10.0, 16.0, 20.0], frames)
        added = rng.integers(-1, 4, frames).astype(float)
        usable = rng.random(frames) < 0.8
        usable[:2] = True
        costs[usable.nonzero()[0][::2]] = 10.0
        costs = np.where(usable, costs, 0.0)
        high = np.where(usable & (costs > 13.0), costs - 10.0, 0.0)
        ends = [0, *edges, frames]
        near = [np.zeros(frames, dtype=bool) for _ in ends]
        for edge, rows in zip(edges, near[1:-1], strict=True):
            rows[max(edge - reach, 0) : edge + reach] = True
        kept = set[int]()
        pairs = [
            (start, stop)
            for start, stop in product(range(len(ends)), repeat=2)
            if start < stop
            and added[ends[start] : ends[stop]].sum()
            < high[near[start] | near[stop]].sum()
        ]
        for pair in pairs:
            kept |= {ends[k] for k in pair}
        expected = [edge for edge in edges if edge in kept], bool(pairs)
        assert in_doubt(edges, reach, costs, added, usable) == expected


def test_landmarks_tell_the_left_leg_from_the_right(
    film: tuple[Scene, list[Frame]],
) -> None:
    """Landmarks of half the frames are enough, and those of the others do not matter."""
    scene, frames = film
    joints = scene.motion(frames).joints
    pixels = np.array([scene.cameras[0].project(each)[0] for each in joints])
    marks = np.dstack([pixels, np.full(pixels.shape[:2], 0.9)])[:, None]
    observations = [
        replace(observation, landmarks=marks[k] if k % 2 else None)
        for k, observation in enumerate(scene.observations)
    ]
    scene = replace(scene, observations=observations)
    assert not found(scene, frames).any()
    assert found(scene, exchanged(scene, frames, range(FRAMES))).all()


def uncertain(frames: list[Frame]) -> list[Frame]:
    """Return frames with posteriors whose sides are said to be known."""
    model = Recalibration(second_side=1.0)
    return [
        replace(
            frame,
            posterior=Posterior(
                frame.pose[None], frame.translation[None], np.ones(1), False, model
            ),
        )
        for frame in frames
    ]


@pytest.mark.parametrize(
    ("wrong", "share"), [(range(16, 22), 6 / FRAMES), (range(16, 19), 0.0)]
)
def test_exchanged_frames_are_smoothed_again(
    film: tuple[Scene, list[Frame]], wrong: range, share: float
) -> None:
    """Where a fifth of them were exchanged, sides are unknown."""
    scene, frames = film
    before = smooth(scene, uncertain(exchanged(scene, frames, wrong)), None, BETA)
    tracked = uncertain(exchanged(scene, frames, wrong))
    after, which = with_cheapest_legs(tracked, before, BETA)
    assert np.flatnonzero(which).tolist() == list(wrong)
    costs = [
        np.mean([frame.cost for frame in each])
        for each in (before.frames, after.frames)
    ]
    assert costs[1] < 0.8 * costs[0]
    for frame in after.frames:
        assert frame.posterior is not None
        assert frame.posterior.poses[0] == pytest.approx(frame.pose)
        assert frame.posterior.weights == pytest.approx(
            [1.0 - share, share] if share else [1.0]
        )
        assert unknown_sides(scene.body.skeleton, frame.posterior, frame.pose) == (
            share > 0.0
        )


def test_frames_that_show_nothing_are_not_tried(
    film: tuple[Scene, list[Frame]],
) -> None:
    scene, frames = film
    here, there = (
        scene.motion(each) for each in (frames, exchanged(scene, frames, range(FRAMES)))
    )
    assert not doubtful(here, there, np.ones(FRAMES), np.arange(FRAMES) != PASSING)


def test_a_film_by_one_camera_is_tracked_with_legs_that_pass(
    film: tuple[Scene, list[Frame]],
) -> None:
    scene, frames = film
    track = tracked(scene, exchanged(scene, frames, range(PASSING, FRAMES)))
    truth, turned = (
        scene.motion(each).joints
        for each in (frames, exchanged(scene, frames, range(FRAMES)))
    )
    off = [
        np.linalg.norm(track.motion.joints - joints, axis=2).mean()
        for joints in (truth, turned)
    ]
    assert min(off) < 0.03 < 0.1 < max(off)
