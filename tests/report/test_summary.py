"""The sentences of a report's first screen, worked by hand."""

from dataclasses import replace
from pathlib import Path

from posefit.report.contest import leaderboard
from posefit.report.summary import not_worse, others_clause, three_tracks, unpaired_sentence
from tests.report.browser import result
from tests.report.contests import (
    FIRST,
    contest_of_errors,
    contest_of_results,
    full,
    sentence,
    three_methods,
)


def test_the_leader_and_methods_not_shown_to_be_worse_are_one_sentence(tmp_path: Path) -> None:
    contest = contest_of_errors(tmp_path, three_methods())
    first = leaderboard(contest)[0]
    assert sentence(contest) == (
        f"a leads with an error of 1.26° (95 % interval {first['low']:.2f}° to {first['high']:.2f}°), 0.00° ahead of "
        "c, on 6 instances of walk with 2 seeds each; c is not shown to be worse, and b is worse (Wilcoxon's "
        "signed ranks over 12 paired runs, after Holm, at 5 %). The best baseline, the mean training pose, has 4.00°."
    )


def test_a_leader_by_the_mean_may_be_worse_on_most_runs(tmp_path: Path) -> None:
    # b is better in 11 of 12 instances, p = 0.034; in the fourth it is so much worse that its middle half is, too
    errors = {("a", i, 0): 1.0 + i for i in range(12)}
    errors |= {("b", i, 0): 7.5 if i == 3 else 0.9 + 0.999 * i for i in range(12)}
    text = sentence(contest_of_errors(tmp_path, errors))
    assert text.startswith("a leads")
    assert "; all others differ, and on most runs b is better (Wilcoxon's signed ranks" in text


def test_the_sentence_counts_worse_methods_and_names_better_ones() -> None:
    tests = {
        "methods": (0, 1, 2, 3),
        "blocks": 9,
        "pairs": [[0, 1, 0.1, 0.2, 0.2], [0, 2, -3.0, 0.01, 0.01], [0, 3, 2.0, 0.01, 0.01], [1, 2, 0.0, 1.0, 1.0]],
    }
    assert others_clause(("a", "b", "c", "d"), 0, tests, "runs") == (
        "; b is not shown to be worse, and on most runs d is better, and c is worse (Wilcoxon's signed ranks "
        "over 9 paired runs, after Holm, at 5 %)"
    )
    assert [not_worse(tests, 0), not_worse(tests, 3), not_worse(None, 0)] == [[1], [], []]


def test_one_method_alone_one_run_alone_and_a_leader_behind_the_baselines(tmp_path: Path) -> None:
    two = {"a": 1.0, "b": 2.0}
    for k, (errors, text) in enumerate(
        [
            (full(two, instances=6), "; every other method is worse ("),
            (full({"a": 1.0}), "a has an error of 1.06° on 2 instances of walk with 2 seeds each; no other method"),
            (full(two, instances=1, seeds=1), "on 1 instance of walk with one seed; one shared run is too few"),
            (full({"a": 5.0, "b": 6.0}), "It does not beat the baselines: the best baseline, the mean training pose, "),
        ]
    ):
        assert text in sentence(contest_of_errors(tmp_path / str(k), errors))


def test_too_few_runs_for_any_difference_are_reported(tmp_path: Path) -> None:
    # of eight pairs the least p is 2 / 2^8, times ten after Holm; of nine it is half of that, and below 5 %
    methods = dict.fromkeys("abcde", 1.0) | {"e": 2.0}
    errors = full(methods, instances=4, seeds=2)
    assert (
        "; too few runs to show any difference (over 8 paired runs Wilcoxon's p cannot be below 0.078 after Holm over "
        "10 pairs, and must be below 0.05)."
    ) in sentence(contest_of_errors(tmp_path / "eight", errors))
    text = sentence(contest_of_errors(tmp_path / "eleven", errors | full(methods, instances=3, seeds=3)))
    assert "b, c and d are not shown to be worse, and e is worse (" in text


def test_the_lead_is_in_degrees_and_lost_frames_of_the_first_two_are_counted(tmp_path: Path) -> None:
    lost = {("b", 1): 0.2, ("c", 0): 0.5}
    made = [
        result(replace(FIRST, method=m, instance=i), error + 0.1 * i, lost_rate=lost.get((m, i), 0.0))
        for m, error in {"a": 1.0, "b": 1.5, "c": 2.0}.items()
        for i in range(2)
    ]
    text = sentence(contest_of_results(tmp_path, made))
    assert "a leads with an error of 1.05°, 0.50° ahead of b, on 2 instances" in text
    assert "Frames are lost by a in 0, b in 1 and c in 1 of 2 tracks." in text  # too few runs to tell them apart
    alone = sentence(contest_of_results(tmp_path / "alone", [made[0], made[3]]))  # of two instances
    assert alone.startswith("a has an error of 1.00°")
    assert "Frames are lost" not in alone


def test_the_best_the_median_and_the_worst_track_are_examples(tmp_path: Path) -> None:
    for errors, examples in (
        ([3.0, 1.0, 2.0, 9.0], [("best", 1.0), ("median", 2.0), ("worst", 9.0)]),
        ([3.0, 1.0], [("best", 1.0), ("worst", 3.0)]),
        ([1.0], [("best", 1.0)]),
    ):
        runs = {("a", i, 0): error for i, error in enumerate(errors)}
        contest = contest_of_errors(tmp_path / str(len(errors)), runs)
        error = contest.runs.figures["error"]
        assert [(name, error[row]) for name, row in three_tracks(contest, 0)] == examples


def test_runs_without_a_pair_are_counted(tmp_path: Path) -> None:
    both = full({"a": 1.0, "b": 2.0}, instances=3, seeds=3)
    assert unpaired_sentence(contest_of_errors(tmp_path / "all", both)) == ""
    gaps = {key: error for key, error in both.items() if key != ("b", 2, 2)}
    assert unpaired_sentence(contest_of_errors(tmp_path / "gap", gaps)) == (
        "1 finished run is left out of the comparison, as some method has no run to pair it with; 4 more count in "
        "tests, but not in means and intervals, which are of 2 seeds of every instance"
    )
