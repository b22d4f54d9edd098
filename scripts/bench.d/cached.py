"""The engine `cached` beside `path`: seconds to an error, bias, and the cost of many workers."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from document import Bar, Part, Table
from harness import Bench
from program import Failed, compare, run
from scenes import Case

# By scene: the error to reach, and the allowed time over that of `path`.
WANTED = {"cornell": (0.005, 0.15), "cabin": (0.02, 0.3), "corridor": (0.03, 0.3)}
# Settings to try, coarse ones first. The quickest that reaches the error counts.
ACCURACIES = (0.3, 0.2, 0.1, 0.06, 0.03)
COUNTS = (1, 2, 3, 4, 6, 8)
BIAS_BAR = 0.01
BLOCK_BAR = 0.05
# Limits for many workers over one: CPU seconds per sample, and rays of records.
MANY = 8
SHARING_BAR = 1.1
# Limits for a warm sample over one path: least rate, greatest variance.
RATE_BAR = 0.5
VARIANCE_BAR = 1 / 30
# A view at rest: the times of its pictures, the time when it has settled, and the greatest change
# between pictures.
REST = (2, 4, 6, 8, 10, 20, 30, 40)
SETTLED = 10
ACCURACY = 0.03


def cached(bench: Bench) -> Part:
    """Time to an error with indirect light from records; bias; cost of many workers."""
    part = Part(
        "Clean samples: the engine `cached`",
        [
            (
                "*Seconds to an error*: of `path`, from its error at 64 paths per pixel (relMSE"
                " falls as 1/paths); of `cached`, of the quickest of several settings that reaches"
                " it, its cache empty at the start. *At the default accuracy*: 64 paths per pixel;"
                " *worst block* of the lit 16 × 16 ones: its error as it is, and with its variance"
                " by both pictures' standard errors taken off. The corridor's truth is a long"
                " render of our own by `path`, made once."
            ),
            (
                f"*Sharing*: the same job by one worker and by {MANY}, one thread each; the rays of"
                " records are work that would be done several times if workers did not tell each"
                f" other. Preparing the scene, which every worker does once, is said apart. {MANY}"
                " programs on fewer cores take turns and push each other's data out of the caches:"
                " what each costs more than alone is measured with renders by `path`, which share"
                " nothing."
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
    seconds = Table(
        "Seconds to an error",
        [
            ["scene", ""], ["relMSE", ".3f"], ["path, s", ".2f"], ["cached, s", ".2f"],
            ["ratio", ".2f"], ["accuracy", "g"], ["paths", "d"]
        ],
    )
    bias = Table(
        "At the default accuracy",
        [
            ["view", ""], ["seconds", ".1f"], ["relMSE", ".4f"], ["bias", "+.2%"],
            ["worst block", ".1%"], ["without noise", ".1%"]
        ],
    )
    for case in (*bench.scenes.referenced(), bench.scenes.corridor()):
        if case.name in WANTED:
            seconds.rows.append(to_error(bench, part, case))
        truth, error = bench.truth(case), bench.work / f"{case.name}-cached-se.pfm"
        picture, said = bench.render(
            case, "cached", "--engine", "cached", "--spp", str(bench.paths(64)), "--se", error
        )
        theirs = ("--reference-se", case.reference.standard_error) if case.reference else ()
        found = compare(bench.holodeck, picture, truth, "--se", error, *theirs)
        worst = found["worst_block_beyond_noise"]
        bias.rows.append(
            [
                case.title, said["seconds"], found["relmse_trim"], found["bias"],
                found["worst_block"], worst
            ]
        )
        part.bars.append(
            Bar(
                f"bias, {case.title}", f"{found['bias']:+.2%}", f"≤ {BIAS_BAR:.0%}",
                abs(found["bias"]) <= BIAS_BAR
            )
        )
        part.bars.append(
            Bar(
                f"worst block without noise, {case.title}", f"{worst:.1%}", f"≤ {BLOCK_BAR:.0%}",
                worst <= BLOCK_BAR
            )
        )
    if not bench.scenes.referenced():
        part.skipped.append("../shared is not there: of references only our own of the corridor")
    part.tables += [seconds, bias, warm(bench, part), flicker(bench, part), sharing(bench, part)]
    return part


def to_error(bench: Bench, part: Part, case: Case) -> list:
    """Returns a row: the seconds of both engines to the case's error."""
    wanted, bar = WANTED[case.name]
    truth = bench.truth(case)
    picture, said = bench.render(case, "to-error", "--spp", str(bench.paths(64)))
    paths_seconds = (
        said["seconds"] * compare(bench.holodeck, picture, truth)["relmse_trim"] / wanted
    )
    best = None
    for accuracy in ACCURACIES:
        for count in COUNTS:
            picture, said = bench.render(
                case, "to-error", "--engine", "cached", "--accuracy", str(accuracy), "--spp",
                str(count)
            )
            if best and said["seconds"] >= best[0]:
                break
            if compare(bench.holodeck, picture, truth)["relmse_trim"] <= wanted:
                best = (said["seconds"], accuracy, count)
                break
    if not best:
        part.bars.append(
            Bar(
                f"seconds to relMSE {wanted:g}, {case.title}", "never", f"≤ {bar:g} × path's", False
            )
        )
        return [case.title, wanted, paths_seconds, None, None, None, None]
    ratio = best[0] / paths_seconds
    part.bars.append(
        Bar(
            f"seconds to relMSE {wanted:g}, {case.title}", f"{ratio:.2f} × path's", f"≤ {bar:g} ×",
            ratio <= bar
        )
    )
    return [case.title, wanted, paths_seconds, best[0], ratio, best[1], best[2]]


def warm(bench: Bench, part: Part) -> Table:
    table = Table(
        "A sample, its surroundings known",
        [["scene", ""], ["path, M/s", ".3f"], ["variance", ".4f"], ["cached, M/s", ".3f"],
         ["variance", ".5f"], ["rate", ".2f"], ["variance, one of", ".0f"]],
    )  # fmt: skip
    program = bench.cargo.build("holo-tracer", "--example", "warm")
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        if not case.scene[0].endswith(".obj"):
            part.skipped.append(
                f"a warm sample of the {case.title}: the example takes plain OBJ files"
            )
            continue
        found = json.loads(
            run([program, case.scene[0], case.view.vp, case.view.vd, f"{case.view.vh:g}"]).stdout
        )
        rate, variance = (
            found[f"cached_{what}"] / found[f"path_{what}"] for what in ("rate", "variance")
        )
        table.rows.append([case.title, found["path_rate"] / 1e6, found["path_variance"],
                           found["cached_rate"] / 1e6, found["cached_variance"], rate,
                           1 / variance])  # fmt: skip
        if case.name == "cabin":
            part.bars.append(
                Bar(
                    "samples a second, warm, over paths', cabin", f"{rate:.2f} ×",
                    f"≥ {RATE_BAR:g} ×", rate >= RATE_BAR
                )
            )
            part.bars.append(
                Bar(
                    "variance of such a sample, cabin", f"1/{1 / variance:.0f}", "≤ 1/30",
                    variance <= VARIANCE_BAR
                )
            )
    return table


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
        filled, _ = bench.fill(f"{case.name}-cached", case, seconds, "--engine", "cached")
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
                # During the first step records are still made, or the view's own samples arrive.
                worst = {kind: max(values[1:]) for kind, values in of.items()}
                if file is None:
                    for kind in ("as displayed", "away from the reference"):
                        worst[f"{kind}, settled"] = max(
                            value for value, (since, _) in zip(of[kind], steps) if since >= SETTLED
                        )
                for kind, value in worst.items():
                    title = f"flicker, {case.title}, {driver}, {state} file, {kind}"
                    part.bars.append(
                        Bar(title, f"{value:.1%}", f"≤ {ACCURACY:.0%}", value <= ACCURACY)
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
    opened = [*case.scene, "--engine", "cached"]
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
        [["scene", ""], ["workers", "d"], ["samples", ",d"], ["records", ",d"],
         ["rays of records", ",d"],
         ["CPU s, scene prepared", ".1f"], ["CPU s, preparing", ".1f"], ["µs a sample", ".1f"]],
    )  # fmt: skip
    for case, samples in ((bench.scenes.cornell(), 4_000_000), (bench.scenes.room(), 1_000_000)):
        found = {}
        for workers in (1, 2, MANY):
            prepared = cpu_of_fill(bench, case, workers, 1)[0]
            cpu, info = cpu_of_fill(bench, case, workers, bench.paths(samples))
            found[workers] = ((cpu - prepared) / info["samples"], info["light_rays"])
            table.rows.append([case.title, workers, info["samples"], info["light_records"],
                               info["light_rays"], cpu - prepared, prepared,
                               found[workers][0] * 1e6])  # fmt: skip
        time, rays = (many / one for many, one in zip(found[MANY], found[1]))
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
        part.bars.append(
            Bar(
                f"rays of records, the same, {case.title}", f"{rays:.2f} ×", f"≤ {SHARING_BAR:g} ×",
                rays <= SHARING_BAR
            )
        )
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
            bench.holodeck, "fill", *case.scene, "-o", file, "--engine", "cached", "--samples", "1",
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
