"""The table a track prints: the method beside what anybody can reach without it."""

from collections.abc import Mapping
from typing import Any

_NAMES = {
    "mean_pose": "mean training pose",
    "persistence": "first true pose, held",
    "nearest": "best training pose",
}
NOTABLE = 0.05  # a part of the build that is off the average by less is not worth a word


def table(summary: Mapping[str, Any]) -> str:
    """Return the lines that `posefit track` prints."""
    lines = [
        f"{summary['motion']}: {summary['frames']} frames, {summary['method']}, seed {summary['seed']}, "
        f"translation {summary['translation']}, trained on {', '.join(summary['train'])}"
    ]
    error = summary["error_degrees"]
    if error is not None:
        lines.append(f"{'':24} {'error deg':>9} {'skill':>7}")
        lines.append(f"{summary['method']:24} {error['mean']:9.2f}")
        for name, baseline in summary["baselines_degrees"].items():
            skill = summary["skill"][name]  # None where the baseline has no error at all
            lines.append(f"{_NAMES[name]:24} {baseline:9.2f} " + (f"{'-':>7}" if skill is None else f"{skill:7.2f}"))
        if summary["prior_floor_degrees"] is not None:  # a tracker of its own may have no prior
            lines.append(f"{'floor of the prior':24} {summary['prior_floor_degrees']:9.2f}")
        lines.append(
            f"MPJPE {summary['mpjpe_mm']:.0f} mm, PA-MPJPE {summary['pa_mpjpe_mm']:.0f} mm, left/right swapped "
            f"{100 * summary['swap_rate']:.0f} %, lost {100 * summary['lost_rate']:.0f} % of frames"
        )
    if summary["held_frames"]:
        held = summary["held_frames"]
        show = "frame shows" if held == 1 else "frames show"
        lines.append(
            f"{held} {show} too little of the person: the pose is held, not searched, and may be off the person; "
            "IoU is that of the others"
        )
    if summary["body"] is not None:
        body = summary["body"]
        parts = [
            f"{name} {factor:.2f} +- {body['spread'][name]:.2f}"
            for name, factor in body["factors"].items()
            if abs(factor - 1.0) >= NOTABLE
        ]
        lines.append(
            f"build: {body['stature']:.2f} m tall; against the average {', '.join(parts) or 'nothing notable'}"
        )
    if summary["camera"] == "guessed":
        lines.append(
            "camera guessed: level, 40 degrees across; distances and size are as good as that, and as --height"
        )
    used = summary["evaluations"] / summary["frames"]
    lines.append(
        f"IoU {summary['iou']:.3f}, {used:,.0f} of {summary['evaluations_per_frame']:,} evaluations and "
        f"{1e3 * summary['seconds_per_frame']:.1f} ms a frame, {summary['evaluations_per_second']:,.0f} poses a second"
    )
    return "\n".join(lines)
