"""Cached reflections: the experiments of Ruff, Clua and Fernandes 2013, and what they left out.

Invariant: times are processor times of one core, of the same binary with and without cubes.
"""

from __future__ import annotations

import json
from pathlib import Path

from document import Bar, Part, Table
from harness import Bench
from program import run
from quadtree import one_core

# The side of pictures, pixels, as in the paper.
SIDE = 1024
QUICK_SIDE = 256
# Texels along a side of a face.
TEXELS = (128, 256, 512)
# Further spheres, and frames a second of the paper: standard and cached, Table I and Table II.
PAPER: dict[int, tuple[tuple[float, float], tuple[float, float] | None]] = {
    0: ((68, 125), None),
    1: ((63, 120), (56.7, 57.8)),
    2: ((59, 117), (52.0, 55.6)),
    4: ((49, 98), (44.7, 51.8)),
    8: ((38, 85), (32.8, 43.5)),
    16: ((23, 63), (17.1, 33.4)),
    32: ((12, 42), (8.0, 21.5)),
}
# Invalid share after the first, the seventh and the eighth of nine steps (Fig. 7, as its text says).
PAPER_FILLS = {128: (0.03, 0.0, 0.0), 256: (0.31, 0.0, 0.0), 512: (0.73, None, 0.01)}
# Largest difference of these shares.
SAME_SHARE = 0.05
# Least ratio of a frame without cubes to one with them, 32 further spheres (Table II).
LEAST_GAIN = 2.5


def reflections(bench: Bench) -> Part:
    """Cached reflections: cost, filling and error by resolution, beside the paper's figures."""
    side = QUICK_SIDE if bench.quick else SIDE
    part = Part(
        "Cached reflections",
        [
            (
                "`crates/light/tracer/examples/reflections.rs` on the scenes of `holo-scenes"
                f" reflections`: {side} × {side} pixels, one path a pixel, direct light, perfect"
                " mirrors, one core, processor time. Cubes of 512² texels a face, filled before."
                " *Paper*: Ruff, Clua and Fernandes, \"Dynamic per Object Ray Caching Textures\","
                " 2013, frames a second on a GTX 680. *Gain*: cost without cubes over cost with"
                " them. *Hybrid* (Table I): without the cost of first hits, which the paper"
                " rasterised."
            ),
            (
                "*Wrong*: pixels of mirrors that are more than a tenth off. *PSNR*: of these"
                " pixels, with three times their mean as white. *Rms*: relative, without a limit,"
                " so that edges of the lamp count most. Without parallax, look-ups are the"
                " paper's: the nearest texel of the direction."
            ),
        ],
    )
    folder = bench.work / "reflections"
    run([bench.cargo.build("holo-scenes"), "reflections", "--out", folder])
    example = bench.cargo.build("holo-tracer", "--example", "reflections")

    def measure(scene: str, what: str, texels: int, *options: str | Path) -> dict:
        words = [example, folder / f"{scene}.obj", what, str(side), str(texels), *options]
        with one_core():
            return json.loads(run(words).stdout)

    times(part, measure)
    fills(part, measure)
    errors(part, measure)
    return part


def times(part: Part, measure) -> None:
    """Tables I and II, and Fig. 6."""
    columns = [
        ["further spheres", "d"], ["standard, ms", ".1f"], ["cached, ms", ".1f"],
        ["gain", ".2f"], ["paper's gain", ".2f"],
    ]  # fmt: skip
    hybrid = Table("Table I and Fig. 6: hybrid, spheres behind the eye", columns)
    whole = Table("Table II: conventional, spheres before the eye", columns)
    gains: dict[int, float] = {}
    for further, (of_hybrid, of_whole) in PAPER.items():
        found = measure(f"behind-{further}", "times", 512)
        plain, cached = (found[key] - found["first_hits"] for key in ("standard", "cached"))
        hybrid.rows.append(
            [further, plain, cached, plain / cached, of_hybrid[1] / of_hybrid[0]]
        )
        found = measure(f"before-{further}", "times", 512)
        gains[further] = found["standard"] / found["cached"]
        paper = of_whole[1] / of_whole[0] if of_whole else None
        whole.rows.append(
            [further, found["standard"], found["cached"], gains[further], paper]
        )
    part.tables += [hybrid, whole]
    most = max(gains)
    part.bars.append(
        Bar(
            f"Table II: cost without cubes over cost with them, {most} further spheres",
            f"{gains[most]:.2f}", f"≥ {LEAST_GAIN:g}", gains[most] >= LEAST_GAIN,
        )  # fmt: skip
    )
    part.bars.append(
        Bar(
            "Table II: the same, one sphere", f"{gains[0]:.2f}", "≥ 0.98", gains[0] >= 0.98
        )
    )


def fills(part: Part, measure) -> None:
    """Fig. 7."""
    columns = [["texels", ""], *([f"before {step}", ".1%"] for step in range(1, 10))]
    columns += [["after 9", ".1%"], ["paper, after 1", ".1%"], ["after 7", ".1%"],
                ["after 8", ".1%"]]  # fmt: skip
    table = Table("Fig. 7: invalid texels over nine steps of 10/3°", columns)
    worst = 0.0
    for texels in TEXELS:
        invalid = measure("behind-0", "fills", texels)["invalid"]
        paper = PAPER_FILLS[texels]
        table.rows.append([f"{texels}²", *invalid, *paper])
        for step, share in zip((1, 7, 8), paper):
            if share is not None:
                worst = max(worst, abs(invalid[step] - share))
    part.tables.append(table)
    part.bars.append(
        Bar(
            "Fig. 7: largest difference from the paper's shares", f"{100 * worst:.1f} points",
            f"≤ {100 * SAME_SHARE:g} points", worst <= SAME_SHARE,
        )  # fmt: skip
    )


def errors(part: Part, measure) -> None:
    """Figs. 1, 8 and 9, and the error by distance of the surroundings."""
    columns = [["scene", ""], ["texels", ""], ["look-up", ""], ["wrong", ".2%"],
               ["PSNR, dB", ".1f"], ["rms", ".1%"]]  # fmt: skip
    figures = Table("Figs. 1, 8 and 9: error against traced reflections", columns)
    lookups = (("paper's", ["unmarked"]), ("parallax", ["parallax"]))
    names = {
        "blocks": "Fig. 1, ten blocks", "before-32": "Fig. 1, 33 spheres", "cone": "Fig. 8, cone",
        "cylinder": "Fig. 8, cylinder", "concave": "Fig. 9, concave",
    }  # fmt: skip
    distances = Table("Error by resolution and distance of the surroundings", columns)
    for table, scenes in (
        (figures, names),
        (distances, {"near": "walls 4.5 radii away", "far": "walls 45 radii away"}),
    ):
        for scene, title in scenes.items():
            for texels in TEXELS if scene in ("blocks", "before-32", "near", "far") else (512,):
                for lookup, options in lookups:
                    found = measure(scene, "errors", texels, *options)
                    figures_of = [found[key] for key in ("wrong", "psnr", "rms")]
                    table.rows.append([title, f"{texels}²", lookup, *figures_of])
        part.tables.append(table)
