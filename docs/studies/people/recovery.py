"""Whoever was not seen for a while is found again: gaps in a clip, and coming back the other way.

Frames in which nothing is seen, and motions made for the occasion, are no cells; so the runs are jobs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from people.clips import Piece
from people.design import TOLD, Views
from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Rendered, Scene, synthetic
from posefit.footage.training import training_clips, training_motions
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Silhouette
from posefit.sweep.cell import TrackCell, cell_scene, parts
from posefit.sweep.check import cell_of
from posefit.tracking.method import Choice
from posefit.tracking.opening import Opening
from posefit.tracking.run import follow
from posefit_reproduce.grid import Progress, each

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
    optimiser, prior, tracker = parts(cell.method)
    named: dict[str, Any] = {"tracker": tracker} if tracker else {"optimiser": optimiser, "prior": prior}
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    choice, opening = Choice(evaluations=cell.evaluations, **named), Opening(translation=translation)
    track = follow(scene, training, choice=choice, opening=opening)
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
    drawn = Rendered(motion, seen.body, seen.cameras)
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
