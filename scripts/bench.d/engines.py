"""Fills by the default engine beside fills by `path`, given the same seconds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from document import Bar, Part, Table
from harness import Bench
from program import compare
from rooms import TRUTH_SIZE, Pixels, mean, named_views, read, truth
from scenes import Case

SECONDS = (10, 60)
ENGINES = ("path", "gather")
# Largest allowed ratio of the default engine's error to that of `path`.
BAR = 1.05
# Share of a picture's pixels that do not count: the worst ones.
WORST = 0.001


def engines(bench: Bench) -> Part:
    """Fills by the default engine beside fills by `path`, given the same seconds."""
    part = Part(
        "Filling by the default engine, beside `path`",
        [
            (
                "`fill --time` of an empty file, with the default engine (`gather`) and with"
                " `--engine path`; then `picture` of each view without a denoiser. relMSE is the"
                " mean over a scene's views. The interior's truth is our own, of 256 paths a pixel;"
                " its noise is in both figures."
            ),
        ],
    )
    columns = [["scene", ""], ["seconds", "d"]]
    for engine in ENGINES:
        columns += [[f"{engine}, samples", ",d"], [f"{engine}, relMSE", ".5f"]]
    table = Table("Error of pictures after the same seconds", [*columns, ["ratio", ".2f"]])
    for title, scene, looks in scenes(bench):
        for seconds in SECONDS:
            row: list = [title, seconds]
            errors = []
            for engine in ENGINES:
                case = replace(looks[0], scene=scene)
                file, said = bench.fill(
                    f"{case.name}-{engine}-{seconds}", case, seconds, "--engine", engine
                )
                errors.append(sum(error(bench, look, file, engine) for look in looks) / len(looks))
                row += [said["added"], errors[-1]]
            ratio = errors[1] / errors[0]
            table.rows.append([*row, ratio])
            part.bars.append(
                Bar(
                    f"relMSE of the default engine, {title}, {seconds} s", f"{ratio:.2f} × path's",
                    f"≤ {BAR:g} ×", ratio <= BAR
                )
            )
    part.tables.append(table)
    return part


def scenes(bench: Bench) -> list[tuple[str, tuple[str, ...], list[Case]]]:
    """Returns, for each scene, its title, its options and the views that are compared."""
    found = {}
    for case in bench.scenes.referenced():
        found.setdefault(case.scene, []).append(case)
    all = [(looks[0].title.split(",")[0], scene, looks) for scene, looks in found.items()]
    interior = bench.scenes.interior()
    views = named_views(Path(interior.scene[1]))
    looks = [
        replace(interior, name=f"interior-{name}", title=name, view=view, size=TRUTH_SIZE)
        for name, view in views.items()
    ]
    return [*all, (interior.title, interior.scene[:2], looks)]


def error(bench: Bench, look: Case, file: Path, engine: str) -> float:
    """Returns the relMSE of a view's picture."""
    options = [*look.view.options(), "--denoise", "off"]
    picture, _, _ = bench.picture(file, options, look.size, f"{look.name}-{engine}-filled")
    if look.reference:
        return compare(bench.holodeck, picture, look.reference.picture)["relmse_trim"]
    return relative(read(picture), mean(truth(bench, look)))


def relative(picture: Pixels, truth: Pixels) -> float:
    """Returns a picture's relMSE, as `holodeck compare` has it."""
    level = sum(map(sum, truth)) / (3 * len(truth))
    squares = (
        sum((a - b) ** 2 / (b * b + 0.01 * level * level) for a, b in zip(one, other)) / 3
        for one, other in zip(picture, truth)
    )
    kept = sorted(squares)[: round(len(truth) * (1 - WORST))]
    return sum(kept) / len(kept)
