"""Does an optimiser do the same again, and leave everything else alone?"""

import copy
import multiprocessing
import pickle
import subprocess
import sys
import threading
from functools import partial
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.testing.case import OptimiserCase, checklist, same
from posefit.testing.randomness import left_alone, seeded
from posefit.testing.results import BrokenError, SkippedError, expect
from posefit.testing.toy import Toy, ball, sphere

SPACE = Toy(5, ball)


@checklist
def same_seed(case: OptimiserCase) -> None:
    """The same seed gives the same proposals."""
    expect(same(case.trace(SPACE, sphere), case.trace(SPACE, sphere)), "one seed must give one trace, got two")


@checklist
def other_seed(case: OptimiserCase) -> None:
    """Another seed gives other proposals."""
    other = case.trace(SPACE, sphere, seed=1)
    expect(not same(case.trace(SPACE, sphere), other), "two seeds must give two traces, got the same")


@checklist
def new_process(case: OptimiserCase) -> None:
    """The same seed gives the same proposals in a new process."""
    try:
        payload = pickle.dumps((sys.path, pickle.dumps(case)))
    except Exception as error:
        raise SkippedError(f"the factory cannot be sent to another process: {error}") from None
    ran = subprocess.run([sys.executable, "-m", "posefit.testing.fresh"], input=payload, capture_output=True)
    if ran.returncode == 3:
        raise SkippedError("the factory cannot be imported in another process")
    expect(not ran.returncode, f"it must work in a new process, got {ran.stderr.decode()[-300:]}")
    expect(ran.stdout, "it must work in a new process, got one that ended in the middle")
    expect(
        same(case.trace(SPACE, sphere), pickle.loads(ran.stdout)),
        "one seed must give one trace in every process, got two",
    )


@checklist
def global_randomness(case: OptimiserCase) -> None:
    """The global random generators are neither used nor changed."""
    traces = []
    for seed in (1, 2):
        with seeded(seed), left_alone():
            traces.append(case.trace(SPACE, sphere))
    expect(same(*traces), "global seeds must not matter, got two traces")


@checklist
def inputs(case: OptimiserCase) -> None:
    """What tell gets stays as it was."""
    optimiser = case.build(SPACE)
    for _ in range(4):
        proposals = optimiser.ask()
        if not len(proposals):
            break
        costs = sphere(proposals)
        before = proposals.copy(), costs.copy()
        optimiser.tell(proposals, costs)
        for name, value, was in zip(("proposals", "costs"), (proposals, costs), before, strict=True):
            expect(np.array_equal(value, was), f"tell must not modify its {name}, got others afterwards")


@checklist
def deep_copy(case: OptimiserCase) -> None:
    """A deep copy goes on as the original does, each on its own."""
    _continues(case, "a deep copy", copy.deepcopy)


@checklist
def pickled(case: OptimiserCase) -> None:
    """What comes out of a pickle goes on as the original does."""
    _continues(case, "a pickle", lambda optimiser: pickle.loads(pickle.dumps(optimiser)))


def _continues(case: OptimiserCase, what: str, copied: Any) -> None:
    for told in (0, 2):
        optimiser = case.build(SPACE)
        for _ in case.steps(optimiser, SPACE, sphere, told):
            pass
        try:
            twin = copied(optimiser)
        except Exception as error:
            raise BrokenError(f"{what} of it must be possible, got {type(error).__name__}: {error}") from None
        first = _rest(case, optimiser)
        expect(same(first, _rest(case, twin)), f"{what} must go on as the original, got another trace after {told}")


def _rest(case: OptimiserCase, optimiser: Any) -> list[Array]:
    return [proposals for proposals, _ in case.steps(optimiser, SPACE, sphere, 3)]


@checklist
def nothing_left(case: OptimiserCase) -> None:
    """No thread and no process outlives a search."""
    threads, children = set(threading.enumerate()), set(multiprocessing.active_children())
    for _ in range(3):
        case.trace(SPACE, sphere, count=3)
        case.build(SPACE)
    left = [one.name for one in set(threading.enumerate()) - threads]
    expect(not left, f"no thread must be left, got {', '.join(left)}")
    left = [one.name for one in set(multiprocessing.active_children()) - children]
    expect(not left, f"no process must be left, got {', '.join(left)}")


trace_again = partial(OptimiserCase.trace, space=SPACE, evaluate=sphere)
