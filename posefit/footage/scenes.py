"""Turns what a user names, a motion or what one camera or several saw, into a scene."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from posefit.footage.footage import Seen, calibrated, masks_of, scene_of, video_of
from posefit.footage.masks import Range
from posefit.footage.segmentation import Extraction, Segmentation
from posefit.footage.source import FPS, Scene, kind_of, motion_of, synthetic
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.calibration import Up, read_calibrations, upright
from posefit.geometry.camera import Camera
from posefit.motion import library
from posefit.motion.motion import Motion

Source = str | Path | Motion
HEIGHTS = (0.3, 2.8)  # metres that a person may stand


@dataclass(frozen=True)
class Viewing:
    """How a source is looked at.

    `cameras`, or calibration files, one a view; `view_degrees` from where, where no camera says; the `size` of
    rendered pictures; the rate `fps` of motions and masks, by default 30 or what a file of masks states; which
    `frames`. For real footage: its `extraction`, how tall the person stands in metres (`height`), and which axis of
    the calibration's world points up (`up`).
    """

    asf: str | Path | None = None
    cameras: Sequence[Camera | str | Path] = ()
    view_degrees: Sequence[float] = ()
    size: tuple[int, int] = (320, 240)
    fps: float | None = None
    frames: Range = (None, None)
    extraction: Extraction = field(default_factory=Extraction)
    height: float | None = None
    up: Up | None = None

    def __post_init__(self) -> None:
        for degrees in self.view_degrees:
            if not np.isfinite(degrees):
                raise ValueError(f"view_degrees must be a finite number, got {degrees}")
        if self.fps is not None and not (np.isfinite(self.fps) and self.fps > 0.0):
            raise ValueError(f"fps must be a positive number, got {self.fps}")
        if min(self.size) < 1 or max(self.size) > 16_384:
            raise ValueError(f"size must be from 1x1 to 16384x16384 pixels, got {self.size[0]}x{self.size[1]}")
        if self.height is not None and not HEIGHTS[0] <= self.height <= HEIGHTS[1]:
            raise ValueError(f"height must lie in {HEIGHTS[0]} to {HEIGHTS[1]} metres, got {self.height}")


def scene(
    sources: Sequence[Source] | Scene,
    viewing: Viewing,
    work: Path,
    progress: Callable[..., Any] | None,
    say: Callable[[str], None],
) -> tuple[Scene, list[str]]:
    """Return the scene of a source, or of what several cameras saw, and warnings about it.

    Masks of videos are written to the folder `work`. Raises ValueError where something does not fit.
    """
    if isinstance(sources, Scene):
        if viewing != Viewing():
            raise ValueError(f"a scene must be followed as it is, got {viewing}")
        return sources, []
    kinds = {kind_of(source) for source in sources}
    if kinds == {"motion"}:
        if len(sources) > 1:
            raise ValueError(f"source must be one motion, or views of one person, got {len(sources)} motions")
        if viewing.height is not None:
            raise ValueError(f"height must be given for footage only, a motion knows its own, got {viewing.height}")
        cameras = [camera for one in viewing.cameras for camera in _cameras(one, viewing)]
        motion = motion_of(sources[0], viewing.asf, viewing.fps or FPS)
        return synthetic(motion, viewing.view_degrees, viewing.size, cameras, viewing.frames), []
    if len(kinds) > 1:
        raise ValueError(f"sources must be of one kind, got {' and '.join(sorted(kinds))}")
    if len(viewing.view_degrees) > 1:
        raise ValueError(f"view_degrees must be one for footage, of its first camera, got {len(viewing.view_degrees)}")
    paths = [Path(source) for source in sources if not isinstance(source, Motion)]
    if kinds == {"video"}:
        seen = _filmed(paths, viewing, work, progress, say)
    else:
        calibrated(viewing.cameras, [None] * len(paths))
        seen = [masks_of(path, viewing.fps, viewing.frames) for path in paths]
    body = _body(viewing)
    views = viewing.view_degrees[0] if viewing.view_degrees else None
    name = Path(str(sources[0])).stem
    made = scene_of(seen, name, body, viewing.cameras, views, viewing.up)
    return made, [warning for one in seen for warning in one.warnings]


def _filmed(
    paths: Sequence[Path],
    viewing: Viewing,
    work: Path,
    progress: Callable[..., Any] | None,
    say: Callable[[str], None],
) -> list[Seen]:
    """Return what videos show, after everything that a user may have got wrong was checked."""
    videos = [Video.of(path) for path in paths]
    rates = {round(video.fps, 3) for video in videos}
    if len(rates) > 1:
        raise ValueError(f"videos must have one frame rate, got {', '.join(map(str, sorted(rates)))}")
    calibrated(viewing.cameras, [video.size for video in videos])
    found = [Segmentation(video, viewing.extraction, viewing.frames) for video in videos]
    seen = []
    for k, (video, one) in enumerate(zip(videos, found, strict=True)):
        say(f"taking the person out of {video.path}")
        seen.append(video_of(video, one, work / f"view-{k}", progress))
    return seen


def _cameras(one: Camera | str | Path, viewing: Viewing) -> list[Camera]:
    if isinstance(one, Camera):
        return [one]
    known = read_calibrations(one)
    return [calibration.camera(calibration.size, upright(known, viewing.up)) for calibration in known]


def _body(viewing: Viewing) -> Body:
    from posefit.motion.asf import read_asf

    skeleton = library.average_skeleton() if viewing.asf is None else read_asf(viewing.asf)
    body = Body.of(skeleton)
    scale = 1.0 if viewing.height is None else viewing.height / body.stature
    return body.scaled(scale, scale)
