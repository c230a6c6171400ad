"""The search space, the problem and the loop that drives an optimiser."""

from dataclasses import replace

import numpy as np
import pytest

from posefit import (
    Body,
    Camera,
    PoseProblem,
    SearchSpace,
    Silhouette,
    minimise,
    project,
)
from posefit.fitting.optimiser import BudgetError
from posefit.fitting.prior import Tilt
from posefit.motion import built_in
from posefit.plugin import Array, align, displacement, draw_population
from posefit_priors.pca import PCA
from tests.cases import each

WALK = built_in.motion("walk", frames=8)
BODY = Body.of(WALK.skeleton)


@pytest.fixture(scope="module")
def problem() -> PoseProblem:
    """Return the problem of one pose in two views."""
    angles = np.concatenate(
        [built_in.motion(style).poses[:, 3:] for style in ("walk-a", "walk-b")]
    )
    cameras = [
        Camera.around(WALK.translations[0], azimuth, 3.5, (160, 120))
        for azimuth in (0.8, 2.1)
    ]
    silhouettes = [
        Silhouette.of(project(BODY, camera, WALK.poses[0], WALK.translations[0]))
        for camera in cameras
    ]
    space = SearchSpace(
        PCA().fit(angles),
        np.zeros(3),
        np.radians([45.0, 15.0, 15.0]),
        WALK.translations[0],
    )
    return PoseProblem(BODY, cameras, silhouettes, space)


def drawn(problem: PoseProblem, count: int) -> Array:
    return draw_population(problem.space, np.random.default_rng(0), count)


@each(
    ("translation", "tilted"),
    [("known", False), ("searched", True), ("aligned", False)],
)
def test_a_cost_has_the_same_bits_whatever_is_beside_it(
    problem: PoseProblem, translation: str, tilted: bool
) -> None:
    tilt = (
        Tilt.of(problem.space.prior, [built_in.motion("walk-a")], 0.99, 0.1)
        if tilted
        else None
    )
    problem = replace(
        problem, space=replace(problem.space, translation=translation, tilt=tilt)
    )
    proposals = drawn(problem, 1000)
    costs = problem.evaluate(proposals)
    for threads in (1, 3):
        shared = replace(problem, threads=threads)
        np.testing.assert_array_equal(shared.evaluate(proposals), costs)
        np.testing.assert_array_equal(shared.evaluate(proposals[::-1])[::-1], costs)
    parts = [problem.evaluate(proposals[k : k + 7]) for k in range(0, 1000, 7)]
    np.testing.assert_array_equal(np.concatenate(parts), costs)
    np.testing.assert_array_equal(
        [problem.evaluate(proposal[None])[0] for proposal in proposals[:20]], costs[:20]
    )
    np.testing.assert_array_equal(
        problem.cost_and_areas(*problem.decode(proposals))[0], costs
    )
    assert problem.evaluate(proposals[:0]).shape == (0,)


@each("threads", [1, 2])
def test_a_search_gets_the_costs_of_areas_without_views_that_know_nothing(
    problem: PoseProblem, threads: int
) -> None:
    whole = problem.silhouettes[0]
    half = Silhouette.of(
        whole.mask, np.ones_like(whole.mask) & (np.arange(whole.size[0]) < 80)
    )
    blind = Silhouette.of(np.zeros_like(whole.mask), np.zeros_like(whole.mask))
    cameras = [problem.cameras[0]] * 3
    several = replace(
        problem,
        cameras=cameras,
        silhouettes=[blind, whole, half],
        beta=0.3,
        threads=threads,
    )
    proposals = drawn(several, 40)
    counts = several.cost_and_areas(*several.decode(proposals))[1]
    shares = np.array(
        [
            100.0 * (0.7 * b / (b + y) + 0.3 * r / (r + y))
            for r, b, y in np.concatenate(counts[1:])
        ]
    )
    np.testing.assert_allclose(
        several.evaluate(proposals), shares.reshape(2, -1).mean(axis=0)
    )
    nothing = replace(several, silhouettes=[blind] * 3, blank=True)
    # Interpretation S2
    np.testing.assert_array_equal(nothing.evaluate(proposals), 100.0)


@each("translation", ["known", "searched", "aligned"])
def test_a_proposal_means_the_same_pose_at_every_size(
    problem: PoseProblem, translation: str
) -> None:
    problem = replace(problem, space=replace(problem.space, translation=translation))
    half = problem.coarser(2)
    quarter = problem.coarser(4)
    assert problem.coarser(2) is half
    assert [camera.width for camera in (*half.cameras, *quarter.cameras)] == [
        80,
        80,
        40,
        40,
    ]
    proposals = drawn(problem, 50)
    for values, expected in zip(
        half.decode(proposals), problem.decode(proposals), strict=True
    ):
        np.testing.assert_allclose(values, expected, atol=1e-9)


def test_a_searched_translation_has_three_more_dimensions(problem: PoseProblem) -> None:
    space = replace(
        problem.space, translation="searched", anchor=np.array([1.0, 2.0, 3.0])
    )
    assert space.dimensions == problem.space.dimensions + 3 == 12
    poses, translations = space.decode(
        np.array([[0.0] * 3 + [1.0, 0.0, -0.5] + [0.0] * 6])
    )
    np.testing.assert_allclose(translations, [[1.5, 2.0, 2.75]])
    np.testing.assert_allclose(poses[0, :3], 0.0)


def test_a_full_circle_of_yaw_wraps(problem: PoseProblem) -> None:
    space = replace(problem.space, root_range=np.array([np.pi, 0.2, 0.2]))
    assert space.periodic.tolist() == [True] + [False] * 8
    assert displacement(
        space, np.array([0.9] + [0.0] * 8), np.array([-0.9] + [0.0] * 8)
    )[0] == pytest.approx(0.2)


def test_aligning_recovers_the_true_translation(problem: PoseProblem) -> None:
    camera = problem.cameras[0]
    for pose, translation in zip(WALK.poses, WALK.translations, strict=True):
        true = translation + [0.2, -0.1, 0.3]
        silhouette = Silhouette.of(project(BODY, camera, pose, true))
        off = (
            align(BODY, [camera], [silhouette], pose[None], translation[None])[0] - true
        )
        # metres; a pixel is 0.016 m here
        assert np.abs(camera.rotation[:2] @ off).max() < 0.02
        assert abs(camera.rotation[2] @ off) < 0.15  # depth


def slowly_aligned(
    cameras: list[Camera], silhouettes: list[Silhouette], joints: Array, place: Array
) -> Array:
    """Return what `align` does for one pose: joints (27, 3), the root at the origin."""
    radii = BODY.joint_radii()
    for _ in range(3):
        rows = [*1e-6 * np.eye(3)]
        values = [*1e-6 * place]
        for camera, silhouette in zip(cameras, silhouettes, strict=True):
            turn = camera.rotation
            scale = np.sqrt(camera.focal.prod())
            points, still = (
                (joints + at) @ turn.T + camera.translation
                for at in (place, np.zeros(3))
            )
            pixels = camera.focal * points[:, :2] / points[:, 2:]
            # left, top, right, bottom
            for side, border in enumerate(silhouette.extent):
                axis = side % 2
                sign = np.sign(side - 1.5)
                b = border - camera.centre[side % 2]
                if np.isnan(b):
                    continue
                f = camera.focal[axis]
                j = int(
                    (sign * pixels[:, axis] + scale * radii / points[:, 2]).argmax()
                )
                rows.append((f * turn[axis] - b * turn[2]) / scale)
                values.append(
                    (b * still[j, 2] - f * still[j, axis]) / scale - sign * radii[j]
                )
        place = np.linalg.lstsq(np.array(rows), np.array(values))[0]
    return place


@each("azimuths", [(0.8,), (0.3, 1.9)])
def test_aligning_near_a_camera_is_that_of_a_slow_twin(
    azimuths: tuple[float, ...],
) -> None:
    # so near that a joint's depth decides which one is outermost
    cameras = [
        Camera.around(WALK.translations[0], angle, 1.5, (160, 120), field_of_view=1.9)
        for angle in azimuths
    ]
    poses = WALK.poses[::3]
    places = WALK.translations[::3]
    silhouettes = [
        Silhouette.of(project(BODY, camera, poses[0], places[0])) for camera in cameras
    ]
    starts = places + [0.15, -0.1, 0.2]
    for place, pose, start in zip(
        align(BODY, cameras, silhouettes, poses, starts), poses, starts, strict=True
    ):
        expected = slowly_aligned(
            cameras, silhouettes, WALK.skeleton.joints(pose), start
        )
        np.testing.assert_allclose(place, expected, atol=1e-5)


def test_mistakes_are_named(problem: PoseProblem) -> None:
    holed = np.zeros((1000, 9))
    holed[900, 3] = np.nan
    for shared in (problem, replace(problem, threads=2)):
        for proposals, message in (
            (
                np.zeros((1000, 8)),
                r"proposals must have shape \(n, 9\), got \(1000, 8\)",
            ),
            (np.zeros(1000), r"proposals must have shape \(n, 9\), got \(1000,\)"),
            (holed, "proposals must be finite"),
        ):
            with pytest.raises(ValueError, match=message):
                shared.evaluate(proposals)
    space = problem.space
    nowhere = np.zeros(3)
    empty = Silhouette.of(np.zeros((120, 160)))
    lying = Silhouette.of(np.ones((160, 120)))
    for call, message in (
        (
            lambda: replace(problem, silhouettes=[lying] * 2),
            r"mask must have shape \(120, 160\), the camera's, got \(160, 120\)",
        ),
        (
            lambda: replace(problem, silhouettes=[]),
            r"silhouettes must be one a camera \(2\), got 0",
        ),
        (
            lambda: replace(problem, silhouettes=[empty] * 2),
            "silhouettes must show a person, got an empty mask",
        ),
        (
            lambda: replace(space, translation="free"),
            "translation must be one of known, searched, aligned, got 'free'",
        ),
        (
            lambda: replace(space, root_range=-np.ones(3)),
            r"root_range must be 3 numbers of 0 or more, got \[-1.0, ",
        ),
        (
            lambda: replace(space, translation_range=-np.ones(3)),
            "translation_range must be 3 numbers of 0 or more",
        ),
        (
            lambda: Camera.around(nowhere, 0.0, -1.0, (64, 48)),
            "distance must be 0 or more metres, got -1.0",
        ),
        (
            lambda: Camera.around(nowhere, 0.0, 3.0, (64, 48), 4.0),
            "field_of_view must lie between 0 and pi radians",
        ),
        (
            lambda: minimise(lambda x: x[1:, 0], Walker(7), 40),
            r"an array of costs of shape \(7,\), got shape \(6,\)",
        ),
        (
            lambda: minimise(lambda x: x[:, 0].tolist(), Walker(7), 40),
            r"an array of costs of shape \(7,\), got list",
        ),
    ):
        with pytest.raises((ValueError, TypeError), match=message):
            call()


class Walker:
    """Proposes fixed populations, whatever they cost."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.evaluated: list[tuple[Array, Array]] = []

    def ask(self) -> Array:
        return np.full((self.size, 1), float(len(self.evaluated)))

    def tell(self, proposals: Array, costs: Array) -> None:
        self.evaluated.append((proposals, costs))


def test_the_budget_is_used_in_whole_populations() -> None:
    best = minimise(lambda x: -x[:, 0], Walker(7), 40)
    assert (best.evaluations, best.cost) == (35, -4.0)
    assert best.trace.tolist() == [
        [7.0, 0.0],
        [14.0, -1.0],
        [21.0, -2.0],
        [28.0, -3.0],
        [35.0, -4.0],
    ]
    with pytest.raises(
        BudgetError, match="evaluations must hold one population of 7, got 6"
    ):
        minimise(lambda x: x[:, 0], Walker(7), 6)


def test_nan_is_never_the_best_cost() -> None:
    best = minimise(lambda x: np.where(x[:, 0] == 1.0, 5.0, np.nan), Walker(3), 9)
    assert best.cost == 5.0
    with pytest.raises(
        ValueError, match="costs must be numbers, got nan for all 9 proposals"
    ):
        minimise(lambda x: x[:, 0] * np.nan, Walker(3), 9)
