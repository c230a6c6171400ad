"""The motions of the SAPSO paper's experiments: CMU clips of a folder, else the same ones of posefit's own library.

The library keeps a clip's poses at 30 frames a second to within a centimetre; between them angles are interpolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.scene import Scene, synthetic
from posefit.footage.views import Range
from posefit.motion.clips import load_motion
from posefit.motion.motion import Motion
from posefit.sweep.cell import digest_of

SIZE = (320, 240)  # pixels
# not in the paper; at this rate a clip of a walk has more than the 100 frames, and of a
# run nearly
FPS = 60.0
# the clip, and those that its prior learns from; there is one run of each person, so its prior knows only others
CLIPS = {
    "walk": ("16/16_15", ("16/16_17",)),
    "turn": ("16/16_17", ("16/16_15",)),
    "run": ("16/16_35", ("09/09_01", "127/127_03")),
}
ALL_CLIPS = [clip for test, training in CLIPS.values() for clip in (test, *training)]
# the first frame that is followed: 16_15 begins with an arm held out that is gone 1/60 s later, and the person of 16_17
# walks straight on for two seconds before turning by a quarter
FIRST = {"walk": 1, "turn": 120, "run": 1}
LABELS = {"walk": "walk", "turn": "walk with a turn", "run": "run"}


@dataclass(frozen=True, eq=False)
class PaperMotion:
    """A motion to follow, and what a prior may learn from."""

    test: Motion
    training: Sequence[Motion] = field(repr=False)

    @property
    def angles(self) -> Array:
        """The joint angles (n, 63) that may be learned from."""
        return np.concatenate([motion.poses[:, 3:] for motion in self.training])


def paper_motions(clips: str | Path | None, frames: int) -> dict[str, PaperMotion]:
    """Return the three motions, each of so many `frames` or as many as there are.

    Raises ValueError where `clips` is no folder with the CMU clips that are wanted.
    """
    for clip in ALL_CLIPS:
        if clips is not None and not (Path(clips) / f"{clip}.amc").is_file():
            raise InputError(
                f"clips must be a folder of CMU clips such as {clip}.amc, got {clips}, which has none"
            )
    motions = {}
    for name, (test, training) in CLIPS.items():
        first, *others = (_clip(clips, clip) for clip in (test, *training))
        followed = first.frames(FIRST[name], min(FIRST[name] + frames, len(first)))
        motions[name] = PaperMotion(
            followed, [motion.frames(1, len(motion)) for motion in others]
        )
    return motions


def digests(clips: str | Path | None) -> str | list[str]:
    """Return what clips are: `library`, or digests of the files of a folder that are read."""
    if clips is None:
        return "library"
    paths = [Path(clips) / f"{clip}.amc" for clip in ALL_CLIPS]
    return [
        digest_of(file)[:8]
        for path in paths
        for file in (path, *sorted(path.parent.glob("*.asf")))
    ]


def _clip(folder: str | Path | None, clip: str) -> Motion:
    return load_motion(
        clip.partition("/")[2] if folder is None else Path(folder) / f"{clip}.amc", FPS
    )


def paper_scene(
    motion: PaperMotion, view: float, frames: Range = (None, None)
) -> Scene:
    """Return a motion as a camera sees it."""
    return synthetic(motion.test, [view], SIZE, [], frames)
