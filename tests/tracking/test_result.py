"""What people do with masks in Python: arrays in, joints, angles, tables, pictures and files out."""

import pickle
import time
import webbrowser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.motion import built_in
from posefit.output.text import _effort
from posefit.silhouette.cost import project
from tests.cases import each
from tests.files import arrays

QUICK: dict[str, Any] = {
    "method": "random@loose",
    "evaluations": 40,
    "restarts": 1,
    "body_frames": 0,
    "smooth": False,
}
MOTION = built_in.motion("walk", frames=3)
BODY = posefit.Body.of(MOTION.skeleton)
CAMERA = posefit.Camera.around(MOTION.translations[0], 0.5, 3.6, (80, 60))
CAMERAS = [CAMERA, posefit.Camera.around(MOTION.translations[0], 2.0, 3.6, (80, 60))]


def masks_by(camera: posefit.Camera) -> Any:
    poses = zip(MOTION.poses, MOTION.translations, strict=True)
    return np.array([project(BODY, camera, *pose) for pose in poses])


MASKS = masks_by(CAMERA)


@pytest.fixture(scope="module")
def track() -> posefit.Track:
    return posefit.track(MASKS, camera=CAMERA, fps=25, **QUICK)


def test_the_same_masks_give_the_same_track(
    track: posefit.Track, tmp_path: Path
) -> None:
    np.save(tmp_path / "masks.npy", MASKS)
    images = [tmp_path / f"{k}.png" for k in range(len(MASKS))]
    for path, mask in zip(images, MASKS, strict=True):
        cv2.imwrite(str(path), 255 * mask.astype(np.uint8))
    for source in (
        tmp_path / "masks.npy",
        images,
        list(MASKS),
        255 * MASKS.astype(np.uint8),
        tmp_path,
    ):
        again = posefit.track(source, camera=CAMERA, fps=25, **QUICK)
        np.testing.assert_array_equal(
            again.joints, track.joints, err_msg=f"{type(source)}"
        )


@each(
    "masks,words",
    [
        (np.zeros((2, 3, 4, 5), bool), "masks must have shape"),
        (np.zeros((2, 6, 8), bool), "a mask with a person"),
        ([np.zeros((6, 8)), np.zeros((8, 6))], "masks must have one shape"),
        (["missing.png"], "missing.png: no such file"),
        (
            np.moveaxis(MASKS, 0, 2),
            "must have shape .frames, height, width., got 3 as the width",
        ),
    ],
)
def test_arrays_that_are_no_masks_are_named(masks: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        posefit.track(masks, **QUICK)


def test_a_track_of_masks_and_one_of_a_motion_pickle(track: posefit.Track) -> None:
    for result in (track, posefit.track("walk", frames=(0, 2), size=(80, 60), **QUICK)):
        copied = pickle.loads(pickle.dumps(result))
        assert copied.summary == result.summary
        np.testing.assert_array_equal(copied.joints, result.joints)
        before, after = (
            each.scene.observations[1].silhouettes[0].mask for each in (result, copied)
        )
        np.testing.assert_array_equal(after, before)


def test_warnings_are_shown_without_a_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    posefit.track(~MASKS, camera=CAMERA, **QUICK)
    assert "warning: " in capsys.readouterr().err


def test_joints_angles_and_table_belong_to_the_motion(
    track: posefit.Track,
) -> None:
    table = track.to_pandas()
    assert track.joints.shape == (3, 27, 3)
    np.testing.assert_array_equal(
        table["left_knee_flexion"], track.angles("left_knee_flexion")
    )
    np.testing.assert_allclose(table["seconds"], [0.0, 0.04, 0.08])
    np.testing.assert_array_equal(
        table["left_knee_y"], track.joints[:, track.joint_names.index("left_knee"), 1]
    )
    with pytest.raises(InputError, match="did you mean 'left_knee_flexion'"):
        track.angles("left_knee_flexio")


def test_a_frame_is_a_fit_with_a_picture(track: posefit.Track) -> None:
    frame = track.frame(1)
    with pytest.raises(InputError, match="frame must lie in 0 to 2, got 3"):
        track.frame(3)
    assert not track.unknown_sides.any()  # the method does not say
    assert (frame.cost, frame.iou) == (track.table["cost"][1], track.table["iou"][1])
    np.testing.assert_array_equal(frame.joints, track.joints[1])
    picture = np.asarray(frame.overlay())
    assert picture.shape == (480, 640, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 2  # background, body, mask


def test_a_mask_is_fitted() -> None:
    fit = posefit.fit(MASKS[0], camera=CAMERA, **QUICK)
    assert fit.pose.shape == (66,)


# What holds the masks, the keywords that choose one of them, and its number as filmed.
FIRST: dict[str, tuple[list[int | None], dict[str, Any], int]] = {
    "an array": ([None], {}, 0),
    "an archive": ([0], {}, 0),
    "an archive that begins later": ([100], {}, 100),
    "a frame of it": ([100], {"frame": 101}, 101),
    "two cameras": ([100, 101], {}, 101),
}


@each("firsts, chosen, number", FIRST.values())
def test_a_fit_takes_the_first_frame_as_filmed(
    firsts: list[int | None], chosen: dict[str, Any], number: int, tmp_path: Path
) -> None:
    sources: list[Any] = []
    for view, first in enumerate(firsts):
        source: Any = MASKS
        if first is not None:
            source = tmp_path / f"{view}.npz"
            np.savez(source, masks=masks_by(CAMERAS[view]), first=first)
        sources.append(source)
    cameras = CAMERAS[: len(sources)]
    fit = posefit.fit(
        sources if len(sources) > 1 else sources[0], camera=cameras, **chosen, **QUICK
    )
    assert fit.track.table["frame"].tolist() == [number]
    assert fit.track.gait.why == "one frame is not a walk"


def test_files_and_a_page_come_later_too(
    track: posefit.Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # no midnight between the two
    monkeypatch.setattr(time, "strftime", lambda _: "1 July 2026")
    track.save(tmp_path / "out")
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    page = track.show()
    assert (tmp_path / "out" / "track.html").read_text() == page.read_text()
    assert opened == [page.as_uri()]


def test_the_files_of_a_track_have_the_build_that_was_fitted(tmp_path: Path) -> None:
    motion = built_in.motion("walk", frames=6)
    masks = [
        project(BODY, CAMERA, *pose)
        for pose in zip(motion.poses, motion.translations, strict=True)
    ]
    track = posefit.track(
        masks,
        camera=CAMERA,
        fps=25,
        out=tmp_path / "out",
        **{**QUICK, "body_frames": 6},
    )
    assert track.log.build is not None
    np.testing.assert_array_equal(
        arrays(tmp_path / "out" / "poses.npz")["radii"], track.scene.body.radii
    )


def test_methods_are_compared(tmp_path: Path) -> None:
    compared = posefit.compare(
        ["random@pca", "sapso@pca"],
        seeds=1,
        frames=2,
        evaluations=80,
        out=tmp_path / "kept",
    )
    assert list(compared.to_pandas()["method"]) == ["random@pca", "sapso@pca"]
    compared.report(tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size > 1000
    assert "random@pca" in str(compared)


@each(
    ("drawn", "hypotheses", "stages", "words"),
    [
        (1200, 0, {}, "300 of 400 evaluations"),
        (1600, 1, {}, "400 of 400 evaluations"),
        # what is searched again takes more than one budget
        (1604, 1, {}, "401 evaluations"),
        # each hypothesis has a budget
        (3200, 3, {}, "800 of 1,200 evaluations"),
        (1600, 1, {"first_pose": 2500}, "400 of 400 evaluations (and 2,500 for the first pose)"),
    ],
)  # fmt: skip
def test_the_effort_of_a_frame_is_shown_with_its_budget(
    drawn: int, hypotheses: int, stages: dict[str, int], words: str
) -> None:
    content: Any = SimpleNamespace(
        setup=SimpleNamespace(evaluations_per_frame=400, frames=4),
        log=SimpleNamespace(hypotheses=("one",) * hypotheses),
        measures=SimpleNamespace(
            iou=0.9, seconds_per_frame=0.01, effort={"frames": drawn, **stages}
        ),
    )
    assert f", {words} and 10" in _effort(content)
