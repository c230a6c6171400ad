"""What vsmm says that people do, in recorded clips: `python docs/studies/activities.py`.

None of these people is one that a motion model was fitted to. The first yaw is known, the body exact, the silhouettes
clean. A row is what the person does, a column the share of its frames with a label. Some do what no model knows; they
count neither for the accuracy nor for chance, which always says the commonest activity.
"""

from collections import Counter
from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import click

import posefit
from make_models import TEACHINGS
from posefit_reproduce.jobs import each
from table import WORKERS, bar, markdown, percent

LABELS = ("walk", "arms-out", "jacks", "jump", "squat")
VIEWS = (0.0, 45.0, 90.0)  # degrees from the front


class Excerpt(NamedTuple):
    """A part of a recorded clip."""

    name: str
    start: int
    stop: int


EXCERPTS: Mapping[str, tuple[Excerpt, ...]] = {
    "walk": (Excerpt("09_12", 0, 150), Excerpt("29_01", 0, 150)),
    "jacks": (Excerpt("14_06", 10, 110), Excerpt("14_14", 10, 110), Excerpt("14_20", 6, 110)),
    "jump": (Excerpt("14_09", 555, 660),),
    "squat": (Excerpt("14_06", 260, 385), Excerpt("14_14", 270, 395)),
    "run": (Excerpt("09_01", 0, 37), Excerpt("09_11", 0, 42), Excerpt("127_06", 0, 44)),
    "sit down": (Excerpt("14_30", 20, 150), Excerpt("14_31", 30, 150)),
    "box": (Excerpt("14_02", 0, 150),),
}


def labels(excerpt: Excerpt, method: str, view: float, seed: int) -> Counter[str | None]:
    """Return how many frames of a tracked excerpt have each label."""
    track = posefit.track(
        excerpt.name,
        method=method,
        frames=(excerpt.start, excerpt.stop),
        view_degrees=view,
        seed=seed,
        translation="aligned",
        train=["walk"],  # the baselines' only: the models were fitted before
    )
    return Counter(track.activity)


@click.command()
@click.option("--method", multiple=True, default=("vsmm", "vsmm:patent"), show_default=True)
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True)
@WORKERS
def main(method: tuple[str, ...], seeds: int, workers: int | None) -> None:
    """Print the table of each method."""
    fitted = {clip.path.partition("/")[0] for teaching in TEACHINGS.values() for clip in teaching.fitted}
    assert not fitted & {one.name.partition("_")[0] for parts in EXCERPTS.values() for one in parts}
    jobs = {
        (name, activity, one, view, seed): partial(labels, one, name, view, seed)
        for name in method
        for activity, parts in EXCERPTS.items()
        for one in parts
        for view in VIEWS
        for seed in range(seeds)
    }
    counted = each(jobs, workers or 1, bar)
    for name in method:
        counts = {activity: Counter[str | None]() for activity in EXCERPTS}
        for (other, activity, *_), count in counted.items():
            if other == name:
                counts[activity] += count
        known = [activity for activity in EXCERPTS if activity in LABELS]
        total = sum(counts[activity].total() for activity in known)
        right = sum(counts[activity][activity] for activity in known)
        commonest = max(counts[activity].total() for activity in known)
        click.echo(
            f"\n{name}: right in {percent(right / total)} % of frames, by chance {percent(commonest / total)} %\n"
        )
        rows = [
            [activity, *(percent(row[label] / row.total(), 0) for label in LABELS)] for activity, row in counts.items()
        ]
        click.echo("\n".join(markdown(["%", *LABELS], rows)))


if __name__ == "__main__":
    main()
