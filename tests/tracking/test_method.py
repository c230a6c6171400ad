"""A method is chosen by names, or by the source: equal budgets, settings, and what happens where a plugin breaks a rule."""

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import posefit
from posefit import Problem, minimise
from posefit.fitting.validation import BrokenRuleError
from posefit.footage.extraction import Extraction
from posefit.footage.options import SourceOptions
from posefit.footage.scene import synthetic
from posefit.footage.source import scene_of
from posefit.motion import built_in, recorded
from posefit.progress import Progress
from posefit.registry import Offer, Plugin, Registry, registry
from posefit.silhouette import sharing
from posefit.testing.toy import Toy, sphere
from posefit.tracking import defaults, front, method
from posefit.tracking.defaults import completed
from posefit.tracking.options import TrackOptions
from posefit_envs import world
from posefit_swarm.sapso import SAPSO
from tests.cases import each
from tests.testing import planted
from tests.tracking.scenes import masks_of

WALKS = ("walk-a", "walk-b", "walk-c")
QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 200}


@each("name", ["sapso", "pso", "particle", "annealed", "cma", "random"])
def test_every_method_gets_the_same_budget_and_reports_its_evaluations(
    name: str,
) -> None:
    for budget in (200, 437):
        summary = posefit.track(
            "walk", method=name, **{**QUICK, "evaluations": budget}
        ).summary
        assert summary["evaluations_per_frame"] == budget
        used = summary["evaluations"] / summary["frames"]
        assert 0.85 * budget < used <= budget


@pytest.fixture
def installed(monkeypatch: Any) -> Any:
    """Let plugins of the tests pass for installed ones."""

    def install(kind: Any, factory: Any, name: str = "bad", **more: Any) -> None:
        mine = Offer(kind, name, factory, "posefit-bad", "1.0", **more)
        rest = tuple(offer for plugin in registry().plugins for offer in plugin.offers)
        replaced = Registry(
            (Plugin("bad", "posefit-bad", "1.0", "loaded", offers=(mine, *rest)),)
        )
        monkeypatch.setattr(method, "registry", lambda: replaced)

    return install


@each(
    ("name", "later"),
    [
        ("particle", []),
        ("sapso", ["start", "start"]),
        ("random", ["anywhere", "anywhere"]),
    ],
)
def test_a_filter_carries_its_particles_and_others_are_built_again(
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
    assert built == ["anywhere", *later]


def test_a_broken_optimiser_ends_its_run_with_one_line_and_the_next_run_works(
    installed: Any,
) -> None:
    installed("optimiser", planted.WrongSignature)
    rule = "construction must not fail, got TypeError: .*"
    with pytest.raises(
        BrokenRuleError, match=f"^optimiser 'bad' of posefit-bad 1.0: {rule}$"
    ):
        posefit.track("walk", method="bad", **QUICK)
    assert posefit.track("walk", **QUICK).summary["frames"] == 3


@each(
    ("change", "rule"),
    [
        (
            {"low": np.zeros((2, 3))},
            r"low and high must be finite and of shape \(m,\), got \(2, 3\), \(6,\)",
        ),
        (
            {"inverse_transform": lambda z: np.zeros((len(z), 60))},
            r"inverse_transform must return shape \(3, 63\), got \(3, 60\)",
        ),
        (
            {"inverse_transform": lambda z: np.full((len(z), 63), np.nan)},
            "inverse_transform must return finite numbers",
        ),
        ({"feasible": lambda z: True}, r"feasible must return shape \(3,\), got \(\)"),
        (
            {"transform": lambda angles: 1 / 0},
            "transform must not fail, got ZeroDivisionError",
        ),
        (
            {"transform": lambda angles: angles @ np.zeros((60, 6))},
            r"transform must not fail, got ValueError: matmul: .* \(test_method.py:[0-9]+\)",
        ),
        (
            {"inverse_transform": lambda z: np.full((len(z), 63), 0.01)},
            "inverse_transform must turn joints about their free axes only, got 0.01 rad about the [xyz] axis of [a-z]+",
        ),
        (
            {"low": np.full(6, 9.0)},
            "low must not be above high, got 9 and [0-9.]+ of latent 0",
        ),
        (
            {"feasible": lambda z: np.zeros(len(z), dtype=bool)},
            "feasible must allow some poses, got none of [0-9]+ training poses and 1000 of the range",
        ),
    ],
)
def test_a_broken_prior_is_named(
    change: dict[str, Any], rule: str, installed: Any
) -> None:
    class Bad(planted.PCA):
        def fit(self, angles: Any, skeleton: Any = None) -> Any:
            super().fit(angles)
            vars(self).update(change)
            return self

    installed("prior", Bad)
    with pytest.raises(
        BrokenRuleError, match=f"prior 'bad' of posefit-bad 1.0: {rule}"
    ):
        posefit.track("walk", method="@bad", **QUICK)


def test_a_prior_that_moves_fixed_axes_is_refused_wherever_it_is_used(
    installed: Any, monkeypatch: Any, tmp_path: Path
) -> None:
    rule = (
        r"inverse_transform must turn joints about their free axes only, got 0.01 rad"
    )
    installed("prior", planted.MovesFixedAxes)
    monkeypatch.setattr(world, "registry", method.registry)
    monkeypatch.setattr(front, "registry", method.registry)
    motion = built_in.motion("walk", frames=1)
    scene = synthetic(motion, [45.0], (120, 90), [], (None, None))
    out = tmp_path / "out"
    learned = planted.MovesFixedAxes().fit(built_in.motion("walk-a").poses[:, 3:])
    for refused in (
        lambda: posefit.track("walk", method="@bad", out=out, **QUICK),
        lambda: posefit.track("walk", method=(SAPSO, learned), **QUICK),
        lambda: posefit.fit(masks_of(scene)[0], method="@bad", height=1.75),
        lambda: gymnasium.make("posefit/FitImage-v1", prior="bad").reset(seed=0),
    ):
        with pytest.raises((BrokenRuleError, gymnasium.error.Error), match=rule):
            refused()
    assert not list(tmp_path.iterdir())


@each("method", ["inverse_transform", "feasible"])
@each(
    ("error", "rule"),
    [
        (SystemExit(0), "end the program, got SystemExit: 0"),
        (KeyError("lost"), r"fail, got KeyError: 'lost' \(test_method.py:[0-9]+\)"),
    ],
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
    with pytest.raises(
        BrokenRuleError,
        match=f"^prior 'bad' of posefit-bad 1.0: {method} must not {rule}$",
    ):
        posefit.track("walk", method="@bad", **QUICK)


@each("prior", ["full", "sklearn", "sklearn:FactorAnalysis"])
def test_every_prior_can_be_searched(prior: str) -> None:
    summary = posefit.track("walk", method=f"@{prior}", **QUICK).summary
    assert summary["method"] == f"annealed@{prior}"
    assert summary["iou"] > 0.4


def test_a_scene_is_tracked_as_it_is() -> None:
    motion = built_in.motion("walk", frames=3)
    scene = synthetic(motion, [45.0], (120, 90), [], (None, None))
    how = {
        "method": "sapso",
        "train": built_in.other_styles("walk"),
        "evaluations": 200,
    }
    result = posefit.track(scene, **how)
    by_name = posefit.track(motion, **how, size=(120, 90))
    np.testing.assert_array_equal(result.motion.poses, by_name.motion.poses)
    assert [frame.cost for frame in result.frames] == result.table["cost"].tolist()
    with pytest.raises(ValueError, match="must be left out for a scene, got fps"):
        posefit.track(scene, fps=20.0)
    with pytest.raises(
        ValueError,
        match="a scene must be of a known motion, got walk, whose truth is unknown",
    ):
        posefit.track(replace(scene, truth=None))


def test_the_method_and_the_training_motions_depend_on_the_source() -> None:
    for source, given, expected, train in (
        ("walk", {}, "annealed@pca", WALKS),
        ("run-a", {}, "annealed@pca", ("run-b",)),
        ("16_15", {}, "exemplars", ["library"]),
        ("16_15.amc", {"method": "exemplars"}, "exemplars", ["library"]),
        ("16_15", {"method": "sapso"}, "sapso@pca", WALKS),
        ("a.mp4", {}, "exemplars", ["library"]),
        ("a.npz", {}, "exemplars", ["library"]),
        ("masks/", {"method": "exemplars"}, "exemplars", ["library"]),
        ("a.npz", {"train": ["library:-16"]}, "exemplars", ["library:-16"]),
        ("a.npz", {"method": "annealed"}, "annealed@loose", WALKS),
        ("a.npz", {"method": "@pca"}, "annealed@pca", WALKS),
        ("a.npz", {"settings": {"sapso.cooling": 0.9}}, "sapso@loose", WALKS),
        ("a.npz", {"settings": {"tracker.floor": 0.1}}, "annealed@loose", WALKS),
        ("a.npz", {"settings": {"exemplars.lag": 0}}, "exemplars", ["library"]),
        ("a.npz", {"method": "vsmm"}, "vsmm", WALKS),
    ):
        motion = None if source.startswith(("a.", "masks/")) else source
        options = completed(TrackOptions(**given), motion)
        assert (options.method, options.train) == (expected, train), (source, given)
        again = completed(TrackOptions(**{**given, "method": options.method}), motion)
        assert (again.method, again.train) == (expected, train), (source, given)


def test_a_track_uses_the_cores_of_the_processor_but_at_most_four(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    for cores, threads in ((1, 1), (3, 3), (64, 4)):
        monkeypatch.setattr(sharing, "cores", lambda cores=cores: cores)
        assert completed(TrackOptions(), None).threads == threads
        assert completed(TrackOptions(threads=6), None).threads == 6
    # as in a worker of a sweep
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert completed(TrackOptions(), None).threads == 1


@each(
    (
        "motion",
        "options",
        "evaluations",
        "restarts",
        "body_frames",
        "translation",
        "smooth",
    ),
    [
        ("walk", {}, 2440, 0, 0, "known", False),
        ("16_15", {}, 9760, 0, 0, "known", False),
        # its tracker looks ahead, and searches the first pose by itself
        (None, {}, 9760, 0, 12, "aligned", True),
        (None, {"method": "vsmm"}, 2440, 8, 12, "aligned", True),
        # the build is known
        (
            None,
            {"method": ("sapso", "pca"), "asf": "a.asf"},
            2440,
            8,
            0,
            "aligned",
            True,
        ),
        (
            None,
            {"evaluations": 99, "restarts": 0, "body_frames": 0, "smooth": False},
            99,
            0,
            0,
            "aligned",
            False,
        ),
        (
            "walk",
            {"translation": "searched", "restarts": 2, "smooth": True},
            2440,
            2,
            0,
            "searched",
            True,
        ),
    ],
)
def test_every_default_is_completed(
    motion: Any, options: dict[str, Any], **expected: Any
) -> None:
    done = completed(TrackOptions(**options), motion)
    assert {name: getattr(done, name) for name in expected} == expected
    assert completed(done, motion) == done


def test_footage_is_searched_where_the_tracker_is_not_installed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    without = replace(
        registry(),
        plugins=tuple(
            plugin for plugin in registry().plugins if plugin.name != "exemplars"
        ),
    )
    monkeypatch.setattr(method, "registry", lambda: without)
    monkeypatch.setattr(defaults, "registry", lambda: without)
    options = completed(TrackOptions(), None)
    assert (options.method, options.train) == ("annealed@loose", WALKS)


MISUSES: list[tuple[dict[str, Any], str]] = [
    (
        {"evaluations": 1e3},
        "evaluations must be a whole number of at least 1, got 1000.0",
    ),
    (
        {"frames": 5},
        r"frames must be \(start, stop\), either of which may be None, got 5",
    ),
    ({"frames": (5, 2)}, "frames must contain one of the 60 frames, got 5:2"),
    (
        {"size": (320.5, 240)},
        "size must be from 1x1 to 16384x16384 pixels, got 320.5x240",
    ),
    ({"seed": None}, "seed must be a whole number of at least 0, got None"),
    ({"threads": True}, "threads must be a whole number of at least 1, got True"),
    ({"fps": 10**400}, "fps must be a finite number, got 1000"),
    ({"view_degrees": "front"}, "view_degrees must be a finite number, got 'front'"),
    ({"train": "walk-a"}, "train must be a list of motions, got 'walk-a'"),
    ({"view_degrees": 361}, "view_degrees must lie in -360 to 360 degrees, got 361"),
    (
        {"force": True},
        "force needs out, the folder of the track, got none",
    ),
    (
        {"settings": ("sapso.cooling=0.9", "sapso.cooling=0.8")},
        "must be given once, got 'sapso.cooling' twice",
    ),
    (
        {"asf": "a.asf"},
        "asf applies only to .amc files and footage, got 'a.asf'",
    ),
    (
        {"extraction": Extraction()},
        "extraction applies only to video, got Extraction.* for a motion",
    ),
    ({"up": "y"}, "up applies only to .amc and .bvh files, got 'y'"),
    ({"unit": "cm"}, "unit applies only to .amc and .bvh files, got 'cm'"),
    ({"unit": "ell"}, "unit must be one of m, cm, mm, inch, foot, cmu, got 'ell'"),
    ({"rate": 50.0}, "rate applies only to .amc files, got 50.0"),
    (
        {"evaluations": 30, "method": "sapso"},
        "evaluations must be at least 40, one population, got 30",
    ),
    (
        {"method": "sapzo"},
        "method must be OPTIMISER@PRIOR, or one of .*, got 'sapzo'; did you mean 'sapso'",
    ),
    ({"method": "sapzo@pca"}, "optimiser must be one of .*did you mean 'sapso'"),
    (
        {"method": "@pcb"},
        "prior must be one of full, gplvm, isomap, loose, pca, sklearn, got 'pcb'; did you mean 'pca'",
    ),
    (
        {"method": 3},
        "method must be a name, a factory, or a pair of optimiser and prior, got 3",
    ),
    ({"first_pose": "mine"}, "first_pose must be one of searched, given, got 'mine'"),
    (
        {"settings": {"sapso.coling": 1.0}},
        "a setting of sapso must be one of .*did you mean 'cooling'",
    ),
    (
        {"settings": {"pca.components": "six"}},
        "pca.components must be float, got 'six'",
    ),
    (
        {"settings": {"tracker.flor": 1.0}},
        "a setting of tracker must be one of .*did you mean 'floor'",
    ),
    (
        {"settings": {"tracker.relocalise_gap": -1}},
        "relocalise_gap must be 0 or more, got -1",
    ),
    (
        {"settings": {"tracker.tilt": "upright"}},
        r"tilt must be learned \| box \| none, got 'upright'",
    ),
    ({"settings": {"tracker.beta": 1.5}}, "beta must lie in 0 to 1, got 1.5"),
    (
        {"settings": {"tracker.root_range_degrees": (9.0, -15.0, 9.0)}},
        "root_range_degrees must be at least 0, got -15",
    ),
    (
        {"settings": {"tracker.start": "nowhere"}},
        "start must be one of blind, lookup, got 'nowhere'",
    ),
    ({"method": "exemplars"}, "evaluations must be at least 715 for exemplars, got 80"),
    (
        {"method": "exemplars", "settings": {"spread": 0.0}},
        "spread must be above 0, got 0",
    ),
    (
        {"method": "exemplars", "settings": {"temperature": np.nan}},
        "temperature must be above 0, got nan",
    ),
    (
        {"method": "exemplars", "settings": {"lag": -1}},
        "lag must be at least 0, got -1",
    ),
    ({"method": "vsmm", "settings": {"structure": "some"}}, "structure must be"),
    (
        {"method": "vsmm", "settings": {"joint_noise": 0.0}},
        "joint_noise must be above 0, got 0",
    ),
    ({"method": "vsmm:letter"}, "variant must be one of default, patent, got 'letter'"),
    ({"hypotheses": 0}, "hypotheses must be .* got 0"),
    ({"restarts": -1}, "restarts must be 0 or more, got -1"),
]


def test_a_misuse_of_track_is_one_clear_error() -> None:
    for given, message in MISUSES:
        with pytest.raises(ValueError, match=message):
            posefit.track("walk", **{"evaluations": 80, "frames": (0, 2), **given})


@each("name", ["sapso", "annealed", "particle"])
def test_a_search_that_ends_long_before_its_budget_says_so(name: str) -> None:
    optimiser = registry().optimiser(name)(Toy(9), np.random.default_rng(0))
    with pytest.warns(
        UserWarning,
        match="ended its search after 24.. of 100000 evaluations: .* pass the budget to its factory",
    ):
        minimise(Problem(sphere, Toy(9), 100_000), optimiser)


def test_masks_are_followed_through_the_library_once_and_a_build_is_fitted(
    tmp_path: Path,
) -> None:
    scene = scene_of(["09_01"], SourceOptions(frames=(0, 8), size=(120, 90)))
    log = list[str]()
    np.savez(tmp_path / "masks.npz", masks=masks_of(scene))
    track = posefit.track(
        tmp_path / "masks.npz",
        evaluations=800,
        body_frames=5,
        progress=Progress(log.append),
    )
    assert track.summary["method"] == "exemplars"
    assert track.summary["train"] == [clip.name for clip in recorded.clips()]
    assert track.summary["build"] is not None
    assert not any("looking for the first pose" in line for line in log)
    assert "fitting the person's build to 5 frames" in log
    # one camera leaves open which of two poses is right
    assert not any("again" in line for line in log)
    more = {"train": ["walk-a"], "restarts": 1, "body_frames": 0}
    posefit.track(
        tmp_path / "masks.npz", evaluations=800, progress=Progress(log.append), **more
    )
    assert "looking for the first pose around 1 pose with such a silhouette" in log


def test_footage_by_several_cameras_is_tracked_again_where_evaluations_are_enough(
    tmp_path: Path,
) -> None:
    scene = scene_of(
        ["09_01"],
        SourceOptions(frames=(0, 6), size=(120, 90), view_degrees=(0.0, 90.0)),
    )
    paths = [tmp_path / "0.npz", tmp_path / "1.npz"]
    used = dict[int, int]()
    for v, path in enumerate(paths):
        np.savez(path, masks=masks_of(scene, v))
    given: dict[str, Any] = {
        "train": ["walk-a"],
        "body_frames": 0,
        "camera": scene.cameras,
    }
    for passes in (1, 2):  # of which each has as many evaluations
        log = list[str]()
        known = {
            "evaluations": 2440 * passes,
            "progress": Progress(log.append),
            **given,
        }
        track = posefit.track(paths, method="exemplars", **known)
        again = ["tracking the 6 frames again, back in time"] * (passes - 1)
        assert [line for line in log if "again" in line] == again
        assert track.summary["evaluations_per_frame"] == 2440 * passes
        used[passes] = track.measures.evaluations
    # the effort of both, and no more than is given
    assert 1.5 * used[1] < used[2] <= 6 * 4880
