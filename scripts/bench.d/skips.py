"""The gain of each skip: the same measurement with and without it."""

from __future__ import annotations

from document import Part, Table
from harness import Bench
from program import compare, run


def skips(bench: Bench) -> Part:
    """Beams that see nothing: filling a Cornell box with and without tracing them."""
    case = bench.scenes.cornell()
    size = "512x512"
    seconds = bench.seconds(10)
    truth, _ = bench.render(
        case, "skips", "--bounces", "0", "--spp", str(bench.paths(1024)), "--seed", "1", size=size
    )
    part = Part(
        "Skipping beams that see nothing",
        [
            f"`fill --bounces 0 --time {seconds:g}s` of the {case.title} on an 8×8×8 grid, half of"
            f" which lies before the open side, then `picture` at {size} against `render --bounces"
            f" 0 --spp {bench.paths(1024)}`. *Useful* samples are those that the beams which see"
            " something hold; where all are traced, by their share of importance."
        ],
    )
    columns = [["", ""], ["samples/s", ",.0f"], ["samples", ",d"], ["useful", ",d"],
               ["beams that see nothing", ",d"], ["in the picture", ",d"], ["PSNR, dB", ".1f"],
               ["relMSE", ".3f"], ["bias", "+.1%"], ["empty pixels", ",d"]]  # fmt: skip
    table = Table("", columns)
    share = 0.0
    for title, options in (("skipped", []), ("traced", ["--no-skip-unseen"])):
        file = bench.work / f"skips-{title}.holo"
        command = [
            bench.holodeck, "fill", *case.scene, "--bounces", "0", "-o", file, "--time",
            f"{seconds:g}s"
        ]
        filled = run([*command, *options, "--json", "--quiet"]).json()
        picture, said, _ = bench.picture(file, case.view.options(), size, f"skips-{title}")
        measures = compare(bench.holodeck, picture, truth)
        section = run([bench.holodeck, "info", file, "--json"]).json()["sections"][0]
        # Batch order deals packets in proportion to importance. The first file knows which beams
        # need none.
        share = share or section["unseen_share"]
        useful = filled["added"] if section["unseen"] else round(filled["added"] * (1.0 - share))
        row = [
            title, filled["added"] / filled["seconds"], filled["added"], useful, section["unseen"],
            said["samples"]
        ]
        table.rows.append(
            [
                *row, measures["psnr_disp"], measures["relmse_trim"], measures["bias"],
                said["empty_pixels"]
            ]
        )
    part.tables.append(table)
    return part
