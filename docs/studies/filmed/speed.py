"""How fast frames of a video are extracted, and how much longer a frame takes than its evaluations."""

import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import ROOT_RANGE_DEGREES, SearchSpace
from posefit.fitting.tracker import Task
from posefit.footage.masks import Range
from posefit.footage.scene import Scene
from posefit.footage.segmentation import Extraction, Segmentation
from posefit.footage.segmenting.film import Box
from posefit.footage.source import Viewing, scene_of
from posefit.footage.video import Video
from posefit.motion import built_in
from posefit.tracking.method import Choice, prepare

POPULATION = 40
METHODS = (("sapso", "loose"), ("sapso", "pca"), ("pso", "loose"), ("annealed", "loose"))


def loop_speed(source: str | Path, roi: Box, frames: Range) -> dict[str, float]:
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
    training = [built_in.motion(style) for style in built_in.other_styles("walk")]
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
        found = np.concatenate([frame.pose[:3], frame.coordinates[3:]])  # its root itself, whatever tilt was learned
        near = np.tile(space.proposals(found), (POPULATION, 1))
        began = time.perf_counter()
        for _ in range(frame.evaluations // POPULATION):
            problem.evaluate(near)
        alone.append(time.perf_counter() - began)
        whole.append(frame.seconds)
    return 1e3 * float(np.median(whole)), 1e3 * float(np.median(alone))
