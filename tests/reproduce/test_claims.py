"""What becomes of the SAPSO paper's claims, on errors that are made up."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.tracking.measures import BASELINES
from posefit_reproduce.sapso.claims import PaperClaim, paper_claims
from posefit_reproduce.sapso.design import COMPARED, Scale
from posefit_reproduce.sapso.experiment import PaperResults, PaperTrack, TrackKey
from posefit_reproduce.sapso.motions import paper_motions

SEEDS = 12
SCALE = Scale(frames=2, views=(45.0,), iterations=60, swarms=(20, 100))
DEGREES = {
    "particle@full": 5.0,
    "sapso@full": 4.0,
    "sapso@pca": 2.0,
    "pso@pca": 1.0,
    "particle@pca": 2.0,
    **dict.fromkeys(BASELINES, 3.0),
}


def results(seeds: int = SEEDS, history: Array | None = None) -> PaperResults:
    """Return results whose every angle is off by so many degrees, a little more with every seed."""
    made = paper_motions(None, SCALE.frames)
    off = {name: np.radians(degrees) for name, degrees in DEGREES.items()}
    tracks = {
        TrackKey(motion, name, 45.0, seed): PaperTrack(
            made[motion].test.poses + off[name] * (1.0 + 0.01 * seed),
            {"sapso@full": 0.02}.get(name, 0.01) * (1.0 + 0.01 * seed),
            2440.0,
            0.0,
            0.0,
        )
        for motion, names in COMPARED.items()
        for name in names
        for seed in range(seeds)
    }
    baselines = {
        (motion, 45.0): {name: one.test.poses + off[name] for name in BASELINES} for motion, one in made.items()
    }
    falling = np.tile(np.maximum(20.0 - np.arange(61.0), 5.0), (2, 1)) if history is None else history
    histories = {(motion, 45.0, seed): falling for motion in ("walk", "run") for seed in range(seeds)}
    return PaperResults(made, SCALE, seeds, tracks, baselines, histories)


def of(found: list[PaperClaim], text: str) -> PaperClaim:
    """Return the only claim that begins so."""
    (one,) = [claim for claim in found if claim.text.startswith(text)]
    return one


@pytest.fixture(scope="module")
def found() -> list[PaperClaim]:
    return paper_claims(results())


def test_an_order_that_every_pair_has_is_confirmed(found: list[PaperClaim]) -> None:
    for text in ("SAPSO errs less than PF on the walk", "PCA + SAPSO errs less than SAPSO on the run"):
        assert of(found, text).verdict == "confirmed"
    one = of(found, "SAPSO errs less than PF on the walk")
    assert one.source == "table 2"
    # all 12 signed ranks of one sign: p = 2 / 2^12; Holm's first factor is the paper's 6 tests, all alike
    assert f"p = {2.0 / 2**12:.2g}, {6 * 2.0 / 2**12:.3g} after Holm for 6 tests, 12 pairs" in one.evidence
    # 1 degree less, times the mean of the middle two factors 1.05 and 1.06
    assert "median difference -1.05 degrees" in one.evidence or "median difference -1.06 degrees" in one.evidence


def test_an_order_the_other_way_round_is_called_so(found: list[PaperClaim]) -> None:
    one = of(found, "PCA + SAPSO errs less than PCA + PSO on the walk")
    assert (one.verdict, one.source) == ("the opposite holds", "")


def test_equal_errors_confirm_nothing(found: list[PaperClaim]) -> None:
    assert of(found, "PCA + SAPSO errs less than PCA + PF on the run").verdict == "not confirmed"


def test_the_method_is_held_against_every_baseline(found: list[PaperClaim]) -> None:
    for name in BASELINES.values():
        assert of(found, f"PCA + SAPSO errs less than the {name} on the walk").verdict == "confirmed"


def test_less_time_is_paired_too(found: list[PaperClaim]) -> None:
    one = of(found, "PCA + SAPSO takes less time than SAPSO on the walk")
    assert one.verdict == "confirmed"
    assert "ms" in one.evidence


def test_few_pairs_confirm_nothing_and_say_so() -> None:
    one = of(paper_claims(results(seeds=3)), "SAPSO errs less than PF on the walk")
    assert one.verdict == "undecided"
    assert "3 pairs, too few to confirm anything" in one.evidence


def test_a_cost_that_is_still_falling_has_not_converged(found: list[PaperClaim]) -> None:
    assert of(found, "the cost has converged after 30").verdict == "confirmed"
    straight = np.tile(100.0 - np.arange(61.0), (2, 1))
    one = of(paper_claims(results(history=straight)), "the cost has converged after 30")
    assert one.verdict == "not confirmed"
    assert "50 % with N = 20, 50 % with N = 100" in one.evidence


def test_the_number_of_particles_is_never_confirmed_not_to_matter(found: list[PaperClaim]) -> None:
    assert of(found, "the number of particles").verdict == "not contradicted"
    better = np.stack([np.full(61, 9.0), np.full(61, 4.0)])
    assert of(paper_claims(results(history=better)), "the number of particles").verdict == "not confirmed"


def test_dimensions_are_counted_among_the_free_ones(found: list[PaperClaim]) -> None:
    turn = of(found, "most dimensions err by less than 5 degrees on the walk with a turn")
    free = int(paper_motions(None, 1)["walk"].test.skeleton.free.sum())
    assert turn.verdict == "confirmed"
    assert turn.evidence == f"{free} of the {free} free angles; of the mean training pose {free}"
