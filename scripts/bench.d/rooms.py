"""Furnished rooms at the usual size of a picture, beside a path tracer with a denoiser.

Invariants: all pictures are averaged down to the truth's size. The truth's own noise is
measured by its two halves, and subtracted from the error.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import tomllib
import zlib
from array import array
from dataclasses import replace
from pathlib import Path

from document import Bar, Part, Plot, Table
from harness import Bench
from program import Failed, run
from rivals import environment
from scenes import Case, View

SIZE = "1280x720"
TRUTH_SIZE = "320x180"
# The size of the path tracer's pictures by the seconds that it has: as many pixels as it can give a
# path.
TRACED_SIZES = {1.0: "320x180", 3.0: "640x360", 8.0: SIZE}
# Paths of a pixel of each half of the truth.
TRUTH_PATHS = 128
FILL = 60
# Seconds after a move, and the decibels wanted of the worst view with Open Image Denoise.
WANTED = {0.2: 24.0, 1.0: 28.0, 3.0: 30.0, 8.0: 32.5}
# Decibels that the own filter may be below these.
BELOW = 1.0
# Decibels wanted above the path tracer's pictures, with Open Image Denoise and without.
AHEAD, OWN_AHEAD = 1.0, 0.0
# Seconds after a move by which the first picture is wanted.
FIRST = 0.35
SHOWN = (0.2, 1.0, 5.0, 20.0)
ASKED = tuple(sorted({*WANTED, *SHOWN}))
STAY = ASKED[-1] + 0.5
# Seconds of the path tracer.
TRACED = tuple(TRACED_SIZES)
PYOIDN = "pyoidn"
WEIGHTS = (0.2126, 0.7152, 0.0722)

Pixels = list[tuple[float, float, float]]


def rooms(bench: Bench) -> Part:
    """Six views of the bundled interior at 1280 × 720, beside a denoised path tracer."""
    part = Part(
        "Furnished rooms, beside a path tracer with a denoiser",
        [
            (
                f"The bundled interior, all rooms filled for {FILL} s together; then one session"
                " with a worker that moves to each of the six named views in turn, at 1280 × 720."
                " Decibels are the display PSNR after averaging down to 320 × 180, the truth's own"
                " noise taken off; *written* is when the picture was there; the first is asked at"
                " 0.2 s, to be there by 0.35 s. *Path tracer* is `render --engine path --time`,"
                " denoised by Open Image Denoise with albedo and normals; the scene's loading and"
                " the denoiser's half second do not count. Its pictures have as many pixels as it can give"
                f" a path: {', '.join(f'{size} in {time:g} s' for time, size in TRACED_SIZES.items())}."
            ),
        ],
    )
    library, reason = denoiser(bench)
    if reason:
        part.skipped.append(f"the path tracer and pictures with the denoiser: {reason}")
    case = bench.scenes.interior()
    views = named_views(Path(case.scene[1]))
    looks = [
        replace(case, name=f"interior-{name}", title=name, view=view, size=TRUTH_SIZE)
        for name, view in views.items()
    ]
    truths = {look.name: truth(bench, look) for look in looks}
    alone: dict[tuple[str, float], Path] = {}
    took: dict[tuple[str, float], float] = {}
    if library:
        for look in looks:
            for seconds in TRACED:
                time = f"{bench.seconds(seconds)}s"
                picture, said = bench.render(
                    look, f"rival-{seconds:g}", "--engine", "path", "--time", time, "--denoise",
                    library, size=TRACED_SIZES[seconds]
                )
                alone[look.name, seconds] = picture
                took[look.name, seconds] = said["seconds"]
    ways = [("own filter", "off")] + ([("Open Image Denoise", library)] if library else [])
    sheets = []
    for title, way in ways:
        table, pictures = session(bench, part, case, looks, truths, (title, str(way)), alone, took)
        part.tables.append(table)
        sheets.append(pictures)
    sheet = bench.plots / "rooms.png"
    contact_sheet(sheet, looks, truths, sheets[-1], alone)
    part.plots.append(
        Plot(
            f"benchmarks/{sheet.name}",
            f"Asked at {', '.join(f'{s:g}' for s in SHOWN)} s after a move; path tracer with the"
            " denoiser, 1 and 8 s",
        )
    )
    return part


def denoiser(bench: Bench) -> tuple[Path | None, str]:
    """Returns the library of Open Image Denoise, which is installed if it can be, or why not."""
    try:
        found = library(sys.executable)
        if not found:
            python = environment(bench)
            run([python, "-m", "pip", "install", "--quiet", PYOIDN])
            found = library(python)
        return (found, "") if found else (None, f"{PYOIDN} has no library")
    except (Failed, OSError) as error:
        return None, str(error).strip().splitlines()[-1]


def library(python: str | Path) -> Path | None:
    """Returns the library that a Python's package holds."""
    program = (
        f"import importlib.util as u; s = u.find_spec('{PYOIDN}');"
        " print(s.submodule_search_locations[0] if s else '')"
    )
    folder = run([python, "-c", program]).stdout.strip()
    found = sorted(Path(folder).rglob("libOpenImageDenoise.so.2*")) if folder else []
    return found[0] if found else None


def named_views(config: Path) -> dict[str, View]:
    """Returns the views that a scene's configuration names."""
    views = tomllib.loads(config.read_text(encoding="utf-8"))["view"]
    return {
        view["name"]: View(
            *(",".join(f"{x:g}" for x in view[key]) for key in ("vp", "vd", "vu")), view["vh"]
        )
        for view in views
    }


def session(
    bench: Bench, part: Part, case: Case, looks: list[Case], truths: dict, way: tuple[str, str],
    alone: dict, took: dict
) -> tuple[Table, dict]:
    title, denoise = way
    filled, _ = bench.fill("interior-rooms", case, FILL)
    name = title.split()[0].lower()
    file = bench.work / f"rooms-{name}.holo"
    file.write_bytes(filled.read_bytes())
    lines, pictures = [f"0 view {looks[-1].view.line()}"], {}
    for index, look in enumerate(looks):
        lines.append(f"{bench.seconds(STAY) if index else 3} view {look.view.line()}")
        for asked in ASKED:
            pictures[look.name, asked] = bench.work / f"rooms-{name}-{look.name}-{asked}.pfm"
            lines.append(f"{bench.seconds(asked)} picture {pictures[look.name, asked]}")
    script = bench.work / f"rooms-{name}.txt"
    script.write_text("\n".join([*lines, "quit", ""]), encoding="utf-8")
    options = [
        "--headless", "--json", "--quiet", "--size", SIZE, "--driver", "surfaces", "--denoise",
        denoise
    ]
    said = run([bench.holodeck, "view", file, *options, "--script", script])
    written = {
        line["picture"]: line["seconds"]
        for line in map(json.loads, filter(lambda l: l.startswith("{"), said.stdout.splitlines()))
        if "picture" in line
    }
    columns = [["view", ""]]
    for asked in ASKED:
        columns += [[f"at {asked:g} s, dB", ".1f"], ["written, s", ".2f"]]
    for seconds in TRACED if alone else ():
        columns += [[f"path tracer {seconds:g} s, dB", ".1f"], ["took, s", ".1f"]]
    table = Table(f"Driver `surfaces`, {title}", columns)
    for look in looks:
        row: list = [look.title]
        found = {asked: decibels(pictures[look.name, asked], truths[look.name]) for asked in ASKED}
        for asked in ASKED:
            row += [found[asked], written.get(str(pictures[look.name, asked]), 0.0)]
        for seconds in TRACED if alone else ():
            rival = decibels(alone[look.name, seconds], truths[look.name])
            row += [rival, took[look.name, seconds]]
        table.rows.append(row)
    part.bars += bars(table, title, denoise != "off")
    return table, pictures


def bars(table: Table, title: str, has_denoiser: bool) -> list[Bar]:
    """Returns what is wanted of a session's table, beside what it has."""
    names = [name for name, _ in table.columns]

    def column(name: str) -> list[float]:
        return [row[names.index(name)] for row in table.rows]

    found = []
    written = max(row[names.index(f"at {min(WANTED):g} s, dB") + 1] for row in table.rows)
    found.append(
        Bar(f"{title}, first picture of the slowest room", f"{written:.2f} s", f"≤ {FIRST:g} s",
            written <= FIRST)
    )  # fmt: skip
    for asked, want in WANTED.items():
        least = want if has_denoiser else want - BELOW
        worst = min(column(f"at {asked:g} s, dB"))
        found.append(
            Bar(f"{title}, worst room at {asked:g} s", f"{worst:.1f} dB", f"≥ {least:g} dB",
                worst >= least)
        )  # fmt: skip
    least = AHEAD if has_denoiser else OWN_AHEAD
    for seconds in TRACED:
        rival = f"path tracer {seconds:g} s, dB"
        if rival in names:
            ahead = min(a - b for a, b in zip(column(f"at {seconds:g} s, dB"), column(rival)))
            found.append(
                Bar(f"{title}, ahead of the path tracer at {seconds:g} s, worst room",
                    f"{ahead:+.1f} dB", f"≥ {least:g} dB", ahead >= least)
            )  # fmt: skip
    return found


def truth(bench: Bench, look: Case) -> tuple[Pixels, Pixels]:
    """Returns two independent converged pictures, which are kept until the scene changes."""
    halves = []
    folder = bench.root / "target/truths"
    folder.mkdir(parents=True, exist_ok=True)
    paths = bench.paths(TRUTH_PATHS)
    scene = Path(look.scene[1]).with_suffix(".obj")
    stamp = zlib.crc32(scene.read_bytes() + scene.with_suffix(".mtl").read_bytes())
    for seed in (1, 2):
        kept = folder / f"{look.name}-{look.size}-{paths}-{seed}-{stamp:08x}.pfm"
        if not kept.exists():
            made, _ = bench.render(
                look, f"truth-{seed}", "--engine", "path", "--spp", str(paths), "--seed", str(seed)
            )
            kept.write_bytes(made.read_bytes())
        halves.append(read(kept))
    return halves[0], halves[1]


def read(path: Path, size: str = TRUTH_SIZE, most: float = math.inf) -> Pixels:
    """Returns a picture's pixels, rows from the bottom, averaged down to the truth's size. What is
    brighter than `most` counts as that.
    """
    data = path.read_bytes()
    head = data.split(b"\n", 3)
    width, height = (int(side) for side in head[1].split())
    values = array("f", head[3])
    if most < math.inf:
        values = array("f", (min(value, most) for value in values))
    columns, rows = (int(side) for side in size.split("x"))
    step = width // columns
    pixels = []
    for y in range(rows):
        for x in range(columns):
            sums = [0.0, 0.0, 0.0]
            for row in range(y * step, (y + 1) * step):
                at = 3 * (row * width + x * step)
                block = values[at : at + 3 * step]
                for channel in range(3):
                    sums[channel] += sum(block[channel::3])
            pixels.append(tuple(total / step / step for total in sums))
    return pixels


def mean(halves: tuple[Pixels, Pixels]) -> Pixels:
    return [tuple((a + b) / 2 for a, b in zip(*pair)) for pair in zip(*halves)]


def white(truth: Pixels) -> float:
    """Returns the luminance that pictures show as white: the truth's 95th percentile."""
    bright = sorted(sum(w * c for w, c in zip(WEIGHTS, pixel)) for pixel in truth)
    return bright[int(0.95 * (len(bright) - 1))]


def shown(pixels: Pixels, white: float) -> list[float]:
    return [min(max(c / white, 0.0), 1.0) ** (1 / 2.2) for pixel in pixels for c in pixel]


def decibels(
    picture: Path, halves: tuple[Pixels, Pixels], size: str = TRUTH_SIZE, most: float = math.inf
) -> float:
    """Returns the display PSNR of a picture, the truth's noise taken off. What is brighter than
    `most` counts as that.
    """
    return decibels_of(read(picture, size, most), halves)


def decibels_of(pixels: Pixels, halves: tuple[Pixels, Pixels]) -> float:
    """Returns the display PSNR of pixels of the truth's size, the truth's noise taken off."""
    middle = mean(halves)
    level = white(middle)
    true, one, other = (shown(pixels, level) for pixels in (middle, *halves))
    noise = sum((a - b) ** 2 for a, b in zip(one, other)) / 4
    error = sum((a - b) ** 2 for a, b in zip(shown(pixels, level), true)) - noise
    return -10 * math.log10(max(error, 1e-6) / len(true))


def filtered(row: bytes) -> bytes:
    """Returns a row of pixels as PNG's filter 1 writes it: as differences, which pack well."""
    return b"\1" + row[:3] + bytes((a - b) & 255 for a, b in zip(row[3:], row))


def contact_sheet(path: Path, looks: list[Case], truths: dict, pictures: dict, alone: dict) -> None:
    """Writes what a person sees: a row for each view, a column for each time."""
    columns, rows = (int(side) for side in TRUTH_SIZE.split("x"))
    lines = []
    for look in looks:
        level = white(mean(truths[look.name]))
        tiles = [pictures[look.name, asked] for asked in SHOWN]
        tiles += [alone[look.name, seconds] for seconds in (TRACED[0], TRACED[-1])] if alone else []
        shades = [shown(read(tile), level) for tile in tiles]
        for y in reversed(range(rows)):
            row = [
                shade for tile in shades for shade in tile[3 * y * columns : 3 * (y + 1) * columns]
            ]
            lines.append(filtered(bytes(min(4 * round(255 * shade / 4), 255) for shade in row)))
    width, height = (len(lines[0]) - 1) // 3, len(lines)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(b"".join(lines), 9))
        + chunk(b"IEND", b"")
    )
