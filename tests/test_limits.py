"""Limits of time end what runs Python, nest, and let nothing swallow them."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
import pytest

from posefit.limits import allowed_bytes, memory, timed
from tests.cases import each


def works() -> None:
    while True:
        pass


def swallows() -> None:
    while True:
        try:
            time.sleep(10.0)
        except Exception:
            continue


@each("endless", [works, swallows])
def test_a_call_that_takes_too_long_is_ended(endless: Callable[[], None]) -> None:
    with pytest.raises(TimeoutError), timed(0.05):
        endless()


def test_an_inner_limit_leaves_the_outer_one_unchanged() -> None:
    def nested() -> None:
        with timed(20.0):
            pass
        with pytest.raises(TimeoutError), timed(0.05):
            time.sleep(10.0)
        time.sleep(20.0)

    with pytest.raises(TimeoutError), timed(0.3):
        nested()
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_the_outer_limit_holds_where_the_inner_one_is_longer() -> None:
    with pytest.raises(TimeoutError), timed(0.1), timed(20.0):
        time.sleep(20.0)


def test_an_alarm_ends_the_body_or_nothing_whenever_it_comes() -> None:
    def busy(seconds: float) -> None:
        began = time.perf_counter()
        while time.perf_counter() - began < seconds:
            pass

    outcomes = set()
    for k in range(2000):
        # about as long as the body takes, and, for each tenth, as long as entering it
        limit = 1e-4 * (0.5 + k % 100 / 100) if k % 10 else 1e-6 * (1 + k % 70)
        try:
            with timed(limit):
                busy(1e-4)
            outcomes.add("in time")
        except TimeoutError:
            outcomes.add("too long")
    assert outcomes <= {"in time", "too long"}
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_more_memory_than_it_may_have_is_an_error() -> None:
    with pytest.raises(MemoryError), memory(4.0):
        np.ones(10**10)


def test_a_process_may_have_no_more_than_its_limit_and_the_machine_leave() -> None:
    machine = allowed_bytes()
    assert 1e8 < machine <= 1e15
    with memory(0.9 * machine / 1e9):
        assert allowed_bytes() == int(0.9 * machine / 1e9 * 1e9)
    assert allowed_bytes() == machine


def test_threads_share_a_heap_where_the_c_library_can() -> None:
    # in another process, because it holds for the whole process; elsewhere it does
    # nothing
    code = "from posefit.limits import share_heap; share_heap()"
    subprocess.run([sys.executable, "-c", code], check=True)
