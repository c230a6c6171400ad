"""Films: what is no video, frames that were never written, names of files, pictures one a frame."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.files import opencv_name
from posefit.footage.kinds import resolve
from posefit.footage.options import SourceOptions
from posefit.footage.rates import rate_of
from posefit.footage.source import scene_of
from posefit.footage.video import Video
from tests.cases import each
from tests.commands import error_of
from tests.footage.conftest import EMPTY, Film, film, iou, stack, truth
from tests.footage.matroska import write_matroska


def test_frames_that_are_all_the_same_are_refused(tmp_path: Path) -> None:
    # OpenCV 5.0 returns what the memory held where frames are interlaced
    path = write_matroska(
        tmp_path / "a.mkv", [np.full((48, 64, 3), 90, np.uint8)] * 5, range(0, 200, 40)
    )
    with pytest.raises(
        ValueError,
        match="a.mkv: all frames show the same picture; if the video is int",
    ):
        Video.of(path)


def test_pixels_that_are_not_square_are_reported(tmp_path: Path) -> None:
    images = [np.full((48, 64, 3), 20 * k, np.uint8) for k in range(5)]
    (warning,) = Video.of(
        write_matroska(tmp_path / "a.mkv", images, range(0, 200, 40), wide=93)
    ).warnings
    assert (
        "a.mkv: its pixels are 1.45 times as wide as high. This is not corrected"
        in warning
    )


@each(
    "text",
    [
        "ffconcat version 1.0\nfile 'secret.mp4'\n",
        "#EXTM3U\n#EXTINF:1,\nsecret.ts\n\0",
        "v=0\nm=video 1 RTP",
    ],
)
def test_a_text_that_would_open_other_files_is_refused(
    tmp_path: Path, text: str
) -> None:
    film(tmp_path / "secret.avi", truth()[:4])
    (tmp_path / "a.mp4").write_text(text.replace("secret.mp4", "secret.avi"))
    with pytest.raises(
        ValueError, match="a.mp4: expected a video that OpenCV can read, got a text"
    ):
        Video.of(tmp_path / "a.mp4")


def test_a_relative_name_with_a_colon_is_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film(tmp_path / "walk.avi", truth()[:4]).rename(tmp_path / "run-10:30.avi")
    monkeypatch.chdir(tmp_path)
    assert Video.of("run-10:30.avi").count() == 4
    assert opencv_name("run-10:30") == str(tmp_path / "run-10:30")


def guarded(name: str) -> Callable[..., Any]:
    """Return OpenCV's function or class of a name, behind a check that each name is UTF-8."""
    library = getattr(cv2, name)

    def stub(first: Any, *others: Any) -> Any:
        str(
            first
        ).encode()  # raises UnicodeEncodeError, where the library ends the process
        return library(first, *others)

    return stub


def test_a_name_that_opencv_cannot_open_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    strange = os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9")
    out = tmp_path / "out"
    path = film(tmp_path / "walk.avi", truth()[:4])
    _ = stack(Path(f"{strange}.npz"), truth()[:4])
    shutil.copy(path, f"{strange}.avi")
    before = sorted(tmp_path.iterdir())
    # if posefit let such a name through, the library would still not get it
    for name in ("VideoCapture", "VideoWriter", "imread", "imwrite"):
        monkeypatch.setattr(cv2, name, guarded(name))
    for words in (
        ("track", path, "--out", strange),
        ("track", f"{strange}.avi", "--out", out),
        ("track", f"{strange}.npz", "--out", out),
        ("track", "--live", strange),
        ("extract", path, "--out", strange),
    ):
        assert "expected a name in UTF-8, got other bytes" in error_of(*words), words
        assert sorted(tmp_path.iterdir()) == before, words


def test_a_name_beyond_ascii_is_refused_in_one_line_under_a_language_without_it(
    tmp_path: Path,
) -> None:
    film(tmp_path / "walk.avi", truth()[:4]).rename(tmp_path / "café.avi")
    script = f"""
import cv2
from posefit.footage.video import Video
cv2.VideoCapture = None  # if posefit let the name through, the library would not get it
Video.of(b'{tmp_path}/caf\\xc3\\xa9.avi'.decode('ascii', 'surrogateescape'))
"""
    plain = {
        "LC_ALL": "C",
        "PYTHONUTF8": "0",
        "PYTHONCOERCECLOCALE": "0",
        "PATH": os.environ["PATH"],
    }
    done = subprocess.run(
        [sys.executable, "-c", script], env=plain, capture_output=True, check=False
    )
    assert done.returncode == 1
    assert b"expected a name in UTF-8" in done.stderr.splitlines()[-1]


def written(folder: Path, path: Path, suffix: str, numbers: list[int]) -> Path:
    """Write the frames of a film as pictures with these numbers, and return their folder."""
    folder.mkdir()
    for number, image in zip(numbers, Video.of(path).frames(), strict=False):
        assert cv2.imwrite(str(folder / f"frame{number}{suffix}"), image)
    return folder


@each("suffix", [".png", ".jpg", ".webp"])
def test_pictures_are_a_film(filmed: Film, tmp_path: Path, suffix: str) -> None:
    path, masks = filmed
    folder = written(tmp_path / "a", path, suffix, list(range(len(masks))))
    assert resolve(folder).medium == "pictures"
    # a single one, which is refused there
    assert resolve(folder / f"frame0{suffix}").medium == "masks"
    scene, other = (
        scene_of([source], SourceOptions(fps=fps))
        for source, fps in ((folder, 25.0), (path, None))
    )
    assert (scene.count, scene.fps) == (len(masks), 25.0)
    views = [
        [one.observations[k].silhouettes[0].mask for k in range(EMPTY + 12, EMPTY + 30)]
        for one in (scene, other)
    ]
    assert np.median([iou(*pair) for pair in zip(*views, strict=True)]) > 0.9
    assert "30 frames a second" in scene_of([folder]).guesses


def test_a_picture_that_is_missing_is_held(filmed: Film, tmp_path: Path) -> None:
    numbers = [number for number in range(60) if number not in (30, 31)]
    folder = written(tmp_path / "a", filmed[0], ".png", numbers)
    scene = scene_of([folder])
    assert scene.count == 60
    assert not any(scene.observations[k].usable for k in (30, 31))
    assert any(
        "2 of the frames 0 to 59 are missing, and the pose is held" in guess
        for guess in scene.guesses
    )


@each(
    ("rate", "stated", "expected"),
    [
        # within half a percent: it is the stated one, over any length
        (30.0, 30.1, 30.1),
        (30.0, 30.3, 30.0),
        # of a whole rate and 1000 / 1001 of it, the nearer one
        (24.0, 30.0, 24.0),
        (24.0 / 1.001, 30.0, 24.0 / 1.001),
        (60.0 / 1.001, 30.0, 60.0 / 1.001),
        (12.3, 60.0, 12.3),
    ],
)
def test_the_stated_rate_is_kept_if_it_agrees_with_the_times(
    rate: float, stated: float, expected: float
) -> None:
    for seconds in (20, 200):
        times = np.arange(round(seconds * rate) + 1) / rate
        assert rate_of(times, 0.0, stated) == pytest.approx(expected, rel=1e-9)
