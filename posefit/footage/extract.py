"""Write the masks of one person, a preview and a report: `posefit extract`."""

import csv
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.files import check_new, new_folder, opencv_name
from posefit.footage.cleaning import cleaned
from posefit.footage.extraction import Extraction
from posefit.footage.kinds import Resolved, resolve
from posefit.footage.options import SourceOptions
from posefit.footage.scanner import Progress
from posefit.footage.scene import observed_views
from posefit.footage.segmentation import Segmentation
from posefit.footage.source import films_of, scene_of, views_of_masks
from posefit.footage.uses import useless_for
from posefit.footage.views import Range, View, border_of, range_warning
from posefit.footage.writing import VideoWriter
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette

BLANK_LEVEL = 128  # level of the preview's pictures if there is no film
# colours of the person in the preview (blue, green, red): green, and red in frames that
# are not usable
USABLE_COLOUR = (90, 200, 90)
UNUSABLE_COLOUR = (60, 60, 230)


def extract(
    source: Any,
    out: str | Path,
    how: Extraction | None = None,
    *,
    frames: Range = (None, None),
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write the masks of one person to a new folder, with a preview and a report.

    masks.npz has `masks` and `valid` (T, height, width), `usable` (T,), `first`, the
    number of the first frame, `fps` if it is known, and `landmarks` (T, 27, 3) if the
    segmenter reports any, see `Segmenter`. quality.csv compares the masks of a film
    with its pictures. Several cameras are written to the folders 1, 2 and so on.

    The folder appears complete or not at all.

    Args:
        source: As for `posefit.track`.
        out: The folder, which must not exist.
        how: How to segment the person in a film.
        frames: First frame, and the frame after the last.
        progress: Shows the progress of each film.

    Returns:
        The summary; for several cameras, a list of summaries as `cameras`.

    Raises:
        InputError: An argument or a file is wrong, no frame shows a person, or the disk
            is full.
    """
    target = Path(out)
    check_new(target)
    # a name that OpenCV cannot write is refused before the work
    opencv_name(target)
    resolved = resolve(source)
    how = how or Extraction()
    # checked before the folder is made
    films = films_of(resolved, how.width)
    parts = [Segmentation(film, how, frames) for film in films]
    if not parts and how != Extraction(person=how.person):
        raise useless_for(resolved.medium, "extraction", how, "video")
    with suppress(OSError):  # reported where the folder is made
        target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        count = len(resolved.named)
        folders = [building]
        if count > 1:
            folders = [building / str(number) for number in range(1, count + 1)]
        summaries = []
        if parts:
            for folder, part in zip(folders, parts, strict=True):
                view, rows, _ = part.read(progress)
                view = _warned(view, frames)
                summaries.append(_written(folder, view, rows, how.name))
        else:
            views = _masks(resolved, how, frames)
            for folder, view in zip(folders, views, strict=True):
                summaries.append(_written(folder, _warned(view, frames)))
    return summaries[0] if len(summaries) == 1 else {"cameras": summaries}


def _warned(view: View, frames: Range) -> View:
    """Return a view that warns of chosen frames that the source does not have."""
    warning = range_warning(frames, int(view.numbers[0]), len(view))
    # the scene of a motion warns, too
    if not warning or warning in view.warnings:
        return view
    return replace(view, warnings=[*view.warnings, warning])


def _written(
    folder: Path,
    view: View,
    rows: Sequence[dict[str, Any]] = (),
    method: str | None = None,
) -> dict[str, Any]:
    """Write the files of a view to a folder, and return its summary.

    `rows` become quality.csv, and `method` is the segmenter's name.
    """
    folder.mkdir(exist_ok=True)
    warnings = [*view.warnings]
    preview = folder / "preview.mp4"
    try:
        with VideoWriter(preview, view.fps or FPS, view.size) as writer:
            for k, image in enumerate(_pictures(view)):
                silhouette = view.silhouette(k)
                writer.write(_painted(image, silhouette, bool(view.usable[k])))
    except (InputError, cv2.error) as error:
        # some builds of OpenCV cannot write video, and the masks matter more
        preview.unlink(missing_ok=True)
        warnings.append(f"preview.mp4 is missing: {error}")
    _write_npz(folder / "masks.npz", view)
    if rows:
        path = folder / "quality.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    border = border_of(view.bits, view.size).any(axis=1)
    return {
        "video": view.name,
        "method": method,
        "frames": len(view),
        "usable": int(view.usable.sum()),
        "size": list(view.size),
        "fps": view.fps,
        "touching_border": int(border.sum()),
        # masks that were not segmented here have no rows
        "in_pieces": sum(row["pieces"] > 1 for row in rows) if rows else None,
        "warnings": warnings,
        "guesses": [*view.guesses],
    }


def _masks(source: Resolved, how: Extraction, frames: Range) -> list[View]:
    """Return the views of a source that needs no extraction."""
    if source.medium == "motion":
        return observed_views(scene_of(source, SourceOptions(frames=frames)))
    views = views_of_masks(source, frames)
    return [cleaned(view, choice=how.person) for view in views]


def _pictures(view: View) -> Iterator[Image]:
    """Yield the pictures of a view, or grey ones if it has masks only."""
    if view.pictures is not None:
        return view.pictures()
    width, height = view.size
    return repeat(np.full((height, width, 3), BLANK_LEVEL, dtype=np.uint8), len(view))


def _write_npz(path: Path, view: View) -> None:
    """Write masks.npz frame by frame, because all masks may not fit in memory."""
    header = {
        "descr": "|u1",
        "fortran_order": False,
        "shape": (len(view), view.size[1], view.size[0]),
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for kind, attribute in (("masks", "mask"), ("valid", "valid")):
            with archive.open(f"{kind}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                for k in range(len(view)):
                    plane = getattr(view.silhouette(k), attribute)
                    member.write(plane.astype(np.uint8).tobytes())
        rest = {
            "usable": view.usable,
            "fps": None if view.fps is None else np.array(view.fps),
            "first": view.numbers[0],
            "landmarks": view.landmarks,
        }
        for name, value in rest.items():
            if value is None:
                continue
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, value)


def _painted(image: Image, person: Silhouette, usable: bool) -> Image:
    """Return a picture with the person tinted, and unknown pixels darkened."""
    colour = np.array(USABLE_COLOUR if usable else UNUSABLE_COLOUR, dtype=np.float32)
    painted = image.copy()
    painted[~person.valid] //= 2
    painted[person.mask] = (0.5 * painted[person.mask] + 0.5 * colour).astype(np.uint8)
    return painted
