"""How somebody walks, seen in masks and fitted: the way, whether the person faces it, and the steps a second.

The steps are the strongest period of how wide the lower half of the masks is, and of how far apart the fitted feet are
in the image.
"""

from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Mask

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
