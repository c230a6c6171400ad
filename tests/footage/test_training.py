"""Motions by name: those that a method learns from, and numbered instances."""

from pathlib import Path

import numpy as np
import pytest

from posefit.motion import built_in, recorded
from posefit.motion import clips as clips_of_sources
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.bvh import write_bvh
from posefit.motion.clips import POSE_BYTES, training_clips, training_motions
from posefit.motion.instances import SPEED, VIEW_DEGREES, motion_of_instance, variation
from tests.commands import error_of


def test_people_of_the_library_are_all_their_clips_at_any_rate() -> None:
    clips = training_clips(["library:17", "walk-a"])
    assert [clip.motion(60.0).name for clip in clips] == ["17_03", "17_10", "walk-a"]
    whole = recorded.clip("17_03").motion()
    assert len(clips[0].motion(15.0)) == (len(whole) + 1) // 2


def test_mistakes_are_reported_in_one_line() -> None:
    for words, message in [
        (
            ["--without-subject", "16"],
            "without_subject must be given with --train library, got walk-a, walk-b, walk-c",
        ),
        (
            ["--train", "library", "--without-subject", "99"],
            "a subject of the library must be one of 02, 05",
        ),
        (
            ["--train", "library:"],
            "a library must be library, library:02,16 or library:-16, got 'library:'",
        ),
        (
            ["--train", "library:16", "--without-subject", "16"],
            "at least one person of the library must remain",
        ),
    ]:
        assert error_of("track", "walk", *words).startswith(f"posefit: {message}")


def test_clips_of_a_folder_have_their_own_rates(tmp_path: Path) -> None:
    write_bvh(tmp_path / "a.bvh", built_in.motion("walk-a", frames=41, fps=60.0))
    write_asf(tmp_path / "b.asf", built_in.average_skeleton())
    # as .amc files are read
    write_amc(tmp_path / "b.amc", built_in.motion("walk-b", frames=121, fps=120.0))
    clips = training_clips([tmp_path])
    assert [len(clip.motion(30.0)) for clip in clips] == [21, 31]
    # about as many, before it is made
    assert [clip.count(30.0) for clip in clips] == [20, 30]
    joints = built_in.motion("walk-a", frames=41, fps=60.0).joints[::2]
    np.testing.assert_allclose(clips[0].motion(30.0).joints, joints, atol=1e-5)


def test_the_clip_that_is_followed_is_left_out(tmp_path: Path) -> None:
    names = {
        clip.motion(30.0).name
        for clip in training_clips(["library:16"], followed="16_15")
    }
    assert names == {clip.name for clip in recorded.clips(only=["16"])} - {"16_15"}
    same = {
        clip.motion(30.0).name
        for clip in training_clips(["library:16"], followed=Path("somewhere/16_15.amc"))
    }
    assert same == names
    for name in ("a", "b"):
        write_bvh(tmp_path / f"{name}.bvh", built_in.motion(f"walk-{name}", frames=5))
    assert [
        clip.motion(30.0).name
        for clip in training_clips([tmp_path], followed=tmp_path / "a.bvh")
    ] == ["b"]
    (tmp_path / "b.bvh").unlink()
    with pytest.raises(
        ValueError,
        match="expected a folder with a clip other than the source, got only that clip",
    ):
        training_clips([tmp_path], followed=tmp_path / "a.bvh")
    with pytest.raises(
        ValueError, match="train must not contain the source itself, got .*a.bvh"
    ):
        training_clips(
            [tmp_path / "a.bvh"], followed=str(tmp_path / "x" / ".." / "a.bvh")
        )


def test_more_than_the_memory_holds_is_refused_before_a_motion_is_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    poses = sum(int(clip.times[-1]) + 1 for clip in recorded.clips())
    clips = training_clips(["library"])
    assert sum(clip.count(recorded.FPS) for clip in clips) == poses
    monkeypatch.setattr(
        clips_of_sources, "allowed_bytes", lambda: 3 * poses * POSE_BYTES
    )
    assert len(training_motions(clips[:1], 120.0)) == 1
    message = f"the 0.6 GB of memory that posefit may use, got 0.8 GB for {4 * poses:,} poses at 120 frames a second"
    with pytest.raises(ValueError, match=message):
        training_motions(clips, 120.0)
    monkeypatch.setattr(clips_of_sources, "allowed_bytes", lambda: 100_000_000)
    error = error_of("track", "walk", "--train", "library")
    assert error.startswith(
        "posefit: train must take at most the 0.1 GB of memory that posefit may use, got 0.1 GB"
    )


def test_a_folder_with_a_clip_that_cannot_be_read_is_reported_in_one_line(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.bvh"
    words = ("track", "walk", "--train", tmp_path, "--out", tmp_path / "out")
    path.mkdir()
    assert (
        "expected a folder of .amc or .bvh files, got a folder without any"
        in error_of(*words)
    )
    path.rmdir()
    write_bvh(path, built_in.motion("walk-a", frames=3, fps=60.0))
    text = path.read_text()
    path.write_text(text.replace(text.split()[-5], "nan", 1))
    assert "a.bvh: expected finite numbers below 1e+06, got nan" in error_of(*words)
    assert not (tmp_path / "out").exists()


def test_a_clip_of_one_frame_is_too_short_to_learn_from(tmp_path: Path) -> None:
    write_bvh(tmp_path / "a.bvh", built_in.motion("walk-a", frames=1))
    for method, message in (
        ("exemplars", "a must have at least 2 frames to be followed, got 1"),
        ("@pca", "angles must contain at least 7 frames, got 1"),
    ):
        words = ["--train", tmp_path, "--frames", "0:2", "--method", method]
        assert error_of("track", "walk", *words) == f"posefit: {message}"


def test_instance_0_is_the_motion_as_it_is():
    assert variation(0).views([45.0, -0.0]) == [45.0, 0.0]
    walk = motion_of_instance("walk", 0, frames=7, fps=25.0)
    assert (
        walk.poses.tobytes()
        == built_in.motion("walk", frames=7, fps=25.0).poses.tobytes()
    )
    whole = built_in.motion("run", frames=20)
    assert (
        motion_of_instance(whole, 0, frames=5, fps=30.0).poses.tobytes()
        == whole.poses[:5].tobytes()
    )


def test_instances_differ_all_over_their_ranges():
    variations = [variation(number) for number in range(1, 2000)]
    assert len(set(variations)) == len(variations)
    for name, low, high in (
        ("speed", 1.0 - SPEED, 1.0 + SPEED),
        ("phase", 0.0, 1.0),
        ("turn_degrees", -VIEW_DEGREES, VIEW_DEGREES),
        ("start", 0.0, 1.0),
    ):
        values = np.array([getattr(varied, name) for varied in variations])
        assert low <= values.min() < low + 0.01 * (high - low)
        assert high - 0.01 * (high - low) < values.max() <= high
        assert values.mean() == pytest.approx(
            0.5 * (low + high), abs=0.03 * (high - low)
        )


def test_the_frames_of_an_instance_of_a_file_begin_anywhere_but_never_end_beyond_it():
    whole = built_in.motion("run", frames=12)
    begins = set()
    for number in range(200):
        part = motion_of_instance(whole, number, frames=10, fps=30.0)
        (first,) = (
            k
            for k in range(3)
            if part.poses.tobytes() == whole.poses[k : k + 10].tobytes()
        )
        begins.add(first)
    assert begins == {0, 1, 2}
    varied = variation(17)
    walk = built_in.motion("walk", frames=9, speed=varied.speed, phase=varied.phase)
    assert (
        motion_of_instance("walk", 17, frames=9, fps=30.0).poses.tobytes()
        == walk.poses.tobytes()
    )
    assert len(motion_of_instance(whole, 5, frames=12, fps=30.0)) == 12
    with pytest.raises(
        ValueError, match="frames must be at most 12, the length of run, got 13"
    ):
        motion_of_instance(whole, 5, frames=13, fps=30.0)
