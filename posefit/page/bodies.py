"""Cameras, joints and angles as a page's scripts read them: as few characters as they need."""

import base64
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera

LARGEST = 32_767  # of 16 bits


def in_16_bits(values: Array, unit: float = 1e-3) -> str:
    """Return numbers in 16 bits each, little-endian in base 64, as multiples of a unit: a millimetre, if in metres.

    What is beyond 32,767 units counts as so many; NaN is -32,768.
    """
    counted = np.clip(np.round(np.asarray(values, dtype=np.float64) / unit), -LARGEST, LARGEST)
    whole = np.where(np.isnan(counted), -LARGEST - 1, counted).astype("<i2")
    return base64.b64encode(whole.tobytes()).decode()


def camera_seen_from(camera: Camera, origin: Array) -> dict[str, Any]:
    """Return a camera that sees points in metres from the origin."""
    return {
        "size": [camera.width, camera.height],
        "focal": np.round(camera.focal, 3).tolist(),
        "centre": np.round(camera.centre, 3).tolist(),
        "rotation": np.round(camera.rotation, 6).tolist(),
        "translation": np.round(camera.translation + camera.rotation @ origin, 6).tolist(),
    }
