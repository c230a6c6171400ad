"""A cell: one run of a sweep, a track or a search, described completely by names and numbers; and its result."""

import hashlib
import json
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from posefit.errors import InputError
from posefit.settings import settings_text
from posefit.version import posefit_build

if TYPE_CHECKING:
    from posefit.footage.scene import Scene

ALL_AROUND = 180.0  # degrees that a yaw may be off when it is unknown
RNG_STREAM_PERSON = 2001  # of what a method knows of the person
DROPPED = "dropped"  # the corruption that removes whole frames, a share of them
# that a row has under another name, or not at all
RENAMED_MEASURES = ("evaluations", "evaluations_per_second")


class Cell:
    """Everything that one run depends on. `posefit.sweep.plan` makes cells that are checked.

    `version` is that of posefit and of the method's plugins, with digests of their sources: see
    `posefit.registry.version_of`. `name` is what reports call the method; it changes no result, and no key.
    """

    kind: ClassVar[str]  # "track" or "search"
    method: str
    settings: Mapping[str, Any]
    evaluations: int
    instance: int
    seed: int
    name: str
    version: str

    @cached_property
    def spec(self) -> dict[str, Any]:
        """The cell as JSON holds it."""
        spec: dict[str, Any] = json.loads(json.dumps(self._values))
        return spec

    @cached_property
    def key(self) -> str:
        """The SHA-256 of its spec without its name, version included, as 64 hexadecimal digits."""
        return hashlib.sha256(
            json_of({**self._values, "name": ""}).encode()
        ).hexdigest()

    @property
    def _values(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            **{field.name: getattr(self, field.name) for field in fields(self)},  # type: ignore[arg-type]
        }

    @property
    def total_evaluations(self) -> int:
        """The evaluations of the whole cell."""
        return self.evaluations

    def measure(self) -> dict[str, Any]:
        """Run it, and return its figures as JSON holds them: the same bits wherever it ran, but for the times.

        Raises ValueError where a file has changed since it was planned.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class TrackCell(Cell):
    """A motion that is tracked.

    `method` is `OPTIMISER@PRIOR` or a tracker's name; `settings` are named `NAME.SETTING`, as for `--set`. `instance`
    numbers what the cameras see of the motion, see `posefit.motion.instances`. `corruption` gives kinds of
    `posefit.silhouette.corruption` their strength, 0 to 1, and `dropped` the share of frames without masks; the damage
    follows from the instance, so that it is the same for every method and seed. `hypotheses` is how many times the
    motion is tracked, see `posefit.tracking.restarts`. `files` holds the SHA-256 of every capture file that is read.

    Of the person a method knows where they face at first, at most `yaw_off_degrees` off, nothing at 180; and their
    body, each bone's length and radii at most `body_off_percent` off. Both are drawn from the instance and the motion's
    name. A field that has the name of an option of `posefit.tracking.options.TrackOptions` is that option.
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
        return f"{self.name or self.method} on {self.motion}, instance {self.instance}, seed {self.seed}"

    @property
    def total_evaluations(self) -> int:
        """The evaluations of all frames, by every hypothesis."""
        return self.hypotheses * self.frames * self.evaluations

    def measure(self) -> dict[str, Any]:
        """Track the motion. Raises ValueError where a file has changed since it was planned."""
        from posefit.evaluation.errors import anytime_trace, mode_reliability
        from posefit.evaluation.measures import MEASURES
        from posefit.geometry.skeleton import joint_distances
        from posefit.motion.clips import training_clips, training_motions
        from posefit.tracking.defaults import completed
        from posefit.tracking.options import VIEW, TrackOptions
        from posefit.tracking.pipeline import track_scene

        for path, digest in self.files.items():
            if (present := digest_of(path)) != digest:
                raise InputError(
                    f"{path} must be the file that was planned, {digest[:8]}, got {present[:8]}"
                )
        scene = cell_scene(self)
        training = training_motions(
            training_clips(self.train, followed=self.motion), scene.fps
        )
        options_of_cells = {field.name for field in fields(TrackOptions)} - {
            *VIEW,
            "train",
        }
        values = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if field.name in options_of_cells
        }
        options = TrackOptions(**{**values, "settings": settings_text(self.settings)})
        result = track_scene(scene, training, completed(options, self.motion))
        assert result.truth is not None
        truth = result.truth.joints
        estimate = result.motion.joints
        # both roots at one point, as in `mpjpe_mm`
        errors = 1e3 * joint_distances(truth, estimate).mean(axis=0)
        measured = asdict(result.measures)
        return {
            **{
                name: measured[name]
                for name in MEASURES
                if name not in RENAMED_MEASURES
            },
            "warnings": result.log.warnings,
            "evaluations_used": result.measures.evaluations,
            "dimensions": result.setup.dimensions,
            "joint_errors_mm": [round(float(error), 3) for error in errors],
            "mode_reliability": mode_reliability(
                result.frames, truth, result.motion.skeleton
            ),
            "trace": anytime_trace(result.frames),
        }


@dataclass(frozen=True)
class SearchCell(Cell):
    """An optimiser that searches a problem of a suite once."""

    method: str
    suite: str
    function: int
    dimension: int
    instance: int
    evaluations: int
    settings: Mapping[str, Any] = field(default_factory=dict)  # of the optimiser
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
    kind.kind: kind for kind in (TrackCell, SearchCell)
}


def cell_from(spec: Mapping[str, Any]) -> Cell:
    """Return the cell of a spec, as JSON holds it."""
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in spec.items()
        if name != "kind"
    }
    return KINDS[spec["kind"]](**values)


def run_cell(cell: Cell) -> dict[str, Any]:
    """Return a cell's row: its key, its spec, its figures and the seconds it took.

    Raises ValueError where this posefit, on a remote worker perhaps, or one of its plugins is not the planned one.
    """
    began = time.perf_counter()
    for planned in cell.version.split(", "):
        if installed := other_version(planned):
            raise InputError(f"a worker must have {planned}, got {installed}")
    with _guarded(cell):
        figures = cell.measure()
    row = {
        "key": cell.key,
        "spec": cell.spec,
        "status": "done",
        **figures,
        "seconds": time.perf_counter() - began,
    }
    try:
        json.dumps(row, allow_nan=False)
    except ValueError:
        raise InputError(
            f"what {cell.method} measures must be finite numbers, got some that are not"
        ) from None
    return row


def _guarded(cell: Cell) -> AbstractContextManager[None]:
    """Return a context that undoes what a plugin from elsewhere does to libraries; posefit's own do nothing to them."""
    from posefit.sweep.worker import functions_kept

    if _own_origins().issuperset(cell.version.split(", ")[1:]):
        return nullcontext()
    return functions_kept()


@lru_cache(maxsize=1)
def _own_origins() -> frozenset[str]:
    """Return the origins of what posefit's own plugins offer."""
    from posefit.hooks import PROJECT
    from posefit.registry import registry

    offers = (offer for named in registry().offers.values() for offer in named.values())
    return frozenset(offer.origin for offer in offers if offer.distribution == PROJECT)


def other_version(origin: str) -> str | None:
    """Return what is installed instead of one origin of a version; None where it is this one, or is unknown here."""
    name = origin.partition(" ")[0]
    origins = installed()
    if origin in origins:
        return None
    return next((other for other in origins if other.partition(" ")[0] == name), None)


@lru_cache(maxsize=1)
def installed() -> frozenset[str]:
    """Return the origins of everything that is installed: see `posefit.registry.Offer.origin`."""
    from posefit.registry import registry

    offers = (offer for named in registry().offers.values() for offer in named.values())
    return frozenset([posefit_build(), *(offer.origin for offer in offers)])


def cell_scene(cell: TrackCell) -> "Scene":
    """Return the observations of a cell; the same for all methods and seeds."""
    from posefit.footage.scene import synthetic, with_corruption
    from posefit.motion.instances import motion_of_instance, variation

    motion = motion_of_instance(
        cell.motion, cell.instance, frames=cell.frames, fps=cell.fps
    )
    scene = synthetic(
        motion,
        variation(cell.instance).views(cell.view_degrees),
        cell.size,
        [],
        (None, None),
    )
    scene = _with_known_person(cell, scene)
    if not cell.corruption:
        return scene
    noise = {
        kind: strength for kind, strength in cell.corruption.items() if kind != DROPPED
    }
    observations = with_corruption(
        scene.observations, noise, cell.corruption.get(DROPPED, 0.0), cell.instance
    )
    return replace(scene, observations=observations)


def _with_known_person(cell: TrackCell, scene: "Scene") -> "Scene":
    """Return the scene with what a method knows of the person: about where they face at first, and their body."""
    import numpy as np

    from posefit.geometry.body import varied

    if not (cell.yaw_off_degrees or cell.body_off_percent):
        return scene
    stream = [RNG_STREAM_PERSON, cell.instance, *Path(cell.motion).stem.encode()]
    for_yaw, for_body = np.random.default_rng(stream).spawn(2)
    off = np.radians(cell.yaw_off_degrees) * for_yaw.uniform(-1.0, 1.0)
    yaw = (
        None
        if cell.yaw_off_degrees >= ALL_AROUND or scene.yaw is None
        else scene.yaw + float(off)
    )
    return replace(
        scene, yaw=yaw, body=varied(scene.body, cell.body_off_percent, for_body)
    )


def json_of(value: Any) -> str:
    """Return the one JSON text of a value, as keys are made of it."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest_of(path: str | Path) -> str:
    """Return the SHA-256 of a file's content. Raises InputError where there is no file, or something else."""
    if not Path(path).is_file():
        raise InputError(f"{path}: expected a file, got none")
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
