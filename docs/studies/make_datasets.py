"""Makes data sets to upload: `python docs/studies/make_datasets.py --out DIR`.

DIR/motions has the recorded library, and DIR/suite the numbered benchmark. Each has its
data, a table of them as CSV, Croissant 1.1 metadata (`croissant.json`), which search
engines for data read, and the card from `docs/contributions/datasets`, in the form of
Hugging Face. `mlcroissant validate --jsonld DIR/motions/croissant.json` checks one.
"""

import csv
import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping
from datetime import datetime
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import click

from posefit import __version__
from posefit.cli.output import Command
from posefit.files import new_folder
from posefit.motion import recorded
from posefit.suites.functions import FUNCTIONS, SUITE
from posefit.suites.registry import suite_registry

CARDS = Path(__file__).parents[1] / "contributions" / "datasets"
CITATION = (
    "The posefit developers. posefit: a person's 3D pose from silhouettes, by "
    f"searching. Version {__version__}."
)
# of the Croissant specification, as it has to be in every file
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
TYPES = {str: "sc:Text", int: "sc:Integer", float: "sc:Float", bool: "sc:Boolean"}


def metadata(
    folder: Path,
    formats: Mapping[str, str],
    table: str,
    types: Mapping[str, type],
    **described: Any,
) -> dict[str, Any]:
    """Return the Croissant metadata of a folder's files.

    Args:
        folder: The folder.
        formats: The media type of each file that it describes, by name.
        table: The CSV file whose rows are its records.
        types: The type of each column of the table, the first of which is its key.
        described: Properties of the data set, such as its name.

    Returns:
        The metadata, as values that JSON has.
    """
    distribution = []
    for name, media_type in formats.items():
        content = (folder / name).read_bytes()
        distribution.append(
            {
                "@type": "cr:FileObject",
                "@id": name,
                "name": name,
                "contentUrl": name,
                "contentSize": f"{len(content)} B",
                "encodingFormat": media_type,
                "sha256": hashlib.sha256(content).hexdigest(),
            }
        )
    records = table.partition(".")[0]
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"{records}/{column}",
            "name": column,
            "dataType": TYPES[kind],
            "source": {"fileObject": {"@id": table}, "extract": {"column": column}},
        }
        for column, kind in types.items()
    ]
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.1",
        **described,
        "version": __version__,
        "creator": {"@type": "sc:Organization", "name": "The posefit developers"},
        "citeAs": CITATION,
        "distribution": distribution,
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": records,
                "name": records,
                "key": {"@id": f"{records}/{next(iter(types))}"},
                "field": fields,
            }
        ],
    }


def write_table(path: Path, rows: Iterable[Mapping[str, Any]]) -> dict[str, type]:
    """Write rows with the same columns as a CSV file, and return the columns' types."""
    listed = list(rows)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(listed[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(listed)
    return {name: type(value) for name, value in listed[0].items()}


def write_motions(folder: Path, date: str) -> None:
    """Write the library of recorded motions: the poses, and a table of the clips."""
    with as_file(files("posefit.motion") / "recorded.npz") as packed:
        shutil.copyfile(packed, folder / "recorded.npz")
    clips = recorded.clips()
    types = write_table(
        folder / "clips.csv",
        (
            {
                "name": clip.name,
                "person": f"{recorded.LIBRARY}:{clip.subject}",
                "seconds": round(clip.seconds, 3),
                "poses": len(clip),
            }
            for clip in clips
        ),
    )
    described = {
        "name": "posefit-motions",
        "description": (
            f"{len(clips)} recorded motions of {len(recorded.subjects())} people, as "
            "joint angles: walks, runs, jumps, turns, dances, fights and everyday "
            "motions. Derived from the CMU motion capture database."
        ),
        "url": "http://mocap.cs.cmu.edu",
        "license": "http://mocap.cs.cmu.edu/faqs.php",
        "datePublished": date,
        "keywords": ["motion capture", "3D human pose", "joint angles"],
    }
    formats = {"recorded.npz": "application/zip", "clips.csv": "text/csv"}
    write_json(
        folder / "croissant.json",
        metadata(folder, formats, "clips.csv", types, **described),
    )


def write_suite(folder: Path, date: str) -> None:
    """Write the numbered benchmark: its registry, and a table of its functions."""
    write_json(folder / "suite.json", suite_registry())
    types = write_table(
        folder / "functions.csv",
        (
            {
                "number": function.number,
                "name": function.name,
                "dimensions": " ".join(map(str, function.dimensions)),
                "known_optimum": function.exact,
                "noisy": function.noisy,
                "summary": function.summary,
            }
            for function in FUNCTIONS
        ),
    )
    described = {
        "name": SUITE,
        "description": (
            f"{len(FUNCTIONS)} black-box functions in 9 to 66 dimensions, with 20,000 "
            "instances each: find the pose of a person whose silhouette is given. A "
            "renderer computes each cost, and optima are known."
        ),
        "url": "https://pypi.org/project/posefit/",
        "license": "https://www.apache.org/licenses/LICENSE-2.0",
        "datePublished": date,
        "keywords": [
            "black-box optimisation",
            "benchmark",
            "renderer",
            "3D human pose",
        ],
    }
    formats = {"suite.json": "application/json", "functions.csv": "text/csv"}
    write_json(
        folder / "croissant.json",
        metadata(folder, formats, "functions.csv", types, **described),
    )


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON."""
    path.write_text(json.dumps(value, indent=2) + "\n", encoding="utf-8")


WRITERS = {"motions": write_motions, "suite": write_suite}


@click.command(cls=Command)
@click.option("--out", required=True, metavar="DIR", help="The new folder.")
@click.option(
    "--date",
    required=True,
    type=click.DateTime(["%Y-%m-%d"]),
    metavar="YYYY-MM-DD",
    help="When the data sets are published.",
)
def main(out: str, date: datetime) -> None:
    """Write the data sets with their metadata into the new folder DIR."""
    with new_folder(out) as building:
        for name, write in WRITERS.items():
            folder = building / name
            folder.mkdir()
            shutil.copyfile(CARDS / name / "README.md", folder / "README.md")
            write(folder, f"{date:%Y-%m-%d}")
    print(f"written to {out}: {', '.join(WRITERS)}")


if __name__ == "__main__":
    main()
