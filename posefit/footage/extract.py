"""Masks of one person as a file, with a preview and a report: `posefit extract`."""

import csv
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import repeat
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.files import check_new, new_folder, opencv_name
from posefit.footage.cleaning import cleaned
from posefit.footage.scene import observed_views
from posefit.footage.segmentation import Extraction, Progress, Segmentation
from posefit.footage.source import (
    Resolved,
    films_of,
    resolve,
    scene_of,
    useless_for,
    views_of_masks,
)
from posefit.footage.video import VideoWriter
from posefit.footage.views import Range, View, border_of
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette


def extract(
    source: Any,
    out: str | Path,
    how: Extraction | None = None,
    *,
    frames: Range = (None, None),
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return a summary of masks of one person, and write them, a preview and a report to a new folder.

    `source` is what `posefit.track` takes. masks.npz holds `masks` and `valid` (T, height, width), `usable` (T,), `fps`
    where it is known, the number of the `first` frame, and `landmarks` (T, 27, 3) where a segmenter gives any, see
    `Segmenter`. The report, quality.csv, compares masks with the pictures of a film. Of several cameras each has its
    number as a folder, 1 and so on, and its summary in the list `cameras`. The folder appears whole or not at all.
    Raises InputError for mistakes in arguments or files, where no frame shows a person, and on a full disk.
    """
    target = Path(out)
    check_new(target)
    opencv_name(target)  # a name that it cannot write is refused before the work
    resolved = resolve(source)
    how = how or Extraction()
    # checked before the folder is made
    parts = [Segmentation(film, how, frames) for film in films_of(resolved)]
    if not parts and how != Extraction(person=how.person):
        raise useless_for(resolved.medium, "extraction", how, "video")
    with suppress(OSError):  # reported where the folder is made
        target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        if len(resolved.named) == 1:
            folders = [building]
        else:
            folders = [building / f"{k}" for k in range(1, len(resolved.named) + 1)]
        summaries = []
        if parts:
            for folder, part in zip(folders, parts, strict=True):
                view, rows, _ = part.read(progress)
                summaries.append(_written(folder, view, rows, how.name))
        else:
            views = _masks(resolved, how, frames)
            for folder, view in zip(folders, views, strict=True):
                summaries.append(_written(folder, view))
    return summaries[0] if len(summaries) == 1 else {"cameras": summaries}


def _written(
    folder: Path,
    view: View,
    rows: Sequence[dict[str, Any]] = (),
    method: str | None = None,
) -> dict[str, Any]:
    """Return the summary of a view, and write its files to a folder."""
    folder.mkdir(exist_ok=True)
    warnings = [*view.warnings]
    preview = folder / "preview.mp4"
    try:
        with VideoWriter(preview, view.fps or FPS, view.size) as writer:
            for k, image in enumerate(_pictures(view)):
                silhouette = view.silhouette(k)
                writer.write(_painted(image, silhouette, bool(view.usable[k])))
    except (InputError, cv2.error) as error:
        # such as of a build of OpenCV without the format: the masks are the work
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
        # which a film's quality.csv says
        "in_pieces": sum(row["pieces"] > 1 for row in rows) if rows else None,
        "warnings": warnings,
        "guesses": [*view.guesses],
    }


def _masks(source: Resolved, how: Extraction, frames: Range) -> list[View]:
    """Return the views of a source that needs no extraction."""
    if source.medium == "motion":
        return observed_views(scene_of(source, frames=frames))
    views = views_of_masks(source, frames)
    return [cleaned(view, choice=how.person) for view in views]


def _pictures(view: View) -> Iterator[Image]:
    """Yield the pictures of a film, or grey ones."""
    if view.pictures is not None:
        return view.pictures()
    width, height = view.size
    return repeat(np.full((height, width, 3), 128, dtype=np.uint8), len(view))


def _write_npz(path: Path, view: View) -> None:
    """Write masks.npz frame by frame, as there may be more than memory holds unpacked."""
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
                    member.write(
                        getattr(view.silhouette(k), attribute)
                        .astype(np.uint8)
                        .tobytes()
                    )
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
    colour = np.array((90, 200, 90) if usable else (60, 60, 230), dtype=np.float32)
    painted = image.copy()
    painted[~person.valid] //= 2
    painted[person.mask] = (0.5 * painted[person.mask] + 0.5 * colour).astype(np.uint8)
    return painted
