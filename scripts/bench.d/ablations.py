"""What it gains to leave out what a scene lacks: the same picture of a scene without it, and with a trace of it that nobody sees."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Callable

from document import Bar, Part, Table
from harness import Bench
from program import compare, run

VIEW = ("--vp=2.78,2.73,-2", "--vd=0,0,1", "--vu=0,1,0", "--vh=60", "--size=256x256")
# Within the short block, which has no openings.
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

# Above the blocks and below the lamp, where nothing stands.
EMPTY_SECTION = "--section=0.5,3.5,0.5 4.5,0,0 0,1.7,0 0,0,4.6 3,2,3"
EMPTY_VIEW = ("--vp=2.7,4.3,2.8", "--vd=-1,0,0", "--vu=0,1,0", "--vh=40", "--size=128x128")


@dataclass
class Variant:
    """One way to make a picture: `make` writes the picture, and gives seconds of processor time."""

    picture: Path
    error: Path | None
    make: Callable[[], float]


def ablations(bench: Bench) -> Part:
    """Skips one by one: processor time with and without, and that the result is the same."""
    rounds, paths = (1, 16) if bench.quick else (3, 128)
    part = Part(
        "What skipping gains",
        [
            f"Processor time of the whole program, the least of {rounds} alternate runs. *Skipped*: the scene lacks it, and nothing is "
            "done about it. *Not skipped*: there is a trace of it that no ray meets, or so little of it that it cannot be seen (a "
            "piece of glass within a block; a sky or a lamp of 1e-6 of the light), or, for obstructions, it is asked for. "
            f"`render --spp {paths}` of the bundled Cornell box at 256², `fill` with a section in which nothing stands. The "
            "results differ by *bias*, with its 99 % interval; random numbers differ where there is something to sample. (Beams "
            "that see nothing: above.)",
        ],
    )  # fmt: skip
    columns = [["skipped", ""], ["skipped, s", ".2f"], ["not skipped, s", ".2f"], ["ratio", ".3f"], ["bias", "+.3%"],
               ["± (99 %)", ".3%"]]  # fmt: skip
    table = Table("", columns)
    for title, with_skip, without in variants(bench, paths):
        times = [(with_skip.make(), without.make()) for _ in range(rounds)]
        skipped, done = min(t[0] for t in times), min(t[1] for t in times)
        options: list[str | Path] = []
        if with_skip.error and without.error:
            options = ["--se", with_skip.error, "--reference-se", without.error]
        measures = compare(bench.holodeck, with_skip.picture, without.picture, *options)
        bias, half = measures["bias"], measures.get("bias_99")
        table.rows.append([title, skipped, done, skipped / done, bias, half])
        # The same rays, begun elsewhere: rounding alone, and samples whose colour it rounds the other way.
        bound = half if half is not None else 0.001
        part.bars.append(Bar(f"same result, {title}", f"{bias:+.3%}", f"within ±{bound:.3%}", abs(bias) <= bound))
    part.tables.append(table)
    return part


def variants(bench: Bench, paths: int) -> list[tuple[str, Variant, Variant]]:
    """By what is skipped: the way with the skip, and that without."""
    plain, glass, dark, faint = scenes(bench)

    def render(name: str, obj: Path, *options: str) -> Variant:
        picture, error = bench.work / f"ablation-{name}.pfm", bench.work / f"ablation-{name}-se.pfm"
        command = [bench.holodeck, "render", obj, *VIEW, "--spp", str(paths), *options]
        # Another seed, so that the two are independent.
        seed = "7" if name.startswith("with-") else "3"
        whole = [*command, "--seed", seed, "--se", error, "--quiet", "-o", picture]
        return Variant(picture, error, lambda: run(whole).processor)

    def fill(obstructions: str) -> Variant:
        picture, file = bench.work / f"ablation-{obstructions}.pfm", bench.work / f"ablation-{obstructions}.holo"
        samples = "200k" if bench.quick else "5M"
        command = [bench.holodeck, "fill", plain, EMPTY_SECTION, "--obstructions", obstructions, "--bounces", "0",
                   "--samples", samples, "--quiet", "-o", file]  # fmt: skip

        def make() -> float:
            file.unlink(missing_ok=True)
            seconds = run(command).processor
            run([bench.holodeck, "picture", file, *EMPTY_VIEW, "-o", picture])
            return seconds

        return Variant(picture, None, make)

    sky = ("--sky", "0.5,0.5,0.5")
    return [
        ("glass: what paths are inside of", render("no-glass", plain), render("with-glass", glass)),
        ("sky: samples of it", render("no-sky", plain), render("with-sky", plain, "--sky", "1e-6,1e-6,1e-6")),
        ("lamps: the light tree", render("no-lamps", dark, *sky), render("with-lamps", faint, *sky)),
        ("obstructions: from entry to exit wall", fill("off"), fill("on")),
    ]


def scenes(bench: Bench) -> tuple[Path, Path, Path, Path]:
    """The bundled Cornell box; with unseen glass; without its lamp; with next to none of it."""
    plain = bench.scenes.bundle() / "cornell.obj"
    text, materials = plain.read_text(encoding="utf-8"), plain.with_suffix(".mtl").read_text(encoding="utf-8")
    found = [plain]
    for name, faces, library in (
        ("glass", GLASS, materials + GLASS_MATERIAL),
        ("dark", "", materials.replace("Ke 17 12 4", "Ke 0 0 0")),
        ("faint", "", materials.replace("Ke 17 12 4", "Ke 1e-6 1e-6 1e-6")),
    ):
        obj = bench.work / f"ablation-{name}.obj"
        obj.write_text(text.replace("mtllib cornell.mtl", f"mtllib {obj.stem}.mtl") + faces, encoding="utf-8")
        obj.with_suffix(".mtl").write_text(library, encoding="utf-8")
        found.append(obj)
    return found[0], found[1], found[2], found[3]
