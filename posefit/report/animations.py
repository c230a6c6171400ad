"""The animations of a report: joints of runs, and the cameras that see them, in as few bytes as they need."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.page.bodies import camera_from_origin, in_16_bits
from posefit.report.kind import Runs
from posefit.sweep.cell import TrackCell, cell_scene, digest_of
from posefit.sweep.ledger import Ledger
from posefit.uncertainty.modes import nearer_mirrored

MAX_CHARACTERS = 5_500_000  # of all animations together
MAX_FRAMES = 90  # of an animation; of longer tracks every second, third, ... frame is used


def animations_of(ledger: Ledger, runs: Runs, warn: Callable[[str], None], first: Sequence[int] = ()) -> dict[str, Any]:
    """Return the animations of as many runs as there is room for: `first`, then the first seeds of every instance.

    `scenes` has the true joints and the cameras of each instance, by its index; `tracks` the estimated joints of each
    row, by its index, with each frame's MPJPE in mm, and which frames are lost and which swapped. Joints are
    millimetres from the scene's origin, 16-bit little-endian in base 64.
    """
    scenes: dict[int, dict[str, Any]] = {}
    origins: dict[int, Array] = {}
    tracks: dict[int, dict[str, Any]] = {}
    used = 0
    for row in dict.fromkeys([*first, *_rows_by_priority(runs)]):
        instance = int(runs.instance[row])
        try:
            joints = ledger.joints(runs.keys[row])
        except (ValueError, OSError) as error:
            warn(f"warning: {error}; this run has no animation")
            continue
        step = -(-len(joints["truth"]) // MAX_FRAMES)
        truth, estimate = (joints[name][::step].astype(np.float64) for name in ("truth", "estimate"))
        if instance not in scenes:
            origins[instance] = np.round(truth[0, 0], 3)
            scenes[instance] = _scene(runs.places[instance], truth, step, origins[instance])
            used += len(scenes[instance]["truth"]) + 500
        errors = metrics.mpjpe_mm(truth, estimate)
        tracks[row] = {
            "estimate": in_16_bits(estimate - origins[instance]),
            "mpjpe": np.round(errors).astype(int).tolist(),
            "lost": np.flatnonzero(errors > metrics.LOST_MM).tolist(),
            "swapped": np.flatnonzero(nearer_mirrored(truth, estimate)).tolist(),
        }
        used += len(tracks[row]["estimate"]) + 8 * len(truth)
        if used > MAX_CHARACTERS:
            break
    return {"scenes": scenes, "tracks": tracks}


def _rows_by_priority(runs: Runs) -> Iterator[int]:
    """Yield rows: the first seed of all methods on all instances, in a random order, then the second, and so on."""
    mixed = np.random.default_rng(0).permutation(len(runs.instances))
    group = runs.instance * len(runs.methods) + runs.method  # rows are sorted by it, and then by seed
    rank = np.arange(len(group)) - np.searchsorted(group, group, side="left")
    yield from np.lexsort((runs.method, mixed[runs.instance], rank)).tolist()


def _scene(place: Mapping[str, Any], truth: Array, step: int, origin: Array) -> dict[str, Any]:
    scene: dict[str, Any] = {
        "truth": in_16_bits(truth - origin),
        "frames": len(truth),
        "step": step,
        "fps": place["fps"],
    }
    try:
        for path, digest in place["files"].items():
            if digest_of(path) != digest:
                raise ValueError(f"{path} has changed")
        more = {name: place[name] for name in ("instance", "frames", "fps", "size")}
        made = cell_scene(TrackCell("", place["motion"], (), {}, tuple(place["view_degrees"]), {}, **more))
    except (ValueError, OSError):  # a capture file is missing: the joints are shown without a camera
        return {**scene, "cameras": [], "radii": []}
    cameras = [camera_from_origin(camera, origin) for camera in made.cameras]
    return {**scene, "cameras": cameras, "radii": np.round(made.body.radii, 4).tolist()}
