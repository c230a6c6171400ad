"""Settings are read from a plugin's signature, and a mistake is an error before anything runs."""

import functools
import inspect
import re
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.fitting.check import choices
from posefit.fitting.synthesis import Prediction
from posefit.hooks import PROJECT
from posefit.registry import register, registry
from posefit.settings import (
    check,
    check_hints,
    parse,
    planned,
    setting_text,
    settings_in,
    settings_of,
    without_settings,
)
from posefit.suites.running import run_on
from posefit.sweep.plan import Plan
from posefit_filters.particle import Particle
from posefit_swarm.sapso import SAPSO
from tests.cases import each


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


def test_texts_become_values_of_their_types() -> None:
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
        ValueError,
        match="a setting of bare must be left out, because it takes none, got 'x'",
    ):
        check("bare", lambda space, rng: None, {"x": 1})


TEXT = "from __future__ import annotations\n"
MODULE = """
from typing import TYPE_CHECKING, Annotated, Literal, Optional
from collections.abc import Sequence
if TYPE_CHECKING:
    from nowhere import Space

def function(space: Space, rng, *, value: {hint} = None): ...

class Plugin:
    def __init__(self, space: Space, *, value: {hint} = None): ...

class Heir(Plugin): ...
"""
# hint, what fits it, what does not, and a text with the value that it means
HINTS: list[tuple[str, list[object], list[object], str, object]] = [
    ("int", [3, np.int64(3)], [3.0, True, "3", None], "3", 3),
    ("float", [0.5, 3, np.float32(0.5)], ["0.5", True, None, (0.5,)], "0.5", 0.5),
    ("bool", [True, np.True_], [1, 0, "true"], "true", True),
    ("str", ["a"], [1, None], "7", "7"),
    ("None", [None], [0, "none"], "none", None),
    ("Literal['a', 'b']", ["a"], ["c", 1], "b", "b"),
    ("Literal[1, 2]", [1, np.int8(2)], [True, 1.0, 3, "1"], "2", 2),
    ("int | None", [3, None], [0.5, "a"], "none", None),
    ("Optional[Literal['a']]", ["a", None], ["b"], "a", "a"),
    ("Annotated[int, 'above 0']", [3], ["a", 0.5], "3", 3),
    ("Annotated[float | None, 1, 2]", [0.5, None], ["a"], "1", 1),
    ("tuple[float, ...]", [(0.1, 0.2, 3), (), [1.0]], [(0.1, "x"), 0.1], "1,2", (1, 2)),
    ("tuple[float, ...]", [(np.float64(0.1),)], [("x",), None], "1", (1,)),
    ("tuple[float, float]", [(1.0, 2), [1.0, 2.0]], [(1.0,), (1, 2, 3)], "1,2", (1, 2)),
    ("tuple[int, str]", [(1, "a")], [("a", 1), (1, 1)], "7,7", (7, "7")),
    (
        "tuple[tuple[int, int], ...]",
        [((1, 2), (3, 4))],
        [((1,),)],
        "[[1, 2]]",
        ((1, 2),),
    ),
    ("list[int]", [[1, 2], (1, 2), []], [["a"], [1.5], 1, "12"], "1,2", [1, 2]),
    ("list[str]", [["a"]], [[1]], "1,b", ["1", "b"]),
    ("Sequence[float]", [(1.0, 2.0), [1]], [["a"], "12"], "1,2", (1, 2)),
    ("list", [[1, "a"]], [1, "a"], "1,a", [1, "a"]),
    (
        "tuple[Annotated[int, 1] | None, ...]",
        [(1, None)],
        [(0.5,)],
        "1,none",
        (1, None),
    ),
    ("float | tuple[float, ...]", [0.5, (0.5, 1.0)], ["a", ("a",)], "1,2", (1, 2)),
    ("list[Literal['a', 'b']]", [["a", "b"]], [["c"]], "a,b", ["a", "b"]),
]


def made_with(hint: str, postponed: bool) -> list[Any]:
    """Return factories with a setting of this hint: two functions and two classes; one wraps another."""
    names: dict[str, Any] = {"__name__": "nowhere_to_be_found"}
    if postponed:
        exec(TEXT + MODULE.format(hint=hint), names)
    else:
        exec(MODULE.format(hint=hint).replace(": Space", ""), names)

    @functools.wraps(names["function"])
    def wrapping(*given: Any, **more: Any) -> None: ...

    return [
        *(names[name] for name in ("function", "Plugin", "Heir")),
        functools.partial(names["Plugin"], value=None),
        wrapping,
    ]


@each("postponed", [False, True])
@each("hint, fits, unfit, text, means", HINTS)
def test_every_hint_that_is_offered_is_checked(
    hint: str,
    fits: list[object],
    unfit: list[object],
    text: str,
    means: object,
    postponed: bool,
) -> None:
    for made in made_with(hint, postponed):
        check_hints("it", made)
        for value in fits:
            checked = check("it", made, {"value": value})
            assert check("it", made, checked) == checked
        for value in unfit:
            with pytest.raises(ValueError, match=r"it\.value must be .+, got"):
                check("it", made, {"value": value})
        came = parse("it", made, {"value": text})["value"]
        assert (came, type(came)) == (means, type(means))
        again = setting_text(came)
        assert parse("it", made, {"value": again})["value"] == came, again


@each("postponed", [False, True])
@each(
    "hint, shown",
    [
        ("dict[str, int]", "dict[str, int]"),
        ("set", "set"),
        ("list[complex]", "list[complex]"),
        ("tuple[dict, ...]", "tuple[dict, ...]"),
        ("int | bytes", "int | bytes"),
        ("Annotated[range, 1]", "range"),
    ],
)
def test_a_hint_that_cannot_be_checked_is_refused(
    hint: str, shown: str, postponed: bool
) -> None:
    for made in made_with(hint, postponed):
        with pytest.raises(
            InputError,
            match=rf"^it: the type of the setting value must be int, .*, got {re.escape(shown)}$",
        ):
            check_hints("it", made)


def test_a_hint_of_a_name_that_is_not_there_is_refused() -> None:
    def stringly(space, rng, *, a: "Missing" = 1): ...  # noqa: F821

    assert [one.name for one in settings_of(stringly)] == ["a"]
    with pytest.raises(InputError, match="setting a must be int, .*, got Missing$"):
        check_hints("it", stringly)
    with pytest.raises(InputError, match="it.a must be Missing, got 1"):
        check("it", stringly, {"a": 1})


def test_choices_are_checked_in_a_module_with_postponed_annotations() -> None:
    names: dict[str, Any] = {}
    exec(
        TEXT
        + "from typing import Literal\n"
        + "class Made:\n"
        + "    kind: Literal['a', 'b'] = 'a'\n"
        + "    def __init__(self, *, kind: Literal['a', 'b'] = 'a') -> None: ...\n",
        names,
    )
    for settings in (names["Made"], names["Made"].__init__):
        choices(settings, {"kind": "b"})
        with pytest.raises(InputError, match="kind must be one of a, b, got 'c'"):
            choices(settings, {"kind": "c"})


HUGE = 1_000_000_000  # proposals: more than memory holds


class Hungry:
    """An optimiser that draws its population when it is made."""

    def __init__(self, space: Any, rng: Any, *, population_size: int = 40) -> None:
        raise AssertionError(f"drawn: {population_size}")


def test_a_population_that_no_budget_holds_is_refused_before_it_is_drawn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    message = f"evaluations must be at least {HUGE}, one population, got 100"
    sized = [
        offer
        for offer in registry().offers["optimiser"].values()
        if any(setting.name == "population_size" for setting in offer.settings)
    ]
    assert len(sized) > 3
    for offer in sized:
        with pytest.raises(InputError, match=message):
            planned(offer.factory, {"population_size": HUGE}, 100)
    monkeypatch.setattr("posefit.registry._own", {})
    register({"hungry": (Hungry, "")})
    try:
        setting = [f"hungry.population_size={HUGE}"]
        small = {"frames": 1, "size": (80, 60), "evaluations": 100}
        track = partial(posefit.track, "walk", method="hungry", settings=setting)
        mask = np.zeros((60, 80), dtype=bool)
        mask[20:40, 30:40] = True
        plan = {"defaults": small | {"settings": {"hungry.population_size": HUGE}}}
        plan["product"] = {"methods": ["hungry"], "motions": ["walk"], "seeds": 1}
        problem = posefit.suite(instance=10_000)
        for run in (
            partial(track, **{**small, "frames": (0, 1)}),
            partial(
                posefit.fit, mask, method="hungry", settings=setting, evaluations=100
            ),
            partial(
                run_on, problem, "hungry", {"population_size": HUGE}, evaluations=100
            ),
            partial(Plan.of, plan),
        ):
            with pytest.raises(InputError, match=message):
                run()
    finally:
        registry.cache_clear()


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


def test_the_settings_are_listed_in_order_and_only_they() -> None:
    offers = [
        offer for of_kind in registry().offers.values() for offer in of_kind.values()
    ]
    factories = [offer.factory for offer in offers if offer.distribution == PROJECT]
    assert len(factories) > 12
    for factory in (*factories, Prediction):
        listed = settings_in(inspect.getdoc(factory) or "")
        assert list(listed) == [one.name for one in settings_of(factory)], factory
        assert all(meaning.endswith(".") for _, meaning in listed.values()), factory
