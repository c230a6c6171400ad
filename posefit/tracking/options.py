"""The options of a track, for `posefit.track` and the flags of the command line.

Nothing slow is imported here, because every start of the command line imports this
module.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from posefit.errors import InputError
from posefit.footage.options import SourceOptions
from posefit.options import choice, option, whole_option
from posefit.reading import quoted

if TYPE_CHECKING:
    from posefit.fitting.optimiser import OptimiserFactory
    from posefit.fitting.prior import Prior
    from posefit.fitting.space import Translation
    from posefit.fitting.tracker import TrackerFactory
    from posefit.motion.clips import FileOptions, Source

# per frame: N (C + 1) with N = 40 and C = 60 of the SAPSO paper, section 5.2
EVALUATIONS = 2440


def _device(_name: str, value: Any) -> str:
    from posefit.footage.device import device_of

    device_of(value)
    return str(value)


def _flag(name: str, value: Any) -> bool:
    # NumPy's booleans are not Python's
    value = value.item() if hasattr(value, "item") else value
    if not isinstance(value, bool):
        raise InputError(f"{name} must be True or False, got {quoted(value)}")
    return value


def _method(name: str, value: Any) -> Any:
    is_pair = isinstance(value, tuple) and len(value) == 2
    if not (isinstance(value, str) or callable(value) or is_pair):
        raise InputError(
            f"{name} must be a name, a factory, or a pair of optimiser and prior, "
            f"got {quoted(value)}"
        )
    return value


def _sources(name: str, value: Any) -> Sequence[Any]:
    if isinstance(value, str | Path) or not isinstance(value, Sequence):
        raise InputError(f"{name} must be a list of motions, got {quoted(value)}")
    return value


@dataclass(frozen=True, kw_only=True)
class TrackOptions(SourceOptions):
    """The options of a track, checked.

    For an option that is None or empty, the default depends on the source. In Python
    `method` may also be a tracker's class, or a pair: an optimiser, by name or class,
    and a prior, by name or fitted.
    """

    method: "str | TrackerFactory | tuple[str | OptimiserFactory, str | Prior] | None" = option(  # noqa: E501
        None,
        "OPTIMISER@PRIOR such as cma@pca, OPTIMISER, @PRIOR, or a tracker such as "
        "vsmm; `posefit plugins` lists them. Default: exemplars, or annealed@pca for "
        "a built-in motion.",
        _method,
        "METHOD",
        heading="Method and budget",
    )
    settings: Mapping[str, Any] | Sequence[str] = option(
        (),
        "Setting of a plugin, such as sapso.cooling=0.9, or cooling=0.9 if only one "
        "plugin has it; repeatable.",
        None,
        "[NAME.]SETTING=VALUE",
        "set",
        repeated=True,
    )
    train: "Sequence[Source]" = option(
        (),
        "Training motions: a motion, a folder, library, or library:16; repeatable. "
        "Default: library for exemplars; for other methods the other styles of a "
        "built-in motion, or the built-in walks.",
        _sources,
        "SOURCE",
        repeated=True,
    )
    evaluations: int | None = whole_option(
        None,
        "Number of poses to compare with each frame. Default: 9760 for exemplars, else "
        "2440.",
        1,
        "POSES",
    )
    translation: "Translation | None" = option(
        None,
        "Position of the root: known (the true one), searched, or aligned to the mask. "
        "Default: known for motions, aligned for footage.",
        choice("known", "searched", "aligned"),
        "HOW",
        heading="Tracking",
    )
    first_pose: Literal["searched", "given"] = option(
        "searched",
        "First pose: searched, or given (the truth).",
        choice("searched", "given"),
        "HOW",
    )
    restarts: int | None = whole_option(
        None,
        "Largest number of searches for an unknown first pose. Default: 8, or 0 for "
        "a tracker that looks ahead.",
        0,
    )
    body_frames: int | None = whole_option(
        None,
        "Frames to which the build is fitted. Default: 12 for footage, else 0.",
        0,
        live=False,
    )
    hypotheses: int = whole_option(
        1,
        "Number of tracks from different initial guesses, each at the full budget. One "
        "is kept.",
        1,
        live=False,
    )
    smooth: bool | None = option(
        None,
        "Smooth the root, and keep feet from sliding. Default: only for footage.",
        _flag,
        parse=bool,
        identifies=False,
        live=False,
    )
    seed: int = whole_option(
        0, "Seed of all random numbers.", 0, heading="Method and budget"
    )
    threads: int | None = whole_option(
        None,
        "Number of threads. Does not change the result. Default: the processor's "
        "cores, at most 4.",
        1,
        identifies=False,
    )
    device: str = option(
        "cpu",
        "Where poses are rasterised: cpu, or a plugin's device, such as a GPU.",
        _device,
        "NAME",
        identifies=False,
    )

    @property
    def of_files(self) -> "FileOptions":
        """The options for the files of training motions."""
        from posefit.motion.clips import FileOptions

        return FileOptions(self.asf, rate=self.rate)
