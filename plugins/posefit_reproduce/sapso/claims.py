"""What the SAPSO paper claims, and whether the repeated experiments bear it out."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import INNER, JOINTS
from posefit.statistics.ranks import LEVEL, holm, wilcoxon
from posefit_priors.pca import PCA
from posefit_reproduce.sapso.experiment import PaperResults
from posefit_reproduce.sapso.motions import LABELS
from posefit_reproduce.sapso.paper import CONVERGED, LETTER, METHODS, OURS, SMALL_DEGREES, TABLE_2, VARIANCE

ORDER = ("particle@full", "sapso@full", "sapso@pca")  # of table 2, each beaten by the next
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


class _Pair(NamedTuple):
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
    claims = []
    for pair, test, p in zip(pairs, tests, holm([test.p_value for test in tests]), strict=True):
        verdict, counted = _judgement(test.difference, p, pair.errors[0].size, len(pairs))
        evidence = f"median difference {test.difference:+.3g} {pair.unit}, Wilcoxon p = {test.p_value:.2g}, "
        evidence += f"{p:.3g} after Holm for {len(pairs)} tests, {counted}"
        claims.append(PaperClaim(pair.text, pair.source, verdict, evidence))
    return claims


def _judgement(difference: float, p: float, pairs: int, tests: int) -> tuple[Verdict, str]:
    """Return the verdict on a claim that a difference is below 0, and how many pairs it rests on.

    So many pairs can confirm it only if they do where all signed ranks have one sign, by Holm's largest factor.
    """
    if 2.0 ** (1 - pairs) * tests >= LEVEL:
        return "not decided", f"{pairs} pairs, too few to confirm anything"
    if p >= LEVEL or not difference:
        return "not confirmed", f"{pairs} pairs"
    return "confirmed" if difference < 0.0 else "the opposite holds", f"{pairs} pairs"


def _counted(text: str, source: str, holds: object, evidence: str) -> PaperClaim:
    """Return a claim that holds or does not, without a test."""
    return PaperClaim(text, source, "confirmed" if holds else "not confirmed", evidence)


def _paired(results: PaperResults, motion: str) -> Iterator[_Pair]:
    def label(name: str) -> str:
        return METHODS[name].label if name in METHODS else f"the {BASELINES[name]}"

    def error(lower: str, other: str, source: str = "") -> _Pair:
        blocks = np.array([results.errors(motion, name).mean(axis=2) for name in (lower, other)])
        text = f"{label(lower)} errs less than {label(other)} on the {LABELS[motion]}"
        return _Pair(text, source, "degrees", blocks)

    for other, lower in pairwise(ORDER):
        yield error(lower, other, "table 2")
    seconds = np.array([[run.seconds for run in results.of(motion, name)] for name in ("sapso@pca", "sapso@full")])
    text = f"{label('sapso@pca')} takes less time than {label('sapso@full')} on the {LABELS[motion]}"
    yield _Pair(text, "table 2", "ms", 1e3 * seconds.reshape(2, len(results.scale.views), results.seeds))
    for name in (LETTER, "pso@pca", "particle@pca", *BASELINES):
        yield error(OURS, name)


def _compactness(results: PaperResults) -> Iterator[PaperClaim]:
    for words, count in (("six", 6), ("five", 5)):
        shares = {m: float(PCA().fit(results.motions[m].angles).explained[:count].sum()) for m in TABLE_2}
        text = ", ".join(f"{100 * share:.1f} % of the {LABELS[motion]}" for motion, share in shares.items())
        sentence = f"{words} components keep {100 * VARIANCE:.0f} % of the variance"
        yield _counted(sentence, "section 2.1", min(shares.values()) >= VARIANCE, text)


def _convergence(results: PaperResults) -> Iterator[PaperClaim]:
    histories = np.array([run for motion in TABLE_2 for run in results.of(motion, kind="first frame")])
    at = min(CONVERGED, histories.shape[2] - 1)  # histories are (runs, swarms, iterations + 1)
    fall = histories[:, :, 0] - histories[:, :, -1]
    done = np.median((histories[:, :, 0] - histories[:, :, at]) / np.maximum(fall, np.finfo(float).tiny), axis=0)
    swarms = results.scale.swarms
    shares = ", ".join(f"{100 * share:.0f} % with N = {count}" for count, share in zip(swarms, done, strict=True))
    text = f"the cost has converged after {at} iterations, {100 * FALLEN:.0f} % of its fall done"
    yield _counted(text, "figure 6", (done >= FALLEN).all(), f"median share of the fall done: {shares}")
    ends = histories[:, [0, -1], -1]  # the least and the most particles
    middle = np.median(ends, axis=0)
    what = f"last cost {middle[0]:.2f} with N = {swarms[0]}, {middle[1]:.2f} with N = {swarms[-1]}; difference"
    yield _below("the number of particles matters little", "figure 6", ends[:, 0] - ends[:, 1], ALIKE_COST, what)


def _small(results: PaperResults) -> Iterator[PaperClaim]:
    for motion, one in results.motions.items():
        free = one.test.skeleton.free
        ours, mean = (
            results.angle_errors(motion, name).mean(axis=(0, 1, 2))[free] < SMALL_DEGREES
            for name in (OURS, "mean_pose")
        )
        text = f"most dimensions err by less than {SMALL_DEGREES:.0f} degrees on the {LABELS[motion]}"
        evidence = f"{ours.sum()} of the {free.sum()} free angles; of the mean training pose {mean.sum()}"
        yield _counted(text, "figure 7", ours.mean() > 0.5, evidence)


def _tracks(results: PaperResults) -> Iterator[PaperClaim]:
    """Yield what section 5.4 says of its tracks: how far they are off, and to which joints high errors are due."""
    errors = np.concatenate([results.errors(motion, OURS).mean(axis=2).ravel() for motion in TABLE_2])
    text = f"tracks err by about {TRACK_DEGREES:g} degrees and not more"
    yield _below(text, "section 5.4", errors, TRACK_DEGREES, "degrees")
    shares, names = list[float](), Counter[str]()
    for motion in TABLE_2:
        away = np.abs(wrapped(results.poses(motion) - results.motions[motion].test.poses))
        frames = away.reshape(-1, 22, 3).sum(axis=2)  # the root and 21 inner joints
        high = frames[frames.sum(axis=1) >= np.quantile(frames.sum(axis=1), HIGH_FRAMES)].sum(axis=0)
        worst = np.argsort(-high)[:FEW_JOINTS]
        shares.append(float(high[worst].sum() / high.sum()))
        names.update(JOINTS[(0, *INNER)[joint]] for joint in worst.tolist())
    yield _counted(
        "frames with a high error owe most of it to a few joints such as the head",
        "section 5.4",
        min(shares) > 0.5,
        f"{FEW_JOINTS} of 22 joints hold {', '.join(f'{100 * share:.0f} %' for share in shares)} of the error in "
        f"the worst tenth of the frames: {', '.join(names)}",
    )


def _single_images(results: PaperResults) -> Iterator[PaperClaim]:
    """Yield what section 5.3 and figure 8 claim of single images: hidden parts, views, left and right."""
    hidden, ranges, swapped = list[float](), list[float](), list[float]()
    for motion in results.motions:
        free = results.motions[motion].test.skeleton.free  # the others cannot err
        hidden += results.angle_errors(motion, kind="hidden")[..., free].mean(axis=(2, 3)).ravel().tolist()
        ranges += np.ptp(results.angle_errors(motion).mean(axis=(2, 3)), axis=0).tolist()
        swapped += [run.swapped for run in results.of(motion, OURS, "images")]
    text = f"poses err by less than {SMALL_DEGREES:.0f} degrees although a part of the silhouette is hidden"
    yield _below(text, "figure 8", hidden, SMALL_DEGREES, "degrees")
    views = ranges if len(results.scale.views) > 1 else []
    yield _below("views of one motion come out alike", "section 5.3", views, ALIKE_DEGREES, "range, degrees")
    text = "left and right are never taken for each other"
    yield _below(text, "section 5.3", swapped, SWAPPED, "share of frames")


def _below(text: str, source: str, values: Array | Sequence[float], bound: float, what: str) -> PaperClaim:
    """Return the claim that a figure of runs is below a bound, judged by Wilcoxon's signed ranks of the runs."""
    runs = np.asarray(values, dtype=np.float64)
    if not len(runs):
        return PaperClaim(text, source, "not decided", "there is a single view")
    test = wilcoxon(np.stack([runs, np.full(len(runs), bound)])[:, None])[0]
    verdict, counted = _judgement(test.difference, test.p_value, len(runs), 1)
    evidence = f"{what}: median {np.median(runs):.3g}, largest {runs.max():.3g}, against {bound:g}; "
    evidence += f"Wilcoxon p = {test.p_value:.2g}, {counted}"
    return PaperClaim(text, source, "not decided" if verdict == "not confirmed" else verdict, evidence)
