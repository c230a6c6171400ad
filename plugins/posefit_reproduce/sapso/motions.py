"""The motions of the SAPSO paper's experiments: CMU clips where a folder of them is given, else built-in ones."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.masks import Range
from posefit.footage.scene import Scene, synthetic
from posefit.motion import built_in
from posefit.motion.clips import load_motion
from posefit.motion.motion import Motion
from posefit_reproduce.sapso.paper import TRAINING_FRAMES, FirstYaw

SIZE = (320, 240)  # pixels
FPS = 60.0  # not in the paper; at this rate a clip of a walk has more than the 100 frames, and of a run nearly
TURN = 90.0  # degrees, of the built-in walk with a turn
# the clip, and those that its prior learns from; there is one run of each person, so its prior knows only others
CLIPS = {
    "walk": ("16/16_15", ("16/16_17",)),
    "turn": ("16/16_17", ("16/16_15",)),
    "run": ("16/16_35", ("09/09_01", "127/127_03")),
}
BROKEN = 1  # frames left out at the start of every clip: 16_15 begins with an arm held out that is gone 1/60 s later
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
    """Return the three motions, each of its first `frames` or as many as there are.

    Raises ValueError where `clips` is no folder with the CMU clips that are wanted.
    """
    made = {name: _built_in(name, frames) if clips is None else _from_clips(clips, name) for name in CLIPS}
    return {name: replace(one, test=one.test.frames(0, min(frames, len(one.test)))) for name, one in made.items()}


def _from_clips(folder: str | Path, name: str) -> PaperMotion:
    test, training = CLIPS[name]
    paths = [Path(folder) / f"{clip}.amc" for clip in (test, *training)]
    for clip, path in zip((test, *training), paths, strict=True):
        if not path.is_file():
            raise InputError(f"clips must be a folder of CMU clips such as {clip}.amc, got {folder}, which has none")
    motions = [load_motion(path, FPS) for path in paths]
    motions = [motion.frames(BROKEN, len(motion)) for motion in motions]
    return PaperMotion(motions[0], motions[1:])


def _built_in(name: str, frames: int) -> PaperMotion:
    kind = "run" if name == "run" else "walk"
    styles = built_in.other_styles(kind)
    test = built_in.motion(kind, frames=frames, fps=FPS)
    if name == "turn":
        test = turned(built_in.motion(kind, frames=frames, fps=FPS, speed=0.9, phase=0.3), TURN)
    count = round(TRAINING_FRAMES[name] / len(styles))
    return PaperMotion(test, [built_in.motion(style, frames=count, fps=FPS) for style in styles])


def paper_scene(motion: PaperMotion, view: float, frames: Range = (None, None), first_yaw: FirstYaw = "known") -> Scene:
    """Return a motion as a camera sees it. Interpretation S17."""
    scene = synthetic(motion.test, [view], SIZE, [], frames)
    return scene if first_yaw == "known" else replace(scene, yaw=None)


def turned(motion: Motion, degrees: float) -> Motion:
    """Return a motion along a bend: the person has turned left by so many degrees in the last frame."""
    yaw = np.linspace(0.0, np.radians(degrees), len(motion))
    poses, steps = motion.poses.copy(), np.diff(motion.translations, axis=0, prepend=motion.translations[:1])
    poses[:, 0] += yaw
    cos, sin = np.cos(yaw), np.sin(yaw)
    bent = np.column_stack([cos * steps[:, 0] + sin * steps[:, 2], steps[:, 1], cos * steps[:, 2] - sin * steps[:, 0]])
    return Motion(
        f"{motion.name}, turning", motion.skeleton, poses, motion.translations[0] + bent.cumsum(axis=0), motion.fps
    )
