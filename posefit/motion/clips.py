"""The motions that a user names: built-in, recorded, or of files; those that are followed, and those learned from."""

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

FPS = 30.0  # of motions and masks that state no rate
MOTIONS = (".amc", ".bvh")
# that a method takes to learn from a pose: its angles, joints and codes, and copies
POSE_BYTES = 3_000
Source = str | Path | Motion


class FileOptions(NamedTuple):
    """What the files of motions do not state, or state wrongly."""

    asf: str | Path | None = None  # of an .amc; None for the only one beside it
    unit: Unit | None = None  # of lengths; None for the one that is recognised
    # the axis that is up; None for y, or the one that a .bvh's person stands along
    up: Up | None = None
    # frames a second of an .amc; None for what it states, or 120
    rate: float | None = None


RECOGNISED = FileOptions()


@dataclass(frozen=True)
class SourceClip:
    """Gives a motion at any rate, `clip.motion(fps)`; before it is made, `clip.count(fps)` says how long it is."""

    motion: Callable[[float], Motion] = field(repr=False)
    poses: int  # of the motion as it is stored
    fps: float | None  # None for a built-in motion, which has as many at any rate

    def count(self, fps: float) -> int:
        """Return about how many poses the motion has at a rate."""
        return self.poses if self.fps is None else round(self.poses * fps / self.fps)


def clip_of(source: Source, stated: FileOptions = RECOGNISED) -> SourceClip:
    """Return what gives the motion that a source names at any rate: built-in, recorded, or of an .amc or .bvh file.

    A file is read once, now. Raises InputError where there is no such motion.
    """
    if source in built_in.names():
        name = str(source)
        return SourceClip(
            lambda fps: built_in.motion(name, fps=fps), len(built_in.motion(name)), None
        )
    if recorded.is_recorded(source):
        return recorded_clip(recorded.clip(str(source)))
    motion = source if isinstance(source, Motion) else _motion_in(source, stated)
    return SourceClip(motion.resampled, len(motion), motion.fps)


def recorded_clip(clip: recorded.RecordedClip) -> SourceClip:
    """Return what gives a recorded clip's motion at any rate, which is made only then."""
    return SourceClip(
        lambda fps: _resampled(clip, float(fps)),
        int(clip.times[-1]) + 1,
        recorded.FPS,
    )


# those of the whole library at one rate, or at two: 40 MB
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
    if path.exists() or path.suffix or os.sep in str(source):
        expected = "an .amc file, a .bvh file or a built-in motion"
        raise InputError(
            f"{existing(path)}: expected {expected}, got {path.suffix or 'a folder'}"
        )
    return built_in.motion(str(source))  # raises: there is none of that name


def load_motion(
    source: Source, fps: float = FPS, stated: FileOptions = RECOGNISED
) -> Motion:
    """Return the motion that a source names, at a rate: built-in, recorded, or of an .amc or .bvh file.

    Raises InputError where there is no such motion, and where something is stated that only files have use for.
    """
    suffix = (
        ""
        if isinstance(source, Motion) or source in built_in.names()
        else Path(source).suffix.lower()
    )
    for name, value in (("unit", stated.unit), ("up", stated.up)):
        if value is not None and suffix not in MOTIONS:
            raise InputError(
                f"{name} must be given for {' and '.join(MOTIONS)} files only, got {quoted(value)}"
            )
    return clip_of(source, stated).motion(fps)


def skeleton_file(amc: Path, asf: str | Path | None) -> Path:
    """Return the .asf file of an .amc file: the given one, or the only one beside it."""
    if asf is not None:
        return existing(Path(asf))
    existing(amc)
    beside = sorted(amc.parent.glob("*.asf"))
    if len(beside) != 1:
        raise InputError(
            f"{amc}: expected --asf or exactly one .asf file beside it, got {len(beside)}"
        )
    return beside[0]


def training_clips(
    sources: Sequence[Source],
    stated: FileOptions = RECOGNISED,
    *,
    followed: Source | None = None,
) -> list[SourceClip]:
    """Return the clips that sources name, each of which gives its motion at any rate.

    A source is what `clip_of` takes; a folder of .amc files with their .asf, or of .bvh files; or `library`,
    `library:02,16` and `library:-16`: all recorded motions, some people's, all but some people's. The clip that is
    `followed` is left out of a folder and the library. Raises InputError where there is no such motion, where none is
    left, and where they would take more memory than this process may have.
    """
    clips = []
    poses = 0
    most = allowed_bytes()
    for source in sources:
        for clip in _clips(source, stated, followed):
            clips.append(clip)
            poses += clip.count(FPS)
            _check_memory(poses, FPS, most)
    return clips


def training_motions(clips: Sequence[SourceClip], fps: float) -> list[Motion]:
    """Return the motions of clips at a rate. Raises InputError where they would take more memory than there may be."""
    _check_memory(sum(clip.count(fps) for clip in clips), fps, allowed_bytes())
    return [clip.motion(fps) for clip in clips]


def _check_memory(poses: int, fps: float, most: int) -> None:
    """Raise InputError where learning from poses would take more memory, in bytes, than this process may have."""
    if poses * POSE_BYTES > most:
        took = f"{poses * POSE_BYTES / 1e9:.1f} GB for {poses:,} poses at {fps:g} frames a second"
        raise InputError(
            f"train must take at most the {most / 1e9:.1f} GB of memory that there may be, got {took}"
        )


def _clips(
    source: Source, stated: FileOptions, followed: Source | None
) -> Iterator[SourceClip]:
    if isinstance(source, str) and recorded.is_library(source):
        clips = [
            clip for clip in recorded.named(source) if clip.name != _stem(followed)
        ]
        if not clips:
            raise InputError(
                f"train must hold another clip than the source, got {source} for {followed}"
            )
        yield from (recorded_clip(clip) for clip in clips)
    elif not isinstance(source, Motion) and Path(source).is_dir():
        paths = sorted(
            path
            for path in Path(source).iterdir()
            if path.suffix.lower() in MOTIONS and path.is_file()
        )
        if not paths:
            raise InputError(
                f"{source}: expected a folder of {' or '.join(MOTIONS)} files, got none in it"
            )
        others = [path for path in paths if not _same(path, followed)]
        if not others:
            raise InputError(
                f"{source}: expected a folder with another clip than the source, got that one alone"
            )
        yield from (clip_of(path, stated) for path in others)
    elif _same(source, followed):
        raise InputError(f"train must not contain the source itself, got {source}")
    else:
        yield clip_of(source, stated)


def _stem(source: Source | None) -> str | None:
    """Return a clip's name: a recorded one's, or that of a file such as 16_15.amc."""
    return (
        source.name
        if isinstance(source, Motion)
        else None
        if source is None
        else Path(source).stem
    )


def _same(source: Source, other: Source | None) -> bool:
    if isinstance(source, Motion) or isinstance(other, Motion) or other is None:
        return source is other
    return str(source) == str(other) or (
        Path(source).exists() and Path(source).resolve() == Path(other).resolve()
    )
