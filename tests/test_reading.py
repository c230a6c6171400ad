"""What a stranger's text may do, and what it may not."""

import os

import pytest

from posefit.errors import InputError
from posefit.reading import SHOWN, cut, parsed_json, parsed_toml, quoted, read_text
from tests.cases import each


def test_a_quoted_value_is_cut_at_80_characters():
    assert quoted("walk") == "'walk'"
    assert len(quoted("n" * 10_000)) == SHOWN == 80
    assert quoted("n" * 10_000).endswith("...")
    assert cut("\0" * 80) == r"\x00" * 19 + r"\..."
    # Python writes 4,300 digits at most
    assert quoted(16**5000) == "one int that is too long to write"


def test_a_message_is_reported_in_one_line_that_leaves_the_terminal_alone():
    assert (
        str(InputError("a" * 200 + "b" * 200 + ": bad"))
        == "a" * 38 + "..." + "b" * 38 + ":" + " bad"
    )
    assert (
        str(InputError("a\nb\x1b[31m\x9b\u202ec é 人: bad"))
        == r"a\nb\x1b[31m\x9b\u202ec é 人: bad"
    )


def test_a_byte_order_mark_is_no_part_of_a_text(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1")
    assert read_text(path, 100) == "a = 1"


def test_a_text_that_is_too_large_or_no_utf_8_is_named(tmp_path):
    path = tmp_path / "a.toml"
    pipe = tmp_path / "pipe"
    path.write_bytes(b"a = \xff")
    os.mkfifo(pipe)
    for place, most, message in (
        (path, 100, "a.toml: expected text in UTF-8, got byte 0xff"),
        (path, 1, "a.toml: expected at most 1e-06 MB, got 0.0 MB"),
        (pipe, 100, "expected a file that can be read, got a pipe or a device"),
        (tmp_path, 1_000_000, "expected a file that can be read, got a folder"),
    ):
        with pytest.raises(ValueError, match=message):
            read_text(place, most)


@each(
    ("parse", "text"),
    [
        # tomllib takes memory as the square of the parts
        (parsed_toml, ".".join("a" * 100_000) + " = 1"),
        (
            parsed_toml,
            "\n".join(f"k{k}." + ".".join("a" * 900) + " = 1" for k in range(1000)),
        ),
        (parsed_toml, "a = " + "[" * 100_000),
        (parsed_json, "[" * 1_000_000),
    ],
)
def test_keys_of_very_many_parts_and_brackets_without_end_are_refused(parse, text):
    with pytest.raises(ValueError, match="less deeply nested"):
        parse(text)


def test_a_long_list_of_numbers_is_read():
    assert len(parsed_toml(f"a = [{', '.join(['0.5'] * 5_000)}]")["a"]) == 5_000
