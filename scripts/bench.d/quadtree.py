"""The quadtree: insertions, and pictures while the camera moves and while samples arrive."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median

from document import Bar, Part, Table
from harness import Bench
from program import run

SIZE = "512x512"
RUNS = 3
# For every kind and number of samples.
LEAST_INSERTIONS = 20.0
MOST_MILLISECONDS = 5.0
# Names in the example's report, and their meaning.
FIGURES = (
    ("insert_m_per_s", "insertion, M/s"),
    ("draft_ms", "draft, ms"),
    ("whole_ms", "whole picture, ms"),
    ("burst_ms", "in a burst of 50,000, ms"),
    ("rest_ms", "at rest, ms"),
)


def quadtree(bench: Bench) -> Part:
    """Insertions per second, and milliseconds of the quadtree's pictures, on one core."""
    part = Part(
        "The quadtree",
        [
            "`crates/driver-quadtree/examples/quadtree_speed.rs`, one core, processor time: samples of a room that is known, without noise and of one "
            "path. *Draft*: the first picture of a view, and so every one while the camera moves, of all samples that it has. *Whole picture*: "
            "the next one of the same samples. *At rest*: one that takes in all samples of bursts. *Insertion* is into memory that has been "
            f"used. The median of {RUNS} runs, each the least of 4 rounds.",
        ],
    )
    example = bench.cargo.build("holo-driver-quadtree", "--example", "quadtree_speed")
    found: dict[tuple[str, str, float], list[dict]] = {}
    with one_core():
        for _ in range(1 if bench.quick else RUNS):
            for line in map(json.loads, run([example, "--json"]).stdout.splitlines()):
                found.setdefault((line["size"], line["samples"], line["a_pixel"]), []).append(line)
    columns = [["size", ""], ["samples", ""], ["a pixel", "g"], *([heading, ".1f"] for _, heading in FIGURES)]
    table = Table("", columns)
    rows = {key: {name: median(line[name] for line in lines) for name, _ in FIGURES} for key, lines in found.items()}
    for (size, samples, density), figures in rows.items():
        table.rows.append([size, samples, density, *figures.values()])
    part.tables.append(table)
    at_bar = [figures for (size, *_), figures in rows.items() if size == SIZE]

    def bar(what: str, name: str, wanted: str, is_met: bool, unit: str) -> None:
        values = [figures[name] for figures in at_bar]
        part.bars.append(Bar(what, f"{min(values):.1f} to {max(values):.1f} {unit}", wanted, is_met))

    slowest = min(figures["insert_m_per_s"] for figures in at_bar)
    bar("insertion", "insert_m_per_s", f"≥ {LEAST_INSERTIONS:g} M/s", slowest >= LEAST_INSERTIONS, "M/s")
    for what, name in (("picture while the camera moves", "draft_ms"), ("picture in a burst of 50,000 samples", "burst_ms")):
        longest = max(figures[name] for figures in at_bar)
        bar(f"{what}, {SIZE}", name, f"≤ {MOST_MILLISECONDS:g} ms", longest <= MOST_MILLISECONDS, "ms")
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
