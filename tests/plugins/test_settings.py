"""Settings are read from a plugin's signature, and a mistake is an error before anything runs."""

import inspect
from typing import Literal

import numpy as np
import pytest

from posefit.fitting.tracker import Prediction
from posefit.hooks import PROJECT
from posefit.registry import registry
from posefit.settings import (
    accepts,
    check,
    parse,
    planned,
    settings_in,
    settings_of,
    without_settings,
)
from posefit_filters.particle import Particle
from posefit_swarm.sapso import SAPSO


def factory(
    space: object,
    rng: object,
    *,
    count: int = 3,
    rate: float = 0.5,
    kind: Literal["a", "b"] = "a",
    name: str = "x",
    sharp: bool = False,
    limit: float | None = None,
    reach: tuple[float, float] = (1.0, 2.0),
    anything=None,
) -> None: ...


def test_settings_have_a_name_a_type_and_a_default() -> None:
    shown = {one.name: (one.type, one.default) for one in settings_of(factory)}
    assert shown == {
        "count": ("int", 3),
        "rate": ("float", 0.5),
        "kind": ("a | b", "a"),
        "name": ("str", "x"),
        "sharp": ("bool", False),
        "limit": ("float | none", None),
        "reach": ("tuple[float, float]", (1.0, 2.0)),
        "anything": ("any", None),
    }


def test_texts_become_what_their_types_ask_for() -> None:
    given = {
        "count": "7",
        "rate": "1",
        "kind": "b",
        "name": "7",
        "sharp": "True",
        "limit": "none",
        "reach": "3,4.5",
    }
    parsed = parse("it", factory, given)
    assert parsed == {
        "count": 7,
        "rate": 1,
        "kind": "b",
        "name": "7",
        "sharp": True,
        "limit": None,
        "reach": (3, 4.5),
    }
    assert parse("it", factory, {"limit": "1e-3", "anything": "4"}) == {
        "limit": 1e-3,
        "anything": 4,
    }


def test_a_text_that_does_not_fit_is_named() -> None:
    for setting, text, message in (
        ("count", "2.5", "it.count must be int, got '2.5'"),
        ("rate", "fast", "it.rate must be float, got 'fast'"),
        ("kind", "c", r"it.kind must be a \| b, got 'c'"),
        ("sharp", "1", "it.sharp must be bool, got '1'"),
        ("reach", "3", r"it.reach must be tuple\[float, float\], got '3'"),
        (
            "rat",
            "1",
            "a setting of it must be one of count, rate, .*, got 'rat'; did you mean 'rate'?",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            parse("it", factory, {setting: text})


def test_values_are_checked_as_texts_are() -> None:
    check(
        "it",
        factory,
        {"count": 4, "rate": 1, "kind": "a", "limit": None, "anything": object()},
    )
    given = {
        "count": np.int64(4),
        "rate": np.float32(0.5),
        "sharp": np.True_,
        "reach": (np.float64(1.0), np.int8(2)),
    }
    plain = check("it", factory, given)
    assert plain == {"count": 4, "rate": 0.5, "sharp": True, "reach": (1.0, 2)}
    assert [type(value) for value in (*plain.values(), *plain["reach"])] == [
        int,
        float,
        bool,
        tuple,
        float,
        int,
    ]
    for given, message in (
        ({"count": True}, "it.count must be int, got True"),
        ({"count": 4.0}, "it.count must be int, got 4.0"),
        ({"count": np.float64(4.0)}, r"it.count must be int, got np.float64\(4.0\)"),
        ({"count": np.array([4])}, r"it.count must be int, got array\(\[4\]\)"),
        ({"rate": "0.5"}, "it.rate must be float, got '0.5'"),
        ({"nothing": 1}, "a setting of it must be one of"),
    ):
        with pytest.raises(ValueError, match=message):
            check("it", factory, given)
    with pytest.raises(
        ValueError, match="a setting of bare must be none, it takes none, got 'x'"
    ):
        check("bare", lambda space, rng: None, {"x": 1})


def test_an_unknown_annotation_accepts_everything() -> None:
    assert accepts("SomeType", 3)
    assert accepts(list[int], [1])

    def stringly(space, rng, *, a: "Missing" = 1): ...  # noqa: F821

    assert [one.name for one in settings_of(stringly)] == ["a"]


def test_a_budget_becomes_iterations_or_evaluations_whichever_an_optimiser_plans_with() -> (
    None
):
    for optimiser, given, evaluations, filled in (
        (SAPSO, {}, 2440, {"iterations": 60}),
        (
            SAPSO,
            {"population_size": 61},
            2440,
            {"population_size": 61, "iterations": 39},
        ),
        (SAPSO, {"iterations": 5}, 2440, {"iterations": 5}),
        (SAPSO, {}, 50, {"iterations": 1}),
        (Particle, {"noise": 0.2}, 500, {"noise": 0.2, "evaluations": 500}),
        (lambda space, rng: None, {}, 500, {}),
    ):
        assert planned(optimiser, given, evaluations) == filled, given


def test_a_list_of_settings_is_read_from_a_docstring() -> None:
    listed = (
        "    cooling (gamma): factor on\n        the temperature: 5.2.\n    seed: any."
    )
    text = f"A swarm.\n\nSettings:\n{listed}\n\nMore."
    assert settings_in(text) == {
        "cooling": ("gamma", "factor on the temperature: 5.2."),
        "seed": ("", "any."),
    }
    assert without_settings(text) == "A swarm.\n\nMore."
    assert settings_in("Settings stand in prose.") == {}


def test_every_setting_is_listed_in_its_order_and_nothing_else_is() -> None:
    offers = [
        offer for of_kind in registry().offers.values() for offer in of_kind.values()
    ]
    factories = [offer.factory for offer in offers if offer.distribution == PROJECT]
    assert len(factories) > 12
    for factory in (*factories, Prediction):
        listed = settings_in(inspect.getdoc(factory) or "")
        assert list(listed) == [one.name for one in settings_of(factory)], factory
        assert all(meaning.endswith(".") for _, meaning in listed.values()), factory
