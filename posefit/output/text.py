"""The table a track prints: the method beside trivial ones, what was not determined, and the budget."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from posefit.errors import printable
from posefit.evaluation.measures import BASELINES, MEASURES, Measures
from posefit.evaluation.trust import trust_line
from posefit.output.content import Content
from posefit.reading import counted

# a part of the build that is off the average by less is not worth a word
MIN_BUILD_CHANGE = 0.05
MIN_MODE = 0.08  # of the weight of a pose that is worth a word
WIDTH = 30  # of the names
GAIT_ROWS = (  # of a foot: names, labels, units, factors and digits
    ("step_length", "step", "m", 1.0, 2),
    ("step_seconds", "step", "s", 1.0, 2),
    ("stance_share", "stance", "%", 100.0, 0),
)
MAX_NAMED = 8  # motions that were learned from, and are named


def brief(track: Content) -> list[str]:
    """Return in lines what a track is worth, which poses a single frame leaves open, and what it took."""
    setup = track.setup
    measures = track.measures
    worth = track.trust.sentence if track.trust is not None else _worth(measures)
    guessed = ", camera guessed" if setup.camera == "guessed" else ""
    work = f"{setup.motion}: {counted(setup.frames, 'frame')} by {setup.method}{guessed}, {_effort(track)}"
    open_poses = sum(weight >= MIN_MODE for weight in track.log.modes or [])
    modes = (
        [f"one silhouette leaves {open_poses} poses open"]
        if setup.frames == 1 and open_poses > 1
        else []
    )
    return [printable(line) for line in (worth, *modes, work)]


def table(track: Content) -> str:
    """Return the lines that `posefit track --verbose` prints."""
    setup = track.setup
    measures = track.measures
    log = track.log
    lines = (
        []
        if track.trust is None
        else [track.trust.sentence, trust_line(asdict(track.trust))]
    )
    names = setup.train
    training = (
        ", ".join(names)
        if len(names) <= MAX_NAMED
        else f"{len(names)} clips, {names[0]} to {names[-1]}"
    )
    lines.append(
        f"{setup.motion}: {counted(setup.frames, 'frame')}, {setup.method}, seed {setup.seed}, "
        f"translation {setup.translation}, trained on {training}"
    )
    lines += _error_lines(setup.method, measures)
    lines += filter(None, [held_frames(track), undetermined(track)])
    lines += [gait_line(track.gait.as_dict())] if setup.frames > 1 else []
    lines += [] if log.build is None else [_build_line(log.build)]
    if setup.camera == "guessed":
        lines.append(
            "camera guessed: level, 40 degrees across; distances and size are as good as that, and as --height"
        )
    if tracks := log.hypotheses:
        best = next(k for k, hypothesis in enumerate(tracks) if hypothesis["kept"])
        costs = [
            f"{hypothesis['guess']} {hypothesis['cost'] + hypothesis['motion']:.2f}"
            for hypothesis in tracks
        ]
        chosen = f"kept track {best + 1} of {len(tracks)}"
        lines.append(f"{chosen}; trajectory cost by initial guess: {', '.join(costs)}")
    speed = MEASURES["evaluations_per_second"].number(measures.evaluations_per_second)
    lines.append(f"{_effort(track)}, {speed} poses a second")
    return "\n".join(map(printable, lines))  # the names of files are among them


def _error_lines(method: str, measures: Measures) -> list[str]:
    """Return the errors of a method beside those of the baselines; none where the truth is unknown."""
    if measures.error_degrees is None:
        return []
    lines = [
        f"{'':{WIDTH}} {'error deg':>9} {'skill':>7}",
        f"{method:{WIDTH}} {measures.error_degrees.mean:9.2f}",
    ]
    for name, baseline in (measures.baselines_degrees or {}).items():
        # a dash where a baseline has no error
        skill = MEASURES["skill"].number((measures.skill or {})[name])
        lines.append(f"{BASELINES[name]:{WIDTH}} {baseline:9.2f} {skill:>7}")
    # a tracker of its own may have no prior
    if measures.prior_floor_degrees is not None:
        floor = MEASURES["prior_floor_degrees"]
        lines.append(
            f"{floor.label:{WIDTH}} {floor.number(measures.prior_floor_degrees):>9}"
        )
    shown = (
        _shown(measures, name)
        for name in ("mpjpe_mm", "pa_mpjpe_mm", "swap_rate", "lost_rate")
    )
    return [*lines, f"{', '.join(shown)} of frames"]


def _build_line(build: Mapping[str, Any]) -> str:
    parts = [
        f"{name} {factor:.2f} +- {build['spread'][name]:.2f}"
        for name, factor in build["factors"].items()
        if abs(factor - 1.0) >= MIN_BUILD_CHANGE
    ]
    return f"build: {build['stature_m']:.2f} m tall; against the average {', '.join(parts) or 'nothing notable'}"


def held_frames(track: Content) -> str:
    """Return in one sentence how many frames were not searched; empty where that is none."""
    count = track.measures.held_frames
    show = "frame shows" if count == 1 else "frames show"
    what = f"{count} {show} too little of the person: the pose is held or carried on, not searched"
    return (
        f"{what}, and may be off the person; IoU is that of the others" if count else ""
    )


def undetermined(track: Content) -> str:
    """Return in one sentence what the method says it did not determine; empty where that is nothing."""
    sides = len(track.log.unknown_sides or ())
    lost = len(track.log.lost_frames or ())
    of = f" of {track.setup.frames}"
    parts = [f"left and right: unknown in {_frames(sides, of)}"] if sides else []
    parts += [f"{_frames(lost, '' if sides else of)} lost"] if lost else []
    return "; ".join(parts)


def gait_line(gait: Mapping[str, Any], *, by_side: bool = True) -> str:
    """Return one line about the gait, or why it has no figures."""
    if not gait["walk"]:
        return f"no figures of gait: {gait['why']}"
    speed = "" if gait["speed"] is None else f", {gait['speed']:.2f} m/s"
    sides = ", ".join(
        f"{label} {left} and {right} {unit}"
        for label, unit, left, right in gait_rows(gait)
    )
    parts = [
        f"{'gait: ' if by_side else ''}{gait['cadence']:.0f} steps a minute{speed}, over {gait['steps']} steps"
    ]
    parts += [f"left and right: {sides}"] if by_side else []
    parts += [f"no lengths: {gait['why_no_lengths']}"] if gait["why_no_lengths"] else []
    return "; ".join(parts)


def gait_rows(gait: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return the measures of a walk by side: label, unit, left and right; those that no side has are left out."""
    rows = []
    for name, label, unit, factor, digits in GAIT_ROWS:
        values = [gait[side][name] for side in ("left", "right")]
        if values != [None, None]:
            left, right = (
                "-" if value is None else f"{factor * value:.{digits}f}"
                for value in values
            )
            rows.append((label, unit, left, right))
    return rows


def _worth(measures: Measures) -> str:
    error = MEASURES["error_degrees"].shown(
        measures.error_degrees.mean if measures.error_degrees else None
    )
    return f"{_shown(measures, 'mpjpe_mm')}, {error}, {_shown(measures, 'lost_rate')} of frames"


def _effort(track: Content) -> str:
    measures = track.measures
    setup = track.setup
    seconds = MEASURES["seconds_per_frame"].number(measures.seconds_per_frame)
    budget = setup.evaluations_per_frame * max(len(track.log.hypotheses), 1)
    effort = measures.effort or {"frames": measures.evaluations}
    frame = effort["frames"] / setup.frames
    # frames that are searched again have more than one budget
    of = f" of {budget:,}" if frame <= budget else ""
    others = [
        f"{count:,} for the {stage.replace('_', ' ')}"
        for stage, count in effort.items()
        if stage != "frames"
    ]
    besides = f" (and {', '.join(others)})" if others else ""
    evaluations = f"{frame:,.0f}{of} evaluations{besides}"
    return f"{_shown(measures, 'iou')}, {evaluations} and {seconds} ms a frame"


def _frames(count: int, of: str) -> str:
    return f"{count}{of} frame{'' if count == 1 and not of else 's'}"


def _shown(measures: Measures, name: str) -> str:
    return MEASURES[name].shown(getattr(measures, name))
