"""A film is decoded once: kept frames are those that are decoded, to the bit."""

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.footage import kept, video
from posefit.footage.kept import KeptFrames
from posefit.footage.kinds import resolve
from posefit.footage.source import films_of
from posefit.footage.video import Video, ahead
from tests.cases import each

SIZE = (160, 120)
WIDTH = 40
SMALL = (40, 30)
BYTES = 3 * 40 * 30  # of a frame
COUNT = 12
SPAN = (3, 9)
Opened = Callable[[], Video]


def images() -> list[Any]:
    rng = np.random.default_rng(0)
    shape = (SIZE[1], SIZE[0], 3)
    return [rng.integers(0, 256, shape).astype(np.uint8) for _ in range(COUNT)]


def opened_video(folder: Path) -> Video:
    path = folder / "noise.avi"
    code = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), code, 25.0, SIZE)
    for image in images():
        writer.write(image)
    writer.release()
    return Video.of(path, WIDTH)


def opened_pictures(folder: Path) -> Video:
    for k, image in enumerate(images()):
        assert cv2.imwrite(str(folder / f"f{k:02d}.png"), image)
    (film,) = films_of(resolve(folder), WIDTH, 25.0)
    return film


@pytest.fixture(params=[opened_video, opened_pictures])
def film(request: pytest.FixtureRequest, tmp_path: Path) -> Opened:
    """Return a function that opens a film of noise."""
    return lambda: request.param(tmp_path)


@pytest.fixture
def expected() -> list[Any]:
    """Return the frames of the film."""
    return [video.scaled(image, SMALL) for image in images()]


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that gets the number of every frame that is decoded later."""
    numbers = list[int]()
    before = Video._decoded

    def counted(self: Video, wanted: list[int]) -> Iterator[Any]:
        for number, image in zip(wanted, before(self, wanted), strict=False):
            numbers.append(number)
            yield image

    monkeypatch.setattr(Video, "_decoded", counted)
    return numbers


def written_over(frames: Any) -> Iterator[Any]:
    """Yield copies of frames, and write into the frames afterwards."""
    for frame in frames:
        yield frame.copy()
        frame[:] = 0


def test_every_frame_is_decoded_once_whoever_writes_into_it(
    film: Opened, expected: list[Any], decoded: list[int]
) -> None:
    opened = film()
    assert (opened.filmed, opened.size, opened.scale) == (SIZE, SMALL, 0.25)
    for bounds in ((0, None, 1), SPAN, (0, None, 2), SPAN):
        frames = [*written_over(opened.frames(*bounds))]
        np.testing.assert_array_equal(frames, expected[slice(*bounds)])
    # a file was decoded when it was opened
    assert decoded == ([] if not opened.pictures else [*range(COUNT)])


@each("room", [0, 4])
def test_of_a_film_that_is_too_long_what_is_needed_again_is_kept(
    film: Opened,
    expected: list[Any],
    decoded: list[int],
    monkeypatch: pytest.MonkeyPatch,
    room: int,
) -> None:
    monkeypatch.setattr(kept, "ROOM", room * BYTES)
    monkeypatch.setattr(video, "ROOM", room * BYTES)
    opened = film()
    opened.keep(*SPAN)
    decoded.clear()
    np.testing.assert_array_equal([*opened.frames()], expected)
    assert [*dict.fromkeys(decoded)] == [*range(COUNT)]
    decoded.clear()
    frames = [*opened.frames(*SPAN)]
    np.testing.assert_array_equal(frames, expected[slice(*SPAN)])
    first, last = SPAN
    assert [*dict.fromkeys(decoded)] == [*range(first + room, last)]


def test_a_disk_without_room_costs_time_and_no_frame(
    film: Opened, expected: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(**_: Any) -> Any:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept, "TemporaryFile", full)
    opened = film()
    for _ in range(2):
        np.testing.assert_array_equal([*opened.frames()], expected)


def test_a_film_in_another_process_is_decoded_there(
    film: Opened, expected: list[Any]
) -> None:
    copy = pickle.loads(pickle.dumps(film()))
    np.testing.assert_array_equal([*copy.frames()], expected)


def test_frames_that_are_not_wanted_are_not_kept() -> None:
    frames = KeptFrames(SMALL, range(2, 4))
    image = np.full((30, 40, 3), 7, dtype=np.uint8)
    for number in range(6):
        frames.add(number, image)
    assert [number for number in range(6) if number in frames] == [2, 3]
    assert not frames.takes(3)
    np.testing.assert_array_equal(frames[3], image)


def test_what_a_thread_makes_ahead_comes_in_order_and_with_its_error() -> None:
    def numbers() -> Any:
        yield from range(5)
        raise ValueError("no more")

    items = ahead(numbers())
    assert [next(items) for _ in range(5)] == [*range(5)]
    with pytest.raises(ValueError, match="no more"):
        next(items)
    assert [*ahead(iter([]))] == []
