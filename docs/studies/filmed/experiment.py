"""What tracks of a real walk are worth, seed by seed."""

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from filmed.gait import gait
from filmed.reference import references
from filmed.speed import loop_speed
from posefit.arrays import Array
from posefit.footage.masks import Range, existing
from posefit.footage.segmentation import WIDTH, Extraction
from posefit.footage.segmenting.film import Box
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Mask
from posefit.steadying.path import SeenFrames, steadied
from posefit.tracking.front import track
from posefit_reproduce.grid import Progress, check_seeds, each

SEEDS = 5


def filmed(
    video: str, roi: Box, frames: Range, seeds: int, workers: int | None, progress: Progress | None = None
) -> dict[str, Any]:
    """Return how fast a video is followed, while nothing else runs, and what the track of each seed is worth.

    Raises ValueError where the video, the region or the frames make no sense.
    """
    check_seeds(seeds)
    existing(Path(video))
    speed = each({"speed": partial(loop_speed, video, roi, frames)}, 1)["speed"]
    tracks = each({seed: partial(filmed_figures, video, roi, frames, seed) for seed in range(seeds)}, workers, progress)
    return {"video": video, "roi": list(roi), "frames": list(frames), "speed": speed, "tracks": list(tracks.values())}


def filmed_lines(told: dict[str, Any]) -> Iterator[str]:
    """Yield a line for each figure of speed, then a table with a row a seed."""
    for name, value in told["speed"].items():
        yield f"{name:32} {value:.4g}"
    heads = list(told["tracks"][0])
    rows = [
        [f"{value:.3g}" if isinstance(value, float) else str(value) for value in one.values()] for one in told["tracks"]
    ]
    for cells in (heads, *rows):
        yield "  ".join(cell.rjust(len(head)) for cell, head in zip(cells, heads, strict=True))


def filmed_figures(source: str | Path, roi: Box, frames: Range, seed: int) -> dict[str, Any]:
    """Return what the track of a seed is worth: its overlap as a search of each frame finds it, its gait as steadied.

    What is steady is fitted to the masks once more; and what is found in each frame goes to and fro in depth, so that
    it tells little of which way somebody goes in a moment.
    """
    video = Video.of(source)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "track"
        method: dict[str, Any] = {"optimiser": "sapso", "prior": "loose", "steady": False, "seed": seed}
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
        **gait(steadied(motion, SeenFrames(usable, np.tile(camera.position, (len(usable), 1)))), camera, seen),
    }


def _overlaps(motion: Motion, radii: Array, camera: Camera, seen: list[Mask]) -> Array:
    body, overlaps = Body(motion.skeleton, radii), []
    for mask, pose, translation in zip(seen, motion.poses, motion.translations, strict=True):
        fitted = project(body, camera, pose, translation)
        overlaps.append((mask & fitted).sum() / (mask | fitted).sum())
    return np.array(overlaps)
