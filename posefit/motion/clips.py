"""Finds the motions that a user names: built-in, recorded, or of files.

They are the motions to follow, and the motions to learn from.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from posefit.errors import InputError
from posefit.geometry.calibration import Up
from posefit.geometry.units import Unit
from posefit.limits import allowed_bytes
from posefit.motion import built_in, recorded
from posefit.motion.amc import read_clip
from posefit.motion.bvh import read_bvh
from posefit.motion.motion import Motion
from posefit.reading import existing, quoted

FPS = 30.0  # rate of motions and masks that state none
MOTIONS = (".amc", ".bvh")
# memory for each pose that a method learns from: angles, joints, codes, and copies
POSE_BYTES = 3_000
Source = str | Path | Motion


class FileOptions(NamedTuple):
    """What motion files do not state, or state wrongly.

    Attributes:
        asf: Skeleton of an .amc file; None for the only .asf file in its folder.
        unit: Length unit; None to recognise it.
        up: Axis that points up; None for y, or in a .bvh file for the axis along which
            the person stands.
        rate: Frames per second of an .amc file; None for the stated rate, or 120.
    """

    asf: str | Path | None = None
    unit: Unit | None = None
    up: Up | None = None
    rate: float | None = None


RECOGNISED = FileOptions()


@dataclass(frozen=True)
class SourceClip:
    """A motion that can be sampled at any rate.

    Attributes:
        motion: `clip.motion(fps)` makes the motion.
        poses: How many poses are stored.
        fps: Rate of the stored poses; None for a built-in motion, which has the same
            number of poses at any rate.
    """

    motion: Callable[[float], Motion] = field(repr=False)
    poses: int
    fps: float | None

    def count(self, fps: float) -> int:
        """Return about how many poses the motion has at a rate, without making it."""
        if self.fps is None:
            return self.poses
        return round(self.poses * fps / self.fps)


def clip_of(source: Source, stated: FileOptions = RECOGNISED) -> SourceClip:
    """Return the clip that a source names. A file is read once, now.

    Args:
        source: A built-in or recorded motion's name, an .amc or .bvh file, or a motion.
        stated: Information that the file lacks.

    Raises:
        InputError: There is no such motion.
    """
    if source in built_in.names():
        name = str(source)
        return SourceClip(
            lambda fps: built_in.motion(name, fps=fps), len(built_in.motion(name)), None
        )
    if recorded.is_recorded(source):
        return recorded_clip(recorded.clip(str(source)))
    if isinstance(source, Motion):
        motion = source
    else:
        motion = _motion_in(source, stated)
    return SourceClip(motion.resampled, len(motion), motion.fps)


def recorded_clip(clip: recorded.RecordedClip) -> SourceClip:
    """Return a recorded clip, whose motion is made only on demand."""
    return SourceClip(
        lambda fps: _resampled(clip, float(fps)),
        int(clip.times[-1]) + 1,
        recorded.FPS,
    )


# contains the whole library at two rates: 40 MB
@lru_cache(maxsize=512)
def _resampled(clip: recorded.RecordedClip, fps: float) -> Motion:
    return clip.motion().resampled(fps)


def _motion_in(source: str | Path, stated: FileOptions) -> Motion:
    path = Path(source)
    if path.suffix.lower() == ".amc":
        skeleton = skeleton_file(path, stated.asf)
        return read_clip(
            skeleton, existing(path), fps=stated.rate, unit=stated.unit, up=stated.up
        )
    if path.suffix.lower() == ".bvh":
        return read_bvh(existing(path), unit=stated.unit, up=stated.up)
    # a bare word may be a misspelt built-in motion, whose message lists the names
    if path.exists() or path.suffix or os.sep in str(source):
        expected = "an .amc file, a .bvh file or a built-in motion"
        raise InputError(
            f"{existing(path)}: expected {expected}, got {path.suffix or 'a folder'}"
        )
    return built_in.motion(str(source))  # raises an error with all names


def load_motion(
    source: Source, fps: float = FPS, stated: FileOptions = RECOGNISED
) -> Motion:
    """Return the motion that a source names, at a rate.

    Args:
        source: A built-in or recorded motion's name, an .amc or .bvh file, or a motion.
        fps: Frames per second.
        stated: Information that the file lacks.

    Returns:
        The motion.

    Raises:
        InputError: There is no such motion, or unit or up is given for a source that is
            not a file.

    Example:
        >>> from posefit import load_motion
        >>> motion = load_motion("walk", fps=60.0)
        >>> motion.fps, motion.poses.shape[1]
        (60.0, 66)
    """
    suffix = ""
    if not isinstance(source, Motion) and source not in built_in.names():
        suffix = Path(source).suffix.lower()
    for name, value in (("unit", stated.unit), ("up", stated.up)):
        if value is not None and suffix not in MOTIONS:
            raise InputError(
                f"{name} applies only to {' and '.join(MOTIONS)} files, "
                f"got {quoted(value)}: leave it out"
            )
    return clip_of(source, stated).motion(fps)


def skeleton_file(amc: Path, asf: str | Path | None) -> Path:
    """Return the .asf file of an .amc file: `asf`, or the only one in its folder."""
    if asf is not None:
        return existing(Path(asf))
    existing(amc)
    files = amc.parent.iterdir()
    found = [file for file in files if file.suffix.lower() == ".asf"]
    if len(found) != 1:
        raise InputError(
            f"{amc}: expected --asf or exactly one .asf file in its folder, "
            f"got {len(found)}"
        )
    return found[0]


def training_clips(
    sources: Sequence[Source],
    stated: FileOptions = RECOGNISED,
    *,
    followed: Source | None = None,
) -> list[SourceClip]:
    """Return the clips that sources name.

    Args:
        sources: Each is what `clip_of` takes; or a folder of .amc files with their
            .asf, or of .bvh files; or `library` for all recorded motions,
            `library:02,16` for some people's, `library:-16` for all but some people's.
        stated: Information that the files lack.
        followed: The motion that is followed. A folder and the library are used
            without it.

    Raises:
        InputError: There is no such motion, none is left, or the motions would take
            more memory than this process may use.
    """
    clips = []
    poses = 0
    most = allowed_bytes()
    for source in sources:
        for clip in _clips(source, stated, followed):
            clips.append(clip)
            poses += clip.count(FPS)
            # after each clip, so that a folder of too many is refused before all are
            # read
            _check_memory(poses, FPS, most)
    return clips


def training_motions(clips: Sequence[SourceClip], fps: float) -> list[Motion]:
    """Return the motions of clips at a rate.

    Raises:
        InputError: They would take more memory than this process may use.
    """
    _check_memory(sum(clip.count(fps) for clip in clips), fps, allowed_bytes())
    return [clip.motion(fps) for clip in clips]


def _check_memory(poses: int, fps: float, most: int) -> None:
    """Raise InputError if learning from poses takes more than `most` bytes."""
    if poses * POSE_BYTES > most:
        took = f"{poses * POSE_BYTES / 1e9:.1f} GB for {poses:,} poses"
        raise InputError(
            f"train must take at most the {most / 1e9:.1f} GB of memory that posefit "
            f"may use, got {took} at {fps:g} frames a second"
        )


def _clips(
    source: Source, stated: FileOptions, followed: Source | None
) -> Iterator[SourceClip]:
    # the followed motion is left out of the library and of folders without a word; to
    # name it is a mistake
    if isinstance(source, str) and recorded.is_library(source):
        stem = _stem(followed)
        clips = [clip for clip in recorded.named(source) if clip.name != stem]
        if not clips:
            raise InputError(
                "train must contain a clip other than the source, "
                f"got {source} for {followed}"
            )
        for clip in clips:
            yield recorded_clip(clip)
    elif not isinstance(source, Motion) and Path(source).is_dir():
        paths = []
        for path in sorted(Path(source).iterdir()):
            if path.suffix.lower() in MOTIONS and path.is_file():
                paths.append(path)
        if not paths:
            raise InputError(
                f"{source}: expected a folder of {' or '.join(MOTIONS)} files, "
                "got a folder without any"
            )
        others = [path for path in paths if not _same(path, followed)]
        if not others:
            raise InputError(
                f"{source}: expected a folder with a clip other than the source, "
                "got only that clip"
            )
        for path in others:
            yield clip_of(path, stated)
    elif _same(source, followed):
        raise InputError(f"train must not contain the source itself, got {source}")
    else:
        yield clip_of(source, stated)


def _stem(source: Source | None) -> str | None:
    """Return the name of a recorded clip, or of a file such as 16_15.amc."""
    if isinstance(source, Motion):
        return source.name
    if source is None:
        return None
    return Path(source).stem


def _same(source: Source, other: Source | None) -> bool:
    if isinstance(source, Motion) or isinstance(other, Motion) or other is None:
        return source is other
    return str(source) == str(other) or (
        Path(source).exists() and Path(source).resolve() == Path(other).resolve()
    )
