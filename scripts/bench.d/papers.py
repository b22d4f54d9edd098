"""The tables of the five papers, and their figures with numbers, each beside ours.

Invariants: a figure that another part measures is taken from the document, with the version that it
was measured with. What only this part measures is on the bundled scenes and on those of
`holo-scenes papers`, so it needs nothing outside of the repository.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import sessions
from document import Bar, Figure, Part, Table
from edges import read, shown, white
from harness import Bench
from program import compare, run
from scenes import Case, View
from walk import Job, Recorded
from walk import shown as walked

TABLE_WORKERS = (0, 1, 2, 4)
TABLE_FILL = 10
# Machine, driver, scene, processes, and samples rendered and recalled a second (Larson & Simmons
# 1999, Table 1), and the interactive session of its section 3.
TABLE_OF_1999 = (
    ("SGI O2, QTre, conference room", 0, 0, 15_000),
    ("SGI O2, QTre, conference room", 1, 140, 13_000),
    ("SGI O2, Vor, conference room", 1, 130, 6_500),
    ("SGI O2, Mesh, conference room", 1, 112, 3_200),
    ("SGI O2, Vor, cabin", 1, 410, 5_900),
    ("SGI O2, Vor, tower", 1, 180, 9_200),
    ("SGI Onyx2, Vor, tower", 1, 360, 30_000),
    ("SGI Onyx2, Vor, tower", 21, 6_500, 35_000),
    ("SGI Onyx, Vor, office (section 3)", 14, 1_200, 41_000),
)  # fmt: skip
# Recalled samples a second of the quickest machine of that table.
MOST_RECALLED_1999 = 41_000
# Share of the recall of a session without tracing that one with a worker has: 13,000 of 15,000.
RECALL_KEPT_1999 = 13 / 15

# Linear speed-up of the first paper, with 24 processes; ours has to be as good on two cores.
SPEED_UP_1999 = 0.96
SPEED_UP_SECONDS = 8.0

# Seconds of Images 9a and 9b.
CARVED_AT = (10.0, 60.0)
CARVED_DRIVERS = ("cells", "surfaces")
GLASS_AT = 30.0
# Degrees of the step aside, and seconds after it.
GLASS_STEP, GLASS_STEPPED = 5.0, 0.5
TRUTH_PATHS = 512

MIRROR_DRIVERS = ("quadtree", "cells", "mesh", "pointimage")
MIRROR_SAMPLES = (10_000, 100_000, 1_000_000)
# The mirror of `holo-scenes papers`: its plane's y, and its ends along x and z, metres.
MIRROR_PLANE, MIRROR_X, MIRROR_Z = 1.98, (0.5, 1.9), (1.0, 1.9)
# Pixels between the mirror's edge and the farthest that counts as near it.
NEAR_EDGE = 2

# Frames before the jump, when the cache is full of the other room, and the ratio of pixels to new
# samples.
JUMP_AFTER, JUMP_RATIO = 90, 64
JUMP_DRIVERS = ("pointimage", "1999", "frameless", "quadtree")
REFILLED = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
# Decibels that the cache with a tenth of its points relevant may lack against all of them.
USABLE = 3.0

# Seconds of the stages of a frame of 256 × 256 pixels on a MIPS R10000 of 195 MHz (1999, Table 1),
# and milliseconds at 512 × 512 on a Pentium 4 of 1.7 GHz (2002, Table 1). Ours has no stages of its
# own for clearing buffers and for the copy to the screen.
STAGES = (
    ("Initialize buffers", 4.6, None, ()),
    ("Update points", 2.7, 7.7, ("Update Points",)),
    ("Predicted projection", None, 7.9, ("Predicted Projection",)),
    ("Predicted sampling", None, 0.2, ("Predicted Sampling",)),
    ("Project and tile sort", 32.8, 15.8, ("Project and Tile Sort",)),
    ("Z-buffer tiles", None, 8.9, ("Z-Buffer Tiles",)),
    ("Depth cull", 8.5, 3.2, ("Depth Cull",)),
    ("Pyramid (ours)", None, None, ("Pyramid",)),
    ("Prefilter", None, 5.9, ("Prefilter",)),
    ("Interpolate and smooth", 13.9, 6.5, ("Interpolate / Smooth",)),
    ("Display image", 2.7, None, ()),
    ("Sampling: request new samples", 5.3, 6.0, ("Sampling",)),
    ("Total", 70.5, 62.1, ("Total",)),
)  # fmt: skip

# QSplat's table: model, then interactive and static (Rusinkiewicz & Levoy 2000, as the lecture has
# it).
QSPLAT = {
    "traversal, ms": ("22; 448", "30; 392", "27; 951"),
    "position and size, ms": ("19; 126", "30; 307", "31; 879"),
    "culling (frustum and back faces), ms": ("2; 26", "3; 28", "2; 38"),
    "drawing, ms": ("77; 664", "46; 324", "50; 1281"),
    "total as printed, ms": ("129; 858", "109; 1051", "110; 3149"),
    "sum of the rows above, ms": ("120; 1264", "109; 1051", "110; 3149"),
    "points drawn": ("125,183; 931,093", "267,542; 2,026,496", "263,915; 8,110,665"),
    "input points": ("2,000,651", "4,251,890", "137,072,827"),
    "leaves; inner nodes": ("2,000,651; 974,114", "4,251,890; 2,608,752",
                            "137,072,827; 50,285,122"),
    "bytes a node": ("6", "4", "4"),
    "file, MB": ("18", "27 (printed: 2.7)", "761"),
    "preprocessing, s": ("42", "84", "3540"),
}  # fmt: skip
# Titles of the tables that other parts have measured begin so.
REPEATED = (
    "Holodeck, section 2.4.5", "Render cache, Table 1", "Render cache: ", "Ray caching textures",
)  # fmt: skip
QSPLAT_MODELS = ("David's head, 1 mm", "David, 2 mm", "St. Matthew, 0.25 mm")
QSPLAT_SAMPLES = (2_000_000, 4_250_000)


def papers(bench: Bench) -> Part:
    """Every table of the five papers beside ours: sessions, pictures, stages, splats."""
    part = Part(
        "The papers beside this program",
        [
            "Made by `./scripts/bench papers`. *1999*, *2002* and so on: the papers' own figures, of "
            "their own machines and scenes. Ours are of the machine named at the end unless a table "
            "says otherwise. The papers:",
            "- **Holodeck**: Larson & Simmons, \"The Holodeck Ray Cache\", ACM TOG 18(4), 1999.\n"
            "- **Render cache**: Walter, Drettakis & Parker, \"Interactive Rendering using the Render "
            "Cache\", EGWR 1999; Walter, Drettakis & Greenberg, \"Enhancing and Optimizing the Render "
            "Cache\", EGWR 2002.\n"
            "- **Ray caching textures**: Ruff, Clua & Fernandes, \"Dynamic per Object Ray Caching "
            "Textures for Real-Time Ray Tracing\", SIBGRAPI 2013.\n"
            "- **QSplat**: Rusinkiewicz & Levoy, SIGGRAPH 2000, as a lecture on frameless rendering, "
            "render cache and QSplat has it.",
        ],
    )  # fmt: skip
    folder = bench.work / "papers"
    run([bench.cargo.build("holo-scenes"), "papers", "--out", folder])
    holodeck_table(bench, part)
    speed_up(bench, part)
    carved(bench, part, folder)
    glass(bench, part, folder)
    mirror(bench, part, folder)
    jump(bench, part)
    qsplat(bench, part)
    repeat(bench, part)
    return part


def repeat(bench: Bench, part: Part) -> None:
    """Takes the tables that other parts have measured anew from the document."""
    part.tables = [table for table in part.tables if not table.title.startswith(REPEATED)]
    repeated_mesh(bench, part)
    cache_stages(bench, part)
    cache_frames(bench, part)
    cache_ratios(bench, part)
    repeated_reflections(bench, part)


def turned(view: View, degrees: float) -> View:
    """Returns a view turned about its upward direction, whose other two coordinates are 0."""
    x, y, z = (float(number) for number in view.vd.split(","))
    up = [float(number) for number in view.vu.split(",")]
    axis = up.index(max(up))
    first, second = [n for n in range(3) if n != axis]
    along = [x, y, z]
    sin, cos = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    a, b = along[first], along[second]
    along[first], along[second] = a * cos - b * sin, a * sin + b * cos
    return replace(view, vd=",".join(f"{number:.6f}" for number in along))


def holodeck_table(bench: Bench, part: Part) -> None:
    """Table 1 of the Holodeck: drivers, scenes and workers."""
    table = Table(
        "Holodeck, Table 1: samples rendered and recalled a second in a whole session",
        [["", ""], ["workers", "d"], ["rendered/s", ",.0f"], ["recalled/s", ",.0f"]],
        note=(
            f"Files filled for {TABLE_FILL} s. A server, workers of one thread each, and a display of"
            f" 640 × 480 pixels are processes of one machine of two cores. The display goes to"
            f" {len(sessions.TURNS)} views in turn, 18° apart at most. It asks for one picture after"
            " another. A view's recall ends with the last picture that has more stored samples than"
            f" the one before, within {sessions.MOST_RECALL:g} s. *Recalled*: stored samples over the"
            " sum of these times, disk, server, connection, driver and pictures included. *Rendered*:"
            f" traced samples over the whole stay at the views, at least {sessions.STAY:g} s each."
            " *Vor* is our `cells`. `surfaces` also asks for samples of the surfaces in sight from"
            " all other directions, and loads the rest of the file while nothing else is to be done."
            " What it has, no view recalls again, so its rows with workers say little and are in no"
            " bar. The paper says that recall depends little on scenes and tracing,"
            " and that the mesh has a quarter of the quadtree's. A paragraph of its section 3 says"
            " that 100,000 samples of a new view are there after 3 s."
        ),
    )
    table.rows += [list(row) for row in TABLE_OF_1999]
    found: dict[tuple[str, str, int], sessions.Rates] = {}
    workers_of = TABLE_WORKERS[: 2 if bench.quick else None]
    for case in (bench.scenes.cornell(), bench.scenes.room(), bench.scenes.interior()):
        if (case.name, "quadtree", 0) in found:
            continue
        options = [] if case.name == "cornell" else ["--engine", "path"]
        scene = replace(case, scene=tuple(word for word in case.scene if word not in ("--engine", "path")))
        file, _ = bench.fill(f"papers-{case.name}", scene, TABLE_FILL, *options)
        views = [turned(case.view.any_shape(), degrees) for degrees in sessions.TURNS]
        for driver in sessions.DRIVERS:
            for workers in workers_of:
                rates = sessions.rates(bench, file, views, driver, workers)
                found[case.name, driver, workers] = rates
                table.rows.append(
                    [f"{driver}, {case.title}", workers, rates.rendered, rates.recalled]
                )
    part.tables.append(table)
    # A display that has the whole file recalls nothing.
    recalling = [driver for driver in sessions.DRIVERS if driver != "surfaces"]
    of_recalling = [pair for pair in found.items() if pair[0][1] in recalling]
    least = min(of_recalling, key=lambda pair: pair[1].recalled)
    (scene, driver, workers), slowest = least
    part.bars.append(
        Bar(
            f"slowest recall in a session ({driver}, {scene}, {workers} workers)",
            f"{slowest.recalled:,.0f}/s", f"≥ {MOST_RECALLED_1999:,}/s",
            slowest.recalled >= MOST_RECALLED_1999,
        )  # fmt: skip
    )
    scenes = {scene for scene, _, _ in found}
    shares = [
        found[scene, driver, 1].recalled / found[scene, driver, 0].recalled
        for scene in scenes for driver in recalling
    ]  # fmt: skip
    middle = sorted(shares)[len(shares) // 2]
    part.bars.append(
        Bar(
            "recall with a worker over recall without, median", f"{middle:.2f}",
            f"≥ {RECALL_KEPT_1999:.2f}", middle >= RECALL_KEPT_1999,
        )  # fmt: skip
    )


def speed_up(bench: Bench, part: Part) -> None:
    """Section 3 of the Holodeck: 96 % of linear speed-up."""
    table = Table(
        "Holodeck, section 3: linear speed-up with real tracers",
        [["", ""], ["processes", "d"], ["samples/s", ",.0f"], ["processor s", ".1f"],
         ["of linear", ".0%"]],
        note=(
            f"A server fills an empty file for {SPEED_UP_SECONDS:g} s by workers of one thread, on two"
            " cores, which the server needs too. *Of linear*: samples a second of processor time,"
            " beside those of one worker. So it has a meaning for more workers than cores. Workers"
            " that only pretend to trace: part `network`."
        ),
    )  # fmt: skip
    table.rows.append(["24-processor Onyx2, tower, batch (1999)", 24, None, None, SPEED_UP_1999])
    # A scene that workers have loaded at once.
    case = bench.scenes.room()
    alone = None
    for workers in (1, 2, 4):
        rate, processor = sessions.batch_rate(
            bench, case, bench.seconds(SPEED_UP_SECONDS), workers
        )
        seconds = bench.seconds(SPEED_UP_SECONDS)
        each = rate * seconds / processor
        alone = alone or each
        table.rows.append([f"{case.title}, batch", workers, rate, processor, each / alone])
        if workers == 2:
            part.bars.append(
                Bar(
                    "samples for a second of processor time, two workers beside one",
                    f"{each / alone:.1%}", f"≥ {SPEED_UP_1999:.0%}", each / alone >= SPEED_UP_1999,
                )  # fmt: skip
            )
    part.tables.append(table)


def case_of(
    folder: Path, name: str, title: str, view: View, size: str = "320x240"
) -> Case:
    scene = ("--config", str(folder / f"{name}.toml"))
    return Case(f"papers-{name}", title, scene, view, view, size, None)


CHESS = View("1.15,-0.8,0.85", "-1.15,0.8,-0.6", "0,0,1", 38)
GLASS = View("0.35,-0.75,1.1", "-0.35,0.75,-0.18", "0,0,1", 34)
BASIN = View("1.85,0.45,1.5", "-0.42,0.88,-0.05", "0,0,1", 60)


def truth_of(bench: Bench, case: Case, name: str = "truth") -> Path:
    paths = str(bench.paths(TRUTH_PATHS))
    return bench.render(case, name, "--engine", "path", "--spp", paths, "--seed", "99")[0]


def scripted(bench: Bench, case: Case, driver: str, lines: list[str]) -> None:
    """Runs a session with a worker from an empty file."""
    script = bench.work / f"{case.name}-{driver}.txt"
    script.write_text("\n".join([*lines, "quit", ""]), encoding="utf-8")
    words = ["--headless", "--quiet", "--size", case.size, *sessions.DRIVERS[driver]]
    run([bench.holodeck, "view", *case.scene, *words, "--script", script])


def carved(bench: Bench, part: Part, folder: Path) -> None:
    """Images 8 and 9 of the Holodeck: an exterior section."""
    case = case_of(folder, "chess", "a game of chess on three boards", CHESS)
    truth = truth_of(bench, case)
    columns = [["driver", ""]]
    for seconds in CARVED_AT:
        columns += [[f"after {seconds:g} s, dB", ".1f"], ["relMSE", ".4f"]]
    table = Table(
        "Holodeck, Images 8 and 9: a carved object in an exterior section, from nothing", columns,
        note=(
            f"{case.title.capitalize()} (`holo-scenes papers`, about 10,000 triangles), seen from"
            " outside, all light, 320 × 240, against a render of"
            f" {bench.paths(TRUTH_PATHS)} paths a pixel. The paper has pictures of a game of chess"
            " after 10 s and 60 s on one processor of 1999 (Voronoi driver), and no number."
        ),
    )  # fmt: skip
    for driver in CARVED_DRIVERS:
        pictures = {at: bench.work / f"carved-{driver}-{at:g}.pfm" for at in CARVED_AT}
        lines = [f"0 view {case.view.line()}"]
        lines += [f"{bench.seconds(at)} picture {path}" for at, path in pictures.items()]
        scripted(bench, case, driver, lines)
        row: list[Figure] = [driver]
        for picture in pictures.values():
            measures = compare(bench.holodeck, picture, truth)
            row += [measures["psnr_disp"], measures["relmse_trim"]]
        table.rows.append(row)
    part.tables.append(table)


def glass(bench: Bench, part: Part, folder: Path) -> None:
    """Image 10 of the Holodeck: solid glass with bubbles."""
    # Light that is focused by glass is noisy, so the truth has few pixels and many paths.
    case = case_of(folder, "bubbles", "glass with bubbles", GLASS, "160x120")
    aside = replace(case, view=turned_around(GLASS, (0.0, 0.0), GLASS_STEP))
    first, second = (bench.work / f"glass-{name}.pfm" for name in ("first", "aside"))
    scripted(
        bench, case, "surfaces",
        [
            f"0 view {case.view.line()}", f"{bench.seconds(GLASS_AT)} picture {first}",
            f"{bench.seconds(GLASS_AT) + 0.1} view {aside.view.line()}",
            f"{GLASS_STEPPED} picture {second}",
        ],
    )  # fmt: skip
    table = Table(
        "Holodeck, Image 10: a solid block of glass with bubbles, a rod and balls inside",
        [["", ""], ["display PSNR, dB", ".1f"], ["relMSE", ".4f"]],
        note=(
            f"One session from an empty file with the driver `surfaces`, 160 × 120, {GLASS_AT:g} s;"
            f" then the eye goes {GLASS_STEP:g}° around the block. The paper has a picture \"rendered"
            " from scratch in a few minutes\", and says that another program must start over \"as"
            " soon as the view changes even slightly\": so the last rows are a render that starts"
            " over at the step."
        ),
    )  # fmt: skip
    truths = truth_of(bench, case), truth_of(bench, aside, "truth-aside")
    over, _ = bench.render(aside, "over", "--engine", "path", "--time", f"{GLASS_STEPPED}s")
    rows = (
        (f"after {GLASS_AT:g} s", first, truths[0]),
        (f"{GLASS_STEPPED:g} s after the step", second, truths[1]),
        (f"a render of {GLASS_STEPPED:g} s that starts over", over, truths[1]),
    )
    for title, picture, truth in rows:
        measures = compare(bench.holodeck, picture, truth)
        table.rows.append([title, measures["psnr_disp"], measures["relmse_trim"]])
    part.tables.append(table)
    kept, anew = table.rows[1][1], table.rows[2][1]
    part.bars.append(
        Bar(
            f"glass {GLASS_STEPPED:g} s after a step, beside a render that starts over",
            f"{kept - anew:+.1f} dB", "≥ +0 dB", kept >= anew,
        )  # fmt: skip
    )


def turned_around(view: View, centre: tuple[float, float], degrees: float) -> View:
    """Returns a view that went around an upright axis."""
    x, y, z = (float(number) for number in view.vp.split(","))
    sin, cos = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    a, b = x - centre[0], y - centre[1]
    eye = (centre[0] + a * cos - b * sin, centre[1] + a * sin + b * cos, z)
    return replace(turned(view, degrees), vp=",".join(f"{number:.6f}" for number in eye))


def mirror(bench: Bench, part: Part, folder: Path) -> None:
    """Image 12 of the Holodeck: what virtual distances gain in a mirror, and lose at its edges."""
    case = case_of(folder, "mirror", "a small room with a mirror", BASIN)
    paths = str(bench.paths(TRUTH_PATHS))
    truth, _ = bench.render(case, "truth", "--bounces", "0", "--spp", paths, "--seed", "99")
    within, near = mirror_masks(case)
    columns = [["driver", ""], ["samples", ",d"]]
    for where in ("in the mirror", "near its edge"):
        columns += [[f"{where}: real, dB", ".1f"], ["virtual, dB", ".1f"], ["gain", "+.1f"]]
    table = Table(
        "Holodeck, Image 12: a mirror without and with virtual distances", columns,
        note=(
            f"{case.title.capitalize()} (`holo-scenes papers`), direct light, files filled in batch"
            " with and without `--virtual-distance`, 320 × 240, display PSNR over the pixels of the"
            f" mirror, and over those within {NEAR_EDGE} pixels of its edge, without the worst 1 %."
            " The paper has two pictures: reflections are sharper with virtual distances, and edges"
            " of small mirrors break up, the quadtree's and the mesh's most. `surfaces` follows rays"
            " at mirrors by itself, so the setting changes nothing there."
        ),
    )  # fmt: skip
    files = {kind: bench.work / f"mirror-{kind}.holo" for kind in ("real", "virtual")}
    gains: dict[str, float] = {}
    there = 0
    for count in MIRROR_SAMPLES[: -1 if bench.quick else None]:
        for kind, file in files.items():
            fill = [bench.holodeck, "fill", *case.scene, "--bounces", "0", "-o", file, "--quiet"]
            if kind == "virtual":
                fill += ["--virtual-distance"]
            run([*fill, "--json", "--samples", str(count - there)])
        there = count
        for driver in MIRROR_DRIVERS:
            found = {
                kind: bench.picture(
                    file, [*case.view.options(), *sessions.DRIVERS[driver]], case.size,
                    f"mirror-{kind}-{driver}-{count}",
                )[0]
                for kind, file in files.items()
            }  # fmt: skip
            row: list[Figure] = [driver, count]
            for mask in (within, near):
                real, virtual = (
                    decibels_within(found[kind], truth, mask) for kind in ("real", "virtual")
                )
                row += [real, virtual, virtual - real]
            table.rows.append(row)
            gains[driver] = float(row[4] or 0.0)
    part.tables.append(table)
    least = min(gains, key=lambda driver: gains[driver])
    part.bars.append(
        Bar(
            f"virtual distances in a mirror, {there:,} samples, least gain ({least})",
            f"{gains[least]:+.1f} dB", "≥ +0 dB", gains[least] >= 0,
        )  # fmt: skip
    )


def mirror_masks(case: Case) -> tuple[list[bool], list[bool]]:
    """Returns the pixels whose view rays go to the mirror, and those near its edge."""
    width, height = (int(side) for side in case.size.split("x"))
    eye, along, up = (
        [float(number) for number in vector.split(",")]
        for vector in (case.view.vp, case.view.vd, case.view.vu)
    )
    along = unit(along)
    right = unit(cross(along, up))
    up = cross(right, along)
    across = math.tan(math.radians(case.view.vh) / 2)
    within = []
    for row in range(height):
        for column in range(width):
            x = across * (2 * (column + 0.5) / width - 1)
            y = across * height / width * (1 - 2 * (row + 0.5) / height)
            ray = [a + x * r + y * u for a, r, u in zip(along, right, up)]
            distance = (MIRROR_PLANE - eye[1]) / ray[1] if ray[1] else -1.0
            at = [e + distance * r for e, r in zip(eye, ray)]
            is_within = MIRROR_X[0] < at[0] < MIRROR_X[1] and MIRROR_Z[0] < at[2] < MIRROR_Z[1]
            within.append(distance > 0 and is_within)
    near = []
    for row in range(height):
        for column in range(width):
            around = [
                within[y * width + x]
                for y in range(max(row - NEAR_EDGE, 0), min(row + NEAR_EDGE + 1, height))
                for x in range(max(column - NEAR_EDGE, 0), min(column + NEAR_EDGE + 1, width))
            ]
            near.append(any(around) and not all(around))
    return within, near


def unit(vector: list[float]) -> list[float]:
    length = math.sqrt(sum(part * part for part in vector))
    return [part / length for part in vector]


def cross(a: list[float], b: list[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def decibels_within(picture: Path, truth: Path, mask: list[bool]) -> float:
    """Returns the display PSNR over the pixels of a mask, without the worst 1 %."""
    (_, _, ours), (_, _, theirs) = read(picture), read(truth)
    level = white(theirs)
    squares = sorted(
        sum(
            (shown(a, level) - shown(b, level)) ** 2
            for a, b in zip(ours[3 * at : 3 * at + 3], theirs[3 * at : 3 * at + 3])
        )
        / 3
        for at, is_in in enumerate(mask)
        if is_in
    )
    kept = squares[: max(int(0.99 * len(squares)), 1)]
    return -10 * math.log10(max(sum(kept) / len(kept), 1e-12))


def from_part(bench: Bench, name: str) -> tuple[Part | None, str]:
    """Returns another part of the document, and a sentence on where its figures are from, or that it
    has none.
    """
    found = bench.recorded(name)
    if found is None or not found.tables:
        return None, f"Not measured yet: `./scripts/bench {name}`."
    conditions = found.conditions
    load = conditions.get("load before")
    of = (conditions.get("date"), conditions.get("commit", "")[:7], load and f"load {load} before")
    of = ", ".join(filter(None, of))
    return found, f"Ours are those of the part `{name}` ({of or 'unknown version'})."


def repeated_mesh(bench: Bench, part: Part) -> None:
    """Section 2.4.5 of the Holodeck: the mesh's swaps and insertions."""
    found, source = from_part(bench, "mesh-speed")
    table = Table(
        "Holodeck, section 2.4.5: the mesh",
        [["", ""], ["vertices", ",d"], ["swaps of an insertion", ".2f"], ["insertions/s", ",.0f"]],
        note=source,
    )
    table.rows.append(["SGI O2 (1999)", None, 2.8, 10_000])
    for row in found.tables[0].rows if found else []:
        table.rows.append(["here, one core", int(row[0]), row[1], 1e6 * float(row[2])])
    part.tables.append(table)


def cache_stages(bench: Bench, part: Part) -> None:
    """Table 1 of both papers on the render cache."""
    found, source = from_part(bench, "rendercache")
    ours: dict[str, dict[str, Figure]] = {}
    if found:
        heads = [head for head, _ in found.tables[0].columns]
        for size in ("256x256", "512x512"):
            column = heads.index(f"{size}, 1 thread")
            ours[size] = {str(row[0]): row[column] for row in found.tables[0].rows}
    table = Table(
        "Render cache, Table 1 of 1999 and of 2002: milliseconds of each stage",
        [["stage", ""], ["1999, 256²", ".1f"], ["ours, 256²", ".2f"], ["2002, 512²", ".1f"],
         ["share", ".0%"], ["ours, 512²", ".2f"], ["share", ".0%"]],
        note=(
            f"{source} 1999: one R10000 of 195 MHz; its projection has no tiles. 2002: Pentium 4 of"
            " 1.7 GHz, 8,000 new samples a frame, as ours. One thread."
        ),
    )  # fmt: skip
    for title, first, second, stages in STAGES:
        def sum_of(size: str) -> Figure:
            times = [ours.get(size, {}).get(stage) for stage in stages]
            known = [float(time) for time in times if isinstance(time, (int, float))]
            return sum(known) if known else None

        small, large = sum_of("256x256"), sum_of("512x512")
        whole = ours.get("512x512", {}).get("Total")
        share = large / whole if large is not None and whole else None
        table.rows.append(
            [title, first, small, second, second / 62.1 if second else None, large, share]
        )
    part.tables.append(table)


def cache_frames(bench: Bench, part: Part) -> None:
    """Frames a second of the render cache with a renderer beside it."""
    found, source = from_part(bench, "walk-points")
    table = Table(
        "Render cache: frames a second with a renderer on the same machine",
        [["", ""], ["pixels", ""], ["frames/s", ".1f"]],
        note=f"{source} A page in a browser, a worker on all cores, walking.",
    )
    table.rows += [
        ["1999, one processor, half of its time for the renderer", "256²", 7.0],
        ["1999, sessions of Fig. 8, two to four processors", "320²", 8.0],
        ["2002, one processor", "512²", 12.0],
        ["2002, two processors", "512²", 14.0],
    ]
    rows = found.tables[0].rows if found else []
    table.rows += [[f"`pointimage`, {row[0]}", row[1], row[2]] for row in rows]
    part.tables.append(table)


def cache_ratios(bench: Bench, part: Part) -> None:
    """Pixels for each new sample: the papers' ratio, good to 64."""
    found, source = from_part(bench, "walk")
    wanted = ("pointimage", "1999", "frameless", "quadtree")
    table = Table(
        "Render cache: pixels for each new sample of a frame, decibels on recorded walks",
        [["walk", ""], ["samples", ""], ["ratio", "d"], *([driver, ".1f"] for driver in wanted)],
        note=(
            f"{source} The papers have no number: the cache \"works well for mismatch ratios up to"
            " 64 and can be usable at even higher ratios\" (1999), and from 1 to 10 % of the pixels"
            " a frame (2002), a ratio of 10 to 100. Frameless rendering serves two to four (1999)."
        ),
    )  # fmt: skip
    for of in found.tables if found else []:
        heads = [head for head, _ in of.columns]
        if heads[:2] != ["samples", "ratio"]:
            continue
        places = [heads.index(f"{driver}, dB") for driver in wanted]
        for row in of.rows:
            if int(row[1]) >= 8:
                table.rows.append([of.title, row[0], row[1], *[row[place] for place in places]])
    part.tables.append(table)


def jump(bench: Bench, part: Part) -> None:
    """Section 3.1 of 1999: the picture is usable once a tenth of the cache is relevant."""
    walks = bench.root / "crates/view/drivers/examples/walk/walks"
    recorded = Recorded(
        "jump", "bundled interior", bench.scenes.bundle() / "interior.obj", walks / "jump.walk"
    )
    program = bench.cargo.build("holo-drivers", "--example", "walk")
    every = 4 if bench.quick else 1
    columns: list[list[str]] = [["samples", ""], ["driver", ""]]
    columns += [[f"{share:.0%}", ".1f"] for share in REFILLED]
    table = Table(
        "Render cache, 1999 section 3.1: decibels by share of the cache refilled after a jump",
        columns,
        note=(
            "The bundled interior's living room fills the cache; then the eye is in the hallway at"
            f" once. One new sample a frame for {JUMP_RATIO} pixels, 320 × 240, direct light; *noisy*"
            " samples are of one path, *clean* of 16. *1999* is the first paper's stages. The paper"
            " finds a frame usable \"once a tenth of the cache\" is relevant, and has no number."
        ),
    )
    for noise, paths in (("noisy", 1), ("clean", 16)):
        for driver in JUMP_DRIVERS:
            job = Job(recorded, every, "0..156", JUMP_RATIO, paths, (driver,))
            line = walked(bench, program, job)[driver]
            after = dict(zip(line["frames"], line["psnr"]))
            row: list[Figure] = [noise, driver]
            for share in REFILLED:
                frame = JUMP_AFTER + 1 + round(share * JUMP_RATIO)
                nearest = min(after, key=lambda at: abs(at - frame))
                row.append(after[nearest])
            table.rows.append(row)
            if driver == "pointimage":
                at = {share: float(row[2 + n] or 0) for n, share in enumerate(REFILLED)}
                lost = at[1.0] - at[0.1]
                part.bars.append(
                    Bar(
                        f"a tenth of the cache refilled, below all of it, {noise}",
                        f"{lost:.1f} dB", f"≤ {USABLE:g} dB", lost <= USABLE,
                    )  # fmt: skip
                )
    part.tables.append(table)


def repeated_reflections(bench: Bench, part: Part) -> None:
    """Tables I and II and Figures 1 and 6 to 9 of ray caching textures."""
    found, source = from_part(bench, "reflections")
    if not found:
        part.tables.append(Table("Ray caching textures: all tables", [["", ""]], note=source))
    for table in found.tables if found else []:
        title = f"Ray caching textures: {table.title[0].lower() + table.title[1:]}"
        if table.title.startswith(("Table", "Fig")):
            title = f"Ray caching textures, {table.title}"
        part.tables.append(replace(table, title=title, note=source))


def qsplat(bench: Bench, part: Part) -> None:
    """QSplat's table, from the lecture."""
    case = bench.scenes.interior()
    example = bench.cargo.build("holo-driver-splats", "--example", "splat_table")
    file = bench.work / "papers-splats.holo"
    ours: list[dict[str, str]] = []
    there = 0
    for count in QSPLAT_SAMPLES[: 1 if bench.quick else None]:
        count = count // 10 if bench.quick else count
        fill = [bench.holodeck, "fill", *case.scene, "-o", file, "--quiet", "--json"]
        run([*fill, "--samples", str(count - there)])
        there = count
        ours.append(splat_rows(bench, example, case, file))
    heads = [*QSPLAT_MODELS, *(f"ours: {column['input points']} samples" for column in ours)]
    table = Table(
        "QSplat: interactive; static", [["", ""], *([head, ""] for head in heads)],
        note=(
            "The lecture's first column does not add up: its rows sum to 120 and 1264 ms, not 129 and"
            " 858. Its file of 2.7 MB must be 27 MB: 6.86 M nodes of 4 bytes. (2.7 MB is also what it"
            " says of the pointers in it.) Ours: the bundled house, `holodeck splats`, 1280 × 720,"
            " ellipses, processor milliseconds of one thread, processor seconds of preprocessing."
            " *Interactive* stays within one splat for four pixels. Ours computes position and size"
            " and culls while it traverses. A file of 141 M samples is in"
            " [the notes](notes/splats.md), because to fill it takes longer than all of this page."
        ),
    )  # fmt: skip
    for name, theirs in QSPLAT.items():
        table.rows.append([name, *theirs, *(column.get(name) for column in ours)])
    part.tables.append(table)


def splat_rows(bench: Bench, example: Path, case: Case, file: Path) -> dict[str, str]:
    splats = file.with_suffix(".splats")
    made = run([bench.holodeck, "splats", file, "-o", splats, "--json", "--quiet"])
    report = made.json()
    size = "1280x720"
    lines = run([example, splats, case.view.any_shape().line(), size]).stdout.splitlines()
    head, *modes = map(json.loads, lines)
    mode = {line["mode"]: line for line in modes}

    def both(key: str, digits: str = ".0f") -> str:
        return "; ".join(format(mode[name][key], digits) for name in ("interactive", "static"))

    nodes, surfels = head["nodes"], head["surfels"]
    return {
        "traversal, ms": both("traversal_ms"),
        "position and size, ms": "in traversal",
        "culling (frustum and back faces), ms": "in traversal",
        "drawing, ms": both("drawing_ms"),
        "total as printed, ms": both("total_ms"),
        "sum of the rows above, ms": both("total_ms"),
        "points drawn": both("points", ",d"),
        "input points": f"{report['samples']:,}",
        "leaves; inner nodes": f"{surfels:,}; {nodes - surfels:,}",
        "bytes a node": f"{head['bytes'] / nodes:.2f}",
        "file, MB": f"{head['bytes'] / 1e6:.1f}",
        "preprocessing, s": f"{made.processor:.0f}",
    }
