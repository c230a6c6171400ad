"""The video, the summary and the page of a track, made in one pass through its footage.

If a picture cannot be made, a warning is given, and the poses are written all the same.
"""

import errno
import logging
from collections.abc import Callable, Iterator, Mapping
from itertools import repeat
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from posefit.files import opencv_name
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.footage.video import ahead
from posefit.footage.writing import VideoWriter
from posefit.output.content import Content
from posefit.output.page import track_document
from posefit.output.page.data import track_data
from posefit.output.page.stills import Stills
from posefit.output.picture import Painter
from posefit.output.text import undetermined
from posefit.reading import cut
from posefit.silhouette.foreground import Image

VIDEO = "overlay.mp4"
LOGGER = logging.getLogger("posefit")
_Made = TypeVar("_Made")


class _Attempt:
    """Makes a file that the poses do not depend on, step by step.

    After a step that failed, the others are skipped.
    """

    def __init__(self, path: Path | None) -> None:
        self.path = path  # the file's path; None if it is not wanted
        self.failure = ""  # the message of the step that failed

    def run(self, step: Callable[..., _Made], *arguments: Any) -> _Made | None:
        """Return the result of a step, or None if one failed or nothing is wanted."""
        if self.failure or self.path is None:
            return None
        try:
            return step(*arguments)
        except Exception as error:
            cause = error.strerror if isinstance(error, OSError) else str(error)
            words = cut(" ".join((cause or "").split()))
            self.failure = words or type(error).__name__
            # the warning has one line; `--debug` shows where a fault of posefit is
            LOGGER.debug("%s", self.path, exc_info=True)
            return None

    def finish(self) -> str:
        """Return why the file is missing, or "". Removes a half-written file."""
        if not self.failure or self.path is None:
            return ""
        self.path.unlink(missing_ok=True)
        return f"{self.path.name} is missing: {self.failure}"


def video_warning(folder: Path, scene: Scene) -> str:
    """Return why there will be no video of a scene's track, or "" if there will.

    One frame is written to the folder as a trial.
    """
    path = folder / VIDEO
    width, height = Painter(scene).size
    attempt = _Attempt(path)
    try:
        writer = attempt.run(VideoWriter, path, scene.fps, (width, height))
        attempt.run(_write_frame, writer, np.zeros((height, width, 3), np.uint8))
        attempt.run(VideoWriter.close, writer)
    finally:
        path.unlink(missing_ok=True)
    return attempt.finish()


def write_pictures(paths: Mapping[str, Path], content: Content) -> list[str]:
    """Write the video, the summary and the page in one pass through the footage.

    Args:
        paths: The path of each requested file, by `mp4`, `png` and `html`.
        content: The data of the track.

    Returns:
        A warning for each of them that is missing.
    """
    if not paths:
        return []
    scene = content.scene
    table = content.table
    stills = Stills(scene)
    painter = Painter(scene, table["usable"] == 1.0)
    video = _Attempt(paths.get("mp4"))
    summary = _Attempt(paths.get("png"))
    page = _Attempt(paths.get("html"))
    # what the video and the summary share
    painting = _Attempt(paths.get("mp4") or paths.get("png"))
    warnings = list[str]()
    writer = video.run(VideoWriter, video.path, scene.fps, painter.size)
    radii = content.intervals.get("joint_radii", repeat(None))

    def painted() -> Iterator[tuple[Frame, Observation, Image | None, Image | None]]:
        """Yield what `_shown` does, with the picture of the body."""
        pairs = zip(_shown(content, warnings), radii, strict=False)
        for k, ((frame, observation, picture), spread) in enumerate(pairs):
            row = {name: float(values[k]) for name, values in table.items()}
            image = painting.run(painter.add, frame, observation, row, picture, spread)
            yield frame, observation, picture, image

    # a second core paints the next frames while this one is encoded
    for frame, observation, picture, image in ahead(painted()):
        page.run(stills.add, frame, observation, picture)
        video.run(_write_frame, writer, image)
    video.run(VideoWriter.close, writer)
    summary.failure = painting.failure
    trust = ""
    if content.trust is not None:
        trust = content.trust.sentence
    notes = (trust, undetermined(content))
    image = summary.run(painter.summary, table, [*filter(None, notes)])
    summary.run(_write_png, summary.path, image)
    document = page.run(lambda: track_document(track_data(content, stills)))
    page.run(_write_page, page.path, document)
    for attempt in (video, summary, page):
        if warning := attempt.finish():
            warnings.append(warning)
    return warnings


def _write_frame(writer: VideoWriter, image: Image | None) -> None:
    if image is None:
        raise ValueError("a frame could not be painted")
    writer.write(image)


def _write_png(path: Path, image: Image) -> None:
    if not cv2.imwrite(opencv_name(path), image):
        raise OSError(errno.ENOSPC, f"no room for {path.name}")


def _write_page(path: Path, document: str) -> None:
    path.write_text(document, encoding="utf-8", newline="\n")


def page_of(content: Content) -> str:
    """Return the page of a track, `track.html`."""
    stills = Stills(content.scene)
    for frame, observation, picture in _shown(content, []):
        stills.add(frame, observation, picture)
    return track_document(track_data(content, stills))


def _shown(
    content: Content, warnings: list[str]
) -> Iterator[tuple[Frame, Observation, Image | None]]:
    """Yield each frame with its masks and its picture.

    The picture is None without footage, and from the frame at which reading fails; a
    warning is then added to `warnings`.
    """
    pictures = _pictures(content.scene, warnings)
    yield from zip(content.frames, content.scene.observations, pictures, strict=False)


def _pictures(scene: Scene, warnings: list[str]) -> Iterator[Image | None]:
    """Yield the footage's pictures, and then None without end; see `_shown`."""
    if scene.pictures is not None:
        try:
            yield from scene.pictures()
        except Exception as error:  # for example because the file was moved meanwhile
            words = cut(" ".join(str(error).split()))
            warnings.append(f"the footage could not be read again: {words}")
    yield from repeat(None)
