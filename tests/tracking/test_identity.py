"""Two tracks are the same where their arguments have the same content, whatever the objects are."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.motion import built_in
from posefit.tracking.identity import digest_of
from tests.cases import each
from tests.tracking.scenes import stopping

QUICK: dict[str, Any] = {"method": "sapso", "frames": (0, 8), "size": (120, 90), "evaluations": 200}


def camera(azimuth: float) -> posefit.Camera:
    return posefit.Camera.around(built_in.motion("walk").translations[0], azimuth, 4.0, (120, 90))


def test_cameras_at_two_azimuths_are_not_the_same_track(tmp_path: Path) -> None:
    assert repr(camera(0.5)) == repr(camera(1.5))  # which is why texts are not enough
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        posefit.track("walk", camera=camera(0.5), out=out, progress=stopping(4), **QUICK)
    with pytest.raises(ValueError, match="camera must be .* as it was, to resume, got one with another content"):
        posefit.track("walk", camera=camera(1.5), out=out, resume=True, **QUICK)
    # another object, the same camera
    resumed = posefit.track("walk", camera=camera(0.5), out=out, resume=True, **QUICK)
    whole = posefit.track("walk", camera=camera(0.5), **QUICK)
    np.testing.assert_array_equal(resumed.motion.poses, whole.motion.poses)


def test_a_file_or_a_folder_is_what_it_holds(tmp_path: Path) -> None:
    file, folder = tmp_path / "a.npz", tmp_path / "b"
    folder.mkdir()
    for path, inside in ((file, file), (folder, folder / "0.png")):
        digests = set()
        for content in (b"masks", b"maskz"):
            inside.write_bytes(content)
            digests |= {digest_of(path, files=True)["digest"], digest_of(str(path), files=True)["digest"]}
        assert len(digests | {digest_of(path)["digest"]}) == 3


@each(
    ("first", "second"),
    [
        (1, 1.5),
        (0, False),
        ((1, 2), (2, 1)),
        ({"a": 1}, {"a": 2}),
        (np.zeros(2, np.float32), np.zeros(2)),
        (np.sin, np.cos),
        (built_in.motion, built_in.names),
    ],
)
def test_different_values_have_different_digests(first: Any, second: Any) -> None:
    assert digest_of(first)["digest"] == digest_of(first)["digest"]
    assert digest_of(first)["digest"] != digest_of(second)["digest"]


def test_resumed_frames_keep_their_details_and_processor_time(tmp_path: Path) -> None:
    options: dict[str, Any] = {**QUICK, "method": "vsmm", "out": tmp_path / "out"}
    with pytest.raises(KeyboardInterrupt):
        posefit.track("walk", progress=stopping(4), **options)
    resumed = posefit.track("walk", resume=True, **options)
    whole = posefit.track("walk", **{**options, "out": None})
    for before, after in zip(whole.estimates, resumed.estimates, strict=True):
        assert after.cpu_seconds is not None
        assert after.details.keys() == before.details.keys()
    first, again = whole.estimates[0].details, resumed.estimates[0].details
    np.testing.assert_array_equal(first["probabilities"], again["probabilities"])
    assert resumed.summary["cpu_seconds_per_frame"] is not None
    with (tmp_path / "out" / "frames.csv").open(newline="") as file:
        written = [row["activity"] for row in csv.DictReader(file)]
    assert written == resumed.activity == whole.activity
    assert None not in whole.activity
