"""What speaks for a frame to be lost, and how likely that makes it."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.fitting.tracker import Frame
from posefit.posterior.modes import Posterior
from posefit_exemplars.beam import Beam
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.factory import exemplars
from posefit_exemplars.lost import (
    EVIDENCE,
    FITTED,
    NAMES,
    Detector,
    Memory,
    doubted,
    drawn_evidence,
    evidence,
    stored_detector,
)
from posefit_exemplars.window import Seen, seen, way
from tests.exemplars.conftest import EMPTY, Walk

EVEN = Detector([], np.empty(0), 0.0)  # says a half of everything


def window(clips: Exemplars, states: list[int], fits: list[list[float]], step: float) -> list[Seen]:
    """Return frames whose states are the same poses, with these costs; another pose costs a step."""
    count = len(states)
    beam = Beam(np.array(states), np.zeros(count), np.full(count, -1), np.zeros(count), np.zeros((count, 3)))
    steps = step * (1.0 - np.eye(count))
    found: list[Seen] = []
    for fit in fits:
        found.append(seen(beam, np.array(fit), found[-1] if found else None, steps if found else None))
    return found


def pose_of(clips: Exemplars, state: int) -> Any:
    pose = clips.poses[state].copy()
    pose[0] = 0.0
    return pose


def test_costs_are_in_units_of_cost_and_means_are_over_the_frames_that_wait(small: Exemplars) -> None:
    frames = window(small, [0, 7], [[3.0, 4.0], [5.0, 5.5], [1.0, 9.0]], 6.0)
    assert way(frames) == [0, 0, 0]
    told = evidence(frames, [True] * 3, np.array([0.9, 0.1]), small, pose_of(small, 0), 2.0)
    assert (told["least"], told["path"]) == (6.0, 6.0)
    assert told["least_on"] == told["path_on"] == pytest.approx(2.0 * (3.0 + 5.0 + 1.0) / 3.0)
    assert (told["step_mean"], told["step_most"]) == (0.0, 0.0)
    assert told["surprise"] == 0.0  # nothing came before
    assert told["entropy"] == pytest.approx(-0.9 * math.log(0.9) - 0.1 * math.log(0.1))
    assert told["off"] == told["nearest"] == pytest.approx(0.0, abs=1e-3)
    assert told["agreement"] == pytest.approx(
        sum(math.sqrt(a * b) for a, b in zip([0.9, 0.1], frames[0].forward, strict=True))
    )


def test_a_silhouette_that_no_step_leads_to_is_a_surprise(small: Exemplars) -> None:
    steady, sudden = (window(small, [0, 7], [[0.0, 30.0], fit], 6.0)[1] for fit in ([0.0, 30.0], [30.0, 0.0]))
    assert steady.surprise == pytest.approx(0.0, abs=0.01)
    # all but nothing was expected at the second state: one part in 1 + e^6 steps there
    assert sudden.surprise == pytest.approx(math.log(1.0 + math.exp(6.0)), abs=0.01)


def test_states_that_are_far_from_what_is_told_spread_by_their_weights(small: Exemplars) -> None:
    away = int(((small.codes - small.codes[0]) ** 2).sum(axis=1).argmax())
    apart = float(np.linalg.norm(small.codes[away] - small.codes[0]))
    assert apart > 0.15
    frames = window(small, [0, away], [[0.0, 0.0]], 6.0)
    told = evidence(frames, [True], np.array([0.75, 0.25]), small, pose_of(small, 0), 2.0)
    assert told["spread"] == pytest.approx(0.5 * apart, rel=1e-2)
    assert told["forward_spread"] == pytest.approx(math.sqrt(0.5) * apart, rel=1e-2)
    assert (told["far"], told["forward_far"], told["turned"]) == (0.25, 0.5, 0.0)
    assert "step_mean" not in told


def test_who_is_not_seen_has_no_costs_of_his_own(small: Exemplars) -> None:
    frames = window(small, [0, 7], [[0.0, 0.0], [5.0, 6.0]], 6.0)
    told = evidence(frames, [False, True], np.array([0.5, 0.5]), small, pose_of(small, 0), 1.0)
    assert not {"least", "path", "surprise", "off", "nearest"} & told.keys()
    assert told["least_on"] == 5.0
    unseen = evidence(frames[:1], [False], np.array([0.5, 0.5]), small, pose_of(small, 0), 1.0)
    assert not {"least_on", "path_on", "surprise_on"} & unseen.keys()


def test_evidence_is_beside_its_mean_so_far_and_stays_where_it_is_not_told_again() -> None:
    memory, at = Memory(30.0), [*EVIDENCE].index("far")
    first = memory.features({"far": 1.0})
    assert (first[at], first[len(EVIDENCE) + at]) == (1.0, 1.0)
    memory.features({"far": 0.0})
    third = memory.features({})
    share = math.exp(-1.0 / 6.0)  # a fifth of a second is six frames
    assert (third[at], third[len(EVIDENCE) + at]) == (0.0, pytest.approx(share**2))
    assert first[[*EVIDENCE].index("cost")] == pytest.approx(math.log(1.0))  # nobody has told it


def test_a_probability_is_that_of_a_logistic_model() -> None:
    detector = Detector.from_dict({"weights": {"far": 2.0, "cost, so far": -1.0}, "bias": 0.5})
    features = np.zeros(len(NAMES))
    features[NAMES.index("far")], features[NAMES.index("cost, so far")] = 1.0, 1.5
    assert detector.probability(features) == pytest.approx(1.0 / (1.0 + math.exp(-1.0)))
    features[NAMES.index("far")] = 1e9
    assert detector.probability(features) == pytest.approx(1.0)


def test_a_model_of_something_else_is_told() -> None:
    with pytest.raises(ValueError, match="weights must be of evidence that frames have, got weather"):
        Detector.from_dict({"weights": {"weather": 1.0}, "bias": 0.0})


def test_what_is_stored_is_such_a_model() -> None:
    told = json.loads(FITTED.read_text(encoding="utf-8"))
    assert set(told["weights"]) <= set(NAMES)
    assert np.isfinite([told["bias"], *told["weights"].values()]).all()
    assert stored_detector().bias == told["bias"]


def test_tracks_of_the_posterior_say_how_far_they_are_from_what_is_told(walker: Walk) -> None:
    skeleton, poses = walker.motion.skeleton, walker.motion.poses[[0, 0, 0, 8]]
    joints = skeleton.joints(poses)
    off = float(np.linalg.norm((joints[3] - joints[3, 0]) - (joints[0] - joints[0, 0]), axis=1).mean())
    told = drawn_evidence(skeleton, Posterior(poses, np.zeros((4, 3)), np.ones(4)), poses[0])
    assert told["samples"] == pytest.approx(off / 4.0)
    assert told["samples_most"] == pytest.approx(off)
    assert told["samples_far"] == (0.25 if off > 0.15 else 0.0)


def test_frames_count_since_when_nobody_was_seen(walker: Walk) -> None:
    pose, areas = walker.motion.poses[0], np.array([[30, 10, 70]])
    base = Frame(
        pose,
        np.zeros(3),
        4.0,
        areas,
        1,
        0.0,
        np.empty(0),
        posterior=Posterior(pose[None], np.zeros((1, 3)), np.ones(1)),
    )
    each = [{"least": 1.0}, {}, {}, {"least": 1.0}]
    frames = list(doubted((replace(base, details={"evidence": one}) for one in each), walker.task, EVEN))
    assert [frame.details["evidence"]["unseen"] for frame in frames] == [0.0, 1.0, 2.0, 0.0]
    assert frames[0].details["evidence"]["missed"] == pytest.approx(0.3)
    assert frames[0].details["evidence"]["spilled"] == pytest.approx(0.125)
    assert "cost" not in frames[1].details["evidence"]
    assert [frame.lost for frame in frames] == [0.5] * 4


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
