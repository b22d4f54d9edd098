"""The measured cases: scenes, views, and their reference pictures.

The scenes in ../shared come with converged pictures of an independent path tracer. Without them
the bundled scenes are used and compared with long renders of this program. That measures noise,
but not the correctness of the tracer.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from program import Cargo, run


@dataclass(frozen=True)
class View:
    """A perspective view, with Radiance's names. Vectors are `x,y,z`, angles are in degrees."""

    vp: str
    vd: str
    vu: str
    vh: float
    # Follows from `vh` and the picture's shape if not given.
    vv: float | None = None

    def options(self) -> list[str]:
        """Returns the view as command-line options."""
        return [f"--{name}={value}" for name, value in self._given()]

    def line(self) -> str:
        """Returns the view for a script's `view` command."""
        return " ".join(f"-{name} {str(value).replace(',', ' ')}" for name, value in self._given())

    def any_shape(self) -> "View":
        """Returns the same view with a vertical angle that follows from the picture's shape."""
        return View(self.vp, self.vd, self.vu, self.vh)

    def _given(self) -> list[tuple[str, object]]:
        named = [
            ("vp", self.vp), ("vd", self.vd), ("vu", self.vu), ("vh", self.vh), ("vv", self.vv)
        ]
        return [(name, value) for name, value in named if value is not None]


@dataclass(frozen=True)
class Reference:
    """A converged picture, and the standard errors of its pixels."""

    picture: Path
    standard_error: Path


@dataclass(frozen=True)
class Case:
    """A scene with its sections, and one view of it."""

    name: str
    title: str
    # Arguments that name scene and sections, for `render`, `fill` and `view`.
    scene: tuple[str, ...]
    view: View
    # The view before the visitor moves to `view`.
    before: View
    size: str
    reference: Reference | None


CORNELL_SECTION = "--section=0.6,0.6,-4 4.3,0,0 0,4.2,0 0,0,5 8,8,8"
CORNELL_VIEW = View("2.78,2.73,-2", "0,0,1", "0,1,0", 60, 60)
# From beside the box, at an angle: the same walls through other beams.
CORNELL_BEFORE = View("1.2,3.6,-3", "0.3,-0.2,1", "0,1,0", 60, 60)

# The paper's own sections of its cabin: living room, bedroom, bathroom; in feet.
CABIN_SECTIONS = (
    "--section=14,1,3 10,0,0 0,14,0 0,0,4",
    "--section=1,1,3 8,0,0 0,8,0 0,0,4",
    "--section=0.5,14.25,3 7,0,0 0,2,0 0,0,3",
)
CABIN_LIVING = View("12.5,0.5,5", "0.707107,0.707107,0", "0,0,1", 60, 46.826)
CABIN_BEDROOM = View("9,9,5", "-0.8,-0.6,-0.1", "0,0,1", 60, 46.826)
# In the order of a visit.
CABIN_VIEWS = {
    "living": CABIN_LIVING,
    "living2": View("15,9,5", "0.986588,0.0507496,-0.155139", "0,0,1", 60, 46.826),
    "bedroom": CABIN_BEDROOM,
    "bath": View("8,14.5,5", "-0.894427,0.447214,0", "0,0,1", 60, 46.826),
    "coatrack": View("22,12,5", "0.563075,0.755671,-0.334526", "0,0,1", 40, 30.53),
}

INTERIOR_LIVING = View("0.8,0.75,1.55", "0.76,0.62,-0.07", "0,0,1", 60, 46.826)
INTERIOR_BEDROOM = View("3.9,7.3,1.55", "-0.76,0.6,-0.2", "0,0,1", 60, 46.826)

# Along the corridor to its bend. Neither the lamp nor the door is visible from there.
CORRIDOR_VIEW = View("2.2,0.8,1.55", "1,0.05,-0.1", "0,0,1", 60, 46.826)
CORRIDOR_BEFORE = View("7.1,0.6,1.55", "0,1,-0.05", "0,0,1", 60, 46.826)


class Scenes:
    """The cases, from ../shared if that exists."""

    def __init__(self, cargo: Cargo, shared: Path, folder: Path) -> None:
        self._cargo = cargo
        self._shared = shared
        self._bundled = folder / "bundled"

    def cornell(self) -> Case:
        obj = self._shared / "scenes/cornell/cornell.obj"
        title = "Cornell box"
        if not obj.exists():
            obj, title = self.bundle() / "cornell.obj", "bundled Cornell box"
        reference = self.reference("cornell")
        scene = (str(obj), CORNELL_SECTION)
        return Case("cornell", title, scene, CORNELL_VIEW, CORNELL_BEFORE, "256x256", reference)

    def room(self) -> Case:
        """Returns the cabin's living room, or that of the bundled interior."""
        obj = self._shared / "scenes/cabin/cabin.obj"
        if obj.exists():
            scene = (str(obj), *CABIN_SECTIONS)
            reference = self.reference("cabin")
            return Case(
                "cabin", "cabin, living room", scene, CABIN_LIVING, CABIN_BEDROOM, "320x240",
                reference
            )
        scene = ("--config", str(self.bundle() / "interior.toml"))
        title = "bundled interior, living room"
        return Case("interior", title, scene, INTERIOR_LIVING, INTERIOR_BEDROOM, "320x240", None)

    def interior(self) -> Case:
        """Returns the bundled interior, as `holodeck` alone shows it."""
        scene = ("--config", str(self.bundle() / "interior.toml"))
        title = "bundled interior"
        return Case("interior", title, scene, INTERIOR_LIVING, INTERIOR_BEDROOM, "320x240", None)

    def corridor(self) -> Case:
        """Returns the bundled corridor, lit only indirectly. It is small, because its converged
        picture must be rendered first.
        """
        scene = (str(self.bundle() / "corridor.obj"),)
        return Case(
            "corridor", "bundled corridor", scene, CORRIDOR_VIEW, CORRIDOR_BEFORE, "80x60", None
        )

    def referenced(self) -> list[Case]:
        """Returns all cases that have an independent reference."""
        cases = [self.cornell(), self.room()]
        bedroom = self.reference("cabin_bed")
        if cases[1].name == "cabin" and bedroom:
            scene = cases[1].scene
            cases.append(
                Case(
                    "cabin_bed", "cabin, bedroom", scene, CABIN_BEDROOM, CABIN_LIVING, "320x240",
                    bedroom
                )
            )
        return [case for case in cases if case.reference]

    def reference(self, name: str) -> Reference | None:
        """Returns the independent picture of this name, if it exists."""
        folder = self._shared / "reference"
        reference = Reference(folder / f"{name}.pfm", folder / f"{name}_se.pfm")
        return (
            reference if reference.picture.exists() and reference.standard_error.exists() else None
        )

    def bundle(self) -> Path:
        """Returns the folder of the bundled scenes, which are made on first use."""
        if not self._bundled.exists():
            run([self._cargo.build("holo-scenes"), "all", "--out", self._bundled])
        return self._bundled
