"""Large models: seconds from the file to the first ray, and from a holodeck to a picture."""

from __future__ import annotations

import math
import subprocess
import time
from pathlib import Path

from document import Bar, Part, Table
from harness import Bench
from program import MIB, Failed, PeakMemory

# Triangles of each ball: two for each of its faces.
AROUND, RINGS = 100, 50
PER_BALL = 2 * AROUND * RINGS

VIEW = ("--vp=-1,-1,3", "--vd=1,1,-0.2", "--vu=0,0,1", "--vh=60", "--size=16x12")
STATED = ("--sky=1,1,1", "--up=z", "--unit=m")

FIRST_RAY_BAR = 10.0
REOPENED_BAR = 1.0
MEMORY_BAR = 8 * 1024.0


def large(bench: Bench) -> Part:
    """Models of 2 and 10 million triangles: seconds to the first ray, reopened, and memory."""
    part = Part(
        "Large models",
        [
            f"OBJ files of dented balls of {PER_BALL:,} triangles each, with normals. *First "
            f"ray*: all of `render --spp 1` of {VIEW[-1].removeprefix('--size=')} pixels, from "
            "the start of the program to its end; *stated* with a view, up, unit and sky, *no "
            "option* without, so that the scene is surveyed. *Reopened*: all of `picture` of a "
            "holodeck that holds the packed scene. *Memory* is the greatest of the processes of "
            "each, in MiB.",
        ],
    )  # fmt: skip
    columns = [["triangles", ",d"], ["file, MiB", ",.0f"], ["stated, s", ".1f"],
               ["no option, s", ".1f"], ["memory, MiB", ",.0f"], ["reopened, s", ".2f"],
               ["memory, MiB", ",.0f"]]  # fmt: skip
    table = Table("", columns)
    for triangles in (200_000,) if bench.quick else (2_000_000, 10_000_000):
        obj = bench.work / f"large-{triangles}.obj"
        count = balls(obj, triangles // PER_BALL)
        picture = ("--spp", "1", "--quiet", "-o", bench.work / "large.png")
        stated, memory = timed([bench.holodeck, "render", obj, *VIEW, *STATED, *picture])
        nothing, most = timed([bench.holodeck, "render", obj, VIEW[-1], *picture])
        file = bench.work / "large.holo"
        file.unlink(missing_ok=True)
        section = "--section=-1,-1,2.5 50,0,0 0,50,0 0,0,2"
        timed(
            [
                bench.holodeck, "fill", obj, *STATED, section, "--samples", "100k", "--quiet", "-o",
                file
            ]
        )
        reopened, shown = timed(
            [bench.holodeck, "picture", file, *VIEW, "--quiet", "-o", bench.work / "large-2.png"]
        )
        memory = max(memory, most)
        table.rows.append(
            [count, obj.stat().st_size / MIB, stated, nothing, memory, reopened, shown]
        )
        if count < 3_000_000:
            for what, seconds in (("stated", stated), ("no option", nothing)):
                bar = Bar(
                    f"first ray of {count:,} triangles, {what}", f"{seconds:.1f} s",
                    f"≤ {FIRST_RAY_BAR:g} s", seconds <= FIRST_RAY_BAR
                )
                part.bars.append(bar)
            part.bars.append(
                Bar(
                    f"{count:,} triangles reopened", f"{reopened:.2f} s", f"≤ {REOPENED_BAR:g} s",
                    reopened <= REOPENED_BAR
                )
            )
        else:
            part.bars.append(
                Bar(
                    f"memory of {count:,} triangles", f"{memory:,.0f} MiB",
                    f"≤ {MEMORY_BAR:,.0f} MiB", memory <= MEMORY_BAR
                )
            )
        obj.unlink()
        file.unlink()
    part.tables.append(table)
    return part


def timed(command: list[str | Path]) -> tuple[float, float]:
    """Runs a command to its end. Returns its seconds, and the most memory of one of its processes
    in MiB.
    """
    words = [str(word) for word in command]
    start = time.monotonic()
    with subprocess.Popen(
        words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        memory = PeakMemory(process.pid)
        memory.start()
        errors = process.stderr.read() if process.stderr else ""
        process.wait()
    seconds = time.monotonic() - start
    memory.stop()
    if process.returncode != 0:
        raise Failed(
            f"`{' '.join(words)}` ended with status {process.returncode}:\n{errors.strip()}"
        )
    return seconds, max(memory.peaks.values(), default=0.0)


def balls(obj: Path, count: int) -> int:
    """Writes so many balls on a floor. Returns the number of triangles."""
    side = math.ceil(math.sqrt(count))
    points, normals = [], []
    for ring in range(RINGS + 1):
        # Not quite to the poles, where triangles would have no area.
        slope = math.pi * (ring + 0.01) / (RINGS + 0.02)
        for step in range(AROUND):
            turn = 2.0 * math.pi * step / AROUND
            x, y, z = (
                math.sin(slope) * math.cos(turn), math.sin(slope) * math.sin(turn), math.cos(slope)
            )
            radius = 1.0 + 0.03 * math.sin(9.0 * turn) * math.sin(slope)
            points.append((radius * x, radius * y, 1.1 + radius * z))
            normals.append(f"vn {x:.4f} {y:.4f} {z:.4f}\n")
    quads = [
        (ring * AROUND + step, (ring + 1) * AROUND + step,
         (ring + 1) * AROUND + (step + 1) % AROUND, ring * AROUND + (step + 1) % AROUND)
        for ring in range(RINGS)
        for step in range(AROUND)
    ]  # fmt: skip
    with open(obj, "w", encoding="ascii") as out:
        far = side * 3.0
        out.write(f"o floor\nv -2 -2 0\nv {far} -2 0\nv {far} {far} 0\nv -2 {far} 0\nf 1 2 3 4\n")
        for ball in range(count):
            left, front = ball % side * 3.0, ball // side * 3.0
            out.write(f"o ball{ball}\n")
            out.writelines(f"v {left + x:.6f} {front + y:.6f} {z:.6f}\n" for x, y, z in points)
            out.writelines(normals)
            first, normal = 5 + ball * len(points), 1 + ball * len(points)
            out.writelines(
                "f " + " ".join(f"{first + k}//{normal + k}" for k in quad) + "\n" for quad in quads
            )
    return 2 + count * PER_BALL
