"""Small files and short inputs that would need gigabytes or hours without limits."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import yaml
from attacking.measured import Attacks, Row, commanded, judged, measured, wrong
from attacking.scenarios import DOCUMENTS, LIMIT, OPTIONS
from store.test_hostile import FILES

from pushplan.errors import PushplanError
from pushplan.scenario.drawings import read_csv_outlines, read_svg_outlines

Bomb = Callable[[Path, Random], list[str]]
"""Writes what it needs into a folder; returns the words of a command, or the name of a drawing."""


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, row: bytes, rows: int | None = None) -> bytes:
    """Return a picture with one byte of grey per cell whose rows alternate with their inverse."""
    packer = zlib.compressobj(9)
    both = b"\0" + row, b"\0" + bytes(255 - value for value in row)
    data = b"".join(packer.compress(both[k % 2]) for k in range(height if rows is None else rows)) + packer.flush()
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", head) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")


def _stated(name: str) -> Any:
    return yaml.safe_load(DOCUMENTS.read_text())["scenarios"][name]


def _plan(folder: Path, document: Any) -> list[str]:
    (folder / "attack.yaml").write_text(json.dumps(document))
    return ["plan", "attack.yaml"]


def _map(folder: Path, picture: bytes | None, image: str = "office.png", **stated: Any) -> list[str]:
    """Write a scenario with a map of a picture; None makes a pipe instead; `stated` are keys of the map's file."""
    made = {**yaml.safe_load(DOCUMENTS.read_text())["map"], "image": image, **stated}
    (folder / "office.yaml").write_text(json.dumps(made))
    if picture is None:
        os.mkfifo(folder / image)
    else:
        (folder / image).write_bytes(picture)
    return _plan(folder, _stated("mapped"))


def _checkers(folder: Path, random: Random) -> list[str]:
    size = random.choice((400, 1000, 4000))
    return _map(folder, png(size, size, bytes(255 * (k % 2) for k in range(size))))


def _dust(folder: Path, random: Random) -> list[str]:
    size, every = random.choice((2000, 6000)), random.choice((3, 5, 9, 31))
    return _map(folder, png(size, size, bytes(0 if k % every == 0 else 255 for k in range(size))))


def _black(folder: Path, random: Random) -> list[str]:
    size = random.choice((2000, 8000, 8192, 9000))
    return _map(folder, png(size, size, bytes(size)))


def _claimed(folder: Path, random: Random) -> list[str]:
    width, height = random.choice(((60_000, 60_000), (1 << 20, 4), (2**31 - 1, 1), (8192, 8192)))
    return _map(folder, png(width, height, bytes(8), 4))


def _grey(folder: Path, random: Random) -> list[str]:
    heads = "P5 99999 99999 255\n", "P2 9 9 255\n1 2", "P5 -4 4 255\n", "P6 4 4 65535\n", "P5 8 8 70000\n"
    head = random.choice(heads)
    return _map(folder, head.encode() + bytes(random.choice((0, 64, 4096))), "office.pgm")


def _program(folder: Path, random: Random) -> list[str]:
    eps = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n(x) (w) file\nshowpage\n"
    image = random.choice(("office.eps", "office.png", "office.pgm"))
    others = b"GIF89a" + bytes(99), b"BM" + bytes(60), b"\0\0\1\0" + bytes(60)
    return _map(folder, random.choice((eps, *others)), image)


def _no_picture(folder: Path, random: Random) -> list[str]:
    return _map(folder, None)


def _odd_map(folder: Path, random: Random) -> list[str]:
    odd = [
        {"resolution": 1e-4}, {"resolution": 1e-300}, {"resolution": 1e9}, {"resolution": float("nan")},
        {"origin": [1e300, 0, 0]}, {"origin": [0, 0, 1e9]}, {"occupied_thresh": -1}, {"image": "../../etc/passwd"},
        {"image": "/dev/zero"}, {"image": "/dev/stdin"}, {"image": "x" * 5000}, {"mode": "raw" * 9},
    ]  # fmt: skip
    return _map(folder, png(64, 64, bytes(range(64))), **random.choice(odd))


def _uses(folder: Path, random: Random) -> list[str]:
    levels, copies = random.choice(((7, 10), (30, 2), (200, 1), (3, 200)))
    text = "<rect id='l0' width='1' height='1'/>"
    for k in range(1, levels + 1):
        text += f"<g id='l{k}'>" + f"<use href='#l{k - 1}'/>" * copies + "</g>"
    return _svg(folder, text)


def _svg(folder: Path, inner: str, head: str = "") -> list[str]:
    root = "<svg xmlns='http://www.w3.org/2000/svg' width='100mm' height='100mm' viewBox='0 0 100 100'>"
    (folder / "attack.svg").write_text(f"{head}{root}{inner}</svg>")
    return ["attack.svg"]


def _points(folder: Path, random: Random) -> list[str]:
    count = random.choice((5_000, 20_000, 200_000))
    return _svg(folder, f"<polygon points='{' '.join(f'{k % 97},{k % 89}' for k in range(count))}'/>")


def _entities(folder: Path, random: Random) -> list[str]:
    lines = "".join(f"<!ENTITY a{k} '{f'&a{k - 1};' * 10}'>" for k in range(1, 10))
    outside = "<!ENTITY a0 SYSTEM 'file:///etc/passwd'>" if random.random() < 0.5 else "<!ENTITY a0 'ha'>"
    return _svg(folder, "<text>&a9;</text>", f"<!DOCTYPE svg [{outside}{lines}]>")


def _odd_shapes(folder: Path, random: Random) -> list[str]:
    odd = (
        "<rect x='nan' width='9' height='9'/>", "<rect width='-10' height='9'/>", "<circle r='inf'/>",
        "<rect width='1e400' height='9'/>", "<path d='M 0 0 A 1e9 1e-9 0 0 1 1 1 Z'/>", "<path d='M0,0 C'/>",
        "<g transform='scale(1e200)'><rect width='9' height='9'/></g>", "<g>" * 20_000 + "</g>" * 20_000,
        "<rect width='9' height='9' transform='matrix(0 0 0 0 0 0)'/>", "<circle r='1e9'/>", "<image href='x.eps'/>",
        "<path d='" + "M 0 0 L 1 1 " * 60_000 + "'/>", "<circle r='40' id='" + "x" * 100_000 + "'/>",
    )  # fmt: skip
    return _svg(folder, random.choice(odd))


def _table(folder: Path, random: Random) -> list[str]:
    rows = random.choice(
        ("a,1,2\n" * 400_000, "a,nan,1\na,1,1\na,2,0\n", "a," + "9" * 5000 + ",1\n", '"' + "x\n" * 99999)
    )
    (folder / "attack.csv").write_text("name,x,y\n" + rows)
    return ["attack.csv"]


def _text(folder: Path, random: Random) -> list[str]:
    number = "9" * random.choice((20, 5000, 200_000))
    odd = (
        "a: &a [x, x]\n" + "".join(f"k{k}: &k{k} [*a, *a]\n" for k in range(30)), "[" * 100_000, "{a: " * 50_000,
        "a: " + "x" * (2 << 20), f"floor: {number}", f"floor: {{friction: {number} mm}}", "? " * 50_000,
        "- a\n" * 300_000, "!!python/object/apply:os.system [true]", "a: !!binary " + "A" * 400_000,
        "---\n" * 99_999,
        "a: |\n" + " x\n" * 300_000, "\x00" * 9999, "\ufeff" * 9999,
        "<<: [" + "{a: 1}," * 50_000 + "]", "a:\n" * 90_000,
        "floor: " + "9:" * 20_000 + "9", "{? [" + "a," * 60_000 + "] : 1}", "# " * 500_000, "k: 1\n" * 90_000,
    )  # fmt: skip
    (folder / "attack.yaml").write_text(random.choice(odd))
    return [random.choice(("check", "plan")), "attack.yaml"]


def _motion(folder: Path, random: Random) -> list[str]:
    """Return limits, sizes and paths whose motions last for hours, or have millions of samples."""
    document = _stated(random.choice(("mapped", "faces", "rich")))
    document.pop("obstacles", None)
    small = random.choice((1e-9, 1e-6, 1e-4, 3e-4, 1e-3, 1e-2))
    limits = document["pusher"].setdefault("limits", {})
    names = "speed", "acceleration", "jerk", "angular_speed", "angular_acceleration", "angular_jerk"
    limits |= dict.fromkeys(random.sample(names, 2), small)
    if random.random() < 0.3:
        document["goal"]["pose"] = [random.choice((30.0, 1e3, 1e5)), 0.0, 0.0]
        document.pop("workspace", None)
    if random.random() < 0.3:
        document |= {"pushes": {"most": 60}} if "pushes" in document else {"planner": {"gap": 0.0}}
    return _plan(folder, document)


def _many(folder: Path, random: Random) -> list[str]:
    """Return objects, corners, feet and obstacles up to their limits and beyond."""
    document = _stated("rich")
    count = random.choice((50, 500, 5000, 12_000))
    match random.choice(("obstacles", "objects", "feet", "corners")):
        case "obstacles":
            document["obstacles"] = [{"circle": 1e-3, "center": [-1.4 + 0.002 * k, -1.4]} for k in range(count)]
        case "objects":
            box = {"shape": {"box": [0.02, 0.08]}, "mass": 0.1}
            document["objects"] = [{"name": f"o{k}", **box} for k in range(count)]
            document["contacts"], document["goal"] = {"friction": 0.4}, {"pose": [1.0, 0.0, 0.0]}
        case "feet":
            feet = [[-0.04 + 0.08 * k / count, 0.03 * (-1) ** k, 1.0 / count] for k in range(count)]
            document["objects"][1]["support"] = {"feet": feet}
        case _:
            corners = [[-0.05 + 0.1 * k / count, -0.04 - 1e-3 * (k % 2)] for k in range(count + 1)]
            document["objects"][1]["shape"] = {"polygon": [*corners, [0.05, 0.04], [-0.05, 0.04]]}
    return _plan(folder, document)


def _log(folder: Path, random: Random) -> list[str]:
    made = bytearray(FILES[random.choice([*FILES])][0]())
    for _ in range(random.choice((0, random.randint(1, 5))) if made else 0):
        made[random.randrange(len(made))] ^= 1 << random.randrange(8)
    (folder / "attack.mcap").write_bytes(made)
    return ["replay", "attack.mcap", *random.choice(([], ["--verify"]))]


BOMBS: dict[str, tuple[Bomb, ...]] = {
    "maps": (_checkers, _dust, _black, _claimed, _grey, _program, _no_picture, _odd_map),
    "SVG and CSV": (_uses, _points, _entities, _odd_shapes, _table),
    "YAML": (_text, _many),
    "motions": (_motion,),
    "MCAP": (_log,),
}


def attacks(folder: Path, count: int, seed: int) -> Attacks:
    """Yield bombs of every kind in turn."""
    for k in range(count):
        turn, number = divmod(k, len(BOMBS))
        kind, bombs = [*BOMBS.items()][number]
        bomb, key = bombs[turn % len(bombs)], f"{seed}-bomb-{k}"
        yield key, partial(measured, partial(_dropped, bomb, key), LIMIT, group=kind, bomb=bomb.__name__.strip("_"))


def _dropped(bomb: Bomb, key: str, folder: Path) -> Row:
    words, log = bomb(folder, Random(key)), folder / "run.mcap"
    if len(words) == 1:
        try:
            (read_svg_outlines if words[0].endswith("svg") else read_csv_outlines)(words[0])
        except PushplanError:
            return {"verdict": "refused"}
        return {"verdict": "read"}
    if words[0] == "plan":
        words += ["--time-limit", str(LIMIT), *OPTIONS[:2], "-o", str(log)]
    code, _, err = commanded(*words, "--json")
    if log.exists():
        replayed, _, said = commanded("replay", log, "--verify", "--json")
        if replayed != 0:
            return wrong(f"its own log: exit code {replayed}: {said[-600:]}")
    return judged(code, err, {0: "done", 2: "refused", 3: "no plan", 4: "mismatch"})
