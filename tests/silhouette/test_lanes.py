"""What runs in vector registers, as plain Python and as compiled: eight rows at a time against sets of pixels."""

import numpy as np

from posefit.arrays import jit
from posefit.silhouette.lanes import BLOCK, LISTED, list_steps, root, set_spans


@jit
def compiled_spans(pixels, place, stride, spans):  # type: ignore[no-untyped-def]
    set_spans(pixels, place, stride, spans)


@jit
def compiled_steps(blocks, at, first, step):  # type: ignore[no-untyped-def]
    list_steps(blocks, at, first, step)


@jit
def compiled_root(x):  # type: ignore[no-untyped-def]
    return root(x)


def test_spans_set_the_bits_from_the_first_to_the_one_before_the_stop() -> None:
    for setting in [set_spans, compiled_spans]:
        spans = np.array([0, 0, 5, 31, 32, 40, 64, 1_000_000_000, 64, 32, 9, 33, 64, 12, 64, 64], np.int32)
        before = np.arange(40, dtype=np.uint32)
        pixels = before.copy()
        setting(pixels, 3, 20, spans)
        for k in range(BLOCK):
            bits = set(range(spans[k], spans[BLOCK + k])) if spans[k] < 64 else set()
            near, far = sum(1 << x for x in bits if x < 32), sum(1 << x - 32 for x in bits if x >= 32)
            assert pixels[3 + k] == before[3 + k] | near
            assert pixels[23 + k] == before[23 + k] | far
        others = np.setdiff1d(np.arange(40), [*range(3, 11), *range(23, 31)])
        np.testing.assert_array_equal(pixels[others], before[others])


def test_a_span_that_ends_before_it_begins_is_empty() -> None:
    for setting in [set_spans, compiled_spans]:
        for stop in [-1_000_000_000, -1, 0]:
            pixels = np.zeros(16, np.uint32)
            setting(pixels, 0, 8, np.array([0, 1, 31, 32, 33, 63, 64, 65] + [stop] * BLOCK, np.int32))
            assert not pixels.any()


def test_the_root_of_a_negative_number_is_nan() -> None:
    for square_root in [root, compiled_root]:
        assert square_root(np.float32(6.25)) == 2.5
        assert square_root(np.float32(0.0)) == 0.0
        assert np.isnan(square_root(np.float32(-1e-9)))
        assert np.isnan(square_root(np.float32(np.nan)))


def test_steps_are_listed_from_a_place_on_and_nowhere_else() -> None:
    for step in [0, 3, (8 << 32) + 256, -(1 << 40)]:
        for listing in [list_steps, compiled_steps]:
            blocks = np.full(LISTED + 9, 7)
            listing(blocks, 5, (1 << 45) + 1, step)
            assert blocks.tolist() == [7] * 5 + range_of(step) + [7] * 4


def range_of(step: int) -> list[int]:
    """Return so many numbers as are listed, each the one before it and a step."""
    numbers = [(1 << 45) + 1]
    while len(numbers) < LISTED:
        numbers.append(numbers[-1] + step)
    return numbers
