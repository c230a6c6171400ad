"""What a track is worth: baselines, errors where the body is not the person's, and how certain the method is."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.evaluation import errors
from posefit.evaluation.errors import Table, evaluated, nearest
from posefit.evaluation.measures import Effort, Measures
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.body import varied
from posefit.geometry.symmetry import mirrored_poses, turned_poses
from posefit.motion.clips import training_clips
from posefit.output.folder import OutputFolder
from posefit.output.text import detailed
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.shared import depth_halves, in_footage, shared_spreads
from tests.files import arrays, csv_rows
from tests.tracking.scenes import (
    MAXWELL,
    SPREAD,
    exact_frames,
    frame_of,
    tracked,
    uncertain_frames,
    walk,
)

FRAMES = 6
VIEWS = (45.0, 135.0)
CERTAIN = np.zeros(FRAMES)


def measures_of(
    scene: Scene, training: Array | None = None, shaken_mm: float = 0.0
) -> Measures:
    """Return what the true track of a scene is worth, whose root goes up and down by so much from frame to frame."""
    truth = scene.truth
    places = truth.translations + np.outer(
        (-1.0) ** np.arange(len(truth)), [0.0, 0.5e-3 * shaken_mm, 0.0]
    )
    frames = [
        frame_of(scene, *values)
        for values in zip(truth.poses, places, scene.observations, strict=True)
    ]
    return evaluated(
        scene,
        frames,
        None,
        truth.poses[:, 3:] if training is None else training,
        0.5,
        Effort(1.0, 1.0),
    )[1]


@pytest.mark.parametrize("size", [(320, 240), (64, 48)])
def test_small_pictures_lead_to_the_nearest_pose(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    training = np.concatenate(
        [clip.motion(30.0).poses[:, 3:] for clip in training_clips(["library:02,16"])]
    )
    scene = walk(FRAMES, VIEWS, size)
    poses = []
    for limit in (len(training) - 1, len(training)):
        monkeypatch.setattr(errors, "MAX_FULL_SIZE_POSES", limit)
        poses.append(
            [nearest(scene, training, k, scene.observations[k]) for k in range(FRAMES)]
        )
    assert np.array_equal(*poses)


def test_baselines_are_reported_in_millimetres_too() -> None:
    scene = walk(FRAMES, VIEWS)
    truth = scene.truth
    measures = measures_of(scene, np.tile(truth.poses[:1, 3:], (2, 1)))
    baselines = measures.baselines_mm
    joints = [
        scene.body.skeleton.joints(poses)
        for poses in (truth.poses, np.tile(truth.poses[0], (FRAMES, 1)))
    ]
    assert baselines["persistence"] == pytest.approx(
        metrics.mpjpe_mm(*joints).mean(), abs=1e-6
    )
    # of two poses that are one
    assert baselines["mean_pose"] == baselines["nearest"] > 0.0
    assert measures.mpjpe_mm == 0.0


def test_the_truth_has_its_own_bones_whatever_the_body_is() -> None:
    exact = walk(FRAMES, VIEWS)
    scene = replace(exact, body=varied(exact.body, 10.0, np.random.default_rng(1)))
    measures = measures_of(scene)
    joints = [
        body.skeleton.joints(exact.truth.poses) for body in (exact.body, scene.body)
    ]
    assert measures.mpjpe_mm == pytest.approx(
        metrics.mpjpe_mm(*joints).mean(), abs=1e-6
    )
    assert measures.mpjpe_mm > 1.0
    assert measures.error_degrees.mean == 0.0


def test_acceleration_and_foot_slide_are_compared_with_the_truth() -> None:
    scene = walk(40, size=(64, 48))
    exact = measures_of(scene)
    shaken = measures_of(scene, shaken_mm=10.0)
    assert exact.acceleration_ratio == 1.0
    # to go up and down by 10 mm thirty times a second is a second difference of 20 mm
    assert shaken.acceleration == pytest.approx(0.02 * 900.0, rel=0.2)
    assert shaken.acceleration_ratio == pytest.approx(
        shaken.acceleration / exact.acceleration
    )
    # up and down is along no ground
    assert shaken.foot_slide_mm == pytest.approx(exact.foot_slide_mm)
    single = measures_of(walk(1, size=(64, 48)))
    assert (single.acceleration, single.acceleration_ratio, single.foot_slide_mm) == (
        None,
        None,
        None,
    )


@pytest.fixture(scope="module")
def scene() -> Scene:
    return walk(FRAMES, size=(160, 120))


def measured(scene: Scene, frames: list[Frame]) -> tuple[Table, Measures]:
    return evaluated(
        scene, frames, None, scene.truth.poses[:, 3:], 0.5, Effort(1.0, 1.0)
    )


def test_nothing_is_reported_of_a_method_that_reports_no_certainty(
    scene: Scene,
) -> None:
    columns, measures = measured(scene, exact_frames(scene))
    names = (
        "coverage",
        "interval_mm",
        "unknown_rate",
        "swapped_known_rate",
        "lost_flagged_rate",
    )
    assert [getattr(measures, name) for name in names] == [None] * 5
    assert np.isnan(
        [columns[name] for name in ("unknown_sides", "lost", "interval_mm")]
    ).all()


def test_swapped_frames_are_counted_among_known_ones(scene: Scene) -> None:
    frames = uncertain_frames(scene, [0.0, 0.0, 0.5, 0.5, 0.0, 0.0])
    for k in (1, 2):
        frames[k] = replace(
            frames[k], pose=mirrored_poses(scene.body.skeleton, frames[k].pose[None])[0]
        )
    # the posterior of frame 1 has nothing else: known, and swapped. Frame 2 is swapped, and half of it says so
    frames[1] = replace(
        frames[1],
        posterior=Posterior(frames[1].pose[None], np.zeros((1, 3)), np.ones(1)),
    )
    columns, measures = measured(scene, frames)
    assert columns["swapped"].tolist() == [0, 1, 1, 0, 0, 0]
    assert columns["unknown_sides"].tolist() == [0, 0, 1, 1, 0, 0]
    assert measures.unknown_rate == pytest.approx(2 / 6)
    assert measures.swap_rate == pytest.approx(2 / 6)
    assert measures.swapped_known_rate == pytest.approx(1 / 4)


def test_coverage_is_the_share_of_joints_that_are_near_enough(scene: Scene) -> None:
    truth = scene.truth
    assert measured(scene, uncertain_frames(scene, CERTAIN))[1].coverage == {
        "50": 1.0,
        "80": 1.0,
        "95": 1.0,
    }
    poses = turned_poses(truth.poses)
    frames = [
        replace(
            frame,
            pose=pose,
            posterior=Posterior(
                pose[None], np.zeros((1, 3)), np.ones(1), False, SPREAD
            ),
        )
        for frame, pose in zip(exact_frames(scene), poses, strict=True)
    ]
    off = np.linalg.norm(
        truth.skeleton.joints(truth.poses) - truth.skeleton.joints(poses), axis=2
    )[:, 1:]
    expected = {
        name: pytest.approx((off <= 0.02 * radius).mean())
        for name, radius in MAXWELL.items()
    }
    assert measured(scene, frames)[1].coverage == expected


def test_the_width_is_the_mean_radius_of_the_frames_that_have_one(scene: Scene) -> None:
    frames = uncertain_frames(scene, CERTAIN)
    frames[2] = replace(frames[2], posterior=None)
    columns, measures = measured(scene, frames)
    # nothing but the pose itself, blurred by 2 cm
    assert measures.interval_mm == {
        name: pytest.approx(20.0 * r, abs=0.5) for name, r in MAXWELL.items()
    }
    widths = columns["interval_mm"].tolist()
    assert np.isnan(widths[2])
    assert widths[:2] + widths[3:] == [pytest.approx(20.0 * MAXWELL["80"], abs=0.5)] * (
        FRAMES - 1
    )
    without_truth = evaluated(
        replace(scene, truth=None),
        frames,
        None,
        np.zeros((1, 63)),
        0.5,
        Effort(1.0, 1.0),
    )[1]
    assert without_truth.interval_mm == measures.interval_mm
    assert without_truth.coverage is None


def test_footage_has_intervals_in_the_world_too_which_are_wider(scene: Scene) -> None:
    model = in_footage(SPREAD, 1, True)
    posterior = Posterior(
        np.zeros((1, 66)), np.zeros((1, 3)), np.ones(1), recalibration=model
    )
    frames = [
        replace(frame, pose=np.zeros(66), posterior=posterior)
        for frame in exact_frames(scene)
    ]
    content = replace(tracked(scene, exact_frames(scene)).content, frames=frames)
    intervals = replace(content, scene=replace(scene, truth=None)).intervals
    depth = depth_halves(model, scene.cameras[0], frames[0].translation)
    for name, least in (("joint_radii", 0.0), ("place_radii", depth)):
        spreads = np.hypot(0.02, shared_spreads(1, world=name == "place_radii"))
        expected = np.hypot(np.outer([*MAXWELL.values()], spreads), least)
        np.testing.assert_allclose(intervals[name][0], expected, rtol=0.01)
    assert "place_radii" not in content.intervals


def test_frames_are_lost_from_a_probability_of_a_half_on(scene: Scene) -> None:
    probabilities = [0.0, 0.25, 0.5, 0.75, 1.0, None]
    frames = [
        replace(frame, lost=p)
        for frame, p in zip(exact_frames(scene), probabilities, strict=True)
    ]
    columns, measures = measured(scene, frames)
    assert measures.lost_flagged_rate == pytest.approx(3 / 5)
    assert columns["lost"][:5].tolist() == probabilities[:5]
    assert np.isnan(columns["lost"][5])
    for lost in (-0.1, 1.5, float("nan")):
        with pytest.raises(
            ValueError, match=f"lost of a frame must lie in 0 to 1, got {lost}"
        ):
            replace(frames[0], lost=lost)


def test_held_and_lost_frames_are_blank_for_other_programs_and_numbered_as_filmed(
    scene: Scene, tmp_path: Path
) -> None:
    observations = list(scene.observations)
    observations[1] = replace(observations[1], usable=False)
    frames = uncertain_frames(scene, [0.0, 0.0, 0.3, 0.4, 0.5, 0.0], coherent=True)
    frames = [
        replace(frame, lost=0.9 if k == 4 else 0.1) for k, frame in enumerate(frames)
    ]
    folder = tmp_path / "out"
    with OutputFolder(folder, False, False, {}, print) as output:
        result = tracked(
            replace(scene, observations=observations, first=100), frames, output
        )
    assert result.unseen == {101, 104}
    assert np.flatnonzero(np.isnan(result.angles("left_knee_flexion"))).tolist() == [
        1,
        4,
    ]
    markers = [
        line.split("\t") for line in (folder / "track.trc").read_text().splitlines()[6:]
    ]
    # OpenSim stops at a row without markers: such frames have none
    assert [len(marker) for marker in markers] == [2 + 81] * (FRAMES - 2)
    # which count from 1: 102 and 105 are missing
    assert [marker[0] for marker in markers] == ["101", "103", "104", "106"]
    assert all("" not in marker for marker in markers)
    for name, column in (("frames", "left_knee_x"), ("angles", "left_knee_flexion")):
        rows = csv_rows(folder / f"{name}.csv")
        assert [row["frame"] for row in rows if row[column] == ""] == ["101", "104"]
    rows = csv_rows(folder / "frames.csv")
    assert [row["usable"] for row in rows] == ["1.0", "0.0", "1.0", "1.0", "1.0", "1.0"]
    assert [row["lost"] for row in rows] == ["0.1", "0.1", "0.1", "0.1", "0.9", "0.1"]
    stored = arrays(folder / "poses.npz")
    assert stored["levels"].tolist() == [0.5, 0.8, 0.95]
    assert stored["angle_halves"].shape == (FRAMES, 3, 66)
    np.testing.assert_allclose(
        stored["joint_radii"][0, :, 1], 0.02 * np.array([*MAXWELL.values()]), atol=5e-4
    )
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["unknown_sides"] == [102, 103, 104]
    assert summary["lost_frames"] == [104]
    assert summary["lost_flagged_rate"] == pytest.approx(1 / 5)
    shares = "left and right unknown in 3 of 5, lost in 1 of 5 frames that show enough"
    assert f"\n{shares} of the person\n" in detailed(result.content)


def test_frames_and_tracks_have_modes_and_the_probability_that_none_is_right(
    scene: Scene,
) -> None:
    frames = uncertain_frames(scene, CERTAIN, turned=0.25, coherent=True)
    track = tracked(scene, frames)
    for estimate, frame in zip(track.frames, frames, strict=True):
        assert [mode.weight for mode in estimate.modes] == pytest.approx([0.75, 0.25])
        np.testing.assert_array_equal(estimate.modes[0].pose, frame.pose)
    assert track.summary["modes"] == pytest.approx([0.75, 0.25])
    assert track.modes[0].poses.shape == (FRAMES, 66)
    # a body that faces the other way has its left where its right was
    assert "left and right unknown in 6 of 6 frames" in detailed(track.content)
    assert "lost in" not in detailed(track.content)
    # whose posteriors are no trajectories
    apart = tracked(scene, uncertain_frames(scene, CERTAIN, turned=0.25))
    assert len(apart.frames[0].modes) == 2
    assert (apart.modes, apart.summary["modes"]) == ([], None)
    for k, frame in enumerate(frames):
        frames[k] = replace(
            frame,
            posterior=replace(
                frame.posterior, recalibration=Recalibration(none=0.1 * k)
            ),
        )
    doubtful = tracked(scene, frames)
    assert doubtful.summary["none_of_modes"] == pytest.approx(0.25)
    assert [mode.weight for mode in doubtful.frames[5].modes] == pytest.approx(
        [0.375, 0.125]
    )


def test_a_resumed_track_keeps_the_certainty_of_its_first_part(
    scene: Scene, tmp_path: Path
) -> None:
    frames = [
        replace(f, lost=0.75)
        for f in uncertain_frames(scene, np.full(FRAMES, 0.3), coherent=True)
    ]
    stopped = [*frames[:3], None]  # which cannot be recorded
    with (
        pytest.raises(AttributeError),
        OutputFolder(tmp_path / "out", False, False, {}, print) as output,
    ):
        tracked(scene, stopped, output)
    with OutputFolder(tmp_path / "out", False, True, {}, print) as output:
        track = tracked(scene, frames, output)
    assert (
        track.summary["unknown_sides"]
        == track.summary["lost_frames"]
        == list(range(FRAMES))
    )
    # it is unknown which new trajectory continues which old one
    assert track.summary["modes"] is None
    for frame, estimate in zip(frames, track.frames, strict=True):
        np.testing.assert_allclose(
            estimate.posterior.poses, frame.posterior.poses, atol=1e-6
        )
        np.testing.assert_array_equal(
            estimate.posterior.recalibration.joint_spreads, SPREAD.joint_spreads
        )
