"""A plugin package's docstring is its manual page, and the example on it runs."""

import doctest
from importlib import import_module
from importlib.util import find_spec

import pytest

PACKAGES = (
    "posefit_background",
    "posefit_evolution",
    "posefit_filters",
    "posefit_vsmm.imm",
    "posefit_mediapipe",
    "posefit_nevergrad",
    "posefit_optuna",
    "posefit_priors",
    "posefit_pycma",
    "posefit_pymoo",
    "posefit_scipy",
    "posefit_swarm",
    "posefit_vsmm",
)
LIBRARIES = {
    "posefit_nevergrad": "nevergrad",
    "posefit_optuna": "optuna",
    "posefit_pycma": "cma",
    "posefit_pymoo": "pymoo",
}


@pytest.mark.parametrize("name", PACKAGES)
def test_the_example_of_a_manual_page_runs(name: str) -> None:
    library = LIBRARIES.get(name)
    if library and not find_spec(library):
        pytest.skip(f"without {library}")
    result = doctest.testmod(import_module(name))
    assert result.attempted >= 3
    assert result.failed == 0
