"""What becomes of the SAPSO paper's claims, on errors that are made up."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.tracking.measures import BASELINES
from posefit_reproduce.sapso.claims import PaperClaim, paper_claims
from posefit_reproduce.sapso.design import COMPARED, LETTER, OURS, Scale
from posefit_reproduce.sapso.experiment import ImageKey, PaperResults, PaperTrack, TrackKey
from posefit_reproduce.sapso.motions import paper_motions

SEEDS = 12
SCALE = Scale(frames=2, views=(45.0,), iterations=60, swarms=(20, 100))
DEGREES = {
    "particle@full": 5.0,
    "sapso@full": 4.0,
    OURS: 2.0,
    LETTER: 3.0,
    "pso@pca": 1.0,
    "particle@pca": 2.0,
    **dict.fromkeys(BASELINES, 3.0),
}


def results(seeds: int = SEEDS, history: Array | None = None, swapped: float = 0.0) -> PaperResults:
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
    images = {
        ImageKey(motion, name, 45.0, seed, hidden): PaperTrack(
            made[motion].test.poses + off[name], 0.01, 2440.0, swapped, 0.0
        )
        for motion in made
        for name in (OURS, LETTER)
        for seed in range(seeds)
        for hidden in (False, True)
    }
    baselines = {
        (motion, 45.0): {name: one.test.poses + off[name] for name in BASELINES} for motion, one in made.items()
    }
    falling = np.tile(np.maximum(20.0 - np.arange(61.0), 5.0), (2, 1)) if history is None else history
    histories = {(motion, 45.0, seed): falling for motion in ("walk", "run") for seed in range(seeds)}
    return PaperResults(made, SCALE, seeds, tracks, images, baselines, histories)


def of(claims: list[PaperClaim], text: str) -> PaperClaim:
    """Return the only claim that begins so."""
    (one,) = [claim for claim in claims if claim.text.startswith(text)]
    return one


@pytest.fixture(scope="module")
def claims() -> list[PaperClaim]:
    return paper_claims(results())


def test_an_order_that_every_pair_has_is_confirmed(claims: list[PaperClaim]) -> None:
    for text in ("SAPSO errs less than PF on the walk", "PCA + SAPSO errs less than SAPSO on the run"):
        assert of(claims, text).verdict == "confirmed"
    one = of(claims, "SAPSO errs less than PF on the walk")
    assert one.source == "table 2"
    # all 12 signed ranks of one sign: p = 2 / 2^12; Holm's first factor is the paper's 6 tests, all alike
    assert f"p = {2.0 / 2**12:.2g}, {6 * 2.0 / 2**12:.3g} after Holm for 6 tests, 12 pairs" in one.evidence
    # 1 degree less, times the mean of the middle two factors 1.05 and 1.06
    assert "median difference -1.05 degrees" in one.evidence or "median difference -1.06 degrees" in one.evidence


def test_an_order_the_other_way_round_is_called_so(claims: list[PaperClaim]) -> None:
    one = of(claims, "PCA + SAPSO errs less than PCA + PSO on the walk")
    assert (one.verdict, one.source) == ("the opposite holds", "")


def test_equal_errors_confirm_nothing(claims: list[PaperClaim]) -> None:
    assert of(claims, "PCA + SAPSO errs less than PCA + PF on the run").verdict == "not confirmed"


def test_the_method_is_held_against_every_baseline(claims: list[PaperClaim]) -> None:
    for name in BASELINES.values():
        assert of(claims, f"PCA + SAPSO errs less than the {name} on the walk").verdict == "confirmed"


def test_less_time_is_paired_too(claims: list[PaperClaim]) -> None:
    one = of(claims, "PCA + SAPSO takes less time than SAPSO on the walk")
    assert one.verdict == "confirmed"
    assert "ms" in one.evidence


def test_few_pairs_confirm_nothing_and_say_so() -> None:
    one = of(paper_claims(results(seeds=3)), "SAPSO errs less than PF on the walk")
    assert one.verdict == "not decided"
    assert "3 pairs, too few to confirm anything" in one.evidence


def test_a_cost_that_is_still_falling_has_not_converged(claims: list[PaperClaim]) -> None:
    assert of(claims, "the cost has converged after 30").verdict == "confirmed"
    straight = np.tile(100.0 - np.arange(61.0), (2, 1))
    one = of(paper_claims(results(history=straight)), "the cost has converged after 30")
    assert one.verdict == "not confirmed"
    assert "50 % with N = 20, 50 % with N = 100" in one.evidence


def test_the_number_of_particles_matters_little_only_if_costs_are_shown_to_be_alike(claims: list[PaperClaim]) -> None:
    assert of(claims, "the number of particles").verdict == "confirmed"
    assert of(paper_claims(results(seeds=1)), "the number of particles").verdict == "not decided"
    better = np.stack([np.full(61, 9.0), np.full(61, 4.0)])
    assert of(paper_claims(results(history=better)), "the number of particles").verdict == "the opposite holds"


def test_claims_of_single_images_are_judged_by_their_runs(claims: list[PaperClaim]) -> None:
    assert of(claims, "poses err by less than 5 degrees although").verdict == "confirmed"
    assert of(claims, "left and right").verdict == "confirmed"
    assert of(claims, "views of one motion").verdict == "not decided"  # there is one
    assert of(paper_claims(results(swapped=0.2)), "left and right").verdict == "the opposite holds"


def test_claims_of_tracks_are_judged_by_their_size_and_their_joints(claims: list[PaperClaim]) -> None:
    assert of(claims, "tracks err by about 4 degrees").verdict == "confirmed"  # 2 degrees and a little
    few = of(claims, "frames with a high error")
    assert few.verdict == "not confirmed"  # every joint errs alike
    assert "3 of 22 joints hold 14 %, 14 % of the error" in few.evidence


def test_dimensions_are_counted_among_the_free_ones(claims: list[PaperClaim]) -> None:
    turn = of(claims, "most dimensions err by less than 5 degrees on the walk with a turn")
    free = int(paper_motions(None, 1)["walk"].test.skeleton.free.sum())
    assert turn.verdict == "confirmed"
    assert turn.evidence == f"{free} of the {free} free angles; of the mean training pose {free}"
