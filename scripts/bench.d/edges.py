"""Error of every driver from the same stored samples, over all pixels and at edges, by number of
samples.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from pathlib import Path

from document import Bar, Part, Plot, Table
from harness import Bench
from program import compare, run
from scenes import INTERIOR_LIVING, Case

# The options that choose each driver.
DRIVERS = {
    "quadtree": ("--driver", "quadtree"),
    "cells": ("--cells", "smooth"),
    "surfaces": ("--driver", "surfaces"),
}
# Numbers of samples in the file, ascending: the same file is filled further.
SAMPLES = (10_000, 100_000, 1_000_000, 10_000_000)
# Targets at the most samples: decibels above the quadtree, decibels in total, and error at edges
# over the quadtree's.
ABOVE_QUADTREE, WANTED, SHARE_AT_EDGES = 6.0, 30.0, 0.25
# Paths per pixel of the converged picture. With 256, its noise was a tenth of the squared error at
# edges.
TRUTH = 1024
GAMMA = 2.2


def edges(bench: Bench) -> Part:
    """Error over samples by driver, everywhere and at edges, with direct light only."""
    part = Part(
        "Drivers on the same samples",
        [
            "Files filled with `--bounces 0 --samples N`, on and on, and `picture` by every "
            f"driver against `render --bounces 0 --spp {bench.paths(TRUTH)}`. *At edges*: root "
            "mean square of the displayed difference (as PSNR has it) over pixels within two of "
            "an edge of what is seen (another material, or a step; "
            "`crates/show/driver-surfaces/examples/edges_of_view.rs`), without the worst 1 % (the "
            "truth's fireflies), in thousandths of white. Of the bundled interior the truth "
            "itself is noisy: two such truths differ by 19 dB, and no picture can be much nearer "
            "to one than 22. The strip shows the truth on the left, then each driver from few "
            "samples to many.",
        ],
    )  # fmt: skip
    example = bench.cargo.build("holo-driver-surfaces", "--example", "edges_of_view")
    for case, obj, is_bar in cases(bench):
        line = case.view.line()
        rows = run([example, obj, line, case.size]).stdout.split()
        mask = [mark == "#" for row in rows for mark in row]
        truth, _ = bench.render(
            case, "direct-truth", "--bounces", "0", "--spp", str(bench.paths(TRUTH)), "--seed", "99"
        )
        columns = [["samples", ",d"], *([f"{driver}, {what}", spec] for driver in DRIVERS
                   for what, spec in (("dB", ".1f"), ("relMSE", ".5f"),
                                      ("at edges", ".1f")))]  # fmt: skip
        table = Table(f"{case.title}, {share(mask):.0%} of the pixels near an edge", columns)
        file = bench.work / f"edges-{case.name}.holo"
        strips: dict[str, list[Path]] = {driver: [] for driver in DRIVERS}
        last: dict[str, tuple[float, float]] = {}
        there = 0
        for count in SAMPLES[: -1 if bench.quick else None]:
            fill = [
                bench.holodeck, "fill", *case.scene, "--bounces", "0", "-o", file, "--quiet",
                "--json"
            ]
            run([*fill, "--samples", str(count - there)])
            there = count
            row: list = [count]
            for driver, words in DRIVERS.items():
                options = [*case.view.options(), *words]
                picture, _, _ = bench.picture(
                    file, options, case.size, f"edges-{case.name}-{driver}-{count}"
                )
                measures = compare(bench.holodeck, picture, truth)
                at_edges = 1000 * displayed_error(picture, truth, mask)
                row += [measures["psnr_disp"], measures["relmse_trim"], at_edges]
                strips[driver].append(picture)
                last[driver] = measures["psnr_disp"], at_edges
            table.rows.append(row)
        part.tables.append(table)
        bench.plots.mkdir(parents=True, exist_ok=True)
        strip = bench.plots / f"edges-{case.name}.png"
        write_strip(strip, truth, list(strips.values()))
        part.plots.append(
            Plot(
                f"benchmarks/{strip.name}",
                f"The truth, and drivers from few samples to many, {case.title}",
            )
        )
        if is_bar:
            (coarse, rough), (fine, sharp) = last["quadtree"], last["surfaces"]
            met = fine >= coarse + ABOVE_QUADTREE and fine >= WANTED
            what = f"surfaces at {there / 1e6:g} M samples, {case.title}"
            figure = f"{fine:.1f} dB, {fine - coarse:+.1f}"
            part.bars.append(
                Bar(what, figure, f"≥ {WANTED:g} dB, ≥ {ABOVE_QUADTREE:+g} on quadtree", met)
            )
            ratio = sharp / rough
            wanted = f"≤ {SHARE_AT_EDGES:g} of quadtree's"
            part.bars.append(
                Bar(
                    f"error at edges, {case.title}", f"{ratio:.2f}", wanted, ratio <= SHARE_AT_EDGES
                )
            )
    return part


def cases(bench: Bench) -> list[tuple[Case, Path, bool]]:
    """Returns scenes and views, their OBJ files, and whether each is compared with the targets."""
    bundle = bench.scenes.bundle()
    found = []
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        obj = Path(case.scene[0])
        found.append(
            (case, obj if obj.suffix == ".obj" else bundle / "interior.obj", case.name != "cornell")
        )
    if bench.scenes.room().name == "cabin":
        scene = ("--config", str(bundle / "interior.toml"))
        title = "bundled interior, living room"
        interior = Case("interior", title, scene, INTERIOR_LIVING, INTERIOR_LIVING, "320x240", None)
        found.append((interior, bundle / "interior.obj", False))
    return found


def share(mask: list[bool]) -> float:
    return sum(mask) / max(len(mask), 1)


def read(path: Path) -> tuple[int, int, array]:
    """Reads a colour .pfm file: width, height and channels, from the top."""
    data = path.read_bytes()
    _, size, scale, rest = data.split(b"\n", 3)
    width, height = map(int, size.split())
    values = array("f", rest)
    if float(scale) > 0:
        values.byteswap()
    line = 3 * width
    upright = array("f")
    for row in reversed(range(height)):
        upright.extend(values[row * line : (row + 1) * line])
    return width, height, upright


def white(values: array) -> float:
    """Returns the luminance that is displayed as white: the 95th percentile."""
    luminances = sorted(
        0.2126 * r + 0.7152 * g + 0.0722 * b
        for r, g, b in zip(values[0::3], values[1::3], values[2::3])
    )
    return luminances[int(0.95 * (len(luminances) - 1))] or 1.0


def shown(value: float, of_white: float) -> float:
    return min(max(value / of_white, 0.0), 1.0) ** (1 / GAMMA)


def displayed_error(picture: Path, truth: Path, mask: list[bool]) -> float:
    """Returns the root mean square of the displayed difference over the pixels of the mask, without
    the worst 1 %.
    """
    (_, _, ours), (_, _, theirs) = read(picture), read(truth)
    level = white(theirs)
    pixels = (slice(3 * at, 3 * at + 3) for at, mark in enumerate(mask) if mark)
    squares = [
        sum((shown(a, level) - shown(b, level)) ** 2 for a, b in zip(ours[p], theirs[p])) / 3
        for p in pixels
    ]
    kept = sorted(squares)[: int(0.99 * len(squares))]
    return (sum(kept) / max(len(kept), 1)) ** 0.5


def write_strip(path: Path, truth: Path, drivers: list[list[Path]]) -> None:
    """Writes a .png: the converged picture, and to its right each driver's row of pictures."""
    level = white(read(truth)[2])
    lines: list[bytearray] = []
    for pictures in drivers:
        columns = []
        for picture in (truth, *pictures):
            width, height, values = read(picture)
            columns.append(
                (width, height, bytes(int(255 * shown(value, level) + 0.5) for value in values))
            )
        for row in range(columns[0][1]):
            line = bytearray(b"\0")
            for width, _, pixels in columns:
                line += pixels[3 * width * row : 3 * width * (row + 1)]
            lines.append(line)
    width = (len(lines[0]) - 1) // 3

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", width, len(lines), 8, 2, 0, 0, 0)
    body = zlib.compress(b"".join(lines), 9)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")
    )
