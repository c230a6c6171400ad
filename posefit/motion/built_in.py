"""The built-in motions: small periodic models, so that everything runs without any data.

Every kind has styles, each from another person: `walk-a`, `walk-b`, ... Kinds are `walk`, `run`, `march` (raising the
knees on the spot), `jacks` (jumping jacks), `squat`, `jump`, `step` (walking on the spot), and `arms-out` and `wave`
(walking with both arms held out, or with one waving). Without a letter it is the mean of the styles, in step. So `walk`
is none of the motions that its prior is trained on, but within their reach; a prior trained on other people only, as
for `walk-a`, is the harder case. They were fitted to CMU clips by `docs/studies/make_motions.py`; arms held out or
waving are drawn by hand. The data used in this project was obtained from mocap.cs.cmu.edu. The database was created
with funding from NSF EIA-0196217.
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
    """Return what built_in.json holds: the average skeleton, and the models by style."""
    stored: dict[str, Any] = json.loads(
        (files("posefit.motion") / "built_in.json").read_text(encoding="utf-8")
    )
    return stored


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """Return the names that `motion` takes."""
    styles = tuple(_stored()["motions"])
    return tuple(dict.fromkeys(activity_of(name) for name in styles)) + styles


def activity_of(name: str) -> str:
    """Return the kind of motion that a name is of: `walk` of `walk-a`, `arms-out` of `arms-out`."""
    return re.sub(r"-[a-z]$", "", name)


@lru_cache
def other_styles(name: str) -> tuple[str, ...]:
    """Return the other styles of a motion's kind, what its prior is trained on by default."""
    _check(name)
    return tuple(
        style
        for style in _stored()["motions"]
        if activity_of(style) == activity_of(name) and style != name
    )


@lru_cache(maxsize=1)
def average_skeleton() -> Skeleton:
    """Return the skeleton of the built-in motions: the mean of nine people, symmetric."""
    return stored_skeleton("average", _stored()["skeleton"])


def stored_skeleton(name: str, stored: Mapping[str, Any]) -> Skeleton:
    """Return a skeleton that the package holds as JSON, with its angles in degrees."""
    return Skeleton(
        name,
        np.array(stored["offsets"]),
        rotation_from_joint_angles(np.radians(stored["axes_degrees"])),
        tuple((bone, tuple(free)) for bone, free in stored["channels"]),
        None
        if stored["limits_degrees"] is None
        else np.radians(stored["limits_degrees"]),
    )


def motion(
    name: str,
    *,
    frames: int = 60,
    fps: float = 30.0,
    speed: float = 1.0,
    phase: float = 0.0,
) -> Motion:
    """Return a built-in motion of so many frames. It goes along +z, and half its way is behind the origin.

    `speed` multiplies the cadence and with it the pace; `phase`, in cycles, is where in its cycle it starts. The
    lowest joint of the cycle is about 3 cm above the ground y = 0, as thick as a toe; a mean of styles may be 2 cm
    off. Raises InputError for an unknown name, and where a number is not what it should be.
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
    turns = (
        2.0
        * np.pi
        * np.outer(times / period + phase, np.arange(1, series.shape[1] // 2 + 1))
    )
    values = np.column_stack([np.ones(frames), np.cos(turns), np.sin(turns)]) @ series.T
    poses = np.zeros((frames, ANGLES))
    poses[:, angles] = values[:, 3:]
    translations = values[:, :3].copy()
    translations[:, 2] += pace * (times - 0.5 * times[-1])
    return Motion(name, average_skeleton(), poses, translations, fps)


@lru_cache(maxsize=64)
def _model(name: str) -> tuple[list[int], Array, float, float]:
    """Return the free angles, the series of path and angles, the period in seconds and the pace in m/s."""
    _check(name)
    styles = [name] if name in _stored()["motions"] else other_styles(name)
    models = [_stored()["motions"][style] for style in styles]
    series, period, pace = (
        np.mean([model[key] for model in models], axis=0)
        for key in ("series", "period", "speed")
    )
    return models[0]["angles"], series, float(period), float(pace)


def _check(name: str) -> None:
    if name not in names():
        raise InputError(
            "motion must be a file, a folder, a recorded one that posefit motions lists, or one of "
            f"{', '.join(names())}, got {quoted(name)}{suggestion(name, names())}"
        )
