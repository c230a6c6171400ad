"""Calls of compiled functions by their address, so that one compiled loop serves whatever function it is given.

A function that calls another holds a compiled copy of it, which takes as long to compile again; and one that is given
as an argument is part of its caller's type. An address is a number like any other.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import typeof, types
from numba.core.cgutils import unpack_tuple
from numba.extending import intrinsic, overload

_addresses: dict[Any, int] = {}


def address_of(function: Any, arguments: tuple[Any, ...]) -> Any:
    """Return where a function of `jit` is, compiled for such arguments: for `call`, in this process only."""
    if not hasattr(function, "py_func"):  # NUMBA_DISABLE_JIT: it is its own address
        return function
    kinds = ((a.dtype.num, a.ndim, a.flags.num) if isinstance(a, np.ndarray) else type(a) for a in arguments)
    key = function, *kinds  # numba takes a hundred times as long to type an array
    if key not in _addresses:
        signature = tuple(map(typeof, arguments))
        function.compile(signature)
        compiled = function.overloads[signature]
        _addresses[key] = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    return _addresses[key]


def call(address: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """Call the function at an address, which returns nothing, with arguments as `address_of` got them."""
    address(*arguments)


@intrinsic
def _call(typing_context: Any, address: Any, arguments: Any) -> Any:  # noqa: ARG001
    return types.void(types.int64, arguments), _build_call


@overload(call, inline="always")
def _call_compiled(address, arguments):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda address, arguments: _call(address, arguments)  # type: ignore[call-arg]


def _build_call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kinds, convention = signature.args[1].types, context.call_conv
    pointer = convention.get_function_type(types.none, kinds).as_pointer()
    function = builder.inttoptr(arguments[0], pointer)
    values: Any = unpack_tuple(builder, arguments[1])  # type: ignore[no-untyped-call]
    convention.call_function(builder, function, types.none, kinds, values)
    return context.get_dummy_value()
