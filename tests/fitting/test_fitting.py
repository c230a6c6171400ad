"""The search space, the cost of proposals, the problem that counts and the loop that minimises it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from posefit import (
    Body,
    Camera,
    Problem,
    Problems,
    SearchSpace,
    Silhouette,
    SilhouetteCost,
    minimise,
    project,
)
from posefit.fitting.prior import Tilt
from posefit.fitting.problem import BudgetError, BudgetSpentError
from posefit.motion import built_in
from posefit.plugin import Array, align, displacement, draw_population
from posefit.testing.toy import Toy
from posefit_priors.pca import PCA
from tests.cases import each

WALK = built_in.motion("walk", frames=8)
BODY = Body.of(WALK.skeleton)


@pytest.fixture(scope="module")
def cost() -> SilhouetteCost:
    """Return the cost of proposals for one pose in two views."""
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
    return SilhouetteCost(BODY, cameras, silhouettes, space)


def drawn(cost: SilhouetteCost, count: int) -> Array:
    return draw_population(cost.space, np.random.default_rng(0), count)


@each(
    ("translation", "tilted"),
    [("known", False), ("searched", True), ("aligned", False)],
)
def test_a_cost_has_the_same_bits_in_any_population(
    cost: SilhouetteCost, translation: str, tilted: bool
) -> None:
    tilt = (
        Tilt.of(cost.space.prior, [built_in.motion("walk-a")], 0.99, 0.1)
        if tilted
        else None
    )
    cost = replace(cost, space=replace(cost.space, translation=translation, tilt=tilt))
    proposals = drawn(cost, 1000)
    costs = cost(proposals)
    for threads in (1, 3):
        shared = replace(cost, threads=threads)
        np.testing.assert_array_equal(shared(proposals), costs)
        np.testing.assert_array_equal(shared(proposals[::-1])[::-1], costs)
    parts = [cost(proposals[k : k + 7]) for k in range(0, 1000, 7)]
    np.testing.assert_array_equal(np.concatenate(parts), costs)
    np.testing.assert_array_equal(
        [cost(proposal[None])[0] for proposal in proposals[:20]], costs[:20]
    )
    np.testing.assert_array_equal(
        cost.cost_and_areas(*cost.decode(proposals))[0], costs
    )
    assert cost(proposals[:0]).shape == (0,)


@each("threads", [1, 2])
def test_a_search_gets_the_costs_of_areas_without_views_that_know_nothing(
    cost: SilhouetteCost, threads: int
) -> None:
    whole = cost.silhouettes[0]
    half = Silhouette.of(
        whole.mask, np.ones_like(whole.mask) & (np.arange(whole.size[0]) < 80)
    )
    blind = Silhouette.of(np.zeros_like(whole.mask), np.zeros_like(whole.mask))
    cameras = [cost.cameras[0]] * 3
    several = replace(
        cost,
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
    np.testing.assert_allclose(several(proposals), shares.reshape(2, -1).mean(axis=0))
    nothing = replace(several, silhouettes=[blind] * 3, blank=True)
    # Interpretation S2
    np.testing.assert_array_equal(nothing(proposals), 100.0)


@each("translation", ["known", "searched", "aligned"])
def test_a_proposal_means_the_same_pose_at_every_size(
    cost: SilhouetteCost, translation: str
) -> None:
    cost = replace(cost, space=replace(cost.space, translation=translation))
    half = cost.coarser(2)
    quarter = cost.coarser(4)
    assert cost.coarser(2) is half
    assert [camera.width for camera in (*half.cameras, *quarter.cameras)] == [
        80,
        80,
        40,
        40,
    ]
    proposals = drawn(cost, 50)
    for values, expected in zip(
        half.decode(proposals), cost.decode(proposals), strict=True
    ):
        np.testing.assert_allclose(values, expected, atol=1e-9)


def test_a_searched_translation_has_three_more_dimensions(cost: SilhouetteCost) -> None:
    space = replace(
        cost.space, translation="searched", anchor=np.array([1.0, 2.0, 3.0])
    )
    assert space.dimensions == cost.space.dimensions + 3 == 12
    poses, translations = space.decode(
        np.array([[0.0] * 3 + [1.0, 0.0, -0.5] + [0.0] * 6])
    )
    np.testing.assert_allclose(translations, [[1.5, 2.0, 2.75]])
    np.testing.assert_allclose(poses[0, :3], 0.0)


def test_a_full_circle_of_yaw_wraps(cost: SilhouetteCost) -> None:
    space = replace(cost.space, root_range=np.array([np.pi, 0.2, 0.2]))
    assert space.periodic.tolist() == [True] + [False] * 8
    assert displacement(
        space, np.array([0.9] + [0.0] * 8), np.array([-0.9] + [0.0] * 8)
    )[0] == pytest.approx(0.2)


def test_aligning_recovers_the_true_translation(cost: SilhouetteCost) -> None:
    camera = cost.cameras[0]
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


def test_threads_align_the_same_bits() -> None:
    camera = Camera.around(WALK.translations[0], 0.8, 3.5, (160, 120))
    silhouette = Silhouette.of(
        project(BODY, camera, WALK.poses[0], WALK.translations[0])
    )
    rng = np.random.default_rng(0)
    poses = np.repeat(WALK.poses, 10, axis=0)
    starts = WALK.translations[0] + rng.normal(0.0, 0.1, (len(poses), 3))
    alone, shared = (
        align(BODY, [camera], [silhouette], poses, starts, threads)
        for threads in (1, 3)
    )
    np.testing.assert_array_equal(alone, shared)


def test_mistakes_are_named(cost: SilhouetteCost) -> None:
    holed = np.zeros((1000, 9))
    holed[900, 3] = np.nan
    for shared in (cost, replace(cost, threads=2)):
        for proposals, message in (
            (
                np.zeros((1000, 8)),
                r"proposals must have shape \(n, 9\), got \(1000, 8\)",
            ),
            (np.zeros(1000), r"proposals must have shape \(n, 9\), got \(1000,\)"),
            (holed, "proposals must be finite"),
        ):
            with pytest.raises(ValueError, match=message):
                shared(proposals)
    space = cost.space
    nowhere = np.zeros(3)
    empty = Silhouette.of(np.zeros((120, 160)))
    lying = Silhouette.of(np.ones((160, 120)))
    for call, message in (
        (
            lambda: replace(cost, silhouettes=[lying] * 2),
            r"mask must have shape \(120, 160\), the camera's, got \(160, 120\)",
        ),
        (
            lambda: replace(cost, silhouettes=[]),
            r"silhouettes must be one for each camera \(2\), got 0",
        ),
        (
            lambda: replace(cost, silhouettes=[empty] * 2),
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


LINE = Toy(1)


def test_the_budget_is_used_in_whole_populations() -> None:
    walker = Walker(7)
    problem = Problem(lambda x: -x[:, 0], LINE, 40)
    assert minimise(problem, walker) is problem
    assert (problem.evaluations, problem.best_cost) == (35, -4.0)
    assert (problem.budget, problem.remaining_evaluations) == (40, 5)
    evaluations, costs = problem.trace
    # the first of each population is lower than all before it
    assert evaluations.tolist() == [1.0, 8.0, 15.0, 22.0, 29.0, 35.0]
    assert costs.tolist() == [0.0, -1.0, -2.0, -3.0, -4.0, -4.0]
    assert problem.points.tolist() == [[0.0], [1.0], [2.0], [3.0], [4.0]]
    assert len(walker.evaluated) == 5
    with pytest.raises(
        BudgetError, match="evaluations must be at least 7, one population, got 6"
    ):
        minimise(Problem(lambda x: x[:, 0], LINE, 6), Walker(7))
    with pytest.raises(ValueError, match="must propose a population, got an empty"):
        minimise(Problem(lambda x: x[:, 0], LINE, 6), Walker(0))
    with pytest.raises(ValueError, match="must have a budget to be minimised"):
        minimise(Problem(lambda x: x[:, 0], LINE), Walker(7))


def test_nothing_is_evaluated_beyond_the_budget_and_nothing_wrong_is_counted() -> None:
    sizes = list[int]()

    def cost(proposals: Array) -> Array:
        sizes.append(len(proposals))
        return proposals[:, 0]

    problem = Problem(cost, LINE, 5, id="a line")
    problem(np.zeros((3, 1)))
    with pytest.raises(
        BudgetSpentError, match="a line: 2 of 5 evaluations are left, got 3"
    ):
        problem(np.zeros((3, 1)))
    with pytest.raises(ValueError, match="proposals must be finite"):
        problem([np.nan])
    assert problem([0.5]) == 0.5
    assert sizes == [3, 1]
    assert problem.evaluations == 4
    problem.reset()
    assert (problem.evaluations, problem.best_cost) == (0, np.inf)
    with pytest.raises(ValueError, match="a line must have a finite cost"):
        _ = problem.best


def test_nan_is_never_the_best_cost() -> None:
    problem = Problem(lambda x: np.where(x[:, 0] == 1.0, 5.0, np.nan), LINE, 9)
    assert minimise(problem, Walker(3)).best_cost == 5.0
    with pytest.raises(
        ValueError,
        match="costs must be finite, got only nan or infinity in 9 evaluations",
    ):
        minimise(Problem(lambda x: x[:, 0] * np.nan, LINE, 9), Walker(3))


@each(
    ("wrong", "came"),
    [
        (lambda x: x[1:, 0], r"got \(6,\)"),
        (lambda x: x[:, 0].tolist(), "got list"),
        (lambda x: x, r"got \(7, 1\)"),
    ],
)
def test_a_cost_function_returns_a_cost_for_each_proposal(
    wrong: Callable[[Array], Array], came: str
) -> None:
    with pytest.raises(
        TypeError, match=r"cost must return an array of shape \(7,\), " + came
    ):
        minimise(Problem(wrong, LINE, 40), Walker(7))


def test_a_repair_is_what_is_evaluated_and_noise_is_not_remembered() -> None:
    problem = Problem(
        lambda x: x[:, 0] ** 2,
        LINE,
        repair=lambda x: np.clip(x, -1.0, 0.5),
        noisy=lambda x, first: 100.0 + first + np.arange(len(x)),
    )
    assert problem(np.array([[0.9], [0.7]])).tolist() == [100.0, 101.0]
    assert problem([0.0]) == 102.0
    assert problem.points.tolist() == [[0.5], [0.0]]
    assert problem.trace[1].tolist() == [0.25, 0.0]


def test_a_problem_knows_what_its_cost_function_knows(cost: SilhouetteCost) -> None:
    problem = Problem(cost, cost.space)
    assert problem.body is cost.body
    with pytest.raises(AttributeError, match="Problem has no attribute 'colour'"):
        _ = problem.colour
    assert not hasattr(Problem(np.sum, LINE), "decode")


def test_a_cost_function_that_works_in_place_changes_nobodys_proposals() -> None:
    def emptied(proposals: Array) -> Array:
        proposals[:] = 0.0
        return np.full(len(proposals), 3.0)

    problem = Problem(emptied, LINE)
    proposals = np.array([[0.9], [0.7]])
    problem(proposals)
    assert proposals.tolist() == [[0.9], [0.7]]
    assert problem.best.tolist() == [0.9]


def test_proposals_are_real_numbers() -> None:
    with pytest.raises(ValueError, match="must be real, got complex"):
        Problem(lambda x: x[:, 0], LINE)(np.array([[0.5j]]))


@each("costs", [[3.0, np.nan, 2.0], [np.nan] * 3, [np.inf, 1.0, 1.0]])
def test_rows_of_problems_count_like_a_problem(costs: list[float]) -> None:
    proposals = np.linspace(-0.5, 0.5, 6).reshape(3, 2)
    alone = Problem(lambda _: np.array(costs), Toy(2))
    together = Problems(2, 2)
    alone(proposals)
    together.count(np.array([1]), proposals[None], np.array([costs]))

    assert together.evaluations.tolist() == [0, alone.evaluations]
    assert together.best_costs.tolist() == [np.inf, alone.best_cost]
    if np.isfinite(alone.best_cost):
        assert together.best[1].tolist() == alone.best.tolist()
