"""The measurements, one function each; `ALL` names them in the document's order.

Invariants: the program itself measures and compares. A measurement without a result fails instead of
leaving a gap. Figures of the original and of other programs are listed beside ours. They are from
other runs, on other days, on a 2-core machine of the same kind.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Callable

from ablations import ablations
from curved import curved
from document import Bar, Figure, Part, Table
from edges import edges
from embree import embree
from engines import engines
from errors import errors
from gather import gather
from harness import Bench
from interactive import interactive
from large import large
from mesh import mesh, mesh_speed
from network import network
from papers import papers
from program import Failed, available_memory, compare, median_of, run
from quadtree import quadtree
from radiance import radiance
from reflections import reflections
from rendercache import rendercache
from rivals import rivals
from rooms import rooms
from step import step
from scenes import Case
from skips import skips
from walk import walk
from walk_live import walk_live
from walk_points import walk_points
from whole import whole

# Half width of the 99 % interval of the bias that a render must reach.
BIAS_BAR = 0.005
# Samples a second that a fill of the Cornell box with direct light must store.
DIRECT_RATE = 4e6
# The original's picture of a cabin filled from nothing has a PSNR of 6.7 dB.
CABIN_PSNR_BAR = 12.0

# Memory that may be mapped while the hierarchy of 10⁷ triangles is built.
TEN_MILLION_MEMORY = 8 << 30

RAY_KEYS = (
    "scene", "triangles", "build_seconds", "nearest", "beam_nearest", "beam_together", "occluded"
)

REPLAY_SIZES = ("320x240", "640x480", "1280x960")


def render_bias(bench: Bench) -> Part:
    """The tracer's bias against an independent renderer, and paths per second."""
    part = Part(
        "The tracer against an independent one",
        [
            (
                "`render --se` against converged pictures of Mitsuba 3.9. The interval of the bias"
                " holds at 99 % for each row, the errors of both pictures counted; it takes"
                " channels as fully correlated and samples as independent, so that it is wider than"
                " the truth. relMSE includes the reference's own noise. Mitsuba `llvm_ad_rgb`"
                " itself traces 3.4 (Cornell) and 1.1 (cabin) M paths/s, from another run, another"
                " day."
            ),
            (
                "The cabin's references are themselves too bright where its flood lamps shine: see"
                " *The tracer beside Mitsuba*."
            ),
        ],
    )
    cases = bench.scenes.referenced()
    if not cases:
        part.skipped.append(
            "no references in ../shared/reference: nothing independent to be held against"
        )
        return part
    columns = [["scene", ""], ["paths per pixel", "d"], ["bias", "+.3%"], ["± (99 %)", ".3%"],
               ["relMSE", ".2e"], ["worst block", ".1%"], ["seconds", ".1f"], ["M paths/s", ".2f"]]  # fmt: skip
    table = Table("", columns)
    for case in cases:
        error = bench.work / f"{case.name}-bias-se.pfm"
        picture, said = bench.render(case, "bias", "--spp", str(bench.paths(1024)), "--se", error)
        reference = bench.reference(case)
        measures = compare(
            bench.holodeck,
            picture,
            reference.picture,
            "--se",
            error,
            "--reference-se",
            reference.standard_error,
        )
        bias, half = measures["bias"], measures["bias_99"]
        rate = said["paths_per_second"] / 1e6
        row = [
            case.title, said["spp"], bias, half, measures["relmse_trim"], measures["worst_block"]
        ]
        table.rows.append([*row, said["seconds"], rate])
        met = abs(bias) <= half < BIAS_BAR
        wanted = f"interval holds 0, narrower than ±{BIAS_BAR:.1%}"
        part.bars.append(Bar(f"bias, {case.title}", f"{bias:+.2%} ± {half:.2%}", wanted, met))
    part.tables.append(table)
    return part


def fill_cornell_direct(bench: Bench) -> Part:
    """A Cornell box with direct light, filled for 10 s: speed, and a picture from the file."""
    case = bench.scenes.cornell()
    file, filled = bench.cornell_direct()
    size = "512x512"
    truth, _ = bench.render(
        case, "direct", "--bounces", "0", "--spp", str(bench.paths(1024)), "--seed", "1", size=size
    )
    picture, said, _ = bench.picture(file, case.view.options(), size, "cornell-direct-512")
    measures = compare(bench.holodeck, picture, truth)
    part = Part(
        f"Filling the {case.title}, direct light only",
        [
            f"`fill --bounces 0 --time {bench.seconds(10):g}s` on an 8×8×8 grid with one path per"
            f" sample, then `picture` at {size} against `render --bounces 0 --spp"
            f" {bench.paths(1024)}`. The original's samples are free of noise here, ours are not."
            " *Empty* pixels are filled from their neighbours: PSNR clips what is too bright, so"
            " read it with relMSE and bias."
        ],
    )
    original = ["the original", 820_000, 8_260_000, 80_700_000, None, 23.8]
    part.tables.append(filled_table(filled, said, measures, original))
    rate = filled["added"] / filled["seconds"]
    part.bars.append(
        Bar(
            "samples stored with direct light", f"{rate / 1e6:.2f} M/s",
            f"≥ {DIRECT_RATE / 1e6:g} M/s", rate >= DIRECT_RATE
        )
    )
    return part


def fill_cabin(bench: Bench) -> Part:
    """The cabin with all its light, filled for 40 s: speed, and a picture from the file."""
    case = bench.scenes.room()
    file, filled = bench.room_filled()
    picture, said, _ = bench.picture(file, case.view.options(), case.size, "room-filled")
    measures = compare(bench.holodeck, picture, bench.reference(case).picture)
    is_cabin = case.name == "cabin"
    against = "the converged reference" if is_cabin else "a long render of our own"
    part = Part(
        f"Filling the {case.title}, all light",
        [
            f"`fill --time {bench.seconds(40):g}s` from nothing with the default grids and one"
            f" unlimited path per sample, then `picture` at {case.size} against {against}. The"
            " original traces with its indirect cache (`-ab 3`) into the same sections."
        ],
    )
    original = ["the original", 13_700, 547_000, None, None, 6.7] if is_cabin else None
    part.tables.append(filled_table(filled, said, measures, original))
    if is_cabin:
        psnr = measures["psnr_disp"]
        wanted = f"≥ {CABIN_PSNR_BAR:g} dB"
        part.bars.append(
            Bar("PSNR of the filled cabin", f"{psnr:.1f} dB", wanted, psnr >= CABIN_PSNR_BAR)
        )
    else:
        part.skipped.append(
            "the cabin is not in ../shared/scenes: the bundled interior stands in, without a bar"
        )
    return part


def filled_table(
    filled: dict[str, float],
    said: dict[str, float],
    measures: dict[str, float],
    original: list[Figure] | None,
) -> Table:
    """Returns the results of a fill, and its picture; `original` is the row of the first six
    columns.
    """
    columns = [["", ""], ["samples/s", ",.0f"], ["samples", ",d"], ["bytes", ",d"],
               ["in the picture", ",d"], ["PSNR, dB", ".1f"], ["relMSE", ".3f"], ["bias", "+.1%"],
               ["empty pixels", ",d"], ["uncovered pixels", ",d"]]  # fmt: skip
    rate = filled["added"] / filled["seconds"]
    ours = ["holodeck", rate, filled["added"], filled["file_bytes"], said["samples"],
            measures["psnr_disp"], measures["relmse_trim"], measures["bias"], said["empty_pixels"],
            said["uncovered_pixels"]]  # fmt: skip
    rows = [ours]
    if original:
        rows.append([*original, *[None] * (len(columns) - len(original))])
    return Table("", columns, rows)


def replay(bench: Bench) -> Part:
    """Pictures from files, without tracing: seconds and samples per second at three sizes."""
    times = 1 if bench.quick else 5
    part = Part(
        "Pictures from a file",
        [
            (
                f"`picture` from files in the operating system's memory, the median of {times} by"
                " the whole program's seconds. *View to picture* leaves out the start of the"
                " program and opening the file; samples per second are those of the view over that"
                " time, drawing included."
            ),
            (
                "The original: 0.02, 0.05, 0.14 and 0.60 s at 256², 512², 1024² and 2048² from its"
                " Cornell file; it recalls 30 to 59 M rays/s from a warm file to a display, 1.4 to"
                " 13 on first runs."
            ),
        ],
    )
    cornell, room = bench.scenes.cornell(), bench.scenes.room()
    files = [
        (f"{cornell.title}, direct, filled", cornell, bench.cornell_direct()[0]),
        (f"{room.title}, filled", room, bench.room_filled()[0]),
        (f"{cornell.title}, walked", cornell, bench.walk(cornell, False).file),
        (f"{room.title}, walked", room, bench.walk(room, False).file),
    ]
    columns = [["file", ""], ["bytes", ",d"], ["size", ""], ["whole program, s", ".3f"],
               ["view to picture, s", ".3f"], ["beams", ",d"], ["samples of the view", ",d"],
               ["M samples/s", ".2f"]]  # fmt: skip
    table = Table("", columns)
    for title, case, file in files:
        for size in REPLAY_SIZES:

            def once(
                case: Case = case, file: Path = file, size: str = size
            ) -> tuple[float, dict[str, float]]:
                _, said, seconds = bench.picture(
                    file, case.view.any_shape().options(), size, "replay"
                )
                return seconds, said

            seconds, said = median_of(times, once)
            rate = said["stored"] / said["seconds"] / 1e6
            row = [
                title, file.stat().st_size, size, seconds, said["seconds"], said["beams"],
                said["stored"], rate
            ]
            table.rows.append(row)
    part.tables.append(table)
    return part


def viewpoint_share(bench: Bench) -> Part:
    """Share of a view's rays that pass within the wanted radius of its eye."""
    example = bench.cargo.build("holo-section", "--example", "viewpoint_share")
    part = Part(
        "Rays near the eye",
        [
            (
                "Share of the first 21 samples of every beam that the eye's rays cross, in all"
                " directions, that pass within the viewpoint radius: a pixel's width at distance 3,"
                " 320 pixels over 60°. *Uniform beams* are those of which no ray passes so near."
            ),
            "The original: 94.6 % with the eye at the centre, 62.8 % near a wall.",
        ],
    )
    columns = [["section", ""], ["grid", ""], ["eye", ""], ["beams", ",d"], ["rays", ",d"],
               ["within the radius", ".2%"], ["uniform beams", ",d"], ["the original", ".1%"]]  # fmt: skip
    original = {"at the centre": 0.946, "near a wall": 0.628}
    table = Table("", columns)
    for found in json.loads(run([example]).stdout):
        grid = "×".join(str(cells) for cells in found["grid"])
        share = found["within_radius"] / found["rays"]
        row = [
            found["section"], grid, found["eye"], found["beams"], found["rays"], share,
            found["uniform_beams"]
        ]
        table.rows.append([*row, original.get(found["eye"])])
    part.tables.append(table)
    return part


def beamfile(bench: Bench) -> Part:
    """The beam file alone: appending, opening, reading and verifying."""
    example = bench.cargo.build("holo-beamfile", "--example", "rates")
    mega = 2 if bench.quick else 20
    part = Part(
        "The beam file alone",
        [
            (
                f"`crates/core/beamfile/examples/rates.rs`: {mega} M samples in packets of 21 to 100,000"
                " beams in a scattered order, then views' reads. *Cold* is in the cache of the"
                " crate; the operating system's is warm. One thread asks."
            ),
            (
                "A machine of this kind writes 65 M samples/s to its disk and holds 1,900 in"
                " memory; the original takes in 2.1 to 2.4 M rays/s and recalls 30 to 59 from a"
                " warm file."
            ),
        ],
    )
    table = Table(
        "", [["", ""], ["seconds", ".3f"], ["M samples/s", ".1f"], ["ns a sample", ".1f"]]
    )
    line = re.compile(
        r"^(\S.*?)\s+([\d.]+) s\s+([\d.]+) M samples/s\s+([\d.]+) ns each$", re.MULTILINE
    )
    for what, *figures in find_all(line, run([example, str(mega)]).stdout):
        table.rows.append([what, *map(float, figures)])
    part.tables.append(table)
    return part


def throughput(bench: Bench) -> Part:
    """Rays and paths per second of the tracer, without files and sockets."""
    part = Part(
        "Rays and paths",
        [
            (
                "`crates/geometry/raycast/examples/rays.rs`: nearest hits of incoherent rays between random"
                " points of the scene's bounds, and occlusion of rays of length 1, on one core."
                " `crates/light/tracer/examples/throughput.rs`: unlimited paths of a view."
            ),
            (
                "Others, from another run, another day, so that ratios are not exact: Mitsuba 3.9"
                " `llvm_ad_rgb`, two cores, 3.4 (Cornell) and 1.1 (cabin) M paths/s, `scalar_rgb`"
                " 1.0 (Cornell)."
            ),
        ],
    )
    rays = bench.cargo.build("holo-raycast", "--example", "rays")
    paths = bench.cargo.build("holo-tracer", "--example", "throughput")
    columns = [["scene", ""], ["triangles", ",d"], ["built in, s", ".3f"],
               ["incoherent nearest", ".2f"], ["21 of a beam, one by one", ".2f"],
               ["21 of a beam together", ".2f"], ["within 1 unit", ".2f"]]  # fmt: skip
    of_rays = Table("M rays/s, one core", columns)
    of_paths = Table("M paths/s", [["scene", ""], ["threads", "d"], ["M paths/s", ".3f"]])
    path_line = re.compile(r"^(\d+) threads: ([\d.]+) M paths/s", re.MULTILINE)
    measured = [["--triangles", "1000,100000,1000000"]]
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        obj = case.scene[0]
        if not obj.endswith(".obj"):
            why = "these examples take plain OBJ files, and the cabin is not in ../shared/scenes"
            part.skipped.append(f"the {case.title}: {why}")
            continue
        measured.append(["--obj", obj])
        view = case.view
        for threads, rate in find_all(
            path_line, run([paths, obj, view.vp, view.vd, f"{view.vh:g}"]).stdout
        ):
            of_paths.rows.append([case.title, int(threads), float(rate)])
    for scene in measured:
        for line in run([rays, *scene, "--json"]).stdout.splitlines():
            found = json.loads(line)
            of_rays.rows.append([found[key] for key in RAY_KEYS])
    if bench.quick or available_memory() < 2 * TEN_MILLION_MEMORY:
        part.skipped.append(
            "10⁷ triangles: " + ("a smoke run" if bench.quick else "not enough memory is free")
        )
    else:
        ended = run([rays, "--triangles", "10000000", "--json"], memory=TEN_MILLION_MEMORY)
        of_rays.rows += [
            [json.loads(line)[key] for key in RAY_KEYS] for line in ended.stdout.splitlines()
        ]
    part.tables += [of_rays, of_paths]
    return part


def find_all(line: re.Pattern[str], text: str) -> list[tuple[str, ...]]:
    """Returns the groups of every line that matches. No match means that a program has changed its
    report.
    """
    found = line.findall(text)
    if not found:
        raise Failed(f"no line matches `{line.pattern}` in:\n{text}")
    return found


ALL: dict[str, Callable[[Bench], Part]] = {
    "render-bias": render_bias,
    "errors": errors,
    "fill-cornell-direct": fill_cornell_direct,
    "fill-cabin": fill_cabin,
    "fill-engines": engines,
    "interactive": interactive,
    "whole": whole,
    "rooms": rooms,
    "step": step,
    "curved": curved,
    "edges": edges,
    "gather": gather,
    "radiance": radiance,
    "replay": replay,
    "walk": walk,
    "walk-live": walk_live,
    "walk-points": walk_points,
    "skips": skips,
    "ablations": ablations,
    "viewpoint-share": viewpoint_share,
    "beamfile": beamfile,
    "throughput": throughput,
    "large": large,
    "network": network,
    "embree": embree,
    "rendercache": rendercache,
    "reflections": reflections,
    "quadtree": quadtree,
    "mesh-speed": mesh_speed,
    "mesh": mesh,
    "rivals": rivals,
    # Repeats figures of parts above.
    "papers": papers,
}
