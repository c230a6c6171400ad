"""What a track says of its own doubts: measures by hand, blank fields, sentences, and what is kept of them."""

import csv
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.skeleton import JOINTS
from posefit.geometry.symmetry import mirrored_poses, turned_poses
from posefit.motion import built_in
from posefit.tracking.evaluation import evaluated as evaluate
from posefit.tracking.outputs import OutputFolder
from posefit.tracking.pipeline import track_scene
from posefit.tracking.table import table, undetermined
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from tests.cases import each
from tests.files import arrays
from tests.tracking.test_evaluation import frame_of

FRAMES = 6
SPREAD = Recalibration(joint_spreads=np.full(len(JOINTS), 0.02))


def walk() -> Scene:
    return synthetic(built_in.motion("walk", frames=FRAMES), [45.0], (160, 120), [], (None, None))


def doubtful(scene: Scene, mirrored: Array, turned: float = 0.0, coherent: bool = False) -> list[Frame]:
    """Return frames that are right, and say that they are mirrored with such weights (T,), or the other way round."""
    truth = scene.truth
    assert truth is not None
    frames = []
    for k in range(FRAMES):
        pose, place = truth.poses[k], truth.translations[k]
        poses = [pose, mirrored_poses(truth.skeleton, pose[None])[0], turned_poses(pose[None])[0]]
        weights = np.array([1.0 - mirrored[k] - turned, mirrored[k], turned])
        posterior = Posterior(np.array(poses), np.tile(place, (3, 1)), weights, coherent, SPREAD)
        frames.append(replace(frame_of(scene, pose, place, scene.observations[k]), posterior=posterior))
    return frames


def evaluated(scene: Scene, frames: Iterable[Frame]) -> tuple[list[dict[str, float]], Any]:
    truth = scene.truth
    assert truth is not None
    return evaluate(scene, list(frames), None, truth.poses[:, 3:], 0.5)


def test_where_nobody_says_anything_nothing_is_said() -> None:
    scene = walk()
    rows, measures = evaluated(scene, [replace(frame, posterior=None) for frame in doubtful(scene, np.zeros(FRAMES))])
    said = ("coverage", "interval_mm", "unknown_rate", "swapped_known_rate", "lost_said_rate")
    assert [getattr(measures, name) for name in said] == [None] * 5
    assert np.isnan([[row["unknown_sides"], row["lost"]] for row in rows]).all()


def test_sides_are_unknown_where_the_mirror_image_is_likely() -> None:
    scene = walk()
    rows, measures = evaluated(scene, doubtful(scene, np.array([0.0, 0.1, 0.19, 0.2, 0.5, 0.0])))
    assert [row["unknown_sides"] for row in rows] == [0, 0, 0, 1, 1, 0]
    assert measures.unknown_rate == pytest.approx(2 / 6)
    assert measures.swapped_known_rate == 0.0


def test_frames_that_are_swapped_count_among_those_that_are_known() -> None:
    scene = walk()
    frames = doubtful(scene, np.array([0.0, 0.0, 0.5, 0.5, 0.0, 0.0]))
    skeleton = scene.body.skeleton
    wrong = {k: mirrored_poses(skeleton, frames[k].pose[None])[0] for k in (1, 2)}
    # of frame 1 the posterior says nothing else: known, and swapped. Frame 2 is swapped, and half of it says so
    alone = Posterior(wrong[1][None], np.zeros((1, 3)), np.ones(1))
    frames[1] = replace(frames[1], pose=wrong[1], posterior=alone)
    frames[2] = replace(frames[2], pose=wrong[2])
    rows, measures = evaluated(scene, frames)
    assert [row["swapped"] for row in rows] == [0, 1, 1, 0, 0, 0]
    assert [row["unknown_sides"] for row in rows] == [0, 0, 1, 1, 0, 0]
    assert measures.swap_rate == pytest.approx(2 / 6)
    assert measures.swapped_known_rate == pytest.approx(1 / 4)


def test_coverage_is_the_share_of_joints_that_are_near_enough() -> None:
    scene = walk()
    truth = scene.truth
    assert truth is not None
    one = doubtful(scene, np.zeros(FRAMES))
    # right in all frames: within every ball. A body that faces the other way: hardly one joint within the smallest
    assert evaluated(scene, one)[1].coverage == {"50": 1.0, "80": 1.0, "95": 1.0}
    other = [replace(frame, pose=turned_poses(frame.pose[None])[0]) for frame in one]
    lost = [replace(f, posterior=Posterior(f.pose[None], np.zeros((1, 3)), np.ones(1), False, SPREAD)) for f in other]
    skeleton = truth.skeleton
    off = np.linalg.norm(skeleton.joints(truth.poses) - skeleton.joints(np.array([f.pose for f in lost])), axis=2)
    within = {"50": 1.5382, "80": 2.1544, "95": 2.7955}  # quantiles of Maxwell's law
    found_within = evaluated(scene, lost)[1].coverage
    assert found_within == {name: pytest.approx((off[:, 1:] <= 0.02 * r).mean()) for name, r in within.items()}


def test_the_width_is_the_mean_radius_of_the_frames_that_say_one() -> None:
    scene = walk()
    frames = doubtful(scene, np.zeros(FRAMES))
    frames[2] = replace(frames[2], posterior=None)
    _, measures = evaluated(scene, frames)
    # nothing but the pose itself, blurred by 2 cm: Maxwell's law
    assert measures.interval_mm == {
        name: pytest.approx(20.0 * r, abs=0.5) for name, r in {"50": 1.5382, "80": 2.1544, "95": 2.7955}.items()
    }
    unknown_truth = replace(scene, truth=None)
    without = evaluate(unknown_truth, frames, None, np.zeros((1, 63)), 0.5)[1]
    assert without.interval_mm == measures.interval_mm
    assert without.coverage is None


@each(
    ("sides", "lost", "said"),
    [
        (41, 3, "left and right: unknown in 41 of 60 frames; 3 frames lost"),
        (41, 0, "left and right: unknown in 41 of 60 frames"),
        (1, 1, "left and right: unknown in 1 of 60 frames; 1 frame lost"),
        (0, 3, "3 of 60 frames lost"),
        (0, 0, ""),
        (None, None, ""),
    ],
)
def test_one_sentence_says_what_was_not_determined(sides: int | None, lost: int | None, said: str) -> None:
    numbers = {name: None if count is None else list(range(count)) for name, count in (("s", sides), ("l", lost))}
    assert undetermined({"frames": 60, "unknown_sides": numbers["s"], "lost_frames": numbers["l"]}) == said


def test_frames_are_said_lost_from_a_half_on() -> None:
    scene = walk()
    frames = doubtful(scene, np.zeros(FRAMES))
    rows, measures = evaluated(
        scene, [replace(frame, lost=0.25 * k) for k, frame in enumerate(frames[:5])] + frames[5:]
    )
    assert measures.lost_said_rate == pytest.approx(3 / 5)
    assert [row["lost"] for row in rows[:5]] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert np.isnan(rows[5]["lost"])


def test_what_is_no_probability_is_told() -> None:
    for lost in [-0.1, 1.5, float("nan")]:
        frame = doubtful(walk(), np.zeros(FRAMES))[0]
        with pytest.raises(ValueError, match=f"lost of a frame must lie in 0 to 1, got {lost}"):
            replace(frame, lost=lost)


@dataclass(frozen=True)
class Told:
    """A tracker that says what it was given."""

    frames: list[Frame]
    first: int = 0

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        for k, _ in enumerate(observations, self.first):
            yield self.frames[k]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return what follows a walk with a tracker that says some frames."""
    from posefit.tracking import method

    def of(frames: list[Frame], scene: Scene, **how: Any) -> posefit.Track:
        training = [built_in.motion("walk-b", frames=20)]

        def tracker(_: object, task: Task, *_how: object) -> Told:
            return Told(frames, len(task.before))

        monkeypatch.setattr(method.Method, "tracker", tracker)
        return track_scene(scene, training, **how)

    return of


def test_what_is_held_or_lost_is_blank_for_other_programs_and_marked_in_the_table(told: Any, tmp_path: Path) -> None:
    scene = walk()
    seen = list(scene.observations)
    seen[1] = replace(seen[1], usable=False)
    frames = doubtful(scene, np.array([0.0, 0.0, 0.3, 0.4, 0.5, 0.0]), coherent=True)
    frames = [replace(frame, lost=0.9 if k == 4 else 0.1) for k, frame in enumerate(frames)]
    with OutputFolder(tmp_path / "out", False, False, {}, print) as output:
        result = told(frames, replace(scene, observations=seen), output=output)
    lines = (tmp_path / "out" / "track.trc").read_text().splitlines()[6:]
    fields = [line.split("\t") for line in lines]
    assert [len(one) for one in fields] == [2 + 81] * FRAMES
    assert [k for k, one in enumerate(fields) if set(one[2:]) == {""}] == [1, 4]
    assert all("" not in one for k, one in enumerate(fields) if k not in (1, 4))
    with (tmp_path / "out" / "frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with (tmp_path / "out" / "angles.csv").open(newline="") as file:
        angles = list(csv.DictReader(file))
    assert [k for k, row in enumerate(angles) if row["left_knee_flexion"] == ""] == [1, 4]
    assert [k for k, row in enumerate(rows) if row["left_knee_x"] == ""] == [1, 4]
    assert [row["usable"] for row in rows] == ["1.0", "0.0", "1.0", "1.0", "1.0", "1.0"]
    assert [row["lost"] for row in rows] == ["0.1", "0.1", "0.1", "0.1", "0.9", "0.1"]
    stored = arrays(tmp_path / "out" / "poses.npz")
    assert stored["levels"].tolist() == [0.5, 0.8, 0.95]
    assert stored["angle_halves"].shape == (FRAMES, 3, 66)
    # nothing but the pose itself, blurred by 2 cm: Maxwell's law
    np.testing.assert_allclose(stored["joint_radii"][0, :, 1], 0.02 * np.array([1.5382, 2.1544, 2.7955]), atol=5e-4)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["unknown_sides"] == [2, 3, 4]
    assert summary["lost_frames"] == [4]
    assert summary["lost_said_rate"] == pytest.approx(1 / 6)
    text = table(result.summary)
    assert "\nleft and right: unknown in 3 of 6 frames; 1 frame lost\n" in text


def test_frames_and_tracks_have_modes(told: Any) -> None:
    scene = walk()
    frames = doubtful(scene, np.zeros(FRAMES), turned=0.25, coherent=True)
    result = told(frames, scene)
    for frame, given in zip(result.found, frames, strict=True):
        assert [mode.weight for mode in frame.modes] == pytest.approx([0.75, 0.25])
        np.testing.assert_array_equal(frame.modes[0].pose, given.pose)
    assert result.summary["modes"] == pytest.approx([0.75, 0.25])
    assert result.modes[0].poses.shape == (FRAMES, 66)
    # whose body faces the other way has his left where his right was
    assert "left and right: unknown in 6 of 6 frames" in table(result.summary)
    assert "frames lost" not in table(result.summary)


def test_the_summary_says_how_likely_no_mode_of_a_frame_is_right(told: Any) -> None:
    scene = walk()
    shown = doubtful(scene, np.zeros(FRAMES), turned=0.25)
    frames = []
    for k, frame in enumerate(shown):
        assert frame.posterior is not None
        learned = Recalibration(none=0.1 * k)
        frames.append(replace(frame, posterior=replace(frame.posterior, recalibration=learned)))
    result = told(frames, scene)
    assert result.summary["none_of_modes"] == pytest.approx(0.25)
    assert [mode.weight for mode in result.found[5].modes] == pytest.approx([0.375, 0.125])


def test_rows_that_are_no_tracks_make_no_modes_of_the_whole(told: Any) -> None:
    scene = walk()
    result = told(doubtful(scene, np.zeros(FRAMES), turned=0.25), scene)
    assert len(result.found[0].modes) == 2
    assert result.modes == []
    assert result.summary["modes"] is None


def test_a_track_that_goes_on_keeps_what_was_said_before(told: Any, tmp_path: Path) -> None:
    scene = walk()
    frames = [replace(one, lost=0.75) for one in doubtful(scene, np.full(FRAMES, 0.3), coherent=True)]
    stopped = [*frames[:3], None]  # which cannot be recorded
    with pytest.raises(AttributeError), OutputFolder(tmp_path / "out", False, False, {}, print) as output:
        told(stopped, scene, output=output)
    with OutputFolder(tmp_path / "out", False, True, {}, print) as output:
        result = told(frames, scene, output=output)
    assert result.summary["unknown_sides"] == list(range(FRAMES))
    assert result.summary["lost_frames"] == list(range(FRAMES))
    assert result.summary["modes"] is None  # nobody knows which of the new tracks goes on with which of the old ones
    for given, frame in zip(frames, result.found, strict=True):
        assert given.posterior is not None
        assert frame.posterior is not None
        np.testing.assert_allclose(frame.posterior.poses, given.posterior.poses, atol=1e-6)
        assert frame.posterior.recalibration is not None
        np.testing.assert_array_equal(frame.posterior.recalibration.joint_spreads, SPREAD.joint_spreads)
