"""The docstrings of importable names are complete, and their examples run.

A complete docstring says what comes back, what each argument is, which errors are
raised, and shows an example. Protocols and errors are not called, so they have neither
Args nor Attributes.
"""

import ast
import doctest
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass
from functools import cached_property
from typing import Any

import pytest

import posefit
import posefit.plugin
import posefit_envs

# names whose examples need a library that is not installed with the tests
NEEDS = {"to_sb3_vec_env": "stable_baselines3"}
# Names that are neither a class nor a function, so that Python keeps no docstring of
# their own: the version, the names of the joints, types of arrays and of a callback,
# and the marker of hooks, which is an object of pluggy.
VALUES = {"Areas", "Array", "JOINTS", "RegisterCommand", "__version__", "hookimpl"}
# the first word of what a function returns or yields
VERBS = ("Return", "Yield")


def importable() -> dict[str, Any]:
    """Return the values of the public modules by name."""
    names = {}
    for module in (posefit, posefit.plugin, posefit_envs):
        for name in module.__all__:
            names[name] = getattr(module, name)
    return names


DOCUMENTED = {name: value for name, value in importable().items() if name not in VALUES}


def sections(text: str) -> dict[str, str]:
    """Return the sections of a docstring in Google's form by heading."""
    parts = re.split(r"^([A-Z][a-z]+):\n", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def parameters(function: Callable[..., Any]) -> list[str]:
    """Return the names of a function's or a class's public parameters."""
    names = inspect.signature(function).parameters
    return [name for name in names if name != "self" and not name.startswith("_")]


def undescribed(function: Callable[..., Any], described: str) -> list[str]:
    """Return the parameters that have no entry in a section of a docstring."""
    missing = []
    for name in parameters(function):
        if not re.search(rf"^    (\*\*)?{name}: \S", described, re.MULTILINE):
            missing.append(name)
    return missing


def raises(function: Callable[..., Any]) -> bool:
    """Return whether a function itself raises an error."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    return any(isinstance(node, ast.Raise) for node in ast.walk(tree))


def returns(function: Callable[..., Any]) -> bool:
    """Return whether a function is annotated to return something but None."""
    return inspect.signature(function).return_annotation not in (None, "None")


def methods(kind: type) -> Iterator[tuple[str, Any]]:
    """Yield the public methods and properties that a class defines, by name."""
    for name, value in vars(kind).items():
        if name.startswith("_"):
            continue
        if inspect.isfunction(value) or isinstance(value, property | cached_property):
            yield name, value
        if isinstance(value, classmethod | staticmethod):
            yield name, value.__func__


@pytest.mark.parametrize("name", DOCUMENTED)
def test_the_example_of_a_name_runs(name: str) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    flags = doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL
    runner = doctest.DocTestRunner(optionflags=flags)
    value = DOCUMENTED[name]
    text = sections(inspect.getdoc(value) or "")["Example"]
    # as `doctest.testmod` runs it, with the names of its module
    names = dict(vars(sys.modules[value.__module__]))
    example = doctest.DocTestParser().get_doctest(text, names, name, None, 0)
    assert example.examples
    assert not any(doctest.SKIP in step.options for step in example.examples)
    assert runner.run(example).failed == 0


def test_every_importable_name_but_six_is_a_class_or_a_function() -> None:
    others = set()
    for name, value in importable().items():
        if not (inspect.isfunction(value) or inspect.isclass(value)):
            others.add(name)
    assert others == VALUES


def test_a_function_describes_its_arguments_result_and_errors() -> None:
    for name, value in DOCUMENTED.items():
        if not inspect.isfunction(value):
            continue
        parts = sections(inspect.getdoc(value) or "")
        assert undescribed(value, parts.get("Args", "")) == [], name
        assert not returns(value) or {"Returns", "Yields"} & parts.keys(), name
        assert not raises(value) or "Raises" in parts, name


def test_a_class_describes_what_it_is_made_of_and_its_errors() -> None:
    for name, value in DOCUMENTED.items():
        is_protocol = getattr(value, "_is_protocol", False)
        if not inspect.isclass(value) or is_protocol or issubclass(value, Exception):
            continue
        parts = sections(inspect.getdoc(value) or "")
        described = parts.get("Args", "") + parts.get("Attributes", "")
        assert undescribed(value, described) == [], name
        # the `__init__` of a dataclass has no source
        method = "__post_init__" if is_dataclass(value) else "__init__"
        made = vars(value).get(method)
        assert made is None or not raises(made) or "Raises" in parts, name


def test_a_method_says_what_it_returns_and_which_errors_it_raises() -> None:
    for name, kind in DOCUMENTED.items():
        if not inspect.isclass(kind):
            continue
        for method, value in methods(kind):
            text = inspect.getdoc(value) or ""
            assert text, f"{name}.{method}"
            # a property is described as a noun
            if not inspect.isfunction(value):
                continue
            said = text.startswith(VERBS) or "Returns:" in text or "return " in text
            assert said or not returns(value), f"{name}.{method}"
            assert "raise" in text.lower() or not raises(value), f"{name}.{method}"
