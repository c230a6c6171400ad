"""The figures that say what a track is worth, each defined once: its name, label, unit, digits and meaning.

`Measures` are those of a whole track: summary.json, `--json`, the rows of a sweep, its CSV and the report's columns
have them under these names. Where the truth is unknown, a figure that needs it is None.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

# Trivial methods that a track is held against, and what a table calls them. All have the true root and translation.
BASELINES = {
    "mean_pose": "mean training pose",
    "persistence": "first true pose, held",
    "nearest": "best training pose",
}


@dataclass(frozen=True)
class Measure:
    """What a figure is: what it is called, how it is shown, and what it means."""

    name: str
    label: str
    unit: str  # in which it is shown; "" for none
    digits: int  # that are shown after the point
    meaning: str
    factor: float = 1.0  # what a value is multiplied by to be in `unit`

    def number(self, value: float | None) -> str:
        """Return a value with its digits and without its unit; a dash where there is none."""
        return "-" if value is None else f"{self.factor * value:,.{self.digits}f}"

    def shown(self, value: float | None) -> str:
        """Return a value with its label and unit, such as `MPJPE 18 mm`."""
        return " ".join(
            word for word in (self.label, self.number(value), self.unit) if word
        )


def _figure(*figure: Any) -> Any:
    """Return the field of a figure, None where it is unknown: all of `Measure` but the name."""
    return field(default=None, metadata={"measure": figure})


def _share(label: str, meaning: str) -> Any:
    return _figure(label, "%", 0, meaning, 100.0)


@dataclass(frozen=True)
class Spread:
    """A figure over the frames of a track."""

    mean: float
    std: float
    max: float


@dataclass(frozen=True)
class Effort:
    """What a track took, from the first mask that was read."""

    seconds: float
    cpu_seconds: float
    # of each stage: first_pose, build, frames, later_passes; empty where all are of the frames
    evaluations: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Measures:
    """What one track is worth. Baselines and skill are by the names of `BASELINES`."""

    error_degrees: Spread | None = _figure(
        "error",
        "degrees",
        2,
        "mean absolute difference of the 66 angles from the true ones. SAPSO (8)-(10)",
    )
    geodesic_degrees: float | None = _figure(
        "geodesic",
        "degrees",
        2,
        "angle between true and estimated rotations of root and joints, the mean",
    )
    free_error_degrees: float | None = _figure(
        "error of free angles",
        "degrees",
        2,
        "the error over those angles alone that the skeleton lets move",
    )
    mpjpe_mm: float | None = _figure(
        "MPJPE",
        "mm",
        0,
        "mean distance of the 27 joints from the true ones, both roots at one point",
    )
    pa_mpjpe_mm: float | None = _figure(
        "PA-MPJPE",
        "mm",
        0,
        "the same after the best rotation, scale and translation (Procrustes)",
    )
    iou: float = _figure(
        "IoU",
        "",
        3,
        "intersection over union of body and mask, the mean over usable views and frames",
    )
    cost: float = _figure(
        "cost", "", 2, "silhouette mismatch of the estimated poses, 0 to 100. SAPSO (4)"
    )
    swap_rate: float | None = _share(
        "left/right swapped", "share of frames nearer to the truth when mirrored"
    )
    lost_rate: float | None = _share(
        "lost", "share of frames with an MPJPE above 150 mm"
    )
    coverage: Mapping[str, float] | None = _share(
        "coverage",
        "share of joints but the root whose truth lies within their 50, 80 and 95 % intervals",
    )
    interval_mm: Mapping[str, float] | None = _figure(
        "interval",
        "mm",
        0,
        "radius about a joint that holds it in 50, 80 and 95 % of cases, the mean over all but the root",
    )
    unknown_rate: float | None = _share(
        "flagged unknown",
        "share of frames whose left and right the method calls unknown",
    )
    swapped_known_rate: float | None = _share(
        "swapped where known",
        "share swapped of the frames whose left and right it calls known",
    )
    lost_flagged_rate: float | None = _share(
        "flagged lost", "share of frames that the method calls lost"
    )
    acceleration: float | None = _figure(
        "acceleration",
        "m/s2",
        1,
        "of the joints, the mean over joints and frames: about 6 in a walk; more is jitter",
    )
    acceleration_ratio: float | None = _figure(
        "acceleration ratio", "", 1, "the same, over that of the true joints"
    )
    foot_slide_mm: float | None = _figure(
        "foot slide",
        "mm a step",
        0,
        "how far a foot that stands (as the true one does, else where it is low and slow) gets along the ground, the "
        "mean over steps: about 20 of motion capture",
    )
    held_frames: int = _figure(
        "held",
        "frames",
        0,
        "frames that show too little: the pose is held or carried on, not searched",
    )
    skill: Mapping[str, float | None] | None = _figure(
        "skill",
        "",
        2,
        "1 - error / the baseline's error: 1 is perfect, 0 no better than the baseline",
    )
    baselines_degrees: Mapping[str, float] | None = _figure(
        "baselines",
        "degrees",
        2,
        "errors of trivial methods, given the true root and translation",
    )
    baselines_mm: Mapping[str, float] | None = _figure(
        "baselines' MPJPE", "mm", 0, "MPJPE of trivial methods, given the same"
    )
    prior_floor_degrees: float | None = _figure(
        "truth projected into the prior",
        "degrees",
        2,
        "error of the true poses' projection; a floor of linear priors",
    )
    seconds_per_frame: float = _figure(
        "time",
        "ms a frame",
        1,
        "wall time from the first mask to the last pose, over the frames",
        1e3,
    )
    cpu_seconds_per_frame: float = _figure(
        "CPU time", "ms a frame", 1, "the same in CPU time of all threads", 1e3
    )
    evaluations: int = _figure(
        "evaluations", "", 0, "poses whose cost was computed, in all stages together"
    )
    effort: Mapping[str, int] | None = _figure(
        "effort",
        "evaluations",
        0,
        "evaluations by stage: the first pose, the build, the frames, and later passes over them",
    )
    evaluations_per_second: float = _figure(
        "speed", "poses a second", 0, "evaluations over that time"
    )


MEASURES = {
    figure.name: Measure(figure.name, *figure.metadata["measure"])
    for figure in fields(Measures)
}
