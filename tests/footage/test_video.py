"""Video whose frames come at uneven times is followed by its time stamps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.footage.video import Video
from tests.commands import run
from tests.files import arrays
from tests.footage.conftest import EMPTY, SIZE
from tests.footage.matroska import write_matroska


def frame_numbers(video: Video, *chosen: Any) -> list[int]:
    """Return the numbers of the frames, which are as grey as their number says."""
    return [round(float(image.mean()) / 20.0) for image in video.frames(*(chosen or (0, None)), video.size)]


def grey(path: Path, milliseconds: list[int]) -> Video:
    images = [np.full((48, 64, 3), 20 * k, dtype=np.uint8) for k in range(len(milliseconds))]
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
    assert "its frames come at uneven times; it is sampled 30" in warning
    assert "so that 3 of 12 frames stand for moments without a filmed one, and are held" in warning


def test_even_times_leave_a_video_as_it_was(tmp_path: Path) -> None:
    # rounded, and by a telephone's clock
    for milliseconds in ([0, 33, 67, 100, 133, 167], [0, 35, 64, 103, 131, 168], [0, 40, 80, 120, 160, 200]):
        video = grey(tmp_path / "a.mkv", milliseconds)
        assert frame_numbers(video) == [0, 1, 2, 3, 4, 5]
        assert video.warnings == []
        assert video.fps == pytest.approx(1e3 * 5 / milliseconds[-1], rel=0.03)


def test_a_very_short_frame_does_not_make_thousands(tmp_path: Path) -> None:
    video = grey(tmp_path / "a.mkv", [0, 1, 2, 3, 400, 800, 1200])
    assert video.count() <= 4 * 7


def test_a_walker_goes_as_fast_as_the_stamps_say(filmed: tuple[Path, list[Any]], tmp_path: Path) -> None:
    pictures = list(Video.of(filmed[0]).frames(0, None, SIZE))
    taken = [k for k in range(len(pictures)) if k % 10 not in (3, 4, 7)]
    path = write_matroska(tmp_path / "a.mkv", [pictures[k] for k in taken], [40 * k for k in taken])
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
    middles = np.array([np.flatnonzero(mask.any(axis=0)).mean() for mask in stored["masks"]])
    true = np.array([np.flatnonzero(mask.any(axis=0)).mean() for mask in filmed[1][EMPTY + 6 : EMPTY + 40]])
    assert np.abs(middles - true)[stored["usable"]].max() < 3.0  # pixels: the frame at its own time
