"""A recorded walk, tracing in lockstep with frames: how like the truth every driver is, by samples a frame, with and without noise."""

from __future__ import annotations

import hashlib
import json
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import mean

from document import Bar, Figure, Part, Plot, Table
from harness import Bench
from plot import decibels_over_seconds
from program import run

DRIVERS = ("pointimage", "1999", "frameless", "quadtree", "voronoi")
# The render cache without one of its stages.
STAGES = ("noise", "prediction", "prefilter", "eviction", "ageing", "cull", "interpolation", "dither")
# Pixels for each new sample of a frame, and the frames: with as many samples as pixels a part of the walk must do.
RATIOS = ((1, "120..180"), (8, "0..1000"), (64, "0..1000"), (256, "0..1000"))
BAR_RATIO = 64
# Paths of a sample.
NOISES = (("noisy", 1), ("clean", 16))
# Decibels that the render cache has to be above its first paper, and above frameless.
WANTED = 3.0


@dataclass(frozen=True)
class Recorded:
    """A walk and its scene."""

    name: str
    title: str
    scene: Path
    walk: Path


def walk(bench: Bench) -> Part:
    """Recorded walks through the bundled interior and the cabin, every driver, tracing in lockstep with frames."""
    every = 80 if bench.quick else 10
    part = Part(
        "A recorded walk",
        [
            "`crates/display/examples/walk`: rest, turns of 90 to 120 degrees a second, a walk of 1.5 to 2 m/s through a door, rest, "
            "at 30 frames a second and 320×240. In each frame a driver gets pixels / *ratio* new samples that it asked for in the frame "
            "before; the next frame's view is what is predicted. Direct light and mirrors; *noisy* samples are of one path, *clean* of "
            f"16. Every {every}th frame is held against a render of relMSE ≤ 0.005 where 1024 paths do. *1999*: the stages of "
            "the render cache's first paper; it keeps its last colours and smooths everywhere. `quadtree` and `voronoi` keep all samples so far, as a server "
            "would, and ask anywhere in the picture: a section's ray, mostly of the best one, as displays weigh beams, and where there is "
            "none a ray traced for its view alone. PSNR as displayed, and structural similarity of luminance as displayed, means "
            f"over frames. With ratio 1, frames {RATIOS[0][1]} only.",
        ],
    )
    program = bench.cargo.build("holo-display", "--example", "walk")
    for recorded in walks(bench, part):
        jobs = {
            (noise, ratio): partial(shown, bench, program, recorded, paths, ratio, frames, every, DRIVERS)
            for noise, paths in NOISES
            for ratio, frames in (RATIOS[1:3] if bench.quick else RATIOS)
        }
        # The first makes the truths of all; nothing is timed, so that the others may share the cores.
        first = jobs[NOISES[0][0], BAR_RATIO]()
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            rest = {key: pool.submit(job) for key, job in jobs.items() if key != (NOISES[0][0], BAR_RATIO)}
            found = {key: rest[key].result() if key in rest else first for key in jobs}
        part.tables.append(likeness(recorded, found))
        for noise, paths in NOISES:
            by_driver = found[noise, BAR_RATIO]
            bars(part, recorded, noise, by_driver)
            part.plots.append(over_time(bench, recorded, noise, by_driver))
            strip = f"walk-{recorded.name}-{paths}-{BAR_RATIO}.png"
            caption = f"The {recorded.title}, {noise} samples: the truth, {', '.join(DRIVERS)} from above, five moments"
            part.plots.append(Plot(f"benchmarks/{strip}", caption))
        part.tables.append(ablation(bench, program, recorded, every, found))
    return part


def walks(bench: Bench, part: Part) -> list[Recorded]:
    recordings = bench.root / "crates/display/examples/walk/walks"
    interior = bench.scenes.bundle() / "interior.obj"
    found = [Recorded("interior", "bundled interior", interior, recordings / "interior.walk")]
    cabin = bench.shared / "scenes/cabin/cabin.obj"
    if cabin.exists():
        found.append(Recorded("cabin", "cabin", cabin, recordings / "cabin.walk"))
    else:
        part.skipped.append("the cabin is not in ../shared/scenes")
    return found


def shown(
    bench: Bench,
    program: Path,
    recorded: Recorded,
    paths: int,
    ratio: int,
    frames: str,
    every: int,
    drivers: tuple[str, ...],
) -> dict[str, dict]:
    """What the example says of each driver. Truths stay between runs, as long as scene and walk are the same."""
    state = hashlib.sha256(recorded.scene.read_bytes() + recorded.walk.read_bytes()).hexdigest()[:12]
    # A smoke run makes do with worse truths, of its own.
    most = 64 if bench.quick else 1024
    truths = bench.root / "target/walk-truths" / f"{recorded.name}-{state}-{most}"
    out = bench.plots / f"walk-{recorded.name}-{paths}-{ratio}"
    command = [program, recorded.scene, recorded.walk, "--bounces", "0", "--paths", str(paths), "--ratio", str(ratio),
               "--frames", frames, "--every", str(every), "--truth-paths", str(most), "--drivers", ",".join(drivers),
               "--truths", truths, "--out", out]  # fmt: skip
    said = [json.loads(line) for line in run(command).stdout.splitlines()]
    strip = out / "strip.png"
    if drivers == DRIVERS and ratio == BAR_RATIO:
        strip.replace(out.with_suffix(".png"))
    else:
        strip.unlink()
    out.rmdir()
    return {line["driver"]: line for line in said}


def likeness(recorded: Recorded, found: dict[tuple[str, int], dict[str, dict]]) -> Table:
    columns = [["samples", ""], ["ratio", "d"]]
    for driver in DRIVERS:
        columns += [[f"{driver}, dB", ".1f"], ["SSIM", ".3f"]]
    table = Table(f"The {recorded.title}", columns)
    for (noise, ratio), by_driver in found.items():
        row: list[Figure] = [noise, ratio]
        for driver in DRIVERS:
            row += [mean(by_driver[driver]["psnr"]), mean(by_driver[driver]["ssim"])]
        table.rows.append(row)
    return table


def bars(part: Part, recorded: Recorded, noise: str, by_driver: dict[str, dict]) -> None:
    ours = mean(by_driver["pointimage"]["psnr"])
    for other in ("1999", "frameless"):
        above = ours - mean(by_driver[other]["psnr"])
        what = f"render cache above {other}, ratio {BAR_RATIO}, {noise}, {recorded.title}"
        part.bars.append(Bar(what, f"{above:+.1f} dB", f"≥ {WANTED:g} dB", above >= WANTED))


def over_time(bench: Bench, recorded: Recorded, noise: str, by_driver: dict[str, dict]) -> Plot:
    series = {
        driver: [(frame / 30, psnr) for frame, psnr in zip(said["frames"], said["psnr"])]
        for driver, said in by_driver.items()
    }
    file = f"walk-{recorded.name}-{noise}.svg"
    title = f"The {recorded.title}, {noise} samples, one for {BAR_RATIO} pixels a frame"
    decibels_over_seconds(bench.plots / file, title, series)
    return Plot(f"benchmarks/{file}", title)


def ablation(bench: Bench, program: Path, recorded: Recorded, every: int, found: dict) -> Table:
    """What each stage brings at the ratio of the bar."""
    table = Table(f"The {recorded.title}, ratio {BAR_RATIO}: the render cache without a stage", [["without", ""]])
    drivers = tuple(f"pointimage-{stage}" for stage in STAGES)
    rows: dict[str, list[Figure]] = {"nothing": [], **{stage: [] for stage in STAGES}}
    for noise, paths in NOISES:
        table.columns += [[f"{noise}, dB", ".2f"], ["SSIM", ".3f"]]
        by_driver = shown(bench, program, recorded, paths, BAR_RATIO, "0..1000", every, drivers)
        by_driver["pointimage"] = found[noise, BAR_RATIO]["pointimage"]
        for name, row in rows.items():
            said = by_driver["pointimage" if name == "nothing" else f"pointimage-{name}"]
            row += [mean(said["psnr"]), mean(said["ssim"])]
    table.rows = [[name, *row] for name, row in rows.items()]
    return table
