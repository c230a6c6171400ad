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
from posefit.registry import COMMAND, KINDS, Offer, Registry, load, registry
from posefit.version import source_digest
from posefit_priors.pca import PCA
from tests.cases import each


def point(name: str, module: Any, group: str = "posefit") -> Any:
    """Return what stands for an entry point of a distribution that is not installed."""

    def load() -> Any:
        if isinstance(module, BaseException):
            raise module
        return module() if callable(module) else module

    distribution = SimpleNamespace(name=f"posefit-{name}", version="1.0")
    return SimpleNamespace(name=name, group=group, dist=distribution, load=load)


def registering(*offers: Any, hook: str = "optimisers", **more: Any) -> Any:
    """Return a plugin that registers each offer, a tuple of arguments."""

    def register_all(register: Any) -> None:
        for offer in offers:
            register(*offer, **more)

    return SimpleNamespace(**{f"posefit_register_{hook}": hookimpl(register_all)})


def commands(*offers: Any) -> Any:
    return registering(*((offer,) for offer in offers), hook="commands")


def test_the_built_ins_are_registered_like_a_third_partys() -> None:
    offers = registry().offers
    for kind, name in (
        ("optimiser", "sapso"),
        ("optimiser", "random"),
        ("prior", "pca"),
        ("start", "lookup"),
    ):
        assert offers[kind][name].distribution == "posefit"
    next_frames = {
        name: offer.next_frame for name, offer in offers["optimiser"].items()
    }
    assert {next_frames[name] for name in ("sapso", "pso", "cma", "scipy")} == {"start"}
    assert {next_frames[name] for name in ("particle", "annealed")} == {"carry"}
    assert next_frames["random"] == "forget"
    assert (
        Registry(load([point("mine", registering(("mine", PCA)))])).optimiser("mine")
        is PCA
    )
    starts = Registry(load([point("mine", registering(("guess", PCA), hook="starts"))]))
    assert starts.offer("start", "guess").factory is PCA


BROKEN = {
    KINDS: [
        (ImportError("no module named 'lost'"), "ImportError: no module named 'lost'"),
        (SystemExit(3), "SystemExit: 3"),
        (registering(hook="optimizers"), "did you mean 'posefit_register_optimisers'?"),
        (registering(("a", PCA), hook="priors", colour="red"), "TypeError"),
        (registering(("a.b", PCA)), "a name must be letters, digits"),
        (registering(("a:b", PCA)), "a name must be letters, digits"),
        (registering((3, PCA)), "a name must be letters, digits"),
        (
            registering(("a", "PCA")),
            "optimiser 'a' must be a factory that can be called, got 'PCA'",
        ),
        (
            registering(("a", PCA), next_frame="stay"),
            "next_frame must be one of start, carry, forget, got 'stay'",
        ),
    ],
    (COMMAND,): [
        (
            commands(click.Command("track")),
            "command 'track' is already registered by posefit",
        ),
        (
            commands(click.Command("a"), click.Command("a")),
            "command 'a' is already registered by posefit-bad",
        ),
        (
            commands(print),
            "a command must be a click.Command with a name, got <built-in function print>",
        ),
        (
            commands(click.Command(None)),
            "a command must be a click.Command with a name",
        ),
        (ImportError("no module named 'lost'"), "ImportError: no module named 'lost'"),
        (registering(hook="command"), "posefit_register_command"),
    ],
}
GOOD = {KINDS: registering(("good", PCA)), (COMMAND,): commands(click.Command("greet"))}


@each("kinds", BROKEN)
def test_a_broken_plugin_is_left_out_with_a_warning_and_the_others_work(
    kinds: Any,
) -> None:
    for module, cause in BROKEN[kinds]:
        points = [point("bad", module), point("good", GOOD[kinds])]
        with pytest.warns(
            UserWarning, match="plugin 'bad' of posefit-bad 1.0 is left out: "
        ) as caught:
            bad, good = load(points, kinds, {}, ["track"])
        assert len(caught) == 1
        assert cause in str(caught[0].message)
        assert (bad.state, good.state) == ("broken", "loaded")
        assert bad.traceback


def test_an_unknown_name_gets_the_nearest_its_kind_or_the_doctor() -> None:
    with pytest.warns(UserWarning, match="'bad' of posefit-bad 1.0 is left out"):
        installed = Registry(
            (
                *registry().plugins,
                *load([point("bad", ImportError("no module"))], variables={}),
            )
        )
    alone = registry()
    for plugins, name, hint in (
        (alone, "sapos", r"; did you mean 'sapso'\?"),
        (alone, "mixture", "; its kind is segmenter"),
        (alone, "xyzzy", "; posefit plugins doctor lists what is installed, .*"),
        (
            installed,
            "sapsso",
            r"did you mean 'sapso'\? posefit plugins doctor says why bad failed to load",
        ),
        (installed, "xyzzy", "; posefit plugins doctor says why bad failed to load"),
    ):
        with pytest.raises(ValueError, match=f"got '{name}'.*{hint}$"):
            plugins.offer("optimiser", name)


def test_an_entry_point_of_a_group_that_is_nearly_right_is_broken() -> None:
    with pytest.warns(
        UserWarning, match="must be in the group 'posefit', got 'posefit.plugins'"
    ):
        (plugin,) = load([point("mine", registering(("mine", PCA)), "posefit.plugins")])
    assert plugin.state == "broken"


def test_one_module_registers_methods_and_commands_and_only_the_hooks_of_the_kinds_asked_for_are_called() -> (
    None
):
    greet = click.Command("greet")
    part = click.Group("part")
    module = SimpleNamespace(
        **vars(registering(("mine", PCA))), **vars(commands(greet, part))
    )
    made = (greet, part)
    for kinds, names, found in (
        (KINDS, ["mine"], ()),
        ((COMMAND,), [], made),
        ((*KINDS, COMMAND), ["mine"], made),
    ):
        (plugin,) = load([point("hello", module)], kinds)
        assert [offer.name for offer in plugin.offers] == names
        assert plugin.commands == found


def test_a_taken_name_is_refused_and_its_plugin_left_out_whole() -> None:
    points = [
        point("a", registering(("one", PCA))),
        point("b", registering(("new", PCA), ("one", PCA))),
    ]
    with pytest.warns(UserWarning, match="'one' is already registered by posefit-a"):
        offers = Registry(load(points)).offers["optimiser"]
    assert {name: offer.distribution for name, offer in offers.items()} == {
        "one": "posefit-a"
    }


def test_a_variable_chooses_the_plugins_to_leave_out() -> None:
    for variables, loaded in (
        ({}, {"posefit-a", "posefit-b"}),
        ({"POSEFIT_BLOCK_PLUGINS": "b"}, {"posefit-a"}),
        ({"POSEFIT_BLOCK_PLUGINS": "Posefit-A,b"}, set()),
    ):
        points = [point(name, registering((f"of-{name}", PCA))) for name in "ab"]
        methods = Registry(load(points, variables=variables))
        assert {
            plugin.distribution
            for plugin in methods.plugins
            if plugin.state == "loaded"
        } == loaded, variables
        assert {
            offer.distribution for offer in methods.offers["optimiser"].values()
        } == loaded, variables
        left_out = [
            plugin.cause for plugin in methods.plugins if plugin.state != "loaded"
        ]
        assert all("names it" in cause for cause in left_out), variables


def test_the_origin_of_results_changes_with_the_source_of_a_plugin(
    tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    package = tmp_path / "growing"
    package.mkdir()
    (package / "__init__.py").write_text("from growing.part import Search\n")
    origins = []
    for step in (1, 2, 1):
        (package / "part.py").write_text(f"class Search:\n    step = {step}\n")
        for name in ("growing.part", "growing"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        source_digest.cache_clear()
        search = importlib.import_module("growing").Search
        origins.append(
            Offer(
                "optimiser", "growing", partial(search), "posefit-growing", "1.0"
            ).origin
        )
    assert origins[0] == origins[2] != origins[1]
    assert origins[0].startswith("posefit-growing 1.0 ")
    # a plugin without a file has its version alone
    assert (
        Offer("optimiser", "plain", dict, "posefit-plain", "1.0").origin
        == "posefit-plain 1.0"
    )
    adapter = Offer(
        "optimiser",
        "plain",
        dict,
        "posefit-plain",
        "1.0",
        needs=("numpy", "posefit[plain]"),
    )
    assert adapter.origin == f"posefit-plain 1.0 with numpy {np.__version__}"
