"""One track, and what is kept of its frames: poses that were told, that are true, and that may be."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from people.clips import Piece
from posefit.arrays import Array
from posefit.footage.training import training_clips, training_motions
from posefit.geometry.skeleton import Skeleton
from posefit.motion import recorded
from posefit.sweep.cell import cell_scene, parts, settings_text
from posefit.sweep.check import cell_of
from posefit.tracking.method import Choice, parse_settings
from posefit.tracking.opening import Opening
from posefit.tracking.run import follow
from posefit.uncertainty.modes import Posterior
from posterior.design import OneTrack


@dataclass(frozen=True, eq=False)
class Followed:
    """The frames of a track."""

    seen: OneTrack
    truth: Array = field(repr=False)  # (T, 66)
    told: Array = field(repr=False)  # (T, 66)
    drawn: Array = field(repr=False)  # (T, K, 66)
    weights: Array = field(repr=False)  # (T, K)
    costs: Array = field(repr=False)  # (T,)

    def __len__(self) -> int:
        return len(self.told)

    @property
    def skeleton(self) -> Skeleton:
        """The person's bones."""
        return _skeleton(self.seen.clip.subject)

    @cached_property
    def off(self) -> Array:
        """How far each joint is from where it was told (T, 27), metres, both roots at one point."""
        true, told = (self.skeleton.joints(poses) for poses in (self.truth, self.told))
        return np.asarray(np.linalg.norm(true - told, axis=2))

    def posterior(self, k: int) -> Posterior:
        """Return what a frame may show, as nobody has recalibrated it."""
        return Posterior(self.drawn[k], np.zeros((len(self.weights[k]), 3)), self.weights[k], coherent=True)


@lru_cache(maxsize=16)
def _skeleton(subject: str) -> Skeleton:
    return recorded.clips(only=(subject,))[0].skeleton


def followed(seen: OneTrack) -> Followed:
    """Return a clip that was followed by a library without the person who moves in it."""
    cell = cell_of(seen.spec)
    scene = cell_scene(cell)
    optimiser, prior, tracker = parts(cell.method)
    settings: dict[str, Any] = dict(parse_settings(settings_text(cell.settings), optimiser, prior, tracker))
    named: dict[str, Any] = {"tracker": tracker} if tracker else {"optimiser": optimiser, "prior": prior}
    choice = Choice(evaluations=cell.evaluations, **named, **settings)
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    opening = Opening(translation="known" if cell.translation == "known" else "aligned")
    track = follow(scene, training, choice=choice, opening=opening)
    assert track.truth is not None
    posteriors = [one.posterior for one in track.found]
    most = max(len(one) for one in posteriors if one is not None)
    drawn = np.zeros((len(posteriors), most, track.truth.poses.shape[1]))
    weights = np.zeros((len(posteriors), most))
    for k, one in enumerate(posteriors):
        assert one is not None
        drawn[k, : len(one)], weights[k, : len(one)] = one.poses, one.weights
    costs = np.array([one.cost for one in track.found])
    return Followed(seen, track.truth.poses, track.motion.poses, drawn, weights, costs)


ARRAYS = tuple(one.name for one in fields(Followed) if one.name != "seen")


def save_tracks(tracks: Sequence[Followed], path: Path) -> None:
    """Write tracks to a file .npz: angles in single precision, those of samples to a thousandth of a radian or two."""
    arrays: dict[str, Any] = {}
    for k, one in enumerate(tracks):
        arrays |= {f"{k}.{name}": getattr(one, name).astype(np.float32) for name in ARRAYS}
        arrays[f"{k}.drawn"] = one.drawn.astype(np.float16)
    arrays["seen"] = np.array(json.dumps([one.seen for one in tracks]))  # tuples become lists
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def load_tracks(path: str) -> list[Followed]:
    """Return the tracks of a file that `save_tracks` wrote. Raises ValueError where it is none."""
    try:
        with np.load(path) as held:
            seen = [
                OneTrack(group, Piece(*clip), tuple(views), *rest)
                for group, clip, views, *rest in json.loads(str(held["seen"]))
            ]
            return [
                Followed(one, **{name: held[f"{k}.{name}"].astype(np.float64) for name in ARRAYS})
                for k, one in enumerate(seen)
            ]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: expected tracks that --out wrote, got {error}") from None
