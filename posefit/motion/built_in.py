"""The built-in motions: small periodic models, so that everything runs without data.

Every kind has styles, each from another person: `walk-a`, `walk-b`, ... The kinds are
`walk`, `run`, `march` (raising the knees on the spot), `jacks` (jumping jacks),
`squat`, `jump`, `step` (walking on the spot), and `arms-out` and `wave` (walking with
both arms held out, or with one waving).

A name without a letter is the mean of the kind's styles, aligned in phase. So `walk` is
easy to track: its prior is trained on all the styles of which it is the mean. A style
such as `walk-a` is harder, because its prior is trained on other people only.

The motions were fitted to CMU clips by `docs/studies/make_motions.py`; arms held out or
waving were added by hand. The data used in this project was obtained from
mocap.cs.cmu.edu. The database was created with funding from NSF EIA-0196217.
"""

import json
import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.rotation import rotation_from_joint_angles
from posefit.geometry.skeleton import ANGLES, Skeleton
from posefit.motion.motion import LONGEST, Motion
from posefit.reading import quoted, suggestion


@lru_cache(maxsize=1)
def _stored() -> dict[str, Any]:
    """Return the content of built_in.json: the average skeleton and the styles."""
    stored: dict[str, Any] = json.loads(
        (files("posefit.motion") / "built_in.json").read_text(encoding="utf-8")
    )
    return stored


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """Return the names that `motion` accepts."""
    styles = tuple(_stored()["motions"])
    return tuple(dict.fromkeys(map(activity_of, styles))) + styles


def activity_of(name: str) -> str:
    """Return the kind of motion of a name: `walk` for `walk-a` and for `walk`."""
    return re.sub(r"-[a-z]$", "", name)


@lru_cache
def other_styles(name: str) -> tuple[str, ...]:
    """Return the other styles of a motion's kind: the default training motions."""
    _check(name)
    styles = []
    for style in _stored()["motions"]:
        if activity_of(style) == activity_of(name) and style != name:
            styles.append(style)
    return tuple(styles)


def person_of(style: str) -> str:
    """Return the person whose clip a style was fitted to, by the database's number.

    Args:
        style: Such as `walk-a`, not the mean of a kind's styles.
    """
    clip: str = _stored()["motions"][style]["source"]
    return clip.partition("_")[0]


@lru_cache(maxsize=1)
def average_skeleton() -> Skeleton:
    """Return the skeleton of the built-in motions: a symmetric mean of nine people."""
    return stored_skeleton("average", _stored()["skeleton"])


def stored_skeleton(name: str, stored: Mapping[str, Any]) -> Skeleton:
    """Return a skeleton that the package stores as JSON, with angles in degrees."""
    limits = None
    if stored["limits_degrees"] is not None:
        limits = np.radians(stored["limits_degrees"])
    channels = []
    # JSON has lists for tuples
    for bone, free in stored["channels"]:
        channels.append((bone, tuple(free)))
    return Skeleton(
        name,
        np.array(stored["offsets"]),
        rotation_from_joint_angles(np.radians(stored["axes_degrees"])),
        tuple(channels),
        limits,
    )


def motion(
    name: str,
    *,
    frames: int = 60,
    fps: float = 30.0,
    speed: float = 1.0,
    phase: float = 0.0,
) -> Motion:
    """Return a built-in motion. The person moves along +z, past the origin halfway.

    The lowest joint of the cycle is about 3 cm above the ground y = 0, as much as a toe
    is thick; a mean of styles may be 2 cm off.

    Args:
        name: One of `names()`.
        frames: Number of frames.
        fps: Frames per second.
        speed: Factor of the cadence and of the speed over the ground.
        phase: Where in its cycle the motion starts, in cycles.

    Raises:
        InputError: The name is unknown, or a number is invalid.
    """
    angles, series, period, pace = _model(name)
    if (
        isinstance(frames, bool)
        or not isinstance(frames, int | np.integer)
        or frames < 1
    ):
        raise InputError(
            f"frames must be a whole number of at least 1, got {quoted(frames)}"
        )
    if frames > LONGEST:
        raise InputError(f"frames must be at most {LONGEST}, got {quoted(frames)}")
    if not (np.isfinite(fps) and fps > 0.0 and np.isfinite(speed) and speed > 0.0):
        raise InputError(f"fps and speed must be positive, got {fps} and {speed}")
    if not np.isfinite(phase):
        raise InputError(f"phase must be finite, got {phase}")
    times = np.arange(frames) * speed / fps
    harmonics = np.arange(1, series.shape[1] // 2 + 1)
    turns = 2.0 * np.pi * np.outer(times / period + phase, harmonics)  # (T, harmonics)
    values = np.column_stack([np.ones(frames), np.cos(turns), np.sin(turns)]) @ series.T
    poses = np.zeros((frames, ANGLES))
    poses[:, angles] = values[:, 3:]
    translations = values[:, :3].copy()
    # centred on the origin, so that a camera around it sees the whole motion
    translations[:, 2] += pace * (times - 0.5 * times[-1])
    return Motion(name, average_skeleton(), poses, translations, fps)


@lru_cache(maxsize=64)
def _model(name: str) -> tuple[list[int], Array, float, float]:
    """Return free angles, Fourier series, period in seconds and pace in m/s."""
    _check(name)
    styles = [name] if name in _stored()["motions"] else other_styles(name)
    models = [_stored()["motions"][style] for style in styles]
    series = np.mean([model["series"] for model in models], axis=0)
    period = np.mean([model["period"] for model in models], axis=0)
    pace = np.mean([model["speed"] for model in models], axis=0)
    return models[0]["angles"], series, float(period), float(pace)


def _check(name: str) -> None:
    if name not in names():
        raise InputError(
            "motion must be a file, a folder, a recorded motion that posefit motions "
            f"lists, or one of {', '.join(names())}, "
            f"got {quoted(name)}{suggestion(name, names())}"
        )
