"""The engine `gather` beside `path`: error for a processor's time, bias, pictures at rest, and the
cost of many workers.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from document import Bar, Part, Table
from harness import Bench
from program import Failed, compare, run
from scenes import Case
from small_scenes import small_scenes

# Paths per pixel, and the greatest cost over that of `path`.
COUNTS = {1: 1.0, 4: 0.6, 16: 0.4}
BIAS_BAR = 0.01
BLOCK_BAR = 0.05
# Limit for many workers over one: CPU seconds per sample.
MANY = 8
SHARING_BAR = 1.1
# A view at rest: the times of its pictures, the time when it has settled, and the greatest change
# between pictures.
REST = (2, 4, 6, 8, 10, 20, 30, 40)
SETTLED = 10
REST_BAR = 0.03


def gather(bench: Bench) -> Part:
    """Error for a processor's time beside `path`; bias; pictures at rest; cost of many workers."""
    part = Part(
        "Paths that end in shared light: the engine `gather`",
        [
            (
                "*Cost* is relMSE × processor seconds of the whole program, its cells empty at the"
                " start, over that of `path` with as many paths per pixel. *Bias* and *worst block*"
                " of the lit 16 × 16 ones are at 16 paths per pixel; the block's error is as it is,"
                " and with its variance by both pictures' standard errors taken off, which leaves"
                " the error that its pixels share."
            ),
            (
                f"*Sharing*: the same job by one worker and by {MANY}, one thread each. Preparing"
                f" the scene, which every worker does once, is said apart. {MANY} programs on fewer"
                " cores take turns and push each other's data out of the caches: what each costs"
                " more than alone is measured with renders by `path`, which share nothing."
            ),
            (
                "*A view at rest* of a filled file (Cornell box 20 s, cabin 60 s) after the first"
                " seconds, in which its own samples come; one of an empty file settles first:"
                " where samples are few, means are over wide parts of a surface, and become"
                f" narrower as samples tell that they may not be; from {SETTLED} s on it has. As"
                " displayed: what is brighter than the 95th percentile is white; as radiance, a"
                " pixel at the edge of a lamp 500 times as bright as the wall decides about its"
                " whole block. Away from the reference: by how much a block's error as displayed"
                " grows; a picture that becomes sharper changes, too, but towards it."
            ),
        ],
    )
    columns = [["scene", ""]]
    for count in COUNTS:
        columns += [[f"{count}: path, relMSE", ".4f"], ["s", ".1f"], ["gather, relMSE", ".4f"],
                    ["s", ".1f"], ["cost", ".2f"]]  # fmt: skip
    cost = Table("Cost by paths per pixel", columns)
    bias = Table(
        "Bias",
        [["scene", ""], ["bias", "+.2%"], ["worst block", ".1%"], ["without noise", ".1%"]],
    )
    for case in cases(bench):
        truth = bench.truth(case)
        row: list = [case.title]
        for count, bar in COUNTS.items():
            costs = []
            for engine in ("path", "gather"):
                picture, seconds = traced(bench, case, engine, count)
                found = compare(bench.holodeck, picture, truth)["relmse_trim"]
                row += [found, seconds]
                costs.append(found * seconds)
            ratio = costs[1] / costs[0]
            row.append(ratio)
            part.bars.append(
                Bar(
                    f"cost over that of path at {count} paths, {case.title}", f"{ratio:.2f} ×",
                    f"≤ {bar:g} ×", ratio <= bar
                )
            )
        cost.rows.append(row)
        bias.rows.append(biased(bench, part, case, truth))
    if not bench.scenes.referenced():
        part.skipped.append("../shared is not there: of references only our own")
    part.tables += [cost, bias, flicker(bench, part), sharing(bench, part)]
    return part


def cases(bench: Bench) -> list[Case]:
    small = small_scenes(bench.work / "small", bench.scenes.bundle())
    return [*bench.scenes.referenced(), bench.scenes.corridor(), *small]


def traced(bench: Bench, case: Case, engine: str, count: int) -> tuple[Path, float]:
    """Renders a picture; returns it and the processor seconds of the whole program."""
    picture = bench.work / f"{case.name}-{engine}-{count}.pfm"
    command = [
        bench.holodeck, "render", *case.scene, *case.view.options(), "--size", case.size,
        "--engine", engine, "--spp", str(count), "--quiet", "-o", picture
    ]
    return picture, run(command).processor


def biased(bench: Bench, part: Part, case: Case, truth: Path) -> list:
    """Returns a row: the bias of a picture of 16 paths per pixel, and its worst block."""
    error = bench.work / f"{case.name}-gather-se.pfm"
    picture, _ = bench.render(
        case, "gather", "--engine", "gather", "--spp", str(bench.paths(16)), "--se", error
    )
    theirs = ("--reference-se", case.reference.standard_error) if case.reference else ()
    found = compare(bench.holodeck, picture, truth, "--se", error, *theirs)
    worst = found["worst_block_beyond_noise"]
    for what, value, bar in (
        ("bias", found["bias"], BIAS_BAR), ("worst block without noise", worst, BLOCK_BAR)
    ):
        part.bars.append(
            Bar(f"{what}, {case.title}", f"{value:+.2%}", f"≤ {bar:.0%}", abs(value) <= bar)
        )
    return [case.title, found["bias"], found["worst_block"], worst]


def flicker(bench: Bench, part: Part) -> Table:
    """Measures how much pictures of a view at rest differ, block by block, while samples arrive."""
    steps = list(zip(REST, REST[1:]))
    columns = [
        ["scene", ""], ["file", ""], ["driver", ""], ["", ""],
        *([f"{a} to {b} s", ".2%"] for a, b in steps)
    ]
    table = Table(
        "A view at rest: the worst lit 16 × 16 block from one picture to the next", columns
    )
    for case, seconds in ((bench.scenes.cornell(), 20), (bench.scenes.room(), 60)):
        filled, _ = bench.fill(f"{case.name}-gather", case, seconds, "--engine", "gather")
        for state, file in (("filled", filled), ("empty", None)):
            for driver in ("surfaces", "quadtree"):
                changes = changes_at_rest(bench, case, driver, file)
                kinds = {
                    "as displayed": "worst_block_shown", "radiance": "worst_block",
                    "away from the reference": "worst_block_away"
                }
                of = {
                    kind: [change[measure] for change in changes] for kind, measure in kinds.items()
                }
                for kind, values in of.items():
                    table.rows.append([case.title, state, driver, kind, *values])
                # During the first step the view's own samples arrive.
                worst = {kind: max(values[1:]) for kind, values in of.items()}
                if file is None:
                    for kind in ("as displayed", "away from the reference"):
                        worst[f"{kind}, settled"] = max(
                            value for value, (since, _) in zip(of[kind], steps) if since >= SETTLED
                        )
                for kind, value in worst.items():
                    title = f"flicker, {case.title}, {driver}, {state} file, {kind}"
                    part.bars.append(
                        Bar(title, f"{value:.1%}", f"≤ {REST_BAR:.0%}", value <= REST_BAR)
                    )
    return table


def changes_at_rest(
    bench: Bench, case: Case, driver: str, filled: Path | None
) -> list[dict[str, float]]:
    """Runs a session that looks at a case's view, with a filled file or an empty one, and compares
    each picture with the one before.
    """
    pictures = [bench.work / f"rest-{at}.pfm" for at in REST]
    lines = [
        f"0 view {case.view.line()}",
        *(f"{bench.seconds(at)} picture {path}" for at, path in zip(REST, pictures)), "quit"
    ]
    script = bench.work / "rest.txt"
    script.write_text("\n".join([*lines, ""]), encoding="utf-8")
    opened = [*case.scene, "--engine", "gather"]
    if filled is not None:
        # The session adds to the file, so each session gets the same copy.
        file = bench.work / "rest.holo"
        file.write_bytes(filled.read_bytes())
        opened = [file]
    run(
        [
            bench.holodeck, "view", *opened, "--driver", driver, "--headless", "--quiet", "--size",
            case.size, "--script", script
        ]
    )
    truth = bench.truth(case)
    away = [
        compare(bench.holodeck, after, truth, "--before", before)
        for before, after in zip(pictures, pictures[1:])
    ]
    return [
        compare(bench.holodeck, after, before) | {"worst_block_away": found["worst_block_away"]}
        for found, before, after in zip(away, pictures, pictures[1:])
    ]


def sharing(bench: Bench, part: Part) -> Table:
    table = Table(
        "Sharing",
        [["scene", ""], ["workers", "d"], ["samples", ",d"], ["cells", ",d"],
         ["CPU s, scene prepared", ".1f"], ["CPU s, preparing", ".1f"], ["µs a sample", ".1f"]],
    )  # fmt: skip
    for case, samples in ((bench.scenes.cornell(), 4_000_000), (bench.scenes.room(), 1_000_000)):
        found = {}
        for workers in (1, 2, MANY):
            prepared = cpu_of_fill(bench, case, workers, 1)[0]
            cpu, info = cpu_of_fill(bench, case, workers, bench.paths(samples))
            found[workers] = (cpu - prepared) / info["samples"]
            table.rows.append([case.title, workers, info["samples"], info["cells"],
                               cpu - prepared, prepared, found[workers] * 1e6])  # fmt: skip
        time = found[MANY] / found[1]
        part.bars.append(
            Bar(
                f"CPU seconds per sample, {MANY} workers over one, {case.title}", f"{time:.2f} ×",
                f"≤ {SHARING_BAR:g} ×", time <= SHARING_BAR
            )
        )
        apart = time / crowding(bench, case)
        title = (
            f"the same over what {MANY} programs that share nothing cost more than one,"
            f" {case.title}"
        )
        part.bars.append(Bar(title, f"{apart:.2f} ×", f"≤ {SHARING_BAR:g} ×", apart <= SHARING_BAR))
    return table


def crowding(bench: Bench, case: Case) -> float:
    """Returns the CPU seconds of a single-threaded program beside as many copies as there are
    workers, over those of one alone.
    """
    scene = [*case.scene, *case.view.options(), "--size", case.size, "--threads", "1", "--quiet"]
    cpu = {}
    for count in (1, MANY):
        commands = [
            [
                bench.holodeck, "render", *scene, "--spp", bench.paths(16), "-o",
                bench.work / f"crowd-{one}.pfm"
            ]
            for one in range(count)
        ]
        started = [subprocess.Popen([str(word) for word in command]) for command in commands]
        cpu[count] = sum(waited(process) for process in started) / count
    return cpu[MANY] / cpu[1]


def waited(process: subprocess.Popen) -> float:
    """Waits for a program and returns its CPU seconds."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise Failed(f"a program ended with status {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def cpu_of_fill(bench: Bench, case: Case, workers: int, samples: int) -> tuple[float, dict]:
    """Returns the CPU seconds that single-threaded workers take to add samples to a new file, and
    the result of `info` about it.
    """
    file: Path = bench.work / "sharing.holo"
    file.unlink(missing_ok=True)
    # A nearly empty file, then a server and workers started by hand.
    run(
        [
            bench.holodeck, "fill", *case.scene, "-o", file, "--engine", "gather", "--samples", "1",
            "--quiet"
        ]
    )
    command = [
        bench.holodeck, "holoserver", file, "--listen", "127.0.0.1:0", "--fill", "--samples",
        samples, "--quiet", "--with-parent"
    ]
    words = [str(word) for word in command]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as server:
        address = (server.stdout.readline().split() or [""])[-1]
        worker = [
            str(bench.holodeck), "rtworker", "--connect", address, "--threads", "1", "--quiet"
        ]
        started = [subprocess.Popen(worker) for _ in range(workers)]
        cpu = sum(waited(process) for process in started)
        server.wait()
    return cpu, json.loads(run([bench.holodeck, "info", file, "--json"]).stdout)
