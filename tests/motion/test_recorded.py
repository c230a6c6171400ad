"""The library of recorded motions: what is stored is what was recorded, to a centimetre."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.cli import main
from posefit.motion import recorded
from tests.cases import each

ROUNDED = 1e-3  # metres: what rounding 66 angles to a thousandth of a radian may move a hand by, and more


@pytest.fixture(scope="module")
def cmu30(cmu: Path) -> Path:
    folder = cmu.parent / "cmu30"
    if not folder.is_dir():
        pytest.skip(f"no clips in {folder}")
    return folder


@each("subject", ["09", "135"])
def test_a_clip_is_the_recorded_one_to_a_centimetre(cmu30: Path, subject: str) -> None:
    with np.load(cmu30 / f"{subject}.npz") as stored:
        start = 0
        for name, length in zip(stored["names"].tolist(), stored["lengths"].tolist(), strict=True):
            part = slice(start, start + length)
            start += length
            clip = recorded.clip(name)
            motion = clip.motion()
            assert (clip.subject, len(motion), motion.fps) == (subject, length, 30.0)
            true = clip.skeleton.joints(stored["poses"][part].astype(float), stored["translations"][part].astype(float))
            away = np.linalg.norm(clip.skeleton.joints(motion.poses, motion.translations) - true, axis=-1)
            assert away.max() < 0.01 + ROUNDED


def test_the_files_are_small_and_say_where_they_come_from_and_open_without_pickle() -> None:
    path = files("posefit.motion") / "recorded.npz"
    assert len(path.read_bytes()) < 3_000_000
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        assert "mocap.cs.cmu.edu" in str(stored["origin"])
        assert "NSF EIA-0196217" in str(stored["origin"])
    built_in = (files("posefit.motion") / "built_in.json").read_text(encoding="utf-8")
    assert len(built_in.encode()) < 100_000
    assert "mocap.cs.cmu.edu" in json.loads(built_in)["origin"]
    assert "NSF EIA-0196217" in json.loads(built_in)["origin"]


def test_between_two_stored_poses_lies_their_mean_and_after_the_last_nothing_moves() -> None:
    clip = next(one for one in recorded.clips() if (np.diff(one.times) == 2).any())
    poses, translations = clip.at(clip.times)
    assert np.array_equal(poses, clip.poses)
    assert np.array_equal(translations, clip.translations)
    k = int(np.flatnonzero(np.diff(clip.times) == 2)[0])
    poses, translations = clip.at(np.array([clip.times[k] + 1, clip.times[-1] + 50]))
    assert poses[0] == pytest.approx(clip.poses[k : k + 2].mean(axis=0), abs=1e-12)
    assert translations[0] == pytest.approx(clip.translations[k : k + 2].mean(axis=0), abs=1e-12)
    assert np.array_equal(poses[1], clip.poses[-1])
    assert np.array_equal(translations[1], clip.translations[-1])


def test_people_are_chosen_by_name() -> None:
    everybody = {one.subject for one in recorded.named("library")}
    assert everybody == set(recorded.subjects())
    assert {one.subject for one in recorded.named("library:16, 02")} == {"02", "16"}
    assert {one.subject for one in recorded.named("library:-16")} == everybody - {"16"}
    assert recorded.leaving_out("library", ["16", "02"]) == "library:-16,-02"
    assert recorded.leaving_out("library:02,16", ["16"]) == "library:02,16,-16"


def test_the_command_lists_what_there_is() -> None:
    listing: dict[str, Any] = json.loads(CliRunner().invoke(main, ["motions", "--json"]).stdout)
    assert listing["recorded"][0]["name"] == "02_01"
    assert listing["recorded"][0]["seconds"] == pytest.approx(85 / 30, abs=1e-3)
    assert len(listing["recorded"]) == 216
