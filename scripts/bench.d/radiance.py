"""The engine `gather` beside Radiance's rpict with its own indirect cache. For developers, because
it installs pyradiance.

Invariants: both render the same triangles at the same size, filtered by a box, in one thread,
alternating. The processor seconds of both include their start, the scene, and the filling of their
caches.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from document import Bar, Part, Plot, Table
from harness import TRUTH_PATHS, Bench
from plot import error_over_seconds
from program import Failed, compare, run
from scenes import Case

PYRADIANCE = "1.3.1"
BAR = 0.3
# Our paths per pixel.
COUNTS = (1, 4, 16, 64, 256)
# A picture may be lucky. Each point is the mean of several pictures; otherwise the
# luckiest would be chosen.
SEEDS = (1, 2, 3)


@dataclass(frozen=True)
class Setting:
    """Settings of rpict's indirect cache, and its pixels per pixel of the picture along each side.
    """

    over: int
    ab: int
    ad: int
    ar: int
    aa: float

    def options(self) -> list[str]:
        # A quarter of the divisions are super-samples, as in Radiance's own `rad`.
        return [
            f"-ab {self.ab}", f"-ad {self.ad}", f"-as {self.ad // 4}", f"-ar {self.ar}",
            f"-aa {self.aa:g}"
        ]


# Coarse settings first.
SETTINGS = (
    Setting(1, 3, 128, 32, 0.3),
    Setting(2, 3, 128, 32, 0.2),
    Setting(2, 4, 256, 64, 0.2),
    Setting(2, 5, 512, 128, 0.15),
    Setting(2, 7, 1024, 128, 0.15),
)

# Soft shadows by a jittered point in each part of a lamp, with no shadow guessed. Low weights are
# followed.
DIRECT = ["-dt 0", "-dc 1", "-ds .1", "-dj 1", "-lw 1e-6", "-lr 12"]
# Every pixel is traced, at any point within it.
PIXELS = ["-ps 1", "-pt 0", "-pj 1", "-pa 1"]


@dataclass(frozen=True)
class Point:
    """One picture: its cost, its distance from the converged picture, and its settings."""

    seconds: float
    error: float
    bias: float
    worst_block: float
    how: str


def radiance(bench: Bench) -> Part:
    """Error over seconds of `gather` beside Radiance's rpict with its indirect cache."""
    part = Part(
        "Clean samples beside Radiance",
        [
            (
                "`render --engine gather --threads 1` with several numbers of paths per pixel,"
                f" each the mean of {len(SEEDS)} seeds, and rpict (pyradiance {PYRADIANCE}) with"
                " its indirect cache, no ambient file, at several settings, over the seconds that"
                " the processor ran for the whole program. rpict traces every pixel at a jittered"
                " place, its pictures are averaged by a box; the averaging is not counted. Lamps"
                " reflect nothing there, which makes the Cornell box 0.8 % darker."
            ),
            (
                "*At equal error*: for each of rpict's pictures that no quicker one of its own"
                " matches, the seconds of ours to the same relMSE, between our neighbouring best"
                " pictures along a straight line of logarithms; where our coarsest is already"
                " better, its seconds."
            ),
            (
                "The corridor is the bundled one, lit only indirectly through a door; its truth is"
                " a render of our own by the engine `path` with"
                f" {bench.paths(TRUTH_PATHS) / 1e6:.0f} M paths, made once."
            ),
        ],
    )
    program = Radiance(bench)
    problem = program.install()
    if problem:
        part.skipped.append(f"pyradiance {PYRADIANCE} cannot be used here: {problem}")
        return part
    columns = [
        ["scene", ""], ["renderer", ""], ["settings", ""], ["CPU s", ".2f"], ["relMSE", ".4f"],
        ["bias", "+.1%"], ["worst block", ".1%"]
    ]
    table = Table("Error over seconds", columns)
    equal = Table(
        "At equal error",
        [
            ["scene", ""], ["relMSE", ".4f"], ["rpict, s", ".2f"], ["gather, s", ".2f"],
            ["ratio", ".2f"]
        ],
    )
    for case in (bench.scenes.cornell(), bench.scenes.corridor()):
        truth = bench.truth(case)
        theirs, ours = [], []
        for setting in SETTINGS[: 2 if bench.quick else None]:
            picture, seconds = program.render(case, setting)
            shown = f"{setting.over} × {setting.over}, {' '.join(setting.options())}"
            theirs.append(measured(bench, picture, truth, seconds, shown))
        for count in COUNTS[: 2 if bench.quick else None]:
            found = []
            for seed in SEEDS:
                picture, seconds = our_render(bench, case, count, seed)
                found.append(measured(bench, picture, truth, seconds, f"{count} paths"))
            ours.append(mean(found))
        for name, points in (("gather", ours), ("rpict", theirs)):
            table.rows += [
                [case.title, name, p.how, p.seconds, p.error, p.bias, p.worst_block] for p in points
            ]
        ratios = []
        for point in best(theirs):
            seconds = seconds_to(best(ours), point.error)
            ratio = seconds / point.seconds if seconds else None
            ratios.append(ratio)
            equal.rows.append([case.title, point.error, point.seconds, seconds, ratio])
        reached = [ratio for ratio in ratios if ratio]
        worst = max(reached) if len(reached) == len(ratios) else None
        figure = (
            f"{worst:.2f} × rpict's at worst"
            if worst
            else f"never at {len(ratios) - len(reached)} of {len(ratios)} errors"
        )
        part.bars.append(
            Bar(
                f"seconds to an error, {case.title}", figure, f"≤ {BAR:g} ×",
                bool(worst) and worst <= BAR
            )
        )
        file = bench.plots / f"radiance-{case.name}.svg"
        lines = {
            name: [(p.seconds, p.error) for p in best(points)]
            for name, points in (("gather", ours), ("rpict", theirs))
        }
        error_over_seconds(file, f"Error over CPU seconds: {case.title}", lines)
        part.plots.append(Plot(f"benchmarks/{file.name}", f"relMSE over seconds, {case.title}"))
    part.tables += [equal, table]
    return part


def measured(bench: Bench, picture: Path, truth: Path, seconds: float, how: str) -> Point:
    found = compare(bench.holodeck, picture, truth)
    return Point(seconds, found["relmse_trim"], found["bias"], found["worst_block"], how)


def mean(points: list[Point]) -> Point:
    """Returns the mean of pictures made in the same way; of blocks, the worst."""
    seconds, error, bias = (
        sum(values) / len(points) for values in zip(*((p.seconds, p.error, p.bias) for p in points))
    )
    return Point(seconds, error, bias, max(p.worst_block for p in points), points[0].how)


def our_render(bench: Bench, case: Case, count: int, seed: int) -> tuple[Path, float]:
    """Renders a picture in one thread; returns it and the seconds of the whole program."""
    picture = bench.work / f"{case.name}-beside-rpict.pfm"
    command = [
        bench.holodeck, "render", *case.scene, *case.view.options(), "--size", case.size,
        "--threads", "1", "--quiet"
    ]
    options = ["--engine", "gather", "--spp", str(count), "--seed", str(seed)]
    return picture, run([*command, *options, "-o", picture]).processor


def best(points: list[Point]) -> list[Point]:
    """Returns the points that no quicker point matches, quick ones first."""
    found: list[Point] = []
    for point in sorted(points, key=lambda point: point.seconds):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def seconds_to(points: list[Point], error: float) -> float | None:
    """Returns the seconds to an error, for points from `best`; `None` if no point reaches it."""
    if points[0].error <= error:
        return points[0].seconds
    for coarse, fine in zip(points, points[1:]):
        if fine.error <= error:
            share = math.log(coarse.error / error) / math.log(coarse.error / fine.error)
            return coarse.seconds * (fine.seconds / coarse.seconds) ** share
    return None


class Radiance:
    """Radiance's programs in their own Python environment under target/."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._folder = bench.root / "target/radiance"
        self._programs = Path()

    def install(self) -> str | None:
        """Makes the environment if it does not exist; returns the reason if that is impossible."""
        python = self._folder / "bin/python"
        try:
            if not python.exists():
                run([sys.executable, "-m", "venv", self._folder])
                run([python, "-m", "pip", "install", "--quiet", f"pyradiance=={PYRADIANCE}"])
            package = Path(
                run(
                    [python, "-c", "import pyradiance; print(pyradiance.__path__[0])"]
                ).stdout.strip()
            )
            self._programs = package / "bin"
            # Where its programs find their own files.
            os.environ["RAYPATH"] = str(package / "lib")
            run([self._programs / "rpict", "-defaults"])
        except (Failed, OSError) as error:
            return str(error).strip().splitlines()[-1]
        return None

    def render(self, case: Case, setting: Setting) -> tuple[Path, float]:
        """Renders a picture of the case's view; returns it and the seconds of rpict."""
        octree = self._octree(case)
        width, height = (int(side) for side in case.size.split("x"))
        view = case.view
        angles = f"-vtv -vh {view.vh:g} -vv {view.vv or view.vh:g}"
        spaced = " ".join(
            f"-{name} {value.replace(',', ' ')}"
            for name, value in (("vp", view.vp), ("vd", view.vd), ("vu", view.vu))
        )
        size = f"-x {width * setting.over} -y {height * setting.over}"
        large, picture = (
            self._bench.work / f"{case.name}-rpict{end}.hdr" for end in ("-large", "")
        )
        options = " ".join([angles, spaced, size, *PIXELS, *DIRECT, *setting.options()]).split()
        # It overwrites nothing.
        large.unlink(missing_ok=True)
        ran = run([self._programs / "rpict", *options, "-o", large, octree])
        # One pass keeps the exposure; its default filter is a box.
        write(picture, [self._programs / "pfilt", "-1", "-x", width, "-y", height, large])
        return picture, ran.processor

    def _octree(self, case: Case) -> Path:
        source, octree = (self._bench.work / f"{case.name}{end}" for end in (".rad", ".oct"))
        if not octree.exists():
            source.write_text(as_radiance(Path(case.scene[0])), encoding="utf-8")
            write(octree, [self._programs / "oconv", source])
        return octree


def write(path: Path, command: list) -> None:
    """Runs a command that writes bytes to its output."""
    words = [str(word) for word in command]
    with path.open("wb") as file:
        ended = subprocess.run(words, stdout=file, stderr=subprocess.PIPE, check=False)
    if ended.returncode != 0:
        raise Failed(
            f"`{' '.join(words)}` ended with status"
            f" {ended.returncode}:\n{ended.stderr.decode(errors='replace').strip()}"
        )


def as_radiance(obj: Path) -> str:
    """Converts an OBJ scene of diffuse surfaces and lamps to Radiance's format, in the same units.
    """
    materials = materials_of(obj.with_suffix(".mtl"))
    lines = []
    for name, values in materials.items():
        if "Ke" in values:
            # One-sided like ours; it reflects nothing.
            lines.append(f"void light {name} 0 0 3 {values['Ke']}")
        else:
            lines.append(f"void plastic {name} 0 0 5 {values['Kd']} 0 0")
    corners: list[str] = []
    material = ""
    for line in obj.read_text(encoding="utf-8").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "v":
            corners.append(rest)
        elif word == "usemtl":
            material = rest.strip()
        elif word == "f":
            face = [corners[int(number.split("/")[0]) - 1] for number in rest.split()]
            # A lamp of one piece is one light source. Not all other faces are flat.
            whole = "Ke" in materials[material]
            pieces = [face] if whole else [[face[0], *pair] for pair in zip(face[1:], face[2:])]
            for piece in pieces:
                lines.append(
                    f"{material} polygon p{len(lines)} 0 0 {3 * len(piece)} {' '.join(piece)}"
                )
    return "\n".join([*lines, ""])


def materials_of(mtl: Path) -> dict[str, dict[str, str]]:
    """Returns, by name, the lines of each material by their first words. Fails for materials that
    are neither diffuse nor a lamp.
    """
    found: dict[str, dict[str, str]] = {}
    name = ""
    for line in mtl.read_text(encoding="utf-8").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            name = rest.strip()
            found[name] = {}
        elif word == "illum" and int(rest) > 1:
            raise Failed(f"{mtl}: `{name}` is not diffuse: this scene is not one for rpict here")
        elif word:
            found[name][word] = rest
    return found
