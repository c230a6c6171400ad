"""Costs of arrays of other libraries: the bits are NumPy's, and nothing is copied on the CPU."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.fitting.dlpack import as_numpy
from tests.cases import each

DRAWN = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 9))
LIBRARIES = [
    name
    for name in ("array_api_strict", "torch", "jax.numpy")
    if find_spec(name.partition(".")[0])
]
KINDS = [(name, kind) for name in LIBRARIES for kind in ("float32", "float64")]
# JAX has it only where a process asks for it
KINDS = [case for case in KINDS if case != ("jax.numpy", "float64")]


def in_numpy(library: Any, values: Any) -> np.ndarray:
    """Return an array of a library as NumPy's, by the library's own method where it has one."""
    return np.asarray(
        values.numpy() if library.__name__ == "torch" else np.from_dlpack(values)
    )


@each(("name", "kind"), KINDS)
def test_costs_come_back_in_the_callers_library_and_type_with_numpys_bits(
    name: str, kind: str
) -> None:
    library = import_module(name)
    array = library.asarray(DRAWN.astype(kind))
    problem = posefit.suite()
    numpys = posefit.suite()
    for evaluate in (
        lambda suite: suite,
        lambda suite: posefit.Problem(suite.made.frames[0], suite.space),
    ):
        costs = evaluate(problem)(array)
        expected = evaluate(numpys)(DRAWN.astype(kind))
        assert type(costs) is type(array)
        assert costs.dtype == array.dtype
        assert np.array_equal(in_numpy(library, costs), expected.astype(kind))
    assert problem(array[0, :]) == numpys(DRAWN[0].astype(kind))
    assert np.array_equal(problem.trace, numpys.trace)


@each("name", ["array_api_strict", "torch"])
def test_an_array_on_the_cpu_is_not_copied(name: str) -> None:
    array = pytest.importorskip(name).asarray(DRAWN.copy())
    values, back = as_numpy("proposals", array)
    assert values.ctypes.data == np.from_dlpack(array).ctypes.data
    results = np.arange(3.0)
    assert np.from_dlpack(back(results)).ctypes.data == results.ctypes.data


def test_an_array_that_is_traced_or_needs_a_gradient_is_refused() -> None:
    problem = posefit.suite()
    torch = pytest.importorskip("torch")
    with pytest.raises(
        InputError, match="with a gradient, got torch.Tensor: .*require gradient"
    ):
        problem(torch.zeros(2, 9, requires_grad=True))
    with pytest.raises(InputError, match="neither traced by jit or vmap"):
        torch.vmap(problem)(torch.zeros(2, 9))
    jax = pytest.importorskip("jax")
    for traced in (jax.jit(problem), jax.vmap(problem), jax.grad(problem)):
        with pytest.raises(InputError, match="neither traced by jit or vmap"):
            traced(jax.numpy.zeros((2, 9)))
    assert problem.evaluations == 0
