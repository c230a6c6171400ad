"""The table a track prints: the method beside trivial ones, what was not determined, and the budget."""

from collections.abc import Mapping
from typing import Any

from posefit.errors import printable
from posefit.evaluation.measures import BASELINES, MEASURES
from posefit.evaluation.trust import trust_line
from posefit.reading import counted

MIN_BUILD_CHANGE = 0.05  # a part of the build that is off the average by less is not worth a word
MIN_MODE = 0.08  # of the weight of a pose that is worth a word
WIDTH = 30  # of the names
GAIT_ROWS = (  # of a foot: names, labels, units, factors and digits
    ("step_length", "step", "m", 1.0, 2),
    ("step_seconds", "step", "s", 1.0, 2),
    ("stance_share", "stance", "%", 100.0, 0),
)
MAX_NAMED = 8  # motions that were learned from, and are named


def brief(summary: Mapping[str, Any]) -> list[str]:
    """Return in lines what a track is worth, which poses a single frame leaves open, and what it took."""
    trust = summary["trust"]
    if trust is None:
        error = MEASURES["error_degrees"].shown(summary["error_degrees"]["mean"])
        worth = f"{_shown(summary, 'mpjpe_mm')}, {error}, {_shown(summary, 'lost_rate')} of frames"
    else:
        worth = trust["sentence"]
    guessed = ", camera guessed" if summary["camera"] == "guessed" else ""
    frames = counted(summary["frames"], "frame")
    work = f"{summary['motion']}: {frames} by {summary['method']}{guessed}, {_effort(summary)}"
    open_poses = sum(weight >= MIN_MODE for weight in summary["modes"] or [])
    modes = [f"one silhouette leaves {open_poses} poses open"] if summary["frames"] == 1 and open_poses > 1 else []
    return [printable(line) for line in (worth, *modes, work)]


def table(summary: Mapping[str, Any]) -> str:
    """Return the lines that `posefit track --verbose` prints."""
    trust = summary["trust"]
    lines = [] if trust is None else [trust["sentence"], trust_line(trust)]
    names = summary["train"]
    training = ", ".join(names) if len(names) <= MAX_NAMED else f"{len(names)} clips, {names[0]} to {names[-1]}"
    lines.append(
        f"{summary['motion']}: {counted(summary['frames'], 'frame')}, {summary['method']}, seed {summary['seed']}, "
        f"translation {summary['translation']}, trained on {training}"
    )
    if (error := summary["error_degrees"]) is not None:
        lines.append(f"{'':{WIDTH}} {'error deg':>9} {'skill':>7}")
        lines.append(f"{summary['method']:{WIDTH}} {error['mean']:9.2f}")
        for name, baseline in summary["baselines_degrees"].items():
            skill = MEASURES["skill"].number(summary["skill"][name])  # a dash where the baseline has no error at all
            lines.append(f"{BASELINES[name]:{WIDTH}} {baseline:9.2f} {skill:>7}")
        if summary["prior_floor_degrees"] is not None:  # a tracker of its own may have no prior
            projected = MEASURES["prior_floor_degrees"]
            lines.append(f"{projected.label:{WIDTH}} {projected.number(summary[projected.name]):>9}")
        shown = (_shown(summary, name) for name in ("mpjpe_mm", "pa_mpjpe_mm", "swap_rate", "lost_rate"))
        lines.append(f"{', '.join(shown)} of frames")
    lines += filter(None, [held_frames(summary), undetermined(summary)])
    lines += [gait_line(summary["gait"])] if summary["frames"] > 1 else []
    if (build := summary["build"]) is not None:
        parts = [
            f"{name} {factor:.2f} +- {build['spread'][name]:.2f}"
            for name, factor in build["factors"].items()
            if abs(factor - 1.0) >= MIN_BUILD_CHANGE
        ]
        lines.append(
            f"build: {build['stature_m']:.2f} m tall; against the average {', '.join(parts) or 'nothing notable'}"
        )
    if summary["camera"] == "guessed":
        lines.append(
            "camera guessed: level, 40 degrees across; distances and size are as good as that, and as --height"
        )
    if tracks := summary["hypotheses"]:
        costs = [f"{track['guess']} {track['cost'] + track['motion']:.2f}" for track in tracks]
        frames = ", ".join(f"{track['frames']} of track {k}" for k, track in enumerate(tracks, 1) if track["frames"])
        lines.append(f"frames kept: {frames}; trajectory cost by initial guess: {', '.join(costs)}")
    speed = MEASURES["evaluations_per_second"].number(summary["evaluations_per_second"])
    lines.append(f"{_effort(summary)}, {speed} poses a second")
    return "\n".join(map(printable, lines))  # the names of files are among them


def held_frames(summary: Mapping[str, Any]) -> str:
    """Return in one sentence how many frames were not searched; empty where that is none."""
    show = "frame shows" if summary["held_frames"] == 1 else "frames show"
    what = f"{summary['held_frames']} {show} too little of the person: the pose is held or carried on, not searched"
    return f"{what}, and may be off the person; IoU is that of the others" if summary["held_frames"] else ""


def undetermined(summary: Mapping[str, Any]) -> str:
    """Return in one sentence what the method says it did not determine; empty where that is nothing."""
    sides, lost = (len(summary[name] or ()) for name in ("unknown_sides", "lost_frames"))
    of = f" of {summary['frames']}"
    parts = [f"left and right: unknown in {_frames(sides, of)}"] if sides else []
    parts += [f"{_frames(lost, '' if sides else of)} lost"] if lost else []
    return "; ".join(parts)


def gait_line(gait: Mapping[str, Any], *, by_side: bool = True) -> str:
    """Return one line about the gait, or why it has no figures."""
    if not gait["walk"]:
        return f"no figures of gait: {gait['why']}"
    speed = "" if gait["speed"] is None else f", {gait['speed']:.2f} m/s"
    sides = ", ".join(f"{label} {left} and {right} {unit}" for label, unit, left, right in gait_rows(gait))
    parts = [f"{'gait: ' if by_side else ''}{gait['cadence']:.0f} steps a minute{speed}, over {gait['steps']} steps"]
    parts += [f"left and right: {sides}"] if by_side else []
    parts += [f"no lengths: {gait['why_no_lengths']}"] if gait["why_no_lengths"] else []
    return "; ".join(parts)


def gait_rows(gait: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return the measures of a walk by side: label, unit, left and right; those that no side has are left out."""
    rows = []
    for name, label, unit, factor, digits in GAIT_ROWS:
        values = [gait[side][name] for side in ("left", "right")]
        if values != [None, None]:
            left, right = ("-" if value is None else f"{factor * value:.{digits}f}" for value in values)
            rows.append((label, unit, left, right))
    return rows


def _effort(summary: Mapping[str, Any]) -> str:
    used = summary["evaluations"] / summary["frames"]
    budget = summary["evaluations_per_frame"] * max(len(summary["hypotheses"]), 1)
    seconds = MEASURES["seconds_per_frame"].number(summary["seconds_per_frame"])
    of = f" of {budget:,}" if used <= budget else ""  # frames that are tracked again have more than one budget
    return f"{_shown(summary, 'iou')}, {used:,.0f}{of} evaluations and {seconds} ms a frame"


def _frames(count: int, of: str) -> str:
    return f"{count}{of} frame{'' if count == 1 and not of else 's'}"


def _shown(summary: Mapping[str, Any], name: str) -> str:
    return MEASURES[name].shown(summary[name])
