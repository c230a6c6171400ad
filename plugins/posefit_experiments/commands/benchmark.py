"""`posefit bench`."""

import tempfile
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from posefit.cli.output import json_line, say


@click.command("bench")
@click.option("--threads", type=int, help="How many `all threads` are; by default every core.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--growth", is_flag=True, help="Time how a pose's cost grows with size, poses, views and dimensions.")
@click.option("--pictures", metavar="DIR", help="With --growth: write a figure of each, growth-*.png, to DIR.")
@click.option("--compile", "compiling", is_flag=True, help="Time what compiles for the default sweep instead.")
@click.option("--follow", type=int, metavar="FRAMES", help="Time and weigh the tracker of the library instead.")
@click.option("--device", metavar="cuda", help="Time a GPU beside the CPU instead, and compare what they count.")
def bench_command(
    threads: int | None,
    as_json: bool,
    growth: bool,
    pictures: str | None,
    compiling: bool,
    follow: int | None,
    device: str | None,
) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run.

    `cpu` tells for which processor the loops are compiled, and which instructions it has. It is this machine's, or the
    one that the environment variable NUMBA_CPU_NAME names: x86-64-v3 has AVX2 and no AVX-512, x86-64-v2 has SSE4.
    """
    _check(threads, growth, pictures, compiling, follow)
    _check_device(device, {"growth": growth, "compile": compiling, "follow": follow is not None, "threads": threads})
    if growth:
        _growth(as_json, pictures)
        return
    if compiling:
        _compile(as_json)
        return
    if follow is not None:
        _follow(as_json, follow)
        return
    if device is not None:
        _device(as_json, device)
        return
    from posefit_experiments.bench.experiment import loop_figures

    say("timing; this takes half a minute ...")
    figures = loop_figures(threads)
    if as_json:
        click.echo(json_line(figures))
        return
    for name, value in _named(figures):
        click.echo(f"{name:38} {value:.4g}" if isinstance(value, float) else f"{name:38} {value}")


def _check(threads: int | None, growth: bool, pictures: str | None, compiling: bool, follow: int | None) -> None:
    """Return nothing. Raises ValueError for options that do not go together, and for a processor that LLVM lacks."""
    from posefit_experiments.bench.processor import check_named

    if growth and compiling:
        raise ValueError("growth and compile must not both be given, got --growth --compile")
    if follow is not None and (growth or compiling):
        raise ValueError(
            f"follow must not be given beside {'--growth' if growth else '--compile'}, got --follow {follow}"
        )
    if follow is not None and follow < 1:
        raise ValueError(f"follow must be at least 1 frame, got {follow}")
    if pictures is not None and not growth:
        raise ValueError("pictures are of --growth, got --pictures without it")
    if threads is not None and (growth or compiling or follow is not None):
        other = "--growth" if growth else "--compile" if compiling else "--follow"
        raise ValueError(f"threads must not be given beside {other}, which has one, got --threads {threads}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    check_named()


def _check_device(device: str | None, others: Mapping[str, Any]) -> None:
    """Return nothing. Raises ValueError where no GPU can be timed, or something else is to be timed as well."""
    from posefit.silhouette.cuda.device import check_device

    if device is None:
        return
    if beside := next((name for name, given in others.items() if given), None):
        raise ValueError(f"device must not be given beside --{beside}, got --device {device}")
    if device == "cpu":
        raise ValueError("device must be cuda, which is timed beside the CPU, got 'cpu'")
    check_device(device)


def _named(figures: Mapping[str, Any], group: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every figure with its name, those of a group as `group.name`."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _named(value, f"{group}{name}.")
        else:
            yield f"{group}{name}", value


def _growth(as_json: bool, pictures: str | None) -> None:
    from posefit_experiments.bench.growth import draw_growths, growth_table, growths

    if pictures is not None and find_spec("matplotlib") is None:
        raise ImportError("the figures need the library matplotlib: pip install posefit[figures]")
    if pictures is not None:
        _check_folder(Path(pictures))
    say("timing; this takes half a minute ...")
    found = growths()
    told = {one.name: dict(zip(one.labels, one.us, strict=True)) for one in found}
    click.echo(json_line(told) if as_json else growth_table(found))
    if pictures is not None:
        for path in draw_growths(found, Path(pictures)):
            say(f"{path}")


def _check_folder(folder: Path) -> None:
    """Make a folder. Raises ValueError where it cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise ValueError(f"{folder}: expected a folder that can be written to, got {error.strerror}") from None


def _compile(as_json: bool) -> None:
    from posefit_experiments.bench.compiling import compile_figures, compile_lines

    say("compiling everything from an empty cache; this takes up to a minute ...")
    figures = compile_figures()
    for line in [json_line(figures)] if as_json else compile_lines(figures):
        click.echo(line)


def _follow(as_json: bool, frames: int) -> None:
    from posefit_experiments.bench.follow import follow_figures

    say(f"following somebody for {frames:,} frames; a thousand take one or two minutes ...")
    figures = follow_figures(frames)
    click.echo(
        json_line(figures)
        if as_json
        else "\n".join(f"{name:12} {round(value, 3):,g}" for name, value in figures.items())
    )


def _device(as_json: bool, device: str) -> None:
    from posefit_experiments.bench.device import device_figures, device_lines

    say("timing the GPU beside the CPU; this takes a minute or more ...")
    figures = device_figures(device)
    for line in [json_line(figures)] if as_json else device_lines(figures):
        click.echo(line)
