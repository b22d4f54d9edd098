"""The tracer beside Mitsuba 3, in one run. For developers, because it installs Mitsuba.

Invariants: both render the same OBJ file at the same size with the same number of paths,
alternating. Neither the loading of scenes nor the compilation of Mitsuba's kernels counts.
"""

from __future__ import annotations

import json
import os
import sys
from array import array
from dataclasses import replace
from pathlib import Path

from converged import pfm
from document import Bar, Part, Plot, Table
from harness import Bench
from plot import error_over_seconds
from program import Failed, compare, run
from scenes import INTERIOR_LIVING, Case, Reference
from small_scenes import small_scenes

MITSUBA = "3.9.1"
PATHS = (16, 64, 256)
# For small scenes, for a room with few lights, and for one with a thousand emitters.
SMALL_BAR, ROOM_BAR, MANY_LIGHTS_BAR = 0.8, 1.0, 0.5
INTERIOR_SKY = [0.28, 0.42, 0.72]
# Small, because its converged picture must be rendered first.
INTERIOR_SIZE = "192x108"


def rivals(bench: Bench) -> Part:
    """Error over seconds beside Mitsuba 3, and the bias without the cabin's flood lamps."""
    part = Part(
        "The tracer beside Mitsuba",
        [
            (
                f"Mitsuba {MITSUBA} `llvm_ad_rgb`, `path`, unlimited depth, on all cores, in the"
                " same run as `render`. *Cost* is relMSE × seconds at the largest number of paths:"
                " what a given error costs, since relMSE falls as 1/paths. The truth is the"
                " reference where there is one, else a long render of our own with another seed;"
                " its own noise, by its standard errors, is taken off both renderers' relMSE."
            ),
            (
                "Mitsuba ends its shadow rays a thousandth of their length before the light, so"
                " that what stands closer to a lamp than that casts no shadow: the cabin's flood"
                " lamps, sunk into their housings, are too bright in it and in the references."
                " (`crates/light/tracer/tests/it/housing.rs` holds our tracer against double precision"
                " under such a lamp.) The last table therefore compares the two in the cabin with"
                " the flood lamps off."
            ),
            (
                "In Mitsuba's rough metal, light that meets several facets is lost: 4 % at normal"
                " incidence in the metal block. Ours reflects it (Kulla and Conty 2017), so its"
                " picture is 1.6 % brighter. Without that light, the two agree within 0.1 %."
            ),
        ],
    )
    mitsuba = Mitsuba(bench)
    problem = mitsuba.install()
    if problem:
        part.skipped.append(f"Mitsuba {MITSUBA} cannot be used here: {problem}")
        return part
    columns = [["scene", ""], ["paths per pixel", "d"], ["ours, s", ".2f"], ["relMSE", ".4f"],
               ["Mitsuba, s", ".2f"], ["relMSE", ".4f"], ["bias between the two", "+.2%"]]  # fmt: skip
    table = Table("Error over seconds", columns)
    costs = Table(
        "Cost: relMSE × seconds",
        [["scene", ""], ["ours", ".4f"], ["Mitsuba", ".4f"], ["ratio", ".2f"]],
    )
    counts = PATHS[:2] if bench.quick else PATHS
    for case, bar in cases(bench):
        lines: dict[str, list[tuple[float, float]]] = {"holodeck": [], "Mitsuba": []}
        reference = bench.reference(case)
        truth, noise = reference.picture, noise_of(bench, reference)
        theirs = mitsuba.render(case, counts)
        for paths in counts:
            ours, said = bench.render(case, f"rival-{paths}", "--spp", str(paths))
            theirs_seconds, their_picture = theirs[paths]
            error = compare(bench.holodeck, ours, truth)["relmse_trim"] - noise
            their_error = compare(bench.holodeck, their_picture, truth)["relmse_trim"] - noise
            between = compare(bench.holodeck, ours, their_picture)["bias"]
            table.rows.append(
                [case.title, paths, said["seconds"], error, theirs_seconds, their_error, between]
            )
            lines["holodeck"].append((said["seconds"], error))
            lines["Mitsuba"].append((theirs_seconds, their_error))
        cost, their_cost = (x * y for x, y in (lines["holodeck"][-1], lines["Mitsuba"][-1]))
        costs.rows.append([case.title, cost, their_cost, cost / their_cost])
        met = cost <= bar * their_cost
        part.bars.append(
            Bar(
                f"seconds to an error, {case.title}", f"{cost / their_cost:.2f} × Mitsuba's",
                f"≤ {bar:g} ×", met
            )
        )
        file = bench.plots / f"rivals-{case.name}.svg"
        error_over_seconds(file, f"Error over seconds: {case.title}", lines)
        part.plots.append(Plot(f"benchmarks/{file.name}", f"relMSE over seconds, {case.title}"))
    part.tables += [table, costs]
    if bench.scenes.room().name == "cabin":
        part.tables.append(without_floods(bench, mitsuba, part))
    return part


def cases(bench: Bench) -> list[tuple[Case, float]]:
    """Returns the compared scenes and the bars of their costs."""
    small = [bench.scenes.cornell(), *small_scenes(bench.work / "small", bench.scenes.bundle())]
    return [
        *((case, SMALL_BAR) for case in small), (bench.scenes.room(), ROOM_BAR),
        (interior(bench), MANY_LIGHTS_BAR)
    ]


def converge(bench: Bench, threads: int | None) -> None:
    """Renders the converged pictures that are missing."""
    for case, _ in cases(bench):
        print(f"{case.title} …", flush=True)
        bench.reference(case, threads)


def noise_of(bench: Bench, reference: Reference) -> float:
    """Returns the apparent error of a picture without noise: relMSE of the reference and of one
    that is a standard error brighter.
    """
    header, picture = pfm(reference.picture)
    _, error = pfm(reference.standard_error)
    brighter = bench.work / "brighter.pfm"
    brighter.write_bytes(
        header + array("f", (value + e for value, e in zip(picture, error))).tobytes()
    )
    return compare(bench.holodeck, brighter, reference.picture)["relmse_trim"]


def interior(bench: Bench) -> Case:
    """Returns the bundled interior: 90 fixtures, thousands of emitting triangles."""
    scene = ("--config", str(bench.scenes.bundle() / "interior.toml"))
    title = "bundled interior, 6,224 emitting triangles"
    return Case(
        "interior", title, scene, INTERIOR_LIVING.any_shape(), INTERIOR_LIVING, INTERIOR_SIZE, None
    )


def without_floods(bench: Bench, mitsuba: Mitsuba, part: Part) -> Table:
    """Returns the cabin's two views with its flood lamps dark, for which both renderers must agree.
    """
    room = bench.scenes.room()
    source = Path(room.scene[0])
    obj = bench.work / "no-floods.obj"
    obj.write_text(
        source.read_text(encoding="utf-8").replace("mtllib cabin.mtl", "mtllib no-floods.mtl"),
        encoding="utf-8",
    )
    materials = source.with_suffix(".mtl").read_text(encoding="utf-8").split("newmtl ")
    dark = [
        text.replace("Ke ", "# Ke ") if text.startswith("flood_light") else text
        for text in materials
    ]
    obj.with_suffix(".mtl").write_text("newmtl ".join(dark), encoding="utf-8")
    table = Table(
        "The cabin without its flood lamps",
        [["view", ""], ["paths per pixel", "d"], ["bias", "+.3%"], ["± (99 %)", ".3%"]],
    )
    paths = bench.paths(512)
    for name, view in (("living room", room.view), ("bedroom", room.before)):
        case = replace(
            room, name=f"no-floods-{name.split()[0]}", view=view, scene=(str(obj), *room.scene[1:])
        )
        error = bench.work / f"{case.name}-se.pfm"
        ours, _ = bench.render(case, "bias", "--spp", str(paths), "--se", error)
        _, theirs = mitsuba.render(case, (paths,))[paths]
        # Mitsuba's errors are those of the same estimator with as many paths, or larger, so ours
        # stand for both.
        found = compare(bench.holodeck, ours, theirs, "--se", error, "--reference-se", error)
        bias, half = found["bias"], found["bias_99"]
        table.rows.append([name, paths, bias, half])
        part.bars.append(
            Bar(
                f"bias without flood lamps, {name}", f"{bias:+.2%} ± {half:.2%}",
                "interval holds 0", abs(bias) <= half
            )
        )
    return table


def environment_of(bench: Bench) -> Path:
    """Returns the folder of the rivals' Python environment."""
    return bench.root / "target/rivals"


def environment(bench: Bench) -> Path:
    """Returns the Python of the environment for rivals under target/, and makes it if needed."""
    folder = environment_of(bench)
    if not (folder / "bin/python").exists():
        run([sys.executable, "-m", "venv", folder])
    return folder / "bin/python"


class Mitsuba:
    """Mitsuba in its own Python environment under target/."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._python = environment_of(bench) / "bin/python"

    def install(self) -> str | None:
        """Makes the environment if it does not exist; returns the reason if that is impossible."""
        try:
            environment(self._bench)
            run([self._python, "-m", "pip", "install", "--quiet", f"mitsuba=={MITSUBA}", "numpy"])
            run(
                [
                    self._python,
                    "-c",
                    (
                        "import mitsuba; mitsuba.set_variant('llvm_ad_rgb'); import drjit;"
                        " drjit.sum(drjit.arange(mitsuba.Float, 3))"
                    ),
                ]
            )
        except (Failed, OSError) as error:
            return str(error).strip().splitlines()[-1]
        return None

    def render(self, case: Case, counts: tuple[int, ...]) -> dict[int, tuple[float, Path]]:
        """Returns seconds and picture by paths per pixel."""
        view = case.view
        described = {
            "vp": numbers(view.vp), "vd": numbers(view.vd), "vu": numbers(view.vu), "vh": view.vh,
            "size": [int(side) for side in case.size.split("x")],
        }  # fmt: skip
        obj = case.scene[0]
        if obj == "--config":
            obj = str(Path(case.scene[1]).with_suffix(".obj"))
            described["sky"] = INTERIOR_SKY
        program = self._bench.root / "scripts/rivals/mitsuba_render.py"
        prefix = self._bench.work / f"mitsuba-{case.name}-"
        said = run(
            [
                self._python, program, obj, "llvm_ad_rgb", json.dumps(described),
                ",".join(map(str, counts)), prefix
            ]
        )
        found = [json.loads(line) for line in said.stdout.splitlines() if line.startswith("{")]
        return {line["spp"]: (line["seconds"], Path(line["picture"])) for line in found}


def numbers(triple: str) -> list[float]:
    return [float(word) for word in triple.split(",")]


def newest_llvm() -> None:
    """Points Mitsuba to the newest LLVM, which Rust brings: older ones lack instructions."""
    rust = Path(run(["rustc", "--print", "sysroot"]).stdout.strip()) / "lib"
    found = sorted(Path("/usr/lib").glob("*-linux-gnu/libLLVM.so.*")) + sorted(
        rust.glob("libLLVM.so.*")
    )
    if found and "DRJIT_LIBLLVM_PATH" not in os.environ:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(found[-1])


newest_llvm()
