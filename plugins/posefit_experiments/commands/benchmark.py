"""`posefit bench`."""

import json

import click

from posefit.cli.output import say


@click.command("bench")
@click.option("--threads", type=int, help="How many `all threads` are; by default every core.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench_command(threads: int | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run."""
    from posefit_experiments.bench.experiment import loop_figures

    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    say("timing; this takes half a minute ...")
    figures = loop_figures(threads)
    if as_json:
        click.echo(json.dumps(figures))
        return
    parts = figures["frame"].items()
    figures["frame"] = {f"{name}.{key}": value for name, profile in parts for key, value in profile.items()}
    for group in ("vector_env", "optimisers", "optimisers_28", "frame"):
        figures |= {f"{group}.{name}": value for name, value in figures.pop(group).items()}
    for name, value in figures.items():
        click.echo(f"{name:38} {value:.4g}" if isinstance(value, float) else f"{name:38} {value}")
