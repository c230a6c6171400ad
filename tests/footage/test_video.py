"""Films: what is no video, frames that were never written, names of files, pictures one a frame."""

import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.files import opencv_name
from posefit.footage.source import kind_of, scene_of
from posefit.footage.video import Video
from tests.cases import each
from tests.commands import error_of
from tests.footage.conftest import EMPTY, SIZE, film, truth

PERSON = (40, 60, 30)


def moving(count: int = 8) -> list[Any]:
    """Return pictures of a square that moves."""
    pictures = np.full((count, SIZE[1], SIZE[0], 3), PERSON, dtype=np.uint8)
    for k, picture in enumerate(pictures):
        picture[40:80, 10 * k : 10 * k + 30] = (200, 180, 160)
    return list(pictures)


def encoded(path: Path, *, interlaced: bool = False, aspect: Fraction | None = None) -> Path:
    """Write pictures by PyAV, which is skipped where it is not there."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"x264-params": f"interlaced={int(interlaced)}"})
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        if aspect is not None:
            stream.codec_context.sample_aspect_ratio = aspect
        for picture in moving():
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode())
    return path


def test_interlaced_frames_are_read_right_or_refused(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    path = encoded(tmp_path / "a.mp4", interlaced=True)
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))
        assert frame.interlaced_frame
        wanted = frame.to_ndarray(format="bgr24").astype(float)
    try:
        video = Video.of(path)
    except ValueError as error:
        assert "got the same picture in all frames; if it is interlaced" in str(error)
    else:
        assert np.abs(next(video.frames(0, 1, SIZE)) - wanted).mean() < 3.0


def test_frames_that_were_never_written_are_refused(tmp_path: Path) -> None:
    class Unwritten:
        """Says that it reads frames, and returns what the memory held, as OpenCV 5.0 does with interlaced video."""

        frames = 5

        def __init__(self, name: str) -> None:
            self._memory = np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8)

        def get(self, key: int) -> float:
            return 30.0 if key == cv2.CAP_PROP_FPS else 0.0

        def read(self) -> tuple[bool, Any]:
            self.frames -= 1
            return self.frames >= 0, self._memory

        def release(self) -> None:
            pass

    (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x20ftypisom" + bytes(99))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cv2, "VideoCapture", Unwritten)
        with pytest.raises(
            ValueError, match="a.mp4: expected a film, got the same picture in all frames; if it is int"
        ):
            Video.of(tmp_path / "a.mp4")


def test_a_film_is_as_pyav_decodes_it(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    video = Video.of(encoded(tmp_path / "a.mp4"))
    with av.open(str(tmp_path / "a.mp4")) as container:
        wanted = [frame.to_ndarray(format="bgr24").astype(float) for frame in container.decode(video=0)]
    assert (video.fps, video.count(), list(video.warnings)) == (25.0, len(wanted), [])
    for frame, other in zip(video.frames(0, None, SIZE), wanted, strict=True):
        assert np.abs(frame - other).mean() < 3.0


def test_pixels_that_are_not_square_are_reported(tmp_path: Path) -> None:
    (warning,) = Video.of(encoded(tmp_path / "a.mp4", aspect=Fraction(16, 11))).warnings
    assert "a.mp4: its pixels are 1.45 times as wide as high, which is not corrected" in warning


@each("text", ["ffconcat version 1.0\nfile 'secret.mp4'\n", "#EXTM3U\n#EXTINF:1,\nsecret.ts\n\0", "v=0\nm=video 1 RTP"])
def test_a_text_that_would_open_other_files_is_refused(tmp_path: Path, text: str) -> None:
    film(tmp_path / "secret.avi", truth()[:4])
    (tmp_path / "a.mp4").write_text(text.replace("secret.mp4", "secret.avi"))
    with pytest.raises(ValueError, match="a.mp4: expected a video that OpenCV can read, got a text"):
        Video.of(tmp_path / "a.mp4")


def test_a_relative_name_with_a_colon_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film(tmp_path / "walk.avi", truth()[:4]).rename(tmp_path / "run-10:30.avi")
    monkeypatch.chdir(tmp_path)
    assert Video.of("run-10:30.avi").count() == 4
    assert opencv_name("run-10:30") == str(tmp_path / "run-10:30")


@each("where", ["source", "out", "extract", "live", "masks"])
def test_a_name_that_opencv_cannot_open_is_refused_before_the_work(tmp_path: Path, where: str) -> None:
    strange = os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9")
    film(tmp_path / "walk.avi", truth()[:4])
    words: tuple[Any, ...] = ("track", tmp_path / "walk.avi", "--out", strange)
    if where == "source":
        os.rename(tmp_path / "walk.avi", f"{strange}.avi")
        words = ("track", f"{strange}.avi", "--out", tmp_path / "out")
    elif where == "masks":
        np.savez(strange + ".npz", masks=truth()[:4])
        (tmp_path / "walk.avi").unlink()
        words = ("track", strange + ".npz", "--out", tmp_path / "out")
    elif where == "live":
        words = ("track", "--live", strange)
    elif where == "extract":
        words = ("extract", tmp_path / "walk.avi", "--out", strange)
    assert "expected a name in UTF-8, got one that is not" in error_of(*words)
    assert len(list(tmp_path.iterdir())) == 1


def test_a_name_beyond_ascii_is_refused_in_one_line_under_a_language_without_it(tmp_path: Path) -> None:
    film(tmp_path / "walk.avi", truth()[:4]).rename(tmp_path / "café.avi")
    script = f"from posefit.footage.video import Video\nVideo.of(b'{tmp_path}/caf\\xc3\\xa9.avi'.decode('ascii', 'surrogateescape'))"
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PATH": os.environ["PATH"]}
    done = subprocess.run([sys.executable, "-c", script], env=plain, capture_output=True, check=False)
    assert done.returncode == 1
    assert b"expected a name in UTF-8" in done.stderr.splitlines()[-1]


def written(folder: Path, path: Path, suffix: str, numbers: list[int]) -> Path:
    """Write the frames of a film as pictures with these numbers, and return their folder."""
    folder.mkdir()
    for number, image in zip(numbers, Video.of(path).frames(0, None, SIZE), strict=False):
        assert cv2.imwrite(str(folder / f"frame{number}{suffix}"), image)
    return folder


@each("suffix", [".png", ".jpg", ".webp"])
def test_pictures_are_a_film(filmed: tuple[Path, list[Any]], tmp_path: Path, suffix: str) -> None:
    path, masks = filmed
    folder = written(tmp_path / "a", path, suffix, list(range(len(masks))))
    assert kind_of(folder) == "pictures"
    assert kind_of((folder / f"frame0{suffix}",)) == "masks"  # a single one, which is refused there
    scene, other = (scene_of([source], fps=fps) for source, fps in ((folder, 25.0), (path, None)))
    assert (scene.count, scene.fps) == (len(masks), 25.0)
    overlaps = []
    for k in range(EMPTY + 12, EMPTY + 30):
        first, second = (one.observations[k].silhouettes[0].mask for one in (scene, other))
        overlaps.append((first & second).sum() / (first | second).sum())
    assert np.median(overlaps) > 0.9
    assert "30 frames a second" in scene_of([folder]).guesses


def test_a_picture_that_is_missing_is_held(filmed: tuple[Path, list[Any]], tmp_path: Path) -> None:
    numbers = [number for number in range(60) if number not in (30, 31)]
    folder = written(tmp_path / "a", filmed[0], ".png", numbers)
    scene = scene_of([folder])
    assert scene.count == 60
    assert not any(scene.observations[k].usable for k in (30, 31))
    assert any("2 of the frames 0 to 59 are missing, and are held" in guess for guess in scene.guesses)
