"""Damage to files, by chance but the same for the same seed: bytes, texts, JSON, chunks and tables of fields."""

from __future__ import annotations

import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

Mutation = Callable[[bytes, random.Random], bytes]

LENGTHS = (0, 1, 2, 3, 7, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**24, 2**31 - 1, 2**31, 2**32 - 1)
# fmt: off
NUMBERS: tuple[Any, ...] = (
    0, -1, 1, 2, 255, 65535, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, 2**64, 10**30, 10**400, -(2**63), 0.5, -0.0, 1e-320,
    1e308, -1e308, float("inf"), float("-inf"), float("nan"), 1e9, 1e18, 5126,
)
# fmt: on
# fmt: off
WORDS = ("nan", "inf", "-inf", "1e308", "-1e999", "0", "-1", "1e-320", "2147483648", "9" * 400, "0x10", "1_0", "1,5",
         "٣", "", "true", "null", "\0", "\ufeff", "é", "#", '"', "\\")
# fmt: on
# fmt: off
TEXTS: tuple[str, ...] = (
    "", "x" * 20_000, "\0", "\ud800", "../../../../etc/passwd", "/dev/zero", "a/" * 2000, "%00", "%2e%2e%2f", "data:,",
    "data:image/png;base64,AAAA", "http://localhost/a", "\x1b[2J\n\n", "<svg>", "main.json", "main.glb", "POSITION",
)
# fmt: on


def damaged_bytes(data: bytes, rng: random.Random) -> bytes:
    """One to four changes of any kind to plain bytes."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        _damage(found, rng)
    return bytes(found)


def _damage(data: bytearray, rng: random.Random) -> None:
    kind = rng.randrange(9)
    size = len(data)
    place = rng.randrange(size + 1)
    if rng.random() < 0.5:
        place = min(place, rng.randrange(1, 64))  # heads decide more than bodies
    length = min(rng.choice((1, 2, 4, 8, 16, 64, 512)), size - place)
    if kind == 0 and size:
        data[min(place, size - 1)] ^= 1 << rng.randrange(8)
    elif kind == 1:
        data[place : place + length] = rng.randbytes(length)
    elif kind == 2:
        del data[place:]
    elif kind == 3:
        del data[place : place + length]
    elif kind == 4:
        data[place:place] = data[place : place + length] * rng.choice((1, 2, 50))
    elif kind == 5:
        data[place:place] = rng.randbytes(rng.choice((1, 4, 100)))
    elif kind == 6:
        word = struct.pack(rng.choice(("<I", ">I", "<H", ">H")), rng.choice(LENGTHS) & 0xFFFF)
        if len(word) == 4:
            word = struct.pack(rng.choice(("<I", ">I")), rng.choice(LENGTHS))
        data[place : place + len(word)] = word
    elif kind == 7:
        number = rng.choice((float("nan"), float("inf"), 1e308, -1e308, 0.0, -1.0))
        data[place : place + 8] = struct.pack(rng.choice(("<d", ">d")), number)
    else:
        other = rng.randrange(size + 1)
        data[place : place + length] = data[other : other + length]


def damaged_text(data: bytes, rng: random.Random) -> bytes:
    """One to four changes to numbers, words and lines, and at times to the encoding."""
    text = data.decode("latin-1")
    for _ in range(rng.choice((1, 1, 2, 4))):
        kind = rng.randrange(7)
        lines = text.split("\n")
        row = rng.randrange(len(lines))
        if kind == 0:
            del lines[row]
        elif kind == 1:
            lines[row:row] = [lines[row]] * rng.choice((1, 3, 300))
        elif kind == 2:
            lines[row] = rng.choice(("", " " * 5000, "x" * 20_000, ",".join("1" * 3000), "-" * 70, "\t"))
        elif kind == 3:
            lines[row] = lines[row].replace(*rng.choice(((",", ";"), (",", " "), (".", ","), ("\n", "\r"), (" ", ""))))
        else:
            tokens = list(re.finditer(r"[-+.\w]+", text))
            if tokens:
                token = rng.choice(tokens)
                text = text[: token.start()] + rng.choice(WORDS).replace("٣", "\xd9\xa3") + text[token.end() :]
            continue
        text = "\n".join(lines)
    raw = text.encode("latin-1", "replace")
    coding = rng.randrange(12)
    if coding == 0:
        return text.encode("utf-16", "replace")
    if coding == 1:
        return b"\xef\xbb\xbf" + raw
    return damaged_bytes(raw, rng) if coding == 2 else raw


def _places(value: Any, found: list[tuple[Any, Any]]) -> None:
    """(container, key) of everything in a document."""
    keys: Any = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        found.append((value, key))
        _places(value[key], found)


def _nested(rng: random.Random) -> Any:
    deep = rng.choice((3, 90, 300))
    value: Any = 0
    key = rng.choice(("children", "items", "a", ""))
    for _ in range(deep):
        value = [value] if not key else {key: [value]}
    return value


def _extreme(rng: random.Random) -> Any:
    kind = rng.randrange(8)
    if kind < 3:
        return rng.choice(NUMBERS)
    if kind == 3:
        return rng.choice(TEXTS)
    if kind == 4:
        return _nested(rng)
    return rng.choice((None, True, False, [], {}, [[]], [None], {"": None}, [0, 0, 0], [1e308] * 16, ["x"], [{}]))


def damaged_document(document: Any, rng: random.Random) -> Any:
    """A copy of a JSON document with one to three changes of structure or values."""
    holder = [json.loads(json.dumps(document))]
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        found: list[tuple[Any, Any]] = []
        _places(holder, found)
        where, key = rng.choice(found)
        kind = rng.randrange(9)
        if kind == 0 and len(found) > 1 and where is not holder:
            del where[key]
        elif kind == 1 and isinstance(where, dict):
            where[rng.choice((*where, "", "x", *TEXTS[:3]))] = where.pop(key)
        elif kind == 2 and isinstance(where, list) and where is not holder:
            where[key:key] = [where[key]] * rng.choice((1, 2, 40))
        elif kind == 3:
            other, name = rng.choice(found)
            where[key] = json.loads(json.dumps(other[name]))
        elif kind == 4:
            where[key] = rng.choice(([where[key]], {"a": where[key]}, str(where[key]), [where[key]] * 2))
        elif kind == 5 and isinstance(where[key], int | float) and not isinstance(where[key], bool):
            where[key] = rng.choice((where[key] + 1, where[key] - 1, -where[key], where[key] * 1000, str(where[key])))
        else:
            where[key] = _extreme(rng)
    return holder[0]


def json_text(document: Any, rng: random.Random) -> bytes:
    """A document as text, at times damaged as a text: deeper than `json` itself can write, twice the same key."""
    text = json.dumps(document, ensure_ascii=rng.random() < 0.8).encode("utf-8", "surrogatepass")
    kind = rng.randrange(40)
    if kind == 0:
        return b"[" * rng.choice((500, 100_000)) + text
    if kind == 1:
        deep = rng.choice((1000, 20_000))
        return text[:-1] + b',"deep":' + b'{"a":[' * deep + b"0" + b"]}" * deep + b"}"
    if kind == 2 and text.startswith(b"{"):
        return text[:-1] + b"," + text[1:]
    if kind == 3:
        return b"\xef\xbb\xbf" + text
    if kind == 4:
        return text.decode("utf-8", "replace").encode(rng.choice(("utf-16", "utf-32", "utf-16-be")))
    return text


def damaged_json(data: bytes, rng: random.Random) -> bytes:
    """A JSON file: mostly its structure, at times its bytes."""
    if rng.random() < 0.15:
        return damaged_bytes(data, rng)
    return json_text(damaged_document(json.loads(data), rng), rng)


def damaged_glb(data: bytes, rng: random.Random) -> bytes:
    """A binary glTF: mostly its document within an intact container, else its buffer or any bytes."""
    kind = rng.random()
    if kind < 0.2:
        return damaged_bytes(data, rng)
    size = struct.unpack_from("<I", data, 12)[0]
    text, binary = data[20 : 20 + size], data[28 + size :]
    if kind < 0.35:
        binary = damaged_bytes(binary, rng)
    else:
        text = damaged_json(text, rng)
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def damaged_b3dm(data: bytes, rng: random.Random) -> bytes:
    """A batched 3D model: any bytes, one of its tables, or the glTF in it."""
    kind = rng.random()
    if kind < 0.3:
        return damaged_bytes(data, rng)
    lengths = list(struct.unpack_from("<4I", data, 12))
    ends = [28 + sum(lengths[:n]) for n in range(5)]
    feature, batch, glb = data[28 : ends[1]], data[ends[2] : ends[3]], data[ends[4] :]
    if kind < 0.5:
        feature = damaged_json(feature, rng)
    elif kind < 0.7:
        batch = damaged_json(batch, rng)
    else:
        glb = damaged_glb(glb, rng)
    feature += b" " * (-(28 + len(feature)) % 8)
    batch += b" " * (-len(batch) % 8)
    glb += bytes(-len(glb) % 8)
    total = 28 + len(feature) + len(batch) + len(glb)
    return struct.pack("<4s6I", b"b3dm", 1, total, len(feature), 0, len(batch), 0) + feature + batch + glb


def damaged_png(data: bytes, rng: random.Random) -> bytes:
    """A PNG whose chunks are changed, doubled, moved or packed bombs, their checksums right."""
    if rng.random() < 0.3:
        return damaged_bytes(data, rng)
    chunks, place = [], 8
    while place + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, place)
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + size]))
        place += 12 + size
    index = rng.randrange(len(chunks))
    name, body = chunks[index]
    kind = rng.randrange(6)
    if kind == 0:
        chunks[index] = (name, damaged_bytes(body, rng))
    elif kind == 1:
        chunks.insert(rng.randrange(len(chunks) + 1), (name, body))
    elif kind == 2:
        del chunks[index]
    elif kind == 3:
        head = bytearray(chunks[0][1])
        struct.pack_into(">I", head, rng.choice((0, 4)), rng.choice(LENGTHS))
        chunks[0] = (chunks[0][0], bytes(head))
    elif kind == 4:
        packed = zlib.compress(bytes(3_000_000), 9)
        bomb = rng.choice(
            (
                (b"zTXt", b"k\0\0" + packed),
                (b"iTXt", b"k\0\1\0\0\0" + packed),
                (b"iCCP", b"k\0\0" + packed),
                (b"IDAT", packed),
                (b"tEXt", b"k\0" + b"x" * 100_000),
                (b"eXIf", rng.randbytes(200)),
                (b"acTL", struct.pack(">II", rng.choice(LENGTHS), 0)),
                (b"fcTL", bytes(26)),
                (b"PLTE", bytes(769)),
            )
        )
        chunks.insert(rng.randrange(1, len(chunks)), bomb)
    else:
        head = bytearray(chunks[0][1])
        head[rng.randrange(8, 13)] = rng.choice((0, 1, 2, 3, 4, 6, 8, 16, 255))
        chunks[0] = (chunks[0][0], bytes(head))
    return data[:8] + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in chunks
    )


def damaged_tiff(data: bytes, rng: random.Random) -> bytes:
    """A TIFF whose first directory has other tags, types, counts and values."""
    if rng.random() < 0.3:
        return damaged_bytes(data, rng)
    order = "<" if data[:2] == b"II" else ">"
    found = bytearray(data)
    (start,) = struct.unpack_from(order + "I", data, 4)
    (count,) = struct.unpack_from(order + "H", data, start)
    for _ in range(rng.choice((1, 1, 2, 3))):
        entry = start + 2 + 12 * rng.randrange(count)
        kind = rng.randrange(6)
        if kind == 0:
            tags = (
                254,
                256,
                257,
                258,
                259,
                262,
                273,
                274,
                277,
                278,
                279,
                284,
                317,
                322,
                323,
                324,
                325,
                338,
                339,
                347,
                33550,
                33922,
                34264,
                34665,
                34675,
                34735,
                34736,
                34737,
            )
            struct.pack_into(order + "H", found, entry, rng.choice(tags))
        elif kind == 1:
            struct.pack_into(order + "H", found, entry + 2, rng.randrange(20))
        elif kind == 2:
            struct.pack_into(order + "I", found, entry + 4, rng.choice(LENGTHS))
        elif kind == 3:
            struct.pack_into(order + "I", found, entry + 8, rng.choice((*LENGTHS, start, 8, len(data) - 4)))
        elif kind == 4:
            struct.pack_into(order + "H", found, entry + 8, rng.choice(LENGTHS) & 0xFFFF)
        else:
            struct.pack_into(order + "H", found, start, rng.choice((0, 1, count + 1, 65535)))
    return bytes(found)


def _npy_head(kind: str, shape: str) -> bytes:
    text = f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text


def damaged_zip(data: bytes, rng: random.Random) -> bytes:
    """An archive of .npy and JSON members: other members, heads that lie, or any bytes."""
    if rng.random() < 0.25:
        return damaged_bytes(data, rng)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    index = rng.randrange(len(members))
    name, body = members[index]
    kind = rng.randrange(6)
    if kind == 0:
        del members[index]
    elif kind == 1:
        members[index] = (name, members[rng.randrange(len(members))][1])
    elif kind == 2:
        members[index] = (rng.choice(("../../evil.npy", "/abs.npy", "a9.npy", "\u00e9.npy", "a0.npy")), body)
    elif kind == 3 and body[:6] == b"\x93NUMPY":
        shape = rng.choice(("(999999999999,)", "(-1,)", "(3, 3)", "()", "(0,)", "(2, 2, 2, 2)", "(1e9,)", "(True,)"))
        kinds = ("'<f4'", "'<f8'", "'|O'", "'<U9'", "'|b1'", "'<i8'", "'|V9'", "'<c16'", "[('a', '<f4')]", "'<M8[s]'")
        members[index] = (name, _npy_head(rng.choice(kinds), shape) + body[128:])
    elif kind == 4 and b"{" in body[128:]:
        text = body[128:].decode("utf-32-le", "replace").rstrip("\0")
        try:
            tree = json_text(damaged_document(json.loads(text), rng), rng).decode("latin-1")
        except ValueError:
            tree = "{}"
        coded = tree.encode("utf-32-le", "replace")
        members[index] = (name, _npy_head(f"'<U{len(tree)}'", "()") + coded)
    else:
        members[index] = (name, damaged_bytes(body, rng))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
        for name, body in members:
            archive.writestr(name, body)
    return stream.getvalue()


def damaged_safetensors(data: bytes, rng: random.Random) -> bytes:
    """A file of parameters: its head as JSON, the facts in it as JSON, or any bytes."""
    if rng.random() < 0.3:
        return damaged_bytes(data, rng)
    (size,) = struct.unpack_from("<Q", data)
    head = json.loads(data[8 : 8 + size])
    if rng.random() < 0.5:
        kinds = head["__metadata__"]
        key = next(iter(kinds))
        kinds[key] = damaged_json(kinds[key].encode(), rng).decode("utf-8", "replace")
        text = json.dumps(head).encode()
    else:
        text = damaged_json(json.dumps(head).encode(), rng)
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + data[8 + size :]


# fmt: off
BY_SUFFIX: dict[str, Mutation] = {
    ".json": damaged_json, ".geojson": damaged_json, ".czml": damaged_json, ".gltf": damaged_json,
    ".glb": damaged_glb, ".b3dm": damaged_b3dm, ".png": damaged_png, ".tif": damaged_tiff, ".npz": damaged_zip,
    ".pgw": damaged_text, ".points": damaged_text, ".prj": damaged_text, ".usda": damaged_text, ".obj": damaged_text,
    ".mtl": damaged_text, ".csv": damaged_text, ".safetensors": damaged_safetensors,
}
# fmt: on
"""Mutation for each kind of file; others are damaged as bytes."""


def mutated(files: dict[str, bytes], main: str, rng: random.Random) -> dict[str, bytes]:
    """A copy of an input, one of whose files, mostly the main one, is damaged."""
    others = [name for name in files if name != main]
    name = rng.choice(others) if others and rng.random() < 0.25 else main
    suffix = "." + name.rsplit(".", 1)[-1].lower()
    change = BY_SUFFIX.get(suffix, damaged_bytes)
    try:
        return files | {name: change(files[name], rng)}
    except RecursionError:  # nested deeper than can be written
        return files | {name: damaged_bytes(files[name], rng)}
