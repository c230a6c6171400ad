"""`posefit bench`."""

from collections.abc import Iterator, Mapping
from typing import Any

import click

from posefit.cli.output import json_line, say
from posefit.errors import InputError


@click.command("bench")
@click.option("--threads", type=click.IntRange(1), help="Threads of the multi-threaded figures; by default every core.")
@click.option("--follow", type=click.IntRange(1), metavar="FRAMES", help="Time the tracker of the library instead.")
@click.option("--device", type=click.Choice(["cuda"]), help="Time a GPU beside the CPU instead, and compare counts.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def bench_command(threads: int | None, follow: int | None, device: str | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run.

    `cpu` names the processor that the loops are compiled for and the instructions it has. It is this machine's, or the
    one that the environment variable NUMBA_CPU_NAME names: x86-64-v3 has AVX2 and no AVX-512, x86-64-v2 has SSE4.
    """
    from posefit.silhouette.cuda.device import check_device
    from posefit_reproduce.bench.processor import check_named

    chosen = {"--threads": threads, "--follow": follow, "--device": device}
    options = [name for name, value in chosen.items() if value is not None]
    if len(options) > 1:
        raise InputError(f"bench must have one of --threads, --follow and --device, got {' and '.join(options)}")
    check_named()
    if device is not None:
        check_device(device)
    figures, lines = _timed(threads, follow, device)
    click.echo(json_line(figures) if as_json else "\n".join(lines))


def _timed(threads: int | None, follow: int | None, device: str | None) -> tuple[dict[str, Any], Iterator[str]]:
    """Return the figures, and the lines that show them."""
    if follow is not None:
        from posefit_reproduce.bench.follow import follow_figures

        say(f"following a person for {follow:,} frames; a thousand take one or two minutes ...")
        followed = follow_figures(follow)
        return dict(followed), (f"{name:12} {round(value, 3):,g}" for name, value in followed.items())
    if device is not None:
        from posefit_reproduce.bench.device import device_figures, device_lines

        say("timing the GPU beside the CPU; this takes a minute or more ...")
        figures = device_figures(device)
        return figures, device_lines(figures)
    from posefit_reproduce.bench.experiment import loop_figures

    say("timing; this takes half a minute ...")
    figures = loop_figures(threads)
    named = _named(figures)
    return figures, (
        f"{name:38} {value:.4g}" if isinstance(value, float) else f"{name:38} {value}" for name, value in named
    )


def _named(figures: Mapping[str, Any], group: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every figure with its name, those of a group as `group.name`."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _named(value, f"{group}{name}.")
        else:
            yield f"{group}{name}", value
