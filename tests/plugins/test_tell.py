"""Every optimiser refuses costs that are not those of what it proposed, and then goes on."""

import numpy as np
import pytest

from posefit.errors import InputError
from posefit.registry import registry
from posefit.testing.toy import Toy, sphere
from tests.cases import each

NAMES = [
    name for name, offer in registry().offers["optimiser"].items() if not offer.missing
]


@each("name", NAMES)
def test_unrequested_costs_are_refused(name: str) -> None:
    space = Toy(5)
    optimiser = registry().optimiser(name)(space, np.random.default_rng(0))
    with pytest.raises(
        InputError, match="tell must follow ask, got costs before proposals"
    ):
        optimiser.tell(np.zeros((40, 5)), np.zeros(40))
    proposals = optimiser.ask()
    n = len(proposals)
    for told, costs, message in (
        (proposals, np.zeros(n - 1), f"{n} costs, got {n - 1}"),
        (proposals, np.zeros(n + 1), f"{n} costs, got {n + 1}"),
        (proposals, np.float64(3.0), f"{n} costs, got one number"),
        (proposals, np.zeros((n, 1)), rf"{n} costs, got an array of shape \({n}, 1\)"),
        (proposals[1:], np.zeros(n), f"{n} proposals, got {n - 1}"),
    ):
        with pytest.raises(InputError, match=f"tell must get {message}$"):
            optimiser.tell(told, costs)
    optimiser.tell(proposals, sphere(proposals))
    with pytest.raises(InputError, match="tell must follow ask"):
        optimiser.tell(proposals, sphere(proposals))
    assert np.isfinite(optimiser.ask()).all()
