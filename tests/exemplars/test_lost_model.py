"""The evidence for a frame to be lost, and the probability by it."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from posefit import Frame, mirrored_poses
from posefit.uncertainty.modes import Posterior, unknown_sides
from posefit_exemplars.lost_model import (
    EVIDENCE,
    MEAN_SECONDS,
    EvidenceMeans,
    FailureClassifier,
    LogisticModel,
    evidence_of,
    with_failure_probabilities,
)
from tests.cases import each
from tests.exemplars.conftest import Walk

EVEN = LogisticModel([], np.empty(0), 0.0)  # a half for every frame


def frame_of(walker: Walk) -> Frame:
    """Return a frame that costs 4, whose mirror image costs 7 and whose reflections cost 9 and 6."""
    pose = walker.motion.poses[0]
    mirrored = mirrored_poses(walker.motion.skeleton, pose[None])[0]
    posterior = Posterior(
        np.array([pose, mirrored]), np.zeros((2, 3)), np.array([0.75, 0.25])
    )
    details = {"usable": True, "mirror_costs": np.array([7.0, 9.0, 6.0])}
    return Frame(
        pose,
        np.zeros(3),
        4.0,
        np.array([[30, 10, 70]]),
        1,
        posterior=posterior,
        details=details,
    )


def test_features_are_evidence_and_its_means_and_missing_evidence_is_the_last() -> None:
    memory = EvidenceMeans(30.0)
    at = [*EVIDENCE].index("second")
    rows = [k * len(EVIDENCE) + at for k in range(3)]
    first = memory.features({"second": 1.0})
    assert first[rows].tolist() == [1.0, 1.0, 1.0]
    memory.features({"second": 0.0})
    third = memory.features({})
    shares = [math.exp(-1.0 / (30.0 * seconds)) for seconds in MEAN_SECONDS.values()]
    # older frames count less
    means = [share**2 / (1.0 + share + share**2) for share in shares]
    assert third[rows] == pytest.approx([0.0, *means])
    # the default
    assert first[[*EVIDENCE].index("cost")] == pytest.approx(math.log(1.0))


def test_evidence_of_a_frame(walker: Walk) -> None:
    skeleton = walker.motion.skeleton
    evidence = evidence_of(skeleton, frame_of(walker), walker.task.cameras)
    # the cheapest reflected and the mirrored one, on the scale log(cost + 1)
    expected = {
        "cost": 4.0,
        "reflected": math.log(7.0 / 5.0),
        "mirrored": math.log(8.0 / 5.0),
        "second": 0.25,
        "views": 1.0,
    }
    assert {name: evidence[name] for name in expected} == pytest.approx(expected)
    pose, mirrored = skeleton.joints(frame_of(walker).posterior.poses)
    assert evidence["farthest"] == pytest.approx(
        float(np.linalg.norm(pose - mirrored, axis=1).mean())
    )


def test_cameras_that_show_nothing_do_not_count(walker: Walk) -> None:
    evidence = []
    for visible in (1, 2, 4):
        areas = np.array([[1, 1, 1]] * visible + [[0, 0, 0]] * (5 - visible))
        frame = replace(frame_of(walker), areas=areas)
        values = evidence_of(
            walker.motion.skeleton, frame, [walker.task.cameras[0]] * 5
        )
        evidence.append((values["views"], values["across"] > 0.0))
    assert evidence == [(1.0, True), (2.0, False), (4.0, False)]


@each(("least", "unknown"), [(0.4, True), (0.6, False)])
def test_sides_are_unknown_from_a_probability_on(
    walker: Walk, least: float, unknown: bool
) -> None:
    classifier = FailureClassifier(EVEN, EVEN, least)
    frame = next(
        with_failure_probabilities([frame_of(walker)], walker.task, classifier)
    )
    assert (frame.lost, frame.details["exchanged"]) == (0.5, 0.5)
    assert unknown_sides(walker.motion.skeleton, frame.posterior, frame.pose) == unknown


@each(
    ("cameras", "odds", "unknown"),
    [
        (1, [0.3, 0.2], False),
        (1, [0.1, 0.2], True),
        (1, [-0.1, 2.0], True),  # arms do not outvote legs
        (2, [0.1, 0.2], False),
        (2, [-0.1, 4.0], True),
    ],
)
def test_landmarks_of_legs_that_contradict_make_sides_unknown(
    walker: Walk, cameras, odds, unknown
) -> None:
    classifier = FailureClassifier(EVEN, EVEN, 0.6)  # silhouettes call them known
    frame = frame_of(walker)
    task = replace(walker.task, cameras=list(walker.task.cameras)[:1] * cameras)
    details = {**frame.details, "sides": np.array(odds)}
    frame = replace(
        frame, areas=np.repeat(frame.areas, cameras, axis=0), details=details
    )
    frame = next(with_failure_probabilities([frame], task, classifier))
    assert unknown_sides(walker.motion.skeleton, frame.posterior, frame.pose) == unknown


def test_evidence_of_a_track(walker: Walk) -> None:
    def names(frames: Sequence[Frame]) -> list[set[str]]:
        assert all(
            frame.lost is not None and 0.0 < frame.lost < 1.0 for frame in frames
        )
        return [set(frame.details["evidence"]) for frame in frames]

    first, *others = names(walker.hidden(4, 6).track(0, 6, evaluations=2440))
    fit = {"cost", "reflected", "mirrored"}
    assert first == EVIDENCE.keys()
    assert others == [EVIDENCE.keys()] * 3 + [EVIDENCE.keys() - fit] * 2
