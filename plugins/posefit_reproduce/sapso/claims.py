"""What the SAPSO paper claims, and whether the repeated experiments bear it out."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import INNER, JOINTS
from posefit.statistics.ranks import LEVEL, holm, wilcoxon
from posefit.tracking.measures import BASELINES
from posefit_reproduce.sapso.design import LETTER, METHODS, OURS
from posefit_reproduce.sapso.experiment import PaperResults
from posefit_reproduce.sapso.first_frame import compact_space
from posefit_reproduce.sapso.motions import LABELS
from posefit_reproduce.sapso.numbers import CONVERGED, SMALL_DEGREES, TABLE_2, VARIANCE
from posefit_swarm.claim import SAPSO_ORDER

FALLEN = 0.95  # share of the fall of the cost at which a search counts as converged; the paper gives no measure
TRACK_DEGREES = 4.0  # what section 5.4 calls the mean error of its tracks
HIGH_FRAMES, FEW_JOINTS = 0.9, 3  # the quantile from which a frame's error is high; the paper gives no measure
SWAPPED = 0.01  # share of frames with left and right swapped that still counts as none

ALIKE_DEGREES = 1.0  # by which the errors of views may differ where views come out alike
ALIKE_COST = 1.0  # by which the last costs of swarms may differ where their sizes matter little

Verdict = Literal["confirmed", "not confirmed", "the opposite holds", "not decided"]


@dataclass(frozen=True)
class PaperClaim:
    """A sentence, and what speaks for it or against it."""

    text: str
    source: str  # where the paper says so; "" where it does not
    verdict: Verdict
    evidence: str


@dataclass(frozen=True)
class _Pair:
    text: str
    source: str
    unit: str
    errors: Array  # (2, views, seeds), of the one that is claimed to be lower, and of the other


def paper_claims(results: PaperResults) -> list[PaperClaim]:
    """Return every claim with its evidence: the paper's first, those that a paired test can judge before the others."""
    pairs = [pair for motion in TABLE_2 for pair in _paired(results, motion)]
    return [
        *_judged([pair for pair in pairs if pair.source]),
        *_compactness(results),
        *_convergence(results),
        *_small(results),
        *_tracks(results),
        *_single_images(results),
        *_judged([pair for pair in pairs if not pair.source]),
    ]


def _judged(pairs: Sequence[_Pair]) -> list[PaperClaim]:
    """Return the claims of pairs that are adjusted for each other."""
    tests = [wilcoxon(pair.errors)[0] for pair in pairs]
    return [
        PaperClaim(
            pair.text,
            pair.source,
            _judgement(test.difference, p, pair.errors[0].size, len(pairs)),
            f"median difference {test.difference:+.3g} {pair.unit}, Wilcoxon p = {test.p_value:.2g}, "
            f"{p:.3g} after Holm for {len(pairs)} tests, {_counted(pair.errors[0].size, len(pairs))}",
        )
        for pair, test, p in zip(pairs, tests, holm([test.p_value for test in tests]), strict=True)
    ]


def _judgement(difference: float, p: float, pairs: int, tests: int) -> Verdict:
    if not _enough(pairs, tests):
        return "not decided"
    if p >= LEVEL or not difference:
        return "not confirmed"
    return "confirmed" if difference < 0.0 else "the opposite holds"


def _enough(pairs: int, tests: int) -> bool:
    """Return whether so many pairs can confirm anything: all signed ranks of one sign, and Holm's largest factor."""
    return 2.0 ** (1 - pairs) * tests < LEVEL


def _counted(pairs: int, tests: int) -> str:
    return f"{pairs} pairs" + ("" if _enough(pairs, tests) else ", too few to confirm anything")


def _verdict(good: bool) -> Verdict:
    return "confirmed" if good else "not confirmed"


def _paired(results: PaperResults, motion: str) -> list[_Pair]:
    where = f"on the {LABELS[motion]}"

    def error(lower: str, other: str, source: str) -> _Pair:
        blocks = np.array([results.errors(motion, name).mean(axis=2) for name in (lower, other)])
        return _Pair(f"{_label(lower)} errs less than {_label(other)} {where}", source, "degrees", blocks)

    shape = 2, len(results.scale.views), results.seeds
    slow, fast = "sapso@full", "sapso@pca"
    seconds = np.array([[run.seconds for run in results.of(motion, name)] for name in (fast, slow)]).reshape(shape)
    return [
        *(error(lower, other, "table 2") for other, lower in pairwise(SAPSO_ORDER.methods)),
        _Pair(f"{_label(fast)} takes less time than {_label(slow)} {where}", "table 2", "ms", 1e3 * seconds),
        error(OURS, LETTER, ""),
        error("sapso@pca", "pso@pca", ""),
        error("sapso@pca", "particle@pca", ""),
        *(error("sapso@pca", name, "") for name in BASELINES),
    ]


def _label(name: str) -> str:
    return METHODS[name].label if name in METHODS else f"the {BASELINES[name]}"


def _compactness(results: PaperResults) -> list[PaperClaim]:
    claims = []
    for words, count in (("six", 6), ("five", 5)):
        shares = {m: float(compact_space(results.motions[m]).explained[:count].sum()) for m in TABLE_2}
        text = ", ".join(f"{100 * share:.1f} % of the {LABELS[motion]}" for motion, share in shares.items())
        sentence = f"{words} components keep {100 * VARIANCE:.0f} % of the variance"
        claims.append(PaperClaim(sentence, "section 2.1", _verdict(min(shares.values()) >= VARIANCE), text))
    return claims


def _convergence(results: PaperResults) -> list[PaperClaim]:
    histories = np.array(list(results.histories.values()))  # (runs, swarms, iterations + 1)
    at = min(CONVERGED, histories.shape[2] - 1)
    fall = histories[:, :, 0] - histories[:, :, -1]
    done = np.median((histories[:, :, 0] - histories[:, :, at]) / np.maximum(fall, np.finfo(float).tiny), axis=0)
    swarms = results.scale.swarms
    text = ", ".join(f"{100 * share:.0f} % with N = {count}" for count, share in zip(swarms, done, strict=True))
    ends = histories[:, [0, -1], -1]  # the least and the most particles
    middle = np.median(ends, axis=0)
    return [
        PaperClaim(
            f"the cost has converged after {at} iterations, {100 * FALLEN:.0f} % of its fall done",
            "figure 6",
            _verdict(bool((done >= FALLEN).all())),
            f"median share of the fall done: {text}",
        ),
        _below(
            "the number of particles matters little",
            "figure 6",
            ends[:, 0] - ends[:, 1],
            ALIKE_COST,
            f"last cost {middle[0]:.2f} with N = {swarms[0]}, {middle[1]:.2f} with N = {swarms[-1]}; difference",
        ),
    ]


def _small(results: PaperResults) -> list[PaperClaim]:
    claims = []
    for motion, one in results.motions.items():
        free = one.test.skeleton.free
        ours, mean = (
            results.angle_errors(motion, name).mean(axis=(0, 1, 2))[free] < SMALL_DEGREES
            for name in (OURS, "mean_pose")
        )
        claims.append(
            PaperClaim(
                f"most dimensions err by less than {SMALL_DEGREES:.0f} degrees on the {LABELS[motion]}",
                "figure 7",
                _verdict(ours.mean() > 0.5),
                f"{ours.sum()} of the {free.sum()} free angles; of the mean training pose {mean.sum()}",
            )
        )
    return claims


def _tracks(results: PaperResults) -> list[PaperClaim]:
    """Return what section 5.4 says of its tracks: how far they are off, and to which joints high errors are due."""
    errors = np.concatenate([results.errors(motion, OURS).mean(axis=2).ravel() for motion in TABLE_2])
    shares, names = list[float](), Counter[str]()
    for motion in TABLE_2:
        test = results.motions[motion].test
        away = np.abs(wrapped(results.poses(motion, OURS) - test.poses))
        frames = away.reshape(-1, 22, 3).sum(axis=2)  # the root and 21 inner joints
        high = frames[frames.sum(axis=1) >= np.quantile(frames.sum(axis=1), HIGH_FRAMES)].sum(axis=0)
        worst = np.argsort(-high)[:FEW_JOINTS]
        shares.append(float(high[worst].sum() / high.sum()))
        names.update(JOINTS[(0, *INNER)[joint]] for joint in worst.tolist())
    text = f"tracks err by about {TRACK_DEGREES:g} degrees and not more"
    return [
        _below(text, "section 5.4", errors, TRACK_DEGREES, "degrees"),
        PaperClaim(
            "frames with a high error owe most of it to a few joints such as the head",
            "section 5.4",
            _verdict(min(shares) > 0.5),
            f"{FEW_JOINTS} of 22 joints hold {', '.join(f'{100 * share:.0f} %' for share in shares)} of the error in "
            f"the worst tenth of the frames: {', '.join(names)}",
        ),
    ]


def _single_images(results: PaperResults) -> list[PaperClaim]:
    """Return what section 5.3 and figure 8 claim of single images: hidden parts, views, left and right."""
    hidden, ranges = list[float](), list[float]()
    for motion in results.motions:
        free = results.motions[motion].test.skeleton.free  # the others cannot err
        hidden += results.angle_errors(motion, hidden=True)[..., free].mean(axis=(2, 3)).ravel().tolist()
        ranges += np.ptp(results.angle_errors(motion).mean(axis=(2, 3)), axis=0).tolist()
    swapped = [run.swapped for key, run in results.images.items() if key.method == OURS and not key.hidden]
    views = len(results.scale.views) > 1
    return [
        _below(
            f"poses err by less than {SMALL_DEGREES:.0f} degrees although a part of the silhouette is hidden",
            "figure 8",
            hidden,
            SMALL_DEGREES,
            "degrees",
        ),
        _below(
            "views of one motion come out alike",
            "section 5.3",
            ranges if views else [],
            ALIKE_DEGREES,
            "range, degrees",
        ),
        _below("left and right are never taken for each other", "section 5.3", swapped, SWAPPED, "share of frames"),
    ]


def _below(text: str, source: str, values: Array | Sequence[float], bound: float, what: str) -> PaperClaim:
    """Return the claim that a figure of runs is below a bound, judged by Wilcoxon's signed ranks of the runs."""
    runs = np.asarray(values, dtype=np.float64)
    if not len(runs):
        return PaperClaim(text, source, "not decided", "there is a single view")
    test = wilcoxon(np.stack([runs, np.full(len(runs), bound)])[:, None])[0]
    verdict = _judgement(test.difference, test.p_value, len(runs), 1)
    evidence = f"{what}: median {np.median(runs):.3g}, largest {runs.max():.3g}, against {bound:g}; "
    evidence += f"Wilcoxon p = {test.p_value:.2g}, {_counted(len(runs), 1)}"
    return PaperClaim(text, source, "not decided" if verdict == "not confirmed" else verdict, evidence)
