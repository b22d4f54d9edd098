"""The measure of the whole: a new view over time, compared with the tracer alone in the same
time.
"""

from __future__ import annotations

from document import Bar, Figure, Part, Plot, Table
from harness import Bench, Walk
from plot import error_over_seconds
from program import compare
from scenes import Case

# relMSE of an interactive picture over that of the tracer alone, at the last picture.
INTERACTIVE_BAR = 2.0

# Least seconds for a picture by the tracer alone. In less time it does not finish one pass over the
# pixels.
RENDER_FROM = 0.5

# The tracer's own pictures by requested seconds: actual seconds, paths per pixel, measures.
Alone = dict[float, tuple[float, int, dict[str, float]]]


def interactive(bench: Bench) -> Part:
    """A view never seen before: its picture over time, against the tracer alone."""
    part = Part(
        "A view never seen before",
        [
            (
                "`view --headless` from an empty file, everything on this machine; pictures while"
                " samples come in. *From the start*: the first view of a new session, whose worker"
                " still has to take the scene. *After moving*: the same view after five seconds at"
                " another. The tracer alone is `render --time` for the same seconds, its scene"
                " loaded before the clock starts; its shortest picture is one path per pixel."
            ),
            (
                "*Taken at* is when the picture was written, seconds after the view was asked for;"
                " *ratio* is of the two relMSE. The last picture is taken again by `replay`,"
                " without tracing, and has to be the same byte for byte, but for pixels that no"
                " section covers: those are traced live and not stored."
            ),
            (
                "The original on 1999's hardware: 100,000 samples of a new view within 3 s. On a"
                " machine of this kind it gathers 13,700 rays/s in the cabin with all its light."
            ),
        ],
    )
    sessions = Table(
        "Starting, and memory",
        [["session", ""], ["program start to view asked for, s", ".2f"],
         ["view to first samples, s", ".3f"],
         ["program start to first picture, s", ".2f"], ["holodeck and viewer, MiB", ".0f"],
         ["holoserver, MiB", ".0f"],
         ["rtworker, MiB", ".0f"], ["file, bytes", ",d"], ["replay identical", ""]],
    )  # fmt: skip
    for case in (bench.scenes.cornell(), bench.scenes.room()):
        alone = tracer_alone(bench, case)
        lines = {
            "tracer alone": [
                (seconds, measures["relmse_trim"]) for seconds, _, measures in alone.values()
            ]
        }
        for moving in (False, True):
            walk = bench.walk(case, moving)
            title = f"{case.title}, {'after moving' if moving else 'from the start'}"
            table, ratio, points = walk_table(bench, case, walk, alone, title)
            part.tables.append(table)
            lines["after moving" if moving else "from the start"] = points
            sessions.rows.append(session_row(walk, title))
            last = walk.asked[-1]
            met = ratio <= INTERACTIVE_BAR
            what = f"relMSE over the tracer's at {last:g} s, {title}"
            part.bars.append(Bar(what, f"{ratio:.2f} ×", f"≤ {INTERACTIVE_BAR:g} ×", met))
            same = walk.identical_replay
            part.bars.append(
                Bar(f"replay, {title}", "identical" if same else "differs", "identical", same)
            )
        file = bench.plots / f"interactive-{case.name}.svg"
        error_over_seconds(file, f"A view never seen before: {case.title}", lines)
        part.plots.append(Plot(f"benchmarks/{file.name}", f"relMSE over seconds, {case.title}"))
        if not case.reference:
            part.skipped.append(
                f"no reference of the {case.title} in ../shared: held against a long render of"
                " our own"
            )
    part.tables.append(sessions)
    return part


def tracer_alone(bench: Bench, case: Case) -> Alone:
    """Returns, by requested seconds: actual seconds, paths per pixel and measures of the tracer's
    picture.
    """
    alone: Alone = {}
    for asked in bench.pictures_at:
        if asked >= RENDER_FROM:
            picture, said = bench.render(case, f"alone-{asked}", "--time", f"{asked}s")
            alone[asked] = (
                said["seconds"], said["spp"],
                compare(bench.holodeck, picture, bench.reference(case).picture)
            )
    return alone


def walk_table(
    bench: Bench, case: Case, walk: Walk, alone: Alone, title: str
) -> tuple[Table, float, list[tuple[float, float]]]:
    """Returns a session's pictures, the last one's ratio of relMSE, and its points of the plot."""
    columns = [["asked for, s", "g"], ["taken at, s", ".2f"], ["samples stored", ",d"],
               ["samples traced", ",d"], ["empty pixels", ",d"], ["relMSE", ".4f"],
               ["PSNR, dB", ".1f"], ["bias", "+.1%"], ["alone: s", ".2f"],
               ["paths per pixel", ",d"], ["relMSE", ".4f"], ["PSNR, dB", ".1f"], ["ratio", ".2f"]]  # fmt: skip
    table = Table(title, columns)
    points, ratio = [], float("inf")
    for asked, path, said in zip(walk.asked, walk.pictures, walk.session.reports):
        measures = compare(bench.holodeck, path, bench.reference(case).picture)
        error = measures["relmse_trim"]
        row = [asked, said["seconds"], said["stored"], said["traced"], said["empty_pixels"], error,
               measures["psnr_disp"], measures["bias"]]  # fmt: skip
        points.append((said["seconds"], error))
        if asked in alone:
            seconds, paths, theirs = alone[asked]
            ratio = error / theirs["relmse_trim"]
            row += [seconds, paths, theirs["relmse_trim"], theirs["psnr_disp"], ratio]
        table.rows.append([*row, *[None] * (len(columns) - len(row))])
    return table, ratio, points


def session_row(walk: Walk, title: str) -> list[Figure]:
    """Returns how a session began and what it used."""
    first = walk.session.reports[0]
    # The first report comes with the first picture of the *measured* view. If no view precedes it,
    # that is also the session's first.
    from_start = title.endswith("from the start")
    asked = walk.session.first_report - first["seconds"] if from_start else None
    picture = walk.session.first_report if from_start else None
    heard = next(
        (
            said["first_samples"]
            for said in walk.session.reports
            if said["first_samples"] is not None
        ),
        None,
    )
    memory = [
        walk.session.memory.get(role) for role in ("holodeck and viewer", "holoserver", "rtworker")
    ]
    same = "yes" if walk.identical_replay else "**no**"
    return [title, asked, heard, picture, *memory, walk.file.stat().st_size, same]
