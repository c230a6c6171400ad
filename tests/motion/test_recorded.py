"""The library of recorded motions: where it comes from, whom it has, and what lies between stored poses."""

import json
from importlib.resources import files

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.motion import recorded
from posefit.motion.clips import training_clips
from tests.commands import printed


def test_the_files_are_small_name_their_origin_and_open_without_pickle() -> None:
    path = files("posefit.motion") / "recorded.npz"
    assert len(path.read_bytes()) < 3_000_000
    built_in = (files("posefit.motion") / "built_in.json").read_text(encoding="utf-8")
    assert len(built_in.encode()) < 100_000
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        origins = str(stored["origin"]), json.loads(built_in)["origin"]
    assert all(
        "mocap.cs.cmu.edu" in origin and "NSF EIA-0196217" in origin
        for origin in origins
    )


def test_between_two_stored_poses_lies_their_mean_and_after_the_last_nothing_moves() -> (
    None
):
    clip = next(one for one in recorded.clips() if (np.diff(one.times) == 2).any())
    poses, translations = clip.at(clip.times)
    assert np.array_equal(poses, clip.poses)
    assert np.array_equal(translations, clip.translations)
    k = int(np.flatnonzero(np.diff(clip.times) == 2)[0])
    poses, translations = clip.at(np.array([clip.times[k] + 1, clip.times[-1] + 50]))
    assert poses[0] == pytest.approx(clip.poses[k : k + 2].mean(axis=0), abs=1e-12)
    assert translations[0] == pytest.approx(
        clip.translations[k : k + 2].mean(axis=0), abs=1e-12
    )
    assert np.array_equal(poses[1], clip.poses[-1])
    assert np.array_equal(translations[1], clip.translations[-1])


def test_people_are_chosen_by_name() -> None:
    everybody = {one.subject for one in recorded.named("library")}
    assert everybody == set(recorded.subjects())
    assert {one.subject for one in recorded.named("library:16, 02")} == {"02", "16"}
    assert {one.subject for one in recorded.named("library:-16")} == everybody - {"16"}
    assert recorded.leaving_out("library", ["16", "02"]) == "library:-16,-02"
    assert recorded.leaving_out("library:02,16", ["16"]) == "library:02,16,-16"


def test_the_command_lists_all_motions() -> None:
    first, *others = printed("motions")["recorded"]
    assert (first["name"], first["seconds"]) == (
        "02_01",
        pytest.approx(85 / 30, abs=1e-3),
    )
    assert len(others) == 215


def legs(clip: recorded.RecordedClip) -> tuple[Array, Array, Array]:
    """Return how much knees are bent, the lines from hip to ankle, and feet, from the joints alone."""
    joints = clip.skeleton.joints(clip.poses)
    bent, lines, feet = [], [], []
    for letter in "lr":
        hip, knee, ankle, ball = (
            joints[:, JOINTS.index(letter + end)]
            for end in ("hipjoint", "femur", "tibia", "foot")
        )
        first, second = knee - hip, ankle - knee
        across = np.linalg.norm(np.cross(first, second), axis=1)
        bent.append(np.arctan2(across, (first * second).sum(axis=1)))
        for listed, vector in ((lines, ankle - hip), (feet, ball - ankle)):
            listed.append(vector / np.linalg.norm(vector, axis=1, keepdims=True))
    return np.array(bent).T, np.array(lines), np.array(feet)


@pytest.mark.parametrize("person", recorded.subjects())
def test_a_persons_straighter_knee_is_straight_in_one_pose_of_twenty(
    person: str,
) -> None:
    straighter = []
    turned = []
    for clip in recorded.clips([person]):
        bent, lines, feet = legs(clip)
        less, same_lines, same_feet = legs(clip.straightened)
        assert (less <= bent + 1e-5).all()
        # axes of skeletons are stored to 1e-4 degrees
        np.testing.assert_allclose(lines, same_lines, atol=1e-5)
        turned.append(np.abs(feet - same_feet).ravel())
        straighter.append(less.min(axis=1))
    assert np.quantile(np.concatenate(straighter), recorded.STRAIGHT) < 0.002
    assert np.quantile(np.concatenate(straighter), 0.9) > 0.1
    # feet keep their directions exactly if they do not turn inwards or outwards
    assert np.median(np.concatenate(turned)) < 0.03


def test_clips_are_recorded_ones_unless_straight_knees_are_asked_for() -> None:
    for straight in (False, True):
        for source in ("library:127", "127_06"):
            clips = training_clips([source], straight=straight)
            chosen = recorded.clip("127_06")
            expected = (chosen.straightened if straight else chosen).motion()
            assert any(
                len(motion := clip.motion(recorded.FPS)) == len(expected)
                and np.array_equal(motion.poses, expected.poses)
                for clip in clips
            )
