"""The files of a track: a format is a line of `write_files`, beside the pictures, which are made frame by frame."""

import csv
import errno
import json
from collections.abc import Callable, Iterator
from itertools import repeat
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from posefit.evaluation.errors import FRAME
from posefit.files import opencv_name
from posefit.footage.scene import Scene
from posefit.footage.video import VideoWriter
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.c3d import write_c3d
from posefit.measuring.centres import PLACES
from posefit.measuring.tables import write_angles, write_gait, write_trc
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.bvh import write_bvh
from posefit.motion.gltf import write_glb
from posefit.motion.opensim import write_mot, write_osim
from posefit.output.content import Content
from posefit.output.page import track_document
from posefit.output.page.content import track_data
from posefit.output.page.stills import Stills
from posefit.output.picture import Painter
from posefit.output.text import undetermined
from posefit.reading import cut
from posefit.silhouette.foreground import Image

_Made = TypeVar("_Made")


def _write_npz(path: Path, content: Content) -> None:
    np.savez_compressed(
        path,
        poses=content.motion.poses,
        translations=content.motion.translations,
        fps=np.array(content.motion.fps),
        frames=content.motion.first + np.arange(len(content.motion)),
        joints=np.array(JOINTS),
        places=np.array(PLACES),
        costs=content.table["cost"],
        radii=content.scene.body.radii,
        **dict[str, Any](content.intervals),
    )


def _write_table(path: Path, content: Content) -> None:
    columns = content.columns
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            cells = zip(columns, row, strict=True)
            writer.writerow([_cell(name, value) for name, value in cells])


def _cell(name: str, value: Any) -> Any:
    """Return what a table has for a value: micrometres of places, nothing of what is unknown."""
    if isinstance(value, str | None):
        return value
    if np.isnan(value):
        return ""
    return value.item() if name in FRAME else f"{value:.6f}"


VIDEO = "overlay.mp4"
FILES = (
    "poses.npz", "skeleton.asf", "track.amc", "track.bvh", "track.glb", "track.trc", "track.c3d", "track.mot",
    "model.osim", "frames.csv", "angles.csv", "gait.csv", "camera.json", "summary.json",
    VIDEO, "summary.png", "track.html",
)  # fmt: skip


class _Attempt:
    """Makes a file that the poses do not depend on, step by step; after a step that fails it does nothing.

    A failure of the disk is raised, as it concerns every file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.warning = ""

    def run(self, step: Callable[..., _Made], *arguments: Any) -> _Made | None:
        """Return what a step returns, or None if it or an earlier one failed."""
        if self.warning:
            return None
        try:
            return step(*arguments)
        except OSError:
            raise
        except Exception as error:
            words = cut(" ".join(str(error).split())) or type(error).__name__
            self.warning = f"{self._path.name} is missing: {words}"
            return None

    def finish(self) -> str:
        """Return why the file is missing, empty where it is not; nothing half-written is left."""
        if self.warning:
            self._path.unlink(missing_ok=True)
        return self.warning


def video_warning(folder: Path, scene: Scene) -> str:
    """Return why there will be no video of a scene's track, as far as writing one frame to the folder shows."""
    path = folder / VIDEO
    width, height = Painter(scene).size
    attempt = _Attempt(path)
    try:
        writer = attempt.run(VideoWriter, path, scene.fps, (width, height))
        attempt.run(_write_frame, writer, np.zeros((height, width, 3), np.uint8))
        attempt.run(VideoWriter.close, writer)
    finally:
        path.unlink(missing_ok=True)
    return attempt.warning


def write_files(folder: Path, content: Content) -> list[str]:
    """Write all `FILES` of a track to a folder, and return a warning for each picture that could not be made."""
    scene = content.scene
    motion = content.motion
    blank = content.blank
    _write_npz(folder / "poses.npz", content)
    write_asf(folder / "skeleton.asf", motion.skeleton)
    write_amc(folder / "track.amc", motion)
    write_bvh(folder / "track.bvh", motion)
    write_glb(folder / "track.glb", motion, scene.body.radii)
    write_trc(folder / "track.trc", motion, blank)
    write_c3d(folder / "track.c3d", motion, blank, content.gait)
    write_mot(folder / "track.mot", motion)
    write_osim(folder / "model.osim", scene.body, PLACES)
    _write_table(folder / "frames.csv", content)
    write_angles(folder / "angles.csv", motion, blank)
    write_gait(folder / "gait.csv", content.gait)
    (folder / "camera.json").write_text(scene.cameras[0].to_json(), encoding="utf-8")
    (folder / "summary.json").write_text(
        json.dumps(content.summary, indent=1) + "\n", encoding="utf-8"
    )
    return _write_pictures(folder, content)


def _write_pictures(folder: Path, content: Content) -> list[str]:
    """Write the video, the summary and the page in one pass through the footage; return a warning for each missing."""
    scene = content.scene
    table = content.table
    stills = Stills(scene)
    painter = Painter(scene, table["usable"] == 1.0)
    video = _Attempt(folder / VIDEO)
    summary = _Attempt(folder / "summary.png")
    page = _Attempt(folder / "track.html")
    warnings: list[str] = []
    writer = video.run(VideoWriter, folder / VIDEO, scene.fps, painter.size)
    radii = content.intervals.get("joint_radii", repeat(None))
    filmed = zip(
        content.frames,
        scene.observations,
        _filmed(scene, warnings),
        radii,
        strict=False,
    )
    for k, (frame, observation, picture, spread) in enumerate(filmed):
        row = {name: float(values[k]) for name, values in table.items()}
        page.run(stills.add, frame, observation, picture)
        image = summary.run(painter.add, frame, observation, row, picture, spread)
        video.run(_write_frame, writer, image)
    video.run(VideoWriter.close, writer)
    notes = (
        "" if content.trust is None else content.trust.sentence,
        undetermined(content),
    )
    image = summary.run(painter.summary, table, [*filter(None, notes)])
    if image is not None:
        summary.run(_write_png, folder / "summary.png", image)
    document = page.run(lambda: track_document(track_data(content, stills)))
    if document is not None:
        path = folder / "track.html"
        path.write_text(document, encoding="utf-8", newline="\n")
    missing = [attempt.finish() for attempt in (video, summary, page)]
    return [*warnings, *filter(None, missing)]


def _write_frame(writer: VideoWriter, image: Image | None) -> None:
    if image is None:
        raise ValueError("a frame could not be painted")
    writer.write(image)


def _write_png(path: Path, image: Image) -> None:
    if not cv2.imwrite(opencv_name(path), image):
        raise OSError(errno.ENOSPC, f"no room for {path.name}")


def page_of(content: Content) -> str:
    """Return the page of a track, `track.html`."""
    stills = Stills(content.scene)
    scene = content.scene
    filmed = zip(content.frames, scene.observations, _filmed(scene, []), strict=False)
    for frame, observation, picture in filmed:
        stills.add(frame, observation, picture)
    return track_document(track_data(content, stills))


def _filmed(scene: Scene, warnings: list[str]) -> Iterator[Image | None]:
    """Yield the picture of each frame, then None for ever: there is no footage, or it cannot be read to its end."""
    if scene.pictures is not None:
        try:
            yield from scene.pictures()
        except Exception as error:  # a file may have been moved meanwhile
            words = cut(" ".join(str(error).split()))
            warnings.append(f"the footage could not be read again: {words}")
    yield from repeat(None)
