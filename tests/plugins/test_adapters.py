"""Other people's optimisers: the error where a library is absent, and a whole track with each."""

import subprocess
import sys
import threading
import warnings
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import posefit
from posefit.registry import Registry, load, registry
from posefit.testing.toy import Toy, sphere
from tests.cases import each

LIBRARIES = {
    "pycma": "cma",
    "nevergrad": "nevergrad",
    "pymoo": "pymoo",
    "optuna": "optuna",
    "mediapipe": "mediapipe",
}


def test_an_absent_library_is_named_with_the_extra_to_install() -> None:
    plugins = load([EntryPoint(name, f"posefit_{name}", "posefit") for name in ("bridges", "mediapipe")])
    needs = {offer.name: offer.needs for plugin in plugins for offer in plugin.offers if offer.needs}
    assert needs == {name: (library, f"posefit[{name}]") for name, library in LIBRARIES.items()}
    for plugin in plugins:
        absent = tuple(replace(offer, needs=("no_such_library", f"posefit[{offer.name}]")) for offer in plugin.offers)
        for offer in absent:
            message = rf"{offer.kind} {offer.name} needs the library .* 'posefit\[{offer.name}\]'"
            with pytest.raises(ImportError, match=message):
                Registry((plugin._replace(offers=absent),)).offer(offer.kind, offer.name)


def test_listing_plugins_imports_none_of_their_libraries() -> None:
    script = (
        "import sys; from posefit.registry import registry; registry();"
        f"print([m for m in {[*LIBRARIES.values(), 'scipy.optimize', 'sklearn']} if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "[]"


@each("name", ["scipy", "scipy:dual_annealing", "pycma", "nevergrad", "pymoo:PSO", "optuna"])
def test_an_adapter_follows_a_motion_at_the_same_budget(name: str) -> None:
    threads = set(threading.enumerate())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        summary = posefit.track("walk", method=name, frames=(0, 2), size=(120, 90), evaluations=400).summary
    assert summary["evaluations_per_frame"] == 400
    assert 720 <= summary["evaluations"] <= 800
    assert summary["iou"] > 0.5
    assert set(threading.enumerate()) <= threads


def test_a_library_says_afterwards_what_it_said_before() -> None:
    optuna, config = pytest.importorskip("optuna"), pytest.importorskip("pymoo.config").Config
    before = optuna.logging.get_verbosity(), config.warnings["not_compiled"]
    try:
        optuna.logging.set_verbosity(optuna.logging.DEBUG)
        config.warnings["not_compiled"] = True
        for name in ("optuna", "pymoo"):
            optimiser = registry().optimiser(name)(Toy(3), np.random.default_rng(0))
            proposals = optimiser.ask()
            optimiser.tell(proposals, sphere(proposals))
        assert optuna.logging.get_verbosity() == optuna.logging.DEBUG
        assert config.warnings == {"not_compiled": True}
    finally:
        optuna.logging.set_verbosity(before[0])
        config.warnings["not_compiled"] = before[1]


def test_an_unknown_variant_is_named() -> None:
    for name, message in (
        ("pymoo:NSGA9", "variant must be one of DE, PSO, GA, ES, SRES, ISRES, got 'NSGA9'"),
        ("optuna:Best", "variant must be one of TPESampler"),
        ("nevergrad:Best", "variant must be one of [0-9]+ names such as TwoPointsDE, CMA, PSO, got 'Best'"),
        ("scipy:minimize", "variant must be one of differential_evolution, dual_annealing, got 'minimize'"),
        ("pso:fast", "optimiser must be pso, which has no variants, got 'pso:fast'"),
    ):
        with pytest.raises(ValueError, match=message):
            posefit.track("walk", method=name, frames=(0, 1), size=(60, 45), evaluations=100)
