"""Recorded walks with tracing in lockstep with frames: every driver's likeness to the converged
pictures, by samples per frame, with and without noise.

Invariants: the results of a driver depend only on program, scene, walk and request. They are kept
under target/, so an interrupted run continues where it stopped.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from document import Bar, Figure, Part, Plot, Table
from harness import Bench
from plot import decibels_over_seconds
from program import run

DRIVERS = (
    "pointimage", "pointimage-live", "1999", "frameless", "frameless-live", "quadtree", "surfaces"
)
# The render cache without one of its stages.
STAGES = (
    "noise", "prediction", "prefilter", "pyramid", "eviction", "ageing", "cull", "interpolation",
    "dither",
)
# Pixels per new sample of a frame, and the number of frames. With as many samples as pixels, part
# of the walk suffices.
WHOLE = "0..1000"
RATIOS = ((1, "120..180"), (8, WHOLE), (64, WHOLE), (256, WHOLE), (1024, WHOLE))
BAR_RATIO = 64
# Most paths a pixel of a converged picture.
MOST_TRUTH_PATHS = 256
# Paths per sample.
NOISES = (("noisy", 1), ("clean", 16))
# Targets: decibels of the render cache above its first paper, and above frameless.
WANTED = 3.0
# Target: decibels that the driver of a session may lose against the library.
LIVE_LOSS = 1.0

# The example's report on drivers, by kind of samples and ratio.
Found = dict[tuple[str, int], dict[str, dict]]


@dataclass(frozen=True)
class Recorded:
    """A walk and its scene."""

    name: str
    title: str
    scene: Path
    walk: Path


@dataclass(frozen=True)
class Job:
    """One run of the example, with drivers that get the same samples."""

    recorded: Recorded
    every: int
    frames: str
    ratio: int = BAR_RATIO
    paths: int = 1
    drivers: tuple[str, ...] = DRIVERS


def walk(bench: Bench) -> Part:
    """Recorded walks through interior and cabin with every driver."""
    every = 90 if bench.quick else 30
    part = Part(
        "A recorded walk",
        [
            (
                "`crates/view/drivers/examples/walk`: rest, turns of 90 to 120 degrees a second, a"
                " walk of 1.5 to 2 m/s through a door, rest, at 30 frames a second and 320×240. In"
                " each frame a driver gets pixels / *ratio* new samples that it asked for in the"
                " frame before; the next frame's view is what is predicted. Direct light and"
                f" mirrors; *noisy* samples are of one path, *clean* of 16. Every {every}th frame"
                f" is held against a render of relMSE ≤ 0.005 where {MOST_TRUTH_PATHS} paths do. *1999*: the"
                " stages of the render cache's first paper; it keeps its last colours and smooths"
                " everywhere. *-live*: the driver as a session uses it, with rays that can be"
                " stored, ten bytes a sample and no stated noise. `quadtree` and `surfaces` keep"
                " all samples so far, as a server"
                " would, and ask anywhere in the picture: a section's ray, mostly of the best one,"
                " as displays weigh beams, and where there is none a ray traced for its view"
                " alone. PSNR as displayed, and structural similarity of luminance as displayed,"
                f" means over frames. With ratio 1, frames {RATIOS[0][1]} only."
            ),
        ],
    )
    program = bench.cargo.build("holo-drivers", "--example", "walk")
    ratios = RATIOS[1:3] if bench.quick else RATIOS
    for recorded in walks(bench, part):
        # Converged pictures are made once for all.
        run([*asking(bench, program, Job(recorded, every, WHOLE)), "--truths-only"])
        jobs = [
            Job(recorded, every, frames, ratio, paths, drivers)
            for ratio, frames in ratios
            for _, paths in NOISES
            # A strip shows all drivers. Otherwise each driver has its own run, because they are
            # independent.
            for drivers in ([DRIVERS] if ratio == BAR_RATIO else [(driver,) for driver in DRIVERS])
        ]
        stages = tuple(f"pointimage-{stage}" for stage in STAGES)
        jobs += [Job(recorded, every, WHOLE, BAR_RATIO, paths, stages) for _, paths in NOISES]
        found: Found = {(noise, ratio): {} for noise, _ in NOISES for ratio, _ in ratios}
        names = {paths: noise for noise, paths in NOISES}
        # Nothing is timed, so the runs may share the cores.
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for job, by_driver in zip(jobs, pool.map(lambda job: shown(bench, program, job), jobs)):
                found[names[job.paths], job.ratio] |= by_driver
        part.tables.append(likeness(recorded, found))
        for noise, paths in NOISES:
            by_driver = found[noise, BAR_RATIO]
            bars(part, recorded, noise, by_driver)
            part.plots.append(over_time(bench, recorded, noise, by_driver))
            strip = f"walk-{recorded.name}-{paths}-{BAR_RATIO}.png"
            caption = (
                f"The {recorded.title}, {noise} samples: the truth, {', '.join(DRIVERS)} from"
                " above, five moments"
            )
            part.plots.append(Plot(f"benchmarks/{strip}", caption))
        part.tables.append(ablation(recorded, found))
    return part


def walks(bench: Bench, part: Part) -> list[Recorded]:
    recordings = bench.root / "crates/view/drivers/examples/walk/walks"
    interior = bench.scenes.bundle() / "interior.obj"
    found = [Recorded("interior", "bundled interior", interior, recordings / "interior.walk")]
    cabin = bench.shared / "scenes/cabin/cabin.obj"
    if cabin.exists():
        found.append(Recorded("cabin", "cabin", cabin, recordings / "cabin.walk"))
    else:
        part.skipped.append("the cabin is not in ../shared/scenes")
    return found


def asking(bench: Bench, program: Path, job: Job) -> list[str | Path]:
    """Returns the example's command, without a folder for its results. Converged pictures are kept
    between runs until the scene or the walk changes.
    """
    scene, walk = job.recorded.scene, job.recorded.walk
    state = hashlib.sha256(scene.read_bytes() + walk.read_bytes()).hexdigest()[:12]
    # A smoke run uses its own, noisier pictures.
    most = 64 if bench.quick else MOST_TRUTH_PATHS
    truths = bench.root / "target/walk-truths" / f"{job.recorded.name}-{state}-{most}"
    return [program, scene, walk, "--truths", truths, "--bounces", "0", "--paths", str(job.paths),
            "--ratio", str(job.ratio), "--frames", job.frames, "--every", str(job.every),
            "--truth-paths", str(most)]  # fmt: skip


def shown(bench: Bench, program: Path, job: Job) -> dict[str, dict]:
    """Returns the example's report on each driver, from this run or an earlier one."""
    files = (program, job.recorded.scene, job.recorded.scene.with_suffix(".mtl"), job.recorded.walk)
    state = [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
    asked = (job.ratio, job.paths, job.frames, job.every, bench.quick, *job.drivers)
    kept = (
        bench.root
        / "target/walk-said"
        / hashlib.sha256(repr((state, asked)).encode()).hexdigest()[:24]
    )
    said = kept / "said"
    if not said.exists():
        command = [*asking(bench, program, job), "--drivers", ",".join(job.drivers), "--out", kept]
        saying = run(command).stdout
        (kept / "saying").write_text(saying, encoding="utf-8")
        (kept / "saying").rename(said)
    if job.drivers == DRIVERS:
        bench.plots.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(
            kept / "strip.png",
            bench.plots / f"walk-{job.recorded.name}-{job.paths}-{job.ratio}.png",
        )
    return {
        line["driver"]: line
        for line in map(json.loads, said.read_text(encoding="utf-8").splitlines())
    }


def likeness(recorded: Recorded, found: Found) -> Table:
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
    lost = ours - mean(by_driver["pointimage-live"]["psnr"])
    what = f"render cache of a session below the library, {noise}, {recorded.title}"
    part.bars.append(Bar(what, f"{lost:+.1f} dB", f"≤ {LIVE_LOSS:g} dB", lost <= LIVE_LOSS))


def over_time(bench: Bench, recorded: Recorded, noise: str, by_driver: dict[str, dict]) -> Plot:
    series = {
        driver: [
            (frame / 30, psnr)
            for frame, psnr in zip(by_driver[driver]["frames"], by_driver[driver]["psnr"])
        ]
        for driver in DRIVERS
    }
    file = f"walk-{recorded.name}-{noise}.svg"
    title = f"The {recorded.title}, {noise} samples, one for {BAR_RATIO} pixels a frame"
    decibels_over_seconds(bench.plots / file, title, series)
    return Plot(f"benchmarks/{file}", title)


def ablation(recorded: Recorded, found: Found) -> Table:
    """Returns the gain of each stage at the ratio of the target."""
    table = Table(
        f"The {recorded.title}, ratio {BAR_RATIO}: the render cache without a stage",
        [["without", ""]],
    )
    for noise, _ in NOISES:
        table.columns += [[f"{noise}, dB", ".2f"], ["SSIM", ".3f"]]
    for name in ("nothing", *STAGES):
        row: list[Figure] = [name]
        for noise, _ in NOISES:
            said = found[noise, BAR_RATIO][
                "pointimage" if name == "nothing" else f"pointimage-{name}"
            ]
            row += [mean(said["psnr"]), mean(said["ssim"])]
        table.rows.append(row)
    return table
