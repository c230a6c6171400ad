"""The report of `posefit reproduce sapso`: the paper's tables beside ours, its claims, and what was shortened."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES
from posefit.fitting import metrics
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import turns_of
from posefit.tracking.restarts import RESTARTS
from posefit.version import __version__
from posefit_reproduce.jobs import Progress, figures_folder
from posefit_reproduce.sapso.claims import paper_claims
from posefit_reproduce.sapso.experiment import PaperResults, repeat_paper
from posefit_reproduce.sapso.motions import FPS, LABELS, SIZE, paper_motions
from posefit_reproduce.sapso.paper import (
    COMPARED,
    FRAMES,
    LETTER,
    METHODS,
    OURS,
    TABLE_1,
    TABLE_1_JOINTS,
    TABLE_2,
    TRAINING_FRAMES,
    WORKERS,
    Scale,
)

# LFemur, RFemur, LKnee, RKnee: an Acclaim knee has one angle, the other two are padding
_ANGLES = turns_of(("lfemur", "rfemur", "ltibia", "rtibia"))


def paper_report(
    clips: str | Path | None,
    seeds: int,
    scale: Scale,
    out: str | Path | None,
    workers: int = WORKERS,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return tables, claims and what was shortened; with `out`, write them and the figures, whole or not at all.

    Raises ValueError where `seeds` is no positive number, `clips` no folder of CMU clips or the folder cannot be
    written, and ImportError where the figures need a library that is not installed.
    """
    with figures_folder(out) as folder:
        results = repeat_paper(paper_motions(clips, scale.frames), seeds, scale, workers, progress)
        report = {
            "version": __version__,
            "motions": {
                name: {
                    "test": one.test.name,
                    "train": [clip.name for clip in one.training],
                    "frames": len(one.test),
                    "training_frames": len(one.angles),
                }
                for name, one in results.motions.items()
            },
            "seeds": seeds,
            "views_degrees": list(scale.views),
            "given": _given(scale),
            "table_1": {name: _table_1(results, name) for name in results.motions},
            "table_2": {name: _table_2(results, name) for name in results.motions},
            "claims": [asdict(one) for one in paper_claims(results)],
            "shortened": _shortened(results, clips is not None, workers),
        }
        if folder is not None:
            from posefit_reproduce.sapso.figures import paper_figures

            report["figures"] = paper_figures(results, folder)
            (folder / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
            (folder / "report.txt").write_text(paper_text(report) + "\n", encoding="utf-8")
    return report


def _given(scale: Scale) -> dict[str, str]:
    """Return what each experiment was given beside the silhouettes."""
    always = "each frame's translation, as the paper has none; the person's own body; masks drawn by posefit itself"
    yaw = "the first yaw" if scale.first_yaw == "known" else f"no yaw, and {RESTARTS} restarts"
    return {
        "single images, table 1 and figure 7": f"{always}; no yaw",
        "tracks, table 2 and figure 9": f"{always}; {yaw}; the first pose is searched",
        "baselines": "the true root in every frame, which no method has",
    }


def _table_1(results: PaperResults, motion: str) -> dict[str, Any]:
    """Return four joints' angles in the middle frame, in degrees, and their mean absolute errors."""
    truth, scale = results.motions[motion].test.poses, results.scale
    frame, view = len(truth) // 2, scale.views.index(scale.shown)
    true, estimate = TABLE_1[motion]
    paper = {"truth": true.tolist(), "estimate": estimate.tolist(), "error": float(np.abs(estimate - true).mean())}

    def angles(pose: Array) -> list[list[float]]:
        return [[float(angle) for angle in joint] for joint in np.degrees(wrapped(pose[_ANGLES])).reshape(-1, 3)]

    rows: dict[str, Any] = {}
    for name in (OURS, LETTER, *BASELINES):
        poses = results.poses(motion, name, "images")[view, 0]
        away = np.degrees(np.abs(wrapped(poses - truth)))[:, _ANGLES]
        errors = {"error": float(away[frame].mean()), "error_all_frames": float(away.mean())}
        rows[name] = {"angles": angles(poses[frame]), **errors}
    return {"paper": paper, "frame": frame, "view_degrees": scale.shown, "truth": angles(truth[frame]), **rows}


def _table_2(results: PaperResults, motion: str) -> dict[str, Any]:
    """Return what each method and each baseline is worth on a motion: means over views and seeds."""

    def by_run(name: str, measure: Callable[[Array], float]) -> Array:
        return np.array([measure(one) for view in results.errors(motion, name) for one in view])

    mean = float(by_run("mean_pose", metrics.mean_error).mean())
    rows: dict[str, dict[str, Any]] = {}
    for name in (*COMPARED[motion], *BASELINES):
        error = by_run(name, metrics.mean_error)
        rows[name] = {
            "error_degrees": float(error.mean()),
            "free_degrees": float(results.errors(motion, name, free=True).mean()),
            "worst_degrees": float(error.max()),
            "spread_degrees": float(by_run(name, metrics.error_spread).mean()),
            "skill": metrics.skill(float(error.mean()), mean),
        }
        if name in METHODS:
            tracks = results.of(motion, name)
            rows[name] |= {
                "seconds_per_frame": float(np.mean([track.seconds for track in tracks])),
                "evaluations": float(np.mean([track.evaluations for track in tracks])),
                "swapped": float(np.mean([track.swapped for track in tracks])),
                "lost": float(np.mean([track.lost for track in tracks])),
                "wrong": float((error > mean).mean()),
            }
        if name in TABLE_2.get(motion, {}):
            rows[name]["paper"] = TABLE_2[motion][name]._asdict()
    return rows


def _shortened(results: PaperResults, clips: bool, workers: int) -> list[str]:
    lengths = {name: (len(one.test), len(one.angles)) for name, one in results.motions.items()}
    tests = ", ".join(f"{count} of the {LABELS[name]}" for name, (count, _) in lengths.items())
    trained = ", ".join(
        f"{count} ({TRAINING_FRAMES[name]}) for the {LABELS[name]}" for name, (_, count) in lengths.items()
    )
    views = ", ".join(f"{view:.0f}" for view in results.scale.views)
    at_once = "one track" if workers == 1 else f"{'two' if workers == 2 else workers} tracks"
    return [
        "clips: the first frame of each is left out, for 16_15 begins with a pose that is not of the walk"
        if clips
        else "motions are built in, and smooth: --clips CMU_DIR takes the paper's source",
        f"frames: {tests}; the paper has {FRAMES} of each, at a rate it does not give, here {FPS:.0f} a second",
        f"training poses (the paper's): {trained}; which clips it took, and of whom, the paper does not say",
        f"silhouettes: rendered, {SIZE[0]} x {SIZE[1]} pixels, seen from {views} degrees (0: in front), both ours",
        "left out: figures 8 and 10, of real video: docs/studies/footage_figures.py makes them of a copy of the films",
        "full space: the range of the training poses; PF is in that space, as far as the paper tells",
        f"every method has the same evaluations a frame, which the paper's had not; {at_once} ran at once",
    ]


def paper_text(report: dict[str, Any]) -> str:
    """Return the report as it is printed."""
    return "\n".join([*_lines_1(report), "", *_lines_2(report), "", *_lines_claims(report), "", *_lines_given(report)])


def _lines_1(report: dict[str, Any]) -> Iterator[str]:
    yield "Table 1: angles in degrees of single images, the yaw unknown. Ours are x, y, z of an Acclaim skeleton, whose"
    yield "knee has x alone; the paper's axes are not given. Error: mean of the twelve, in this frame and in all frames"
    yield f"{'':39} {''.join(f'{name:>24}' for name in TABLE_1_JOINTS)}  error  all frames"
    for motion, rows in report["table_1"].items():
        paper = rows["paper"]
        yield _angles(f"{LABELS[motion]}, the paper's truth", paper["truth"])
        yield _angles("  the paper's estimate", paper["estimate"], f"{paper['error']:7.2f}")
        yield _angles(f"  ours, truth of frame {rows['frame']}", rows["truth"])
        for name in (OURS, LETTER, *BASELINES):
            one = rows[name]
            errors = f"{one['error']:7.2f} {one['error_all_frames']:11.2f}"
            yield _angles(f"  {_label(name)}", one["angles"], errors)


def _angles(label: str, joints: list[list[float]], errors: str = "") -> str:
    return f"{label:39} " + "".join(f"{x:8.1f}{y:8.1f}{z:8.1f}" for x, y, z in joints) + errors


def _lines_2(report: dict[str, Any]) -> Iterator[str]:
    yield "Table 2: error in degrees (9), its spread (10) and seconds a frame, the paper's and ours; free: over the"
    yield "angles that move; wrong: runs that err more than the mean pose"
    heads = ["paper", "spread", "s", "ours", "free", "worst", "spread", "s", "skill", "swapped", "lost", "wrong"]
    for motion, rows in report["table_2"].items():
        yield f"{LABELS[motion]:39}" + "".join(f"{head:>8}" for head in heads) + f"{'evaluations':>12}"
        for name, one in rows.items():
            cells = list(one["paper"].values()) if "paper" in one else ["-"] * 3
            cells += [f"{one[f'{key}_degrees']:.2f}" for key in ("error", "free", "worst", "spread")]
            cells.append(f"{one['seconds_per_frame']:.4f}" if name in METHODS else "-")
            cells.append("-" if one["skill"] is None else f"{one['skill']:.2f}")
            cells += [f"{100 * one[key]:.0f} %" for key in ("swapped", "lost", "wrong") if key in one]
            evaluations = f"{one['evaluations']:12,.0f}" if name in METHODS else ""
            yield f"  {_label(name):37}" + "".join(f"{cell:>8}" for cell in cells) + evaluations


def _label(name: str) -> str:
    return f"{METHODS[name].label} ({name})" if name in METHODS else BASELINES[name]


def _lines_claims(report: dict[str, Any]) -> Iterator[str]:
    says = "What the paper says. Pairs are views and seeds of one clip, of single images of all; p-values are of these."
    for heading, asked in ((says, True), ("What it does not ask", False)):
        yield heading
        for one in report["claims"]:
            if bool(one["source"]) == asked:
                source = f" ({one['source']})" if asked else ""
                yield f"  {one['verdict']}: {one['text']}{source}: {one['evidence']}"


def _lines_given(report: dict[str, Any]) -> Iterator[str]:
    yield "What was given"
    yield from (f"  {experiment}: {given}" for experiment, given in report["given"].items())
    yield f"Against the paper ({report['seeds']} seeds)"
    yield from (f"  {line}" for line in report["shortened"])
