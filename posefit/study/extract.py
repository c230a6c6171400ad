"""Masks from a video of one person before a still background: `posefit extract`."""

import csv
import shutil
import tempfile
import zipfile
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, get_args

import cv2
import numpy as np

from posefit.silhouette.foreground import (
    SAMPLES,
    Background,
    Image,
    Mixture,
    Person,
    mean_background,
    median_background,
    person,
)
from posefit.silhouette.mask import Mask
from posefit.study.source import Range
from posefit.study.video import Video

Method = Literal["mixture", "mean", "median"]
WIDTH = 640  # pixels; larger videos are scaled down to it
LATEST = 15  # frames that a frame's area is compared with
CHANGE = 0.5  # a frame whose area is off by more than this share is not usable
FILES = ("masks.npz", "preview.mp4", "quality.csv")


def extract(
    source: str | Path,
    out: str | Path,
    *,
    method: Method = "mixture",
    background: str | None = None,
    roi: tuple[int, int, int, int] | None = None,
    ignore: str | Path | None = None,
    frames: Range = (None, None),
    width: int = WIDTH,
    progress: Callable[[Iterator[Any], int], Iterator[Any]] | None = None,
) -> dict[str, Any]:
    """Return what was found in a video, and write its masks, a preview and a report to a new folder.

    `method` is a "mixture" of Gaussians or the "median", both learned from the whole video, or the "mean" of
    `background`: frames without a person, as A:B, or an image. `roi` x, y, width, height in the video's own pixels is
    where the person is looked for; `ignore` is an image whose bright pixels are never known, such as a tree in front.
    masks.npz holds `masks` and `valid` (T, height, width), `usable` (T,) and `fps`. The folder appears whole or not at
    all. Raises ValueError for every mistake in the arguments or files, and where nobody is seen.
    """
    target = Path(out)
    if target.exists():
        raise ValueError(f"{target}: expected a new folder, got one that exists")
    if method not in get_args(Method):
        raise ValueError(f"method must be one of {', '.join(get_args(Method))}, got {method!r}")
    if not 36 <= width <= 8192:
        raise ValueError(f"width must lie in 36 to 8192 pixels, got {width}")
    video = Video.of(source)
    start, stop = _span(frames, video.count())
    scale = min(1.0, width / video.size[0])
    size = max(1, round(video.size[0] * scale)), max(1, round(video.size[1] * scale))
    model = _background(video, method, background, size)
    box, ignored = _scaled_roi(roi, video, scale), _ignored(ignore, size)
    target.parent.mkdir(parents=True, exist_ok=True)
    building = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        images = video.frames(start, stop, size)
        images = progress(images, stop - start) if progress else images
        report = _write(building, images, model, box, ignored, video.fps, size, start)
        if not any(row["usable"] for row in report):
            raise ValueError(f"{source}: expected a person who moves before a still background, got none in any frame")
        building.chmod(0o755)
        building.rename(target)
    except BaseException:
        shutil.rmtree(building, ignore_errors=True)
        raise
    usable = sum(bool(row["usable"]) for row in report)
    return {
        "video": str(source),
        "frames": len(report),
        "usable": usable,
        "size": list(size),
        "fps": video.fps,
        "method": method,
        "touching_border": sum(bool(row["touches_border"]) for row in report),
        "in_pieces": sum(row["pieces"] > 1 for row in report),
    }


def _background(video: Video, method: str, given: str | None, size: tuple[int, int]) -> Background:
    if method == "mean":
        if given is None:
            raise ValueError("background must be frames A:B or an image for the method mean, got none")
        return mean_background(_given_background(video, given, size))
    if given is not None:
        raise ValueError(f"background must not be given for the method {method}, which learns it, got {given!r}")
    if method == "median":
        step = max(1, video.count() // SAMPLES)
        return median_background(list(video.frames(0, None, size, step))[:SAMPLES])
    return Mixture(video.frames(0, None, size))


def _given_background(video: Video, given: str, size: tuple[int, int]) -> Iterator[Image]:
    start, colon, stop = given.partition(":")
    if colon and (start + stop).isdigit() and stop:
        first, last = _span((int(start or 0), int(stop)), video.count())
        yield from video.frames(first, last, size)
        return
    image = cv2.imread(given)
    if image is None:
        raise ValueError(f"background must be frames A:B or an image, got {given!r}")
    if (image.shape[1], image.shape[0]) != video.size:
        came = f"{image.shape[1]}x{image.shape[0]}"
        raise ValueError(f"{given}: background must have the video's size {video.size[0]}x{video.size[1]}, got {came}")
    yield np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _scaled_roi(roi: tuple[int, int, int, int] | None, video: Video, scale: float) -> tuple[int, int, int, int] | None:
    if roi is None:
        return None
    x, y, wide, tall = roi
    if min(x, y) < 0 or min(wide, tall) < 1 or x + wide > video.size[0] or y + tall > video.size[1]:
        raise ValueError(f"roi must lie within the video's {video.size[0]}x{video.size[1]} pixels, got {roi}")
    left, top = round(x * scale), round(y * scale)
    return left, top, max(1, round((x + wide) * scale) - left), max(1, round((y + tall) * scale) - top)


def _ignored(path: str | Path | None, size: tuple[int, int]) -> Mask | None:
    if path is None:
        return None
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise ValueError(f"{path}: expected an image of what to ignore, got a file that is none")
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_NEAREST) > 127)


def _span(frames: Range, count: int) -> tuple[int, int]:
    start, stop, _ = slice(*frames).indices(count)
    if start >= stop:
        low, high = ("" if value is None else value for value in frames)
        raise ValueError(f"frames must choose some of the {count} frames, got {low}:{high}")
    return start, stop


def _write(
    folder: Path,
    images: Iterator[Image],
    model: Background,
    roi: tuple[int, int, int, int] | None,
    ignore: Mask | None,
    fps: float,
    size: tuple[int, int],
    start: int,
) -> list[dict[str, Any]]:
    """Write the three files while the video goes by; return a row a frame."""
    rows: list[dict[str, Any]] = []
    latest: deque[int] = deque(maxlen=LATEST)
    preview = cv2.VideoWriter(str(folder / "preview.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), fps, size)
    with (folder / "masks.raw").open("wb") as masks, (folder / "valid.raw").open("wb") as valid:
        for k, image in enumerate(images):
            found = person(*model.classify(image), roi, ignore)
            rows.append(_judged(found, start + k, latest))
            masks.write(found.mask.astype(np.uint8).tobytes())
            valid.write(found.valid.astype(np.uint8).tobytes())
            preview.write(_painted(image, found, rows[-1]["usable"]))
    preview.release()
    usable = np.array([row["usable"] for row in rows], dtype=bool)
    shape = (len(rows), size[1], size[0])
    with zipfile.ZipFile(folder / "masks.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in ("masks", "valid"):
            with (
                archive.open(f"{name}.npy", "w", force_zip64=True) as member,
                (folder / f"{name}.raw").open("rb") as raw,
            ):
                header = {"descr": "|u1", "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member, header)
                shutil.copyfileobj(raw, member)
            (folder / f"{name}.raw").unlink()
        for name, value in (("usable", usable), ("fps", np.array(fps))):
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, value)
    with (folder / "quality.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else ["frame"])
        writer.writeheader()
        writer.writerows(rows)
    return rows


def _judged(found: Person, frame: int, latest: deque[int]) -> dict[str, Any]:
    """Return a frame's row: usable where the person is whole and about as large as in the frames before."""
    usual = float(np.median(latest)) if latest else float(found.area)
    jitter = abs(found.area / usual - 1.0) if usual else 0.0
    whole = found.area > 0 and not found.touches_border
    usable = whole and jitter <= CHANGE
    if whole:
        latest.append(found.area)
    return {
        "frame": frame,
        "area": found.area,
        "jitter": round(jitter, 4),
        "pieces": found.pieces,
        "touches_border": int(found.touches_border),
        "usable": int(usable),
    }


def _painted(image: Image, found: Person, usable: bool) -> Image:
    colour = np.array((90, 200, 90) if usable else (60, 60, 230), dtype=np.float32)
    painted = image.copy()
    painted[~found.valid] //= 2
    painted[found.mask] = (0.5 * painted[found.mask] + 0.5 * colour).astype(np.uint8)
    return painted
