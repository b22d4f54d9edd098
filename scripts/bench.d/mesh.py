"""The mesh: its triangulation alone (`mesh_speed`); its pictures beside those of other drivers from
the same samples, at rest and along recorded walks (`mesh`).
"""

from __future__ import annotations

import json
from statistics import mean, median

from document import Bar, Figure, Part, Table
from harness import Bench
from program import compare, run
from quadtree import RUNS, one_core
from scenes import Case
from walk import WHOLE, Job, asking, walks

# The options that choose each driver.
DRIVERS = {
    "quadtree": ("--driver", "quadtree"),
    "cells": ("--cells", "smooth"),
    "mesh": ("--driver", "mesh"),
    "surfaces": ("--driver", "surfaces", "--denoise", "off"),
}
# Numbers of samples in the file, ascending: the same file is filled further.
SAMPLES = (10_000, 100_000, 1_000_000, 10_000_000)
# Paths per pixel of the converged picture.
TRUTH = 1024
# Pixels for each new sample of a frame of a walk, and paths of each sample.
WALKS = ((8, 1), (64, 1), (64, 16))
# Swaps of an insertion, as the paper has them: a vertex has six edges on average, three of which
# come from its triangle.
MOST_SWAPS = 3.1
# Insertions a second of the paper's machine of 1999.
LEAST_INSERTIONS = 10_000


def mesh(bench: Bench) -> Part:
    """Pictures of the mesh beside those of the other drivers."""
    part = Part(
        "The mesh",
        [
            "*At rest*: files filled with "
            "`--bounces 0 --samples N`, on and on, and `picture` by every driver against `render "
            f"--bounces 0 --spp {bench.paths(TRUTH)}`. *Walks*: as in the part `walk`, with all "
            "samples so far. `surfaces` knows the scene, and its own filter smooths; the others "
            "draw from samples alone.",
        ],
    )  # fmt: skip
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        part.tables.append(at_rest(bench, part, case))
    program = bench.cargo.build("holo-drivers", "--example", "walk")
    every = 80 if bench.quick else 20
    for recorded in walks(bench, part):
        columns: list[list[str]] = [["ratio", "d"], ["paths", "d"]]
        for driver in DRIVERS:
            columns += [[f"{driver}, dB", ".1f"], ["SSIM", ".3f"]]
        table = Table(f"A walk, the {recorded.title}", columns)
        for ratio, paths in WALKS[: 1 if bench.quick else None]:
            job = Job(recorded, every, WHOLE, ratio, paths, tuple(DRIVERS))
            out = bench.work / f"mesh-walk-{recorded.name}"
            words = ["--drivers", ",".join(job.drivers), "--out", out]
            report = run([*asking(bench, program, job), *words]).stdout
            found = {line["driver"]: line for line in map(json.loads, report.splitlines())}
            row: list[Figure] = [ratio, paths]
            for driver in DRIVERS:
                row += [mean(found[driver]["psnr"]), mean(found[driver]["ssim"])]
            table.rows.append(row)
        part.tables.append(table)
    return part


def mesh_speed(bench: Bench) -> Part:
    """Insertions into the mesh, and its pictures of a known room."""
    part = Part(
        "The mesh alone",
        [
            "`crates/show/driver-mesh/examples/mesh_speed.rs`, one core, processor time; "
            f"the median of {RUNS} runs. Directions of a view of 60° in random order. The paper "
            "has 2.8 swaps and 10,000 insertions a second (SGI O2).",
        ],
    )  # fmt: skip
    example = bench.cargo.build("holo-driver-mesh", "--example", "mesh_speed")
    found: dict[tuple, list[dict]] = {}
    with one_core():
        for _ in range(1 if bench.quick else RUNS):
            for line in map(json.loads, run([example, "--json"]).stdout.splitlines()):
                key = (line.get("vertices"), line.get("size"), line.get("a_pixel"))
                found.setdefault(key, []).append(line)

    def rows(first: str, keys: tuple[str, ...]) -> list[list[Figure]]:
        lines = [same for same in found.values() if first in same[0]]

        def figure(same: list[dict], key: str) -> Figure:
            is_name = isinstance(same[0][key], str)
            return same[0][key] if is_name else median(line[key] for line in same)

        return [[figure(same, key) for key in keys] for same in lines]

    columns = [["vertices", ",d"], ["swaps each", ".2f"], ["insertions, M/s", ".2f"],
               ["removals, M/s", ".2f"]]  # fmt: skip
    keys = ("vertices", "swaps", "insert_m_per_s", "remove_m_per_s")
    of_triangles = rows("vertices", keys)
    for row in of_triangles:
        row[0] = int(row[0])
    part.tables.append(Table("The triangulation", columns, of_triangles))
    columns = [["size", ""], ["samples a pixel", "g"], ["samples sorted, M/s", ".1f"],
               ["first picture, ms", ".0f"], ["again, ms", ".0f"]]  # fmt: skip
    keys = ("size", "a_pixel", "sort_m_per_s", "first_ms", "again_ms")
    part.tables.append(Table("Pictures", columns, rows("size", keys)))
    swaps = max(float(row[1]) for row in of_triangles)
    slowest = 1e6 * min(float(row[2]) for row in of_triangles)
    wanted = f"≤ {MOST_SWAPS:g}"
    part.bars.append(Bar("swaps of an insertion", f"{swaps:.2f}", wanted, swaps <= MOST_SWAPS))
    wanted = f"≥ {LEAST_INSERTIONS:,}/s"
    met = slowest >= LEAST_INSERTIONS
    part.bars.append(Bar("insertions a second", f"{slowest:,.0f}/s", wanted, met))
    return part


def at_rest(bench: Bench, part: Part, case: Case) -> Table:
    """Measures the pictures of every driver from the same samples."""
    truth, _ = bench.render(
        case, "direct-truth", "--bounces", "0", "--spp", str(bench.paths(TRUTH)), "--seed", "99"
    )
    columns = [["samples", ",d"], *([f"{driver}, dB", ".1f"] for driver in DRIVERS)]
    table = Table(f"At rest, {case.title}", columns)
    file = bench.work / f"mesh-{case.name}.holo"
    there = 0
    for count in SAMPLES[: -1 if bench.quick else None]:
        fill = [bench.holodeck, "fill", *case.scene, "--bounces", "0", "-o", file, "--quiet"]
        run([*fill, "--json", "--samples", str(count - there)])
        there = count
        row: list[Figure] = [count]
        for driver, words in DRIVERS.items():
            options = [*case.view.options(), *words]
            name = f"mesh-{case.name}-{driver}-{count}"
            picture, _, _ = bench.picture(file, options, case.size, name)
            row.append(compare(bench.holodeck, picture, truth)["psnr_disp"])
        table.rows.append(row)
    return table
