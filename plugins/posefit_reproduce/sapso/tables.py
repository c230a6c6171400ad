"""The SAPSO paper's tables beside ours, its claims with verdicts, and what each part of its method is worth."""

from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES
from posefit.fitting import metrics
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import turns_of
from posefit.uncertainty.modes import nearer_mirrored
from posefit_priors.pca import PCA
from posefit_reproduce.experiment import Claim, Results, Table, bounded, claims_table, interval
from posefit_reproduce.sapso.experiment import COMPARED
from posefit_reproduce.sapso.methods import LABELS, LETTER, METHODS, OTHERS, OURS, PAPER, PARTS
from posefit_reproduce.sapso.motions import LABELS as MOTIONS
from posefit_reproduce.sapso.motions import PaperMotion
from posefit_reproduce.sapso.paper import (
    CONVERGED,
    SMALL_DEGREES,
    SWARMS,
    TABLE_1,
    TABLE_1_JOINTS,
    TABLE_2,
    TRACK_DEGREES,
    TRAINING_FRAMES,
    VARIANCE,
)

# LFemur, RFemur, LKnee, RKnee: an Acclaim knee has one angle, the other two are padding that cannot err
ANGLES = turns_of(("lfemur", "rfemur", "ltibia", "rtibia"))
# bounds that are ours, where the paper gives none
HIGH_FRAMES, FEW_JOINTS = 0.9, 3  # the quantile from which a frame's error is high, and how many joints are a few
SWAPPED = 0.01  # share of frames with left and right exchanged that still counts as none
SAME_DEGREES = 1.0  # by which views, or a hidden part, may change an error that stays the same
SAME_COST = 1.0  # by which costs may differ that have converged or are equal; costs go from 0 to 100
TURNED_ROUND = 90.0  # degrees: a yaw that is more off is a person seen the wrong way round


class Analysis:
    """Errors of the runs on the paper's motions."""

    def __init__(self, results: Results, motions: Mapping[str, PaperMotion]) -> None:
        self.results, self.motions = results, motions

    def away(self, motion: str, method: str = OURS, kind: str = "track") -> Array:
        """Return the absolute errors of all angles in degrees, (views, seeds, T, 66)."""
        poses = self.results.of("poses", kind, motion, method)
        return np.asarray(np.degrees(np.abs(wrapped(poses - self.motions[motion].test.poses))))

    def free(self, motion: str) -> NDArray[np.bool_]:
        """Return which of the 66 angles can err."""
        return self.motions[motion].test.skeleton.free

    def errors(self, motion: str, method: str = OURS, kind: str = "track", free: bool = False) -> Array:
        """Return the mean errors (8) of runs in degrees, (views, seeds). Interpretation S18."""
        away = self.away(motion, method, kind)
        return np.asarray((away[..., self.free(motion)] if free else away).mean(axis=(2, 3)))

    def spread(self, motion: str, method: str) -> Array:
        """Return the deviations (10) of runs in degrees, (views, seeds)."""
        return np.asarray(self.away(motion, method).mean(axis=3).std(axis=2))

    def share(self, which: str, motion: str, method: str = OURS, kind: str = "track") -> Array:
        """Return the share of frames (views, seeds) that are "swapped", left for right, or "lost"."""
        test, poses = self.motions[motion].test, self.results.of("poses", kind, motion, method)
        joints = test.skeleton.joints(
            poses.reshape(-1, 66), np.tile(test.translations, (len(poses.reshape(-1, 66)) // len(test), 1))
        )
        truth = np.tile(test.joints, (len(joints) // len(test), 1, 1))
        flags = (
            nearer_mirrored(truth, joints) if which == "swapped" else metrics.mpjpe_mm(truth, joints) > metrics.LOST_MM
        )
        return np.asarray(flags.reshape(poses.shape[:3]).mean(axis=2))


def paper_tables(results: Results, motions: Mapping[str, PaperMotion]) -> Iterator[Table]:
    """Yield all tables: the paper's, its claims, by view, what each part is worth, the turn."""
    analysis = Analysis(results, motions)
    yield motions_table(analysis)
    yield table_1(analysis)
    yield table_1_errors(analysis)
    yield from (table_2(analysis, motion) for motion in motions)
    yield claims_table("claims", list(claims(analysis)))
    yield by_view(analysis)
    yield parts(analysis)
    yield turn(analysis)


def motions_table(analysis: Analysis) -> Table:
    """Return what is followed and learned from, and how many seeds there are."""
    rows = []
    for name, motion in analysis.motions.items():
        yaw = np.degrees(np.unwrap(motion.test.poses[:, 0]))
        counts = [f"{len(motion.test)}", f"{yaw[-1] - yaw[0]:.0f}", f"{len(motion.angles)}", f"{TRAINING_FRAMES[name]}"]
        seeds = [str(analysis.results.of("poses", kind, name, OURS).shape[1]) for kind in ("track", "image")]
        rows.append(
            [MOTIONS[name], motion.test.name, ", ".join(clip.name for clip in motion.training), *counts, *seeds]
        )
    heads = ["motion", "followed", "learned from", "frames", "turns by, degrees", "training frames", "the paper's"]
    return Table("motions", [*heads, "seeds of tracks", "of images"], rows, 3)


def table_1(analysis: Analysis) -> Table:
    """Return table 1: twelve angles of one image; ours is the middle frame of the first seed from 45 degrees."""
    rows = []
    for motion, (truth, estimate) in TABLE_1.items():
        test = analysis.motions[motion].test.poses
        frame = len(test) // 2
        angles: dict[str, Array] = {"paper, truth": truth, "paper, estimate": estimate}
        angles[f"truth of frame {frame}"] = np.degrees(wrapped(test[frame, ANGLES])).reshape(-1, 3)
        for name in (OURS, LETTER):
            pose = analysis.results.of("poses", "image", motion, name)[1, 0, frame]
            angles[LABELS[name]] = np.degrees(wrapped(pose[ANGLES])).reshape(-1, 3)
        for label, values in angles.items():
            rows.append([MOTIONS[motion], label, *(", ".join(f"{value:.1f}" for value in joint) for joint in values)])
    return Table("table-1", ["motion", "", *TABLE_1_JOINTS], rows, 2)


def table_1_errors(analysis: Analysis) -> Table:
    """Return the mean errors of table 1's angles over all images, of the eight that can err and of all twelve."""
    rows = []
    for motion, (truth, estimate) in TABLE_1.items():
        cells = [MOTIONS[motion], f"{np.abs(estimate - truth).mean():.2f}"]
        for name, kind in ((OURS, "image"), (LETTER, "image"), ("mean_pose", "track"), ("nearest", "track")):
            errors = table_1_angles(analysis, motion, name, kind)
            cells += [bounded(interval(errors)), f"{analysis.away(motion, name, kind)[..., ANGLES].mean():.2f}"]
        rows.append(cells)
    names = [LABELS[name] for name in (OURS, LETTER, "mean_pose", "nearest")]
    heads = [head for name in names for head in (f"{name}: angles that can err", "all 12")]
    return Table("table-1-errors", ["motion", "paper, all 12", *heads], rows)


def table_2(analysis: Analysis, motion: str) -> Table:
    """Return what each method and each baseline is worth on a motion, beside the paper's table 2."""
    rows, mean = [], analysis.errors(motion, "mean_pose")
    for name in (*PAPER, *OTHERS, *BASELINES):
        error = analysis.errors(motion, name)
        paper = [f"{value:.2f}" for value in TABLE_2[motion][name]] if name in TABLE_2.get(motion, {}) else [""] * 3
        cells = [LABELS[name], *paper[:2], bounded(interval(error)), f"{analysis.spread(motion, name).mean():.2f}"]
        cells += [f"{error.max():.2f}", f"{analysis.errors(motion, name, free=True).mean():.2f}"]
        cells += [f"{100 * analysis.share(which, motion, name).mean():.0f}" for which in ("swapped", "lost")]
        cells += [f"{100 * (error > mean).mean():.0f}" if name in METHODS else "", paper[2]]
        cells.append(
            f"{analysis.results.of('cpu_seconds', 'track', motion, name).mean():.4f}" if name in METHODS else ""
        )
        unknown = analysis.results.has("unknown", motion, name)
        cells.append(f"{analysis.errors(motion, name, 'unknown').mean():.2f}" if unknown else "")
        rows.append(cells)
    heads = ["method", "paper, (9)", "paper, (10)", "(9), degrees", "(10)", "worst run", "of the angles that can err"]
    heads += ["swapped %", "lost %", "wrong runs %", "paper, s a frame", "CPU s", "yaw unknown: (9)"]
    return Table(f"table-2-{motion}", heads, rows)


def claims(analysis: Analysis) -> Iterator[Claim]:
    """Yield the paper's claims, each on one motion."""
    results, motions, all_three, tracked = analysis.results, analysis.motions, [*analysis.motions], ("walk", "run")
    for motion, (lower, other) in product(tracked, (("sapso@full", "particle@full"), (OURS, "sapso@full"))):
        difference = analysis.errors(motion, lower) - analysis.errors(motion, other)
        yield Claim(f"{LABELS[lower]} has a smaller error than {LABELS[other]}, {motion}", "table 2", difference)
    for motion in tracked:
        ours, full = (1e3 * results.of("cpu_seconds", "track", motion, name) for name in (OURS, "sapso@full"))
        yield Claim(f"PCA + SAPSO takes less time than SAPSO, {motion}", "table 2", ours - full, "CPU ms a frame")
    for motion in tracked:
        text = f"tracks have an error of about 4 degrees, {motion}"
        yield Claim(text, "5.4", analysis.errors(motion), bound=TRACK_DEGREES)
    # the walk with a turn is followed in the space of the straight walk
    for (words, count), (motion, name) in product((("six", 6), ("five", 5)), (("turn", "walk"), ("run", "run"))):
        share = np.asarray(100.0 * PCA().fit(motions[motion].angles).explained[:count].sum())
        text = f"{words} components keep 95 % of the variance, {name}"
        yield Claim(text, "2.1", share, "%", 100.0 * VARIANCE, above=True)
    for motion, (name, form) in product(tracked, ((OURS, ""), (LETTER, ", the letter"))):
        history = results.of("history", "first", motion, name)  # (views, seeds, swarms, populations)
        usual = history[:, :, SWARMS.index(40)]
        fall = usual[:, :, min(CONVERGED, usual.shape[2] - 1)] - usual[:, :, -1]
        text = f"after 30 iterations the cost falls by less than 1, {motion}{form}"
        yield Claim(text, "figure 6", fall, "cost", SAME_COST)
        ends = np.abs(history[:, :, 0, -1] - history[:, :, -1, -1])
        text = f"N = 20 and N = 100 differ by less than 1, {motion}{form}"
        yield Claim(text, "figure 6", ends, "cost", SAME_COST)
    for motion in all_three:
        away = analysis.away(motion, OURS, "image")
        small = 100.0 * (away[..., analysis.free(motion)].mean(axis=2) < SMALL_DEGREES).mean(axis=2)
        text = f"most dimensions have an error below 5 degrees, {motion}"
        yield Claim(text, "figure 7", small, "% of those that can err", 50.0, above=True)
    for motion in all_three:
        errors, paper = (
            table_1_angles(analysis, motion, OURS, "image"),
            float(np.abs(np.subtract(*TABLE_1[motion])).mean()),
        )
        yield Claim(f"femora and knees are as near as in table 1, {motion}", "table 1", errors, bound=paper)
    for motion in all_three:
        hidden = analysis.errors(motion, OURS, "hidden", free=True)
        worse = hidden - analysis.errors(motion, OURS, "image", free=True)[: len(hidden)]  # of the same views
        text = f"a hidden part adds less than 1 degree, {motion}"
        yield Claim(text, "figure 8", worse, bound=SAME_DEGREES)
    for motion in all_three:
        around = np.ptp(analysis.errors(motion, OURS, "image", free=True), axis=0)[None]
        yield Claim(f"eight views have the same error to 1 degree, {motion}", "5.3", around, bound=SAME_DEGREES)
    for motion in all_three:
        swapped = 100.0 * analysis.share("swapped", motion, OURS, "image")
        yield Claim(f"left and right are never exchanged, {motion}", "5.3", swapped, "% of frames", 100.0 * SWAPPED)
    for motion in tracked:
        share = 100.0 * few_joints(analysis, motion)
        yield Claim(f"a few joints make up high errors, {motion}", "5.4", share, "% by 3 of 22", 50.0, above=True)


def table_1_angles(analysis: Analysis, motion: str, method: str, kind: str) -> Array:
    """Return the mean errors (views, seeds) of table 1's angles, of those that can err."""
    chosen = [angle for angle in ANGLES if analysis.free(motion)[angle]]
    return np.asarray(analysis.away(motion, method, kind)[..., chosen].mean(axis=(2, 3)))


def few_joints(analysis: Analysis, motion: str) -> Array:
    """Return which share (views, seeds) of the error of a run's worst tenth of frames its three worst joints have."""
    away = analysis.away(motion)
    joints = away.reshape(*away.shape[:3], 22, 3).sum(axis=4)  # the root and 21 inner joints
    shares = np.empty(joints.shape[:2])
    for place in np.ndindex(shares.shape):
        frames = joints[place]
        high = frames[frames.sum(axis=1) >= np.quantile(frames.sum(axis=1), HIGH_FRAMES)].sum(axis=0)
        shares[place] = np.sort(high)[-FEW_JOINTS:].sum() / high.sum()
    return shares


def by_view(analysis: Analysis) -> Table:
    """Return single images by view, all around: the yaw unknown, each frame by itself."""
    views = sorted({run.view for run in analysis.results.runs if run.kind == "image"})
    rows = []
    for motion in analysis.motions:
        yaw = analysis.away(motion, OURS, "image")[..., 0]
        figures = {
            "PCA + SAPSO, degrees": analysis.errors(motion, OURS, "image", free=True),
            "the letter, degrees": analysis.errors(motion, LETTER, "image", free=True),
            "its yaw, degrees": yaw.mean(axis=2),
            "the wrong way round, %": 100.0 * (yaw > TURNED_ROUND).mean(axis=2),
            "left for right, %": 100.0 * analysis.share("swapped", motion, OURS, "image"),
        }
        for label, values in figures.items():
            digits = 0 if "%" in label else 1
            cells = [f"{value:.{digits}f}" for value in values.mean(axis=1)]
            rows.append([MOTIONS[motion], label, *cells, bounded(interval(values), digits)])
    return Table("views", ["motion", "", *(f"{view:.0f}°" for view in views), "mean"], rows, 2)


def parts(analysis: Analysis) -> Table:
    """Return by how much PCA + SAPSO is worse without each part, and others than it is, paired by view and seed."""
    labels = {"sapso@full": "no PCA space: all angles"} | {name: LABELS[name] for name in (*PARTS, *OTHERS, *BASELINES)}
    rows = []
    for name, label in labels.items():
        cells = [label]
        for motion in analysis.motions:
            cells.append(bounded(interval(analysis.errors(motion, name) - analysis.errors(motion))))
        rows.append(cells)
    first = [
        "PCA + SAPSO itself, degrees",
        *(bounded(interval(analysis.errors(motion))) for motion in analysis.motions),
    ]
    return Table("parts", ["without, or instead", *(MOTIONS[motion] for motion in analysis.motions)], [first, *rows])


def turn(analysis: Analysis) -> Table:
    """Return the errors on the walk with a turn, by view."""
    views = sorted({run.view for run in analysis.results.runs if run.kind == "track"})
    rows = []
    for name in (*COMPARED["turn"], *BASELINES):
        if name in PARTS:
            continue
        errors, worst = analysis.errors("turn", name), analysis.away("turn", name)[..., 0].mean(axis=2)
        cells = [f"{value:.2f}" for value in errors.mean(axis=1)]
        yaw = f"{worst.mean():.1f}" if name in METHODS else ""
        rows.append([LABELS[name], *cells, bounded(interval(errors)), yaw])
    return Table("turn", ["method", *(f"{view:.0f}°" for view in views), "mean", "yaw"], rows)
