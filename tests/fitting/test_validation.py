"""A mistake of an optimiser ends with one line that names it and the rule."""

from typing import Any

import numpy as np
import pytest

from posefit import Problem, minimise
from posefit.fitting.validation import BrokenRuleError, Checked
from posefit.silhouette.drawn import count_poses
from posefit.testing.toy import Toy, sphere


class Answers:
    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def ask(self) -> Any:
        return self.answer() if callable(self.answer) else self.answer

    def tell(self, proposals: Any, costs: Any) -> None:
        if isinstance(self.answer, np.ndarray) and self.answer[0, 0] == 0.25:
            raise KeyError("lost")


def peeks() -> Any:
    count_poses(40.0)
    return np.zeros((4, 9))


def fails() -> None:
    raise ZeroDivisionError("division by zero")


def exits() -> None:
    raise SystemExit(0)


def test_a_broken_rule_is_named_with_the_plugin() -> None:
    rows: list[Any] = [
        (
            np.zeros((40, 8)),
            r"ask must return an array of shape \(n, 9\), got shape \(40, 8\)",
        ),
        (np.zeros(9), r"ask must return an array of shape \(n, 9\), got shape \(9,\)"),
        ([[0.0] * 9], r"ask must return an array of shape \(n, 9\), got list"),
        (
            np.zeros((4, 9)).view(np.matrix),
            r"ask must return an array of shape \(n, 9\), got matrix",
        ),
        (
            np.ma.zeros((4, 9)),
            r"ask must return an array of shape \(n, 9\), got MaskedArray",
        ),
        (None, r"ask must return an array of shape \(n, 9\), got NoneType"),
        (
            np.zeros((4, 9), dtype=int),
            "ask must return numbers of type float64, got int64",
        ),
        (np.full((4, 9), 1.5), r"ask must return proposals in \[-1, 1\], got 1.5"),
        (np.full((4, 9), -np.inf), r"ask must return proposals in \[-1, 1\], got -inf"),
        (np.full((4, 9), np.nan), "ask must return finite proposals, got nan"),
        (
            np.full((4, 9), 0.25),
            r"tell must not fail, got KeyError: 'lost' \(test_validation.py:[0-9]+\)",
        ),
        (
            fails,
            r"ask must not fail, got ZeroDivisionError: division by zero \(test_validation.py:[0-9]+\)",
        ),
        (peeks, "ask must leave evaluations to the search, got 40 of its own"),
        (exits, "ask must not end the program, got SystemExit: 0"),
    ]
    for answer, rule in rows:
        checked = Checked(Answers(answer), "optimiser 'bad' of posefit-bad 1.0", Toy(9))
        with pytest.raises(
            BrokenRuleError, match=rf"^optimiser 'bad' of posefit-bad 1.0: {rule}$"
        ):
            minimise(Problem(sphere, Toy(9), 40), checked)
    with pytest.raises(
        BrokenRuleError, match="advance must not fail, got AttributeError"
    ):
        Checked(Answers(np.zeros((4, 9))), "it", Toy(9)).advance(Toy(9))


def test_an_empty_population_ends_a_search_and_is_a_mistake_where_it_is_the_first_of_a_frame() -> (
    None
):
    class Filter(Answers):
        def advance(self, space: Any) -> None: ...

    answers = Filter(np.zeros((4, 9)))
    checked = Checked(answers, "it", Toy(9))
    checked.tell(checked.ask(), np.zeros(4))
    answers.answer = np.empty((0, 9))
    assert checked.ask().shape == (0, 9)
    checked.advance(Toy(9))
    for first in (checked, Checked(answers, "it", Toy(9))):
        with pytest.raises(
            BrokenRuleError,
            match="it: ask must return a first population of one proposal or more",
        ):
            first.ask()
