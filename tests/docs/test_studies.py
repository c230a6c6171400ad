"""Every study can be started, every plan beside them is one, and what they compute is right."""

import importlib
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

import ablate
import agents
import functions
import proportions
import seeds
import table
from make_boxes import learned_from, upright_poses
from make_library import LONGEST_GAP, TOLERANCE, kept_frames
from make_models import normalised_ridge
from posefit.motion.built_in import average_skeleton
from posefit.suites.boxes import STEP, TRAINING_PEOPLE, learned_without
from posefit.sweep.plan import Plan
from posterior import conformal_factor
from tests.docs.pages import DOCS

STUDIES = DOCS / "studies"


def test_every_study_starts_and_is_named_by_a_page() -> None:
    pages = "".join(path.read_text("utf-8") for path in DOCS.rglob("*.md"))
    for path in sorted(STUDIES.glob("*.py")):
        study = importlib.import_module(path.stem)
        if isinstance(getattr(study, "main", None), click.Command):
            result = CliRunner().invoke(study.main, ["--help"])
            assert result.exit_code == 0, path.name
            assert f"docs/studies/{path.name}" in pages, path.name
    for path in sorted(STUDIES.glob("*.toml")):
        assert f"docs/studies/{path.name}" in pages, path.name


def test_plans_of_built_in_motions_are_plans() -> None:
    assert [
        len(Plan.read(STUDIES / f"{name}.toml")) for name in ("views", "degradation")
    ] == [45, 36]


def test_a_plan_of_recorded_clips_is_one(
    cmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(cmu)
    assert len(Plan.read(STUDIES / "accuracy.toml")) == 60


def test_the_table_of_a_plan_has_a_line_a_group(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(
        '[defaults]\nframes = 2\nevaluations = 80\n[product]\nmethods = ["random@pca"]\nmotions = ["walk"]\n'
        "corruptions = [{}, { holes = 0.5 }]\nseeds = 2\n"
    )
    words = [str(plan), "--by", "method", "--by", "corruption", "--workers", "1"]
    result = CliRunner(env={"POSEFIT_CMU": ""}).invoke(table.main, words)
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stdout.splitlines() if line.startswith("|")]
    starts = ["| random@pca | - | 2 |", "| random@pca | holes 0.5 | 2 |"]
    assert [
        line.startswith(start) for line, start in zip(lines[2:], starts, strict=True)
    ] == [True, True]


def test_rows_are_written_as_they_come_and_read_again(tmp_path: Path) -> None:
    path = str(tmp_path / "rows.jsonl")
    rows = {
        name: {"name": name, "cost": cost}
        for name, cost in (("one", 1.5), ("other", 2.5))
    }
    assert table.earlier(path, lambda row: row["name"]) == {}
    coming = table.kept(path, iter(rows.items()), 2)
    assert next(coming) == ("one", rows["one"])
    assert table.earlier(path, lambda row: row["name"]) == {"one": rows["one"]}
    assert list(coming) == [("other", rows["other"])]
    assert table.earlier(path, lambda row: row["name"]) == rows


def test_an_interval_holds_the_median() -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    low, high = table.interval(values, "abcde")
    assert 1.0 <= low <= 3.0 <= high <= 5.0
    assert table.interval(values, "aaaaa") == (3.0, 3.0)


# Interpretation V5
def test_the_models_ridge_is_in_normalised_units_with_an_offset_towards_a_target() -> (
    None
):
    rng = np.random.default_rng(1)
    before = np.column_stack([np.zeros((90, 3)), rng.normal(0.0, 0.3, (90, 40))])
    after = before + rng.normal(0.0, 0.05, before.shape)
    inputs = before[:, 3:]
    target = 0.1 * rng.normal(size=(43, 40))
    matrix, offset = normalised_ridge(before, after, target, 0.15)
    unit = np.sqrt(inputs.var(axis=0).sum() / 10.0)
    scaled = (inputs - inputs.mean(axis=0)) / unit
    wanted = after - before - inputs @ target.T
    wanted[:, [0, 2]] = 0.0  # the way over the ground
    rows = np.vstack([scaled, np.sqrt(0.15 * len(scaled)) * np.eye(40)])
    outputs = np.vstack([wanted - wanted.mean(axis=0), np.zeros((40, 43))])
    flow = np.linalg.lstsq(rows, outputs, rcond=None)[0]
    assert np.allclose(matrix, flow.T / unit + target)
    assert np.allclose(
        inputs @ (matrix - target).T + offset, scaled @ flow + wanted.mean(axis=0)
    )


def test_the_file_of_boxes_follows_from_the_library() -> None:
    """Where another LAPACK decomposes, rounding may differ, and a component may point the other way.

    The sign is that of its largest number; those of a left and a right limb are equally large but for rounding.
    """
    others = tuple(person for person in TRAINING_PEOPLE if person != "17")
    learned = learned_from(upright_poses(others))
    stored = learned_without("17")
    assert np.abs(STEP * learned["mean"] - stored.mean).max() <= STEP
    components = STEP * learned["components"]
    components *= np.sign((components * stored.components).sum(axis=1))[:, None]
    assert np.abs(components - stored.components).max() <= 10 * STEP
    assert np.array_equal(learned["order"], stored.order)


def test_a_still_body_leaves_few_frames_and_a_moving_one_all() -> None:
    def kept(places: np.ndarray) -> list[int]:
        return kept_frames(average_skeleton(), np.zeros((50, 66)), places).tolist()

    thrown = np.zeros((50, 3))
    assert kept(thrown) == [*range(0, 49, LONGEST_GAP), 49]
    # the root, to and fro by twice the tolerance: every frame is a corner
    thrown[::2, 1] = 4.0 * TOLERANCE
    assert kept(thrown) == list(range(50))
    # at an even pace, everything lies on a line
    assert len(kept(np.linspace(0.0, 5.0, 50)[:, None] * [1.0, 0.0, 0.0])) == 8


def test_clips_have_equal_weight_and_a_future_clip_is_infinitely_far() -> None:
    # three clips: 1, 2 | 3 | 4. Each weighs a quarter, shared by its scores; the last quarter is the new clip's
    scores = [np.array([2.0, 1.0]), np.array([3.0]), np.array([4.0])]
    # for a level of 0.6, of the three that are known alone 3 would be enough
    assert [
        conformal_factor(scores, level) for level in (0.125, 0.2, 0.5, 0.6, 0.75)
    ] == [1.0, 2.0, 3.0, 4.0, 4.0]
    for clips, level, message in (
        (scores, 0.8, r"clips must be at least 4 for a level of 0\.8, got 3"),
        ([], 0.5, "scores must be of one clip or more"),
        ([np.zeros(0)], 0.5, "each with one score or more"),
        ([np.ones(3)], 1.0, "level must be between 0 and 1, got 1"),
    ):
        with pytest.raises(ValueError, match=message):
            conformal_factor(clips, level)


def test_features_of_functions_that_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(functions, "LONGEST", 200)
    # a quadratic whose Hessian has a condition number of 100
    scales = 100.0 ** np.linspace(0.0, 1.0, 3)

    def quadratic(points: np.ndarray) -> np.ndarray:
        return (scales * points**2).sum(axis=1)

    rng = np.random.default_rng(1)
    drawn = rng.uniform(-1.0, 1.0, (functions.POINTS, 3))
    for cost in (quadratic, lambda points: np.sqrt(quadratic(points))):
        row, basins = functions.features(cost, cost, np.full(3, 0.001), drawn, rng)
        assert row["conditioning"] == pytest.approx(100.0, rel=0.1)
        assert (row["elsewhere"], row["basins"], row["rises"], row["noise"]) == (
            0,
            1,
            0,
            0,
        )
        assert len(basins) == 1
        assert np.abs(basins[0][1]).max() < 1e-3
    row, _ = functions.features(quadratic, quadratic, np.zeros(3), drawn, rng)
    assert row["interaction"] < 1e-9

    def noisy(points: np.ndarray) -> np.ndarray:
        return quadratic(points) + 100.0 * rng.standard_normal(len(points))

    row, _ = functions.features(noisy, quadratic, np.zeros(3), drawn, rng)
    assert row["noise"] > 0.5
    assert row["conditioning"] == pytest.approx(100.0, rel=0.1)

    # two wells, at 0.5 and -0.5 along each coordinate; the second costs 0.1 at its bottom
    def wells(points: np.ndarray) -> np.ndarray:
        one = ((points - 0.5) ** 2).sum(axis=1)
        other = ((points + 0.5) ** 2).sum(axis=1) + 0.1
        return np.minimum(one, other)

    row, basins = functions.features(wells, wells, np.full(3, 0.5), drawn, rng)
    assert row["basins"] == 2
    assert 0.0 < row["elsewhere"] < 1.0
    assert [np.round(point, 2).tolist() for _, point in basins] == [
        [0.5] * 3,
        [-0.5] * 3,
    ]
    assert functions.sliced(wells, basins, rng, "wells").shape == (
        functions.TILE + 26,
        functions.TILE + 4,
        3,
    )


def test_shares_are_of_problems_and_targets() -> None:
    targets = np.array([[4.0, 2.0], [5.0, 3.0]])
    one, other = (
        {name: [9.0, last] for name in functions.METHODS} for last in (4.0, 9.0)
    )
    shares = functions.shares_of(
        targets, [one | {"pso": [4.0, 4.0]}, other | {"cma": [9.0, 3.0]}]
    )
    assert shares["pso"] == [0.25, 0.25]
    assert shares["cma"] == [0.0, 0.75]


def test_a_problem_of_the_suite_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"BUDGETS": (6, 7), "DESCENTS": 2, "LONGEST": 20}.items():
        monkeypatch.setattr(functions, name, value)
    row, targets, costs, picture = functions.measured(2, 10_000, 9)
    median = functions.medians([row])
    others = {
        (number, d): {**median, "rises": 0.1 * number}
        for number, d in ((1, 9), (3, 9), (0, 20))
    }
    lines = list(functions.feature_lines({(2, 9): median}, others))
    # rises are nearer to a tenth than to three; of nine dimensions
    assert lines[2].endswith("| 1 |")
    shares = list(
        functions.share_lines({2: functions.shares_of(targets[None], [costs])})
    )
    assert [part[2].partition(" |")[0] for part in (lines, shares)] == [
        "| 2 next frame"
    ] * 2
    assert picture.any()


def test_proportions_are_of_as_many_men_as_women(tmp_path: Path) -> None:
    heads = sorted(
        {
            "stature",
            *(name.strip("-") for of in proportions.MEASURES.values() for name in of),
        }
    )
    men_csv = tmp_path / "men.csv"
    person = dict.fromkeys(heads, 100.0) | {
        "stature": 2000.0,
        "trochanterionheight": 1100.0,
        "cervicaleheight": 1700.0,
    }
    people = [
        person | {"lateralfemoralepicondyleheight": height} for height in (500.0, 600.0)
    ]
    men_csv.write_text(
        "\n".join(
            [
                ",".join(heads),
                *(",".join(str(row[name]) for name in heads) for row in people),
            ]
        )
    )
    logs = proportions.proportions(men_csv)
    assert logs.shape == (2, 9)
    np.testing.assert_allclose(
        logs[:, :3], np.log([[2.0, 0.3, 0.2], [2.0, 0.25, 0.25]])
    )
    men = np.array([[0.0, 0.0], [2.0, 2.0]])
    women = np.array([[3.0, -3.0], [3.0, -1.0], [3.0, -2.0]])
    spread, correlation = proportions.moments(men, women)
    # means 2 and -0.5; variances 0.5 * (0.5 * (4 + 0) + 1) and 0.5 * (0.5 * (0.25 + 6.25) + (6.25 + 0.25 + 2.25) / 3)
    assert spread**2 == pytest.approx([1.5, 0.5 * (3.25 + 8.75 / 3)])
    covariance = 0.5 * (0.5 * (-2.0 * 0.5 + 0.0) + 1.0 * -1.5)
    assert correlation[0, 1] == pytest.approx(
        covariance / np.sqrt(1.5 * 0.5 * (3.25 + 8.75 / 3))
    )


def test_tracks_are_as_far_apart_as_the_median_joint_of_all_pairs() -> None:
    tracks = [
        np.zeros((1, 3, 3)),
        np.full((1, 3, 3), [3.0, 4.0, 0.0]),
        np.full((1, 3, 3), [0.0, 12.0, 0.0]),
    ]
    # of 5, 12 and the square root of 9 + 64
    assert seeds.median_distance(tracks) == pytest.approx(np.sqrt(73.0))
    assert seeds.median_distance(tracks[:1]) == 0.0


def test_blind_equivalents_lie_between_the_budgets_measured_by_their_logarithm() -> (
    None
):
    blind = {100: 10.0, 10_000: 2.0}
    assert [agents.equivalent(blind, cost) for cost in (10.0, 6.0, 2.0)] == [
        "100",
        "1,000",
        "10,000",
    ]
    assert [agents.equivalent(blind, cost) for cost in (10.1, 1.9)] == [
        "< 100",
        "> 10,000",
    ]


def test_the_table_of_agents_has_a_search_in_a_line_and_the_mean_of_seeds() -> None:
    rows = [
        {
            "agent": name,
            "budget": budget,
            "costs": [cost, cost + 2.0],
            "cpu_seconds": 3.0,
        }
        for name, budget, cost in (
            ("sapso", 40, 9.0),
            ("sapso", 4_000, 1.0),
            ("cma", 40, 9.0),
            ("cma", 4_000, 5.0),
        )
    ]
    rows += [
        {"agent": "PPO", "budget": 1_000, "costs": [cost, cost], "cpu_seconds": 60.0}
        for cost in (5.0, 7.0)
    ]
    _, _, sapso, _, ppo = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in agents.table(rows)
    ]
    assert (*sapso[:2], sapso[5]) == ("sapso", "40; 4,000", "10.0; 2.0")
    assert ppo == ["PPO", "8", "1,000", "60", "2", "6.0", "5.0 to 7.0", "400", "4,000"]


def test_every_change_of_the_tracker_finds_its_constants_and_puts_them_back() -> None:
    for change in [*ablate.MECHANISMS.values(), *ablate.constants().values()]:
        places = [place for place in change if not place.startswith(ablate.CELL)]
        before = [value_of(place) for place in places]
        with ablate.changed(change):
            assert [value_of(place) for place in places] == [
                change[place] for place in places
            ]
        assert [value_of(place) for place in places] == before


def value_of(place: str) -> object:
    """Return the value of a constant of the tracker, given as `module.NAME`."""
    module, name = place.split(".")
    return getattr(importlib.import_module(f"{ablate.PACKAGE}.{module}"), name)
