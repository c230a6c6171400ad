"""The moving pictures of a report: joints of some runs, as few bytes as they need."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.page.bodies import camera_seen_from, in_16_bits
from posefit.report.runs import Runs
from posefit.sweep.cell import TrackCell, cell_scene, digest_of
from posefit.sweep.ledger import Ledger

LARGEST = 5_500_000  # characters of all pictures together
FRAMES = 90  # of a picture at most; of longer tracks every second, third, ... frame is shown


def gallery(
    ledger: Ledger, runs: Runs, say: Callable[[str], None], largest: int = LARGEST, first: Sequence[int] = ()
) -> dict[str, Any]:
    """Return the pictures of as many runs as there is room for: `first`, then the first seeds of every instance.

    `scenes` holds of each instance, by its index, the true joints and the cameras; `tracks` of each row, by its index,
    the estimated joints, each frame's MPJPE in mm, and which frames are lost and which swapped. Joints are millimetres
    from the scene's origin, 16-bit little-endian in base 64.
    """
    scenes: dict[int, dict[str, Any]] = {}
    origins: dict[int, Array] = {}
    tracks: dict[int, dict[str, Any]] = {}
    used = 0
    for row in dict.fromkeys([*first, *_chosen(runs)]):
        instance = int(runs.instance[row])
        try:
            joints = ledger.joints(runs.keys[row])
        except (ValueError, OSError) as error:
            say(f"warning: {error}; this run has no picture")
            continue
        step = -(-len(joints["truth"]) // FRAMES)
        truth, estimate = (joints[name][::step].astype(np.float64) for name in ("truth", "estimate"))
        if instance not in scenes:
            origins[instance] = np.round(truth[0, 0], 3)
            scenes[instance] = _scene(runs.places[instance], truth, step, origins[instance])
            used += len(scenes[instance]["truth"]) + 500
        tracks[row] = _track(truth, estimate, origins[instance])
        used += len(tracks[row]["estimate"]) + 8 * len(truth)
        if used > largest:
            break
    return {"scenes": scenes, "tracks": tracks}


def _chosen(runs: Runs) -> Iterator[int]:
    """Yield rows: of all methods on all instances the first seed, then the second, and so on; instances well mixed."""
    mixed = np.random.default_rng(0).permutation(len(runs.instances))
    group = runs.instance * len(runs.methods) + runs.method  # rows are sorted by it, and then by seed
    first = np.searchsorted(group, group, side="left")
    rank = np.arange(len(group)) - first
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
                raise ValueError(f"{path} is another file now")
        made = cell_scene(
            TrackCell(
                "",
                place["motion"],
                (),
                {},
                tuple(place["view_degrees"]),
                {},
                **{name: place[name] for name in ("instance", "frames", "fps", "size")},
            )
        )
    except (ValueError, OSError):  # a capture file that is not here: the joints are seen without a camera
        return {**scene, "cameras": [], "radii": []}
    return {
        **scene,
        "cameras": [camera_seen_from(camera, origin) for camera in made.cameras],
        "radii": np.round(made.body.radii, 4).tolist(),
    }


def _track(truth: Array, estimate: Array, origin: Array) -> dict[str, Any]:
    errors = metrics.mpjpe_mm(truth, estimate)
    return {
        "estimate": in_16_bits(estimate - origin),
        "mpjpe": np.round(errors).astype(int).tolist(),
        "lost": np.flatnonzero(errors > metrics.LOST_MM).tolist(),
        "swapped": np.flatnonzero(metrics.swapped(truth, estimate)).tolist(),
    }
