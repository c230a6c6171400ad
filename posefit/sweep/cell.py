"""A cell: one run of a sweep, told completely by names and numbers; and what it measured."""

import hashlib
import io
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posefit.version import __version__

if TYPE_CHECKING:
    from posefit.arrays import Array
    from posefit.fitting.tracker import Frame
    from posefit.footage.scene import Scene
    from posefit.geometry.skeleton import Skeleton
    from posefit.motion.motion import Motion
    from posefit.tracking.method import Choice
    from posefit.tracking.opening import Opening

POINTS = 64  # of an anytime trace at most
TIMES = ("seconds", "seconds_per_frame", "cpu_seconds_per_frame")  # what two runs of a cell do not have in common
ALL_AROUND = 180.0  # degrees that a yaw may be off when nothing is told of it
SALT = 2001  # part of the seed of what is told of a person
DROPPED = "dropped"  # the corruption that takes whole frames away, a share of them
UNLIKE = ("evaluations", "evaluations_per_second")  # measures that a row has under another name, or not at all


@dataclass(frozen=True)
class Cell:
    """Everything a run depends on. `posefit.sweep.plan` makes cells that are checked.

    `method` is `OPTIMISER@PRIOR` or a tracker's name; `settings` are named `NAME.SETTING`, as for `--set`. `instance`
    numbers what is seen of the motion, see `posefit.footage.instance`. `corruption` gives kinds of
    `posefit.silhouette.corruption` their strength, 0 to 1, and `dropped` the share of frames that are not seen; what is
    spoilt follows from the instance, so that every method and seed sees the same. `tracks` is how many times the motion
    is followed, see `posefit.tracking.tracks`. `files` holds the SHA-256 of every capture file that is read.

    Of the person a method is told where he faces at first, at most `yaw_off_degrees` off, nothing at 180; and his body,
    each bone's length and radii at most `body_off_percent` off. Both are drawn from the instance and the motion's name.
    """

    method: str
    motion: str
    train: tuple[str, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    view_degrees: tuple[float, ...] = (45.0,)
    corruption: Mapping[str, float] = field(default_factory=dict)
    instance: int = 0
    frames: int = 60
    fps: float = 30.0
    size: tuple[int, int] = (320, 240)
    evaluations: int = 2440
    translation: str = "known"
    first_pose: str = "searched"
    tracks: int = 1
    yaw_off_degrees: float = 0.0
    body_off_percent: float = 0.0
    seed: int = 0
    files: Mapping[str, str] = field(default_factory=dict)
    version: str = __version__  # of posefit, and of plugins that are not its own

    @cached_property
    def spec(self) -> dict[str, Any]:
        """The cell as JSON holds it, without fields of `LATER` that say nothing new."""
        told = {name: value for name in FIELDS if is_told(name, value := getattr(self, name))}
        spec: dict[str, Any] = json.loads(json.dumps(told))
        return spec

    @cached_property
    def key(self) -> str:
        """The cell's name: the SHA-256 of its spec, version included, as 64 hexadecimal digits."""
        return hashlib.sha256(json_of(self.spec).encode()).hexdigest()

    def __str__(self) -> str:
        return f"{self.method} on {self.motion}, instance {self.instance}, seed {self.seed}"


FIELDS = tuple(one.name for one in fields(Cell))
NAMES = tuple(sorted(FIELDS))  # in which order a key is of them
# Fields that came after ledgers had been kept, and what a spec means that does not say them: keys stay as they were.
LATER = {"tracks": 1, "yaw_off_degrees": 0.0, "body_off_percent": 0.0}


def is_told(name: str, value: Any) -> bool:
    """Return whether a field's value stands in the cell's spec, and so in its key."""
    return name not in LATER or value != LATER[name]


def in_full(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return a spec with the fields that it does not tell."""
    return {**LATER, **spec}


@dataclass(frozen=True)
class CellResult:
    """What a cell measured; but for `TIMES`, the same bits wherever it ran."""

    row: dict[str, Any]  # as JSON holds it: the spec, the key, and the figures
    joints: bytes = field(repr=False)  # an .npz of `estimate` and `truth` (T, 27, 3), float32, metres


def run_cell(cell: Cell) -> CellResult:
    """Return what following the cell's motion by its method measures. Raises ValueError where a file has changed.

    And where this posefit, on a worker far away perhaps, is not the one whose results were asked for.
    """
    from posefit.footage.training import training_clips, training_motions
    from posefit.tracking.measures import MEASURES
    from posefit.tracking.run import follow

    began = time.perf_counter()
    if (planned := cell.version.partition(",")[0]) != __version__:
        raise ValueError(f"a worker must have posefit {planned}, got {__version__}")
    for path, digest in cell.files.items():
        if (found := digest_of(path)) != digest:
            raise ValueError(f"{path} must be the file that was planned, {digest[:8]}, got {found[:8]}")
    scene = cell_scene(cell)
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    result = follow(scene, training, choice=_choice(cell), opening=_opening(cell), seed=cell.seed, tracks=cell.tracks)
    truth, estimate = (_joints(motion) for motion in (result.truth, result.motion))
    errors, measured = _joint_errors_mm(truth, estimate), result.measures.as_dict()
    row = {
        "key": cell.key,
        "spec": cell.spec,
        "status": "done",
        **{name: measured[name] for name in MEASURES if name not in UNLIKE},
        "warnings": result.summary["warnings"],
        "evaluations_used": result.measures.evaluations,
        "dimensions": result.summary["dimensions"],
        "joint_errors_mm": [round(float(error), 3) for error in errors],
        "mode_reliability": _mode_reliability(result.found, truth, result.motion.skeleton),
        "trace": anytime_trace(result.found),
        "seconds": time.perf_counter() - began,
    }
    try:
        json.dumps(row, allow_nan=False)
    except ValueError:
        raise ValueError(f"what {cell.method} measures must be finite numbers, got some that are not") from None
    return CellResult(row, packed_joints(estimate=estimate, truth=truth))


def cell_scene(cell: Cell) -> "Scene":
    """Return what is seen in a cell; the same for all methods and seeds."""
    from posefit.footage.instance import motion_of_instance, variation
    from posefit.footage.scene import synthetic
    from posefit.footage.spoilt import Spoilt

    motion = motion_of_instance(cell.motion, cell.instance, frames=cell.frames, fps=cell.fps)
    scene = synthetic(motion, variation(cell.instance).views(cell.view_degrees), cell.size, [], (None, None))
    scene = _as_told(cell, scene)
    if not cell.corruption:
        return scene
    noise = {kind: strength for kind, strength in cell.corruption.items() if kind != DROPPED}
    spoilt = Spoilt(scene.observations, noise, cell.corruption.get(DROPPED, 0.0), cell.instance)
    return replace(scene, observations=spoilt)


def _as_told(cell: Cell, scene: "Scene") -> "Scene":
    """Return the scene with what a method is told of the person: about where he faces at first, and his body."""
    import numpy as np

    from posefit.geometry.body import varied

    if not (cell.yaw_off_degrees or cell.body_off_percent):
        return scene
    for_yaw, for_body = np.random.default_rng([SALT, cell.instance, *Path(cell.motion).stem.encode()]).spawn(2)
    off = np.radians(cell.yaw_off_degrees) * for_yaw.uniform(-1.0, 1.0)
    told = None if cell.yaw_off_degrees >= ALL_AROUND or scene.yaw is None else scene.yaw + float(off)
    return replace(scene, yaw=told, body=varied(scene.body, cell.body_off_percent, for_body))


def json_of(value: Any) -> str:
    """Return the one JSON text of a value, as keys are made of it."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest_of(path: str | Path) -> str:
    """Return the SHA-256 of a file's content."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def parts(method: str) -> tuple[str, str, str | None]:
    """Return the optimiser, the prior and the tracker that a method names; without a tracker the last is None.

    A tracker has no optimiser and no prior: these are "".
    """
    optimiser, at, prior = method.partition("@")
    return (optimiser, prior, None) if at else ("", "", method)


def settings_text(settings: Mapping[str, Any]) -> list[str]:
    """Return settings as `--set` takes them."""
    return [f"{name}={setting_text(value)}" for name, value in settings.items()]


def anytime_trace(found: "list[Frame]") -> dict[str, list[float]]:
    """Return the anytime trace: after so many `evaluations` of a frame, the best `cost`, the mean over the frames.

    A frame that spent fewer keeps its last cost; frames that were held do not count. There are at most 64 points.
    """
    import numpy as np

    searched = [frame for frame in found if len(frame.history)]
    if not searched:
        return {"evaluations": [], "cost": []}
    spent = [_spent(frame) for frame in searched]
    points = np.unique(np.concatenate(spent))
    points = points[points >= max(one[0] for one in spent)]  # from where every frame has a cost
    if len(points) > POINTS:
        wanted = np.geomspace(points[0], points[-1], POINTS)
        points = np.unique(points[np.searchsorted(points, wanted * (1.0 - 1e-12))])
    costs = [
        frame.history[np.searchsorted(one, points, side="right") - 1]
        for frame, one in zip(searched, spent, strict=True)
    ]
    mean = np.mean(costs, axis=0)
    return {"evaluations": [int(point) for point in points], "cost": [float(f"{cost:.6g}") for cost in mean]}


def _spent(frame: "Frame") -> "Array":
    """Return the evaluations (populations,) after each population; of equal ones where the tracker does not say."""
    import numpy as np

    if frame.spent is not None:
        return np.asarray(frame.spent)
    count = len(frame.history)
    return np.asarray(np.arange(1, count + 1) * frame.evaluations // count)


def _choice(cell: Cell) -> "Choice":
    from posefit.tracking.method import Choice, parse_settings

    optimiser, prior, tracker = parts(cell.method)
    settings: dict[str, Any] = dict(parse_settings(settings_text(cell.settings), optimiser, prior, tracker))
    named: dict[str, Any] = {"tracker": tracker} if tracker else {"optimiser": optimiser, "prior": prior}
    return Choice(evaluations=cell.evaluations, **named, **settings)


def _opening(cell: Cell) -> "Opening":
    from posefit.tracking.opening import Opening

    told: dict[str, Any] = {name: getattr(cell, name) for name in ("translation", "first_pose")}
    return Opening(**told)


def _joints(motion: "Motion | None") -> "Array":
    assert motion is not None
    return motion.skeleton.joints(motion.poses, motion.translations)


def _joint_errors_mm(truth: "Array", estimate: "Array") -> "Array":
    """Return each joint's mean distance (27,) in millimetres, both roots at one point, as in `mpjpe_mm`."""
    import numpy as np

    difference = (truth - truth[:, :1]) - (estimate - estimate[:, :1])
    return np.asarray(1e3 * np.linalg.norm(difference, axis=-1).mean(axis=0))


def _mode_reliability(found: "list[Frame]", truth: "Array", skeleton: "Skeleton") -> list[list[float]]:
    """Return, by bins of how likely each frame's likeliest mode is: frames, mean probability, how often it is right."""
    import numpy as np

    from posefit.uncertainty.calibration import reliability
    from posefit.uncertainty.modes import likeliest_is_right

    told = [(frame.modes, joints) for frame, joints in zip(found, truth, strict=True) if frame.modes]
    if not told:
        return []
    right = np.array([likeliest_is_right(skeleton, modes, joints) for modes, joints in told])
    likely = np.array([max(mode.weight for mode in modes) for modes, _ in told])
    return [[count, round(mean, 6), round(share, 6)] for count, mean, share in reliability(likely, right)]


def packed_joints(**arrays: "Array") -> bytes:
    """Return arrays in metres as an .npz, float32."""
    import numpy as np

    buffer = io.BytesIO()
    # to half a millimetre: the digits after that do not compress, and no picture shows them
    rounded: dict[str, Any] = {
        name: (np.round(array * 1024.0) / 1024.0).astype(np.float32) for name, array in arrays.items()
    }
    np.savez_compressed(buffer, **rounded)
    return buffer.getvalue()


def setting_text(value: Any) -> str:
    """Return a setting's value as `--set` takes it."""
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    if isinstance(value, list | tuple):
        return ",".join(setting_text(one) for one in value)
    return str(value)
