"""People who are not in the library: walks, runs, jumps, turns, dances and everyday things, in recorded clips.

    python docs/studies/people.py --ledger people
    python docs/studies/people.py --recovery

The base are walks from every side and in two cameras: the first yaw known to 25 degrees, the translation known, the
body exact, the silhouettes clean. Then one thing is changed at a time, and other methods follow some of the same
tracks. `--recovery` measures instead how soon a track is right again after the person was out of sight for a while.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import click
import numpy as np

from clips import (
    ASIDE,
    EVALUATIONS,
    FOUR,
    GROUPS,
    METHOD,
    PAIRS,
    SIDES,
    WALKS,
    Clip,
    Views,
    cell_fields,
    track_of,
)
from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene, rendered, synthetic
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Silhouette
from posefit.sweep.cell import ALL_AROUND, TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit.sweep.plan import Plan
from posefit_reproduce.jobs import Progress, each
from table import LEDGER, WORKERS, bar, grouped, markdown, percent, rows

OFF_PERCENT = 10.0  # that bones and radii of another body are off at most: five per cent, root mean square
DAMAGE = {"holes": 0.3, "blobs": 0.3, "jitter": 0.3, "dropped": 0.1}
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
    "not smoothed": {"settings": {"exemplars.smoothing": 0.0}},
}
METHODS = ("sapso@pca", "annealed@pca", "sapso@loose", "annealed@loose", "vsmm")
CHANGED_WALKS, COMPARED_WALKS, COMPARED_OTHERS = 3, 3, 1  # clips of which one thing is changed, that others follow
SEEDED = 2  # clips of a group that are followed with more seeds, from 45 and 90 degrees
FEW_CLIPS = 2  # that are followed with few evaluations
FEW = 2440  # evaluations of a frame, the default of other methods
SEEDS = (1, 2)  # with which tracks of one camera are followed again: which hypothesis is chosen depends on a few draws


class Task(NamedTuple):
    """One track: its table, the line in it, the clip, and the changes of the base."""

    table: str
    line: str
    clip: Clip
    views: Views
    change: Mapping[str, Any] = {}

    def spec(self, method: str) -> dict[str, Any]:
        """Return the fields of the cell."""
        return cell_fields(self.clip, self.views, self.clip.frames, **{"method": method, **self.change})


def design(method: str, quick: bool) -> Iterator[Task]:
    """Yield all tracks, or a few of them."""
    for group, clips in GROUPS.items():
        views = (*SIDES[:3], *PAIRS) if group == WALKS else (*SIDES[:3], PAIRS[1])
        for clip, view in product(clips[: 2 if quick else None], views[1:2] if quick else views):
            line = f"{group}, {len(view)} camera{'s' * (len(view) > 1)}"
            yield Task("groups", line, clip, view)
            if len(view) == 1 and view in SIDES[:3] and not quick:
                if clip in clips[:FEW_CLIPS]:
                    yield Task("groups", f"{line}, {FEW:,} evaluations", clip, view, {"evaluations": FEW})
                if clip in clips[:SEEDED] and view in SIDES[1:3]:
                    yield from (Task("groups", line, clip, view, {"seed": seed}) for seed in SEEDS)
    changed = [*product(GROUPS[WALKS][: 1 if quick else CHANGED_WALKS], SIDES[1:2] if quick else SIDES[1:3])]
    others = [] if quick else [*product(GROUPS["everyday"][:CHANGED_WALKS], SIDES[1:3])]
    for table, changes, places in (
        ("changes", CHANGES, changed),
        ("steps", STEPS if method == METHOD else {}, [*changed, *others]),
    ):
        for name, change in {"base": {}, **changes}.items():
            yield from (Task(table, name, *place, change) for place in places)
    compared = [*product(GROUPS[WALKS][: 1 if quick else COMPARED_WALKS], SIDES[1:3])]
    for group in [] if quick else [name for name in GROUPS if name != WALKS]:
        compared += [(clip, SIDES[1]) for clip in GROUPS[group][:COMPARED_OTHERS]]
    for name in (method, *METHODS):
        yield from (Task("methods", name, *place, {"method": name}) for place in compared)


def kept_aside() -> Iterator[Task]:
    """Yield the tracks of clips that nothing was tuned on."""
    for group, clips in ASIDE.items():
        for clip, view in product(clips, (*SIDES[:3], PAIRS[1], FOUR)):
            line = f"{group}, {len(view)} camera{'s' * (len(view) > 1)}"
            yield Task("kept aside", line, clip, view)


def people_lines(
    tracks: Sequence[Task], method: str, by_view: bool, workers: int | None, ledger: str | None
) -> Iterator[str]:
    """Yield the tables: by group, the effect of each change and each step, and other methods."""
    specs = [track.spec(method) for track in tracks]
    different = {repr(spec): spec for spec in specs}  # a plan has no cell twice
    results = dict(zip(different, rows(Plan.of({"cells": [*different.values()]}), workers, ledger), strict=True))
    for table in dict.fromkeys(track.table for track in tracks):
        lines = [
            (track.line, results[repr(spec)]) for track, spec in zip(tracks, specs, strict=True) if track.table == table
        ]
        named = [{**row, "line": line} for line, row in lines]
        yield from grouped(named, lambda row: [row["line"]], [table])
        yield ""
    if by_view:
        yield from grouped(
            [
                {**results[repr(spec)], "group": track.line.partition(",")[0]}
                for track, spec in zip(tracks, specs, strict=True)
                if track.table == "groups"
            ],
            lambda row: [row["group"], ", ".join(f"{view:g}" for view in row["spec"]["view_degrees"])],
            ["groups", "view"],
        )


WITHIN = 10  # frames after the person is visible again, in which the track has to be right again
STAYS = 10  # frames after these, all of which have to be right
AWAY = 20  # frames that the person is out of the picture before they come back the other way
BEFORE = 60  # frames that they are visible until then, and afterwards
GAPS = {"10 frames of nothing": 10, "30 frames of nothing": 30}
RETURN = "back the other way"
KINDS = (*GAPS, RETURN)
TRANSLATIONS: tuple[Translation, ...] = ("known", "aligned")


@dataclass(frozen=True, eq=False)
class Hidden(Sequence[Observation]):
    """Observations of which some show nothing, not even where the person is."""

    observations: Sequence[Observation] = field(repr=False)
    start: int
    stop: int

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        observation = self.observations[k]
        if not self.start <= k < self.stop:
            return observation
        empty = [Silhouette.of(np.zeros_like(silhouette.mask)) for silhouette in observation.silhouettes]
        return Observation(empty, None, usable=False)


def recoveries(
    walks: Sequence[Clip],
    views: Sequence[Views],
    method: str,
    evaluations: int,
    workers: int | None,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """Return the result of every trial: some walks, each kind of absence, translations known and aligned."""
    jobs = {}  # all cells are made, and so checked, before any runs
    for key in product(walks, views, KINDS, TRANSLATIONS):
        clip, view, kind, _ = key
        frames = BEFORE if kind == RETURN else clip.frames
        jobs[key] = partial(
            _trial, cell_of(cell_fields(clip, view, frames, method=method, evaluations=evaluations)), *key
        )
    return list(each(jobs, workers, progress).values())


def _trial(cell: TrackCell, clip: Clip, views: Views, kind: str, translation: Translation) -> dict[str, Any]:
    scene = cell_scene(cell)
    scene, gone, back = returned(scene, views) if kind == RETURN else with_gap(scene, GAPS[kind])
    track = track_of(cell, scene, translation=translation)
    case = {"clip": clip.name, "views_degrees": list(views), "kind": kind, "translation": translation}
    mpjpe = track.table["mpjpe_mm"]
    assert track.truth is not None
    return {**case, **recovery(mpjpe, track.truth.poses[:, 0], track.motion.poses[:, 0], gone, back)}


def with_gap(scene: Scene, frames: int) -> tuple[Scene, int, int]:
    """Return the scene with empty frames in its middle, the first of them, and the first after them."""
    gone = (scene.count - frames) // 2
    back = gone + frames
    return replace(scene, observations=Hidden(scene.observations, gone, back)), gone, back


def returned(scene: Scene, views: Views) -> tuple[Scene, int, int]:
    """Return the scene whose person leaves at its end and comes back the same way, turned round, from the same place.

    And the first frame without them, and the first in which they are visible again.
    """
    truth = scene.truth
    assert truth is not None
    turned = np.array(truth.poses)
    turned[:, 0] += np.pi
    first, last = truth.translations[0], truth.translations[-1]
    across = (first + last) * [1.0, 0.0, 1.0] - truth.translations * [1.0, 0.0, 1.0]
    places = across + truth.translations * [0.0, 1.0, 0.0]
    poses = np.concatenate([truth.poses, np.tile(truth.poses[-1], (AWAY, 1)), turned])
    translations = np.concatenate([truth.translations, np.tile(last, (AWAY, 1)), places])
    motion = Motion(truth.name, truth.skeleton, poses, translations, truth.fps)
    size = scene.cameras[0].width, scene.cameras[0].height
    whole = synthetic(motion, views, size, [], (None, None))
    observations = rendered(motion, whole.body, whole.cameras)
    gone, back = len(truth), len(truth) + AWAY
    return replace(whole, yaw=scene.yaw, observations=Hidden(observations, gone, back)), gone, back


def recovery(mpjpe: Array, true_yaws: Array, yaws: Array, gone: int, back: int) -> dict[str, Any]:
    """Return whether a track is right again within ten frames from `back` on, and stays so for ten more.

    A frame that is not lost is right. `frames` is the number until the track stays right, None where it never does;
    `before` is whether the ten frames before `gone` were right.
    """
    right = mpjpe[back : back + WITHIN + STAYS] <= LOST_MM
    wrong = np.flatnonzero(~right)
    needed = int(wrong[-1]) + 1 if len(wrong) else 0
    later = slice(back + WITHIN, back + WITHIN + STAYS)
    facing = np.cos(yaws[later] - true_yaws[later]) > 0.0
    return {
        "before": bool((mpjpe[gone - STAYS : gone] <= LOST_MM).all()),
        "right": bool(needed <= WITHIN),
        "frames": needed if needed < len(right) else None,
        "facing_right": bool(facing.mean() > 0.5),
        "mpjpe_mm": float(mpjpe[later].mean()),
    }


def recovery_lines(method: str, quick: bool, workers: int | None) -> Iterator[str]:
    """Yield for each kind of absence and of translation the shares of trials in which a track was right."""
    walks, views = (GROUPS[WALKS][:1], SIDES[1:2]) if quick else (GROUPS[WALKS][:5], SIDES[1:3])
    trials = recoveries(walks, views, method, EVALUATIONS, workers, bar)
    table = []
    for case in dict.fromkeys((trial["kind"], trial["translation"]) for trial in trials):
        some = [trial for trial in trials if (trial["kind"], trial["translation"]) == case]
        means = [float(np.mean([trial[name] for trial in some])) for name in ("before", "right", "facing_right")]
        median = np.median([trial["mpjpe_mm"] for trial in some])
        table.append([*case, str(len(some)), *(percent(mean, 0) for mean in means), f"{median:.0f}"])
    heads = ["out of sight", "translation", "trials", "right before %", "right again %", "facing right %", "MPJPE mm"]
    yield from markdown(heads, table, 2)


@click.command(help=__doc__)
@click.option("--method", default=METHOD, show_default=True, help="A tracker, or OPTIMISER@PRIOR.")
@click.option("--recovery", is_flag=True, help="Gaps, and coming back, instead.")
@click.option("--aside", is_flag=True, help="Clips that nothing was tuned on, instead.")
@click.option("--quick", is_flag=True, help="A few tracks: a look, not a measurement.")
@LEDGER
@WORKERS
def main(method: str, recovery: bool, aside: bool, quick: bool, ledger: str | None, workers: int | None) -> None:
    tracks = [*(kept_aside() if aside else design(method, quick))]
    by_view = not quick and not aside
    for line in (
        recovery_lines(method, quick, workers) if recovery else people_lines(tracks, method, by_view, workers, ledger)
    ):
        click.echo(line)


if __name__ == "__main__":
    main()
