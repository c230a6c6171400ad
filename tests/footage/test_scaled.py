"""A video at the size of its masks: kept frames are those that are decoded, to the bit."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.footage import scaled
from posefit.footage.scaled import ScaledVideo, ahead
from posefit.footage.video import Video
from tests.cases import each

SIZE = (160, 120)
WIDTH = 40
COUNT = 12
SPAN = (3, 9)


@pytest.fixture
def video(tmp_path: Path) -> Video:
    rng = np.random.default_rng(0)
    path = tmp_path / "noise.avi"
    code = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), code, 25.0, SIZE)
    for _ in range(COUNT):
        writer.write(rng.integers(0, 256, (SIZE[1], SIZE[0], 3)).astype(np.uint8))
    writer.release()
    return Video.of(path)


def decoded(video: Video, monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, Any]]:
    """Return a list that gets the start and the stop of every pass of decoding."""
    passes = list[tuple[int, Any]]()
    frames = Video.frames

    def counted(self: Video, start: int, stop: int | None, *how: Any) -> Any:
        passes.append((start, stop))
        return frames(self, start, stop, *how)

    monkeypatch.setattr(Video, "frames", counted)
    return passes


def test_frames_are_decoded_once_even_if_a_reader_overwrites_them(
    video: Video, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = [*video.frames(*SPAN, (40, 30))]
    passes = decoded(video, monkeypatch)
    small = ScaledVideo(video, WIDTH, SPAN)
    assert small.size == (40, 30)
    for bounds in ((0, None), SPAN, SPAN):
        frames = [frame.copy() for frame in written_over(small.frames(*bounds))]
        chosen = frames if bounds == SPAN else frames[slice(*SPAN)]
        np.testing.assert_array_equal(chosen, expected)
    assert passes == [(0, None)]


def written_over(frames: Any) -> Any:
    """Yield frames, and write into each of them afterwards."""
    for frame in frames:
        yield frame
        frame[:] = 0


@each("bounds", [(4, None, 1), (0, 8, 1), (0, None, 2)])
def test_a_pass_that_misses_frames_of_the_span_keeps_none(
    video: Video, bounds: tuple[int, int | None, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    small = ScaledVideo(video, WIDTH, SPAN)
    for _ in small.frames(*bounds):
        pass
    next(small.frames())  # a pass that was not ended
    passes = decoded(video, monkeypatch)
    assert len([*small.frames(*SPAN)]) == SPAN[1] - SPAN[0]
    assert passes == [SPAN]


@each("limit", [("KEPT_BYTES", 5000), ("LARGE", 17)])
def test_frames_that_are_too_many_or_hardly_scaled_are_decoded_again(
    video: Video, limit: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scaled, *limit)
    expected = [*video.frames(*SPAN, (40, 30))]
    small = ScaledVideo(video, WIDTH, SPAN)
    passes = decoded(video, monkeypatch)
    for _ in range(2):
        np.testing.assert_array_equal([*small.frames(*SPAN)], expected)
    assert passes == [SPAN, SPAN]


def test_a_threads_results_come_in_order_with_its_error() -> None:
    def numbers() -> Any:
        yield from range(5)
        raise ValueError("no more")

    items = ahead(numbers())
    assert [next(items) for _ in range(5)] == [*range(5)]
    with pytest.raises(ValueError, match="no more"):
        next(items)
    assert [*ahead(iter([]))] == []
