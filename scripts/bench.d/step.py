"""A step within a room that was visible before, and the first view of a session, at the usual size
of a picture.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from document import Bar, Part, Table
from harness import Bench
from program import run
from rooms import decibels, denoiser, read
from scenes import CABIN_LIVING, Case

# Pictures of this size have the reference's shape: 960 × 720 pixels.
SIZE = "1280x720"
FILL = 60
# 0.4 m beside the view, in feet.
ASIDE = replace(CABIN_LIVING, vp="13.5,1.3,5")
# Seconds at the view before, and after the step.
BEFORE, STAY = 8.0, 3.5
# Seconds after the step, and the decibels wanted by then.
WANTED = {0.1: 28.0, 1.0: 31.0, 3.0: 33.0}
# The first picture after the step, and that of a session whose scene is loaded, are there by then.
MOST_STEP, MOST_FIRST = 0.25, 0.6


def step(bench: Bench) -> Part:
    """A step of 0.4 m in the cabin at 1280 × 720: pictures after 0.1, 1 and 3 s; a session's first one."""
    part = Part(
        "A step within a room",
        [
            (
                f"The cabin's three sections filled for {FILL} s by the default engine; then one"
                " session with a worker. Its first view is 0.4 m beside the living room's view,"
                f" which it goes to after {BEFORE:g} s; a picture was drawn 2 s earlier. Pictures"
                " have 960 × 720 pixels, and are averaged down to the reference's 320 × 240."
                " *Written* is when a picture was there, seconds after its view was asked for."
            ),
        ],
    )
    case = bench.scenes.room()
    if case.name != "cabin":
        part.skipped.append("needs ../shared")
        return part
    library, reason = denoiser(bench)
    if reason:
        part.skipped.append(f"pictures with the denoiser: {reason}")
    columns = [["", ""], ["first picture of the session, written, s", ".2f"]]
    for asked in WANTED:
        columns += [[f"at {asked:g} s, dB", ".1f"], ["written, s", ".2f"]]
    table = Table("The cabin's living room", columns)
    for title, way in [
        ("own filter", "off"),
        *([("Open Image Denoise", library)] if library else []),
    ]:
        table.rows.append(session(bench, part, case, title, way))
    part.tables.append(table)
    return part


def session(bench: Bench, part: Part, case: Case, title: str, way: str | Path) -> list:
    filled, _ = bench.fill("cabin-step", case, FILL)
    name = title.split()[0].lower()
    file = bench.work / f"step-{name}.holo"
    file.write_bytes(filled.read_bytes())
    first, before = (bench.work / f"step-{name}-{when}.pfm" for when in ("first", "before"))
    pictures = {asked: bench.work / f"step-{name}-{asked:g}.pfm" for asked in WANTED}
    lines = [
        f"0 view {ASIDE.line()}",
        f"0.1 picture {first}",
        f"{bench.seconds(BEFORE - 2)} picture {before}",
    ]
    lines += [f"{bench.seconds(BEFORE)} view {CABIN_LIVING.line()}"]
    lines += [f"{bench.seconds(asked)} picture {picture}" for asked, picture in pictures.items()]
    script = bench.work / f"step-{name}.txt"
    script.write_text("\n".join([*lines, f"{bench.seconds(STAY)} quit", ""]), encoding="utf-8")
    options = [
        "--headless", "--json", "--quiet", "--size", SIZE, "--driver", "surfaces", "--denoise", way
    ]
    said = run([bench.holodeck, "view", file, *options, "--script", script])
    reports = map(json.loads, filter(lambda line: line.startswith("{"), said.stdout.splitlines()))
    written = {report["picture"]: report["seconds"] for report in reports if "picture" in report}
    truth = read(case.reference.picture, case.size)
    row: list = [title, written[str(first)]]
    part.bars.append(
        Bar(
            f"{title}, first picture of a session", f"{row[1]:.2f} s", f"≤ {MOST_FIRST:g} s",
            row[1] <= MOST_FIRST
        )
    )
    for asked, picture in pictures.items():
        found, there, wanted = (
            decibels(picture, (truth, truth), case.size), written[str(picture)], WANTED[asked]
        )
        row += [found, there]
        part.bars.append(
            Bar(
                f"{title}, {asked:g} s after a step", f"{found:.1f} dB", f"≥ {wanted:g} dB",
                found >= wanted
            )
        )
    there = written[str(pictures[0.1])]
    part.bars.append(
        Bar(
            f"{title}, first picture after a step", f"{there:.2f} s", f"≤ {MOST_STEP:g} s",
            there <= MOST_STEP
        )
    )
    return row
