"""Masks from a video of one person before a still background: `posefit extract`."""

import csv
import os
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from posefit.files import new_folder
from posefit.footage.masks import KINDS, PackedMasks, Range, packed
from posefit.footage.segmentation import Extraction, Segmentation
from posefit.footage.video import Video, VideoWriter
from posefit.silhouette.foreground import Image, Person

FILES = ("masks.npz", "preview.mp4", "quality.csv")
Progress = Callable[[Iterator[Any], int], Iterator[Any]]


def extract(
    source: str | Path,
    out: str | Path,
    how: Extraction = Extraction(),  # noqa: B008, it is frozen
    *,
    frames: Range = (None, None),
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return what was found in a video, and write its masks, a preview and a report to a new folder.

    masks.npz holds `masks` and `valid` (T, height, width), `usable` (T,) and `fps`. The folder appears whole or not at
    all. Raises ValueError for every mistake in the arguments or files, where nobody is seen, and on a full disk.
    """
    target = Path(out)
    if os.path.lexists(target):
        raise ValueError(f"{target}: expected a new folder, got one that exists")
    video = Video.of(source)
    found = Segmentation(video, how, frames)
    with suppress(OSError):  # told where the folder is made
        target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        with VideoWriter(building / "preview.mp4", video.fps, found.size) as preview:
            masks = store(building, found, progress, lambda *seen: preview.write(_painted(*seen)))
        _write_npz(building, masks, video.fps, found.size)
        with (building / "quality.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(found.rows[0]))
            writer.writeheader()
            writer.writerows(found.rows)
    return {"video": str(source), "method": how.method, **found.summary}


def store(
    folder: Path,
    found: Segmentation,
    progress: Progress | None = None,
    look: Callable[[Image, Person, bool], None] | None = None,
) -> PackedMasks:
    """Return the masks of a video, written to a folder while it goes by.

    `look` gets each frame, the person in it, and whether it is usable.
    """
    files = [(folder / f"{kind}.bits").open("wb") for kind in KINDS]
    try:
        frames = iter(found)
        for image, person in progress(frames, len(found)) if progress else frames:
            for file, plane in zip(files, (person.mask, person.valid), strict=True):
                file.write(packed(plane))
            if look is not None:
                look(image, person, bool(found.rows[-1]["usable"]))
    finally:
        for file in files:
            file.close()
    usable = np.array([row["usable"] for row in found.rows], dtype=bool)
    return PackedMasks(folder, found.size, usable, str(found.name), found.start)


def _write_npz(folder: Path, masks: PackedMasks, fps: float, size: tuple[int, int]) -> None:
    """Write masks.npz frame by frame, as there may be more than memory holds, and remove the files of bits."""
    count = len(masks)
    header = {"descr": "|u1", "fortran_order": False, "shape": (count, size[1], size[0])}
    with zipfile.ZipFile(folder / "masks.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for kind, name in zip(KINDS, ("mask", "valid"), strict=True):
            with archive.open(f"{kind}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                for k in range(count):
                    member.write(getattr(masks.silhouette(k), name).astype(np.uint8).tobytes())
        usable = np.array([masks.is_usable(k) for k in range(count)])
        for name, value in (("usable", usable), ("fps", np.array(fps))):
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, value)
    for kind in KINDS:
        (folder / f"{kind}.bits").unlink()


def _painted(image: Image, found: Person, usable: bool) -> Image:
    colour = np.array((90, 200, 90) if usable else (60, 60, 230), dtype=np.float32)
    painted = image.copy()
    painted[~found.valid] //= 2
    painted[found.mask] = (0.5 * painted[found.mask] + 0.5 * colour).astype(np.uint8)
    return painted
