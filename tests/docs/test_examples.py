"""The examples in the docstrings of importable names run, and show what they say."""

import doctest
import inspect
import sys
from typing import Any

import pytest

import posefit
import posefit.plugin
import posefit_envs

# names whose examples need a library that is not installed with the tests
NEEDS = {"to_sb3_vec_env": "stable_baselines3"}


def importable() -> dict[str, Any]:
    """Return the functions and classes of the public modules by name."""
    names = {}
    for module in (posefit, posefit.plugin, posefit_envs):
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isfunction(value) or inspect.isclass(value):
                names[name] = value
    return names


WITH_EXAMPLES = {
    name: value
    for name, value in importable().items()
    if ">>> " in (inspect.getdoc(value) or "")
}


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_example_of_a_name_runs(name: str) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    flags = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL
    runner = doctest.DocTestRunner(optionflags=flags)
    value = WITH_EXAMPLES[name]
    text = inspect.getdoc(value) or ""
    # as `doctest.testmod` runs it, with the names of its module
    names = dict(vars(sys.modules[value.__module__]))
    example = doctest.DocTestParser().get_doctest(text, names, name, None, 0)
    assert runner.run(example).failed == 0


def test_every_name_has_an_example_and_every_function_its_sections() -> None:
    names = importable()
    assert names.keys() - WITH_EXAMPLES.keys() == set()
    for name, value in names.items():
        if not inspect.isfunction(value):
            continue
        text = inspect.getdoc(value) or ""
        assert "Args:" in text, name
        gives_none = inspect.signature(value).return_annotation in (None, "None")
        assert gives_none or "Returns:" in text or "Yields:" in text, name
