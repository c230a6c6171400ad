"""How the report of the SAPSO paper's experiments is printed."""

from collections.abc import Iterator
from typing import Any

from posefit.tracking.measures import BASELINES
from posefit_reproduce.sapso.design import METHODS
from posefit_reproduce.sapso.motions import LABELS
from posefit_reproduce.sapso.numbers import TABLE_1_JOINTS


def paper_text(told: dict[str, Any]) -> str:
    """Return the report as it is printed."""
    return "\n".join([*_lines_1(told), "", *_lines_2(told), "", *_lines_claims(told), "", *_lines_shortened(told)])


def _lines_1(told: dict[str, Any]) -> Iterator[str]:
    yield "Table 1: angles in degrees. Ours are x, y, z of an Acclaim skeleton, whose knee has x alone; the paper's"
    yield "axes are not given. Error: mean of the twelve, in this frame and in all frames"
    yield f"{'':34} {''.join(f'{name:>24}' for name in TABLE_1_JOINTS)}  error  all frames"
    for motion, rows in told["table_1"].items():
        paper = rows["paper"]
        yield _angles(f"{LABELS[motion]}, the paper's truth", paper["truth"])
        yield _angles("  the paper's estimate", paper["estimate"], f"{paper['error']:7.2f}")
        yield _angles(f"  ours, truth of frame {rows['frame']}", rows["truth"])
        for name in ("sapso@pca", *BASELINES):
            one = rows[name]
            errors = f"{one['error']:7.2f} {one['error_all_frames']:11.2f}"
            yield _angles(f"  {_label(name)}", one["angles"], errors)


def _angles(label: str, joints: list[list[float]], errors: str = "") -> str:
    return f"{label:34} " + "".join(f"{x:8.1f}{y:8.1f}{z:8.1f}" for x, y, z in joints) + errors


def _lines_2(told: dict[str, Any]) -> Iterator[str]:
    yield "Table 2: error in degrees (9), its spread (10) and seconds a frame, the paper's and ours"
    heads = ("paper", "spread", "s", "ours", "worst", "spread", "s", "skill", "swapped", "lost", "evaluations")
    for motion, rows in told["table_2"].items():
        yield f"{LABELS[motion]:34}" + "".join(f"{head:>{12 if head == 'evaluations' else 8}}" for head in heads)
        for name, one in rows.items():
            paper = list(one["paper"].values()) if "paper" in one else []
            cells = [f"{value:8}" for value in paper] or [f"{'-':>8}"] * 3
            cells += [f"{one[key]:8.2f}" for key in ("error_degrees", "worst_degrees", "spread_degrees")]
            cells.append(f"{one['seconds_per_frame']:8.4f}" if name in METHODS else f"{'-':>8}")
            cells.append(f"{'-':>8}" if one["skill"] is None else f"{one['skill']:8.2f}")
            if name in METHODS:
                cells += [f"{100 * one[key]:6.0f} %" for key in ("swapped", "lost")]
                cells.append(f"{one['evaluations']:12,.0f}")
            yield f"  {_label(name):32}" + "".join(cells)


def _label(name: str) -> str:
    return f"{METHODS[name].label} ({name})" if name in METHODS else BASELINES[name]


def _lines_claims(told: dict[str, Any]) -> Iterator[str]:
    yield "What the paper says. Pairs are views and seeds of one clip: a p-value speaks of that clip alone."
    for one in told["claims"]:
        if one["source"]:
            yield f"  {one['verdict']}: {one['text']} ({one['source']}): {one['evidence']}"
    yield "What it does not ask"
    for one in told["claims"]:
        if not one["source"]:
            yield f"  {one['verdict']}: {one['text']}: {one['evidence']}"


def _lines_shortened(told: dict[str, Any]) -> Iterator[str]:
    yield f"Against the paper ({told['seeds']} seeds; baselines have the true root, which no method has)"
    for one in told["shortened"]:
        yield f"  {one}"
