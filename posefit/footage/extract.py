"""Masks from a video of one person before a still background: `posefit extract`."""

import csv
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.files import check_new, new_folder, opencv_name
from posefit.footage.masks import PackedMasks, Range
from posefit.footage.readers import name_of
from posefit.footage.segmentation import Extraction, Progress, Segmentation
from posefit.footage.source import films_of, kind_of, sources_of
from posefit.footage.video import Video, VideoWriter
from posefit.motion.motion import Motion
from posefit.reading import existing
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette


def extract(
    source: str | Path | Sequence[str | Path],
    out: str | Path,
    how: Extraction | None = None,
    *,
    frames: Range = (None, None),
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return a summary of a film's masks, and write them, a preview and a report to a new folder.

    `source` is a video, or a folder or a list of pictures. masks.npz holds `masks` and `valid` (T, height, width),
    `usable` (T,), `fps`, the number of the `first` frame in the film, and `landmarks` (T, 27, 3) where a segmenter
    gives any, see `Segmenter`. The folder appears whole or not at all. Raises InputError for every mistake
    in arguments or files, where no frame shows a person, and on a full disk.
    """
    target = Path(out)
    check_new(target)
    opencv_name(target)  # a name that it cannot write is refused before the work
    video = _film(source)
    how = how or Extraction()
    segmentation = Segmentation(video, how, frames)
    with suppress(OSError):  # reported where the folder is made
        target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        masks, rows, _, warnings, *_ = segmentation.read(progress)
        preview = building / "preview.mp4"
        try:
            with VideoWriter(preview, video.fps, masks.size) as writer:
                for k, image in enumerate(
                    video.frames(segmentation.start, segmentation.stop, masks.size)
                ):
                    silhouette = masks.silhouette(k)
                    writer.write(_painted(image, silhouette, bool(masks.usable[k])))
        except (InputError, cv2.error) as error:
            # such as of a build of OpenCV without the format: the masks are the work
            preview.unlink(missing_ok=True)
            warnings = [*warnings, f"preview.mp4 is missing: {error}"]
        _write_npz(building / "masks.npz", masks)
        with (building / "quality.csv").open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    return {
        "video": str(source),
        "method": how.name,
        "frames": len(rows),
        "usable": int(masks.usable.sum()),
        "size": list(masks.size),
        "fps": video.fps,
        "touching_border": sum(bool(row["touches_border"]) for row in rows),
        "in_pieces": sum(row["pieces"] > 1 for row in rows),
        "warnings": warnings,
        "guesses": [*video.guesses],
    }


def _film(source: str | Path | Sequence[str | Path]) -> Video:
    """Return the film that a source names. Raises InputError where it is none, or several."""
    sources = sources_of(source)
    if len(sources) > 1:
        raise InputError(f"source must be one film, got {len(sources)}")
    (film,) = sources
    if isinstance(film, Motion) or kind_of(film) == "masks":
        if isinstance(film, str | Path):
            existing(Path(film))
        came = "a motion" if isinstance(film, Motion) else name_of(film)
        raise InputError(
            f"source must be a film to extract masks from, got {came}, which needs no extraction"
        )
    assert not isinstance(film, np.ndarray)
    (video,) = films_of([film], None)
    return video


def _write_npz(path: Path, masks: PackedMasks) -> None:
    """Write masks.npz frame by frame, as there may be more than memory holds unpacked."""
    header = {
        "descr": "|u1",
        "fortran_order": False,
        "shape": (len(masks), masks.size[1], masks.size[0]),
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for kind, attribute in (("masks", "mask"), ("valid", "valid")):
            with archive.open(f"{kind}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                for k in range(len(masks)):
                    member.write(
                        getattr(masks.silhouette(k), attribute)
                        .astype(np.uint8)
                        .tobytes()
                    )
        rest = {
            "usable": masks.usable,
            "fps": np.array(masks.fps),
            "first": np.array(masks.first),
            "landmarks": masks.landmarks,
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
