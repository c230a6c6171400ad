"""What can be said of a GPU's machine code where there is no GPU: NVIDIA's compiler takes the loops, and rounds as asked."""

import re
from types import SimpleNamespace

import pytest

numba_cuda = pytest.importorskip("numba_cuda", reason="numba-cuda compiles for a GPU")


def compiled(function: object, signature: tuple[object, ...], monkeypatch: pytest.MonkeyPatch) -> str:
    """Return a function as PTX for an H100 or H200, whose compute capability is 9.0."""
    from numba import cuda
    from numba.core import config

    if config.ENABLE_CUDASIM or cuda.is_available():
        pytest.skip("the loops themselves run here")
    monkeypatch.setattr("numba.cuda.dispatcher.get_current_device", lambda: SimpleNamespace(compute_capability=(9, 0)))
    try:
        return cuda.compile_ptx(function.py_func, signature, cc=(9, 0))[0]
    except (RuntimeError, OSError) as error:
        pytest.skip(f"no compiler for a GPU: {error}")


@pytest.mark.slow
def test_the_loops_compile_and_fuse_four_products_in_single_precision_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from numba import types as t

    from posefit.silhouette.cuda.launch import count_on_device

    whole, number = t.int64[::1], t.float64[:, ::1]
    body = (whole, whole, t.boolean[::1], t.float64[:, :, ::1], number, number)
    seen = (t.uint32[:, :, ::1], t.uint32[:, :, ::1], whole)
    signature = (*body, t.float64[::1], t.int64, t.int64, *seen, number, number, t.int32[:, :, ::1])
    code = compiled(count_on_device, signature, monkeypatch)
    # two tangents and two discs, as on a CPU with FMA; no other product of a row that could be rounded otherwise
    assert len(re.findall(r"\bfma\.rn\.f32", code)) == 4
    assert not re.search(r"\bmul(\.rn)?\.f32", code)
    assert not re.search(r"\bsqrt\.approx", code)
    assert not re.search(r"\bdiv\.(approx|full)", code)
    assert "popc.b32" in code
    assert "popc.b64" not in code
    assert not re.search(r"^\s*\.local", code, re.MULTILINE)  # a thread's words are in registers
