"""A track goes on that ended too early, where its arguments have the same content, whatever the objects are."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.footage.extraction import Extraction
from posefit.geometry.calibration import pinhole_matrix
from posefit.motion import built_in
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.output.folder import OutputFolder
from posefit.output.identity import digest_of
from posefit.output.record import read_frames
from posefit.registry import Offer
from tests.cases import each
from tests.files import csv_rows
from tests.fuzz.written import SPEC, mended, written
from tests.laws.sources import FILMS, FPS, background, masks, pictures
from tests.laws.sources import camera as film_camera
from tests.tracking.scenes import stopping
from tests.tracking.test_resuming import stopped_after

QUICK: dict[str, Any] = {"frames": (0, 8), "size": (120, 90), "evaluations": 200}


def camera(azimuth: float) -> posefit.Camera:
    return posefit.Camera.around(
        built_in.motion("walk").translations[0], azimuth, 4.0, (120, 90)
    )


@each("method", ["sapso", "vsmm"])
def test_a_resumed_track_equals_an_uninterrupted_one(
    method: str, tmp_path: Path
) -> None:
    assert repr(camera(0.5)) == repr(camera(1.5))  # which is why texts are not enough
    options: dict[str, Any] = {**QUICK, "method": method, "out": tmp_path / "out"}
    with pytest.raises(KeyboardInterrupt):
        posefit.track("walk", camera=camera(0.5), progress=stopping(4), **options)
    with pytest.raises(
        ValueError,
        match="camera must be .*, as before, to resume, got other content",
    ):
        posefit.track("walk", camera=camera(1.5), resume=True, **options)
    # another object, the same camera
    resumed = posefit.track("walk", camera=camera(0.5), resume=True, **options)
    whole = posefit.track("walk", camera=camera(0.5), **{**options, "out": None})
    if method == "sapso":  # vsmm begins with new particles
        np.testing.assert_array_equal(resumed.motion.poses, whole.motion.poses)
    for before, after in zip(whole.frames, resumed.frames, strict=True):
        assert after.details.keys() == before.details.keys()
    first, again = (
        track.frames[0].details.get("probabilities", 0.0) for track in (whole, resumed)
    )
    np.testing.assert_array_equal(first, again)
    activities = [row["activity"] for row in csv_rows(tmp_path / "out" / "frames.csv")]
    assert [activity or None for activity in activities] == resumed.activity
    assert (None in resumed.activity) == (method == "sapso")


@each("role", ["source", "train"])
def test_a_track_does_not_go_on_with_another_skeleton(
    role: str, tmp_path: Path
) -> None:
    """The .asf beside an .amc is an argument of the track, though the user did not name it."""
    motion = built_in.motion("walk")
    (tmp_path / "a").mkdir()
    captured = tmp_path / "a" / "walk.amc"
    skeleton = tmp_path / "a" / "person.asf"
    write_amc(captured, motion)
    write_asf(skeleton, motion.skeleton)
    options: dict[str, Any] = {**QUICK, "method": "sapso", "out": tmp_path / "out"}
    if role == "train":
        options["train"] = [captured]
    source = captured if role == "source" else "walk-a"
    with pytest.raises(KeyboardInterrupt):
        posefit.track(source, progress=stopping(4), **options)
    write_asf(skeleton, posefit.Body.of(motion.skeleton).scaled(1.2, 1.2).skeleton)
    with pytest.raises(
        ValueError,
        match="asf must be .*, as before, to resume, got other content",
    ):
        posefit.track(source, resume=True, **options)
    # the frames that were tracked are kept for the skeleton that they belong to
    write_asf(skeleton, motion.skeleton)
    resumed = posefit.track(source, resume=True, **options)
    whole = posefit.track(source, **{**options, "out": None})
    np.testing.assert_array_equal(resumed.motion.poses, whole.motion.poses)


def test_a_track_does_not_go_on_with_another_calibration_of_its_name(
    tmp_path: Path,
) -> None:
    file = tmp_path / "rig.toml"
    options: dict[str, Any] = {
        **QUICK,
        "method": "sapso",
        "camera": f"{file}:left",
        "out": tmp_path / "out",
    }
    write_camera(file, camera(0.5))
    with pytest.raises(KeyboardInterrupt):
        posefit.track("walk", progress=stopping(4), **options)
    write_camera(file, camera(1.5))
    with pytest.raises(
        ValueError,
        match="camera must be .*, as before, to resume, got other content",
    ):
        posefit.track("walk", resume=True, **options)
    write_camera(file, camera(0.5))
    assert len(posefit.track("walk", resume=True, **options)) == 8


def write_camera(path: Path, camera: posefit.Camera) -> None:
    """Write a calibration of one camera, whose name is left."""
    turn, _ = cv2.Rodrigues(camera.rotation)
    lines = [
        "[left]",
        f"matrix = {pinhole_matrix(camera.focal, camera.centre).tolist()}",
        f"size = [{camera.width}, {camera.height}]",
        f"rotation = {turn.ravel().tolist()}",
        f"translation = {camera.translation.tolist()}",
    ]
    path.write_text("\n".join(lines))


@each("kind", ["optimiser", "prior", "tracker", "start", "segmenter"])
def test_a_track_does_not_go_on_with_another_version_of_its_plugins(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options: dict[str, Any] = {
        "method": "vsmm" if kind == "tracker" else "sapso@pca",
        "evaluations": 200,
        "restarts": 0,
        "body_frames": 0,
        "out": tmp_path / "out",
    }
    source: Any = "walk-a"
    if kind == "segmenter":
        source = FILMS["folder of pictures"](tmp_path / "in", pictures(masks()))
        empty = str(tmp_path / "empty.png")
        assert cv2.imwrite(empty, background())
        how = Extraction(background=empty)
        options |= {"camera": film_camera(), "fps": FPS, "extraction": how}
    else:
        options |= QUICK
    with monkeypatch.context() as patch:
        stopped_after(4, patch)
        with pytest.raises(KeyboardInterrupt):
            posefit.track(source, **options)
    present = Offer.origin.fget
    assert present is not None

    def changed(offer: Offer) -> str:
        origin: str = present(offer)
        return f"{origin} changed" if offer.kind == kind else origin

    with monkeypatch.context() as patch:
        patch.setattr(Offer, "origin", property(changed))
        with pytest.raises(
            ValueError, match="version must be .*, as before, to resume"
        ):
            posefit.track(source, resume=True, **options)
    assert len(posefit.track(source, resume=True, **options)) == 8


def test_a_file_or_a_folder_is_what_it_holds(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    folder = tmp_path / "b"
    folder.mkdir()
    for path, inside in ((file, file), (folder, folder / "0.png")):
        digests = set()
        for content in (b"masks", b"maskz"):
            inside.write_bytes(content)
            digests |= {
                digest_of(path, files=True)["digest"],
                digest_of(str(path), files=True)["digest"],
            }
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


def test_a_first_frame_that_was_being_written_is_cut_off(tmp_path: Path) -> None:
    lines = written(tmp_path)["frames"].splitlines(keepends=True)
    (unfinished,) = (tmp_path / "made").iterdir()
    file = unfinished / "frames.jsonl"
    messages = list[str]()
    file.write_bytes(lines[0][:-9])
    folder = OutputFolder(
        tmp_path / "made" / "subject", False, True, SPEC, messages.append
    )
    with suppress(KeyboardInterrupt), folder as output:
        assert output.earlier() == ([], None)
        tracked_now = tmp_path / "tracked.jsonl"
        tracked_now.write_bytes(lines[0])
        (frame,), state, _ = read_frames(tracked_now)
        assert state is not None
        output.record(frame, state)
        raise KeyboardInterrupt
    assert file.read_bytes() == lines[0]
    assert not [message for message in messages if message.startswith("warning")]


@each(
    ("old", "new", "right", "reason"),
    [
        (b"40", b"4\xff", False, "a damaged one"),
        (
            b'"lost": 0.5',
            b'"lost": 2',
            True,
            "lost of a frame must lie in 0 to 1, got 2",
        ),
        (
            b'"bit_generator": "PCG64"',
            b'"bit_generator": "none"',
            True,
            "state must be for a PCG64",
        ),
        (
            b'"evaluations"',
            b'"evaluation"',
            True,
            "unexpected keyword argument 'evaluation'",
        ),
    ],
)
def test_frames_before_the_damage_are_kept(
    old: bytes, new: bytes, right: bool, reason: str, tmp_path: Path
) -> None:
    lines = written(tmp_path)["frames"].splitlines(keepends=True)
    assert old in lines[1]
    lines[1] = lines[1].replace(old, new, 1)
    (unfinished,) = (tmp_path / "made").iterdir()
    (unfinished / "frames.jsonl").write_bytes(
        mended(b"".join(lines)) if right else b"".join(lines)
    )
    messages: list[str] = []
    folder = OutputFolder(
        tmp_path / "made" / "subject", False, True, SPEC, messages.append
    )
    with suppress(KeyboardInterrupt), folder as output:
        assert len(output.earlier()[0]) == 1
        raise KeyboardInterrupt
    assert "frames.jsonl line 2: expected a frame, got" in messages[0]
    assert reason in messages[0]
