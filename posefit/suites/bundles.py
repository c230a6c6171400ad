"""Bundles: runs on a suite in one file, with the points that every improvement can be evaluated again at.

manifest.json     the suite, the methods, the runs, and the digest of all that
evaluations.npy   (n,) int64: after how many evaluations the cost fell, the runs' improvements one after the other
costs.npy         (n,) float64: to which cost
points.npy        float64: at which point, the d coordinates of each improvement one after the other
"""

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.archive import array_of, unpacked
from posefit.errors import InputError
from posefit.files import new_file
from posefit.fitting.check import whole
from posefit.reading import cut, parsed_json, quoted
from posefit.suites.functions import HELD_OUT
from posefit.suites.running import SuiteRun

FORMAT = 1
MAX_BYTES = 500_000_000  # unpacked
MAX_NUMBER = 2**53  # of a run, but for its seed: floats have it exactly
MANIFEST = "manifest.json"
TYPES = {"costs": "<f8", "evaluations": "<i8", "points": "<f8"}  # of the arrays
FIELDS = ("digest", "format", "methods", "runs", "suite")  # of the manifest
METHOD_FIELDS = ("infeasible", "method", "settings", "version")
RUN_FIELDS = ("budget", "dimension", "evaluations", "function", "improvements", "instance", "method", "seed")
_DATE = (2000, 1, 1, 0, 0, 0)  # of the files, so that the same runs make the same bytes

Manifest = dict[str, Any]
Arrays = Mapping[str, NDArray[Any]]


def write_bundle(runs: Sequence[SuiteRun], path: str | Path) -> str:
    """Write runs on one suite to a new file, and return its digest.

    Runs are of `run_on`, of `run_of` after any loop, or of `posefit.sweep.table.search_runs`. Raises ValueError where
    there is none, where they are of several suites, where one has no points or comes twice, or where the file exists.
    """
    if len(suites := {run.suite for run in runs}) != 1:
        raise InputError(f"runs must be of one suite, got {', '.join(sorted(suites)) or 'none'}")
    numbers = {text: k for k, text in enumerate(sorted({method_text(run) for run in runs}))}
    order = sorted(runs, key=lambda run: (numbers[method_text(run)], *_place(run)))
    listed = []
    for k, run in enumerate(order):
        if run.points is None or not len(run.points):
            raise InputError(f"{label(run)}: expected the points of its improvements, got none: search again")
        if run.instance not in HELD_OUT:
            raise InputError(f"{label(run)}: expected instances that are held out, from {HELD_OUT[0]} on")
        if k and _place(order[k - 1]) == _place(run) and method_text(order[k - 1]) == method_text(run):
            raise InputError(f"{label(run)}: expected each run once, got it twice")
        entry = {"method": numbers[method_text(run)]}
        entry |= {name: getattr(run, name) for name in ("function", "dimension", "instance", "seed", "budget")}
        listed.append({**entry, "evaluations": int(run.evaluations[-1]), "improvements": len(run.points)})
    methods = [json.loads(text) for text in numbers]
    manifest: Manifest = {"format": FORMAT, "suite": suites.pop(), "methods": methods, "runs": listed}
    arrays = {
        "costs": np.concatenate([run.costs[: len(run.points)] for run in order if run.points is not None]),
        "evaluations": np.concatenate([run.evaluations[: len(run.points)] for run in order if run.points is not None]),
        "points": np.concatenate([run.points.ravel() for run in order if run.points is not None]),
    }
    arrays = {name: np.ascontiguousarray(array, dtype=TYPES[name]) for name, array in arrays.items()}
    manifest["digest"] = digest = digest_of(manifest, arrays)
    with new_file(path) as building, zipfile.ZipFile(building, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        text = json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False)
        archive.writestr(zipfile.ZipInfo(MANIFEST, _DATE), text, zipfile.ZIP_DEFLATED)
        for name, array in sorted(arrays.items()):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array, version=(1, 0), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", _DATE), buffer.getvalue(), zipfile.ZIP_DEFLATED)
    return digest


def read_contents(path: str | Path) -> tuple[Manifest, Arrays]:
    """Return the manifest and the arrays of a bundle, as far as their form and the digest are right.

    Raises InputError where they are not: nothing that a run claims is checked here.
    """
    files = unpacked(Path(path), "a bundle of runs", MAX_BYTES)
    if wrong := {MANIFEST, *(f"{name}.npy" for name in TYPES)} ^ files.keys():
        first = min(wrong)
        raise InputError(
            f"a bundle must hold {MANIFEST} and {', '.join(f'{name}.npy' for name in TYPES)}, got "
            f"{f'one called {quoted(first)}' if first in files else f'no {first}'}"
        )
    try:
        manifest = parsed_json(files[MANIFEST])
    except ValueError as error:
        raise InputError(f"{MANIFEST} must be JSON, got {cut(str(error))}") from None
    _check_fields(MANIFEST, manifest, FIELDS)
    if manifest["format"] != FORMAT:
        raise InputError(f"format must be {FORMAT}, got {quoted(manifest['format'])}")
    arrays = {name: array_of(f"{name}.npy", files[f"{name}.npy"]) for name in TYPES}
    for name, array in arrays.items():
        if array.dtype.str != TYPES[name] or array.ndim != 1:
            raise InputError(
                f"{name}.npy must have shape (n,) and type {TYPES[name]}, got {array.shape}, {array.dtype}"
            )
        if not np.isfinite(array).all():
            raise InputError(f"{name}.npy must hold finite numbers, got nan or infinity")
    digest = digest_of({name: value for name, value in manifest.items() if name != "digest"}, arrays)
    if manifest["digest"] != digest:
        raise InputError(f"digest must be that of the contents, {digest[:12]}, got {quoted(manifest['digest'])}")
    _check_manifest(manifest, arrays)
    return manifest, arrays


def _check_manifest(manifest: Manifest, arrays: Arrays) -> None:
    """Raise InputError where methods and runs have another form, or are not as many numbers as the arrays hold."""
    for name, fields in (("methods", METHOD_FIELDS), ("runs", RUN_FIELDS)):
        if not isinstance(manifest[name], list) or not manifest[name]:
            raise InputError(f"{name} must be a list of one or more, got {quoted(manifest[name])}")
        for k, entry in enumerate(manifest[name]):
            _check_fields(f"{name}[{k}]", entry, fields)
    for entry in manifest["methods"]:
        if not all(isinstance(entry[name], str) for name in ("method", "version")):
            raise InputError(f"a method and its version must be texts, got {quoted(entry)}")
        if not isinstance(entry["settings"], dict):
            raise InputError(f"settings must be values by their names, got {quoted(entry['settings'])}")
    texts = [_canonical(entry) for entry in manifest["methods"]]
    if len(set(texts)) < len(texts):
        raise InputError("methods must be listed once each, got one twice")
    for entry in manifest["runs"]:
        for name in RUN_FIELDS:
            number = whole(
                name, entry[name], 1 if name in ("budget", "dimension", "evaluations", "improvements") else 0
            )
            if number > MAX_NUMBER and name != "seed":
                raise InputError(f"{name} must be at most {MAX_NUMBER}, got {quoted(number)}")
        if entry["method"] >= len(texts):
            raise InputError(f"method of a run must be 0 to {len(texts) - 1}, got {entry['method']}")
    steps = sum(entry["improvements"] for entry in manifest["runs"])
    coordinates = sum(entry["improvements"] * entry["dimension"] for entry in manifest["runs"])
    for name, count in (("costs", steps), ("evaluations", steps), ("points", coordinates)):
        if len(arrays[name]) != count:
            raise InputError(f"{name}.npy must hold {count} numbers, as the runs say, got {len(arrays[name])}")


def _check_fields(what: str, value: Any, fields: Sequence[str]) -> None:
    if not isinstance(value, dict) or sorted(value) != sorted(fields):
        raise InputError(f"{what} must have the fields {', '.join(fields)}, got {quoted(value)}")


def digest_of(manifest: Manifest, arrays: Arrays) -> str:
    """Return the SHA-256 of a manifest without its digest, and of its arrays: 64 hexadecimal digits.

    It is of the manifest as JSON with sorted keys, without blanks, in UTF-8; then, for each array by name, of its name,
    a zero byte and its numbers.
    """
    digest = hashlib.sha256(_canonical(manifest).encode())
    for name, array in sorted(arrays.items()):
        digest.update(f"{name}\0".encode() + array.tobytes())
    return digest.hexdigest()


def label(run: SuiteRun) -> str:
    """Return how a message names a run."""
    return f"{run.method} on f{run.function} in {run.dimension}D, instance {run.instance}, seed {run.seed}"


def _place(run: SuiteRun) -> tuple[int, ...]:
    """Return what makes a run of a method: two with the same are one that comes twice."""
    return run.function, run.dimension, run.instance, run.seed, run.budget


def method_text(run: SuiteRun) -> str:
    """Return the one text of what makes a method: its name, settings, version and way with infeasible proposals."""
    fields = {"method": run.method, "settings": run.settings, "version": run.version, "infeasible": run.infeasible}
    return _canonical(fields)


def _canonical(value: Any) -> str:
    try:
        text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        text.encode()  # half of a character that takes two raises
        return text
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"a bundle must hold finite numbers and texts, got {cut(str(error))}") from None
