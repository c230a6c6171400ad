"""The library of recorded motions: clips of ten people, so that you need no recordings.

The people walk, run, jump, turn, dance, fight, sweep the floor, and imitate animals.
`docs/studies/make_library.py` made the file from clips of the CMU database. A clip
keeps only the poses that interpolation needs to place every joint within about a
centimetre. The data used in this project was obtained from mocap.cs.cmu.edu. The
database was created with funding from NSF EIA-0196217.

    from posefit.motion import recorded

    others = recorded.clips(without=("16",))  # like recorded.named("library:-16")
    print(others[0].name, others[0].poses.shape, others[0].times[:4])
    walk = recorded.clip("16_15").motion()  # a motion of 30 frames per second
"""

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.skeleton import (
    ANGLES,
    Skeleton,
)
from posefit.motion.built_in import stored_skeleton
from posefit.motion.motion import Motion
from posefit.reading import quoted

FPS = 30.0  # frames per second that the times of clips count
LIBRARY = "library"  # the name of all clips among the names of motions
STEP = 0.001  # radians or metres: unit of the stored whole numbers
_NAME = re.compile(r"\d+_\d+")


@dataclass(frozen=True, eq=False)
class RecordedClip:
    """The stored poses of one clip, in order. Arrays are read-only.

    Attributes:
        name: Subject and clip, such as 16_15.
        subject: The person's number in the CMU database.
        skeleton: The skeleton of the person.
        steps: Stored whole numbers (K, 69), of angles and of the root joint.
        times: Frames (K,) since the first pose, at 30 frames per second.
    """

    name: str
    subject: str
    skeleton: Skeleton = field(repr=False)
    steps: NDArray[np.int16] = field(repr=False)
    times: NDArray[np.int64] = field(repr=False)

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def poses(self) -> Array:
        """The angles (K, 66) in radians."""
        return np.asarray(STEP * self.steps[:, :ANGLES])

    @property
    def translations(self) -> Array:
        """The root joint (K, 3) in metres."""
        return np.asarray(STEP * self.steps[:, ANGLES:])

    @property
    def seconds(self) -> float:
        """The clip's duration."""
        return float(self.times[-1]) / FPS

    def motion(self) -> Motion:
        """Return the whole clip at 30 frames per second."""
        poses, translations = self.at(np.arange(self.times[-1] + 1))
        return Motion(self.name, self.skeleton, poses, translations, FPS)

    def at(self, frames: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the poses (n, 66) and translations (n, 3) at some frames.

        Values between the stored poses are interpolated. After the last pose it is
        held.

        Args:
            frames: Frames (n,) since the first pose, at 30 frames per second.
        """
        frames = np.minimum(frames, self.times[-1])
        second_last = max(len(self) - 2, 0)
        before = np.minimum(
            np.searchsorted(self.times, frames, "right") - 1, second_last
        )
        after = np.minimum(before + 1, len(self) - 1)
        gap = np.maximum(self.times[after] - self.times[before], 1)
        share = ((frames - self.times[before]) / gap)[:, None]
        weight = 1.0 - share  # (n, 1)
        values = STEP * self.steps
        values = weight * values[before] + share * values[after]
        return values[:, :ANGLES], values[:, ANGLES:]


@lru_cache(maxsize=1)
def _stored() -> dict[str, RecordedClip]:
    with (
        (files("posefit.motion") / "recorded.npz").open("rb") as file,
        np.load(file) as stored,
    ):
        skeletons_json = json.loads(str(stored["skeletons"]))
        names = stored["names"].tolist()
        owners = stored["owners"].tolist()
        ends = np.cumsum(stored["counts"], dtype=np.int64)
        changes = stored["changes"].T.astype(np.int64)
        gaps = stored["gaps"].astype(np.int64)
    skeletons = []
    for skeleton in skeletons_json:
        skeletons.append(stored_skeleton(skeleton["name"], skeleton))
    clips = {}
    for name, owner, start, stop in zip(
        names, owners, [0, *ends[:-1].tolist()], ends.tolist(), strict=True
    ):
        # 16 bits hold up to 32 radians or metres, in a quarter of the memory of floats
        steps = np.cumsum(changes[start:stop], axis=0).astype(np.int16)
        times = np.cumsum(gaps[start:stop])
        for array in (steps, times):
            array.setflags(write=False)
        skeleton = skeletons[owner]
        clips[name] = RecordedClip(name, skeleton.name, skeleton, steps, times)
    return clips


def subjects() -> tuple[str, ...]:
    """Return the people of the library, with the CMU database's numbers."""
    return tuple(dict.fromkeys(clip.subject for clip in _stored().values()))


def is_recorded(name: object) -> bool:
    """Return whether a name is a recorded clip's."""
    return (
        isinstance(name, str)
        and _NAME.fullmatch(name) is not None
        and name in _stored()
    )


def clip(name: str) -> RecordedClip:
    """Return the clip with a name such as 16_15.

    Raises:
        InputError: There is no such clip.
    """
    if not is_recorded(name):
        raise InputError(
            f"a recorded motion must be listed by posefit motions, got {quoted(name)}"
        )
    return _stored()[name]


def clips(
    only: Iterable[str] = (), without: Iterable[str] = ()
) -> Sequence[RecordedClip]:
    """Return the clips of some people.

    Args:
        only: The people, all by default.
        without: People to leave out.

    Raises:
        InputError: A person is not in the library, or nobody is left.
    """
    people = subjects()
    only = tuple(only) or people
    without = tuple(without)
    for subject in (*only, *without):
        if subject not in people:
            raise InputError(
                f"a subject of the library must be one of {', '.join(people)}, "
                f"got {quoted(subject)}"
            )
    chosen = []
    for clip in _stored().values():
        if clip.subject in only and clip.subject not in without:
            chosen.append(clip)
    if not chosen:
        raise InputError(
            "at least one person of the library must remain, got all of them left out"
        )
    return chosen


def is_library(name: object) -> bool:
    """Return whether a name means the library, such as `library` or `library:-16`."""
    return isinstance(name, str) and name.partition(":")[0] == LIBRARY


def named(name: str) -> Sequence[RecordedClip]:
    """Return the clips that a library name selects.

    Args:
        name: `library`; `library:02,16` for some people; `library:-16` for all but
            some.

    Raises:
        InputError: A person is not in the library, or nobody is left.
    """
    _, colon, listed = name.partition(":")
    if colon:
        people = [person.strip() for person in listed.split(",")]
    else:
        people = []
    # a comma too many or a lone minus is a slip, not a choice of everybody
    if not is_library(name) or "" in people or "-" in people:
        raise InputError(
            f"a library must be {LIBRARY}, {LIBRARY}:02,16 or {LIBRARY}:-16, "
            f"got {quoted(name)}"
        )
    only = []
    without = []
    for person in people:
        if person[0] == "-":
            without.append(person[1:])
        else:
            only.append(person)
    return clips(only, without)


def leaving_out(name: str, subjects: Iterable[str]) -> str:
    """Return the library's name with more people left out."""
    named(name)  # raises an error if the name is invalid
    people = [name.partition(":")[2]]
    for subject in subjects:
        people.append(f"-{subject}")
    return f"{LIBRARY}:{','.join(filter(None, people))}"
