"""What is written by hand for a processor does what its plain Python does."""

import numpy as np

from posefit.arrays import jit
from posefit.silhouette.spans import BLOCK, STRIP_PIXELS, popcount, set_spans


@jit
def set_spans_compiled(image, place, stride, spans):  # type: ignore[no-untyped-def]
    set_spans(image, place, stride, spans)


@jit
def popcount_compiled(bits):  # type: ignore[no-untyped-def]
    return popcount(bits)


def test_any_eight_spans_equal_plain_pythons() -> None:
    rng = np.random.default_rng(0)
    edges = np.array(
        [
            0,
            1,
            STRIP_PIXELS - 1,
            STRIP_PIXELS,
            STRIP_PIXELS + 1,
            2 * STRIP_PIXELS - 1,
            2 * STRIP_PIXELS,
        ]
    )
    for case in range(300):
        numbers = edges if case % 2 else np.arange(2 * STRIP_PIXELS + 1)
        spans = rng.choice(numbers, 2 * BLOCK).astype(np.int32)
        if case % 5 == 0:
            # of a row that the cone does not cross
            spans[0], spans[BLOCK] = 1 << 30, -(1 << 30)
        before = rng.integers(0, 2**63, (2, BLOCK), dtype=np.uint64)
        plain = before.copy()
        compiled = before.copy()
        set_spans(plain, BLOCK, BLOCK, spans)
        set_spans_compiled(compiled, BLOCK, BLOCK, spans)
        np.testing.assert_array_equal(compiled, plain)


def test_spans_by_hand() -> None:
    image = np.zeros((2, BLOCK // 2), dtype=np.uint64)
    spans = np.zeros(2 * BLOCK, dtype=np.int32)
    spans[0], spans[BLOCK] = 30, 34  # in the first row, two pixels of either strip
    set_spans_compiled(image, 0, BLOCK, spans)
    rows = image.view(np.uint32).reshape(2, BLOCK)
    assert rows[:, 0].tolist() == [0b11 << 30, 0b11]
    assert not rows[:, 1:].any()


def test_bits_are_counted_as_plain_python_counts_them() -> None:
    words = np.random.default_rng(1).integers(0, 2**64, 100, dtype=np.uint64)
    for word in [np.uint64(0), np.uint64(2**64 - 1), *words]:
        assert popcount_compiled(word) == popcount(word) == int(word).bit_count()
