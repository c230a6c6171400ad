"""People whom the library does not hold: walks, runs, jumps, turns, dances and everyday things, in recorded clips.

    python docs/studies/people.py --ledger people
    python docs/studies/people.py --recovery

The base are walks from every side and in two cameras: the first yaw known to 25 degrees, the translation known, the
body exact, the silhouettes clean. Then one thing is changed at a time, and other methods follow some of the same
tracks. `--recovery` asks instead how soon a person is followed rightly again who was out of sight for a while.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import click
import numpy as np

from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene, rendered, synthetic
from posefit.footage.training import training_clips, training_motions
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Silhouette
from posefit.sweep.cell import ALL_AROUND, TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.sweep.plan import Plan
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit_reproduce.jobs import Progress, each
from table import LEDGER, WORKERS, bar, grouped, markdown, percent, rows


class Piece(NamedTuple):
    """So many frames of an instance of a recorded clip."""

    name: str  # of `posefit motions`: the subject, and which of his clips
    frames: int
    instance: int
    shows: str

    @property
    def subject(self) -> str:
        """Whose clip it is."""
        return self.name.partition("_")[0]

    @property
    def library(self) -> str:
        """The library of everybody else."""
        return f"library:-{self.subject}"


WALKS, RUNS = "walks", "runs"
# The first few of a group are other people's, since a quick look takes only these. Runs of the database are short:
# most are over before two seconds are, and all that there is of them is followed.
GROUPS: dict[str, tuple[Piece, ...]] = {
    WALKS: (
        Piece("02_01", 86, 0, "walks straight"),
        Piece("05_01", 120, 0, "walks, veering right, toes first"),
        Piece("49_01", 130, 0, "walks straight, slowly"),
        Piece("16_16", 100, 0, "walks straight"),
        Piece("29_01", 80, 1, "walks straight, at a stroll"),
        Piece("09_12", 80, 0, "walks about, along an arc"),
        Piece("16_13", 100, 0, "walks, veering right"),
        Piece("16_22", 76, 0, "walks fast"),
        Piece("16_31", 100, 0, "walks straight"),
    ),
    RUNS: (
        Piece("09_01", 37, 0, "runs"),
        Piece("16_35", 41, 0, "jogs"),
        Piece("127_06", 44, 0, "runs, bent forward"),
        Piece("127_16", 65, 0, "runs and stops"),
        Piece("09_11", 42, 0, "runs"),
        Piece("16_37", 46, 0, "jogs, veering left"),
        Piece("16_42", 52, 0, "jogs, turns left"),
        Piece("127_03", 83, 0, "stands, then runs"),
    ),
    "jumps": (
        Piece("16_03", 100, 0, "jumps high"),
        Piece("49_04", 63, 0, "runs and leaps"),
        Piece("127_21", 89, 0, "runs, leaps and stops"),
        Piece("16_09", 120, 0, "jumps forward"),
        Piece("49_03", 100, 1, "hops on either foot"),
    ),
    "turns": (
        Piece("16_18", 120, 0, "walks and turns left"),
        Piece("29_01", 100, 6, "walks and turns round"),
        Piece("09_12", 100, 7, "walks and turns round"),
        Piece("16_20", 120, 0, "walks and turns right"),
        Piece("16_27", 61, 0, "walks fast and turns left"),
    ),
    "dances": (
        Piece("05_11", 120, 0, "steps aside, pirouette"),
        Piece("49_06", 121, 0, "cartwheel"),
        Piece("135_07", 120, 0, "kicks of a martial art"),
        Piece("05_05", 120, 0, "raises a leg, leaps and turns"),
        Piece("05_16", 130, 0, "leaps and turns"),
    ),
    "everyday": (
        Piece("02_06", 120, 1, "bends, scoops, lifts an arm"),
        Piece("14_13", 120, 1, "sweeps the floor"),
        Piece("17_03", 110, 0, "sneaks"),
        Piece("02_05", 120, 0, "punches"),
        Piece("14_30", 120, 0, "goes and sits down"),
    ),
}

Views = tuple[float, ...]

METHOD, EVALUATIONS = "exemplars", 2440  # evaluations of a frame
OFF_PERCENT = 10.0  # that bones and radii of another body are off at most: five per cent, root mean square
DAMAGE = {"holes": 0.3, "blobs": 0.3, "jitter": 0.3, "dropped": 0.1}
TOLD: Mapping[str, Any] = {"yaw_off_degrees": 25.0}
CHANGES: dict[str, Mapping[str, Any]] = {
    "first yaw unknown": {"yaw_off_degrees": ALL_AROUND},
    "translation aligned": {"translation": "aligned"},
    "aligned, first yaw unknown": {"translation": "aligned", "yaw_off_degrees": ALL_AROUND},
    "body 5 % off": {"body_off_percent": OFF_PERCENT},
    "damaged silhouettes": {"corruption": DAMAGE},
    "all of these": {
        "translation": "aligned",
        "yaw_off_degrees": ALL_AROUND,
        "body_off_percent": OFF_PERCENT,
        "corruption": DAMAGE,
    },
}
# the same without one of the tracker's steps
STEPS: dict[str, Mapping[str, Any]] = {
    "the path alone": {"settings": {"exemplars.refiner": "none", "exemplars.smoothing": 0.0}},
    "refined, not smoothed": {"settings": {"exemplars.smoothing": 0.0}},
    "no mirror images": {"settings": {"exemplars.mirrored": False}},
}
METHODS = ("sapso@pca", "annealed@pca", "sapso@loose", "annealed@loose", "vsmm")
SIDES: tuple[Views, ...] = ((0.0,), (45.0,), (90.0,), (135.0,), (180.0,))
PAIRS: tuple[Views, ...] = ((0.0, 90.0), (45.0, 135.0))
CHANGED_WALKS, COMPARED_WALKS, COMPARED_OTHERS = 7, 5, 2  # clips of which one thing is changed, that others follow
SEEDS = (1, 2)  # with which walks in one view are followed again: which half-cycle is chosen depends on a few draws


class Track(NamedTuple):
    """One track: the table it is in, the line of it, the clip, and what its cell has beside the base."""

    table: str
    line: str
    clip: Piece
    views: Views
    change: Mapping[str, Any] = {}

    def spec(self, method: str) -> dict[str, Any]:
        """Return the cell."""
        return {
            "method": method,
            "motion": self.clip.name,
            "train": [self.clip.library],
            "view_degrees": self.views,
            "frames": self.clip.frames,
            "instance": self.clip.instance,
            "evaluations": EVALUATIONS,
            **TOLD,
            **self.change,
        }


def design(method: str, quick: bool) -> Iterator[Track]:
    """Yield all tracks, or a few of them."""
    for group, clips in GROUPS.items():
        views = {WALKS: (*SIDES, *PAIRS), RUNS: SIDES}.get(group, (*SIDES[:3], PAIRS[1]))
        for clip, view in product(clips[: 2 if quick else None], views[1:2] if quick else views):
            line = f"{group}, {len(view)} camera{'s' * (len(view) > 1)}"
            yield Track("groups", line, clip, view)
            if group == WALKS and len(view) == 1 and not quick:
                yield from (Track("groups", line, clip, view, {"seed": seed}) for seed in SEEDS)
    changed = [*product(GROUPS[WALKS][: 1 if quick else CHANGED_WALKS], SIDES[1:2] if quick else SIDES[:3])]
    runs = [] if quick else [*product(GROUPS[RUNS], SIDES[:3])]
    for table, changes, places in (
        ("changes", CHANGES, changed),
        ("steps", STEPS if method == METHOD else {}, [*changed, *runs]),
    ):
        for name, change in {"base": {}, **changes}.items():
            yield from (Track(table, name, *place, change) for place in places)
    compared = [*product(GROUPS[WALKS][: 1 if quick else COMPARED_WALKS], SIDES[1:3])]
    for group in [] if quick else [name for name in GROUPS if name != WALKS]:
        compared += [(clip, SIDES[1]) for clip in GROUPS[group][:COMPARED_OTHERS]]
    for name in (method, *METHODS):
        yield from (Track("methods", name, *place, {"method": name}) for place in compared)


def people_lines(method: str, quick: bool, workers: int | None, ledger: str | None) -> Iterator[str]:
    """Yield the tables: by group, what each change and each step is worth, and other methods."""
    tracks = list(design(method, quick))
    specs = [track.spec(method) for track in tracks]
    different = {repr(spec): spec for spec in specs}  # a plan has no cell twice
    found = dict(zip(different, rows(Plan.of({"cells": [*different.values()]}), workers, ledger), strict=True))
    for table in dict.fromkeys(track.table for track in tracks):
        lines = [
            (track.line, found[repr(spec)]) for track, spec in zip(tracks, specs, strict=True) if track.table == table
        ]
        named = [{**row, "line": line} for line, row in lines]
        yield from grouped(named, lambda row: [row["line"]], [table])
        yield ""
    if not quick:
        yield from grouped(
            [
                {**found[repr(spec)], "group": track.line.partition(",")[0]}
                for track, spec in zip(tracks, specs, strict=True)
                if track.table == "groups"
            ],
            lambda row: [row["group"], ", ".join(f"{view:g}" for view in row["spec"]["view_degrees"])],
            ["groups", "view"],
        )


WITHIN = 10  # frames after somebody is seen again, in which the track has to be right again
STAYS = 10  # frames after these, all of which have to be right
AWAY = 20  # frames that somebody is out of the picture before he comes back the other way
BEFORE = 60  # frames that he is seen until then, and afterwards
GAPS = {"10 frames of nothing": 10, "30 frames of nothing": 30}
RETURN = "back the other way"
KINDS = (*GAPS, RETURN)
TRANSLATIONS: tuple[Translation, ...] = ("known", "aligned")


@dataclass(frozen=True, eq=False)
class Unseen(Sequence[Observation]):
    """Observations of which some show nothing; where the person is, nobody knows then."""

    observations: Sequence[Observation] = field(repr=False)
    start: int
    stop: int

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        seen = self.observations[k]
        if not self.start <= k < self.stop:
            return seen
        empty = [Silhouette.of(np.zeros_like(one.mask)) for one in seen.silhouettes]
        return Observation(empty, None, usable=False)


def recoveries(
    walks: Sequence[Piece],
    views: Sequence[Views],
    method: str,
    evaluations: int,
    workers: int | None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Return what came of every trial: some walks, each kind of absence, translations known and aligned."""
    keys = list(product(walks, views, KINDS, TRANSLATIONS))
    # all cells are made, and so checked, before any runs
    found = each({key: partial(_tried, _cell(method, evaluations, *key[:3]), *key) for key in keys}, workers, progress)
    return [found[key] for key in keys]


def _cell(method: str, evaluations: int, clip: Piece, views: Views, kind: str) -> TrackCell:
    """Return the cell of the walk as it is, whole or until its end."""
    frames = BEFORE if kind == RETURN else clip.frames
    spec = {"method": method, "motion": clip.name, "train": [clip.library], "view_degrees": views, "frames": frames}
    return cell_of({**spec, "instance": clip.instance, "evaluations": evaluations, **TOLD})


def _tried(cell: TrackCell, clip: Piece, views: Views, kind: str, translation: Translation) -> dict[str, Any]:
    scene = cell_scene(cell)
    scene, gone, back = returned(scene, views) if kind == RETURN else with_gap(scene, GAPS[kind])
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    options = TrackOptions(method=cell.method, evaluations=cell.evaluations, translation=translation)
    track = track_scene(scene, training, options)
    told = {"clip": clip.name, "views_degrees": list(views), "kind": kind, "translation": translation}
    mpjpe = np.array([row["mpjpe_mm"] for row in track.frames])
    assert track.truth is not None
    return {**told, **judged(mpjpe, track.truth.poses[:, 0], track.motion.poses[:, 0], gone, back)}


def with_gap(scene: Scene, frames: int) -> tuple[Scene, int, int]:
    """Return the scene with so many frames of nothing in its middle: the first of them, and the first after them."""
    gone = (scene.count - frames) // 2
    back = gone + frames
    return replace(scene, observations=Unseen(scene.observations, gone, back)), gone, back


def returned(scene: Scene, views: Views) -> tuple[Scene, int, int]:
    """Return the scene with its person away at its end, who then comes back the same way, turned round.

    And the first frame without him, and the first in which he is seen again. He comes back where he left.
    """
    there = scene.truth
    assert there is not None
    turned = np.array(there.poses)
    turned[:, 0] += np.pi
    first, last = there.translations[0], there.translations[-1]
    across = (first + last) * [1.0, 0.0, 1.0] - there.translations * [1.0, 0.0, 1.0]
    places = across + there.translations * [0.0, 1.0, 0.0]
    poses = np.concatenate([there.poses, np.tile(there.poses[-1], (AWAY, 1)), turned])
    translations = np.concatenate([there.translations, np.tile(last, (AWAY, 1)), places])
    motion = Motion(there.name, there.skeleton, poses, translations, there.fps)
    size = scene.cameras[0].width, scene.cameras[0].height
    seen = synthetic(motion, views, size, [], (None, None))
    drawn = rendered(motion, seen.body, seen.cameras)
    gone, back = len(there), len(there) + AWAY
    return replace(seen, yaw=scene.yaw, observations=Unseen(drawn, gone, back)), gone, back


def judged(mpjpe: Array, true_yaws: Array, yaws: Array, gone: int, back: int) -> dict[str, Any]:
    """Return whether a track is right again within ten frames from `back` on, and stays so for ten more.

    A frame that is not lost is right. `frames` is how many were lost first, None where the last one is; `before` is
    whether the ten frames before `gone` were right.
    """
    seen = mpjpe[back : back + WITHIN + STAYS] <= LOST_MM
    wrong = np.flatnonzero(~seen)
    needed = int(wrong[-1]) + 1 if len(wrong) else 0
    later = slice(back + WITHIN, back + WITHIN + STAYS)
    facing = np.cos(yaws[later] - true_yaws[later]) > 0.0
    return {
        "before": bool((mpjpe[gone - STAYS : gone] <= LOST_MM).all()),
        "right": bool(needed <= WITHIN),
        "frames": needed if needed < len(seen) else None,
        "facing_right": bool(facing.mean() > 0.5),
        "mpjpe_mm": float(mpjpe[later].mean()),
    }


def recovery_lines(method: str, quick: bool, workers: int | None) -> Iterator[str]:
    """Yield for each kind of absence and of translation in which shares of the trials a track was right."""
    walks, views = (GROUPS[WALKS][:1], SIDES[1:2]) if quick else (GROUPS[WALKS][:5], SIDES[1:3])
    trials = recoveries(walks, views, method, EVALUATIONS, workers, bar)
    table = []
    for place in dict.fromkeys((one["kind"], one["translation"]) for one in trials):
        mine = [one for one in trials if (one["kind"], one["translation"]) == place]
        shares = [
            percent(float(np.mean([one[name] for one in mine])), 0) for name in ("before", "right", "facing_right")
        ]
        table.append([*place, str(len(mine)), *shares, f"{np.median([one['mpjpe_mm'] for one in mine]):.0f}"])
    heads = ["out of sight", "translation", "trials", "right before %", "right again %", "facing right %", "MPJPE mm"]
    yield from markdown(heads, table, 2)


@click.command(help=__doc__)
@click.option("--method", default=METHOD, show_default=True, help="A tracker, or OPTIMISER@PRIOR.")
@click.option("--recovery", is_flag=True, help="Gaps, and coming back, instead.")
@click.option("--quick", is_flag=True, help="A few tracks: a look, not a measurement.")
@LEDGER
@WORKERS
def main(method: str, recovery: bool, quick: bool, ledger: str | None, workers: int | None) -> None:
    lines = recovery_lines(method, quick, workers) if recovery else people_lines(method, quick, workers, ledger)
    for line in lines:
        click.echo(line)


if __name__ == "__main__":
    main()
