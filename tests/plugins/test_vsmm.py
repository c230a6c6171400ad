"""The vsmm tracker on what goes wrong: nothing to see, pieces, borders, wrong files; and whole, by name."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit import Body, Camera, Frame, Observation, Silhouette, Task, project
from posefit.fitting import metrics
from posefit.fitting.landmarks import GROUPS, MIRRORED
from posefit.geometry.skeleton import joint_distances
from posefit.motion import built_in
from posefit.testing import check_tracker
from posefit_vsmm import tracker
from posefit_vsmm.groups import TOPOLOGY, most_probable
from posefit_vsmm.switching import Switching
from posefit_vsmm.tracker import MAX_BLIND_FRAMES, VSMM
from tests.cases import each

SIZE = (200, 240)


def seen(
    name: str = "jacks-b", frames: int = 40, azimuth: float = 0.1
) -> tuple[Task, list[Observation]]:
    """Return a task and what is seen of a built-in motion, from the front."""
    motion = built_in.motion(name, frames=frames)
    body = Body.of(motion.skeleton)
    camera = Camera.around(np.array([0.0, 1.05, 0.0]), azimuth, 4.4, SIZE)
    placed = zip(motion.poses, motion.translations, strict=True)
    observations = [
        Observation([Silhouette.of(project(body, camera, *at))]) for at in placed
    ]
    return Task(
        body, [camera], 600, 0.0, motion.translations[0], "aligned"
    ), observations


def blank(one: Observation) -> Observation:
    return Observation([Silhouette.of(np.zeros_like(one.silhouettes[0].mask))])


def follow(task: Task, observations: list[Observation], **settings: Any) -> list[Frame]:
    frames = list(VSMM(task, **settings).track(observations, np.random.default_rng(0)))
    assert len(frames) == len(observations)
    for frame in frames:
        assert np.isfinite([*frame.pose, *frame.translation, frame.cost]).all()
        if "probabilities" in frame.details:
            assert np.isclose(frame.details["probabilities"].sum(), 1.0)
    return frames


def iou(frames: list[Frame]) -> np.ndarray:
    return np.array([metrics.iou(frame.areas)[0] for frame in frames])


@pytest.mark.slow
def test_it_keeps_the_rules_of_a_tracker() -> None:
    result = check_tracker(VSMM)
    assert result, str(result)


@each("exchanged", [False, True])
def test_landmarks_bring_the_pose_nearer_though_a_detector_exchanges_legs(
    exchanged: bool,
) -> None:
    task, observations = seen("walk-b", azimuth=1.4)
    motion = built_in.motion("walk-b", frames=len(observations))
    given = []
    for k, (one, joints) in enumerate(zip(observations, motion.joints, strict=True)):
        found = np.column_stack(
            [task.cameras[0].project(joints)[0], np.ones(len(joints))]
        )
        if exchanged and k % 4 == 0:
            found[GROUPS[0]] = found[MIRRORED[GROUPS[0]]]
        given.append(replace(one, landmarks=found[None]))

    def error(observations: list[Observation]) -> float:
        poses = np.array([frame.pose for frame in follow(task, observations)])
        return float(
            joint_distances(
                motion.skeleton.joints(motion.poses), motion.skeleton.joints(poses)
            ).mean()
        )

    assert error(given) < 0.9 * error(observations)


@each("gap", [1, 10])
def test_a_short_gap_is_coasted_through(gap: int) -> None:
    task, observations = seen()
    for k in range(15, 15 + gap):
        observations[k] = blank(observations[k])
    frames = follow(task, observations)
    assert not any(frame.details["lost"] for frame in frames)
    # no fresh estimation
    assert [frame.evaluations for frame in frames[1:]] == [1] * (len(frames) - 1)
    assert iou(frames)[-8:].mean() > 0.5


def test_after_a_long_gap_the_track_is_lost_and_estimated_again() -> None:
    task, observations = seen(frames=100)
    for k in range(15, 75):
        observations[k] = blank(observations[k])
    frames = follow(task, observations)
    lost = [k for k, frame in enumerate(frames) if frame.details["lost"]]
    assert lost == list(range(15 + MAX_BLIND_FRAMES, 75))
    assert all(np.array_equal(frames[k].pose, frames[lost[0] - 1].pose) for k in lost)
    assert frames[75].evaluations > 100  # estimated again
    assert iou(frames)[76:].mean() > 0.5


def test_frames_that_never_show_the_person() -> None:
    task, observations = seen(frames=5)
    frames = follow(task, [blank(one) for one in observations])
    assert all(frame.details["lost"] and frame.evaluations == 0 for frame in frames)


def test_moving_things_other_than_people_do_not_fail_a_track() -> None:
    task, observations = seen(frames=24)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    # its skeleton is a point: no end points
    disc = (rows - 120) ** 2 + (columns - 100) ** 2 < 40**2
    dot = (rows == 100) & (columns == 100)
    for k, change in enumerate(
        (
            lambda mask: disc,
            lambda mask: mask & (rows % 30 > 3),  # pieces
            lambda mask: np.roll(mask, 90, axis=1) & (columns >= 40),  # at the border
            lambda mask: dot,
            np.ones_like,
        )
    ):
        mask = change(observations[6 + 3 * k].silhouettes[0].mask)
        observations[6 + 3 * k] = Observation([Silhouette.of(mask)])
    frames = follow(task, observations)
    assert iou(frames)[:6].mean() > 0.5


def test_an_activity_is_as_probable_as_its_models_together() -> None:
    models = ("stiff-walk", "walk", "jacks")
    assert (
        most_probable(TOPOLOGY.activities, models, np.array([0.3, 0.3, 0.4])) == "walk"
    )
    assert (
        most_probable(TOPOLOGY.activities, models, np.array([0.2, 0.2, 0.6])) == "jacks"
    )


@each(
    "settings",
    [
        {"structure": "all"},
        {"variant": "patent"},
        {"variant": "patent", "recovery": True},
    ],
)
def test_other_forms_run(settings: dict[str, Any]) -> None:
    task, observations = seen(frames=40)
    poses = np.array([frame.pose for frame in follow(task, observations, **settings)])
    assert poses.shape == (40, 66)
    assert len(np.unique(poses, axis=0)) > 20  # it moves, and is not held


# VSMM 7
def test_the_rules_of_a_frame_look_at_the_joints_detected_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recorded: list[np.ndarray] = []
    cycle = Switching.cycle
    monkeypatch.setattr(
        Switching,
        "cycle",
        lambda self, *given: (recorded.append(given[-1]), cycle(self, *given))[1],
    )
    frames = follow(*seen(frames=6))
    for frame, points in zip(frames, recorded, strict=True):
        assert np.array_equal(points, frame.details["joints"][0])


def test_a_setting_counts_for_every_variant() -> None:
    task, observations = seen(frames=30)
    for k in range(5, 30):
        observations[k] = blank(observations[k])
    # without recovery a track is never lost
    cases = (
        ("default", None, True),
        ("default", False, False),
        ("patent", None, False),
        ("patent", True, True),
    )
    for variant, recovery, lost in cases:
        frames = follow(task, observations, variant=variant, recovery=recovery)
        assert frames[-1].details["lost"] == lost


@each("variant", ["default", "patent"])
def test_a_hidden_joint_is_at_the_position_that_its_filter_predicts(
    variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    task, observations = seen(frames=5)
    observations[3] = blank(observations[3])  # where no joint is detected
    measured: list[np.ndarray] = []
    # where no joint is expected
    marks = np.arange(17)[:, None] + np.array([1000.0, 2000.0])
    monkeypatch.setattr(tracker.JointFilter, "follow", lambda *_: marks)
    measure = tracker.JointCameras.measure

    def recorded(self: Any, states: Any, joints: Any, known: Any) -> Any:
        measured.append(joints[0].points[joints[0].confidence > 0.0])
        return measure(self, states, joints, known)

    monkeypatch.setattr(tracker.JointCameras, "measure", recorded)
    hidden_joints = 0
    # VSMM 2.7, Interpretation V9
    for frame in follow(task, observations, variant=variant):
        hidden = frame.details["confidence"][0] == 0.0
        np.testing.assert_array_equal(frame.details["joints"][0][hidden], marks[hidden])
        assert (frame.details["joints"][0][~hidden] < 1000.0).all()
        hidden_joints += int(hidden.sum())
    assert hidden_joints >= 17
    assert any((points >= 1000.0).any() for points in measured) is (variant == "patent")
