"""What the signs of a track come to: good, doubtful or not to be used, in one sentence that names the worst of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

Grade = Literal["good", "doubtful", "useless"]
_BEGINNING: dict[Grade, str] = {"good": "good. ", "doubtful": "doubtful: ", "useless": "do not use: "}
TOGETHER = 3  # signs that make a track doubtful make it useless together
FEWEST = 12  # frames below which nothing can be said of depth, feet and motion together


@dataclass(frozen=True)
class Sign:
    """From where on a figure makes a track doubtful or useless, and how that is said; `bad` grows as it gets worse."""

    name: str
    bad: Callable[[float], float]
    doubtful: float
    useless: float
    words: Callable[[Mapping[str, Any]], str]


def _as_it_is(value: float) -> float:
    return value


def _missing(value: float) -> float:
    return 1.0 - value


# The limits are ours, from footage made from the truth and the demonstration video: docs/howto/trust.md has them.
SIGNS = (
    Sign(
        "frames",
        lambda count: FEWEST - count,
        0.0,
        FEWEST,
        lambda f: f"{f['frames']} frames that show the person are too few to judge by",
    ),
    Sign("lost", _as_it_is, 0.15, 0.5, lambda f: f"the person is lost in {f['lost']:.0%} of the frames"),
    Sign(
        "held",
        _as_it_is,
        0.25,
        0.6,
        lambda f: f"the person is gone, or nearly, in {f['held']:.0%} of the frames in between",
    ),
    Sign("unknown", _as_it_is, 0.1, 1.0, lambda f: f"left and right are unknown in {f['unknown']:.0%} of the frames"),
    Sign("iou", _missing, 0.35, 0.55, lambda f: f"the body and the mask overlap by {f['iou']:.0%} only"),
    Sign(
        "size_ratio",
        lambda ratio: abs(ratio - 1.0),
        0.08,
        0.3,
        lambda f: f"the person seems to be {f['size_m']:.2f} m tall, not {f['height_m']:.2f} m",
    ),
    Sign("depth_scatter", _as_it_is, 0.04, 0.2, lambda f: f"the distance jumps by {f['depth_scatter']:.0%}"),
    Sign("foot_share", _missing, 0.8, 1.0, lambda f: f"a foot stands in {f['foot_share']:.0%} of the frames only"),
    Sign(
        "stance_spread_m", _as_it_is, 0.15, 0.6, lambda f: f"feet stand at heights {f['stance_spread_m']:.2f} m apart"
    ),
    Sign("explained", _missing, 0.3, 0.6, lambda f: f"the body covers {f['explained']:.0%} of what moves only"),
    Sign("acceleration", _as_it_is, 14.0, 60.0, lambda f: f"joints jerk, by {f['acceleration']:.0f} m/s2"),
)


def against(figures: Mapping[str, Any]) -> list[tuple[Grade, str]]:
    """Return what speaks against a track, the worst first, by figures named as `SIGNS`; None of them is not known."""
    found: list[tuple[float, str]] = []
    for sign in SIGNS:
        if figures[sign.name] is None:
            continue
        severity = (sign.bad(figures[sign.name]) - sign.doubtful) / (sign.useless - sign.doubtful)
        if severity > 0.0:
            found.append((severity, sign.words(figures)))
    found.sort(key=lambda one: one[0], reverse=True)
    return [("useless" if severity > 1.0 else "doubtful", words) for severity, words in found]


def grade_of(signs: Sequence[tuple[Grade, str]]) -> Grade:
    """Return what signs come to: that of the worst, but three doubtful ones together are as bad as a useless one."""
    if not signs:
        return "good"
    return "useless" if len(signs) >= TOGETHER else signs[0][0]


def sentence(figures: Mapping[str, Any], signs: Sequence[tuple[Grade, str]]) -> str:
    """Return whether a track can be trusted: the grade, and the worst sign or what speaks for it."""
    beginning = f"Trust: {_BEGINNING[grade_of(signs)]}"
    if not signs:
        return f"{beginning}No sign speaks against it: {_fine(figures)}."
    more = len(signs) - 1
    others = "" if not more else f", and {more} more sign{'s speak' if more > 1 else ' speaks'} against it"
    return f"{beginning}{signs[0][1]}{others}."


def _fine(figures: Mapping[str, Any]) -> str:
    """Return the figures that are known of a good track, in words."""
    size, depth, feet = figures["size_m"], figures["depth_scatter"], figures["foot_share"]
    moving, unknown = figures["explained"], figures["unknown"]
    parts = [
        "" if size is None else f"{size:.2f} m tall, given {figures['height_m']:.2f} m",
        "" if depth is None else f"the distance keeps to {depth:.1%}",
        "" if feet is None else f"a foot stands in {feet:.0%} of the frames",
        "" if moving is None else f"the body covers {moving:.0%} of what moves",
        "" if unknown is None else f"left and right are known in {1.0 - unknown:.0%}",
    ]
    return ", ".join(part for part in parts if part)
