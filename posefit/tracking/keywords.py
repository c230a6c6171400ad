"""The types of the options of `posefit.track` and `posefit.fit`, for type checkers.

`TrackOptions` has the same options with defaults, help and checks. This file repeats
their names and types, because a type checker reads keywords from a `TypedDict` only.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from posefit.footage.choice import Choice

if TYPE_CHECKING:
    from posefit.fitting.optimiser import OptimiserFactory
    from posefit.fitting.prior import Prior
    from posefit.fitting.space import Translation
    from posefit.fitting.tracker import TrackerFactory
    from posefit.footage.extraction import Extraction
    from posefit.footage.options import OneCamera
    from posefit.footage.views import Range
    from posefit.geometry.calibration import Up
    from posefit.geometry.units import Unit
    from posefit.motion.clips import Source
    from posefit.progress import Progress


class _Keywords(TypedDict, total=False):
    asf: str | Path | None
    camera: "OneCamera | Sequence[OneCamera]"
    up: "Up | None"
    unit: "Unit | None"
    rate: float | None
    view_degrees: float | Sequence[float]
    size: tuple[int, int] | None
    fps: float | None
    extraction: "Extraction | None"
    height: float | None
    label: int | None
    category: str | None
    holes: float | None
    person: Choice | None
    method: "str | TrackerFactory | tuple[str | OptimiserFactory, str | Prior] | None"
    settings: Mapping[str, Any] | Sequence[str]
    train: "Sequence[Source]"
    evaluations: int | None
    translation: "Translation | None"
    first_pose: Literal["searched", "given"]
    restarts: int | None
    body_frames: int | None
    hypotheses: int
    smooth: bool | None
    seed: int
    threads: int | None
    device: str


class TrackKeywords(_Keywords, total=False):
    """The options of `posefit.track`."""

    frames: "Range"


class FitKeywords(_Keywords, total=False):
    """The options of `posefit.fit`."""

    out: str | Path | None
    force: bool
    resume: bool
    write: str | Sequence[str]
    progress: "Progress | None"
