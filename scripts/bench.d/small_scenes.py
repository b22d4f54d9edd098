"""Small scenes for the comparison with other path tracers: Cornell boxes with a block of glass,
mirror or rough metal, and an office.

Invariants: a scene has the same bytes each time. Glass is closed, and touches nothing.
"""

from __future__ import annotations

import math
from pathlib import Path

from scenes import CORNELL_BEFORE, CORNELL_VIEW, Case, View

# Materials of a block, as MTL text.
BLOCKS = {
    "glass": "illum 7\nNi 1.5\nTf 1 1 1\n",
    "mirror": "illum 3\nKs 0.9 0.9 0.9\nNs 1000\n",
    "metal": "illum 3\nKs 0.85 0.75 0.6\nNs 60\n",
}
# Corners of the tall block's top and their height, in units of 100 mm.
BLOCK_CORNERS = ((4.23, 2.47), (2.65, 2.96), (3.14, 4.56), (4.72, 4.06))
BLOCK_TOP, BLOCK_BOTTOM = 3.3, 0.05

OFFICE_VIEW = View("0.6,0.6,1.6", "0.8,0.55,-0.16", "0,0,1", 70)
OFFICE_MTL = {
    "wall": "Kd 0.72 0.7 0.66\nillum 1\n",
    "carpet": "Kd 0.18 0.2 0.24\nillum 1\n",
    "wood": "Kd 0.45 0.3 0.18\nillum 1\n",
    "plastic": "Kd 0.08 0.08 0.09\nillum 1\n",
    "cloth": "Kd 0.15 0.25 0.45\nillum 1\n",
    "steel": "illum 3\nKs 0.75 0.75 0.75\nNs 80\n",
    "chrome": "illum 3\nKs 0.9 0.9 0.9\nNs 1000\n",
    "pane": "illum 4\nNi 1.5\nTf 0.95 0.97 0.96\n",
    "lamp": "Kd 0 0 0\nKe 14 13 12\nillum 1\n",
}


def small_scenes(folder: Path, bundle: Path) -> list[Case]:
    """Writes the scenes to `folder`, returns their cases. `bundle` holds the bundled scenes."""
    folder.mkdir(parents=True, exist_ok=True)
    cases = []
    for block, material in BLOCKS.items():
        obj = folder / f"cornell-{block}.obj"
        obj.write_text(with_block(bundle / "cornell.obj", obj.stem), encoding="utf-8")
        library = (bundle / "cornell.mtl").read_text(encoding="utf-8")
        obj.with_suffix(".mtl").write_text(f"{library}\nnewmtl block\n{material}", encoding="utf-8")
        title = f"Cornell box, {block} block"
        cases.append(
            Case(obj.stem, title, (str(obj),), CORNELL_VIEW, CORNELL_BEFORE, "256x256", None)
        )
    office = Mesh()
    furnish(office)
    obj = folder / "office.obj"
    office.write(obj, OFFICE_MTL)
    title = f"office, {office.triangles:,} triangles"
    cases.append(Case("office", title, (str(obj),), OFFICE_VIEW, OFFICE_VIEW, "256x192", None))
    return cases


def with_block(cornell: Path, name: str) -> str:
    """Returns the bundled Cornell box with another material on its tall block.

    The block is closed and raised a little.
    """
    lines = cornell.read_text(encoding="utf-8").splitlines()
    # The tall block is last: five quads, each of four vertices, a material and a face.
    kept = [line.replace("cornell.mtl", f"{name}.mtl") for line in lines[:-30]]
    corners = sum(line.startswith("v ") for line in kept)
    heights = (BLOCK_BOTTOM, BLOCK_TOP)
    vertices = [f"v {x} {y} {z}" for y in heights for x, z in BLOCK_CORNERS]
    sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    faces = [*sides, (4, 5, 6, 7), (3, 2, 1, 0)]
    text = [f"f {' '.join(str(corners + 1 + corner) for corner in face)}" for face in faces]
    return "\n".join([*kept, *vertices, "usemtl block", *text, ""])


class Mesh:
    """Polygons by material, +Z up; faces run counter-clockwise as seen from outside."""

    def __init__(self) -> None:
        self._vertices: list[tuple[float, float, float]] = []
        self._faces: dict[str, list[list[int]]] = {}
        self.triangles = 0

    def face(self, material: str, corners: list[tuple[float, float, float]]) -> None:
        first = len(self._vertices) + 1
        self._vertices += corners
        self._faces.setdefault(material, []).append(list(range(first, first + len(corners))))
        self.triangles += len(corners) - 2

    def box(
        self, material: str, low: tuple[float, float, float], high: tuple[float, float, float]
    ) -> None:
        (a, b, c), (x, y, z) = low, high
        self.face(material, [(a, b, z), (x, b, z), (x, y, z), (a, y, z)])
        self.face(material, [(a, y, c), (x, y, c), (x, b, c), (a, b, c)])
        ring = [(a, b), (x, b), (x, y), (a, y)]
        for (p, q), (r, s) in zip(ring, ring[1:] + ring[:1]):
            self.face(material, [(p, q, c), (r, s, c), (r, s, z), (p, q, z)])

    def turned(
        self, material: str, at: tuple[float, float], profile: list[tuple[float, float]], sides: int
    ) -> None:
        """Adds a surface of revolution around a vertical axis.

        `profile` has radii and heights, from below.
        """
        ring = [
            (math.cos(2 * math.pi * i / sides), math.sin(2 * math.pi * i / sides))
            for i in range(sides + 1)
        ]
        for (r, low), (s, high) in zip(profile, profile[1:]):
            for (c, d), (e, f) in zip(ring, ring[1:]):
                corners = [
                    (r * c, r * d, low), (r * e, r * f, low), (s * e, s * f, high),
                    (s * c, s * d, high)
                ]
                corners = [(at[0] + x, at[1] + y, z) for x, y, z in corners]
                if r == 0:
                    del corners[1]
                if s == 0:
                    del corners[-1]
                self.face(material, corners)

    def write(self, obj: Path, materials: dict[str, str]) -> None:
        """Writes OBJ and MTL files."""
        lines = [
            f"mtllib {obj.stem}.mtl",
            *(f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in self._vertices),
        ]
        for material, faces in self._faces.items():
            lines += [f"usemtl {material}", *(f"f {' '.join(map(str, face))}" for face in faces)]
        obj.write_text("\n".join([*lines, ""]), encoding="utf-8")
        text = "\n".join(f"newmtl {name}\n{material}" for name, material in materials.items())
        obj.with_suffix(".mtl").write_text(text, encoding="utf-8")


def furnish(mesh: Mesh) -> None:
    """Fills a room of 12 × 8 × 2.8 m with 24 desks under 24 lamps, and a glazed partition."""
    length, width, height = 12.0, 8.0, 2.8
    mesh.box("carpet", (0, 0, -0.1), (length, width, 0))
    mesh.box("wall", (0, 0, height), (length, width, height + 0.1))
    mesh.box("wall", (-0.1, 0, 0), (0, width, height))
    mesh.box("wall", (length, 0, 0), (length + 0.1, width, height))
    mesh.box("wall", (0, -0.1, 0), (length, 0, height))
    mesh.box("wall", (0, width, 0), (length, width + 0.1, height))
    mesh.face("pane", [(8, 0.5, 0.3), (8, 7.5, 0.3), (8, 7.5, 2.5), (8, 0.5, 2.5)])
    for i in range(6):
        for j in range(4):
            x, y = 0.7 + 1.9 * i, 0.8 + 1.85 * j
            z = height - 0.01
            mesh.face("lamp", [(x, y, z), (x, y + 0.3, z), (x + 1.2, y + 0.3, z), (x + 1.2, y, z)])
            desk(mesh, x, y)


def desk(mesh: Mesh, x: float, y: float) -> None:
    """Adds a desk with a screen, a cup, a bowl, a lamp and a chair: 1,920 triangles."""
    mesh.box("wood", (x, y, 0.7), (x + 1.3, y + 0.7, 0.74))
    for dx, dy in ((0.05, 0.05), (1.25, 0.05), (0.05, 0.65), (1.25, 0.65)):
        mesh.turned("steel", (x + dx, y + dy), [(0.02, 0.0), (0.02, 0.7)], 24)
    mesh.box("plastic", (x + 0.4, y + 0.5, 0.85), (x + 0.95, y + 0.53, 1.2))
    mesh.box("plastic", (x + 0.64, y + 0.5, 0.74), (x + 0.7, y + 0.53, 0.85))
    mesh.turned(
        "wall", (x + 0.2, y + 0.3),
        [(0, 0.745), (0.04, 0.745), (0.04, 0.84), (0.035, 0.84), (0.035, 0.75), (0, 0.75)], 32
    )
    bowl = [
        (0.1 * math.sin(0.2 + 0.14 * k), 0.86 - 0.1 * math.cos(0.2 + 0.14 * k)) for k in range(10)
    ]
    mesh.turned("chrome", (x + 1.1, y + 0.25), bowl, 28)
    seat = [
        (0.24 * math.sin(math.pi * k / 9), 0.45 - 0.05 * math.cos(math.pi * k / 9))
        for k in range(10)
    ]
    seat[0], seat[-1] = (0.0, seat[0][1]), (0.0, seat[-1][1])
    mesh.turned("cloth", (x + 0.65, y - 0.15), seat, 32)
    mesh.turned("steel", (x + 0.65, y - 0.15), [(0.03, 0.05), (0.03, 0.4)], 24)
    foot = [(0.0, 0.0), (0.25, 0.0), (0.25, 0.03), (0.0, 0.05)]
    mesh.turned("plastic", (x + 0.65, y - 0.15), foot, 24)
