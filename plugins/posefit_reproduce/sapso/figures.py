"""The figures of the SAPSO paper, drawn again.

Figures 3 and 4 show the compact space, 5 and 6 one search, 7 and 9 errors.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from posefit.arrays import Array
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.problem import Problem, minimise
from posefit.fitting.synthesis import Prediction, Predictor
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import INNER, JOINTS, PARENTS
from posefit.report.figures import COLOURS
from posefit.tracking.defaults import completed
from posefit.tracking.initialise import task_of
from posefit.tracking.options import TrackOptions
from posefit_priors.pca import PCA
from posefit_reproduce.sapso.experiment import ITERATIONS, options_of
from posefit_reproduce.sapso.methods import LABELS as METHODS
from posefit_reproduce.sapso.methods import LETTER, OURS, PAPER
from posefit_reproduce.sapso.motions import LABELS, PaperMotion, paper_scene
from posefit_reproduce.sapso.paper import (
    CONVERGED,
    SHOWN_ITERATIONS,
    SHOWN_PARTICLES,
    SMALL_DEGREES,
    SWARMS,
)
from posefit_reproduce.sapso.tables import Analysis
from posefit_swarm.sapso import SAPSO

MOTIONS = ("walk", "run")
SHOWN_VIEW = 45.0  # degrees; the view of figure 5
_DIM = "0.55"
_LEGEND: dict[str, Any] = {"fontsize": 8, "frameon": False}


def paper_figures(analysis: Analysis) -> Iterator[tuple[str, Figure]]:
    """Yield the figures with the names of their files."""
    yield "figure-3-latents.png", _in_compact_space(analysis, _latents)
    yield "figure-4-clusters.png", _in_compact_space(analysis, _clusters)
    yield "figure-5-swarm.png", swarm_figure(watched_swarm(analysis.motions["walk"]))
    yield "figure-6-convergence.png", lowest_cost_figure(analysis)
    yield "figure-7-dimensions.png", dimension_figure(analysis)
    yield "figure-9-frames.png", frame_figure(analysis)


def _in_compact_space(
    analysis: Analysis, draw: Callable[[Any, PaperMotion, PCA], str]
) -> Figure:
    """Return the first three latents of two motions; `draw` returns their title."""
    figure = Figure(figsize=(10.0, 4.8), layout="constrained")
    for k, motion in enumerate(MOTIONS):
        axes: Any = figure.add_subplot(1, len(MOTIONS), k + 1, projection="3d")
        axes.set(xlabel="latent 1", ylabel="latent 2", zlabel="latent 3")
        axes.tick_params(labelsize=7)
        axes.set_box_aspect(None, zoom=0.88)  # else the last label is cut
        title = draw(
            axes, analysis.motions[motion], PCA().fit(analysis.motions[motion].angles)
        )
        axes.set_title(f"{LABELS[motion]}: {title}", fontsize=9)
    return figure


def _latents(axes: Any, motion: PaperMotion, prior: PCA) -> str:
    """Draw the training poses, in one colour for each clip."""
    for clip, colour in zip(motion.training, COLOURS, strict=False):
        points = prior.transform(clip.poses[:, 3:])
        axes.plot(
            *points[:, :3].T,
            ".-",
            color=colour,
            markersize=3,
            linewidth=0.4,
            label=clip.name,
        )
    axes.legend(fontsize=7, frameon=False)
    shares = 100.0 * prior.explained
    return f"{shares[:3].sum():.0f} % of the variance, six keep {shares.sum():.1f} %"


def _clusters(axes: Any, motion: PaperMotion, prior: PCA) -> str:
    """Draw the training poses by their nearest centre of K-means, with the centres."""
    points = prior.transform(motion.angles)
    away = np.abs(points[:, None] - prior.centres).mean(axis=2)
    for k, (centre, colour) in enumerate(zip(prior.centres, COLOURS, strict=False)):
        axes.plot(
            *points[away.argmin(axis=1) == k, :3].T, ".", color=colour, markersize=3
        )
        axes.plot(
            *centre[:3, None], "*", color=colour, markersize=13, markeredgecolor="black"
        )
    within = 100.0 * (away.min(axis=1) < prior.reach).mean()
    return f"K = {len(prior.centres)}, {within:.0f} % of the poses valid"


class WatchedSwarm(NamedTuple):
    """The iterations of a swarm in the first frame."""

    scene: Scene
    poses: list[Array]  # (n, 66) in each iteration
    translations: list[Array]  # (n, 3) in each iteration
    best: list[int]  # the proposal of lowest cost in each iteration
    history: Array  # (iterations + 1,) lowest cost so far


def watched_swarm(
    motion: PaperMotion, particles: int = SHOWN_PARTICLES, iterations: int = ITERATIONS
) -> WatchedSwarm:
    """Return the swarm of SAPSO in the first frame."""
    scene = paper_scene(motion, SHOWN_VIEW, 1)
    options = completed(
        TrackOptions(**options_of(OURS, motion.training, iterations)), scene.truth
    )
    task = task_of(scene, options, motion.training)
    observation = scene.observations[0]
    space = Predictor(task, PCA().fit(motion.angles), Prediction(tilt="box")).space(
        observation
    )
    cost = SilhouetteCost(scene.body, scene.cameras, observation.silhouettes, space)
    search = SAPSO(
        space,
        np.random.default_rng(0),
        population_size=particles,
        iterations=iterations,
    )
    poses = list[Array]()
    translations = list[Array]()
    leaders = list[int]()
    least = list[float]()

    def watched(proposals: Array) -> Array:
        costs = cost(proposals)
        decoded = cost.decode(proposals)
        poses.append(decoded[0])
        translations.append(decoded[1])
        leaders.append(int(costs.argmin()))
        least.append(float(costs.min()))
        return costs

    minimise(Problem(watched, space, particles * (iterations + 1)), search)
    history = np.minimum.accumulate(least)
    return WatchedSwarm(
        scene,
        poses,
        translations,
        leaders,
        history,
    )


def swarm_figure(swarm: WatchedSwarm) -> Figure:
    """Return the silhouette, and the bones of all particles after some iterations.

    The best particle is coloured.
    """
    scene = swarm.scene
    shown = [k for k in SHOWN_ITERATIONS if k < len(swarm.poses)]
    camera = scene.cameras[0]
    mask = scene.observations[0].silhouettes[0].mask
    figure = Figure(figsize=(12.5, 3.1), layout="constrained")
    panels: Any = figure.subplots(1, 1 + len(shown), squeeze=False)[0]
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    side = 0.62 * max(np.ptp(rows), np.ptp(columns))
    extent = 0, mask.shape[1], mask.shape[0], 0
    for axes in panels:
        axes.imshow(
            np.where(mask, 0.75, 1.0), cmap="gray", vmin=0.0, vmax=1.0, extent=extent
        )
        axes.set(
            xlim=columns.mean() + np.array([-side, side]),
            ylim=rows.mean() + np.array([side, -side]),
        )
        axes.set(xticks=[], yticks=[])
    panels[0].set_title("silhouette", fontsize=9)
    for axes, k in zip(panels[1:], shown, strict=True):
        pixels = camera.project(
            scene.body.skeleton.joints(swarm.poses[k], swarm.translations[k])
        )[0]
        # their ends, (n, 26, 2, 2)
        bones = np.stack([pixels[:, list(PARENTS[1:])], pixels[:, 1:]], axis=2)
        axes.add_collection(
            LineCollection(
                [*bones.reshape(-1, 2, 2)], colors="black", linewidths=0.5, alpha=0.12
            )
        )
        axes.add_collection(
            LineCollection([*bones[swarm.best[k]]], colors=COLOURS[1], linewidths=1.4)
        )
        axes.set_title(
            f"iteration {k}, N = {len(bones)}\n"
            f"lowest cost so far {swarm.history[k]:.1f}",
            fontsize=9,
        )
    return figure


def lowest_cost_figure(analysis: Analysis) -> Figure:
    """Return the lowest cost by iteration in the first frame, for each N.

    Lines are medians over views and seeds.
    """
    figure, panels = _panels((10.0, 3.8), 1, len(MOTIONS), sharey=True)
    for axes, motion in zip(panels, MOTIONS, strict=True):
        for name, style in ((OURS, "-"), (LETTER, ":")):
            histories = analysis.results.of("history", "first", motion, name)
            for k, count in enumerate(SWARMS):
                middle = np.median(histories[:, :, k], axis=(0, 1))
                label = f"N = {count}" + " letter" * (style == ":")
                axes.plot(middle, style, color=COLOURS[k], linewidth=1.3, label=label)
        axes.axvline(CONVERGED, color=_DIM, linewidth=0.8, linestyle=":")
        runs = histories.shape[0] * histories.shape[1]
        axes.set(xlabel="iteration", ylim=(0.0, None))
        axes.set_title(f"{LABELS[motion]}, first frame, {runs} runs", fontsize=9)
    panels[0].set_ylabel("lowest cost")
    panels[-1].legend(ncols=2, **_LEGEND)
    return figure


def dimension_figure(analysis: Analysis) -> Figure:
    """Return the error of each angle in single images from eight views.

    Shown are PCA + SAPSO, its letter and the mean pose.
    """
    names = ["root", *(JOINTS[joint] for joint in INNER)]
    figure, panels = _panels((12.0, 7.5), len(analysis.motions), sharex=True)
    for axes, motion in zip(panels, analysis.motions, strict=True):
        for name, kind, style in ((LETTER, "image", "x"), ("mean_pose", "track", "_")):
            away = analysis.away(motion, name, kind).mean(axis=(0, 1, 2))
            label = METHODS[name] + ", true root" * (kind == "track")
            axes.plot(
                away,
                style,
                color=COLOURS[1 + (kind == "track")],
                markersize=5,
                label=label,
            )
        ours = analysis.away(motion, OURS, "image").mean(axis=(0, 1, 2))
        axes.bar(np.arange(len(ours)), ours, color=COLOURS[0], label=METHODS[OURS])
        axes.axhline(SMALL_DEGREES, color=_DIM, linewidth=0.8, linestyle=":")
        axes.set(ylabel="degrees", xlim=(-1, len(ours)), ylim=(0.0, 25.0))
        axes.set_title(LABELS[motion], fontsize=9)
        for k in range(3, len(ours), 3):
            axes.axvline(k - 0.5, color="0.92", linewidth=0.8, zorder=0)
    panels[0].legend(**_LEGEND)
    panels[-1].set_xticks(
        3 * np.arange(len(names)) + 1, names, rotation=60, ha="right", fontsize=8
    )
    panels[-1].tick_params(axis="x", length=0)
    return figure


def frame_figure(analysis: Analysis) -> Figure:
    """Return the errors of the paper's methods and the letter by frame.

    Lines are medians of all runs, and bands their middle halves.
    """
    figure, panels = _panels((10.0, 6.4), len(MOTIONS))
    for axes, motion in zip(panels, MOTIONS, strict=True):
        for name, colour in zip(
            (*PAPER, LETTER), (*COLOURS[1::-1], *COLOURS[2:4]), strict=True
        ):
            errors = analysis.away(motion, name).mean(axis=3)
            low, middle, high = np.quantile(
                errors.reshape(-1, errors.shape[2]), [0.25, 0.5, 0.75], axis=0
            )
            axes.plot(middle, color=colour, linewidth=1.3, label=METHODS[name])
            axes.fill_between(
                np.arange(len(middle)), low, high, color=colour, alpha=0.15, linewidth=0
            )
        mean = analysis.away(motion, "mean_pose").mean(axis=3)[0, 0]
        axes.plot(
            mean,
            color=_DIM,
            linewidth=1.0,
            linestyle="--",
            label="mean training pose, true root",
        )
        axes.set(ylabel="error, degrees", ylim=(0.0, None), xlim=(0, len(mean) - 1))
        axes.set_title(LABELS[motion], fontsize=9)
    panels[0].legend(ncols=3, **_LEGEND)
    panels[-1].set_xlabel("frame")
    return figure


def _panels(
    size: tuple[float, float], rows: int, columns: int = 1, **shared: Any
) -> tuple[Figure, Any]:
    """Return a figure of a size in inches, and its axes without top and right."""
    figure = Figure(figsize=size, layout="constrained")
    panels: Any = figure.subplots(rows, columns, **shared)
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
    return figure, panels
