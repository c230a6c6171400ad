"""The figures of a track, each defined once: its name, label, unit, digits and meaning.

`Measures` has the figures of a whole track. They have the same names in summary.json,
in `--json`, in the rows of a sweep, in its CSV and in the report. A figure that needs
the truth is None if the truth is unknown.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

# Trivial methods with which a track is compared, and their labels. All of them have the
# true root and translation.
BASELINES = {
    "mean_pose": "mean training pose",
    "persistence": "first true pose, held",
    "nearest": "best training pose",
}


@dataclass(frozen=True)
class Measure:
    """The definition of a figure.

    Attributes:
        name: Its name in files.
        label: Its name in texts.
        unit: The unit of displayed values, "" if it has none.
        digits: The digits after the point of displayed values.
        meaning: Its meaning in half a sentence.
        factor: Multiplies a value to convert it to `unit`.
    """

    name: str
    label: str
    unit: str
    digits: int
    meaning: str
    factor: float = 1.0

    def number(self, value: float | None) -> str:
        """Return a value with its digits and without its unit, or "-" for None."""
        if value is None:
            return "-"
        return f"{self.factor * value:,.{self.digits}f}"

    def shown(self, value: float | None) -> str:
        """Return a value with its label and unit, such as `MPJPE 18 mm`."""
        words = (self.label, self.number(value), self.unit)
        # some figures have no unit
        return " ".join(filter(None, words))


def _figure(*figure: Any) -> Any:
    """Return the field of a figure, None by default.

    The arguments are the fields of a `Measure` except its name.
    """
    return field(default=None, metadata={"measure": figure})


def _share(label: str, meaning: str) -> Any:
    """Return the field of a share, which is displayed in percent."""
    return _figure(label, "%", 0, meaning, 100.0)


@dataclass(frozen=True)
class Spread:
    """A figure over the frames of a track."""

    mean: float
    std: float
    max: float


@dataclass(frozen=True)
class Effort:
    """The effort of a track, from reading the first mask."""

    seconds: float
    cpu_seconds: float
    # of each stage: first_pose, build, frames, later_passes; empty if all are of frames
    evaluations: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Measures:
    """The figures of one track, which `MEASURES` defines.

    Figures of baselines, and skills, are by the names of `BASELINES`.
    """

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
        "mean angle between true and estimated rotations of the root and the joints",
    )
    free_error_degrees: float | None = _figure(
        "error of free angles",
        "degrees",
        2,
        "error over only the angles that the skeleton leaves free",
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
        "MPJPE after the best rotation, scale and translation (Procrustes)",
    )
    iou: float = _figure(
        "IoU",
        "",
        3,
        "intersection over union of body and mask, the mean over usable views and "
        "frames",
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
        "share of joints, except the root, with the truth in their 50, 80 and 95 % "
        "intervals",
    )
    interval_mm: Mapping[str, float] | None = _figure(
        "interval",
        "mm",
        0,
        "radius of the balls about joints that contain the true joint in 50, 80 and "
        "95 % of cases, the mean over all joints except the root",
    )
    unknown_rate: float | None = _share(
        "flagged unknown",
        "share of frames whose left and right the method calls unknown",
    )
    swapped_known_rate: float | None = _share(
        "swapped where known",
        "share of swapped frames among those whose left and right are called known",
    )
    lost_flagged_rate: float | None = _share(
        "flagged lost", "share of frames that the method calls lost"
    )
    acceleration: float | None = _figure(
        "acceleration",
        "m/s2",
        1,
        "acceleration of the joints, the mean over joints and frames: about 6 in a "
        "walk; more is jitter",
    )
    acceleration_ratio: float | None = _figure(
        "acceleration ratio",
        "",
        1,
        "acceleration of the joints over that of the true joints",
    )
    foot_slide_mm: float | None = _figure(
        "foot slide",
        "mm a step",
        0,
        "distance that a standing foot moves along the ground, the mean over steps: "
        "about 20 in motion capture; the true motion decides when a foot stands or, if "
        "the truth is unknown, a foot that is low and slow counts as standing",
    )
    held_frames: int = _figure(
        "held",
        "frames",
        0,
        "frames that show too little: the pose is not searched, but held or continued",
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
        "baselines' MPJPE",
        "mm",
        0,
        "MPJPE of trivial methods, given the true root and translation",
    )
    prior_floor_degrees: float | None = _figure(
        "truth projected into the prior",
        "degrees",
        2,
        "error of the projected true poses; a lower limit for linear priors",
    )
    seconds_per_frame: float = _figure(
        "time",
        "ms a frame",
        1,
        "wall time from the first mask to the last pose, over the frames",
        1e3,
    )
    cpu_seconds_per_frame: float = _figure(
        "CPU time",
        "ms a frame",
        1,
        "CPU time of all threads from the first mask to the last pose, over the frames",
        1e3,
    )
    evaluations: int = _figure(
        "evaluations", "", 0, "poses whose cost was computed, in all stages together"
    )
    effort: Mapping[str, int] | None = _figure(
        "effort",
        "evaluations",
        0,
        "evaluations by stage: the first pose, the build, the frames, and later passes "
        "over them",
    )
    evaluations_per_second: float = _figure(
        "speed", "poses a second", 0, "evaluations over the wall time of the track"
    )


MEASURES = dict[str, Measure]()
for _field in fields(Measures):
    MEASURES[_field.name] = Measure(_field.name, *_field.metadata["measure"])
