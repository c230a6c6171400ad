"""What a method learns from: motions by name, whole folders of them, or people of the library."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from posefit.errors import InputError
from posefit.footage.masks import FPS
from posefit.footage.source import MOTIONS, Source, SourceClip, clip_of, recorded_clip
from posefit.limits import allowed_bytes
from posefit.motion import recorded
from posefit.motion.motion import Motion

POSE_BYTES = 3_000  # that a method takes to learn from a pose: its angles, joints and codes, and copies


def training_clips(
    sources: Sequence[Source], asf: str | Path | None = None, *, followed: Source | None = None
) -> list[SourceClip]:
    """Return the clips that sources name, each of which gives its motion at any rate.

    A source is what `clip_of` takes; a folder of .amc files with their .asf, or of .bvh files; or `library`,
    `library:02,16` and `library:-16`: all recorded motions, some people's, all but some people's. The clip that is
    `followed` is left out of a folder and the library. Raises InputError where there is no such motion, where none is
    left, and where they would take more memory than this process may have.
    """
    clips, poses = [], 0
    for source in sources:
        for clip in _clips(source, asf, followed):
            clips.append(clip)
            poses += clip.count(FPS)
            _check_memory(poses, FPS)
    return clips


def training_motions(clips: Sequence[SourceClip], fps: float) -> list[Motion]:
    """Return the motions of clips at a rate. Raises InputError where they would take more memory than there may be."""
    _check_memory(sum(clip.count(fps) for clip in clips), fps)
    return [clip(fps) for clip in clips]


def _check_memory(poses: int, fps: float) -> None:
    """Return nothing. Raises InputError where learning from poses would take more memory than this process may have."""
    most = allowed_bytes()
    if poses * POSE_BYTES > most:
        took = f"{poses * POSE_BYTES / 1e9:.1f} GB for {poses:,} poses at {fps:g} frames a second"
        raise InputError(f"train must take at most the {most / 1e9:.1f} GB of memory that there may be, got {took}")


def _clips(source: Source, asf: str | Path | None, followed: Source | None) -> Iterator[SourceClip]:
    if isinstance(source, str) and recorded.is_library(source):
        clips = [clip for clip in recorded.named(source) if clip.name != _stem(followed)]
        if not clips:
            raise InputError(f"train must hold another clip than the source, got {source} for {followed}")
        yield from (recorded_clip(clip) for clip in clips)
    elif not isinstance(source, Motion) and Path(source).is_dir():
        paths = sorted(path for path in Path(source).iterdir() if path.suffix.lower() in MOTIONS and path.is_file())
        if not paths:
            raise InputError(f"{source}: expected a folder of {' or '.join(MOTIONS)} files, got none in it")
        others = [path for path in paths if not _same(path, followed)]
        if not others:
            raise InputError(f"{source}: expected a folder with another clip than the source, got that one alone")
        yield from (clip_of(path, asf) for path in others)
    elif _same(source, followed):
        raise InputError(f"train must not contain the source itself, got {source}")
    else:
        yield clip_of(source, asf)


def _stem(source: Source | None) -> str | None:
    """Return a clip's name: a recorded one's, or that of a file such as 16_15.amc."""
    return source.name if isinstance(source, Motion) else None if source is None else Path(source).stem


def _same(one: Source, other: Source | None) -> bool:
    if isinstance(one, Motion) or isinstance(other, Motion) or other is None:
        return one is other
    return str(one) == str(other) or (Path(one).exists() and Path(one).resolve() == Path(other).resolve())
