"""The library of recorded motions: where it comes from, whom it has, and what lies between stored poses."""

import json
from importlib.resources import files

import numpy as np
import pytest

from posefit.motion import recorded
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
