"""What a user names, a motion or what one camera or several saw, becomes a scene, once."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from numbers import Real
from pathlib import Path
from typing import Literal, Self

import numpy as np

from posefit.fitting.check import finite_number, pair
from posefit.footage.cameras import CameraView, calibrated, combined, masks_of, video_of
from posefit.footage.masks import FPS, Range, existing
from posefit.footage.readers import IMAGES
from posefit.footage.scene import Scene, synthetic
from posefit.footage.segmentation import Extraction, Segmentation
from posefit.footage.video import Video
from posefit.geometry.body import Body
from posefit.geometry.calibration import Up, read_calibrations, upright
from posefit.geometry.camera import Camera
from posefit.listening import QUIET, Listener
from posefit.motion import built_in, recorded
from posefit.motion.motion import RATES, Motion
from posefit.reading import quoted

MOTIONS = (".amc", ".bvh")
NO_VIDEO = (*IMAGES, *MOTIONS, ".npz", ".asf", ".json", ".csv", ".txt")
SIZE = (320, 240)  # pixels of a rendered picture
HEIGHTS = (0.3, 2.8)  # metres that a person may stand
Kind = Literal["motion", "masks", "video"]
_KINDS: dict[Kind, str] = {"motion": "a motion", "masks": "masks", "video": "a video"}
Source = str | Path | Motion


@dataclass(frozen=True, kw_only=True)
class Viewing:
    """How a source is looked at.

    `cameras`, or calibration files, one a view; `view_degrees` from where, where no camera says; the `size` of
    rendered pictures, by default 320 x 240; the rate `fps` of motions and masks, by default 30 or what a file of masks
    states; which `frames`. For real footage: its `extraction`, how tall the person stands in metres (`height`), and
    which axis of the calibration's world points up (`up`). For masks: the `label` that the person has, where there are
    several, and the largest of his `holes` that is filled, as a share of his area.
    """

    asf: str | Path | None = None
    cameras: Sequence[Camera | str | Path] = ()
    view_degrees: Sequence[float] = ()
    size: tuple[int, int] | None = None
    fps: float | None = None
    frames: Range = (None, None)
    extraction: Extraction | None = None
    height: float | None = None
    up: Up | None = None
    label: int | None = None
    holes: float | None = None

    def __post_init__(self) -> None:
        for degrees in self.view_degrees:
            finite_number("view_degrees", degrees)
        if self.fps is not None and not (isinstance(self.fps, Real) and 0.0 < self.fps < np.inf):
            raise ValueError(f"fps must be a positive number, got {quoted(self.fps)}")
        if self.fps is not None and not RATES[0] <= self.fps <= RATES[1]:
            raise ValueError(f"fps must lie in {RATES[0]:g} to {RATES[1]:g}, got {quoted(self.fps)}")
        sides = pair("size", SIZE if self.size is None else self.size, "(width, height)")
        if not all(isinstance(side, int | np.integer) and 1 <= side <= 16_384 for side in sides):
            raise ValueError(f"size must be from 1x1 to 16384x16384 pixels, got {sides[0]}x{sides[1]}")
        for end in pair("frames", self.frames, "(start, stop), either of which may be None"):
            if end is not None and (isinstance(end, bool) or not isinstance(end, int | np.integer)):
                raise ValueError(f"frames must be two whole numbers or None, got {quoted(self.frames)}")
        if self.label is not None and (isinstance(self.label, bool) or not isinstance(self.label, int | np.integer)):
            raise ValueError(f"label must be a whole number, got {quoted(self.label)}")
        if self.holes is not None and not 0.0 <= finite_number("holes", self.holes) <= 1.0:
            raise ValueError(f"holes must lie in 0 to 1, a share of the person's area, got {self.holes}")
        if self.height is not None and not HEIGHTS[0] <= finite_number("height", self.height) <= HEIGHTS[1]:
            raise ValueError(f"height must lie in {HEIGHTS[0]} to {HEIGHTS[1]} metres, got {self.height}")

    def check_used(self, kind: Kind) -> None:
        """Return nothing. Raises ValueError where something was given that sources of this kind have no use for."""
        useless: list[tuple[str, object, str]] = []
        if kind != "video":
            useless.append(("extraction", self.extraction, "video"))
        if kind == "video":
            useless.append(("fps", self.fps, "motions and masks"))
        if kind != "masks":
            useless += [("label", self.label, "masks"), ("holes", self.holes, "masks")]
        if kind == "motion":
            useless.append(("height", self.height, "footage"))
        else:
            useless.append(("size", self.size, "motions"))
        if not self.cameras:
            useless.append(("up", self.up, "calibrations"))
        for name, value, where in useless:
            if value is not None:
                raise useless_for(kind, name, value, where)


def useless_for(kind: Kind, name: str, value: object, where: str) -> ValueError:
    """Return the error of an option that sources of this kind have no use for, and says for which it is given."""
    return ValueError(f"{name} must be given for {where} only, got {quoted(value)} for {_KINDS[kind]}")


def scene_of(sources: Sequence[Source], viewing: Viewing, listener: Listener = QUIET) -> Scene:
    """Return the scene of a source, or of what several cameras saw at the same times.

    Raises ValueError where something does not fit.
    """
    kinds = {kind_of(source) for source in sources}
    if len(kinds) > 1:
        raise ValueError(f"sources must be of one kind, got {' and '.join(sorted(kinds))}")
    viewing.check_used(next(iter(kinds)))
    if kinds == {"motion"}:
        return _known(sources, viewing)
    if len(viewing.view_degrees) > 1:
        raise ValueError(f"view_degrees must be one for footage, of its first camera, got {len(viewing.view_degrees)}")
    paths = [Path(source) for source in sources if not isinstance(source, Motion)]
    if kinds == {"video"}:
        views = _filmed(paths, viewing, listener)
    else:
        calibrated(viewing.cameras, [None] * len(paths))
        views = [masks_of(path, viewing.frames, viewing.label, viewing.holes) for path in paths]
    facing = viewing.view_degrees[0] if viewing.view_degrees else None
    return combined(views, paths[0].stem, _body(viewing), viewing.cameras, facing, viewing.up, viewing.fps)


def _known(sources: Sequence[Source], viewing: Viewing) -> Scene:
    """Return the scene of a motion, which cameras see that stand where they are told."""
    if len(sources) > 1:
        raise ValueError(f"source must be one motion, or views of one person, got {len(sources)} motions")
    cameras = [camera for one in viewing.cameras for camera in _cameras(one, viewing)]
    motion = motion_of(sources[0], viewing.asf, viewing.fps or FPS)
    return synthetic(motion, viewing.view_degrees, viewing.size or SIZE, cameras, viewing.frames)


@dataclass(frozen=True)
class SourceClip:
    """Gives a motion at any rate, which is `clip(fps)`; before it is made, `clip.count(fps)` says how long it is."""

    motion: Callable[[float], Motion] = field(repr=False)
    poses: int  # of the motion as it is stored
    fps: float | None  # None for a built-in motion, which has as many at any rate

    def __call__(self, fps: float) -> Motion:
        """Return the motion at a rate."""
        return self.motion(fps)

    @classmethod
    def of(cls, motion: Motion) -> Self:
        """Return the clip of a motion."""
        return cls(motion.resampled, len(motion), motion.fps)

    @classmethod
    def of_recorded(cls, clip: recorded.RecordedClip) -> Self:
        """Return that of a recorded clip, whose motion is made when it is asked for."""
        return cls(lambda fps: clip.motion().resampled(fps), int(clip.times[-1]) + 1, recorded.FPS)

    def count(self, fps: float) -> int:
        """Return about how many poses the motion has at a rate."""
        return self.poses if self.fps is None else round(self.poses * fps / self.fps)


def clip_of(source: Source, asf: str | Path | None = None) -> SourceClip:
    """Return what gives the motion that a source names at any rate: built-in, recorded, or of an .amc or .bvh file.

    A file is read once, now; the .asf of an .amc is `asf`, or the only one beside it. Raises ValueError where there is
    no such motion.
    """
    if isinstance(source, Motion):
        return SourceClip.of(source)
    if source in built_in.names():
        return SourceClip(partial(_built_in, str(source)), len(built_in.motion(str(source))), None)
    if recorded.is_recorded(source):
        return SourceClip.of_recorded(recorded.clip(str(source)))
    path = Path(source)
    if path.suffix.lower() == ".amc":
        from posefit.motion.amc import read_clip

        return SourceClip.of(read_clip(_skeleton_file(path, asf), existing(path)))
    if path.suffix.lower() == ".bvh":
        from posefit.motion.bvh import read_bvh

        return SourceClip.of(read_bvh(existing(path)))
    if path.exists() or path.suffix or _has_folders(source):
        existing(path)
        raise ValueError(
            f"{path}: expected an .amc file, a .bvh file or a built-in motion, got {path.suffix or 'a folder'}"
        )
    return SourceClip.of(built_in.motion(str(source)))  # raises: there is none of that name


def motion_of(source: Source, asf: str | Path | None, fps: float) -> Motion:
    """Return the motion that a source names, at `fps`; see `clip_of`."""
    return clip_of(source, asf)(fps)


def kind_of(source: Source) -> Kind:
    """Return what a source names: a built-in motion's name is never a folder, and what is no other file is video.

    A name with folders in it and no suffix is a folder's, even where there is none.
    """
    if isinstance(source, Motion) or source in built_in.names() or recorded.is_recorded(source):
        return "motion"
    path = Path(source)
    if path.is_dir() or path.suffix.lower() == ".npz" or (not path.suffix and _has_folders(source)):
        return "masks"
    return "video" if path.suffix and path.suffix.lower() not in NO_VIDEO else "motion"


def _has_folders(source: str | Path) -> bool:
    """Return whether a name is a path beyond doubt: with a separator, if only at its end."""
    return os.sep in str(source)


def _filmed(paths: Sequence[Path], viewing: Viewing, listener: Listener) -> list[CameraView]:
    """Return what videos show, after everything that a user may have got wrong was checked."""
    videos = [Video.of(path) for path in paths]
    rates = {round(video.fps, 3) for video in videos}
    if len(rates) > 1:
        raise ValueError(f"videos must have one frame rate, got {', '.join(map(str, sorted(rates)))}")
    calibrated(viewing.cameras, [video.size for video in videos])
    segmentations = [Segmentation(video, viewing.extraction or Extraction(), viewing.frames) for video in videos]
    views = []
    for video, segmentation in zip(videos, segmentations, strict=True):
        listener.say(f"taking the person out of {video.path}")
        views.append(video_of(video, segmentation, listener))
    return views


def _cameras(one: Camera | str | Path, viewing: Viewing) -> list[Camera]:
    if isinstance(one, Camera):
        return [one]
    known = read_calibrations(one)
    return [calibration.camera(calibration.size, upright(known, viewing.up)) for calibration in known]


def _body(viewing: Viewing) -> Body:
    from posefit.motion.asf import read_asf

    skeleton = built_in.average_skeleton() if viewing.asf is None else read_asf(viewing.asf)
    body = Body.of(skeleton)
    scale = 1.0 if viewing.height is None else viewing.height / body.stature
    return body.scaled(scale, scale)


def _built_in(name: str, fps: float) -> Motion:
    return built_in.motion(name, fps=fps)


def _skeleton_file(amc: Path, asf: str | Path | None) -> Path:
    if asf is not None:
        return existing(Path(asf))
    existing(amc)
    beside = sorted(amc.parent.glob("*.asf"))
    if len(beside) != 1:
        raise ValueError(f"{amc}: expected --asf or exactly one .asf file beside it, got {len(beside)}")
    return beside[0]
