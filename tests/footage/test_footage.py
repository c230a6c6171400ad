"""Video and masks of real cameras: calibrations, several views, restarts, what is written, and what is resumed."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.fitting import metrics
from posefit.footage.camera_motion import CameraMotion
from posefit.footage.extract import extract
from posefit.footage.extraction import Extraction
from posefit.footage.kept import KeptFrames
from posefit.footage.observations import Observations
from posefit.footage.options import SourceOptions
from posefit.footage.source import scene_of
from posefit.footage.straightening import undistorted
from posefit.footage.video import Video
from posefit.geometry.calibration import Calibration
from posefit.geometry.rotation import wrapped
from posefit.progress import Progress
from posefit.uncertainty.modes import nearer_mirrored
from tests.cases import each
from tests.commands import error_of, run
from tests.footage.conftest import (
    ALL,
    EMPTY,
    NOBODY,
    SIZE,
    Film,
    camera,
    encoded,
    film,
    iou,
    read_masks,
    stack,
    truth,
    walk,
)
from tests.tracking.scenes import stopping

QUICK: dict[str, Any] = {
    "method": "sapso",
    "evaluations": 400,
    "restarts": 2,
    "body_frames": 0,
    "frames": (EMPTY + 6, EMPTY + 30),
}
BRIEF = [
    "--method",
    "@loose",
    "--evaluations",
    "200",
    "--restarts",
    "1",
    "--body-frames",
    "0",
]


def test_a_video_is_tracked_from_nothing_but_its_frames(filmed: Film) -> None:
    settings = {**QUICK, "body_frames": 12, "restarts": 4, "evaluations": 1000}
    result = posefit.track(filmed[0], height=1.7, **settings)
    assert result.summary["frames"] == 24
    assert result.summary["method"] == "sapso@loose"
    assert result.summary["fps"] == 25.0
    assert result.summary["translation"] == "aligned"
    assert result.summary["iou"] > 0.75  # masks of 900 pixels
    assert result.summary["build"]["stature_m"] == pytest.approx(1.7)
    assert set(result.summary["build"]["factors"]) == set(
        result.summary["build"]["spread"]
    )
    # the camera is on the person's left, so they walk to the left of the image, and face there
    assert result.motion.translations[-1, 0] < result.motion.translations[0, 0] - 0.5
    assert np.abs(wrapped(result.motion.poses[:, 0] + np.pi / 2)).mean() < np.radians(
        45.0
    )


def toml(path: Path, *cameras: posefit.Camera) -> Path:
    text = ""
    for k, one in enumerate(cameras):
        turned = cv2.Rodrigues(one.rotation)[0].ravel().tolist()
        centre = one.centre - 0.5
        matrix = [
            [one.focal[0], 0.0, centre[0]],
            [0.0, one.focal[1], centre[1]],
            [0.0, 0.0, 1.0],
        ]
        text += f"[cam{k}]\nsize = [{one.width}, {one.height}]\nmatrix = {np.array(matrix).tolist()}\n"
        text += f"distortions = [0.0, 0.0, 0.0, 0.0]\nrotation = {turned}\ntranslation = {one.translation.tolist()}\n"
    path.write_text(text)
    return path


def test_two_calibrated_cameras_place_the_person(filmed: Film, tmp_path: Path) -> None:
    calibration = toml(tmp_path / "two.toml", camera(np.pi / 2), camera(0.6))
    sources = [
        stack(tmp_path / f"{k}.npz", truth(azimuth)[6:30])
        for k, azimuth in enumerate((np.pi / 2, 0.6))
    ]
    result = posefit.track(
        sources,
        camera=calibration,
        up="y",
        **{**QUICK, "method": "sapso@pca", "frames": ALL},
    )
    assert result.summary["views"] == 2
    motion = walk().frames(6, 30)
    away = np.linalg.norm(result.motion.translations - motion.translations, axis=1)
    assert np.median(away) < 0.03  # metres
    joints = [
        motion.joints,
        motion.skeleton.joints(result.motion.poses, result.motion.translations),
    ]
    assert np.median(metrics.mpjpe_mm(*joints)) < 50.0
    assert nearer_mirrored(*joints).mean() < 0.2
    other = film(tmp_path / "front.avi", [NOBODY] * EMPTY + truth(0.6))
    # coming nearer the person covers the same place all the time, which a mixture would learn
    how = Extraction("median")
    filmed_twice = posefit.track(
        [filmed[0], other], camera=calibration, up="y", extraction=how, **QUICK
    )
    assert filmed_twice.summary["views"] == 2
    assert filmed_twice.summary["iou"] > 0.4


def test_a_camera_that_sees_too_little_counts_for_nothing_in_that_frame(
    tmp_path: Path,
) -> None:
    side, front = (truth(azimuth)[8:14] for azimuth in (np.pi / 2, 0.6))
    usable = np.arange(6) != 2
    paths = [
        stack(tmp_path / "a.npz", side, usable=usable),
        stack(tmp_path / "b.npz", front),
    ]
    views = Observations([read_masks(path, ALL) for path in paths])
    assert [views[k].usable for k in range(6)] == [True] * 6
    assert not views[2].silhouettes[0].valid.any()
    assert views[2].silhouettes[1].valid.all()
    assert views[3].silhouettes[0].valid.all()
    stack(tmp_path / "b.npz", front, usable=~usable)  # no frame shows enough in both
    calibration = toml(tmp_path / "two.toml", camera(np.pi / 2), camera(0.6))
    scene = scene_of(paths, SourceOptions(camera=[calibration], up="y"))
    assert np.linalg.norm(scene.anchor - walk().translations[8]) < 1.0


def test_lens_distortion_is_undone_and_what_the_lens_missed_is_unknown(
    tmp_path: Path,
) -> None:
    side = camera(np.pi / 2)
    matrix = np.array(
        [[side.focal[0], 0.0, 79.5], [0.0, side.focal[1], 59.5], [0.0, 0.0, 1.0]]
    )
    one = Calibration(
        "bent",
        SIZE,
        matrix,
        np.array([0.8, 0.0, 0.0, 0.0]),
        side.rotation,
        side.translation,
    )
    straight = truth()[20]
    # what the lens makes of it: each bent pixel looks up its straight place
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float64)
    bent = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    undone = cv2.undistortPoints(
        bent, one.matrix, one.distortion, P=one.matrix
    ).reshape(SIZE[1], SIZE[0], 2)
    bent_mask = cv2.remap(
        straight.astype(np.uint8), undone.astype(np.float32), None, cv2.INTER_NEAREST
    )
    masks = read_masks(stack(tmp_path / "a.npz", [bent_mask]), ALL)
    silhouette = undistorted(masks, one, one.maps(SIZE)).silhouette(0)
    assert iou(silhouette.mask, straight) > 0.93 > iou(bent_mask > 0, straight)
    assert not silhouette.valid.all()


def test_a_resumed_track_continues_at_its_last_frame(tmp_path: Path) -> None:
    path = stack(tmp_path / "a.npz", truth()[10:30], usable=np.arange(20) != 11)
    settings: dict[str, Any] = {
        "evaluations": 400,
        "restarts": 1,
        "body_frames": 0,
        "method": "sapso",
    }
    whole = posefit.track(path, out=tmp_path / "whole", **settings)
    messages: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        posefit.track(
            path,
            out=tmp_path / "out",
            progress=replace(stopping(11), log=messages.append),
            **settings,
        )
    assert not (tmp_path / "out").exists()
    assert (
        "11 finished frames are kept: the same command with --resume continues from there"
        in messages
    )
    again = posefit.track(
        path,
        out=tmp_path / "out",
        resume=True,
        progress=Progress(messages.append),
        **settings,
    )
    assert "continuing from frame 11 of 20" in messages
    out, files = (
        {path.name for path in (tmp_path / name).iterdir()} for name in ("out", "whole")
    )
    assert out == files
    assert not list(tmp_path.glob(".out.*"))
    np.testing.assert_array_equal(again.motion.poses, whole.motion.poses)
    np.testing.assert_array_equal(again.motion.translations, whole.motion.translations)


def test_a_track_that_cannot_be_resumed_is_reported(tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match="expected an interrupted track to resume, got none"
    ):
        posefit.track("walk", resume=True, out=tmp_path / "out")
    with pytest.raises(ValueError, match="resume needs out"):
        posefit.track("walk", resume=True)


@pytest.mark.slow
def test_a_full_disk_is_reported_in_one_line_and_loses_no_frame(tmp_path: Path) -> None:
    words = [
        "track",
        str(stack(tmp_path / "a.npz", truth()[10:30])),
        "--out",
        str(tmp_path / "out"),
        *BRIEF,
    ]
    script = (
        "import resource, sys\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (24_000, 24_000))\n"
        "from posefit.cli import main\n"
        f"sys.exit(main({words!r}))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    lines = [line for line in done.stderr.splitlines() if line.startswith("posefit:")]
    assert done.returncode == 2, done.stderr
    assert len(lines) == 1
    assert "cannot write there: File too large" in lines[0]
    assert "finished frames are kept" in lines[0]
    assert not (tmp_path / "out").exists()
    again = run(*words, "--resume")
    assert again.exit_code == 0, again.stderr
    assert "continuing from frame" in again.stderr


def test_two_people_and_a_moving_camera_are_warned_of(tmp_path: Path) -> None:
    masks = [NOBODY] * EMPTY + truth()
    # the same person half the picture away
    crowd = [mask | np.roll(mask, SIZE[0] // 2, axis=1) for mask in masks]
    crowded = extract(film(tmp_path / "crowd.avi", crowd), tmp_path / "one")
    assert any(
        "2 people: 1 at " in warning and "--person" in warning
        for warning in crowded["warnings"]
    )
    still = film(tmp_path / "still.avi", masks)
    panned = [
        np.roll(image, k, axis=1) for k, image in enumerate(Video.of(still).frames())
    ]
    moving = extract(encoded(tmp_path / "moving.avi", panned), tmp_path / "two")
    assert any("the camera seems to move" in warning for warning in moving["warnings"])
    assert extract(still, tmp_path / "three")["warnings"] == []


def in_front(image: Any, k: int) -> Any:
    """A person stands before the camera, half of the picture wide, and sways."""
    left = 30 + round(15 * np.sin(k / 4.0))
    image[20:, left : left + SIZE[0] // 2] = (40.0, 30.0, 120.0)
    return image


def flickering(image: Any, k: int) -> Any:
    """Stripes of light, as a lamp gives them."""
    rows = np.arange(SIZE[1]) / SIZE[1]
    return (
        image
        * (1.0 + 0.12 * np.sin(2.0 * np.pi * (1.5 * rows + 0.37 * k)))[:, None, None]
    )


def test_a_moving_camera_is_seen_in_pictures_as_wide_as_a_panorama() -> None:
    rng = np.random.default_rng(0)
    # tiles of these pictures have 7 rows and 2, less than their search needs
    for height in (120, 40):
        coarse = rng.integers(0, 256, (height // 10, 64, 3)).astype(np.uint8)
        scene = cv2.resize(coarse, (640, height), interpolation=cv2.INTER_CUBIC)
        for shift, moves in ((0.0, False), (0.5, True)):
            camera_motion = CameraMotion((640, height))
            for k in range(30):
                camera_motion.add(k, np.roll(scene, round(k * shift), axis=1))
            assert camera_motion.moves == moves


@each("change", [in_front, flickering])
def test_a_camera_that_stands_still_does_not_seem_to_move(
    filmed: Film, change: Callable[[Any, int], Any]
) -> None:
    camera_motion = CameraMotion(SIZE)
    for k, image in enumerate(Video.of(filmed[0]).frames()):
        camera_motion.add(
            k, np.clip(change(image.astype(np.float32), k), 0, 255).astype(np.uint8)
        )
    assert not camera_motion.moves


def test_a_video_that_changes_its_size_is_named(filmed: Film) -> None:
    none = KeptFrames((80, 60), ())
    with pytest.raises(
        ValueError, match="walk.avi: expected frames of 160x60, got 160x120 in frame 0"
    ):
        list(replace(Video.of(filmed[0], 80), filmed=(160, 60), _kept=none).frames())


@each(
    ("words", "message"),
    [
        (
            ["VIDEO", "COPY"],
            "camera must be given for each of several views, 2, got none",
        ),
        (["VIDEO", "walk"], "sources must be of one kind, got motion and video"),
        (
            ["walk", "run"],
            "source must be one motion, or views of one person, got 2 motions",
        ),
        (
            ["VIDEO", "--camera", "LARGE"],
            "camera 'large' must be calibrated for 160x120, the size of the pictures, got 320x240",
        ),
        (["VIDEO", "--camera", "TWO"], "camera must be given for each view, 1, got 2"),
        (["VIDEO", "--height", "17"], "height must lie in 0.3 to 2.8 metres, got 17.0"),
        (["VIDEO", "--restarts", "-1"], "restarts must be 0 or more, got -1"),
        (
            ["VIDEO", "--view-degrees", "0", "--view-degrees", "90"],
            "view_degrees must be one for footage",
        ),
        (
            ["VIDEO", "--translation", "known"],
            "translation must be searched or aligned for footage",
        ),
        (
            ["VIDEO", "--first-pose", "given"],
            "first_pose must be searched for footage",
        ),
        (
            ["VIDEO", "--frames", "0:5"],
            "expected a person who moves in front of a still background, got none in any frame",
        ),
    ],
)
def test_a_mistake_with_footage_leaves_one_line(
    filmed: Film, tmp_path: Path, words: list[str], message: str
) -> None:
    inputs = tmp_path / "in"
    inputs.mkdir()
    (inputs / "large.json").write_text(
        posefit.Camera.around(np.zeros(3), 0.0, 4.0, (320, 240)).to_json()
    )
    two = toml(inputs / "two.toml", camera(0.0), camera(1.0))
    copy = shutil.copy(filmed[0], inputs / "copy.avi")
    names = {
        "VIDEO": filmed[0],
        "COPY": copy,
        "LARGE": inputs / "large.json",
        "TWO": two,
    }
    assert message in error_of(
        "track", *(names.get(word, word) for word in words), "--out", tmp_path / "out"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


@each(
    ("name", "content", "message"),
    [
        ("walk.trc", "PathFileType", "motions of .trc are not read; .amc and .bvh are"),
        ("walk.C3D", "x", "motions of .c3d are not read; .amc and .bvh are"),
        ("walk.fbx", "x", "motions of .fbx are not read; .amc and .bvh are"),
        ("rle.json", "{}", "expected COCO's lists images, annotations and categories"),
        ("poses.pkl", "x", "masks and motions of .pkl are not read; masks as images"),
        ("noext", "x", "a file name with a suffix such as .mp4"),
        ("missing.trc", None, "missing.trc: no such file"),
    ],
)
def test_a_file_that_is_no_source_is_named_by_its_type(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    content: str | None,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path(name).write_text(content)
    for source in (name, f"./{name}", tmp_path / name):
        assert message in error_of("track", source, "--out", "out")
    assert not Path("out").exists()
