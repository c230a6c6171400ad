"""A method is chosen by names: equal budgets, settings, and what happens where a plugin breaks a rule."""

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.fitting.validation import BrokenRuleError
from posefit.footage.scene import synthetic
from posefit.motion import built_in
from posefit.registry import Offer, Plugin, Registry, registry
from posefit.tracking import initialise, method
from posefit.tracking.options import TrackOptions
from tests.cases import each
from tests.testing import planted

QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 200}


@each("name", ["sapso", "pso", "particle", "annealed", "cma", "random"])
def test_every_method_gets_the_same_budget_and_reports_its_evaluations(name: str) -> None:
    for budget in (200, 437):
        summary = posefit.track("walk", method=name, **{**QUICK, "evaluations": budget}).summary
        assert summary["evaluations_per_frame"] == budget
        used = summary["evaluations"] / summary["frames"]
        assert 0.85 * budget < used <= budget


def test_a_budget_is_the_population_times_iterations_and_one() -> None:
    assert TrackOptions().budget == 2440
    assert TrackOptions(population_size=10, iterations=4).budget == 50
    assert TrackOptions(population_size=10, evaluations=300).budget == 300


@pytest.fixture
def installed(monkeypatch: Any) -> Any:
    """Let plugins of the tests pass for installed ones."""

    def install(kind: Any, factory: Any, name: str = "bad", **more: Any) -> None:
        mine = Offer(kind, name, factory, "posefit-bad", "1.0", **more)
        rest = tuple(offer for plugin in registry().plugins for offer in plugin.offers)
        replaced = Registry((Plugin("bad", "posefit-bad", "1.0", "loaded", offers=(mine, *rest)),))
        monkeypatch.setattr(method, "registry", lambda: replaced)

    return install


@each(
    ("name", "later"),
    [("particle", []), ("sapso", ["start", "start"]), ("random", ["anywhere", "anywhere"])],
)
def test_a_filter_carries_its_particles_and_the_others_are_built_again(
    name: str, later: list[str], installed: Any
) -> None:
    built: list[str] = []
    offer = registry().offer("optimiser", name)

    @functools.wraps(offer.factory)
    def make(space: Any, rng: Any, **settings: Any) -> Any:
        built.append("anywhere" if space.start is None else "start")
        return offer.factory(space, rng, **settings)

    installed("optimiser", make, next_frame=offer.next_frame)
    posefit.track("walk", method="bad", **QUICK)
    assert built == ["anywhere", "anywhere", *later]  # of the track to warm up, and of the track itself


class NeverReturns(planted.Sound):
    def tell(self, proposals: Any, costs: Any) -> None:
        super().tell(proposals, costs)
        while True:
            self.width = 0.5


@pytest.mark.parametrize(
    ("factory", "rule"),
    [
        (planted.AsksOneRow, r"ask must return an array of shape \(n, 9\), got shape \(9,\)"),
        (planted.LeavesTheBox, r"ask must return proposals in \[-1, 1\], got -?[0-9.]+"),
        (planted.ExitsInTell, "tell must not end the program, got SystemExit: .*"),
        (NeverReturns, "tell must return within 0.3 s, and did not"),
        (planted.WrongSignature, "it must not fail, got TypeError: .*"),
    ],
)
def test_a_broken_optimiser_ends_its_run_with_one_line_and_the_next_run_works(
    factory: Any, rule: str, installed: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(initialise, "COMPILE_SECONDS", 0.0)
    installed("optimiser", factory)
    settings = {**QUICK, "ask_seconds": 0.3} if factory is NeverReturns else QUICK
    with pytest.raises(BrokenRuleError, match=f"^optimiser 'bad' of posefit-bad 1.0: {rule}$"):
        posefit.track("walk", method="bad", **settings)
    assert posefit.track("walk", **QUICK).summary["frames"] == 3


@each(
    ("change", "rule"),
    [
        ({"low": np.zeros((2, 3))}, r"low and high must be finite and of shape \(m,\), got \(2, 3\), \(6,\)"),
        (
            {"inverse_transform": lambda latents: np.zeros((len(latents), 60))},
            r"inverse_transform must return shape \(3, 63\), got \(3, 60\)",
        ),
        (
            {"inverse_transform": lambda latents: np.full((len(latents), 63), np.nan)},
            "inverse_transform must return finite numbers",
        ),
        ({"feasible": lambda latents: True}, r"feasible must return shape \(3,\), got \(\)"),
        ({"transform": lambda angles: 1 / 0}, "it must not fail, got ZeroDivisionError"),
        ({"low": np.full(6, 9.0)}, "low must not be above high, got 9 and [0-9.]+ of latent 0"),
        (
            {"feasible": lambda latents: np.zeros(len(latents), dtype=bool)},
            "feasible must allow some poses, got none of [0-9]+ training poses and 1000 of the range",
        ),
    ],
)
def test_a_broken_prior_is_named(change: dict[str, Any], rule: str, installed: Any) -> None:
    class Bad(planted.PCA):
        def fit(self, angles: Any, skeleton: Any = None) -> Any:
            super().fit(angles)
            vars(self).update(change)
            return self

    installed("prior", Bad)
    with pytest.raises(BrokenRuleError, match=f"prior 'bad' of posefit-bad 1.0: {rule}"):
        posefit.track("walk", method="@bad", **QUICK)


@each("method", ["inverse_transform", "feasible"])
@each(
    ("error", "rule"),
    [(SystemExit(0), "end the program, got SystemExit: 0"), (KeyError("lost"), "fail, got KeyError: 'lost'")],
)
def test_a_prior_that_fails_in_a_search_is_named_and_not_the_optimiser_that_meets_it(
    method: str, error: BaseException, rule: str, installed: Any
) -> None:
    class Tires(planted.PCA):
        left = 5

    def tires(self: Any, latents: Any) -> Any:
        self.left -= 1
        if self.left < 0:
            raise error
        return getattr(super(Tires, self), method)(latents)

    setattr(Tires, method, tires)
    installed("prior", Tires)
    with pytest.raises(BrokenRuleError, match=f"^prior 'bad' of posefit-bad 1.0: {method} must not {rule}$"):
        posefit.track("walk", method="@bad", **QUICK)


def test_a_tracker_is_reached_by_name(installed: Any) -> None:
    installed("tracker", planted.Holds)
    summary = posefit.track("walk", method="bad", **QUICK).summary
    assert summary["method"] == "bad"
    assert summary["prior_floor_degrees"] is None
    assert summary["skill"]["mean_pose"] is not None
    installed("optimiser", planted.Sound)


@each("prior", ["full", "union", "sklearn", "sklearn:FactorAnalysis"])
def test_every_prior_can_be_searched(prior: str) -> None:
    summary = posefit.track("walk", method=f"@{prior}", **QUICK).summary
    assert summary["method"] == f"annealed@{prior}"
    assert summary["iou"] > 0.4


def test_a_scene_is_tracked_as_it_is() -> None:
    motion = built_in.motion("walk", frames=3)
    scene = synthetic(motion, [45.0], (120, 90), [], (None, None))
    how = {"method": "sapso", "train": built_in.other_styles("walk"), "evaluations": 200}
    result, by_name = posefit.track(scene, **how), posefit.track(motion, **how, size=(120, 90))
    np.testing.assert_array_equal(result.motion.poses, by_name.motion.poses)
    assert [frame.cost for frame in result.estimates] == [row["cost"] for row in result.frames]
    with pytest.raises(ValueError, match="a scene must be tracked as it is, got fps"):
        posefit.track(scene, fps=20.0)
    with pytest.raises(ValueError, match="a scene must be of a known motion, got walk, whose truth is unknown"):
        posefit.track(replace(scene, truth=None))
