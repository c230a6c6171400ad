"""Tracks of real films.

python docs/studies/footage.py tracks VIDEO --roi X,Y,W,H    what tracks of a walk are worth, seed by seed
python docs/studies/footage.py figures FOLDER                figures 8 and 10 of the SAPSO paper
"""

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np

from footage_figures import figures
from posefit.arrays import Array
from posefit.cli.options import FRAMES, box, parsed_by
from posefit.footage.masks import Range, existing
from posefit.footage.segmentation import WIDTH, Box, Extraction
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image, median_background
from posefit.silhouette.mask import Mask
from posefit.tracking.front import track
from posefit.tracking.smoothing.path import Visibility, smooth_path
from posefit_reproduce.jobs import Progress, each
from table import WORKERS, bar

GREY, GAP = 18, 11  # levels, pixels
LEARNED = 40  # frames that the median is of


def references(video: Video, size: tuple[int, int], roi: Box, frames: Range) -> Iterator[Mask]:
    """Yield a mask of the person for each frame, made without any of what `extract` does."""
    count = video.count()
    middle = median_background(list(video.frames(0, None, size, max(1, count // LEARNED)))[:LEARNED]).middle
    start, stop, _ = slice(*frames).indices(count)
    left, top, wide, tall = (round(value * size[0] / video.size[0]) for value in roi)
    for image in video.frames(start, stop, size):
        yield reference(image, middle.round().astype(np.uint8), (left, top, wide, tall))


def reference(image: Image, background: Image, roi: Box) -> Mask:
    """Return the largest closed and filled piece of what differs from the background, within roi."""
    left, top, wide, tall = roi
    changed = np.zeros(image.shape[:2], dtype=np.uint8)
    part = np.s_[top : top + tall, left : left + wide]
    changed[part] = cv2.absdiff(image, background).max(axis=2)[part] > GREY
    closed = cv2.morphologyEx(changed, cv2.MORPH_CLOSE, np.ones((GAP, GAP), dtype=np.uint8))
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros_like(changed)
    cv2.drawContours(filled, [max(outlines, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return np.asarray(filled > 0)


STEPS = (1.0, 3.5)  # a second: between which a step frequency is sought


def gait(motion: Motion, camera: Camera, seen: list[Mask]) -> dict[str, Any]:
    """Return the way that masks and fitted poses go, the share of frames that face it, and the steps a second."""
    joints = motion.skeleton.joints(motion.poses, motion.translations)
    pixels = camera.project(joints)[0]
    feet = pixels[:, [JOINTS.index("lfoot"), JOINTS.index("rfoot")], 0]
    widths = []
    for mask in seen:
        rows = np.flatnonzero(mask.any(axis=1))
        lower = mask[(rows[0] + rows[-1]) // 2 : rows[-1]]
        widths.append(float(np.ptp(np.flatnonzero(lower.any(axis=0)))))
    middles = [np.flatnonzero(mask.any(axis=0)).mean() for mask in seen]
    facing = np.column_stack([np.sin(motion.poses[:, 0]), np.zeros(len(motion)), np.cos(motion.poses[:, 0])])
    way = np.gradient(motion.translations, axis=0)
    return {
        "travel_seen": "left" if middles[-1] < middles[0] else "right",
        "travel_fitted": "left" if pixels[-1, 0, 0] < pixels[0, 0, 0] else "right",
        "facing_its_way": float(((facing * way).sum(axis=1) > 0.0).mean()),
        "steps_a_second_seen": frequency(np.array(widths), motion.fps),
        "steps_a_second_fitted": frequency(np.abs(feet[:, 0] - feet[:, 1]), motion.fps),
    }


def frequency(series: Array, fps: float) -> float:
    """Return the strongest frequency of a series (T,), a second, between those a walk has."""
    away = series - np.polyval(np.polyfit(np.arange(len(series)), series, 2), np.arange(len(series)))
    tried = np.linspace(*STEPS, 251)
    waves = np.exp(2j * np.pi * np.outer(tried, np.arange(len(series))) / fps)
    return float(tried[np.abs(waves @ (away * np.hanning(len(away)))).argmax()])


def filmed(
    video: str, roi: Box, frames: Range, seeds: int, workers: int | None, progress: Progress | None = None
) -> dict[str, Any]:
    """Return how fast a video is followed, while nothing else runs, and what the track of each seed is worth.

    Raises ValueError where the video, the region or the frames make no sense.
    """
    existing(Path(video))
    tracks = each({seed: partial(filmed_figures, video, roi, frames, seed) for seed in range(seeds)}, workers, progress)
    return {"video": video, "roi": list(roi), "frames": list(frames), "tracks": list(tracks.values())}


def filmed_lines(told: dict[str, Any]) -> Iterator[str]:
    """Yield a line for each figure of speed, then a table with a row a seed."""
    heads = list(told["tracks"][0])
    rows = [
        [f"{value:.3g}" if isinstance(value, float) else str(value) for value in one.values()] for one in told["tracks"]
    ]
    for cells in (heads, *rows):
        yield "  ".join(cell.rjust(len(head)) for cell, head in zip(cells, heads, strict=True))


def filmed_figures(source: str | Path, roi: Box, frames: Range, seed: int) -> dict[str, Any]:
    """Return what the track of a seed is worth: its overlap as a search of each frame finds it, its gait as smoothed.

    What is steady is fitted to the masks once more; and what is found in each frame goes to and fro in depth, so that
    it tells little of which way somebody goes in a moment.
    """
    video = Video.of(source)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "track"
        method: dict[str, Any] = {"method": "sapso@loose", "smooth": False, "seed": seed}
        result = track(source, extraction=Extraction(roi=roi), frames=frames, out=out, **method)
        camera = Camera.from_json(out / "camera.json")
        with np.load(out / "poses.npz") as stored:
            radii = stored["radii"]
    motion, usable = result.motion, np.array([row.get("usable", 1.0) > 0 for row in result.frames])
    size = camera.width, camera.height
    assert size[0] == min(WIDTH, video.size[0])
    seen = list(references(video, size, roi, frames))
    return {
        "seed": seed,
        "frames": len(usable),
        "usable": int(usable.sum()),
        "iou_masks": result.summary["iou"],
        "iou_reference": float(np.mean(_overlaps(motion, radii, camera, seen)[usable])),
        "lowest_iou_masks": min(row["iou"] for row, ok in zip(result.frames, usable, strict=True) if ok),
        **gait(smooth_path(motion, Visibility(usable, np.tile(camera.position, (len(usable), 1)))), camera, seen),
    }


def _overlaps(motion: Motion, radii: Array, camera: Camera, seen: list[Mask]) -> Array:
    body, overlaps = Body(motion.skeleton, radii), []
    for mask, pose, translation in zip(seen, motion.poses, motion.translations, strict=True):
        fitted = project(body, camera, pose, translation)
        overlaps.append((mask & fitted).sum() / (mask | fitted).sum())
    return np.array(overlaps)


@click.group()
def main() -> None:
    """Tracks of real films."""


main.add_command(figures)


@main.command("tracks")
@click.argument("video")
@click.option(
    "--roi", callback=parsed_by(box), required=True, metavar="X,Y,W,H", help="Where the person is, in pixels."
)
@FRAMES
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True, help="Tracks, one a seed.")
@WORKERS
def tracks(video: str, roi: Box, frames: Range, seeds: int, workers: int | None) -> None:
    """What tracks of a real walk are worth, whose truth is unknown: overlap, direction and steps, seed by seed."""
    for line in filmed_lines(filmed(video, roi, frames, seeds, workers, bar)):
        click.echo(line)


if __name__ == "__main__":
    main()
