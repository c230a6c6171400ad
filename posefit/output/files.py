"""The files of a track. Each format is one line of `WRITERS`.

Pictures are made last, frame by frame.
"""

import csv
import errno
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.evaluation.errors import FRAME
from posefit.files import opencv_name
from posefit.footage.scene import Scene
from posefit.footage.writing import VideoWriter
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
from posefit.reading import cut, quoted, suggestion
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
    """Return a value as a table cell: places to a micrometre, unknown values empty."""
    if isinstance(value, str | None):
        return value
    if np.isnan(value):
        return ""
    return value.item() if name in FRAME else f"{value:.6f}"


VIDEO = "overlay.mp4"
Write = Callable[[Path, Content], None]
# For each kind of file, the name by which a user chooses it: the file's name and its
# writer. Pictures have no writer, because they are made frame by frame.
WRITERS: Mapping[str, tuple[str, Write | None]] = {
    "npz": ("poses.npz", _write_npz),
    "asf": ("skeleton.asf", lambda path, track: write_asf(path, track.motion.skeleton)),
    "amc": ("track.amc", lambda path, track: write_amc(path, track.motion)),
    "bvh": ("track.bvh", lambda path, track: write_bvh(path, track.motion)),
    "glb": (
        "track.glb",
        lambda path, track: write_glb(path, track.motion, track.scene.body.radii),
    ),
    "trc": (
        "track.trc",
        lambda path, track: write_trc(path, track.motion, track.blank),
    ),
    "c3d": (
        "track.c3d",
        lambda path, track: write_c3d(path, track.motion, track.blank, track.gait),
    ),
    "mot": ("track.mot", lambda path, track: write_mot(path, track.motion)),
    "osim": (
        "model.osim",
        lambda path, track: write_osim(path, track.scene.body, PLACES),
    ),
    "frames": ("frames.csv", _write_table),
    "angles": (
        "angles.csv",
        lambda path, track: write_angles(path, track.motion, track.blank),
    ),
    "gait": ("gait.csv", lambda path, track: write_gait(path, track.gait)),
    "camera": (
        "camera.json",
        lambda path, track: _write_text(path, track.scene.cameras[0].to_json()),
    ),
    "summary": (
        "summary.json",
        lambda path, track: _write_text(
            path, json.dumps(track.summary, indent=1) + "\n"
        ),
    ),
    "mp4": (VIDEO, None),
    "png": ("summary.png", None),
    "html": ("track.html", None),
}
FILES = tuple(name for name, _ in WRITERS.values())
# written in any case: it marks the folder as a track's, which `force` may replace
ALWAYS = "summary"


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def chosen_kinds(write: str | Sequence[str] = ()) -> tuple[str, ...]:
    """Return the kinds of files that a track writes, in the order of `WRITERS`.

    Args:
        write: Kinds such as `bvh`, or names of files such as `track.bvh`. A string may
            have several, separated by commas. If empty, all kinds are chosen.

    Returns:
        The kinds, always with `summary`.

    Raises:
        InputError: A kind is unknown.

    """
    parts = [write] if isinstance(write, str) else list(write)
    if not all(isinstance(part, str) for part in parts):
        raise InputError(f"write must be names of files, got {quoted(write)}")
    named = {file: kind for kind, (file, _) in WRITERS.items()}
    words = [word.strip() for word in ",".join(parts).split(",")]
    kinds = {named.get(word, word) for word in words if word}
    if any(parts) and not kinds:
        raise InputError(f"write must name a file such as bvh, got {quoted(write)}")
    for kind in kinds:
        if kind not in WRITERS:
            hint = suggestion(kind, [*WRITERS, *named])
            raise InputError(
                f"write must be some of {', '.join(WRITERS)}, got {quoted(kind)}{hint}"
            )
    if not kinds:
        return tuple(WRITERS)
    return tuple(kind for kind in WRITERS if kind in kinds | {ALWAYS})


class _Attempt:
    """Makes a file that the poses do not depend on, step by step.

    After a step that failed, the others are skipped.
    """

    def __init__(self, *, wanted: bool = True) -> None:
        self._wanted = wanted
        self.failure = ""  # the message of the step that failed

    def run(self, step: Callable[..., _Made], *arguments: Any) -> _Made | None:
        """Return the result of a step, or None if one failed or nothing is wanted."""
        if self.failure or not self._wanted:
            return None
        try:
            return step(*arguments)
        except Exception as error:
            cause = error.strerror if isinstance(error, OSError) else str(error)
            words = cut(" ".join((cause or "").split()))
            self.failure = words or type(error).__name__
            return None

    def finish(self, path: Path) -> str:
        """Return why a file is missing, or "". Removes a half-written file."""
        if not self.failure:
            return ""
        path.unlink(missing_ok=True)
        return f"{path.name} is missing: {self.failure}"


def video_warning(folder: Path, scene: Scene) -> str:
    """Return why there will be no video of a scene's track, or "" if there will.

    One frame is written to the folder as a trial.
    """
    path = folder / VIDEO
    width, height = Painter(scene).size
    attempt = _Attempt()
    try:
        writer = attempt.run(VideoWriter, path, scene.fps, (width, height))
        attempt.run(_write_frame, writer, np.zeros((height, width, 3), np.uint8))
        attempt.run(VideoWriter.close, writer)
    finally:
        path.unlink(missing_ok=True)
    return attempt.finish(path)


def write_files(
    folder: Path, content: Content, kinds: Sequence[str] = tuple(WRITERS)
) -> list[str]:
    """Write files of a track to a folder, the pictures last.

    Args:
        folder: An existing folder.
        content: The data of the track.
        kinds: The kinds of files, as `chosen_kinds` returns them.

    Returns:
        A warning for each picture that could not be made.

    """
    for kind in kinds:
        name, write = WRITERS[kind]
        if write is not None:
            write(folder / name, content)
    pictures = [kind for kind in kinds if WRITERS[kind][1] is None]
    if not pictures:
        return []
    return _write_pictures(folder, content, pictures)


def _write_pictures(folder: Path, content: Content, kinds: Sequence[str]) -> list[str]:
    """Write the video, the summary and the page in one pass through the footage.

    Returns a warning for each of them that is missing.
    """
    scene = content.scene
    table = content.table
    stills = Stills(scene)
    painter = Painter(scene, table["usable"] == 1.0)
    video = _Attempt(wanted="mp4" in kinds)
    summary = _Attempt(wanted="png" in kinds)
    page = _Attempt(wanted="html" in kinds)
    painting = _Attempt(wanted="mp4" in kinds or "png" in kinds)
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
        image = painting.run(painter.add, frame, observation, row, picture, spread)
        video.run(_write_frame, writer, image)
    video.run(VideoWriter.close, writer)
    summary.failure = painting.failure
    trust = ""
    if content.trust is not None:
        trust = content.trust.sentence
    notes = (trust, undetermined(content))
    image = summary.run(painter.summary, table, [*filter(None, notes)])
    summary.run(_write_png, folder / "summary.png", image)
    document = page.run(lambda: track_document(track_data(content, stills)))
    page.run(_write_page, folder / "track.html", document)
    attempts = {"mp4": video, "png": summary, "html": page}
    for kind, attempt in attempts.items():
        if kind not in kinds:
            continue
        if warning := attempt.finish(folder / WRITERS[kind][0]):
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
    scene = content.scene
    filmed = zip(content.frames, scene.observations, _filmed(scene, []), strict=False)
    for frame, observation, picture in filmed:
        stills.add(frame, observation, picture)
    return track_document(track_data(content, stills))


def _filmed(scene: Scene, warnings: list[str]) -> Iterator[Image | None]:
    """Yield the picture of each frame, then None without end.

    None if there is no footage, or if it cannot be read to its end.
    """
    if scene.pictures is not None:
        try:
            yield from scene.pictures()
        except Exception as error:  # for example because the file was moved meanwhile
            words = cut(" ".join(str(error).split()))
            warnings.append(f"the footage could not be read again: {words}")
    yield from repeat(None)
