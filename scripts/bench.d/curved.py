"""Curved meshes in the Cornell box: is their light as clean as that of flat walls?

Invariants: only pixels that see the mesh alone, or no mesh, count. The truth's own noise is
measured by its two halves, and subtracted from the error.
"""

from __future__ import annotations

import math
import random
from array import array
from dataclasses import replace
from pathlib import Path

from document import Bar, Part, Table
from edges import read
from harness import Bench
from program import run
from scenes import Case

Point = tuple[float, float, float]
Mesh = tuple[list[Point], list[Point], list[tuple[int, int, int]]]

# Numbers of samples in the file, ascending: the same file is filled further.
SAMPLES = (100_000, 1_000_000, 10_000_000)
# Paths of a pixel of each half of the truth.
TRUTH_PATHS = 128
# Paths of a pixel of the picture without a filter.
PLAIN_PATHS = 16
# Largest allowed ratio of the error on a mesh to that on the walls.
WANTED = 1.5
# The share of pixels with the largest errors that does not count: edges within the mesh.
WORST = 0.01
# In the lamp's light, above the blocks.
MIDDLE: Point = (1.35, 3.0, 3.9)
SIDE = 224
# The lamp that a mesh becomes to find its pixels. Everything else is black then.
LAMP = 1000.0
WEIGHTS = (0.2126, 0.7152, 0.0722)


def curved(bench: Bench) -> Part:
    """Error on curved meshes over that on flat walls, by number of samples."""
    part = Part(
        "Curved meshes beside flat walls",
        [
            (
                "A mesh of about 100,000 triangles in the Cornell box, filled with `--samples`, on"
                " and on; `picture` by the driver `surfaces` against `render --engine path` with"
                f" {2 * bench.paths(TRUTH_PATHS)} paths a pixel. Errors are root mean squares of"
                f" relative differences of luminance, without the worst {WORST:.0%} of the pixels."
                f" *Smooth*: the mesh has normals. *Paths*: the same ratio in a picture by `render"
                f" --engine path` of {PLAIN_PATHS} paths a pixel, which no filter has changed."
            ),
        ],
    )
    columns = [["mesh", ""], ["normals", ""]]
    counts = SAMPLES[: -1 if bench.quick else None]
    for count in counts:
        columns += [[f"mesh, {count:,}", ".1%"], ["walls", ".1%"], ["ratio", ".2f"]]
    columns.append(["paths", ".2f"])
    table = Table("", columns)
    worst = dict.fromkeys(counts, 0.0)
    for name, make in (("sphere", sphere), ("knot", knot), ("cloth", cloth), ("plant", plant)):
        for smooth in (False, True):
            row: list = [name, "smooth" if smooth else "flat"]
            of_counts, paths = errors(bench, f"{name}-{row[1]}", make(), smooth, counts)
            for count, mesh, walls in of_counts:
                row += [mesh, walls, mesh / walls]
                worst[count] = max(worst[count], mesh / walls)
            table.rows.append([*row, paths])
    part.tables.append(table)
    for count, ratio in worst.items():
        part.bars.append(
            Bar(
                f"error on the worst mesh over the walls', {count:,} samples", f"{ratio:.2f}",
                f"≤ {WANTED:g}", ratio <= WANTED
            )
        )
    return part


def errors(
    bench: Bench, name: str, mesh: Mesh, smooth: bool, counts: tuple[int, ...]
) -> tuple[list[tuple[int, float, float]], float]:
    """Returns, by number of samples, the errors of the mesh's pixels and of the walls', and the
    ratio of both without a filter.
    """
    box = bench.scenes.cornell()
    case = write(bench, box, name, mesh, smooth, lamp=False)
    lamp = write(bench, box, f"{name}-lamp", mesh, smooth=False, lamp=True)
    found, _ = bench.render(lamp, "mask", "--bounces", "0", "--spp", "16", "--sky", "0,0,0")
    shares = [min(value / LAMP, 1.0) for value in luminances(found)]
    masks = [
        [n for n, share in enumerate(shares) if share > 0.99],
        [n for n, share in enumerate(shares) if share < 0.01],
    ]
    halves = []
    for seed in ("1", "2"):
        half, _ = bench.render(
            case, f"half-{seed}", "--engine", "path", "--spp", str(bench.paths(TRUTH_PATHS)),
            "--seed", seed
        )
        halves.append(luminances(half))
    plain, _ = bench.render(
        case, "plain", "--engine", "path", "--spp", str(PLAIN_PATHS), "--seed", "3"
    )
    of_mesh, of_walls = (error(luminances(plain), *halves, mask) for mask in masks)
    file = bench.work / f"curved-{name}.holo"
    there, result = 0, []
    for count in counts:
        run(
            [
                bench.holodeck, "fill", *case.scene, "-o", file, "--quiet", "--json", "--samples",
                str(count - there)
            ]
        )
        there = count
        options = [*case.view.options(), "--driver", "surfaces"]
        picture, _, _ = bench.picture(file, options, case.size, f"curved-{name}-{count}")
        shown = luminances(picture)
        result.append((count, *(error(shown, *halves, mask) for mask in masks)))
    file.unlink()
    return result, of_mesh / of_walls


def error(shown: list[float], one: list[float], other: list[float], pixels: list[int]) -> float:
    """Returns the relative error of these pixels."""
    squares = []
    for n in pixels:
        truth = (one[n] + other[n]) / 2
        noise = (one[n] - other[n]) ** 2 / 4
        squares.append(((shown[n] - truth) ** 2 - noise) / max(truth, 1e-3) ** 2)
    squares.sort()
    kept = squares[: max(int(len(squares) * (1 - WORST)), 1)]
    return math.sqrt(max(sum(kept) / len(kept), 1e-12))


def luminances(picture: Path) -> list[float]:
    _, _, values = read(picture)
    return luminance(values)


def luminance(values: array) -> list[float]:
    red, green, blue = (values[channel::3] for channel in range(3))
    return [WEIGHTS[0] * r + WEIGHTS[1] * g + WEIGHTS[2] * b for r, g, b in zip(red, green, blue)]


def write(bench: Bench, box: Case, name: str, mesh: Mesh, smooth: bool, lamp: bool) -> Case:
    """Writes the box with a mesh in it, and returns its case."""
    folder = bench.work / "curved"
    folder.mkdir(exist_ok=True)
    source = Path(box.scene[0])
    materials = source.with_suffix(".mtl").read_text(encoding="utf-8")
    surface = "Kd 0.6 0.5 0.35"
    if lamp:
        names = [line for line in materials.splitlines() if line.startswith("newmtl")]
        materials = "".join(f"{name}\nKd 0 0 0\n" for name in names)
        surface = f"Kd 0 0 0\nKe {LAMP} {LAMP} {LAMP}"
    (folder / f"{name}.mtl").write_text(
        f"{materials}\nnewmtl mesh\n{surface}\n", encoding="utf-8"
    )
    kept = [
        line
        for line in source.read_text(encoding="utf-8").splitlines()
        if not line.startswith("mtllib")
    ]
    points, normals, triangles = mesh
    first = sum(line.startswith("v ") for line in kept)
    lines = [f"mtllib {name}.mtl", *kept, "usemtl mesh"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    if smooth:
        lines += [f"vn {x:.5f} {y:.5f} {z:.5f}" for x, y, z in normals]
    at = (lambda n: f"{first + n + 1}//{n + 1}") if smooth else (lambda n: str(first + n + 1))
    lines += ["f " + " ".join(at(corner) for corner in triangle) for triangle in triangles]
    path = folder / f"{name}.obj"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return replace(
        box, name=f"curved-{name}", scene=(str(path), *box.scene[1:]), reference=None,
        size="256x256"
    )


def grid(at, columns: int, rows: int) -> Mesh:
    """Returns a surface of two parameters between 0 and 1. `at` returns a point."""
    points, normals, triangles = [], [], []
    small = 1e-4
    for row in range(rows + 1):
        for column in range(columns + 1):
            u, v = column / columns, row / rows
            points.append(at(u, v))
            normals.append(
                unit(
                    cross(
                        difference(at(u + small, v), at(u - small, v)),
                        difference(at(u, v + small), at(u, v - small)),
                    )
                )
            )
    for row in range(rows):
        for column in range(columns):
            corner = row * (columns + 1) + column
            below = corner + columns + 1
            triangles += [(corner, corner + 1, below + 1), (corner, below + 1, below)]
    return points, normals, triangles


def sphere() -> Mesh:
    def at(u: float, v: float) -> Point:
        turn, height = 2 * math.pi * u, math.pi * (0.001 + 0.998 * v)
        ring = math.sin(height)
        return moved((ring * math.cos(turn), -math.cos(height), -ring * math.sin(turn)))

    return grid(at, SIDE, SIDE)


def knot() -> Mesh:
    def middle(t: float) -> Point:
        ring = 0.75 + 0.3 * math.cos(3 * t)
        return (ring * math.cos(2 * t), ring * math.sin(2 * t), 0.35 * math.sin(3 * t))

    def at(u: float, v: float) -> Point:
        t, turn = 2 * math.pi * u, 2 * math.pi * v
        along = unit(difference(middle(t + 1e-3), middle(t - 1e-3)))
        side = unit(cross(along, (0.0, 0.0, 1.0)))
        up = cross(side, along)
        return moved(
            tuple(
                m + 0.2 * (math.cos(turn) * s + math.sin(turn) * w)
                for m, s, w in zip(middle(t), side, up)
            )
        )

    return grid(at, 1000, 50)


def cloth() -> Mesh:
    def at(u: float, v: float) -> Point:
        x, y = 2.2 * u - 1.1, 1.1 - 2.2 * v
        fold = 0.12 * math.sin(9 * x + 0.8 * math.sin(2 * y)) * (0.3 + v) + 0.05 * math.sin(
            4 * y + x
        )
        return moved((x, y, fold))

    return grid(at, SIDE, SIDE)


def plant() -> Mesh:
    """Thin curved leaves, of 50 triangles each, around a point."""
    numbers = random.Random(7)
    points: list[Point] = []
    normals: list[Point] = []
    triangles: list[tuple[int, int, int]] = []
    for _ in range(2000):
        out = unit(tuple(numbers.gauss(0, 1) for _ in range(3)))
        side = unit(cross(out, (0.3, 1.0, 0.2)))
        up = cross(side, out)
        base = tuple(c * numbers.uniform(0.2, 0.8) for c in out)

        def at(u: float, v: float, base=base, out=out, side=side, up=up) -> Point:
            wide = 0.07 * math.sin(math.pi * min(max(0.02 + 0.96 * v, 0), 1)) * (2 * u - 1)
            bend = -0.12 * v * v
            return moved(
                tuple(
                    b + 0.35 * v * o + wide * s + bend * w
                    for b, o, s, w in zip(base, out, side, up)
                )
            )

        more = grid(at, 5, 5)
        first = len(points)
        points += more[0]
        normals += more[1]
        triangles += [tuple(first + corner for corner in triangle) for triangle in more[2]]
    return points, normals, triangles


def moved(point) -> Point:
    x, y, z = (at + by for at, by in zip(point, MIDDLE))
    return (x, y, z)


def difference(a: Point, b: Point) -> Point:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def cross(a: Point, b: Point) -> Point:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a) -> Point:
    length = math.sqrt(sum(c * c for c in a)) or 1.0
    return (a[0] / length, a[1] / length, a[2] / length)
