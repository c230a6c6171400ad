"""The motions of the SAPSO paper: CMU clips from a folder or posefit's library.

The library stores a clip's poses at 30 frames a second to within a centimetre. Between
them angles are interpolated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.scene import Scene, synthetic
from posefit.motion.clips import load_motion
from posefit.motion.motion import Motion
from posefit.sweep.cell import digest_of

SIZE = (320, 240)  # pixels
# ours, because the paper gives no rate: at this one, a clip of a walk has more than the
# 100 frames, and a clip of a run nearly as many
FPS = 60.0
# the test clip and the training clips; each person has only one run, so the run's prior
# learns from others
CLIPS = {
    "walk": ("16/16_15", ("16/16_17",)),
    "turn": ("16/16_17", ("16/16_15",)),
    "run": ("16/16_35", ("09/09_01", "127/127_03")),
}
ALL_CLIPS: list[str] = []
for _test, _training in CLIPS.values():
    ALL_CLIPS += [_test, *_training]
# the first tracked frame: 16_15 begins with an arm held out that is gone 1/60 s later,
# and the person of 16_17 walks straight on for two seconds before the quarter turn
FIRST = {"walk": 1, "turn": 120, "run": 1}
LABELS = {"walk": "walk", "turn": "walk with a turn", "run": "run"}


@dataclass(frozen=True, eq=False)
class PaperMotion:
    """A motion to track, and the motions from which a prior may learn."""

    test: Motion
    training: Sequence[Motion] = field(repr=False)

    @property
    def angles(self) -> Array:
        """The joint angles (n, 63) from which a prior may learn."""
        return np.concatenate([motion.poses[:, 3:] for motion in self.training])


def paper_motions(clips: str | Path | None, frames: int) -> dict[str, PaperMotion]:
    """Return the three motions, each of `frames` frames or as many as there are.

    Raises InputError if `clips` is not a folder with the CMU clips.
    """
    for clip in ALL_CLIPS:
        if clips is not None and not (Path(clips) / f"{clip}.amc").is_file():
            raise InputError(
                f"clips must be a folder of CMU clips such as {clip}.amc, "
                f"got {clips}, which has none"
            )
    motions = {}
    for name, (test, training) in CLIPS.items():
        first = _clip(clips, test)
        followed = first.frames(FIRST[name], min(FIRST[name] + frames, len(first)))
        others = []
        for clip in training:
            motion = _clip(clips, clip)
            others.append(motion.frames(1, len(motion)))
        motions[name] = PaperMotion(followed, others)
    return motions


def digests(clips: str | Path | None) -> str | list[str]:
    """Return the identity of the clips: "library", or digests of the files."""
    if clips is None:
        return "library"
    paths = [Path(clips) / f"{clip}.amc" for clip in ALL_CLIPS]
    identities = []
    for path in paths:
        for file in (path, *sorted(path.parent.glob("*.asf"))):
            identities.append(digest_of(file)[:8])
    return identities


def _clip(folder: str | Path | None, clip: str) -> Motion:
    if folder is None:
        return load_motion(clip.partition("/")[2], FPS)
    return load_motion(Path(folder) / f"{clip}.amc", FPS)


def paper_scene(motion: PaperMotion, view: float, frames: int | None = None) -> Scene:
    """Return the scene of a motion, or of its first frames, seen by a camera."""
    test = motion.test
    if frames is not None:
        test = test.frames(0, frames)
    return synthetic(test, [view], SIZE, [], (None, None))
