"""The render cache, stage by stage, as in Table 1 of its papers."""

from __future__ import annotations

import json

from document import Bar, Part, Table
from harness import Bench
from program import run

# Sides of the picture, and threads.
RUNS = (("256x256", 1), ("512x512", 1), ("1024x1024", 1), ("2048x2048", 1), ("1920x1080", 1), ("1920x1080", 2))
# For a whole frame.
BARS = {
    ("512x512", 1): ("ms", 2.0),
    ("1920x1080", 2): ("ms", 9.0),
    ("2048x2048", 1): ("ns_per_pixel", 9.0),
}
# Greatest time of a stage over the time to move its data once.
MOVED_BAR = 3.0
MOVED_AT = ("2048x2048", 1)


def rendercache(bench: Bench) -> Part:
    """Milliseconds of every stage at several sizes, against the time to move its data."""
    part = Part(
        "The render cache",
        [
            "`crates/driver-rendercache/examples/pointimage.rs`: 8,000 new samples a frame, the camera walking and turning (1.5 m/s, 30 degrees/s at "
            "30 frames/s), rays met with a formula outside of the time taken. Medians over frames. *Least* is the shortest frame of all: "
            "on a machine that is busy otherwise it is nearer to the truth. The second paper took 62 ms at 512×512 on a processor of 2001.",
            "The two projections take turns over portions of the points, z-buffer to interpolation over slabs of rows, so that the later "
            "ones find their data in the second cache. With two threads a stage's time is the first thread's; the total is the frame's.",
            "*Times moved*: against copying as many bytes as the stage reads and writes at least, half of them each way, at "
            "2048×2048, measured beside it. Projection and z-buffer scatter, sampling is a chain of additions: they have no such figure.",
        ],
    )
    example = bench.cargo.build("holo-driver-rendercache", "--example", "pointimage")
    found = {}
    for size, threads in RUNS:
        frames = 20 if bench.quick else 90
        command = [example, size, "--threads", str(threads), "--frames", str(frames), "--json"]
        found[size, threads] = json.loads(run(command).stdout)
    names = [f"{size}, {threads} thread{'s' if threads > 1 else ''}" for size, threads in RUNS]
    table = Table("Milliseconds", [["stage", ""], *([name, ".3f"] for name in names)])
    stages = [stage["stage"] for stage in found[RUNS[0]]["stages"]]
    times = {key: {stage["stage"]: stage for stage in said["stages"]} for key, said in found.items()}
    for stage in stages:
        table.rows.append([stage, *(times[key].get(stage, {}).get("ms") for key in RUNS)])
    for title, figure in (("Total", "ms"), ("Least", "least_ms"), ("Total, ns a pixel", "ns_per_pixel")):
        table.rows.append([title, *(found[key][figure] for key in RUNS)])
    part.tables.append(table)
    moved = Table("Streaming stages", [["stage", ""], ["ms", ".3f"], ["times moved", ".1f"]])
    for stage in stages:
        said = times[MOVED_AT].get(stage, {})
        if said.get("times_moved") is not None:
            moved.rows.append([stage, said["ms"], said["times_moved"]])
            met = said["times_moved"] <= MOVED_BAR
            part.bars.append(Bar(stage, f"{said['times_moved']:.1f} times moved", f"≤ {MOVED_BAR:g}", met))
    part.tables.append(moved)
    for key, (figure, most) in BARS.items():
        size, threads = key
        unit = "ms" if figure == "ms" else "ns a pixel"
        value = found[key][figure]
        what = f"{size}, {threads} thread{'s' if threads > 1 else ''}"
        least = found[key]["least_ms"] if figure == "ms" else found[key]["least_ms"] / found[key]["ms"] * value
        part.bars.append(Bar(what, f"{value:.2f} {unit} (least {least:.2f})", f"≤ {most:g} {unit}", value <= most))
    return part
