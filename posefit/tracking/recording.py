"""A recording for the Rerun viewer, through the optional library rerun-sdk: the body, what was filmed, the camera."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from posefit.footage.scene import Scene
from posefit.geometry.skeleton import BONES, PARENTS
from posefit.motion.motion import Motion


def _library() -> Any:
    try:
        return importlib.import_module("rerun")
    except ImportError as error:
        raise ImportError("recordings for Rerun need the library rerun-sdk: pip install posefit[viewer]") from error


def check_recording(path: str | Path) -> None:
    """Raise ImportError without the library, and ValueError where the recording may not be written."""
    _library()
    if Path(path).exists():
        raise ValueError(f"{path}: expected a new file for the recording, got one that exists")
    if not Path(path).resolve().parent.is_dir():
        raise ValueError(f"{path}: expected a folder to write the recording to, got none of that name")


def record(path: str | Path, scene: Scene, estimate: Motion) -> None:
    """Write a recording (.rrd) of the motion in 3D, with the cameras and the masks they saw."""
    rerun = _library()
    recording = rerun.RecordingStream("posefit")
    recording.save(str(path))
    recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
    for v, camera in enumerate(scene.cameras):
        place = rerun.Transform3D(translation=camera.position, mat3x3=camera.rotation.T)
        recording.log(f"world/camera-{v}", place, static=True)
        lens = rerun.Pinhole(
            resolution=[camera.width, camera.height], focal_length=camera.focal, principal_point=camera.centre
        )
        recording.log(f"world/camera-{v}/seen", lens, static=True)
    joints = estimate.skeleton.joints(estimate.poses, estimate.translations)
    parents = np.array(PARENTS[1:])
    radii = scene.body.radii.mean(axis=1)
    for k, (points, observation) in enumerate(zip(joints, scene.observations, strict=True)):
        recording.set_time("frame", sequence=k)
        recording.set_time("time", duration=k / estimate.fps)
        bones = np.stack([points[parents], points[1:]], axis=1)
        recording.log("world/body", rerun.LineStrips3D(bones, radii=radii, labels=list(BONES), show_labels=False))
        for v, silhouette in enumerate(observation.silhouettes):
            recording.log(f"world/camera-{v}/seen", rerun.SegmentationImage(silhouette.mask.astype(np.uint8)))
    recording.flush()
