"""The text that a track prints.

It compares the method with trivial ones, and names everything undetermined and the
budget.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from posefit.errors import printable
from posefit.evaluation.errors import flagged
from posefit.evaluation.measures import BASELINES, MEASURES, Measures
from posefit.evaluation.trust import trust_line
from posefit.output.content import Content
from posefit.reading import counted

# parts of the build that differ less from the average are not mentioned
MIN_BUILD_CHANGE = 0.05
MIN_OPEN_WEIGHT = 0.08  # poses with less weight do not count as open
WIDTH = 30  # characters of the column of names
GAIT_ROWS = (  # the measures of a foot: name, label, unit, factor and digits
    ("step_length", "step", "m", 1.0, 2),
    ("step_seconds", "step", "s", 1.0, 2),
    ("stance_share", "stance", "%", 100.0, 0),
)
MAX_NAMED = 8  # if there are more motions, only the first and the last are named


def brief(track: Content) -> list[str]:
    """Return the short report of a track as lines.

    They say how good the track is, which poses a single frame leaves open, and how much
    work the track took.
    """
    setup = track.setup
    measures = track.measures
    lines = [_quality(measures) if track.trust is None else track.trust.sentence]
    open_poses = sum(weight >= MIN_OPEN_WEIGHT for weight in track.log.modes or [])
    if setup.frames == 1 and open_poses > 1:
        lines.append(f"{open_poses} poses are possible with this one silhouette")
    guessed = ", camera guessed" if setup.camera == "guessed" else ""
    frames = counted(setup.frames, "frame")
    made_by = f"{frames} by {setup.method}{guessed}"
    lines.append(f"{setup.motion}: {made_by}, {_effort(track)}")
    return [printable(line) for line in lines]


def detailed(track: Content) -> str:
    """Return the lines that `posefit track --verbose` prints."""
    setup = track.setup
    measures = track.measures
    log = track.log
    lines = []
    if track.trust is not None:
        lines += [track.trust.sentence, trust_line(asdict(track.trust))]
    frames = counted(setup.frames, "frame")
    lines.append(
        f"{setup.motion}: {frames}, {setup.method}, seed {setup.seed}, "
        f"translation {setup.translation}, trained on {_training(setup.train)}"
    )
    lines += _error_lines(setup.method, measures)
    lines += filter(None, [held_frames(track), undetermined(track)])
    if setup.frames > 1:
        lines.append(gait_line(track.gait.as_dict()))
    if log.build is not None:
        lines.append(_build_line(log.build))
    if setup.camera == "guessed":
        lines.append(
            "camera guessed: level, 40 degrees across; "
            "distances and size depend on this guess and on --height"
        )
    if log.hypotheses:
        lines.append(_hypotheses_line(log.hypotheses))
    speed = MEASURES["evaluations_per_second"].number(measures.evaluations_per_second)
    lines.append(f"{_effort(track)}, {speed} poses a second")
    return "\n".join(map(printable, lines))  # the lines may have names of files


def _training(names: Sequence[str]) -> str:
    """Return the names of training motions, or the number of many."""
    if len(names) > MAX_NAMED:
        return f"{len(names)} clips, {names[0]} to {names[-1]}"
    return ", ".join(names)


def _hypotheses_line(hypotheses: Sequence[Mapping[str, Any]]) -> str:
    """Return which hypothesis is kept, and the costs of all."""
    kept = ""
    costs = []
    for number, hypothesis in enumerate(hypotheses, 1):
        cost = hypothesis["cost"] + hypothesis["motion"]
        costs.append(f"{hypothesis['guess']} {cost:.2f}")
        if hypothesis["kept"]:
            kept = f"kept track {number} of {len(hypotheses)}"
    return f"{kept}; trajectory cost by initial guess: {', '.join(costs)}"


def _error_lines(method: str, measures: Measures) -> list[str]:
    """Return the errors of a method and of the baselines, if the truth is known."""
    if measures.error_degrees is None:
        return []
    lines = [
        f"{'':{WIDTH}} {'error deg':>9} {'skill':>7}",
        f"{method:{WIDTH}} {measures.error_degrees.mean:9.2f}",
    ]
    for name, baseline in (measures.baselines_degrees or {}).items():
        # a dash if the skill is unknown because the baseline has no error
        skill = MEASURES["skill"].number((measures.skill or {})[name])
        lines.append(f"{BASELINES[name]:{WIDTH}} {baseline:9.2f} {skill:>7}")
    # a tracker from a plugin may have no prior
    if measures.prior_floor_degrees is not None:
        floor = MEASURES["prior_floor_degrees"]
        lines.append(
            f"{floor.label:{WIDTH}} {floor.number(measures.prior_floor_degrees):>9}"
        )
    names = ("mpjpe_mm", "pa_mpjpe_mm", "swap_rate", "lost_rate")
    shown = [_shown(measures, name) for name in names]
    return [*lines, f"{', '.join(shown)} of frames"]


def _build_line(build: Mapping[str, Any]) -> str:
    parts = []
    for name, factor in build["factors"].items():
        if abs(factor - 1.0) >= MIN_BUILD_CHANGE:
            parts.append(f"{name} {factor:.2f} +- {build['spread'][name]:.2f}")
    changes = ", ".join(parts) or "nothing notable"
    stature = f"build: {build['stature_m']:.2f} m tall"
    return f"{stature}; compared with the average: {changes}"


def held_frames(track: Content) -> str:
    """Return one sentence about the frames that were not searched, or ""."""
    count = track.measures.held_frames
    if not count:
        return ""
    show = "frame shows" if count == 1 else "frames show"
    return (
        f"{count} {show} too little of the person: the pose is held or continued, "
        "not searched, and may be wrong; these frames are excluded from the IoU"
    )


def undetermined(track: Content) -> str:
    """Return one sentence about everything that a method left undetermined, or ""."""
    parts = []
    words = {"unknown_sides": "left and right unknown in", "lost": "lost in"}
    for name, flag in words.items():
        frames = flagged(track.table, name)
        if frames is not None and frames.frames.any():
            parts.append(f"{flag} {frames.frames.sum()} of {frames.known}")
    if not parts:
        return ""
    return f"{', '.join(parts)} frames that show enough of the person"


def gait_line(gait: Mapping[str, Any], *, by_side: bool = True) -> str:
    """Return one line about the gait, or why there are no figures of it.

    With `by_side` it begins with "gait:" and has the figures of both feet.
    """
    if not gait["walk"]:
        return f"no figures of gait: {gait['why']}"
    speed = ""
    if gait["speed"] is not None:
        speed = f", {gait['speed']:.2f} m/s"
    cadence = f"{gait['cadence']:.0f} steps a minute"
    parts = [f"{cadence}{speed}, over {gait['steps']} steps"]
    if by_side:
        parts[0] = f"gait: {parts[0]}"
        sides = []
        for label, unit, left, right in gait_rows(gait):
            sides.append(f"{label} {left} and {right} {unit}")
        parts.append(f"left and right: {', '.join(sides)}")
    if gait["why_no_lengths"]:
        parts.append(f"no lengths: {gait['why_no_lengths']}")
    return "; ".join(parts)


def gait_rows(gait: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return the measures of a walk by side: label, unit, left and right.

    A measure that is unknown on both sides is left out.
    """
    rows = []
    for name, label, unit, factor, digits in GAIT_ROWS:
        texts = []
        for side in ("left", "right"):
            value = gait[side][name]
            text = "-"
            if value is not None:
                text = f"{factor * value:.{digits}f}"
            texts.append(text)
        if texts != ["-", "-"]:
            left, right = texts
            rows.append((label, unit, left, right))
    return rows


def _quality(measures: Measures) -> str:
    mean = measures.error_degrees.mean if measures.error_degrees else None
    error = MEASURES["error_degrees"].shown(mean)
    lost = _shown(measures, "lost_rate")
    return f"{_shown(measures, 'mpjpe_mm')}, {error}, {lost} of frames"


def _effort(track: Content) -> str:
    measures = track.measures
    setup = track.setup
    seconds = MEASURES["seconds_per_frame"].number(measures.seconds_per_frame)
    budget = setup.evaluations_per_frame * max(len(track.log.hypotheses), 1)
    effort = measures.effort or {"frames": measures.evaluations}
    per_frame = effort["frames"] / setup.frames
    # no budget is named if frames were searched again and so used more than one
    of_budget = f" of {budget:,}" if per_frame <= budget else ""
    stages = []
    for stage, count in effort.items():
        if stage != "frames":
            stages.append(f"{count:,} for the {stage.replace('_', ' ')}")
    other_stages = f" (and {', '.join(stages)})" if stages else ""
    evaluations = f"{per_frame:,.0f}{of_budget} evaluations{other_stages}"
    return f"{_shown(measures, 'iou')}, {evaluations} and {seconds} ms a frame"


def _shown(measures: Measures, name: str) -> str:
    return MEASURES[name].shown(getattr(measures, name))
