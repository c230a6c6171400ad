"""Plugins are loaded through one entry-point group, and a broken one costs a warning."""

import importlib
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import numpy as np
import pytest

from posefit import hookimpl
from posefit.hooks import ClaimedOrder
from posefit.registry import Offer, Registry, load, plugins_of, registry
from posefit.version import source_digest
from posefit_priors.pca import PCA
from tests.cases import each


def point(name: str, module: Any) -> Any:
    """Return what stands for an entry point of a distribution that is not installed."""

    def load() -> Any:
        if isinstance(module, BaseException):
            raise module
        return module() if callable(module) else module

    return SimpleNamespace(name=name, dist=SimpleNamespace(name=f"posefit-{name}", version="1.0"), load=load)


def registering(*offers: Any, hook: str = "optimisers", **more: Any) -> Any:
    """Return a plugin that registers each offer, a tuple of arguments."""

    def register_all(register: Any) -> None:
        for offer in offers:
            register(*offer, **more)

    return SimpleNamespace(**{f"posefit_register_{hook}": hookimpl(register_all)})


def offering(name: str) -> Any:
    return registering((name, PCA))


def commands(*offers: Any) -> Any:
    return registering(*((offer,) for offer in offers), hook="commands")


def claims(*offers: Any) -> Any:
    return registering(*((offer,) for offer in offers), hook="claims")


def test_the_built_ins_are_registered_like_a_third_partys() -> None:
    offers = registry().offers
    assert {"sapso", "random"} <= set(offers["optimiser"])
    assert "pca" in offers["prior"]
    assert offers["optimiser"]["sapso"].distribution == "posefit"
    next_frames = {name: offer.next_frame for name, offer in offers["optimiser"].items()}
    assert {next_frames[name] for name in ("sapso", "pso", "cma", "scipy")} == {"start"}
    assert {next_frames[name] for name in ("particle", "annealed")} == {"carry"}
    assert next_frames["random"] == "forget"
    assert Registry(load("methods", [point("mine", offering("mine"))])).optimiser("mine") is PCA
    # section 4 of the paper: a particle filter, SAPSO in the full space, SAPSO in the compact one
    orders = [claim.methods for plugin in plugins_of("claims") for claim in plugin.offers]
    assert orders == [("particle@full", "sapso@full", "sapso@pca")]


BROKEN = {
    "methods": [
        (ImportError("no module named 'lost'"), "ImportError: no module named 'lost'"),
        (SystemExit(3), "SystemExit: 3"),
        (registering(hook="optimizers"), "posefit_register_optimizers"),
        (registering(("a", PCA), hook="priors", colour="red"), "TypeError"),
        (registering(("a.b", PCA)), "a name must be letters, digits"),
        (registering(("a:b", PCA)), "a name must be letters, digits"),
        (registering((3, PCA)), "a name must be letters, digits"),
        (registering(("a", "PCA")), "optimiser 'a' must be a factory that can be called, got 'PCA'"),
        (registering(("a", PCA), next_frame="stay"), "next_frame must be one of start, carry, forget, got 'stay'"),
        (commands(click.Command("a")), "posefit_register_commands must end in -commands, got 'bad'"),
    ],
    "commands": [
        (commands(click.Command("track")), "command 'track' is already registered by posefit"),
        (commands(click.Command("a"), click.Command("a")), "command 'a' is already registered by posefit-bad"),
        (commands(print), "a command must be a click.Command with a name, got <built-in function print>"),
        (commands(click.Command(None)), "a command must be a click.Command with a name"),
        (offering("a"), "'bad-commands' must register commands alone, got posefit_register_optimisers"),
    ],
    "claims": [(claims(3), "a claim must be a ClaimedOrder, got 3")],
}
GOOD = {"methods": offering("good"), "commands": commands(click.Command("greet")), "claims": claims()}


@each("what", BROKEN)
def test_a_broken_plugin_is_left_out_with_a_warning_and_the_others_work(what: Any) -> None:
    end = "" if what == "methods" else f"-{what}"
    for module, cause in BROKEN[what]:
        points = [point(f"bad{end}", module), point(f"good{end}", GOOD[what])]
        with pytest.warns(UserWarning, match=f"plugin 'bad{end}' of posefit-bad{end} 1.0 is left out: ") as caught:
            bad, good = load(what, points, {"POSEFIT_STRICT_PLUGINS": "0"}, ["track"])
        assert len(caught) == 1
        assert cause in str(caught[0].message)
        assert (bad.state, good.state) == ("broken", "loaded")
        assert bad.traceback
        with pytest.raises(ValueError, match=f"plugin 'bad{end}' of posefit-bad{end} 1.0 is left out: "):
            load(what, points, {"POSEFIT_STRICT_PLUGINS": "1"}, ["track"])


def test_commands_and_claims_are_those_that_were_registered() -> None:
    (plugin,) = load("commands", [point("hello-commands", commands(click.Command("greet"), click.Group("part")))])
    assert [command.name for command in plugin.offers] == ["greet", "part"]
    orders = [ClaimedOrder("a paper", "b beats a", ("a", "b")), ClaimedOrder("another", "a beats b", ("b", "a"))]
    (plugin_with_claims,) = load("claims", [point("mine-claims", claims(*orders))])
    assert list(plugin_with_claims.offers) == orders
    for methods in (("a",), (), ("a", "a")):
        with pytest.raises(ValueError, match="methods must be at least two that differ, got"):
            ClaimedOrder("a paper", "nothing", methods)


def test_a_taken_name_is_refused_and_its_plugin_left_out_whole() -> None:
    points = [point("a", offering("one")), point("b", registering(("new", PCA), ("one", PCA)))]
    with pytest.warns(UserWarning, match="'one' is already registered by posefit-a"):
        offers = Registry(load("methods", points)).offers["optimiser"]
    assert {name: offer.distribution for name, offer in offers.items()} == {"one": "posefit-a"}


def test_variables_choose_what_is_loaded() -> None:
    for variables, loaded in (
        ({}, {"posefit-a", "posefit-b"}),
        ({"POSEFIT_LOAD_PLUGINS": "a"}, {"posefit-a"}),
        ({"POSEFIT_LOAD_PLUGINS": "posefit-b, x"}, {"posefit-b"}),
        ({"POSEFIT_LOAD_PLUGINS": ""}, set()),
        ({"POSEFIT_BLOCK_PLUGINS": "b"}, {"posefit-a"}),
        ({"POSEFIT_BLOCK_PLUGINS": "Posefit-A,b"}, set()),
        ({"POSEFIT_LOAD_PLUGINS": "a,b", "POSEFIT_BLOCK_PLUGINS": "a"}, {"posefit-b"}),
    ):
        methods = Registry(load("methods", [point("a", offering("one")), point("b", offering("two"))], variables))
        assert {plugin.distribution for plugin in methods.plugins if plugin.state == "loaded"} == loaded, variables
        assert {offer.distribution for offer in methods.offers["optimiser"].values()} == loaded, variables
        left_out = [plugin.cause for plugin in methods.plugins if plugin.state != "loaded"]
        assert all("names it" in cause or "not name it" in cause for cause in left_out), variables


def test_the_origin_of_results_changes_with_the_source_of_a_plugin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    package = tmp_path / "growing"
    package.mkdir()
    (package / "__init__.py").write_text("from growing.part import Search\n")
    origins = []
    for text in ("class Search:\n    step = 1\n", "class Search:\n    step = 2\n", "class Search:\n    step = 1\n"):
        (package / "part.py").write_text(text)
        for name in ("growing.part", "growing"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        source_digest.cache_clear()
        search = importlib.import_module("growing").Search
        origins.append(Offer("optimiser", "growing", partial(search), "posefit-growing", "1.0").origin)
    assert origins[0] == origins[2] != origins[1]
    assert origins[0].startswith("posefit-growing 1.0 ")
    # a plugin without a file has its version alone
    assert Offer("optimiser", "plain", dict, "posefit-plain", "1.0").origin == "posefit-plain 1.0"
    adapter = Offer("optimiser", "plain", dict, "posefit-plain", "1.0", needs=("numpy", "posefit[plain]"))
    assert adapter.origin == f"posefit-plain 1.0 with numpy {np.__version__}"
