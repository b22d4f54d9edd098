"""The ray caster beside Embree: the same triangles and rays, in one run."""

from __future__ import annotations

import json
import sys

from document import Bar, Part, Table
from harness import Bench
from program import Failed, run

# Targets as a share of Embree's rate: incoherent nearest hits at 10⁶ triangles ray by ray, and the
# 21 rays of a beam traced together.
SINGLE_BAR = 0.8
BEAM_BAR = 1.3
# Names of measurements in `scripts/embree-bench --json`, and the measurement of Embree to compare
# with.
KINDS = {
    "nearest": "incoherent, nearest",
    "occluded": "incoherent, occluded",
    "beam_nearest": "21 of a beam, one by one",
    "beam_together": "21 of a beam, together",
    "beam_occluded": "21 of a beam, occluded",
}


def embree(bench: Bench) -> Part:
    """Rays per second beside Embree's: the same triangles and rays, one thread each, alternating.
    """
    part = Part(
        "The ray caster beside Embree",
        [
            "`scripts/embree-bench`: Embree 4.4 (the `embreex` wheel), called ray by ray"
            " (`rtcIntersect1`, `rtcOccluded1`), and ours; M rays per second of processor time,"
            " runs by turns, the best of each. Ours is watertight always, Embree in its default"
            " mode is not. Embree's rate beside *together* is that of the same rays one by one."
        ],
    )
    command = [sys.executable, bench.root / "scripts/embree-bench", "--json"]
    command += ["--triangles", "1000,100000" if bench.quick else "1000,1000000"]
    room = bench.scenes.room().scene[0]
    if room.endswith(".obj"):
        command += ["--obj", room]
    else:
        part.skipped.append("the cabin is not in ../shared/scenes")
    try:
        said = run(command).stdout
    except Failed as error:
        part.skipped.append(f"Embree cannot be used here: {error}")
        return part
    table = Table(
        "",
        [
            ["scene", ""], ["triangles", ",d"], ["rays", ""], ["ours", ".2f"], ["Embree", ".2f"],
            ["ratio", ".2f"]
        ],
    )
    for row in json.loads(said[said.index("\n[") :]):
        for kind, title in KINDS.items():
            found = row[kind]
            table.rows.append(
                [
                    row["scene"], row["triangles"], title, found["ours"], found["embree"],
                    found["ratio"]
                ]
            )
        what = f"{row['scene']}, {row['triangles']:,} triangles"
        if row["triangles"] > 900_000:
            add(part, f"incoherent nearest hits, {what}", row["nearest"]["ratio"], SINGLE_BAR)
        add(part, f"21 rays of a beam together, {what}", row["beam_together"]["ratio"], BEAM_BAR)
    part.tables.append(table)
    return part


def add(part: Part, what: str, ratio: float, bar: float) -> None:
    part.bars.append(Bar(what, f"{ratio:.2f} × Embree's", f"≥ {bar:g} ×", ratio >= bar))
