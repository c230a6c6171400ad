"""The files of a track. Each format is one line of `WRITERS`.

Pictures are made last, see `pictures`.
"""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from posefit.errors import InputError
from posefit.evaluation.errors import FRAME
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
from posefit.output.pictures import VIDEO, write_pictures
from posefit.reading import quoted, suggestion


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


def _write_frames(path: Path, content: Content) -> None:
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


Write = Callable[[Path, Content], None]


class Format(NamedTuple):
    """A file of a track, and how it is written."""

    file: str  # its name
    write: Write | None = None  # None for pictures, which are made frame by frame


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _write_summary(path: Path, content: Content) -> None:
    _write_text(path, json.dumps(content.summary, indent=1) + "\n")


# by the name by which a user chooses the file
WRITERS: Mapping[str, Format] = {
    "npz": Format("poses.npz", _write_npz),
    "asf": Format(
        "skeleton.asf", lambda path, track: write_asf(path, track.motion.skeleton)
    ),
    "amc": Format("track.amc", lambda path, track: write_amc(path, track.motion)),
    "bvh": Format("track.bvh", lambda path, track: write_bvh(path, track.motion)),
    "glb": Format(
        "track.glb",
        lambda path, track: write_glb(path, track.motion, track.scene.body.radii),
    ),
    "trc": Format(
        "track.trc", lambda path, track: write_trc(path, track.motion, track.unseen)
    ),
    "c3d": Format(
        "track.c3d",
        lambda path, track: write_c3d(path, track.motion, track.unseen, track.gait),
    ),
    "mot": Format("track.mot", lambda path, track: write_mot(path, track.motion)),
    "osim": Format(
        "model.osim", lambda path, track: write_osim(path, track.scene.body, PLACES)
    ),
    "frames": Format("frames.csv", _write_frames),
    "angles": Format(
        "angles.csv", lambda path, track: write_angles(path, track.motion, track.unseen)
    ),
    "gait": Format("gait.csv", lambda path, track: write_gait(path, track.gait)),
    "camera": Format(
        "camera.json",
        lambda path, track: _write_text(path, track.scene.cameras[0].to_json()),
    ),
    "summary": Format("summary.json", _write_summary),
    "mp4": Format(VIDEO),
    "png": Format("summary.png"),
    "html": Format("track.html"),
}
FILES = tuple(each.file for each in WRITERS.values())
# written in any case: it marks the folder as a track's, which `force` may replace
ALWAYS = "summary"


def chosen_kinds(write: str | Sequence[str] = ()) -> tuple[str, ...]:
    """Return the kinds of files that a track writes, in the order of `WRITERS`.

    Args:
        write: Kinds such as `bvh`, or names of files such as `track.bvh`. A string may
            have several, separated by commas. If empty, all kinds are chosen.

    Returns:
        The kinds, always with `summary`, and with `asf` if there is `amc`.

    Raises:
        InputError: A kind is unknown.
    """
    parts = [write] if isinstance(write, str) else list(write)
    if not all(isinstance(part, str) for part in parts):
        raise InputError(f"write must be names of files, got {quoted(write)}")
    named = {each.file: kind for kind, each in WRITERS.items()}
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
    kinds.add(ALWAYS)
    # no program can read an .amc file without the skeleton
    if "amc" in kinds:
        kinds.add("asf")
    return tuple(kind for kind in WRITERS if kind in kinds)


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
        if (write := WRITERS[kind].write) is not None:
            write(folder / WRITERS[kind].file, content)
    pictures = {}
    for kind in kinds:
        if WRITERS[kind].write is None:
            pictures[kind] = folder / WRITERS[kind].file
    return write_pictures(pictures, content)
