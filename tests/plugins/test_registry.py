"""Plugins come in by one door, and a broken one costs a warning."""

import importlib
import io
import sys
import threading
import time
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from posefit import entries, hookimpl
from posefit.motion import built_in
from posefit.registry import Offer, registry, registry_of
from posefit.version import source_digest
from posefit_priors.pca import PCA


class Point:
    """Stands for an entry point of a distribution that is not installed."""

    def __init__(self, name: str, module: Any) -> None:
        self.name, self.module = name, module
        self.dist = type("Distribution", (), {"name": f"posefit-{name}", "version": "1.0"})()

    def load(self) -> Any:
        if isinstance(self.module, Exception):
            raise self.module
        return self.module


def plugin(**hooks: Any) -> ModuleType:
    module = ModuleType("plugin")
    for name, hook in hooks.items():
        setattr(module, name, hookimpl(hook))
    return module


def offering(name: str) -> ModuleType:
    def posefit_register_optimisers(register: Any) -> None:
        register(name, PCA)

    return plugin(posefit_register_optimisers=posefit_register_optimisers)


def test_the_built_ins_are_there_under_their_names() -> None:
    offers = registry().offers
    assert {"sapso", "random"} <= set(offers["optimiser"])
    assert "pca" in offers["prior"]
    assert offers["optimiser"]["sapso"].distribution == "posefit"


def test_a_third_partys_optimiser_is_found_like_a_built_in() -> None:
    assert registry_of([Point("mine", offering("mine"))]).optimiser("mine") is PCA  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("broken", "cause"),
    [
        (ImportError("no module named 'lost'"), "ImportError: no module named 'lost'"),
        (plugin(posefit_register_optimizers=lambda register: register), "posefit_register_optimizers"),
        (plugin(posefit_register_priors=lambda register: register / 0), "TypeError"),
    ],
)
def test_a_broken_plugin_costs_one_warning_that_names_it(broken: Any, cause: str) -> None:
    with pytest.warns(UserWarning, match="posefit-bad") as caught:
        found = registry_of([Point("bad", broken), Point("good", offering("good"))])  # type: ignore[list-item]
    assert len(caught) == 1
    assert cause in str(caught[0].message)
    assert list(found.offers["optimiser"]) == ["good"]


def test_a_taken_name_is_refused() -> None:
    with pytest.warns(UserWarning, match="'one' is already registered by posefit-a"):
        found = registry_of([Point("a", offering("one")), Point("b", offering("one"))])  # type: ignore[list-item]
    assert found.offers["optimiser"]["one"].distribution == "posefit-a"


def test_an_unknown_name_lists_the_known_and_the_nearest() -> None:
    with pytest.raises(
        ValueError, match=r"optimiser must be one of pso, random, sapso, got 'sapzo'; did you mean 'sapso'\?"
    ):
        registry_of(
            EntryPoint(f"p{k}", module, "posefit") for k, module in enumerate(["posefit_swarm", "posefit_priors"])
        ).optimiser("sapzo")


def test_the_registry_says_what_becomes_of_an_optimiser_in_the_next_frame() -> None:
    said = {name: offer.next_frame for name, offer in registry().offers["optimiser"].items()}
    assert {said[name] for name in ("sapso", "pso", "cma", "scipy")} == {"start"}
    assert {said[name] for name in ("particle", "annealed")} == {"carry"}
    assert said["random"] == "forget"


@pytest.mark.parametrize(
    ("variables", "loaded"),
    [
        ({}, {"posefit-a", "posefit-b"}),
        ({"POSEFIT_LOAD_PLUGINS": "a"}, {"posefit-a"}),
        ({"POSEFIT_LOAD_PLUGINS": "posefit-b, x"}, {"posefit-b"}),
        ({"POSEFIT_LOAD_PLUGINS": ""}, set()),
        ({"POSEFIT_BLOCK_PLUGINS": "b"}, {"posefit-a"}),
        ({"POSEFIT_BLOCK_PLUGINS": "Posefit-A,b"}, set()),
        ({"POSEFIT_LOAD_PLUGINS": "a,b", "POSEFIT_BLOCK_PLUGINS": "a"}, {"posefit-b"}),
    ],
)
def test_variables_choose_what_is_loaded(variables: dict[str, str], loaded: set[str]) -> None:
    found = registry_of([Point("a", offering("one")), Point("b", offering("two"))], variables)  # type: ignore[list-item]
    assert {plugin.distribution for plugin in found.plugins if plugin.state == "loaded"} == loaded
    assert {offer.distribution for offer in found.offers["optimiser"].values()} == loaded
    assert all("names it" in one.cause or "not name it" in one.cause for one in found.plugins if one.state != "loaded")


def test_built_ins_are_loaded_whatever_the_load_variable_says_but_may_be_blocked() -> None:
    points = [point for point in entry_points(group="posefit") if point.name in ("swarm", "priors")]
    assert "sapso" in registry_of(points, {"POSEFIT_LOAD_PLUGINS": ""}).offers["optimiser"]
    assert "sapso" not in registry_of(points, {"POSEFIT_BLOCK_PLUGINS": "swarm"}).offers["optimiser"]


@pytest.mark.parametrize("value", ["1", "yes"])
def test_a_broken_plugin_is_an_error_where_plugins_are_strict(value: str) -> None:
    points: Any = [Point("bad", ImportError("no module named 'lost'"))]
    with pytest.raises(ValueError, match="plugin 'bad' of posefit-bad 1.0 is left out: ImportError: no module named"):
        registry_of(points, {"POSEFIT_STRICT_PLUGINS": value})
    with pytest.warns(UserWarning, match="posefit-bad"):
        assert registry_of(points, {"POSEFIT_STRICT_PLUGINS": "0"}).plugins[0].state == "broken"


def registering(*arguments: Any, **more: Any) -> ModuleType:
    def posefit_register_optimisers(register: Any) -> None:
        register(*arguments, **more)

    return plugin(posefit_register_optimisers=posefit_register_optimisers)


@pytest.mark.parametrize(
    ("module", "cause"),
    [
        (registering("a.b", PCA), "a name must be letters, digits"),
        (registering("a:b", PCA), "a name must be letters"),
        (registering(3, PCA), "a name must be letters"),
        (registering("a", "PCA"), "optimiser 'a' must be a factory that can be called, got 'PCA'"),
        (registering("a", PCA, next_frame="stay"), "next_frame must be one of start, carry, forget, got 'stay'"),
        (registering("a", PCA, colour="red"), "TypeError"),
        (SystemExit(3), "SystemExit: 3"),
    ],
)
def test_a_registration_that_makes_no_sense_is_left_out(module: Any, cause: str) -> None:
    if isinstance(module, SystemExit):
        point = Point("bad", None)
        point.load = exits  # type: ignore[method-assign]
    else:
        point = Point("bad", module)
    with pytest.warns(UserWarning, match=cause):
        assert not registry_of([point]).offers["optimiser"]  # type: ignore[list-item]


def test_an_import_that_hangs_has_a_limit_that_names_the_distribution() -> None:
    def hangs() -> Any:
        while True:
            try:
                time.sleep(10.0)
            except Exception:  # it swallows what would end it
                continue

    point = Point("slow", None)
    point.load = hangs  # type: ignore[method-assign]
    points: Any = [point, Point("good", offering("good"))]
    with pytest.warns(
        UserWarning, match="'slow' of posefit-slow 1.0 is left out: it must load within 0.05 s, and did not"
    ):
        found = registry_of(points, {"POSEFIT_LOAD_SECONDS": "0.05"})
    assert list(found.offers["optimiser"]) == ["good"]
    assert "in hangs" in found.plugins[1].traceback


def test_a_load_that_nothing_can_end_is_told_of_by_name(monkeypatch: Any) -> None:
    told, waiting = io.StringIO(), threading.Event()

    def waits() -> Any:
        waiting.wait(60.0)
        return offering("late")

    class Told(io.StringIO):
        def write(self, text: str) -> int:
            waiting.set()
            return told.write(text)

    point = Point("slow", None)
    point.load = waits  # type: ignore[method-assign]
    monkeypatch.setattr(entries, "GRACE", 0.0)
    monkeypatch.setattr(sys, "stderr", Told())
    found: list[Any] = []
    load = threading.Thread(target=lambda: found.append(registry_of([point], {"POSEFIT_LOAD_SECONDS": "0.05"})))  # type: ignore[list-item]
    load.start()
    load.join()
    assert "plugin 'slow' of posefit-slow 1.0 is still loading after 0.05 s" in told.getvalue()
    assert list(found[0].offers["optimiser"]) == ["late"]


@pytest.mark.parametrize("text", ["soon", "0", "-1", "nan"])
def test_a_limit_that_makes_no_sense_is_named(text: str) -> None:
    points: Any = [Point("good", offering("good"))]
    with pytest.raises(ValueError, match=f"POSEFIT_LOAD_SECONDS must be a number of seconds above 0, got '{text}'"):
        registry_of(points, {"POSEFIT_LOAD_SECONDS": text})


def exits() -> Any:
    raise SystemExit(3)


def test_a_plugin_that_takes_one_name_that_is_taken_is_left_out_whole() -> None:
    def posefit_register_optimisers(register: Any) -> None:
        register("new", PCA)
        register("one", PCA)

    points: Any = [
        Point("a", offering("one")),
        Point("b", plugin(posefit_register_optimisers=posefit_register_optimisers)),
    ]
    with pytest.warns(UserWarning, match="'one' is already registered by posefit-a"):
        assert list(registry_of(points).offers["optimiser"]) == ["one"]


def test_a_prior_survives_its_file(tmp_path: Path) -> None:
    prior = PCA().fit(built_in.motion("walk-a").poses[:, 3:])
    prior.save(tmp_path / "prior.npz")
    again = PCA.load(tmp_path / "prior.npz")
    latents = np.random.default_rng(0).uniform(prior.low, prior.high, (50, 6))
    np.testing.assert_array_equal(again.inverse_transform(latents), prior.inverse_transform(latents))
    np.testing.assert_array_equal(again.feasible(latents), prior.feasible(latents))


def test_a_file_that_is_no_prior_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", mean=np.zeros(3))
    (tmp_path / "b.npz").write_bytes(b"nothing of the kind")
    np.savez(tmp_path / "c.npz", mean=np.array([{}], dtype=object))
    for name in "abc":
        with pytest.raises(ValueError, match=r"\.npz: expected an \.npz file with mean"):
            PCA.load(tmp_path / f"{name}.npz")


def test_settings_are_checked() -> None:
    for settings, message in (
        ({"components": 2.5}, "components must be a whole number or a share"),
        ({"clusters": 0}, "clusters must be at least 1, got 0"),
        ({"quantile": 0.0}, "quantile must lie in 0 to 1"),
    ):
        with pytest.raises(ValueError, match=message):
            PCA(**settings)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="angles must hold at least 7 frames, got 3"):
        PCA().fit(np.zeros((3, 63)))


def test_what_results_hang_on_changes_with_the_source_of_a_plugin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    package = tmp_path / "growing"
    package.mkdir()
    (package / "__init__.py").write_text("from growing.part import Search\n")
    said = []
    for text in ("class Search:\n    step = 1\n", "class Search:\n    step = 2\n", "class Search:\n    step = 1\n"):
        (package / "part.py").write_text(text)
        for name in ("growing.part", "growing"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        source_digest.cache_clear()
        search = importlib.import_module("growing").Search
        said.append(Offer("optimiser", "growing", partial(search), "posefit-growing", "1.0").origin)
    assert said[0] == said[2] != said[1]
    assert said[0].startswith("posefit-growing 1.0 ")


def test_a_plugin_without_a_file_has_its_version_alone() -> None:
    assert Offer("optimiser", "plain", dict, "posefit-plain", "1.0").origin == "posefit-plain 1.0"
