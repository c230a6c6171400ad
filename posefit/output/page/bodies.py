"""Cameras, joints and angles as a page's scripts read them, in few characters."""

import base64
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera

MAX_16_BITS = 32_767


def in_16_bits(values: Array, unit: float = 1e-3) -> str:
    """Return numbers in 16 bits each, little-endian in base 64, as multiples of a unit: a millimetre, if in metres.

    Larger values are clipped to 32,767 units; NaN is -32,768.
    """
    units = np.clip(np.round(np.asarray(values, dtype=np.float64) / unit), -MAX_16_BITS, MAX_16_BITS)
    whole = np.where(np.isnan(units), -MAX_16_BITS - 1, units).astype("<i2")
    return base64.b64encode(whole.tobytes()).decode()


def camera_from_origin(camera: Camera, origin: Array) -> dict[str, Any]:
    """Return a camera for points in metres from the origin."""
    return {
        "size": [camera.width, camera.height],
        "focal": np.round(camera.focal, 3).tolist(),
        "centre": np.round(camera.centre, 3).tolist(),
        "rotation": np.round(camera.rotation, 6).tolist(),
        "translation": np.round(camera.translation + camera.rotation @ origin, 6).tolist(),
    }
