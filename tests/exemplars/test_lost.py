"""What speaks for a frame to be lost, and how likely that makes it."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.fitting.tracker import Frame
from posefit.posterior.modes import Posterior
from posefit_exemplars.factory import exemplars
from posefit_exemplars.lost import (
    EVIDENCE,
    FITTED,
    NAMES,
    Detector,
    Memory,
    doubted,
    farthest,
    stored_detector,
)
from tests.exemplars.conftest import EMPTY, Walk

EVEN = Detector([], np.empty(0), 0.0)  # says a half of everything


def test_evidence_is_beside_its_mean_so_far_and_stays_where_it_is_not_told_again() -> None:
    memory, at = Memory(30.0), [*EVIDENCE].index("views")
    first = memory.features({"views": 1.0})
    assert (first[at], first[len(EVIDENCE) + at]) == (1.0, 1.0)
    memory.features({"views": 0.0})
    third = memory.features({})
    share = math.exp(-1.0 / 6.0)  # a fifth of a second is six frames
    assert (third[at], third[len(EVIDENCE) + at]) == (0.0, pytest.approx(share**2))
    assert first[[*EVIDENCE].index("cost")] == pytest.approx(math.log(1.0))  # nobody has told it


def test_a_probability_is_that_of_a_logistic_model() -> None:
    detector = Detector.from_dict({"weights": {"farthest": 2.0, "cost, so far": -1.0}, "bias": 0.5})
    features = np.zeros(len(NAMES))
    features[NAMES.index("farthest")], features[NAMES.index("cost, so far")] = 1.0, 1.5
    assert detector.probability(features) == pytest.approx(1.0 / (1.0 + math.exp(-1.0)))
    features[NAMES.index("farthest")] = 1e9
    assert detector.probability(features) == pytest.approx(1.0)


def test_a_model_of_something_else_is_told() -> None:
    with pytest.raises(ValueError, match="weights must be of evidence that frames have, got weather"):
        Detector.from_dict({"weights": {"weather": 1.0}, "bias": 0.0})


def test_what_is_stored_is_such_a_model() -> None:
    told = json.loads(FITTED.read_text(encoding="utf-8"))
    assert set(told["weights"]) <= set(NAMES)
    assert np.isfinite([told["bias"], *told["weights"].values()]).all()
    assert stored_detector().bias == told["bias"]


def test_the_farthest_track_is_told_in_metres(walker: Walk) -> None:
    skeleton, poses = walker.motion.skeleton, walker.motion.poses[[0, 0, 4, 8]]
    joints = skeleton.joints(poses)
    off = [float(np.linalg.norm((one - one[0]) - (joints[0] - joints[0, 0]), axis=1).mean()) for one in joints]
    told = farthest(skeleton, Posterior(poses, np.zeros((4, 3)), np.ones(4)), poses[0])
    assert told == pytest.approx(max(off)) != 0.0


def test_a_frame_in_which_nobody_is_seen_has_no_cost_of_its_own(walker: Walk) -> None:
    pose = walker.motion.poses[0]
    posterior = Posterior(pose[None], np.zeros((1, 3)), np.ones(1))
    base = Frame(pose, np.zeros(3), 4.0, np.array([[30, 10, 70]]), 1, 0.0, np.empty(0), posterior=posterior)
    frames = list(doubted((replace(base, details={"usable": one}) for one in (True, False)), walker.task, EVEN))
    assert frames[0].details["evidence"] == {"cost": 4.0, "farthest": pytest.approx(0.0), "views": 1.0}
    assert frames[1].details["evidence"].keys() == {"farthest", "views"}
    assert [frame.lost for frame in frames] == [0.5] * 2


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
