"""What a stranger's text may do, and what it may not."""

import pytest

from posefit.reading import SHOWN, parsed_json, parsed_toml, quoted, read_text


def test_what_a_message_quotes_is_cut_at_80_characters():
    assert quoted("walk") == "'walk'"
    assert len(quoted("n" * 10_000)) == SHOWN == 80
    assert quoted("n" * 10_000).endswith("...")
    assert quoted(16**5000) == "one int that is too long to write"  # Python writes 4,300 digits at most


def test_a_byte_order_mark_is_no_part_of_a_text(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1")
    assert read_text(path, 100) == "a = 1"


def test_a_text_that_is_too_large_or_no_utf_8_is_named(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"a = \xff")
    with pytest.raises(ValueError, match="a.toml: expected text in UTF-8, got byte 0xff"):
        read_text(path, 100)
    with pytest.raises(ValueError, match="a.toml: expected at most 1e-06 MB, got 0.0 MB"):
        read_text(path, 1)
    with pytest.raises(ValueError, match="expected a file that can be read, got Is a directory"):
        read_text(tmp_path, 1_000_000)


def test_a_key_of_very_many_parts_is_refused_as_reading_it_takes_memory_as_their_square():
    # 100,000 parts, 200 kB, took more than 20 GB
    with pytest.raises(ValueError, match="keys that are not nested so deeply, got 99999 dots in line 1"):
        parsed_toml(".".join("a" * 100_000) + " = 1")
    with pytest.raises(ValueError, match="keys that are not nested so deeply"):
        parsed_toml("\n".join(f"k{k}." + ".".join("a" * 900) + " = 1" for k in range(1000)))
    numbers = ", ".join(["0.5"] * 5_000)
    assert len(parsed_toml(f"a = [{numbers}]")["a"]) == 5_000


def test_brackets_without_end_are_refused():
    with pytest.raises(ValueError, match="not nested so deeply"):
        parsed_toml("a = " + "[" * 100_000)
    with pytest.raises(ValueError, match="not nested so deeply"):
        parsed_json("[" * 1_000_000)
