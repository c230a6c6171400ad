"""What speaks for a frame to be lost, and how likely that makes it."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.fitting.tracker import Frame
from posefit.geometry.camera import Camera
from posefit.geometry.symmetry import mirrored_poses
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.sides import unknown_sides
from posefit_exemplars.factory import exemplars
from posefit_exemplars.lost_model import (
    EVIDENCE,
    FITTED,
    MAX_SPEED,
    NAMES,
    REACHES,
    EvidenceMeans,
    FailureClassifier,
    LogisticModel,
    across,
    evidence_of,
    greatest_distance,
    root_motion,
    stored_classifier,
    with_failure_probabilities,
)
from tests.cases import cases
from tests.exemplars.conftest import EMPTY, Walk

EVEN = LogisticModel([], np.empty(0), 0.0)  # says a half of everything
WAVERING = FailureClassifier(EVEN, EVEN, 0.6)


def frame_of(walker: Walk, usable: bool = True, cost: float = 4.0) -> Frame:
    """Return a frame that costs so much, whose mirror image costs 7 and whose reflections cost 9 and 6."""
    pose = walker.motion.poses[0]
    mirrored = mirrored_poses(walker.motion.skeleton, pose[None])[0]
    posterior = Posterior(np.array([pose, mirrored]), np.zeros((2, 3)), np.array([0.75, 0.25]))
    twins = np.array([7.0, 9.0, 6.0]) if usable else np.empty(0)
    counts, details = np.array([[30, 10, 70]]), {"usable": usable, "twins": twins}
    return Frame(pose, np.zeros(3), cost, counts, 1, 0.0, np.empty(0), posterior=posterior, details=details)


def test_evidence_is_beside_its_means_and_stays_where_it_is_not_told_again() -> None:
    memory, at = EvidenceMeans(30.0), [*EVIDENCE].index("views")
    first = memory.features({"views": 1.0})
    assert [first[k * len(EVIDENCE) + at] for k in range(3)] == [1.0, 1.0, 1.0]
    memory.features({"views": 0.0})
    third = memory.features({})
    shares = [math.exp(-1.0 / (30.0 * seconds)) for seconds in REACHES.values()]
    means = [share**2 / (1.0 + share + share**2) for share in shares]  # what is older counts less
    assert [third[k * len(EVIDENCE) + at] for k in range(3)] == pytest.approx([0.0, *means])
    assert first[[*EVIDENCE].index("cost")] == pytest.approx(math.log(1.0))  # nobody has told it


def test_evidence_of_twins_is_how_many_times_as_much_the_cheapest_reflected_and_the_mirrored_one_cost(
    walker: Walk,
) -> None:
    told = evidence_of(walker.motion.skeleton, frame_of(walker), walker.task.cameras)
    # (6 + 1) / (4 + 1) and (7 + 1) / (4 + 1)
    assert (told["cost"], told["reflected"], told["mirrored"]) == pytest.approx((4.0, 1.4, 1.6))
    assert (told["second"], told["views"]) == pytest.approx((0.25, 1.0))


def test_cameras_that_see_nothing_of_him_do_not_count_and_more_than_two_count_as_two(walker: Walk) -> None:
    camera, frame = walker.task.cameras[0], frame_of(walker)
    counted = []
    for seeing in (1, 2, 4):
        areas = np.array([[1, 1, 1]] * seeing + [[0, 0, 0]] * (4 - seeing))
        told = evidence_of(walker.motion.skeleton, replace(frame, areas=areas), [camera] * 4)
        counted.append((told["views"], told["across"] > 0.0))
    assert counted == [(1.0, True), (2.0, False), (2.0, False)]


def test_who_is_seen_from_his_side_faces_across_the_only_camera() -> None:
    aside, oblique, ahead = (Camera.around(np.zeros(3), np.radians(view), 4.0, (64, 48)) for view in (90.0, 30.0, 0.0))
    told = [across([camera], 0.0, np.zeros(3)) for camera in (aside, oblique, ahead)]
    assert told == pytest.approx([1.0, 0.5, 0.0])
    assert across([aside, ahead], 0.0, np.zeros(3)) == 0.0


def test_who_goes_where_he_faces_goes_ahead() -> None:
    places = [np.array([0.0, 0.9, 0.0]), np.array([0.01, 0.9, 0.03]), np.array([0.03, 0.8, 0.04])]
    # 3 and 4 centimetres in two thirtieths of a second
    assert root_motion(places, 0.0, 30.0) == pytest.approx({"ahead": 0.6, "speed": 0.75})
    assert root_motion(places, np.pi, 30.0)["ahead"] == pytest.approx(-0.6)
    assert root_motion(places[::-1], 0.0, 30.0, backwards=True) == pytest.approx({"ahead": 0.6, "speed": 0.75})
    assert root_motion(places, np.pi / 2.0, 30.0)["ahead"] == pytest.approx(0.45)
    assert root_motion(places, 0.0, 300.0) == {"ahead": MAX_SPEED, "speed": MAX_SPEED}
    assert root_motion(places[:1], 0.0, 30.0) == {}


def test_a_probability_is_that_of_a_logistic_model() -> None:
    detector = LogisticModel.from_dict({"weights": {"farthest": 2.0, "cost, lately": -1.0}, "bias": 0.5})
    features = np.zeros(len(NAMES))
    features[NAMES.index("farthest")], features[NAMES.index("cost, lately")] = 1.0, 1.5
    assert detector.probability(features) == pytest.approx(1.0 / (1.0 + math.exp(-1.0)))
    features[NAMES.index("farthest")] = 1e9
    assert detector.probability(features) == pytest.approx(1.0)


def test_a_model_of_something_else_is_estimated() -> None:
    with pytest.raises(ValueError, match="weights must be of evidence that frames have, got weather"):
        LogisticModel.from_dict({"weights": {"weather": 1.0}, "bias": 0.0})


def test_what_is_stored_is_such_models() -> None:
    told = json.loads(FITTED.read_text(encoding="utf-8"))
    for name in ("lost", "sides"):
        assert set(told[name]["weights"]) <= set(NAMES)
        assert np.isfinite([told[name]["bias"], *told[name]["weights"].values()]).all()
    assert stored_classifier().lost.bias == told["lost"]["bias"]
    assert 0.0 < stored_classifier().unknown < 0.5


def test_the_farthest_track_is_told_in_metres(walker: Walk) -> None:
    skeleton, poses = walker.motion.skeleton, walker.motion.poses[[0, 0, 4, 8]]
    joints = skeleton.joints(poses)
    off = [float(np.linalg.norm((one - one[0]) - (joints[0] - joints[0, 0]), axis=1).mean()) for one in joints]
    told = greatest_distance(skeleton, Posterior(poses, np.zeros((4, 3)), np.ones(4)), poses[0])
    assert told == pytest.approx(max(off)) != 0.0


def test_a_frame_in_which_nobody_is_seen_has_no_cost_and_no_twins_of_its_own(walker: Walk) -> None:
    frames = list(with_failure_probabilities((frame_of(walker, one) for one in (True, False)), walker.task, WAVERING))
    assert frames[0].details["evidence"].keys() == EVIDENCE.keys() - {"ahead", "speed"}
    assert frames[1].details["evidence"].keys() == EVIDENCE.keys() - {"cost", "reflected", "mirrored"}
    assert [frame.lost for frame in frames] == [0.5] * 2


def test_sides_are_unknown_from_the_probability_on_that_is_held(walker: Walk) -> None:
    for least, unknown in cases([(0.4, True), (0.6, False)]):
        frame = next(with_failure_probabilities([frame_of(walker)], walker.task, replace(WAVERING, unknown=least)))
        assert frame.details["exchanged"] == 0.5
        assert frame.posterior is not None
        assert unknown_sides(walker.motion.skeleton, frame.posterior, frame.pose) == unknown


def test_nobody_says_where_no_tracks_are_drawn(walker: Walk) -> None:
    settings: dict[str, Any] = {"refiner": "none", "lag": 0, "smoothing": 0.0}
    for samples in (0, 2):
        tracker = exemplars(walker.task, samples=samples, **settings)
        frames = list(tracker.track(walker.seen[:2], np.random.default_rng(0)))
        assert [frame.lost is None for frame in frames] == [samples == 0] * 2


def test_everything_that_the_model_looks_at_is_told_of_a_track(walker: Walk) -> None:
    seen_then_not = [*walker.seen[:4], *(replace(one, silhouettes=EMPTY, usable=False) for one in walker.seen[4:6])]
    frames = list(exemplars(walker.task, refiner="none").track(seen_then_not, np.random.default_rng(0)))
    told = set().union(*(frame.details["evidence"] for frame in frames))
    assert told == set(EVIDENCE)
    assert all(frame.lost is not None and 0.0 < frame.lost < 1.0 for frame in frames)
