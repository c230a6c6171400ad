"""Costs of arrays of other libraries: the bits are NumPy's, and nothing is copied on the CPU."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import posefit
import posefit_envs
from posefit.errors import InputError
from posefit.fitting.exchange import exchanged
from tests.cases import each

DRAWN = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 9))
LIBRARIES = [name for name in ("array_api_strict", "torch", "jax.numpy") if find_spec(name.partition(".")[0])]
KINDS = [(name, kind) for name in LIBRARIES for kind in ("float32", "float64")]
KINDS = [case for case in KINDS if case != ("jax.numpy", "float64")]  # JAX has it only where a process asks for it


def kept(library: Any, values: Any) -> np.ndarray:
    """Return an array of a library as NumPy's, by the library's own words where it has some."""
    return np.asarray(values.numpy() if library.__name__ == "torch" else np.from_dlpack(values))


@each(("name", "kind"), KINDS)
def test_costs_come_back_in_the_callers_library_and_type_with_numpys_bits(name: str, kind: str) -> None:
    library = import_module(name)
    given = library.asarray(DRAWN.astype(kind))
    seen, back = posefit.suite(), posefit.suite()
    for evaluate in (lambda one: one.evaluate, lambda one: one, lambda one: one.made.frames[0].evaluate):
        costs, expected = evaluate(back)(given), evaluate(seen)(DRAWN.astype(kind))
        assert type(costs) is type(given)
        assert costs.dtype == given.dtype
        assert np.array_equal(kept(library, costs), expected.astype(kind))
    assert back(given[0, :]) == seen(DRAWN[0].astype(kind))
    assert np.array_equal(back.trace, seen.trace)


def test_an_array_on_the_cpu_is_not_copied() -> None:
    library = pytest.importorskip("array_api_strict")
    given = library.asarray(DRAWN, copy=True)
    array, back = exchanged("proposals", given)
    assert array.ctypes.data == np.from_dlpack(given).ctypes.data
    results = np.arange(3.0)
    assert np.from_dlpack(back(results)).ctypes.data == results.ctypes.data


def test_a_tensor_of_pytorch_is_not_copied() -> None:
    torch = pytest.importorskip("torch")
    given = torch.from_numpy(DRAWN.copy())
    array, back = exchanged("proposals", given)
    assert array.ctypes.data == given.data_ptr()
    results = np.arange(3.0)
    assert back(results).data_ptr() == results.ctypes.data


def test_an_array_that_is_traced_or_needs_a_gradient_is_refused() -> None:
    problem = posefit.suite()
    torch = pytest.importorskip("torch")
    with pytest.raises(InputError, match="with a gradient, got torch.Tensor: .*require gradient"):
        problem(torch.zeros(2, 9, requires_grad=True))
    with pytest.raises(InputError, match="neither traced by jit or vmap"):
        torch.vmap(problem)(torch.zeros(2, 9))
    jax = pytest.importorskip("jax")
    for traced in (jax.jit(problem), jax.vmap(problem), jax.grad(problem)):
        with pytest.raises(InputError, match="neither traced by jit or vmap"):
            traced(jax.numpy.zeros((2, 9)))
    assert problem.evaluations == 0


@each("name", LIBRARIES)
def test_vector_environments_take_any_array_and_give_it_by_gymnasiums_wrapper(name: str) -> None:
    library = import_module(name)
    wrappers = pytest.importorskip("gymnasium.wrappers.vector")
    pytest.importorskip("array_api_compat")
    gym.register_envs(posefit_envs)

    def first_step(wrap: bool) -> Any:
        env = gym.make_vec("posefit/FitState-v0", num_envs=2)
        wrapped = wrappers.ArrayConversion(env, env_xp=np, target_xp=library) if wrap else env
        wrapped.reset(seed=0)
        shape = env.action_space.shape
        return wrapped.step(library.zeros(shape))

    plain, converted = first_step(False), first_step(True)
    for one, other in zip(plain[:2], converted[:2], strict=True):
        assert type(other) is type(library.zeros(1))
        assert np.allclose(one, np.from_dlpack(other), atol=1e-6)
