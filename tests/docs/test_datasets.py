"""The data sets that a study writes for others: whole, and described as their readers want."""

import csv
import hashlib
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import make_datasets
from posefit.motion import recorded
from posefit.suites.functions import FUNCTIONS


@pytest.fixture(scope="module")
def datasets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("written") / "datasets"
    words = ["--out", str(path), "--date", "2026-11-28"]
    result = CliRunner().invoke(make_datasets.main, words)
    assert result.exit_code == 0, result.output
    return path


@pytest.mark.parametrize("name", ["motions", "suite"])
def test_metadata_describe_every_file(datasets: Path, name: str) -> None:
    folder = datasets / name
    described = json.loads((folder / "croissant.json").read_text("utf-8"))
    files = {entry["contentUrl"]: entry for entry in described["distribution"]}
    assert {*files, "croissant.json", "README.md"} == {
        path.name for path in folder.iterdir()
    }
    for file, entry in files.items():
        content = (folder / file).read_bytes()
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
    (records,) = described["recordSet"]
    with (folder / f"{records['name']}.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    assert [field["name"] for field in records["field"]] == list(rows[0])
    assert (
        len(rows)
        == {
            "motions": len(recorded.clips()),
            "suite": len(FUNCTIONS),
        }[name]
    )


@pytest.mark.parametrize("name", ["motions", "suite"])
@pytest.mark.filterwarnings("ignore")  # of libraries that mlcroissant needs
def test_mlcroissant_reads_the_records(datasets: Path, name: str) -> None:
    mlcroissant = pytest.importorskip("mlcroissant", reason="it is in no extra")
    read = mlcroissant.Dataset(jsonld=str(datasets / name / "croissant.json"))
    assert not read.metadata.issues.errors
    records = list(read.records(read.metadata.record_sets[0].uuid))
    assert (
        len(records)
        == {
            "motions": len(recorded.clips()),
            "suite": len(FUNCTIONS),
        }[name]
    )
