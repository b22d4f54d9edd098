"""The render cache, stage by stage, as in Table 1 of its papers."""

from __future__ import annotations

import json

from document import Bar, Part, Table
from harness import Bench
from program import run

# Sides of the picture, and threads.
RUNS = (
    ("256x256", 1), ("512x512", 1), ("1024x1024", 1), ("2048x2048", 1), ("1920x1080", 1),
    ("1920x1080", 2)
)
# For a whole frame.
BARS = {
    ("512x512", 1): ("ms", 2.0),
    ("1920x1080", 2): ("ms", 9.0),
    ("2048x2048", 1): ("ns_per_pixel", 9.0),
}


def rendercache(bench: Bench) -> Part:
    """Milliseconds of every stage at several sizes."""
    part = Part(
        "The render cache",
        [
            (
                "`crates/show/driver-rendercache/examples/pointimage.rs`: 8,000 new samples a frame. The"
                " camera walks and turns (1.5 m/s, 30 degrees/s at 30 frames/s). A formula answers"
                " the rays outside of the time taken. Times are medians over frames. *Least* is the"
                " shortest frame of all: on a busy machine it is nearer to the truth. The second"
                " paper took 62 ms at 512×512 on a processor of 2001."
            ),
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
    times = {
        key: {stage["stage"]: stage for stage in said["stages"]} for key, said in found.items()
    }
    for stage in stages:
        table.rows.append([stage, *(times[key].get(stage, {}).get("ms") for key in RUNS)])
    for title, figure in (
        ("Total", "ms"), ("Least", "least_ms"), ("Total, ns a pixel", "ns_per_pixel")
    ):
        table.rows.append([title, *(found[key][figure] for key in RUNS)])
    part.tables.append(table)
    for key, (figure, most) in BARS.items():
        size, threads = key
        unit = "ms" if figure == "ms" else "ns a pixel"
        value = found[key][figure]
        what = f"{size}, {threads} thread{'s' if threads > 1 else ''}"
        least = (
            found[key]["least_ms"]
            if figure == "ms"
            else found[key]["least_ms"] / found[key]["ms"] * value
        )
        part.bars.append(
            Bar(
                what, f"{value:.2f} {unit} (least {least:.2f})", f"≤ {most:g} {unit}", value <= most
            )
        )
    return part
