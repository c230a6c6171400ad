"""What a method learns from, by name."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

import posefit
from posefit.cli import main
from posefit.footage.training import training_clips
from posefit.motion import recorded
from posefit.sweep.plan import Plan


def test_people_of_the_library_are_all_their_clips_at_any_rate() -> None:
    clips = training_clips(["library:17", "walk-a"])
    assert [clip(60.0).name for clip in clips] == ["17_03", "17_10", "walk-a"]
    whole = recorded.clip("17_03").motion()
    assert len(clips[0](15.0)) == (len(whole) + 1) // 2


def test_a_folder_is_its_clips(cmu: Path, tmp_path: Path) -> None:
    for name in ("16.asf", "16_15.amc", "16_17.amc"):
        shutil.copy(next(cmu.rglob(name)), tmp_path / name)
    assert [clip(30.0).name for clip in training_clips([tmp_path])] == ["16_15", "16_17"]


def test_a_folder_without_clips_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected a folder of \.amc or \.bvh files, got none in it"):
        training_clips([tmp_path])


def test_a_recorded_person_is_followed_by_what_others_taught() -> None:
    track = posefit.track("09_01", train=["library:17", "library:-02,-05,-09,-14,-16,-29,-49,-127,-135"], frames=(0, 2))
    assert track.summary["train"] == ["17_03", "17_10", "17_03", "17_10"]
    assert track.motion.skeleton.name == "09"


def test_a_plan_may_train_on_people_of_the_library() -> None:
    (cell,) = Plan.of({"cells": [{"method": "sapso@pca", "motion": "16_15", "train": ["library:-16"], "frames": 3}]})
    assert cell.train == ("library:-16",)
    with pytest.raises(ValueError, match="a subject of the library must be one of 02"):
        Plan.of({"cells": [{"method": "sapso@pca", "motion": "walk", "train": ["library:99"]}]})


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--train", "walk-a", "--without-subject", "16"],
            "without_subject must be given with --train library, got walk-a",
        ),
        (["--train", "library:99"], "a subject of the library must be one of 02, 05"),
        (
            ["--train", "library:16", "--without-subject", "16"],
            "the library must hold somebody else, got everybody left out",
        ),
    ],
)
def test_mistakes_are_one_line(words: list[str], message: str) -> None:
    done = CliRunner().invoke(main, ["track", "walk", *words])
    assert done.exit_code == 2
    assert done.stderr.startswith(f"posefit: {message}")
    assert len(done.stderr.splitlines()) == 1


def test_many_clips_are_counted_not_listed() -> None:
    done = CliRunner().invoke(main, ["track", "walk", "--train", "library:16", "--frames", "0:1"])
    assert "trained on 54 clips, 16_01 to 16_58" in done.stdout.splitlines()[0]
