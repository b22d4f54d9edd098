"""The measurements, one function each; `ALL` names them in the document's order.

Figures of the original and of other programs are quoted beside ours: from other runs, on other days, on a 2-core
machine of the same kind.
"""

from __future__ import annotations

import filecmp
import json
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Callable

from document import Bar, Part, Plot, Table
from plot import error_over_seconds
from program import Cargo, Session, compare, median_of, run, session
from scenes import Case, Reference, Scenes

# Half width of the 99 % interval of the bias that a render has to reach.
BIAS_BAR = 0.005
# PSNR of the original's picture of a cabin filled from nothing is 6.7 dB.
CABIN_PSNR_BAR = 12.0
# relMSE of an interactive picture over that of the tracer alone, at the last picture.
INTERACTIVE_BAR = 2.0

# Seconds after a view is asked for at which its picture is taken.
PICTURES_AT = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
QUICK_PICTURES_AT = (0.1, 0.5, 2.0)
# Of these, from here on the tracer alone is asked for a picture, too: below it has not one pass over the pixels.
RENDER_FROM = 0.5

REPLAY_SIZES = ("320x240", "640x480", "1280x960")


@dataclass
class Walk:
    """An interactive session: pictures of a view over time, the last one, and its replay."""

    session: Session
    asked: tuple[float, ...]
    pictures: list[Path]
    identical_replay: bool
    file: Path


class Bench:
    """What measurements share: programs, scenes, files already made, and how long to take."""

    def __init__(self, root: Path, work: Path, plots: Path, quick: bool) -> None:
        self.work = work
        self.plots = plots
        self.quick = quick
        self.cargo = Cargo(root)
        self.shared = root.parent / "shared"
        self.scenes = Scenes(self.cargo, self.shared, work)
        self._fills: dict[str, tuple[Path, dict[str, float]]] = {}
        self._walks: dict[str, Walk] = {}
        self._references: dict[str, Reference] = {}

    @cached_property
    def holodeck(self) -> Path:
        """The program, built on first use."""
        return self.cargo.build("holodeck")

    def seconds(self, full: float) -> float:
        return full / 10 if self.quick else full

    def paths(self, full: int) -> int:
        return max(full // 10, 2) if self.quick else full

    def render(self, case: Case, name: str, *options: str | Path, size: str = "") -> tuple[Path, dict[str, float]]:
        """A picture of the case's view straight from the tracer, and what `render --json` says."""
        path = self.work / f"{case.name}-{name}.pfm"
        command = [self.holodeck, "render", *case.scene, *case.view.options(), "--size", size or case.size]
        return path, run([*command, *options, "--json", "--quiet", "-o", path]).json()

    def reference(self, case: Case) -> Reference:
        """The independent reference, or a long render of our own."""
        if case.reference:
            return case.reference
        if case.name not in self._references:
            error = self.work / f"{case.name}-reference-se.pfm"
            picture, _ = self.render(case, "reference", "--spp", str(self.paths(2048)), "--seed", "1", "--se", error)
            self._references[case.name] = Reference(picture, error)
        return self._references[case.name]

    def fill(self, name: str, case: Case, seconds: float, *options: str) -> tuple[Path, dict[str, float]]:
        """A file filled in batch, made once for all measurements, and what `fill --json` says."""
        if name not in self._fills:
            path = self.work / f"{name}.holo"
            time = f"{self.seconds(seconds)}s"
            command = [self.holodeck, "fill", *case.scene, *options, "-o", path, "--time", time, "--json", "--quiet"]
            self._fills[name] = path, run(command).json()
        return self._fills[name]

    def cornell_direct(self) -> tuple[Path, dict[str, float]]:
        return self.fill("cornell-direct", self.scenes.cornell(), 10, "--bounces", "0")

    def room_filled(self) -> tuple[Path, dict[str, float]]:
        return self.fill("room", self.scenes.room(), 40)

    def picture(self, file: Path, options: list[str], size: str, name: str) -> tuple[Path, dict[str, float], float]:
        """A picture from a file, what `picture --json` says, and the seconds of the whole program."""
        path = self.work / f"{name}.pfm"
        ended = run([self.holodeck, "picture", file, *options, "--size", size, "--json", "-o", path])
        return path, ended.json(), ended.seconds

    def walk(self, case: Case, moving: bool) -> Walk:
        """A session at the case's view, from an empty file; `moving`: after a while at another view."""
        name = f"{case.name}-{'moved' if moving else 'start'}"
        if name not in self._walks:
            self._walks[name] = self._walk(case, name, moving)
        return self._walks[name]

    def _walk(self, case: Case, name: str, moving: bool) -> Walk:
        asked = QUICK_PICTURES_AT if self.quick else PICTURES_AT
        pictures = [self.work / f"{name}-{seconds}.pfm" for seconds in asked]
        lines = [f"0 view {case.view.line()}"]
        if moving:
            lines = [f"0 view {case.before.line()}", f"{self.seconds(5)} view {case.view.line()}"]
        lines += [f"{seconds} picture {path}" for seconds, path in zip(asked, pictures)]
        script = self.work / f"{name}.txt"
        script.write_text("\n".join([*lines, "quit", ""]), encoding="utf-8")
        file, last, again = (self.work / f"{name}{end}" for end in (".holo", "-last.pfm", "-replay.pfm"))
        common = ["--headless", "--size", case.size, "--json"]
        found = session(
            [self.holodeck, "view", *case.scene, *common, "--script", script, "--keep", file, "-o", last]
        )
        run([self.holodeck, "replay", file, *common, *case.view.options(), "-o", again])
        return Walk(found, asked, pictures, filecmp.cmp(last, again, shallow=False), file)


def render_bias(bench: Bench) -> Part:
    """Whether the tracer is right: its bias against an independent renderer, and paths per second."""
    part = Part(
        "The tracer against an independent one",
        [
            "`render --se` against converged pictures of Mitsuba 3.9. The interval of the bias holds at 99 % for each row, the errors of "
            "both pictures counted; it takes channels as fully correlated and samples as independent, so that it is wider than the truth. "
            "relMSE includes the reference's own noise. Mitsuba `llvm_ad_rgb` itself traces 3.4 (Cornell) and 1.1 (cabin) M paths/s, "
            "from another run, another day."
        ],
    )
    cases = bench.scenes.referenced()
    if not cases:
        part.skipped.append("no references in ../shared/reference: nothing independent to be held against")
        return part
    columns = [["scene", ""], ["paths per pixel", "d"], ["bias", "+.3%"], ["± (99 %)", ".3%"], ["relMSE", ".2e"],
               ["worst block", ".1%"], ["seconds", ".1f"], ["M paths/s", ".2f"]]  # fmt: skip
    table = Table("", columns)
    for case in cases:
        error = bench.work / f"{case.name}-bias-se.pfm"
        picture, said = bench.render(case, "bias", "--spp", str(bench.paths(1024)), "--se", error)
        reference = bench.reference(case)
        measures = compare(
            bench.holodeck, picture, reference.picture, "--se", error, "--reference-se", reference.standard_error
        )
        bias, half = measures["bias"], measures["bias_99"]
        rate = said["paths_per_second"] / 1e6
        row = [case.title, said["spp"], bias, half, measures["relmse_trim"], measures["worst_block"], said["seconds"], rate]
        table.rows.append(row)
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
    truth, _ = bench.render(case, "direct", "--bounces", "0", "--spp", str(bench.paths(1024)), "--seed", "1", size=size)
    picture, said, _ = bench.picture(file, case.view.options(), size, "cornell-direct-512")
    measures = compare(bench.holodeck, picture, truth)
    part = Part(
        f"Filling the {case.title}, direct light only",
        [
            f"`fill --bounces 0 --time {bench.seconds(10):g}s` on an 8×8×8 grid with one path per sample, then `picture` at {size} against "
            "`render --bounces 0 --spp 1024`. The original's samples are free of noise here, ours are not."
        ],
    )
    part.tables.append(filled_table(filled, said, measures, ["the original", 820_000, 8_260_000, 80_700_000, None, 23.8]))
    return part


def fill_cabin(bench: Bench) -> Part:
    """The cabin with all its light, filled from nothing for 40 s: speed, and a picture from the file."""
    case = bench.scenes.room()
    file, filled = bench.room_filled()
    picture, said, _ = bench.picture(file, case.view.options(), case.size, "room-filled")
    measures = compare(bench.holodeck, picture, bench.reference(case).picture)
    is_cabin = case.name == "cabin"
    against = "the converged reference" if is_cabin else "a long render of our own"
    part = Part(
        f"Filling the {case.title}, all light",
        [
            f"`fill --time {bench.seconds(40):g}s` from nothing with the default grids and one unlimited path per sample, then `picture` at "
            f"{case.size} against {against}. The original traces with its indirect cache (`-ab 3`) into the same sections."
        ],
    )
    original = ["the original", 13_700, 547_000, None, None, 6.7] if is_cabin else None
    part.tables.append(filled_table(filled, said, measures, original))
    if is_cabin:
        psnr = measures["psnr_disp"]
        wanted = f"≥ {CABIN_PSNR_BAR:g} dB"
        part.bars.append(Bar("PSNR of the filled cabin", f"{psnr:.1f} dB", wanted, psnr >= CABIN_PSNR_BAR))
    else:
        part.skipped.append("the cabin is not in ../shared/scenes: the bundled interior stands in, without a bar")
    return part


def filled_table(
    filled: dict[str, float], said: dict[str, float], measures: dict[str, float], original: list[float | str | None] | None
) -> Table:
    """What a fill gave, and its picture; `original` is the row of the first six columns."""
    columns = [["", ""], ["samples/s", ",.0f"], ["samples", ",d"], ["bytes", ",d"], ["in the picture", ",d"], ["PSNR, dB", ".1f"],
               ["relMSE", ".3f"], ["bias", "+.1%"], ["empty pixels", ",d"], ["uncovered pixels", ",d"]]  # fmt: skip
    rate = filled["added"] / filled["seconds"]
    ours = ["holodeck", rate, filled["added"], filled["file_bytes"], said["samples"], measures["psnr_disp"],
            measures["relmse_trim"], measures["bias"], said["empty_pixels"], said["uncovered_pixels"]]  # fmt: skip
    rows = [ours]
    if original:
        rows.append([*original, *[None] * (len(columns) - len(original))])
    return Table("", columns, rows)


def interactive(bench: Bench) -> Part:
    """A view never seen before: its picture over time, against the tracer alone given the same seconds."""
    part = Part(
        "A view never seen before",
        [
            "`view --headless` from an empty file, everything on this machine; pictures while samples come in. *From the start*: the first view of a "
            "new session, whose worker still has to take the scene. *After moving*: the same view after five seconds at another. "
            "The tracer alone is `render --time` for the same seconds, its scene loaded before the clock starts; it ends after the pass "
            "that fits, and its shortest picture is one pass of four paths per pixel.",
            "*Taken at* is when the picture was written, seconds after the view was asked for; *ratio* is of the two relMSE. The last picture "
            "is taken again by `replay`, without tracing, and has to be the same byte for byte.",
            "The original on 1999's hardware: 100,000 samples of a new view within 3 s. On a machine of this kind it gathers 13,700 rays/s in the "
            "cabin with all its light.",
        ],
    )
    sessions = Table(
        "Starting, and memory",
        [["session", ""], ["program start to view asked for, s", ".2f"], ["view to first samples, s", ".2f"],
         ["program start to first picture, s", ".2f"], ["holodeck and viewer, MiB", ".0f"], ["holoserver, MiB", ".0f"],
         ["rtworker, MiB", ".0f"], ["file, bytes", ",d"], ["replay identical", ""]],
    )  # fmt: skip
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        alone = tracer_alone(bench, case)
        lines = {"tracer alone": [(seconds, measures["relmse_trim"]) for seconds, _, measures in alone.values()]}
        for moving in (False, True):
            walk = bench.walk(case, moving)
            title = f"{case.title}, {'after moving' if moving else 'from the start'}"
            table, ratio, points = walk_table(bench, case, walk, alone, title)
            part.tables.append(table)
            lines["after moving" if moving else "from the start"] = points
            sessions.rows.append(session_row(walk, title))
            last = walk.asked[-1]
            met = ratio <= INTERACTIVE_BAR
            part.bars.append(Bar(f"relMSE over the tracer's at {last:g} s, {title}", f"{ratio:.2f} ×", f"≤ {INTERACTIVE_BAR:g} ×", met))
            same = walk.identical_replay
            part.bars.append(Bar(f"replay, {title}", "identical" if same else "differs", "identical", same))
        file = bench.plots / f"interactive-{case.name}.svg"
        error_over_seconds(file, f"A view never seen before: {case.title}", lines)
        part.plots.append(Plot(f"benchmarks/{file.name}", f"relMSE over seconds, {case.title}"))
        if not case.reference:
            part.skipped.append(f"no reference of the {case.title} in ../shared: held against a long render of our own")
    part.tables.append(sessions)
    return part


Alone = dict[float, tuple[float, int, dict[str, float]]]


def tracer_alone(bench: Bench, case: Case) -> Alone:
    """By seconds asked for: seconds taken, paths per pixel and measures of the tracer's own picture."""
    alone: Alone = {}
    for asked in QUICK_PICTURES_AT if bench.quick else PICTURES_AT:
        if asked >= RENDER_FROM:
            picture, said = bench.render(case, f"alone-{asked}", "--time", f"{asked}s")
            alone[asked] = said["seconds"], said["spp"], compare(bench.holodeck, picture, bench.reference(case).picture)
    return alone


def walk_table(
    bench: Bench, case: Case, walk: Walk, alone: Alone, title: str
) -> tuple[Table, float, list[tuple[float, float]]]:
    """A session's pictures; the last one's ratio of relMSE; and its points of the plot."""
    columns = [["asked for, s", "g"], ["taken at, s", ".2f"], ["samples stored", ",d"], ["samples traced", ",d"],
               ["empty pixels", ",d"], ["relMSE", ".4f"], ["PSNR, dB", ".1f"], ["alone: s", ".2f"], ["paths per pixel", ",d"],
               ["relMSE", ".4f"], ["PSNR, dB", ".1f"], ["ratio", ".2f"]]  # fmt: skip
    table = Table(title, columns)
    points, ratio = [], float("inf")
    for asked, path, said in zip(walk.asked, walk.pictures, walk.session.reports):
        measures = compare(bench.holodeck, path, bench.reference(case).picture)
        error = measures["relmse_trim"]
        row = [asked, said["seconds"], said["stored"], said["traced"], said["empty_pixels"], error, measures["psnr_disp"]]
        points.append((said["seconds"], error))
        if asked in alone:
            seconds, paths, theirs = alone[asked]
            ratio = error / theirs["relmse_trim"]
            row += [seconds, paths, theirs["relmse_trim"], theirs["psnr_disp"], ratio]
        table.rows.append([*row, *[None] * (len(columns) - len(row))])
    return table, ratio, points


def session_row(walk: Walk, title: str) -> list[float | int | str | None]:
    """How a session began and what it took."""
    first = walk.session.reports[0]
    # The first report comes when the first picture of the *measured* view is there; without a view before it, that
    # is also the session's first.
    from_start = title.endswith("from the start")
    asked = walk.session.first_report - first["seconds"] if from_start else None
    picture = walk.session.first_report if from_start else None
    heard = next((said["first_samples"] for said in walk.session.reports if said["first_samples"] is not None), None)
    memory = [walk.session.memory.get(role) for role in ("holodeck and viewer", "holoserver", "rtworker")]
    same = "yes" if walk.identical_replay else "**no**"
    return [title, asked, heard, picture, *memory, walk.file.stat().st_size, same]


def replay(bench: Bench) -> Part:
    """Pictures from files, without tracing: seconds and samples per second at three sizes."""
    times = 1 if bench.quick else 5
    part = Part(
        "Pictures from a file",
        [
            f"`picture` from files in the operating system's memory, the median of {times} by the whole program's seconds. *View to picture* leaves out "
            "the start of the program and opening the file; samples per second are those of the view over that time, drawing included.",
            "The original: 0.02, 0.05, 0.14 and 0.60 s at 256², 512², 1024² and 2048² from its Cornell file; it recalls 30 to 59 M rays/s from a "
            "warm file to a display, 1.4 to 13 on first runs.",
        ],
    )
    cornell, room = bench.scenes.cornell(), bench.scenes.room()
    files = [
        (f"{cornell.title}, direct, filled", cornell, bench.cornell_direct()[0]),
        (f"{room.title}, filled", room, bench.room_filled()[0]),
        (f"{cornell.title}, walked", cornell, bench.walk(cornell, False).file),
        (f"{room.title}, walked", room, bench.walk(room, False).file),
    ]
    columns = [["file", ""], ["bytes", ",d"], ["size", ""], ["whole program, s", ".3f"], ["view to picture, s", ".3f"],
               ["beams", ",d"], ["samples of the view", ",d"], ["M samples/s", ".2f"]]  # fmt: skip
    table = Table("", columns)
    for title, case, file in files:
        for size in REPLAY_SIZES:

            def once(case: Case = case, file: Path = file, size: str = size) -> tuple[float, dict[str, float]]:
                _, said, seconds = bench.picture(file, case.view.any_shape().options(), size, "replay")
                return seconds, said

            seconds, said = median_of(times, once)
            rate = said["stored"] / said["seconds"] / 1e6
            row = [title, file.stat().st_size, size, seconds, said["seconds"], said["beams"], said["stored"], rate]
            table.rows.append(row)
    part.tables.append(table)
    return part


def viewpoint_share(bench: Bench) -> Part:
    """Share of a view's rays that pass within the wanted radius of its eye."""
    example = bench.cargo.build("holo-section", "--example", "viewpoint_share")
    part = Part(
        "Rays near the eye",
        [
            "Share of the first 21 samples of every beam that the eye's rays cross, in all directions, that pass within the viewpoint radius: a "
            "pixel's width at distance 3, 320 pixels over 60°. *Uniform beams* are those of which no ray passes so near.",
            "The original: 94.6 % with the eye at the centre, 62.8 % near a wall.",
        ],
    )
    columns = [["section", ""], ["grid", ""], ["eye", ""], ["beams", ",d"], ["rays", ",d"], ["within the radius", ".2%"],
               ["uniform beams", ",d"], ["the original", ".1%"]]  # fmt: skip
    original = {"at the centre": 0.946, "near a wall": 0.628}
    table = Table("", columns)
    for found in json.loads(run([example]).stdout):
        grid = "×".join(str(cells) for cells in found["grid"])
        share = found["within_radius"] / found["rays"]
        row = [found["section"], grid, found["eye"], found["beams"], found["rays"], share, found["uniform_beams"]]
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
            f"`crates/beamfile/examples/rates.rs`: {mega} M samples in packets of 21 to 100,000 beams in a scattered order, then views' reads. *Cold* is "
            "in the cache of the crate; the operating system's is warm. One thread asks.",
            "A machine of this kind writes 65 M samples/s to its disk and holds 1,900 in memory; the original takes in 2.1 to 2.4 M rays/s and "
            "recalls 30 to 59 from a warm file.",
        ],
    )
    table = Table("", [["", ""], ["seconds", ".3f"], ["M samples/s", ".1f"], ["ns a sample", ".1f"]])
    line = re.compile(r"^(\S.*?)\s+([\d.]+) s\s+([\d.]+) M samples/s\s+([\d.]+) ns each$", re.MULTILINE)
    for what, *figures in line.findall(run([example, str(mega)]).stdout):
        table.rows.append([what, *map(float, figures)])
    part.tables.append(table)
    return part


def throughput(bench: Bench) -> Part:
    """Rays and paths per second of the tracer, without files and sockets."""
    part = Part(
        "Rays and paths",
        [
            "`crates/raycast/examples/rays.rs`: nearest hits of incoherent rays between random points of the scene's bounds, and occlusion of rays of "
            "length 1, on one core. `crates/tracer/examples/throughput.rs`: unlimited paths of a view.",
            "Others, from another run, another day, so that ratios are not exact: Embree 3.13, one core, 15.6 M rays/s on 1,292 triangles and 2.4 on "
            "999,692, occluded 23 and 6.4; Mitsuba 3.9 `llvm_ad_rgb`, two cores, 3.4 (Cornell) and 1.1 (cabin) M paths/s, `scalar_rgb` 1.0 (Cornell).",
        ],
    )
    rays = bench.cargo.build("holo-raycast", "--example", "rays")
    paths = bench.cargo.build("holo-tracer", "--example", "throughput")
    of_rays = Table("M rays/s, one core", [["scene", ""], ["build", ""], ["built in", ""], ["nearest", ".2f"], ["within 1 unit", ".2f"]])
    of_paths = Table("M paths/s", [["scene", ""], ["threads", "d"], ["M paths/s", ".3f"]])
    ray_line = re.compile(r"^(\w+): built in (\S+); nearest ([\d.]+) M rays/s .*within 1 unit ([\d.]+) M rays/s", re.MULTILINE)
    path_line = re.compile(r"^(\d+) threads: ([\d.]+) M paths/s", re.MULTILINE)
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        obj = case.scene[0]
        if not obj.endswith(".obj"):
            part.skipped.append(f"the {case.title}: these examples take plain OBJ files; the cabin is not in ../shared/scenes")
            continue
        for build, took, nearest, occluded in ray_line.findall(run([rays, obj]).stdout):
            of_rays.rows.append([case.title, build, took, float(nearest), float(occluded)])
        view = case.view
        for threads, rate in path_line.findall(run([paths, obj, view.vp, view.vd, f"{view.vh:g}"]).stdout):
            of_paths.rows.append([case.title, int(threads), float(rate)])
    part.tables += [of_rays, of_paths]
    return part


ALL: dict[str, Callable[[Bench], Part]] = {
    "render-bias": render_bias,
    "fill-cornell-direct": fill_cornell_direct,
    "fill-cabin": fill_cabin,
    "interactive": interactive,
    "replay": replay,
    "viewpoint-share": viewpoint_share,
    "beamfile": beamfile,
    "throughput": throughput,
}
