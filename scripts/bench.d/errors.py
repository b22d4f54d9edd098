"""Error over time of both engines, trimmed and untrimmed, for every scene and view."""

from __future__ import annotations

from dataclasses import replace

from document import Part, Plot, Table
from harness import Bench
from plot import Series, error_over_seconds
from program import compare
from scenes import INTERIOR_BEDROOM, INTERIOR_LIVING, Case, View

PATHS = (4, 16, 64, 256)

# Scenes without an independent reference are small, because their converged picture must be
# rendered first.
SMALL = {"cabin": "96x72", "interior": "96x54", "cornell": "128x128"}

# The cabin's views of ../shared/scenes that have no reference there.
CABIN_OTHERS = {
    "living room, lamps": View("15,9,5", "0.986588,0.0507496,-0.155139", "0,0,1", 60, 46.826),
    "bathroom": View("8,14.5,5", "-0.894427,0.447214,0", "0,0,1", 60, 46.826),
    "coat rack": View("22,12,5", "0.563075,0.755671,-0.334526", "0,0,1", 40, 30.53),
}


def errors(bench: Bench) -> Part:
    """Error over seconds of both engines, with and without the worst pixels."""
    part = Part(
        "Error over seconds",
        [
            (
                "`render --spp`, all light unless said otherwise, on all cores; the scene's"
                " loading is not counted, what the engine `gather` learns is. *relMSE* as"
                " everywhere in this document, *untrimmed* with the worst 0.1 % of pixels:"
                " fireflies, and edges that a reference has a quarter of a pixel elsewhere. *Cost*"
                " is relMSE × seconds, which paths alone leave as it is; *untrimmed* that of all"
                " pixels. The truth of what has no independent reference is a render of our own"
                f" with {bench.paths(2048)} paths and another seed."
            ),
        ],
    )
    columns = [["scene", ""], ["truth", ""], ["engine", ""], ["paths per pixel", "d"],
               ["seconds", ".2f"], ["relMSE", ".4f"], ["untrimmed", ".4f"], ["bias", "+.2%"],
               ["cost", ".4f"], ["cost, untrimmed", ".4f"]]  # fmt: skip
    table = Table("", columns)
    for case, options in cases(bench):
        truth = bench.reference(case).picture
        whose = "independent" if case.reference else "our own"
        lines: Series = {}
        for engine in ("path", "gather"):
            for paths in PATHS[: 2 if bench.quick else None]:
                name = f"error-{engine}-{paths}"
                picture, said = bench.render(
                    case, name, "--spp", str(paths), "--engine", engine, *options
                )
                measures = compare(bench.holodeck, picture, truth)
                seconds, error, whole = said["seconds"], measures["relmse_trim"], measures["relmse"]
                lines.setdefault(engine, []).append((seconds, error))
                lines.setdefault(f"{engine}, untrimmed", []).append((seconds, whole))
                row = [case.title, whose, engine, paths, seconds, error, whole, measures["bias"]]
                table.rows.append([*row, error * seconds, whole * seconds])
        file = bench.plots / f"errors-{case.name}.svg"
        error_over_seconds(file, f"Error over seconds: {case.title}", lines)
        part.plots.append(Plot(f"benchmarks/{file.name}", f"relMSE over seconds, {case.title}"))
    part.tables.append(table)
    if bench.scenes.room().name != "cabin":
        part.skipped.append("the cabin is not in ../shared/scenes")
    return part


def cases(bench: Bench) -> list[tuple[Case, list[str]]]:
    """Returns all cases, with the options that their converged pictures were made with."""
    found: list[tuple[Case, list[str]]] = [(case, []) for case in bench.scenes.referenced()]
    direct = bench.scenes.reference("cornell_direct")
    cornell = bench.scenes.cornell()
    if direct and cornell.reference:
        case = replace(
            cornell, name="cornell_direct", title=f"{cornell.title}, direct light", reference=direct
        )
        found.insert(1, (case, ["--bounces", "0"]))
    room = bench.scenes.room()
    if room.name == "cabin":
        for name, view in CABIN_OTHERS.items():
            short = f"cabin-{name.replace(' ', '-').replace(',', '')}"
            found.append(
                (
                    replace(
                        room, name=short, title=f"cabin, {name}", view=view, size=SMALL["cabin"],
                        reference=None
                    ),
                    [],
                )
            )
    bundle = bench.scenes.bundle()
    box = replace(
        cornell, name="cornell-bundled", title="bundled Cornell box", size=SMALL["cornell"],
        reference=None
    )
    found.append((replace(box, scene=(str(bundle / "cornell.obj"),)), []))
    scene = ("--config", str(bundle / "interior.toml"))
    for name, view in (("living room", INTERIOR_LIVING), ("bedroom", INTERIOR_BEDROOM)):
        short = f"interior-small-{name.split()[0]}"
        view = view.any_shape()
        found.append(
            (
                Case(
                    short, f"bundled interior, {name}", scene, view, view, SMALL["interior"], None
                ),
                [],
            )
        )
    return found
