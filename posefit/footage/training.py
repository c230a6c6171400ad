"""What a method learns from: motions by name, whole folders of them, or people of the library."""

from collections.abc import Callable, Sequence
from pathlib import Path

from posefit.footage.source import MOTIONS, Source, clip_of
from posefit.motion import recorded
from posefit.motion.motion import Motion

Clip = Callable[[float], Motion]  # gives a motion at any rate


def training_clips(sources: Sequence[Source], asf: str | Path | None = None) -> list[Clip]:
    """Return the clips that sources name, each of which gives its motion at any rate.

    A source is what `clip_of` takes; a folder of .amc files with their .asf, or of .bvh files; or `library`,
    `library:02,16` and `library:-16`: all recorded motions, some people's, all but some people's. Raises ValueError
    where there is no such motion.
    """
    return [clip for source in sources for clip in _clips(source, asf)]


def _clips(source: Source, asf: str | Path | None) -> list[Clip]:
    if isinstance(source, str) and recorded.is_library(source):
        return [one.motion().resampled for one in recorded.named(source)]
    if not isinstance(source, Motion) and Path(source).is_dir():
        found = sorted(path for path in Path(source).iterdir() if path.suffix.lower() in MOTIONS)
        if not found:
            raise ValueError(f"{source}: expected a folder of {' or '.join(MOTIONS)} files, got none in it")
        return [clip_of(path, asf) for path in found]
    return [clip_of(source, asf)]
