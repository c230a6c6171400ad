"""Commands of plugins: found, named once, and left out with a word where something is wrong with them."""

from types import SimpleNamespace
from typing import Any

import click
import pytest

from posefit import hookimpl
from posefit.commands import commands_of


def point(name: str, module: Any) -> Any:
    def loaded() -> Any:
        if isinstance(module, Exception):
            raise module
        return module

    return SimpleNamespace(name=name, dist=SimpleNamespace(name=f"posefit-{name}", version="1.0"), load=loaded)


def plugin(*commands: Any, hook: str = "posefit_register_commands") -> Any:
    def register_all(register: Any) -> None:
        for command in commands:
            register(command)

    return SimpleNamespace(**{hook: hookimpl(register_all)})


def test_commands_are_found_by_the_name_they_have() -> None:
    (found,) = commands_of([point("hello", plugin(click.Command("greet"), click.Group("part")))], variables={})
    assert found.state == "loaded"
    assert [command.name for command in found.offers] == ["greet", "part"]


@pytest.mark.parametrize(
    ("module", "cause"),
    [
        (ModuleNotFoundError("No module named 'x'"), "ModuleNotFoundError: No module named 'x'"),
        (plugin(click.Command("track")), "ValueError: command 'track' is already registered by posefit"),
        (
            plugin(click.Command("a"), click.Command("a")),
            "ValueError: command 'a' is already registered by posefit-bad",
        ),
        (plugin(print), "TypeError: a command must be a click.Command with a name, got <built-in function print>"),
        (plugin(click.Command(None)), "TypeError: a command must be a click.Command with a name"),
        (plugin(click.Command("a"), hook="posefit_register_comands"), "PluginValidationError"),
    ],
)
def test_a_broken_one_is_left_out_and_the_others_work(module: Any, cause: str) -> None:
    points = [point("bad", module), point("good", plugin(click.Command("greet")))]
    with pytest.warns(UserWarning, match="plugin 'bad' of posefit-bad 1.0 is left out"):
        bad, good = commands_of(points, taken=["track"], variables={})
    assert bad.state == "broken"
    assert bad.cause.startswith(cause)
    assert good.state == "loaded"
    with pytest.raises(ValueError, match="plugin 'bad' of posefit-bad 1.0 is left out"):
        commands_of(points, taken=["track"], variables={"POSEFIT_STRICT_PLUGINS": "1"})


def test_variables_choose_which_are_loaded() -> None:
    points = [point("one", plugin(click.Command("a"))), point("two", plugin(click.Command("b")))]
    assert [one.state for one in commands_of(points, variables={"POSEFIT_BLOCK_PLUGINS": "two"})] == [
        "loaded",
        "left out",
    ]
    assert [one.state for one in commands_of(points, variables={"POSEFIT_LOAD_PLUGINS": "two"})] == [
        "left out",
        "loaded",
    ]
