"""Masks from video: synthetic ones with a known person, and video whose frames come at uneven times."""

import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.fitting.validation import BrokenRuleError
from posefit.footage.extract import extract
from posefit.footage.extraction import Extraction
from posefit.footage.segmentation import Segmentation
from posefit.footage.video import Video
from posefit.geometry.skeleton import JOINTS
from posefit.silhouette.foreground import Still, mean_background, people
from tests.cases import each
from tests.commands import error_of, printed, run
from tests.files import arrays, csv_rows
from tests.footage.conftest import (
    ALL,
    EMPTY,
    FRAMES,
    NOBODY,
    SIZE,
    Box,
    Film,
    encoded,
    iou,
    read_masks,
    stack,
    truth,
)
from tests.footage.matroska import write_matroska


@each(
    ("method", "background"),
    [("mixture", None), ("median", None), ("mean", f"0:{EMPTY}")],
)
def test_each_method_finds_the_person(
    filmed: Film, tmp_path: Path, method: Any, background: Any
) -> None:
    path, masks = filmed
    result = extract(
        path, tmp_path / "out", Extraction(method, background), frames=(EMPTY, None)
    )
    assert result["frames"] == FRAMES
    assert result["usable"] > 0.8 * FRAMES
    stored = arrays(tmp_path / "out" / "masks.npz")
    assert stored["masks"].shape == stored["valid"].shape == (FRAMES, SIZE[1], SIZE[0])
    assert stored["fps"] == 25.0
    overlaps = [
        iou(a > 0, b)
        for a, b, ok in zip(
            stored["masks"], masks[EMPTY:], stored["usable"], strict=True
        )
        if ok
    ]
    # a person of 900 pixels: half a pixel all along the edge costs 0.15
    assert np.mean(overlaps) > 0.8
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "masks.npz",
        "preview.mp4",
        "quality.csv",
    }
    rows = csv_rows(tmp_path / "out" / "quality.csv")
    assert [int(row["frame"]) for row in rows] == list(range(EMPTY, EMPTY + FRAMES))
    assert sum(int(row["usable"]) for row in rows) == result["usable"]


def test_a_video_of_masks_is_taken_as_it_is(tmp_path: Path) -> None:
    masks = truth()[8:20]
    images = [
        255 * mask.astype(np.uint8)[..., None].repeat(3, axis=2) for mask in masks
    ]
    result = extract(
        encoded(tmp_path / "a.avi", images, "FFV1"),
        tmp_path / "out",
        Extraction("masks"),
    )
    assert result["usable"] == 12
    stored = arrays(tmp_path / "out" / "masks.npz")
    assert (
        np.mean([iou(a > 0, b) for a, b in zip(stored["masks"], masks, strict=True)])
        > 0.95
    )
    assert stored["valid"].all()


def test_extracted_masks_can_be_tracked_and_unknown_pixels_stay_unknown(
    filmed: Film, tmp_path: Path
) -> None:
    path, _ = filmed
    hidden = np.zeros((SIZE[1], SIZE[0]), dtype=np.uint8)
    hidden[:, 70:80] = 255
    cv2.imwrite(str(tmp_path / "tree.png"), hidden)
    extract(
        path,
        tmp_path / "out",
        Extraction(ignore=tmp_path / "tree.png"),
        frames=(EMPTY + 5, EMPTY + 40),
    )
    masks = tmp_path / "out" / "masks.npz"
    silhouette = read_masks(masks, ALL).silhouette(15)
    assert not silhouette.valid[:, 70:80].any()
    assert not silhouette.mask[:, 70:80].any()
    result = posefit.track(
        masks,
        method="@loose",
        frames=(EMPTY + 10, EMPTY + 14),
        view_degrees=90,
        evaluations=400,
    )
    assert result.summary["iou"] > 0.4


def test_a_mean_background_is_the_mean_and_its_spread() -> None:
    images = [np.full((2, 3, 3), value, dtype=np.uint8) for value in (10, 20, 30)]
    still = mean_background(iter(images))
    np.testing.assert_allclose(still.middle, 20.0)
    np.testing.assert_allclose(still.spread, np.sqrt(200.0 / 3.0), rtol=1e-6)
    with pytest.raises(ValueError, match="at least one frame"):
        mean_background([])


def test_a_shadow_is_darker_but_has_the_grounds_colour() -> None:
    still = Still(
        np.full((1, 4, 3), (80.0, 120.0, 160.0), dtype=np.float32),
        np.zeros((1, 4), dtype=np.float32),
    )
    # the ground; its shadow at 60 %; another colour; far darker than any shadow
    image = np.array(
        [[[80, 120, 160], [48, 72, 96], [160, 60, 40], [8, 12, 16]]], dtype=np.uint8
    )
    foreground, shadow = still.segment(image)
    assert foreground.tolist() == [[False, False, True, True]]
    assert shadow.tolist() == [[False, True, False, False]]


def test_the_largest_person_is_taken_with_the_pieces_near_it_and_small_holes_filled() -> (
    None
):
    foreground, empty = np.zeros((2, 250, 250), dtype=bool)
    foreground[50:200, 100:140] = True  # the person
    foreground[100:106, 115:121] = False  # a small hole in it
    foreground[204:225, 100:140] = True  # feet, 4 rows apart
    foreground[50:120, 220:240] = True  # a smaller person, far off
    foreground[5, 5] = True  # a speck
    largest = people(foreground, empty, None, None)[0]
    assert largest.mask[103, 118]
    assert largest.mask[210, 120]
    assert not largest.mask[:, 215:].any()
    assert not largest.mask[5, 5]
    assert largest.pieces >= 2
    assert not largest.touches_border
    assert people(foreground, empty, (210, 0, 40, 250), None)[0].mask[60, 230]
    none = people(empty, empty, None, None)[0]
    assert (none.area, none.pieces, none.touches_border) == (0, 0, False)
    foreground[50:200, 0:100] = True
    assert people(foreground, empty, None, None)[0].touches_border


def test_the_command_prints_a_summary(filmed: Film, tmp_path: Path) -> None:
    words = ["extract", filmed[0], "--frames", "20:40", "--out"]
    summary = printed(*words, tmp_path / "out")
    assert (summary["frames"], summary["size"], summary["guesses"]) == (
        20,
        [160, 120],
        [],
    )
    assert (
        "20 frames"
        in run(*words, tmp_path / "two", "--width", "80", "--roi", "0,0,160,120").stdout
    )
    assert arrays(tmp_path / "two" / "masks.npz")["masks"].shape == (20, 60, 80)


@each(
    ("words", "message"),
    [
        (
            ["--extraction", "magic"],
            "segmenter must be one of masks, mean, median, mediapipe, mixture, got 'magic'",
        ),
        (
            ["--extraction", "mean"],
            "background must be frames A:B or an image for the method mean, got none",
        ),
        (
            ["--extraction", "mixture", "--background", "0:5"],
            "background applies only to the method mean, got '0:5' with mixture",
        ),
        (
            ["--background", "nothing.png"],
            "nothing.png: no such file",
        ),
        (
            ["--set", "mixture.colour=3"],
            "a setting of mixture must be one of history, threshold, got 'colour'",
        ),
        (["--set", "threshold=-1"], "threshold must be above 0, got -1"),
        (["--frames", "90:"], "frames must contain one of the 60 frames, got 90:"),
        (["--roi", "1,2,3"], "expected X,Y,WIDTH,HEIGHT in pixels"),
        (["--roi", "100,0,100,100"], "roi must lie within the video's 160x120 pixels"),
        (
            ["--ignore", "nothing.png"],
            "nothing.png: expected an image of what to ignore",
        ),
        (["--width", "3"], "width must lie in 36 to 8192 pixels, got 3"),
        (
            ["--frames", "0:8", "--background", "0:12"],
            "expected a person who moves in front of a still background",
        ),
    ],
)
def test_a_mistake_leaves_one_line(
    filmed: Film, tmp_path: Path, words: list[str], message: str
) -> None:
    assert message in error_of("extract", filmed[0], "--out", tmp_path / "out", *words)
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_no_video_is_named(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "empty.mp4").write_bytes(b"")
    for name, message in (
        ("missing.mp4", "missing.mp4: no such file"),
        ("text.mp4", "expected a video that OpenCV can read"),
        ("empty.mp4", "expected a video that OpenCV can read"),
    ):
        assert message in error_of(
            "extract", tmp_path / name, "--out", tmp_path / "out"
        )
    (tmp_path / "out").mkdir()
    assert "got one that exists" in error_of(
        "extract", tmp_path / "text.mp4", "--out", tmp_path / "out"
    )


def test_a_pose_is_held_where_a_frame_is_not_usable(tmp_path: Path) -> None:
    usable = np.ones(12, dtype=bool)
    usable[[0, 5, 6]] = False
    masks = truth()[10:22]
    masks[6] = NOBODY
    path = stack(tmp_path / "a.npz", masks, usable=usable)
    result = posefit.track(
        path,
        method="sapso",
        view_degrees=90,
        evaluations=400,
        smooth=False,
        out=tmp_path / "out",
    )
    assert [result.summary[name] for name in ("frames", "held_frames")] == [12, 3]
    assert result.summary["effort"]["frames"] == 9 * 400
    assert result.table["usable"].tolist() == usable.astype(float).tolist()
    poses = result.motion.poses
    np.testing.assert_array_equal(poses[5], poses[4])
    np.testing.assert_array_equal(poses[6], poses[4])
    assert (poses[7] != poses[6]).any()
    assert result.summary["iou"] == pytest.approx(result.table["iou"][usable].mean())
    carried = posefit.track(
        path, method="annealed", view_degrees=90, evaluations=400
    ).summary
    assert carried["effort"]["frames"] == 9 * 400


@each(
    ("more", "message"),
    [
        (
            {"valid": np.ones((12, 5, 5), dtype=bool)},
            r"valid must have the masks' shape \(12, 120, 160\), got \(12, 5",
        ),
        (
            {"usable": np.ones(5, dtype=bool)},
            r"usable must be 12 booleans, got \(5,\) bool",
        ),
        ({"usable": np.ones(12)}, r"usable must be 12 booleans, got \(12,\) float64"),
        (
            {"usable": np.zeros(12, dtype=bool)},
            "no frame from 0 to 12 is marked as usable",
        ),
        ({"fps": np.array(0.0)}, r"fps must lie in 0.001 to 1e\+06, got 0"),
    ],
)
def test_masks_that_contradict_themselves_are_named(
    tmp_path: Path, more: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        posefit.track(stack(tmp_path / "a.npz", truth()[10:22], **more))


def frame_numbers(video: Video, *chosen: Any) -> list[int]:
    """Return the numbers of the frames, which are as grey as their number says."""
    return [round(float(image.mean()) / 20.0) for image in video.frames(*chosen)]


def grey(path: Path, milliseconds: list[int]) -> Video:
    images = [
        np.full((48, 64, 3), 20 * k, dtype=np.uint8) for k in range(len(milliseconds))
    ]
    return Video.of(write_matroska(path, images, milliseconds))


def test_a_moment_that_was_not_filmed_shows_the_nearest_frame(tmp_path: Path) -> None:
    # thirty frames a second, of which those at 133, 233 and 267 ms were left out
    video = grey(tmp_path / "a.mkv", [0, 33, 67, 100, 167, 200, 300, 333, 367])
    assert video.fps == pytest.approx(30.0, rel=0.02)
    assert video.count() == 12
    numbers = frame_numbers(video)
    assert [numbers[k] for k in (0, 1, 2, 3, 5, 6, 9, 10, 11)] == list(range(9))
    assert (numbers[4] in (3, 4), numbers[7], numbers[8]) == (True, 5, 6)
    assert frame_numbers(video, 2, 6) == numbers[2:6]
    assert [k for k in range(12) if not video.is_filmed(k)] == [4, 7, 8]
    (warning,) = video.warnings
    assert "its frames come at uneven times, so it is sampled 30" in warning
    assert "3 of these 12 frames were not filmed" in warning


def test_even_times_leave_a_video_as_it_was(tmp_path: Path) -> None:
    # rounded, and by a telephone's clock
    for milliseconds in (
        [0, 33, 67, 100, 133, 167],
        [0, 35, 64, 103, 131, 168],
        [0, 40, 80, 120, 160, 200],
    ):
        video = grey(tmp_path / "a.mkv", milliseconds)
        assert frame_numbers(video) == [0, 1, 2, 3, 4, 5]
        assert video.warnings == []
        assert video.fps == pytest.approx(1e3 * 5 / milliseconds[-1], rel=0.03)


@each(
    ("stated", "milliseconds", "rate"),
    [
        # a webcam that falls to half its rate, and films under other rates
        (30, [round(1e3 * k / 15) for k in range(30)], 15.0),
        (25, [round(1e3 * k / 120) for k in range(30)], 120.0),
        (60, [round(1e3 * k / 25) for k in range(30)], 25.0),
        (30, [round(1e3 * k / 24) for k in range(12)], 24.0),
        (25, [round(1e3 * k / 59.94) for k in range(30)], 60 / 1.001),
        (30, [round(1e3 * k / 7.5) for k in range(12)], 7.5),
        # the head is right, where stamps are rounded or shake
        (30, [round(1e3 * k / 30) for k in range(30)], 30.0),
        (30, [33 * k + (7, -5, 0)[k % 3] for k in range(30)], 30.0),
        (30, [0, 33, 67], 30.0),
    ],
)
def test_a_rate_in_the_head_yields_to_even_time_stamps(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stated: int,
    milliseconds: list[int],
    rate: float,
) -> None:
    images = [np.full((48, 64, 3), 4 * k, np.uint8) for k in range(len(milliseconds))]
    milliseconds = [time - milliseconds[0] for time in milliseconds]
    path = write_matroska(tmp_path / "a.mkv", images, milliseconds, stated=stated)
    video = Video.of(path)
    assert video.fps == pytest.approx(rate, rel=1e-3)
    assert video.count() == len(milliseconds)
    assert video.warnings == []
    assert bool(video.guesses) == (video.fps != stated)
    if video.guesses:
        (guess,) = video.guesses
        assert f"{video.fps:.4g} frames a second by the times of its frames" in guess
        assert f"although its header says {stated}" in guess
        assert video.claimed == 0  # counted by the head's rate


@pytest.mark.skipif(
    not hasattr(cv2, "CAP_PROP_PTS"), reason="OpenCV does not say when a film begins"
)
@each("start", [0, 40, 3000])
@each("missing", [0, 5])
def test_the_time_before_the_first_frame_has_no_frames(
    tmp_path: Path, start: int, missing: int
) -> None:
    images = [np.full((48, 64, 3), 4 * k, np.uint8) for k in range(20)]
    path = write_matroska(
        tmp_path / "a.mkv",
        images,
        [start + 40 * k for k in range(20)],
        stated=25,
        # as programs write it that cut a longer film
        lasts=start + 40.0 * (20 + missing),
    )
    assert Video.of(path).claimed == 20 + missing


def test_a_very_short_frame_does_not_make_thousands(tmp_path: Path) -> None:
    video = grey(tmp_path / "a.mkv", [0, 1, 2, 3, 400, 800, 1200])
    assert video.count() <= 4 * 7


def test_an_unstated_rate_is_guessed_aloud(
    filmed: Film, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = cv2.VideoCapture

    class Timeless:
        def __init__(self, name: str) -> None:
            self.file = opened(name)

        def get(self, key: int) -> float:
            return (
                0.0
                if key in (cv2.CAP_PROP_FPS, cv2.CAP_PROP_POS_MSEC)
                else float(self.file.get(key))
            )

        def __getattr__(self, name: str) -> Any:
            return getattr(self.file, name)

    monkeypatch.setattr(cv2, "VideoCapture", Timeless)
    result = run("extract", filmed[0], "--frames", "20:40", "--out", tmp_path / "out")
    assert (
        f"guessed: {filmed[0]}: 30 frames a second, which the file does not state"
        in result.stderr
    )
    assert arrays(tmp_path / "out" / "masks.npz")["fps"] == 30.0


def test_a_walker_goes_as_fast_as_the_stamps_say(filmed: Film, tmp_path: Path) -> None:
    pictures = list(Video.of(filmed[0]).frames())
    taken = [k for k in range(len(pictures)) if k % 10 not in (3, 4, 7)]
    path = write_matroska(
        tmp_path / "a.mkv", [pictures[k] for k in taken], [40 * k for k in taken]
    )
    out = tmp_path / "out"
    result = run("extract", path, "--out", out, "--frames", f"{EMPTY + 6}:{EMPTY + 40}")
    assert result.exit_code == 0, result.stderr
    assert "its frames come at uneven times" in result.stderr
    stored = arrays(out / "masks.npz")
    assert stored["fps"] == pytest.approx(25.0)
    assert len(stored["masks"]) == 34
    held = np.array([k % 10 in (3, 4, 7) for k in range(EMPTY + 6, EMPTY + 40)])
    assert not stored["usable"][held].any()
    assert stored["usable"][~held].mean() > 0.8
    middles = np.array(
        [np.flatnonzero(mask.any(axis=0)).mean() for mask in stored["masks"]]
    )
    true = np.array(
        [
            np.flatnonzero(mask.any(axis=0)).mean()
            for mask in filmed[1][EMPTY + 6 : EMPTY + 40]
        ]
    )
    # pixels: the frame at its own time
    assert np.abs(middles - true)[stored["usable"]].max() < 3.0


def test_a_segmenter_gets_the_roi_alone_and_its_masks_and_landmarks_are_put_there(
    filmed: Film, segmenter: Any
) -> None:
    segmenter("box", Box)
    how = Extraction("box", roi=(20, 10, 120, 100))
    masks, *_ = Segmentation(Video.of(filmed[0]), how, (0, 3)).read()
    assert masks.landmarks is not None
    assert masks.landmarks.shape == (3, len(JOINTS), 3)
    assert not masks.landmarks[0, :, 2].any()
    np.testing.assert_array_equal(masks.landmarks[1:, 0], [[25.0, 17.0, 0.5]] * 2)
    rows, columns = (
        np.flatnonzero(masks.silhouette(0).mask.any(axis=axis)) for axis in (1, 0)
    )
    # of a part 120 pixels wide a sixth is marked
    assert (rows[0], columns[0], columns[-1]) == (30, 25, 44)
    how = Extraction("box", settings={"wrong": "landmarks"})
    with pytest.raises(
        BrokenRuleError, match=r"landmarks must be finite numbers of shape \(27, 3\)"
    ):
        Segmentation(Video.of(filmed[0]), how, (0, 3)).read()


def test_pictures_are_extracted_masks_cleaned_and_motions_drawn(
    filmed: Film, tmp_path: Path
) -> None:
    (tmp_path / "film").mkdir()
    for k, image in enumerate(Video.of(filmed[0]).frames(0, 30)):
        cv2.imwrite(str(tmp_path / "film" / f"{k + 1:03d}.png"), image)
    words = ["--background", "0:10", "--frames", "10:25"]
    result = run("extract", tmp_path / "film", *words, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    masks = read_masks(tmp_path / "out" / "masks.npz", ALL)
    assert masks.numbers.tolist() == [*range(10, 25)]
    (tmp_path / "masks").mkdir()
    for k, mask in enumerate(filmed[1][EMPTY : EMPTY + 3]):
        cv2.imwrite(str(tmp_path / "masks" / f"{k}.png"), 255 * mask.astype(np.uint8))
    for name, source in (
        ("again", tmp_path / "out" / "masks.npz"),
        ("white", tmp_path / "masks"),
        ("motion", "walk"),
    ):
        words = ["--frames", "11:13"] if name == "again" else ["--frames", "1:3"]
        done = run("extract", source, *words, "--out", tmp_path / name)
        assert done.exit_code == 0, done.stderr
        written = read_masks(tmp_path / name / "masks.npz", ALL)
        assert written.numbers.tolist() == ([11, 12] if name == "again" else [1, 2])
        assert (tmp_path / name / "preview.mp4").is_file()
        assert not (tmp_path / name / "quality.csv").exists()
    error = error_of(
        "extract", tmp_path / "masks", "--width", "320", "--out", tmp_path / "new"
    )
    assert "width applies only to video, got 320 for masks" in error
    with pytest.raises(ValueError, match="extraction applies only to video"):
        extract(tmp_path / "masks", tmp_path / "new", Extraction("median"))


def test_views_of_several_cameras_are_extracted_to_a_folder_each(
    filmed: Film, tmp_path: Path
) -> None:
    files = [
        stack(tmp_path / f"{name}.npz", truth(azimuth)[:8], first=first, fps=25.0)
        for name, azimuth, first in (("a", np.pi / 2, 0), ("b", 0.6, 2))
    ]
    copy = Path(shutil.copy(filmed[0], tmp_path / "copy.avi"))
    for name, sources in (("masks", files), ("films", [filmed[0], copy])):
        out = tmp_path / name
        words = ["--background", "0:10", "--frames", "12:18"] * (name == "films")
        result = run("extract", *sources, *words, "--out", out)
        assert result.exit_code == 0, result.stderr
        assert sorted(path.name for path in out.iterdir()) == ["1", "2"]
        start = 12 if name == "films" else 2  # the frames that both have
        for number in "12":
            view = read_masks(out / number / "masks.npz", ALL)
            assert view.numbers.tolist() == [*range(start, start + 6)]
