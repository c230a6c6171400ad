"""What becomes of claims: three words, by an interval of runs that are made up."""

import numpy as np
import pytest

from posefit_reproduce.experiment import Claim, claims_table, interval

# differences of two views and four seeds: the mean is 1; the variance of its mean is that of the seeds of each view,
# 2 x (1/3) / 4 / 2^2, with 6 degrees of freedom, of which t is 2.447: 1 +- 2.447 x 0.2041
VALUES = np.array([[0.5, 1.5, 0.5, 1.5], [0.5, 1.5, 0.5, 1.5]])
HALF = 2.446912 * np.sqrt(2.0 * (1.0 / 3.0) / 4.0 / 4.0)


def test_the_interval_is_students_within_views() -> None:
    mean = interval(VALUES)
    assert mean.value == 1.0
    assert [mean.low, mean.high] == pytest.approx([1.0 - HALF, 1.0 + HALF], rel=1e-5)
    shifted = VALUES + np.array([[0.0], [10.0]])  # what views differ by is no noise
    assert interval(shifted).high - interval(shifted).value == pytest.approx(
        HALF, rel=1e-5
    )


def test_a_claim_is_judged_by_its_interval() -> None:
    verdicts = {
        2.0: ("holds", "fails"),
        1.2: ("not decided", "not decided"),
        0.0: ("fails", "holds"),
    }
    for bound, expected in verdicts.items():
        claims = [
            Claim("", "", "", VALUES, bound=bound, above=above)
            for above in (False, True)
        ]
        assert tuple(claim.verdict(0.95)[0] for claim in claims) == expected, bound


def test_a_single_seed_decides_nothing_and_a_fact_needs_no_seeds() -> None:
    assert (
        Claim("", "", "", VALUES[:, :1], bound=100.0).verdict(0.95)[0] == "not decided"
    )
    assert (
        Claim("", "", "", np.asarray(97.0), bound=95.0, above=True).verdict(0.95)[0]
        == "holds"
    )


def test_the_more_claims_a_table_has_the_wider_are_their_intervals() -> None:
    near = [
        Claim("near its bound", "here", f"{k}", VALUES, "mm", 1.0 + 1.1 * HALF)
        for k in range(10)
    ]
    alone, many = (claims_table("claims", near[:n]) for n in (1, 10))
    assert alone.rows == [
        [
            "near its bound",
            "here",
            "below 1.55 mm",
            "8",
            "**holds** 1.00 (0.50 to 1.50)",
        ]
    ]
    assert all(cell.startswith("**not decided**") for cell in many.rows[0][4:])


def test_the_claims_of_a_text_are_one_row_and_a_subject_is_a_column() -> None:
    rows = (
        ("one", "2.1", "run", 5.0),
        ("two", "5.3", "walk", 4.0),
        ("two", "5.3", "run", 0.0),
    )
    table = claims_table(
        "claims", [Claim(*texts, VALUES, bound=bound) for *texts, bound in rows]
    )
    assert table.heads[3:] == ["n", "walk", "run"]
    assert [row[2] for row in table.rows] == ["below 5 degrees", "below 4 / 0 degrees"]
    assert table.rows[0][4] == ""
    assert [cell.split()[0] for cell in table.rows[1][4:]] == ["**holds**", "**fails**"]
