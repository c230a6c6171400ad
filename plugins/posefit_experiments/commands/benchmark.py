"""`posefit bench`."""

import click

from posefit.cli.output import json_line, say


@click.command("bench")
@click.option("--threads", type=int, help="How many `all threads` are; by default every core.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--compile", "compiling", is_flag=True, help="Time what compiles for the default sweep instead.")
def bench_command(threads: int | None, as_json: bool, compiling: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run."""
    if compiling:
        _compile(as_json)
        return
    from posefit_experiments.bench.experiment import loop_figures

    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    say("timing; this takes half a minute ...")
    figures = loop_figures(threads)
    if as_json:
        click.echo(json_line(figures))
        return
    for group in ("vector_env", "optimisers", "optimisers_28"):
        figures |= {f"{group}.{name}": value for name, value in figures.pop(group).items()}
    for name, value in figures.items():
        click.echo(f"{name:38} {value:.4g}" if isinstance(value, float) else f"{name:38} {value}")


def _compile(as_json: bool) -> None:
    from posefit_experiments.bench.compiling import compile_figures, compile_lines

    say("compiling everything from an empty cache; this takes up to a minute ...")
    figures = compile_figures()
    for line in [json_line(figures)] if as_json else compile_lines(figures):
        click.echo(line)
