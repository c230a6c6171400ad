"""What a track of a real walk is worth, whose truth nobody knows: `python -m posefit_experiments.real VIDEO ROI A:B`.

Prints the overlap with the masks that were tracked and with a reference that was made in another way: where a frame
differs from the median of the video by more than 18 grey levels in a channel, gaps of 11 pixels closed, the largest
piece, all its holes filled, at 640 pixels across. Cast shadows are part of it. Then the direction of travel, whether
the person faces it, and the steps a second, seen and fitted: the strongest period of how wide the lower half of the
reference is, and of how far apart the fitted feet are in the image. The first line tells how fast it is, on one thread.
"""

import json
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import ROOT_RANGE_DEGREES, SearchSpace
from posefit.fitting.tracker import Task
from posefit.footage.masks import Range
from posefit.footage.scene import Scene
from posefit.footage.segmentation import WIDTH, Box, Extraction, Segmentation
from posefit.footage.source import Viewing, scene_of
from posefit.footage.video import Video
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion import library
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image, median_background
from posefit.silhouette.mask import Mask
from posefit.tracking.front import track
from posefit.tracking.method import Choice, prepare

GREY, GAP = 18, 11  # levels, pixels
STEPS = (1.0, 3.5)  # a second: between which a step frequency is sought
SEEDS = range(5)
POPULATION = 40
METHODS = (("sapso", "loose"), ("sapso", "pca"), ("pso", "loose"), ("annealed", "loose"))


def references(video: Video, size: tuple[int, int], roi: Box, frames: Range) -> Iterator[Mask]:
    """Yield a mask of the person for each frame, made without any of what `extract` does."""
    count = video.count()
    middle = median_background(list(video.frames(0, None, size, max(1, count // 40)))[:40]).middle
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


def frequency(series: Array, fps: float) -> float:
    """Return the strongest frequency of a series (T,), a second, between those a walk has."""
    away = series - np.polyval(np.polyfit(np.arange(len(series)), series, 2), np.arange(len(series)))
    tried = np.linspace(*STEPS, 251)
    waves = np.exp(2j * np.pi * np.outer(tried, np.arange(len(series))) / fps)
    return float(tried[np.abs(waves @ (away * np.hanning(len(away)))).argmax()])


def measure(source: str | Path, roi: Box, frames: Range, seed: int) -> dict[str, Any]:
    """Return what a track is worth."""
    video = Video.of(source)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "track"
        result = track(source, extraction=Extraction(roi=roi), frames=frames, seed=seed, out=out)
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
        **_gait(motion, camera, seen),
    }


def _overlaps(motion: Motion, radii: Array, camera: Camera, seen: list[Mask]) -> Array:
    from posefit.geometry.body import Body

    body, overlaps = Body(motion.skeleton, radii), []
    for mask, pose, translation in zip(seen, motion.poses, motion.translations, strict=True):
        fitted = project(body, camera, pose, translation)
        overlaps.append((mask & fitted).sum() / (mask | fitted).sum())
    return np.array(overlaps)


def _gait(motion: Motion, camera: Camera, seen: list[Mask]) -> dict[str, Any]:
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


def speed(source: str | Path, roi: Box, frames: Range) -> dict[str, float]:
    """Return how fast frames are extracted, and how long tracking takes beside its evaluations, on one thread."""
    cv2.setNumThreads(1)
    video, how = Video.of(source), Extraction(roi=roi)
    began = time.perf_counter()
    found = Segmentation(video, how, (None, None))
    count = sum(1 for _ in found)
    ended = time.perf_counter()
    speeds = {
        "extraction_frames_a_second": count / (ended - began),  # learning the background is part of it
        "video_frames_a_second": video.fps,
    }
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        seen = scene_of([source], Viewing(frames=frames, extraction=how), Path(folder))
        for optimiser, prior in METHODS:
            whole, alone = _times(seen, Choice(optimiser=optimiser, prior=prior))
            speeds[f"{optimiser}_{prior}_track_ms"] = whole
            speeds[f"{optimiser}_{prior}_evaluations_ms"] = alone
            speeds[f"{optimiser}_{prior}_overhead"] = whole / alone
    return speeds


def _times(seen: Scene, choice: Choice) -> tuple[float, float]:
    """Return the median milliseconds of a frame, and of the same number of evaluations alone."""
    training = [library.built_in(style) for style in library.other_styles("walk")]
    task = Task(seen.body, seen.cameras, choice.budget(), None, seen.anchor, "aligned", training=training)
    method = prepare(choice, task)
    assert method.prior is not None
    whole, alone = [], []
    for frame, observation in zip(
        method.tracker(task).track(seen.observations, np.random.default_rng(0)), seen.observations, strict=True
    ):
        if frame.coordinates is None:
            continue
        centre = np.array([frame.pose[0], 0.0, 0.0])
        space = SearchSpace(method.prior, centre, np.radians(ROOT_RANGE_DEGREES), seen.anchor, "aligned")
        problem = PoseProblem(seen.body, seen.cameras, observation.silhouettes, space)
        near = np.tile(space.proposals(frame.coordinates.copy()), (POPULATION, 1))
        began = time.perf_counter()
        for _ in range(frame.evaluations // POPULATION):
            problem.evaluate(near)
        alone.append(time.perf_counter() - began)
        whole.append(frame.seconds)
    return 1e3 * float(np.median(whole)), 1e3 * float(np.median(alone))


if __name__ == "__main__":
    try:
        box = tuple(map(int, sys.argv[2].split(",")))
        first, last = map(int, sys.argv[3].split(":"))
    except (IndexError, ValueError):
        sys.exit("usage: python -m posefit_experiments.real VIDEO X,Y,WIDTH,HEIGHT FIRST:STOP")
    print(json.dumps(speed(sys.argv[1], box, (first, last))), flush=True)  # type: ignore[arg-type]
    for seed in SEEDS:
        print(json.dumps(measure(sys.argv[1], box, (first, last), seed)), flush=True)  # type: ignore[arg-type]
