"""posefit recovers a person's 3D pose from silhouettes, by searching.

    import posefit
    result = posefit.track("walk")          # follow a built-in motion; the same as `posefit track walk`
    print(result.summary["error_degrees"])

The pieces: `Skeleton`, `Body` and `Camera` describe the person and the view; `Silhouette` an observation; `SearchSpace`
the box that optimisers search; `PoseProblem` the cost; `minimise` the loop; `SynthesisTracker` follows a sequence;
`suite` numbers problems for a benchmark.
Plugins add optimisers and priors: see `posefit.hooks`. Each name is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pluggy import HookimplMarker

from posefit.version import __version__ as __version__

if TYPE_CHECKING:
    from posefit.fitting.box import Space as Space
    from posefit.fitting.box import Start as Start
    from posefit.fitting.optimiser import Filter as Filter
    from posefit.fitting.optimiser import Minimum as Minimum
    from posefit.fitting.optimiser import Optimiser as Optimiser
    from posefit.fitting.optimiser import minimise as minimise
    from posefit.fitting.prior import Prior as Prior
    from posefit.fitting.problem import PoseProblem as PoseProblem
    from posefit.fitting.space import SearchSpace as SearchSpace
    from posefit.fitting.tracker import Frame as Frame
    from posefit.fitting.tracker import Observation as Observation
    from posefit.fitting.tracker import SynthesisTracker as SynthesisTracker
    from posefit.fitting.tracker import Task as Task
    from posefit.fitting.tracker import Tracker as Tracker
    from posefit.footage.segmentation import Extraction as Extraction
    from posefit.geometry.body import Body as Body
    from posefit.geometry.camera import Camera as Camera
    from posefit.geometry.skeleton import Skeleton as Skeleton
    from posefit.motion.motion import Motion as Motion
    from posefit.report.comparison import Comparison as Comparison
    from posefit.report.comparison import compare as compare
    from posefit.silhouette.mask import Silhouette as Silhouette
    from posefit.suites.problem import Problem as Problem
    from posefit.suites.problem import Suite as Suite
    from posefit.suites.problem import suite as suite
    from posefit.tracking.front import fit as fit
    from posefit.tracking.front import track as track
    from posefit.tracking.result import Fit as Fit
    from posefit.tracking.result import Track as Track

hookimpl = HookimplMarker("posefit")

_HOMES = {
    "geometry.body": ("Body",),
    "geometry.camera": ("Camera",),
    "geometry.skeleton": ("Skeleton",),
    "silhouette.mask": ("Silhouette",),
    "motion.motion": ("Motion",),
    "fitting.box": ("Space", "Start"),
    "fitting.optimiser": ("Filter", "Minimum", "Optimiser", "minimise"),
    "fitting.prior": ("Prior",),
    "fitting.problem": ("PoseProblem",),
    "fitting.space": ("SearchSpace",),
    "fitting.tracker": ("Frame", "Observation", "SynthesisTracker", "Task", "Tracker"),
    "suites.problem": ("Problem", "Suite", "suite"),
    "tracking.front": ("fit", "track"),
    "tracking.result": ("Fit", "Track"),
    "report.comparison": ("Comparison", "compare"),
    "footage.segmentation": ("Extraction",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
__all__ = ["__version__", "hookimpl", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'posefit' has no attribute {name!r}")
    value = getattr(import_module(f"posefit.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
