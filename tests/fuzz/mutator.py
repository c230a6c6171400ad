"""Changes valid files: bits and bytes, numbers, words, sizes that a header states; with the checksums made right again."""

import io
import random
import re
import struct
import zipfile
import zlib

from tests.fuzz.written import mended

NUMBERS = (
    b"0", b"-1", b"1", b"3", b"2147483648", b"4294967295", b"99999999999999999999", b"1e308", b"-1e308", b"1e400", b"1e-320",
    b"nan", b"inf", b"-0.0", b"0x7fffffff", b"1" * 60, b"1" * 5000, b"16384", b"16385", b"0.5", b"true", b"''",
)  # fmt: skip
WORDS = (
    b"{", b"}", b"[", b"]", b"(", b")", b'"', b"'", b",", b":", b"#", b"\n", b"\r\n", b"\0", b"\xff", b"\xef\xbb\xbf", b"\xe2\x80\xa8",
    b"&a ", b"*a", b"<<: ", b"!!python/object:os.system ", b"!!binary ", b"- ", b"? ", b"---\n", b"%YAML 1.0\n", b"null", b"data: ",
    b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&lt;", b"&b;", b"<![CDATA[", b"]]>", b"<a>", b"</a>", b"\t", b" ", b".", b"..", b"=",
    b"JOINT a", b"End Site", b"Frames: 2147483647", b"Frame Time: 70000000", b"CHANNELS 600", b"begin", b"end", b":root", b"dof rx rx",
    b"rows", b"cols", b"dt", b"object", b"O", b"|O", b"<f8", b"<U999999999", b"'shape': (99999999999,)", b"A" * 300, b"[" * 2000, b"a." * 2000,
)  # fmt: skip
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def mutated(rng: random.Random, content: bytes, suffix: str, other: bytes) -> bytes:
    """Return a file's content, changed in one way or several; `other` is another file's, to take parts of."""
    if suffix == ".npz" and rng.random() < 0.7:
        return _repacked(rng, content)
    if suffix == ".png" and rng.random() < 0.5:
        return _resized(rng, content)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        content = _changed(rng, content, other)
    return mended(content) if suffix == ".jsonl" and rng.random() < 0.8 else content


def _changed(rng: random.Random, content: bytes, other: bytes) -> bytes:
    """Return content with one change."""
    size = len(content)
    start = rng.randrange(size + 1)
    length = min(size - start, int(rng.expovariate(0.05)))
    kind = rng.choice((0, 0, 0, 1, 2, 3, 4, 5, 5, 5, 6, 7, 8))
    if kind == 0 and size:  # a bit
        place = rng.randrange(size)
        return (
            content[:place]
            + bytes([content[place] ^ (1 << rng.randrange(8))])
            + content[place + 1 :]
        )
    if kind == 1:  # cut off
        return content[:start]
    if kind == 2:  # a part is missing
        return content[:start] + content[start + length :]
    if kind == 3:  # a part comes several times
        return (
            content[:start]
            + content[start : start + length] * rng.choice((2, 3, 50))
            + content[start + length :]
        )
    if kind == 4:  # a word
        return (
            content[:start]
            + rng.choice(WORDS)
            + content[start + rng.choice((0, 1, length)) :]
        )
    if kind == 5:  # a number
        numbers = list(_NUMBER.finditer(content[:200_000]))
        if numbers:
            number = rng.choice(numbers)
            return (
                content[: number.start()]
                + rng.choice(NUMBERS)
                + content[number.end() :]
            )
    if kind == 6:  # a part of another file
        begin = rng.randrange(len(other) + 1)
        return (
            content[:start] + other[begin : begin + length] + content[start + length :]
        )
    if kind == 7:  # lines in another order
        lines = content.split(b"\n")
        if len(lines) > 1:
            a = rng.randrange(len(lines))
            b = rng.randrange(len(lines))
            lines[a], lines[b] = lines[b], lines[a]
            return b"\n".join(lines)
    return content[:start] + rng.randbytes(length) + content[start + length :]


def _repacked(rng: random.Random, content: bytes) -> bytes:
    """Return an archive with one of its arrays changed, whose checksum is right."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    name = rng.choice(list(members))
    if rng.random() < 0.1:
        members.pop(name)
    else:
        header = members[name][:128] if rng.random() < 0.7 else members[name]
        members[name] = (
            _changed(rng, header, rng.choice(list(members.values())))
            + members[name][len(header) :]
        )
    buffer = io.BytesIO()
    packed = rng.choice(
        (*[zipfile.ZIP_STORED] * 9, *[zipfile.ZIP_DEFLATED] * 10, zipfile.ZIP_BZIP2)
    )
    with zipfile.ZipFile(buffer, "w", packed) as archive:
        for member, value in members.items():
            archive.writestr(member, value)
    return (
        buffer.getvalue()
        if rng.random() < 0.9
        else _changed(rng, buffer.getvalue(), content)
    )


def _resized(rng: random.Random, content: bytes) -> bytes:
    """Return a PNG file that states another size, colour or depth, whose checksum is right."""
    sides = [
        rng.choice((0, 1, 64, 48, 7000, 20_000, 2**20, 2**31 - 1, 2**32 - 1))
        for _ in range(2)
    ]
    head = struct.pack(
        ">IIBB", *sides, rng.choice((1, 2, 4, 8, 16)), rng.choice((0, 2, 3, 4, 6))
    )
    chunk = b"IHDR" + head + content[26:28] + bytes([rng.choice((0, 1))])
    return content[:12] + chunk + struct.pack(">I", zlib.crc32(chunk)) + content[33:]
