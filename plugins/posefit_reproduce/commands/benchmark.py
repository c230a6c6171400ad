"""`posefit bench`."""

from collections.abc import Iterator, Mapping
from typing import Any

import click

from posefit.cli.output import json_line, say
from posefit.errors import InputError


@click.command("bench")
@click.option("--threads", type=click.IntRange(1), help="Threads of the multi-threaded figures; by default every core.")
@click.option("--device", type=click.Choice(["cuda"]), help="Time a GPU beside the CPU instead, and compare counts.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def bench_command(threads: int | None, device: str | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run.

    `cpu` names the processor that the loops are compiled for and the instructions it has. It is this machine's, or the
    one that the environment variable NUMBA_CPU_NAME names: x86-64-v3 has AVX2 and no AVX-512, x86-64-v2 has SSE4.
    """
    from posefit.silhouette.cuda.device import check_device
    from posefit_reproduce.bench.processor import check_named

    if None not in (threads, device):
        raise InputError("bench must have --threads or --device, got both")
    check_named()
    if device is None:
        from posefit_reproduce.bench.experiment import loop_figures

        say("timing; this takes half a minute ...")
        figures = loop_figures(threads)
        lines = _named_lines(figures)
    else:
        from posefit_reproduce.bench.device import device_figures, device_lines

        check_device(device)
        say("timing the GPU beside the CPU; this takes a minute or more ...")
        figures = device_figures(device)
        lines = device_lines(figures)
    click.echo(json_line(figures) if as_json else "\n".join(lines))


def _named_lines(figures: Mapping[str, Any], group: str = "") -> Iterator[str]:
    """Yield every figure with its name, those of a group as `group.name`."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _named_lines(value, f"{group}{name}.")
        else:
            yield f"{group + name:38} " + (f"{value:.4g}" if isinstance(value, float) else str(value))
