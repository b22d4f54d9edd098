"""The gain of leaving out features that a scene lacks.

Compares a scene without a feature with the same scene and an invisible trace of the feature, by
processor time and by picture.
"""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

from document import Bar, Part, Table
from harness import Bench
from program import compare, run

VIEW = ("--vp=2.78,2.73,-2", "--vd=0,0,1", "--vu=0,1,0", "--vh=60", "--size=256x256")
# Inside the short block, which has no openings.
GLASS = """
usemtl unseen_glass
v 1.75 0.5 1.6
v 1.85 0.5 1.6
v 1.75 0.6 1.6
v 1.75 0.5 1.7
f -4 -2 -3
f -4 -3 -1
f -3 -2 -1
f -4 -1 -2
"""
GLASS_MATERIAL = "\nnewmtl unseen_glass\nillum 7\nNi 1.5\nTf 1 1 1\n"

# A square in the same place, with a texture, its own normals, and textures of normals and of
# roughness.
SHADED = """
usemtl unseen_shaded
v 1.75 0.5 1.6
v 1.85 0.5 1.6
v 1.75 0.6 1.6
vt 0 0
vt 1 0
vt 0 1
vn 0 0 1
vn 0.1 0 1
vn 0 0.1 1
f -3/-3/-3 -2/-2/-2 -1/-1/-1
"""
SHADED_MATERIAL = (
    "\nnewmtl unseen_shaded\nKd 1 1 1\nmap_Kd unseen.png\nnorm unseen.png\nmap_Pr unseen.png\n"
)
# A normal that points off the surface.
SHADED_TEXEL = (128, 128, 255)

# Above the blocks and below the lamp, where nothing stands.
EMPTY_SECTION = "--section=0.5,3.5,0.5 4.5,0,0 0,1.7,0 0,0,4.6 3,2,3"
EMPTY_VIEW = ("--vp=2.7,4.3,2.8", "--vd=-1,0,0", "--vu=0,1,0", "--vh=40", "--size=128x128")

# Paths of the converged picture, over those of the picture that is judged.
TRUTH = 8
# Greatest relative difference of two pictures from the same random numbers.
SAME = 1e-3


@dataclass
class Variant:
    """One way to make a picture: `make` writes it and returns seconds of processor time."""

    picture: Path
    error: Path
    make: Callable[[], float]


@dataclass
class Skip:
    """A feature that is skipped, the variants with and without the skip, and the reference of the
    result.
    """

    what: str
    skipped: Variant
    done: Variant
    # A converged picture. `None`: both variants use the same random numbers and are compared
    # directly.
    truth: Variant | None


def ablations(bench: Bench) -> Part:
    """Skips one by one: processor time with and without each, and equality of results."""
    rounds = 1 if bench.quick else 3
    part = Part(
        "What skipping gains",
        [
            f"Processor time of the whole program, the least of {rounds} alternate runs. "
            "*Skipped*: the scene lacks it, and nothing is done about it. *Not skipped*: there is "
            "a trace of it that no ray meets, or so little of it that it cannot be seen (a piece "
            "of glass within a block; a sky or a lamp of 1e-6 of the light), or, for "
            f"obstructions, it is asked for. `render --spp {spp(bench)}` of the bundled Cornell "
            "box at 256², `fill` with a section in which nothing stands. Where random numbers "
            f"differ, *difference* is that of the two biases against a render of {TRUTH} times as "
            "many paths, with its 99 % interval; else that of the two pictures. (Beams that see "
            "nothing: above.)",
            "Paths branch at their first surface if one square gives all light. With a sky they do "
            "not. They then have fewer rays and more noise, so *skipped* takes longer in that row.",
        ],
    )  # fmt: skip
    columns = [["skipped", ""], ["skipped, s", ".2f"], ["not skipped, s", ".2f"], ["ratio", ".3f"],
               ["difference", "+.3%"], ["± (99 %)", ".3%"]]  # fmt: skip
    table = Table("", columns)
    for skip in skips_to_measure(bench):
        times = [(skip.skipped.make(), skip.done.make()) for _ in range(rounds)]
        skipped, done = min(t[0] for t in times), min(t[1] for t in times)
        if skip.truth:
            skip.truth.make()
            one, other = (
                against(bench, variant, skip.truth) for variant in (skip.skipped, skip.done)
            )
            difference, half = one[0] - other[0], math.hypot(one[1], other[1])
        else:
            # Only rounding, and samples that rounding moves to the next code of a colour.
            difference, half = (
                compare(bench.holodeck, skip.skipped.picture, skip.done.picture)["bias"],
                SAME,
            )
        table.rows.append(
            [skip.what, skipped, done, skipped / done, difference, half if skip.truth else None]
        )
        bar = Bar(
            f"same result, {skip.what}", f"{difference:+.3%}", f"within ±{half:.3%}",
            abs(difference) <= half
        )
        part.bars.append(bar)
    part.tables.append(table)
    return part


def against(bench: Bench, variant: Variant, truth: Variant) -> tuple[float, float]:
    """Returns the bias, and half the width of its interval."""
    options = ("--se", variant.error, "--reference-se", truth.error)
    measures = compare(bench.holodeck, variant.picture, truth.picture, *options)
    return measures["bias"], measures["bias_99"]


def spp(bench: Bench) -> int:
    return 16 if bench.quick else 128


def skips_to_measure(bench: Bench) -> list[Skip]:
    """Returns all skips except that of beams that hit nothing."""
    plain, glass, dark, faint, shaded = scenes(bench)

    def render(name: str, obj: Path, *options: str, seed: int = 3, times: int = 1) -> Variant:
        picture, error = bench.work / f"ablation-{name}.pfm", bench.work / f"ablation-{name}-se.pfm"
        command = [
            bench.holodeck, "render", obj, *VIEW, "--spp", str(spp(bench) * times), "--seed",
            str(seed), *options
        ]
        return Variant(
            picture, error,
            lambda: run([*command, "--se", error, "--quiet", "-o", picture]).processor
        )

    def truth(name: str, obj: Path, *options: str) -> Variant:
        return render(name, obj, *options, seed=1, times=TRUTH)

    def fill(obstructions: str) -> Variant:
        picture, file = (
            bench.work / f"ablation-{obstructions}.pfm",
            bench.work / f"ablation-{obstructions}.holo",
        )
        samples = "200k" if bench.quick else "5M"
        command = [bench.holodeck, "fill", plain, EMPTY_SECTION, "--obstructions", obstructions,
                   "--bounces", "0", "--samples", samples, "--quiet", "-o", file]  # fmt: skip

        def make() -> float:
            file.unlink(missing_ok=True)
            seconds = run(command).processor
            run([bench.holodeck, "picture", file, *EMPTY_VIEW, "-o", picture])
            return seconds

        return Variant(picture, picture, make)

    sky = ("--sky", "0.5,0.5,0.5")
    faint_sky = render("sky", plain, "--sky", "1e-6,1e-6,1e-6", seed=4)
    return [
        Skip(
            "glass: what paths are inside of", render("no-glass", plain), render("glass", glass),
            None
        ),
        Skip(
            "textures, bumps and smooth normals", render("plain", plain), render("shaded", shaded),
            None
        ),
        Skip("sky: samples of it", render("no-sky", plain), faint_sky, truth("box", plain)),
        Skip(
            "lamps: the light tree", render("dark", dark, *sky),
            render("faint", faint, *sky, seed=4), truth("dark-box", dark, *sky)
        ),
        Skip("obstructions: from entry to exit wall", fill("off"), fill("on"), None),
    ]


def scenes(bench: Bench) -> tuple[Path, Path, Path, Path, Path]:
    """Returns the bundled Cornell box and its variants.

    They have unseen glass, no lamp, almost no lamp, and an unseen textured and smooth surface.
    """
    plain = bench.scenes.bundle() / "cornell.obj"
    text = plain.read_text(encoding="utf-8")
    materials = plain.with_suffix(".mtl").read_text(encoding="utf-8")
    found = [plain]
    (bench.work / "unseen.png").write_bytes(png(SHADED_TEXEL))
    for name, faces, library in (
        ("glass", GLASS, materials + GLASS_MATERIAL),
        ("dark", "", materials.replace("Ke 17 12 4", "Ke 0 0 0")),
        ("faint", "", materials.replace("Ke 17 12 4", "Ke 1e-6 1e-6 1e-6")),
        ("shaded", SHADED, materials + SHADED_MATERIAL),
    ):
        obj = bench.work / f"ablation-{name}.obj"
        obj.write_text(
            text.replace("mtllib cornell.mtl", f"mtllib {obj.stem}.mtl") + faces, encoding="utf-8"
        )
        obj.with_suffix(".mtl").write_text(library, encoding="utf-8")
        found.append(obj)
    return found[0], found[1], found[2], found[3], found[4]


def png(texel: tuple[int, int, int]) -> bytes:
    """Returns a picture of one texel."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0))
    return (
        b"\x89PNG\r\n\x1a\n"
        + header
        + chunk(b"IDAT", zlib.compress(bytes([0, *texel])))
        + chunk(b"IEND", b"")
    )
