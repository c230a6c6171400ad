"""How likely a frame is lost follows from what its pose costs."""

import numpy as np
import pytest

import posefit
from posefit.tracking.modes import EVEN_COST, LOST_STEEPNESS, lost_probability
from tests.cases import each


def test_a_frame_is_as_likely_lost_as_not_at_one_cost_and_likelier_the_more_it_costs() -> None:
    assert lost_probability(np.array(EVEN_COST)) == pytest.approx(0.5)
    each = lost_probability(np.linspace(0.0, 100.0, 200))
    assert ((each >= 0.0) & (each <= 1.0)).all()
    assert (np.diff(each) >= 0.0).all()
    # by hand: log-odds of twice the even cost are the steepness times ln 2
    odds = lost_probability(np.array(2.0 * EVEN_COST)) / (1.0 - lost_probability(np.array(2.0 * EVEN_COST)))
    assert np.log(odds) == pytest.approx(LOST_STEEPNESS * np.log(2.0))


@each("optimiser", ["sapso", "annealed"])
def test_frames_say_it_where_modes_are_asked_for(optimiser: str) -> None:
    given = {"method": optimiser, "frames": (0, 2), "evaluations": 400, "population_size": 40, "size": (160, 120)}
    assert [frame.lost for frame in posefit.track("walk", **given).estimates] == [None, None]
    track = posefit.track("walk", settings={"tracker.modes": 1}, **given)
    assert [frame.lost for frame in track.estimates] == [
        pytest.approx(float(lost_probability(np.array(f.cost)))) for f in track.estimates
    ]
    assert [row["lost"] for row in track.frames] == pytest.approx([frame.lost for frame in track.estimates])
