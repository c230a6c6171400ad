"""Recorded clips of people outside the library, and their tracks, for all studies.

Other studies import this module; it prints nothing. `GROUPS` has the clips by kind of
motion, and `track_of` tracks one with a library that lacks its person.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from posefit.footage.scene import Scene
from posefit.motion.clips import training_clips, training_motions
from posefit.settings import settings_text
from posefit.sweep.cell import ALL_AROUND, TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.tracking.defaults import completed
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.tracking.result import Track

# evaluations per frame, the default of `posefit track`
METHOD = "exemplars"
EVALUATIONS = 9760


class Clip(NamedTuple):
    """The first frames of an instance of a recorded clip."""

    name: str  # as in `posefit motions`: subject and clip number
    frames: int
    instance: int
    shows: str

    @property
    def subject(self) -> str:
        """The subject of the clip."""
        return self.name.partition("_")[0]

    @property
    def library(self) -> str:
        """The library without the subject."""
        return f"library:-{self.subject}"


WALKS = "walks"
RUNS = "runs"
# The first few of a group are of different people, because a quick run takes only
# these. Most runs of the database are shorter than two seconds.
GROUPS: dict[str, tuple[Clip, ...]] = {
    WALKS: (
        Clip("02_01", 86, 0, "walks straight"),
        Clip("05_01", 120, 0, "walks, veering right, toes first"),
        Clip("49_01", 130, 0, "walks straight, slowly"),
        Clip("16_16", 100, 0, "walks straight"),
        Clip("29_01", 80, 1, "walks straight, at a stroll"),
        Clip("09_12", 80, 0, "walks about, along an arc"),
        Clip("16_13", 100, 0, "walks, veering right"),
        Clip("16_22", 76, 0, "walks fast"),
        Clip("16_31", 100, 0, "walks straight"),
    ),
    RUNS: (
        Clip("09_01", 37, 0, "runs"),
        Clip("16_35", 41, 0, "jogs"),
        Clip("127_06", 44, 0, "runs, bent forward"),
        Clip("127_16", 65, 0, "runs and stops"),
        Clip("09_11", 42, 0, "runs"),
        Clip("16_37", 46, 0, "jogs, veering left"),
        Clip("16_42", 52, 0, "jogs, turns left"),
        Clip("127_03", 83, 0, "stands, then runs"),
    ),
    "jumps": (
        Clip("16_03", 100, 0, "jumps high"),
        Clip("49_04", 63, 0, "runs and leaps"),
        Clip("127_21", 89, 0, "runs, leaps and stops"),
        Clip("16_09", 120, 0, "jumps forward"),
        Clip("49_03", 100, 1, "hops on either foot"),
    ),
    "turns": (
        Clip("16_18", 120, 0, "walks and turns left"),
        Clip("29_01", 100, 6, "walks and turns round"),
        Clip("09_12", 100, 7, "walks and turns round"),
        Clip("16_20", 120, 0, "walks and turns right"),
        Clip("16_27", 61, 0, "walks fast and turns left"),
    ),
    "dances": (
        Clip("05_11", 120, 0, "steps aside, pirouette"),
        Clip("49_06", 121, 0, "cartwheel"),
        Clip("135_07", 120, 0, "kicks of a martial art"),
        Clip("05_05", 120, 0, "raises a leg, leaps and turns"),
        Clip("05_16", 130, 0, "leaps and turns"),
    ),
    "everyday": (
        Clip("02_06", 120, 1, "bends, scoops, lifts an arm"),
        Clip("14_13", 120, 1, "sweeps the floor"),
        Clip("17_03", 110, 0, "sneaks"),
        Clip("02_05", 120, 0, "punches"),
        Clip("14_30", 120, 0, "goes and sits down"),
    ),
}

# Clips from which no study learned and on which none was tuned, for one final report.
ASIDE: dict[str, tuple[Clip, ...]] = {
    WALKS: (
        Clip("16_32", 120, 0, "walks straight"),
        Clip("16_21", 78, 0, "walks fast"),
    ),
    RUNS: (Clip("09_05", 36, 0, "runs"), Clip("16_45", 34, 0, "jogs")),
    "jumps": (
        Clip("16_06", 100, 0, "jumps forward"),
        Clip("127_26", 62, 0, "runs and leaps"),
    ),
    "turns": (
        Clip("16_29", 71, 0, "walks fast and turns right"),
        Clip("16_30", 67, 0, "walks and turns right"),
    ),
    "dances": (
        Clip("05_10", 120, 0, "dances"),
        Clip("49_21", 120, 0, "turns many times"),
        Clip("49_07", 118, 0, "cartwheel"),
    ),
    "everyday": (
        Clip("02_08", 120, 0, "swings something"),
        Clip("14_33", 120, 0, "stands, goes a step"),
    ),
}

Views = tuple[float, ...]

SIDES: tuple[Views, ...] = ((0.0,), (45.0,), (90.0,), (135.0,), (180.0,))
PAIRS: tuple[Views, ...] = ((0.0, 90.0), (45.0, 135.0))
FOUR: Views = (0.0, 90.0, 180.0, 270.0)

# largest difference of bones and radii from the person's: 5 % root mean square
OFF_PERCENT = 10.0
DAMAGE = {"holes": 0.3, "blobs": 0.3, "jitter": 0.3, "dropped": 0.1}
CHANGES: dict[str, Mapping[str, Any]] = {
    "first yaw unknown": {"yaw_off_degrees": ALL_AROUND},
    "translation aligned": {"translation": "aligned"},
    "aligned, first yaw unknown": {
        "translation": "aligned",
        "yaw_off_degrees": ALL_AROUND,
    },
    "body 5 % off": {"body_off_percent": OFF_PERCENT},
    "damaged silhouettes": {"corruption": DAMAGE},
}
CHANGES["all of these"] = {
    name: value for change in CHANGES.values() for name, value in change.items()
}


def cell_fields(clip: Clip, views: Views, frames: int, **fields: Any) -> dict[str, Any]:
    """Return the fields of a cell that tracks a clip without its subject's library.

    `fields` replaces some of them.
    """
    return {
        "method": METHOD,
        "motion": clip.name,
        "train": [clip.library],
        "view_degrees": views,
        "frames": min(frames, clip.frames),
        "instance": clip.instance,
        "evaluations": EVALUATIONS,
        "yaw_off_degrees": 25.0,
        **fields,
    }


def track_of(cell: TrackCell, scene: Scene, **changes: Any) -> Track:
    """Return the track of a cell in a scene, with some options changed.

    The scene may differ from the cell's own.
    """
    training = training_motions(
        training_clips(cell.train, followed=cell.motion), scene.fps
    )
    options = {
        name: getattr(cell, name)
        for name in ("method", "evaluations", "translation", "seed")
    }
    chosen = TrackOptions(settings=settings_text(cell.settings), **(options | changes))
    return track_scene(scene, training, completed(chosen, scene.truth))


@lru_cache(maxsize=4)
def learn_library(clip: Clip, views: Views) -> None:
    """Track two frames of a clip, so that its library is learned in this process."""
    cell = cell_of(cell_fields(clip, views, 2))
    track_of(cell, cell_scene(cell))
