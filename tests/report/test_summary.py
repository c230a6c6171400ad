"""The sentences of a report's first screen, worked by hand."""

from pathlib import Path

from posefit.report.columns import listed
from posefit.report.leaderboard import leaderboard
from posefit.report.summary import unpaired_sentence
from tests.report.contests import contest_of_errors, full, sentences, three_methods


def test_what_leads_by_how_much_and_how_certain_that_is(tmp_path: Path) -> None:
    contest = contest_of_errors(tmp_path, three_methods())
    first = leaderboard(contest)[0]
    assert sentences(contest) == [
        f"a leads with an error of 1.26° (95 % interval {first['low']:.2f}° to {first['high']:.2f}°) "
        "on 6 instances of walk with 2 seeds each.",
        "Over 12 paired runs it is better than b.",
        "12 paired runs are too few to tell it from c (median difference +0.00°, p = 1).",
        "The best baseline, the mean training pose, has 4.00°.",
    ]


def test_a_method_with_a_large_error_that_no_test_tells_apart_has_its_effect(
    tmp_path: Path,
) -> None:
    # of five blocks, the least p is 0.0625
    errors = full({"a": 1.0, "b": 3.0}, instances=5, seeds=1)
    assert sentences(contest_of_errors(tmp_path, errors))[1:3] == [
        "5 paired runs are too few to tell it from b (median difference +2.00°, p = 0.062).",
        "So few cannot show any difference: of 1 pair of methods no p can be below 0.062.",
    ]


def test_a_leader_by_the_mean_may_be_worse_on_most_runs(tmp_path: Path) -> None:
    # b is better in 11 of 12 instances, p = 0.034; in the fourth it is so much worse that its middle half is, too
    errors = {("a", i, 0): 1.0 + i for i in range(12)}
    errors |= {("b", i, 0): 7.5 if i == 3 else 0.9 + 0.999 * i for i in range(12)}
    text = sentences(contest_of_errors(tmp_path, errors))
    assert text[0].startswith("a leads")
    assert (
        text[1]
        == "On most runs it is worse than b (median difference −0.11°, p = 0.034)."
    )


def test_one_method_alone_one_run_alone_and_a_leader_behind_the_baselines(
    tmp_path: Path,
) -> None:
    two = {"a": 1.0, "b": 2.0}
    for k, (errors, text) in enumerate(
        [
            (
                full(two, instances=6),
                "Over 12 paired runs every other method is worse, the next one is b (median difference +1.00°, p < 0.001).",
            ),
            (
                full({"a": 1.0}),
                "a has an error of 1.06° on 2 instances of walk with 2 seeds each.",
            ),
            (full({"a": 1.0}), "No other method shares its runs."),
            (
                full(two, instances=1, seeds=1),
                "One shared run is too few to distinguish it from any other method.",
            ),
            (
                full({"a": 5.0, "b": 6.0}),
                "It does not beat the baselines: the best baseline, the mean training pose, has 4.00°.",
            ),
        ]
    ):
        assert text in sentences(contest_of_errors(tmp_path / str(k), errors))


def test_names_with_commas_stand_between_semicolons() -> None:
    assert listed(["a (x 1, y 2)", "b", "c"]) == "a (x 1, y 2); b; and c"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(["a", "b", "c", "d", "e"]) == "a, b, c and 2 others"
    assert listed(["a (x 1, y 2)"]) == "a (x 1, y 2)"


def test_runs_without_a_pair_are_counted(tmp_path: Path) -> None:
    both = full({"a": 1.0, "b": 2.0}, instances=3, seeds=3)
    assert unpaired_sentence(contest_of_errors(tmp_path / "all", both)) == ""
    gaps = {key: error for key, error in both.items() if key != ("b", 2, 2)}
    assert unpaired_sentence(contest_of_errors(tmp_path / "gap", gaps)) == (
        "1 finished run is left out of the comparison, as some method has no run to pair it with; 4 more count in "
        "tests, but not in means and intervals, which are of 2 seeds of every instance"
    )
