"""A recording for the Rerun viewer, through the optional library rerun-sdk: the body, what was filmed, the camera.

Limbs that are unsure are dark, as the viewer's ground is, and another mode is drawn in thin lines, as in the overlay.
"""

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import BONES, PARENTS, SIDES
from posefit.motion.motion import Motion
from posefit.tracking.drawing import OTHER, SIDE_COLOURS, opacities
from posefit.tracking.evaluation import LOST
from posefit.tracking.picture import MIN_OTHER_WEIGHT
from posefit.uncertainty.calibration import MAIN_LEVEL
from posefit.uncertainty.intervals import joint_intervals
from posefit.uncertainty.modes import other_mode

THIN = 0.006  # metres: how thick the lines are of what else it may be


def check_recording(path: str | Path) -> None:
    """Raise ImportError without the library, and ValueError where the recording may not be written."""
    try:
        importlib.import_module("rerun")
    except ImportError as error:
        raise ImportError("recordings for Rerun need the library rerun-sdk: pip install posefit[viewer]") from error
    if Path(path).exists():
        raise InputError(f"{path}: expected a new file for the recording, got one that exists")
    if not Path(path).resolve().parent.is_dir():
        raise InputError(f"{path}: expected a folder to write the recording to, got none of that name")


def record(path: str | Path, scene: Scene, estimate: Motion, frames: Sequence[Frame]) -> None:
    """Write a recording (.rrd) of the motion in 3D, with the cameras and the masks they saw.

    `frames` are a tracker's, with their posterior and whether each is lost.
    """
    rerun: Any = importlib.import_module("rerun")
    recording = rerun.RecordingStream("posefit")
    recording.save(str(path))
    recording.log("world", rerun.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
    for v, camera in enumerate(scene.cameras):
        place = rerun.Transform3D(translation=camera.position, mat3x3=camera.rotation.T)
        recording.log(f"world/camera-{v}", place, static=True)
        lens = rerun.Pinhole(
            resolution=[camera.width, camera.height], focal_length=camera.focal, principal_point=camera.centre
        )
        recording.log(f"world/camera-{v}/mask", lens, static=True)
    radii, skeleton = scene.body.radii.mean(axis=1), estimate.skeleton
    sides = np.array([SIDE_COLOURS[side][::-1] for side in SIDES[1:]], dtype=np.float64)
    for k, (points, observation, frame) in enumerate(zip(estimate.joints, scene.observations, frames, strict=True)):
        recording.set_time("frame", sequence=k)
        recording.set_time("time", duration=k / estimate.fps)
        colours = sides
        if frame.posterior is not None:
            off = joint_intervals(skeleton, frame.posterior, frame.pose)[MAIN_LEVEL]
            colours = sides * opacities(off)[:, None]
        look = {"radii": radii, "colors": colours.round().astype(np.uint8), "labels": list(BONES)}
        recording.log("world/body", rerun.LineStrips3D(_bones(points), **look, show_labels=False))
        other = other_mode(skeleton, frame.modes, frame.pose, MIN_OTHER_WEIGHT)
        thin: Any = rerun.Clear(recursive=False)  # of what an earlier frame may have shown
        if other is not None:
            bones = _bones(skeleton.joints(other.pose, other.translation))
            thin = rerun.LineStrips3D(bones, radii=THIN, colors=[OTHER[::-1]] * len(bones))
        recording.log("world/other", thin)
        if frame.lost is not None and frame.lost >= LOST:
            recording.log("lost", rerun.TextLog(f"frame {k} is lost", level=rerun.TextLogLevel.WARN))
        for v, silhouette in enumerate(observation.silhouettes):
            recording.log(f"world/camera-{v}/mask", rerun.SegmentationImage(silhouette.mask.astype(np.uint8)))
    recording.flush()


def _bones(joints: Array) -> Array:
    """Return both ends (26, 2, 3) of each bone of joints (27, 3)."""
    return np.stack([joints[np.array(PARENTS[1:])], joints[1:]], axis=1)
