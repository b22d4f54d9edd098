"""The quadtree: insertions, whole pictures, and pictures while the camera moves."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import median

from document import Bar, Part, Table
from harness import Bench
from program import run

SIZE = "512x512"
# The part of the picture that is drawn while the camera moves: every other column and row.
MOVING = "256x256"
RUNS = 3
# Least million insertions a second, for every kind and number of samples.
LEAST_INSERTIONS = 20.0
# Longest time for a picture while the camera moves.
MOST_MILLISECONDS = 5.0
# Names in the example's report, and their meaning.
FIGURES = (
    ("insert_m_per_s", "insertion, M/s"),
    ("whole_ms", "picture, ms"),
)


def quadtree(bench: Bench) -> Part:
    """Insertions per second, and milliseconds of the quadtree's pictures, on one core."""
    part = Part(
        "The quadtree",
        [
            (
                "`crates/show/driver-quadtree/examples/quadtree_speed.rs`, one core, processor time:"
                " samples of a known room, without noise and of one path. Insertions go into new"
                f" memory. While the camera moves, a picture of {MOVING} pixels is drawn and"
                f" enlarged to {SIZE}. The median of {RUNS} runs, each the least of 6 rounds."
            ),
        ],
    )
    example = bench.cargo.build("holo-driver-quadtree", "--example", "quadtree_speed")
    found: dict[tuple[str, str, float], list[dict]] = {}
    with one_core():
        for _ in range(1 if bench.quick else RUNS):
            for line in map(json.loads, run([example, "--json"]).stdout.splitlines()):
                found.setdefault((line["size"], line["samples"], line["a_pixel"]), []).append(line)
    columns = [
        ["size", ""], ["samples", ""], ["a pixel", "g"],
        *([heading, ".1f"] for _, heading in FIGURES)
    ]
    table = Table("", columns)
    rows = {
        key: {name: median(line[name] for line in lines) for name, _ in FIGURES}
        for key, lines in found.items()
    }
    for (size, samples, density), figures in rows.items():
        table.rows.append([size, samples, density, *figures.values()])
    part.tables.append(table)

    def bar(
        what: str, size: str, name: str, wanted: str, is_met: Callable[[float], bool], unit: str
    ) -> None:
        values = [figures[name] for (of, *_), figures in rows.items() if of == size]
        measured = f"{min(values):.1f} to {max(values):.1f} {unit}"
        part.bars.append(Bar(f"{what}, {size}", measured, wanted, all(map(is_met, values))))

    insertions = f"≥ {LEAST_INSERTIONS:g} M/s"
    bar(
        "insertion", SIZE, "insert_m_per_s", insertions, lambda speed: speed >= LEAST_INSERTIONS,
        "M/s"
    )
    moving = f"≤ {MOST_MILLISECONDS:g} ms"
    bar(
        "picture while the camera moves", MOVING, "whole_ms", moving,
        lambda time: time <= MOST_MILLISECONDS, "ms",
    )  # fmt: skip
    return part


@contextmanager
def one_core() -> Iterator[None]:
    """Runs programs that are started inside on one core, if the system allows it."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
