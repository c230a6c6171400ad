"""A page's tables are those of the folder that `posefit reproduce` wrote, and nothing else of it changes."""

from pathlib import Path

import pytest
from click.testing import CliRunner

import reproduced_pages


def test_a_page_gets_the_tables_and_pictures_of_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("docs/measured", "docs/pictures", "out"):
        (tmp_path / folder).mkdir(parents=True)
    page = tmp_path / "docs" / "measured" / "sapso.md"
    out = tmp_path / "out"
    for other in ("patent.md", "related.md"):
        (tmp_path / "docs" / "measured" / other).write_text("Nothing of it.\n")
    before = "Words.\n\n<!-- sapso: parts -->\nold\n<!-- end -->\n\n<!-- vsmm: parts -->\n<!-- end -->\n"
    page.write_text(f"{before}![A swarm](../pictures/sapso-figure-5.png)\n")
    (out / "parts.md").write_text("| a |\n|---|\n| 1 |\n")
    (out / "figure-5.png").write_bytes(b"picture")
    monkeypatch.setattr(reproduced_pages, "DOCS", tmp_path / "docs")
    for _ in range(2):
        assert (
            CliRunner().invoke(reproduced_pages.main, [f"sapso={out}"]).exit_code == 0
        )
        assert page.read_text() == (
            "Words.\n\n<!-- sapso: parts -->\n\n| a |\n|---|\n| 1 |\n\n<!-- end -->\n\n"
            "<!-- vsmm: parts -->\n<!-- end -->\n![A swarm](../pictures/sapso-figure-5.png)\n"
        )
    assert (
        tmp_path / "docs" / "pictures" / "sapso-figure-5.png"
    ).read_bytes() == b"picture"
    (out / "parts.md").unlink()
    result = CliRunner().invoke(reproduced_pages.main, [f"sapso={out}"])
    assert result.exit_code == 2
    assert (
        "parts.md: expected a table of posefit reproduce or a study, got none"
        in result.output
    )
