"""The sentences of a report's first screen, worked by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from posefit.report.columns import listed
from posefit.report.summary import unpaired_sentence
from tests.report.browser import result
from tests.report.contests import (
    FIRST,
    board_of,
    contest_of_errors,
    contest_of_results,
    full,
    sentences,
    three_methods,
)

WHERE = "on 6 instances of walk with 2 seeds each"


def reach_of(differences: list[float], comparisons: int) -> float:
    """Return half of Student's 95 % interval of a mean, at a level that holds for some comparisons together."""
    count = len(differences)
    spread = float(np.std(differences, ddof=1)) / math.sqrt(count)
    return float(stats.t.ppf(1.0 - 0.025 / comparisons, count - 1)) * spread


def test_the_leader_its_lead_and_how_certain_it_is(tmp_path: Path) -> None:
    contest = contest_of_errors(tmp_path, three_methods())
    first = board_of(contest)[0]
    # b is behind by 1, 1.02 and 1.04 in turn: p is below 1e-12
    reach = reach_of([1.0, 1.02, 1.04] * 4, 3)
    low, high = 1.02 - reach, 1.02 + reach
    assert sentences(contest) == [
        "a lost frames in none of 12 tracks and has an error with losses of 1.26° "
        f"(95 % interval {first['low']:.2f}° to {first['high']:.2f}°) {WHERE}; "
        f"it leads b by 1.02° ({low:.2f}° to {high:.2f}°, p = 0.0015).",
        "It does not differ significantly from c (+0.00°, +0.00° to +0.00°, p = 1).",
        "Not even 1,000 seeds of each instance would show differences as small as these.",
        "The best baseline, the mean training pose, has 4.00°.",
    ]


def test_the_seeds_that_would_show_a_difference_are_named(tmp_path: Path) -> None:
    # b is behind by 3, -1, 2, -4, 3 and 3: mean 1 and standard deviation sqrt(42 / 5)
    behind = [3.0, -1.0, 2.0, -4.0, 3.0, 3.0]
    errors = {("a", i, 0): 10.0 for i in range(6)}
    errors |= {("b", i, 0): 10.0 + by for i, by in enumerate(behind)}
    needed = (1.959964 + 0.841621) ** 2 * 42.0 / 5.0
    assert sentences(contest_of_errors(tmp_path, errors))[2] == (
        f"If the difference from b is real, about {math.ceil(needed / 6.0)} seeds of each instance would show it, "
        "with a probability of 80 %."
    )


def test_without_a_difference_no_method_leads_and_too_few_runs_are_named(
    tmp_path: Path,
) -> None:
    errors = {("a", i, 0): 1.0 for i in range(5)}
    behind = [3.0, 1.0, 2.0, 4.0, 5.0]
    errors |= {("b", i, 0): 1.0 + by for i, by in enumerate(behind)}
    text = sentences(contest_of_errors(tmp_path, errors))
    # five blocks give no p below 2 / 2^5, and six are needed for 2 / 2^6 < 0.05
    assert text[:3] == [
        "No method leads; a, which comes first, lost frames in none of 5 tracks and has an error with losses of "
        "1.00° on 5 instances of walk with one seed.",
        "It does not differ significantly from b (+3.00°, p = 0.062).",
        "5 paired runs cannot show a difference between 2 methods: that takes at least 6.",
    ]


def test_a_better_method_with_more_losses_is_not_called_worse(
    tmp_path: Path,
) -> None:
    # b is 0.1 better but in one track of twelve, which it loses
    made = []
    for i in range(12):
        made.append(result(replace(FIRST, method="a", instance=i), 1.0 + 0.01 * i))
        lost = {"lost_rate": 1.0} if i == 5 else {}
        made.append(
            result(replace(FIRST, method="b", instance=i), 0.9 + 0.01 * i, **lost)
        )
    text = sentences(contest_of_results(tmp_path, made))
    assert text[0].startswith("No method leads; a, which comes first, lost frames in")
    # the lost track counts as the mean training pose, 4: 2.95 behind, the others 0.1 ahead
    assert text[1].startswith("It does not differ significantly from b (+0.15°, ")
    assert text[1].endswith(", lost in 1 of 12).")


def test_one_method_alone_one_run_alone_and_a_leader_behind_the_baselines(
    tmp_path: Path,
) -> None:
    two = {"a": 1.0, "b": 2.0}
    many = {"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0, "e": 5.0}
    cases = [
        (full(many, instances=8), "p < 0.001), and c, d and e by more (p < 0.001)."),
        (
            full({"a": 1.0, "b": 1.0}, 4),
            "does not differ significantly from b (equal in all runs).",
        ),
        (full({"a": 1.0}), "a lost frames in none of 4 tracks and has an error with "),
        (full({"a": 1.0}), "No other method shares its runs."),
        (full(two, instances=1, seeds=1), "One shared run shows no difference between"),
        (
            full({"a": 5.0, "b": 6.0}),
            "It does not beat the baselines: the mean training pose has 4.00°.",
        ),
    ]
    for k, (errors, text) in enumerate(cases):
        made = sentences(contest_of_errors(tmp_path / str(k), errors))
        assert any(text in sentence for sentence in made), (text, made)


def test_names_with_commas_are_separated_by_semicolons() -> None:
    assert listed(["a (x 1, y 2)", "b", "c"]) == "a (x 1, y 2); b; and c"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(["a", "b", "c", "d", "e"]) == "a, b, c and 2 others"
    assert listed(["a (x 1, y 2)"]) == "a (x 1, y 2)"


def test_runs_without_a_pair_are_counted(tmp_path: Path) -> None:
    both = full({"a": 1.0, "b": 2.0}, instances=3, seeds=3)
    assert unpaired_sentence(contest_of_errors(tmp_path / "all", both)) == ""
    gaps = {key: error for key, error in both.items() if key != ("b", 2, 2)}
    contest = contest_of_errors(tmp_path / "gap", gaps)
    assert unpaired_sentence(contest) == (
        "1 finished run is left out of the comparison, as some method has no run to pair it with"
    )
    assert "on 3 instances of walk with 2 to 3 seeds each" in sentences(contest)[0]
