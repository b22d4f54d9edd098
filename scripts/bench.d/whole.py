"""The measure of the whole: views of a filled holodeck, right after the request and while workers
continue.
"""

from __future__ import annotations

from dataclasses import replace

from document import Bar, Part, Plot, Table
from harness import Bench
from plot import Axis, Series, decibels_over_seconds
from program import compare, run
from scenes import CABIN_VIEWS, Case

# Seconds after the request of a view, and the decibels wanted of the five views by then, by driver.
ASKED = (0.1, 1.0, 10.0)
WANTED = {"quadtree": (18, 20, 22), "surfaces": (24, 26, 29)}
# The same for the Cornell box at first.
CORNELL_WANTED = {"quadtree": 25, "surfaces": 30}
# Seconds between two views.
STAY = 10.5
# Greatest distance in decibels below the tracer alone, given the same time.
BELOW_TRACER = 1.0


def whole(bench: Bench) -> Part:
    """Pictures of a filled file at 0.1, 1 and 10 s after each of several views."""
    part = Part(
        "The measure of the whole",
        [
            (
                "A file filled in batch by the engine `gather` (Cornell box 20 s, the cabin's three"
                " sections 60 s), then one session with a worker and a move to each view in turn;"
                " PSNR and relMSE of the pictures at 0.1, 1 and 10 s after the view was asked for."
                " *Tracer alone*: `render --engine path --time` for 1 and 10 s, its scene loaded."
                " Truth where there is no reference: a render of our own, `--engine path --spp"
                " 2048`."
            ),
        ],
    )
    # By scene: the worst view's decibels over seconds, by driver.
    worst: dict[str, Series] = {}
    for driver in WANTED:
        part.tables.append(views(bench, part, driver, worst))
    for scene, series in worst.items():
        file, title = (
            bench.plots / f"whole-{scene}.svg",
            f"Seconds after a view is asked for, worst view: {scene}",
        )
        decibels_over_seconds(file, title, series, Axis)
        part.plots.append(
            Plot(f"benchmarks/{file.name}", f"PSNR over seconds, worst view, {scene}")
        )
    return part


def cases(bench: Bench) -> list[tuple[Case, str, tuple[Case, ...]]]:
    """Returns, for each scene, a case, the seconds of its fill, and its views in order."""
    cornell, room = bench.scenes.cornell(), bench.scenes.room()
    rooms = (room,)
    if room.name == "cabin":
        known = {"living": room.reference, "bedroom": bench.scenes.reference("cabin_bed")}
        rooms = tuple(
            replace(
                room, name=f"cabin-{name}", title=f"cabin, {name}", view=view,
                reference=known.get(name)
            )
            for name, view in CABIN_VIEWS.items()
        )
    return [(cornell, 20, (cornell,)), (room, 60, rooms)]


def views(bench: Bench, part: Part, driver: str, worst: dict[str, Series]) -> Table:
    columns = [["view", ""]]
    for seconds in ASKED:
        columns += [[f"at {seconds:g} s, dB", ".1f"], ["relMSE", ".4f"]]
    columns += [["tracer alone 1 s, dB", ".1f"], ["10 s, dB", ".1f"]]
    table = Table(f"Driver `{driver}`", columns)
    for case, seconds, looks in cases(bench):
        filled, _ = bench.fill(f"{case.name}-gather", case, seconds, "--engine", "gather")
        # The session adds to the file, so every driver gets the same copy.
        file = bench.work / f"{case.name}-{driver}.holo"
        file.write_bytes(filled.read_bytes())
        lines, pictures = [], {}
        for index, look in enumerate(looks):
            # A script's seconds count from the last view.
            lines.append(f"{bench.seconds(STAY) if index else 0} view {look.view.line()}")
            for asked in ASKED:
                picture = bench.work / f"whole-{driver}-{look.name}-{asked}.pfm"
                pictures[look.name, asked] = picture
                lines.append(f"{bench.seconds(asked)} picture {picture}")
        script = bench.work / f"whole-{driver}-{case.name}.txt"
        script.write_text("\n".join([*lines, "quit", ""]), encoding="utf-8")
        common = ["--headless", "--quiet", "--size", case.size, "--driver", driver]
        run([bench.holodeck, "view", file, *common, "--script", script])
        lowest, lowest_alone = [float("inf")] * len(ASKED), [float("inf")] * len(ASKED[1:])
        for look in looks:
            row: list = [look.title]
            truth = bench.truth(look)
            found = [compare(bench.holodeck, pictures[look.name, asked], truth) for asked in ASKED]
            lowest = [min(low, measures["psnr_disp"]) for low, measures in zip(lowest, found)]
            for measures in found:
                row += [measures["psnr_disp"], measures["relmse_trim"]]
            alone = [tracer_alone(bench, look, asked) for asked in ASKED[1:]]
            lowest_alone = [min(pair) for pair in zip(lowest_alone, alone)]
            row += alone
            table.rows.append(row)
            if driver == "surfaces":
                margin = min(
                    measures["psnr_disp"] - psnr for measures, psnr in zip(found[1:], alone)
                )
                met = margin >= -BELOW_TRACER
                part.bars.append(
                    Bar(
                        f"above the tracer alone at 1 and 10 s, {look.title}", f"{margin:+.1f} dB",
                        f"≥ -{BELOW_TRACER:g} dB", met
                    )
                )
        wanted = (CORNELL_WANTED[driver],) if case.name == "cornell" else WANTED[driver]
        worst.setdefault(case.name, {}).update(
            {driver: list(zip(ASKED, lowest)), "tracer alone": list(zip(ASKED[1:], lowest_alone))}
        )
        for asked, low, want in zip(ASKED, lowest, wanted):
            part.bars.append(
                Bar(
                    f"{driver}, {case.title.split(',')[0]}, worst view at {asked:g} s",
                    f"{low:.1f} dB", f"≥ {want} dB", low >= want
                )
            )
    return table


_alone: dict = {}


def tracer_alone(bench: Bench, look: Case, seconds: float) -> float:
    """Returns the PSNR of the path tracer's own picture, given the same time."""
    if (look.name, seconds) not in _alone:
        picture, _ = bench.render(look, f"alone-{seconds}", "--time", f"{bench.seconds(seconds)}s")
        _alone[look.name, seconds] = compare(bench.holodeck, picture, bench.truth(look))[
            "psnr_disp"
        ]
    return _alone[look.name, seconds]
