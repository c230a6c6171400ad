"""A cell: one run of a sweep, either a track or a search.

Names and numbers describe it completely. `run_cell` runs it and returns its row.
"""

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from posefit.errors import InputError
from posefit.settings import settings_text
from posefit.sweep.versions import other_version
from posefit.version import posefit_build

if TYPE_CHECKING:
    from posefit.footage.scene import Scene

ALL_AROUND = 180.0  # degrees; with an error this large the yaw is unknown
RNG_STREAM_PERSON = 2001  # errors in what a method knows of the person
DROPPED = "dropped"  # the corruption that removes a share of the frames
# measures that a row has under another name, or lacks
RENAMED_MEASURES = ("evaluations", "evaluations_per_second")


class Cell:
    """Everything that one run depends on. `posefit.sweep.plan` makes checked cells.

    Attributes:
        kind: "track" or "search".
        method: The method's name.
        settings: The method's settings by name.
        evaluations: The budget: of a frame, or of a search.
        instance: The number of the variation of the motion or the function.
        seed: The seed of all random numbers.
        name: The method's name in reports. It changes neither the result nor the key.
        version: The versions of posefit and of the method's plugins, with digests of
            their sources, as `posefit.registry.version_of` returns them.
    """

    kind: ClassVar[str]  # "track" or "search"
    method: str
    settings: Mapping[str, Any]
    evaluations: int
    instance: int
    seed: int
    name: str
    version: str

    @property
    def spec_text(self) -> str:
        """The JSON text of `spec`."""
        return json.dumps(self._values)

    @cached_property
    def spec(self) -> dict[str, Any]:
        """The cell's fields as JSON has them: tuples are lists."""
        spec: dict[str, Any] = json.loads(self.spec_text)
        return spec

    @cached_property
    def key(self) -> str:
        """The SHA-256 of its spec without the name, as 64 hexadecimal digits."""
        text = json_of({**self._values, "name": ""})
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def _values(self) -> dict[str, Any]:
        # in a dataclass these are the names of the fields
        names: tuple[str, ...] = self.__match_args__  # type: ignore[attr-defined]
        return {"kind": self.kind, **{name: getattr(self, name) for name in names}}

    @property
    def total_evaluations(self) -> int:
        """The evaluations of the whole cell."""
        return self.evaluations

    def measure(self) -> dict[str, Any]:
        """Run the cell and return its figures as values that JSON has.

        Except for the times they have the same bits on every machine.

        Raises:
            ValueError: A file has changed since the cell was planned.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class TrackCell(Cell):
    """The tracking of one motion by one method.

    `posefit.tracking.options.TrackOptions` describes method, settings, evaluations,
    translation, first_pose, hypotheses and seed, too.

    Attributes:
        method: `OPTIMISER@PRIOR`, or the name of a tracker.
        motion: The motion that is tracked.
        train: The motions that the method learns from.
        settings: The method's settings, named `NAME.SETTING`, as for `--set`.
        view_degrees: The directions of the cameras.
        corruption: The strength, 0 to 1, of each kind of
            `posefit.silhouette.corruption`, and under `dropped` the share of frames
            without masks. The damage depends on the instance, so it is the same for
            every method and seed.
        instance: The number of the variation of the motion and its cameras, see
            `posefit.motion.instances`.
        frames: Number of frames.
        fps: Frames per second.
        size: Width and height of the masks, in pixels.
        evaluations: The budget of a frame.
        translation: The root's position: "known", "searched" or "aligned".
        first_pose: "searched" or "given".
        hypotheses: How many times the motion is tracked, see
            `posefit.tracking.restarts`.
        yaw_off_degrees: The largest error of the first frame's yaw that the method
            gets. At 180 it gets no yaw. The error depends on the instance and the
            motion's name.
        body_off_percent: The largest error of each bone's length and radii that the
            method gets. It depends on the instance and the motion's name, too.
        seed: The seed of all random numbers.
        name: The method's name in reports.
        files: The SHA-256 of each motion file that is read, by path.
        version: The versions of posefit and of the method's plugins.
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
    hypotheses: int = 1
    yaw_off_degrees: float = 0.0
    body_off_percent: float = 0.0
    seed: int = 0
    name: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    version: str = field(default_factory=posefit_build)
    kind: ClassVar[str] = "track"

    def __str__(self) -> str:
        return (
            f"{self.name or self.method} on {self.motion}, "
            f"instance {self.instance}, seed {self.seed}"
        )

    @property
    def total_evaluations(self) -> int:
        """The evaluations of all frames, by every hypothesis."""
        return self.hypotheses * self.frames * self.evaluations

    def measure(self) -> dict[str, Any]:
        """Track the motion and return the figures.

        Raises:
            ValueError: A file has changed since the cell was planned.
        """
        from posefit.evaluation.errors import anytime_trace, mode_reliability
        from posefit.evaluation.measures import MEASURES
        from posefit.geometry.skeleton import joint_distances
        from posefit.motion.clips import training_clips, training_motions
        from posefit.tracking.defaults import completed
        from posefit.tracking.options import TrackOptions
        from posefit.tracking.pipeline import track_scene

        self._check_files()
        scene = cell_scene(self)
        clips = training_clips(self.train, followed=self.motion)
        training = training_motions(clips, scene.fps)
        options = TrackOptions(
            method=self.method,
            settings=settings_text(self.settings),
            evaluations=self.evaluations,
            translation=self.translation,  # type: ignore[arg-type]
            first_pose=self.first_pose,  # type: ignore[arg-type]
            hypotheses=self.hypotheses,
            seed=self.seed,
            threads=1,  # cells run side by side
        )
        result = track_scene(scene, training, completed(options, self.motion))
        assert result.truth is not None
        truth = result.truth.joints
        estimate = result.motion.joints
        # in mm, with both roots at one point, as in `mpjpe_mm`
        errors = 1e3 * joint_distances(truth, estimate).mean(axis=0)  # (joints,)
        measured = asdict(result.measures)
        figures = {}
        for name in MEASURES:
            if name not in RENAMED_MEASURES:
                figures[name] = measured[name]
        return {
            **figures,
            "warnings": result.log.warnings,
            "evaluations_used": result.measures.evaluations,
            "dimensions": result.setup.dimensions,
            "joint_errors_mm": [round(float(error), 3) for error in errors],
            "mode_reliability": mode_reliability(
                result.frames, truth, result.motion.skeleton
            ),
            "trace": anytime_trace(result.frames),
        }

    def _check_files(self) -> None:
        """Raise InputError if a motion file has changed since the cell was planned."""
        for path, planned in self.files.items():
            present = digest_of(path)
            if present != planned:
                raise InputError(
                    f"{path} must be the file that was planned, "
                    f"{planned[:8]}, got {present[:8]}"
                )


@dataclass(frozen=True)
class SearchCell(Cell):
    """One search of a suite's problem by one optimiser.

    Attributes:
        method: The optimiser's name.
        suite: The suite's name.
        function: The function's number.
        dimension: Number of coordinates.
        instance: The number of the variation of the function.
        evaluations: The budget of the search.
        settings: The optimiser's settings by name.
        infeasible: The treatment of proposals outside the limits of a person.
        seed: The seed of all random numbers.
        name: The optimiser's name in reports.
        version: The versions of posefit and of the optimiser's plugin.
    """

    method: str
    suite: str
    function: int
    dimension: int
    instance: int
    evaluations: int
    settings: Mapping[str, Any] = field(default_factory=dict)
    infeasible: str = "repair"
    seed: int = 0
    name: str = ""
    version: str = field(default_factory=posefit_build)
    kind: ClassVar[str] = "search"

    def __str__(self) -> str:
        problem = f"f{self.function} in {self.dimension}D, instance {self.instance}"
        return f"{self.name or self.method} on {problem}, seed {self.seed}"

    def measure(self) -> dict[str, Any]:
        """Search the problem, and return the figures."""
        from posefit.suites.problem import suite
        from posefit.suites.running import run_on

        problem = suite(
            self.suite,
            self.function,
            self.instance,
            self.dimension,
            infeasible=self.infeasible,  # type: ignore[arg-type]
        )
        run = run_on(
            problem,
            self.method,
            self.settings,
            evaluations=self.evaluations,
            seed=self.seed,
        )
        return {
            "cost": run.cost,
            "truth_cost": run.truth_cost,
            "evaluations_used": problem.evaluations,
            "dimensions": problem.dimension,
            "trace": {
                "evaluations": [int(used) for used in run.evaluations],
                "cost": run.costs.tolist(),
            },
            "warnings": [],
        }


KINDS: dict[str, type[TrackCell] | type[SearchCell]] = {
    TrackCell.kind: TrackCell,
    SearchCell.kind: SearchCell,
}


def cell_from(spec: Mapping[str, Any]) -> Cell:
    """Return the cell of a spec that was read from JSON."""
    values: dict[str, Any] = {}
    for name, value in spec.items():
        if name != "kind":
            values[name] = tuple(value) if isinstance(value, list) else value
    return KINDS[spec["kind"]](**values)


def run_cell(cell: Cell) -> dict[str, Any]:
    """Run a cell and return its row.

    Returns:
        The cell's key, its spec, its status, its figures and the seconds that it took.

    Raises:
        ValueError: The installed posefit or plugin, of a remote worker for example, is
            not the planned version, or a figure is not a finite number.
    """
    start_time = time.perf_counter()
    for planned in cell.version.split(", "):
        if installed := other_version(planned):
            raise InputError(f"a worker must have {planned}, got {installed}")
    figures = cell.measure()
    row = {
        "key": cell.key,
        "spec": cell.spec,
        "status": "done",
        **figures,
        "seconds": time.perf_counter() - start_time,
    }
    try:
        json.dumps(row, allow_nan=False)
    except ValueError:
        raise InputError(
            f"the figures of {cell.method} must be finite numbers, "
            "got some that are not"
        ) from None
    return row


def cell_scene(cell: TrackCell) -> "Scene":
    """Return the scene of a cell, which is the same for all methods and seeds."""
    from posefit.footage.scene import synthetic, with_corruption
    from posefit.motion.instances import motion_of_instance, variation

    motion = motion_of_instance(
        cell.motion, cell.instance, frames=cell.frames, fps=cell.fps
    )
    views = variation(cell.instance).views(cell.view_degrees)
    scene = synthetic(motion, views, cell.size, [], (None, None))
    scene = _with_known_person(cell, scene)
    if not cell.corruption:
        return scene
    # dropped masks are not noise on a mask: `with_corruption` takes their share apart
    noise = dict(cell.corruption)
    noise.pop(DROPPED, None)
    observations = with_corruption(
        scene.observations, noise, cell.corruption.get(DROPPED, 0.0), cell.instance
    )
    return replace(scene, observations=observations)


def _with_known_person(cell: TrackCell, scene: "Scene") -> "Scene":
    """Return the scene with the first yaw and the body that a method gets.

    Both have random errors up to the cell's limits.
    """
    import numpy as np

    from posefit.geometry.body import varied

    if not (cell.yaw_off_degrees or cell.body_off_percent):
        return scene
    stream = [RNG_STREAM_PERSON, cell.instance, *Path(cell.motion).stem.encode()]
    yaw_rng, body_rng = np.random.default_rng(stream).spawn(2)
    yaw = None
    if scene.yaw is not None and cell.yaw_off_degrees < ALL_AROUND:
        error = np.radians(cell.yaw_off_degrees) * yaw_rng.uniform(-1.0, 1.0)
        yaw = scene.yaw + float(error)
    body = varied(scene.body, cell.body_off_percent, body_rng)
    return replace(scene, yaw=yaw, body=body)


def json_of(value: Any) -> str:
    """Return the canonical JSON text of a value: equal values have the same text."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest_of(path: str | Path) -> str:
    """Return the SHA-256 of a file's content. Raises InputError if it is not a file."""
    if not Path(path).is_file():
        raise InputError(f"{path}: expected a file, got none")
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
