"""Shared by all measurements: the programs, the scenes, and existing files.

Invariant: a file or session is made once per run, by the first measurement that needs it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from converged import Converged
from document import Document, Part
from program import Cargo, Failed, Session, run, session
from scenes import Case, Reference, Scenes

# Seconds between the request of a view and its picture.
PICTURES_AT = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
QUICK_PICTURES_AT = (0.1, 0.5, 2.0)
# Paths a pixel of a reference of our own.
REFERENCE_PATHS = 2048
# Paths of a whole converged picture.
TRUTH_PATHS = 32_768 * 80 * 60


@dataclass
class Walk:
    """An interactive session: pictures of a view over time, the last picture, and its replay."""

    session: Session
    asked: tuple[float, ...]
    pictures: list[Path]
    identical_replay: bool
    file: Path


class Bench:
    """What measurements share: programs, scenes, existing files, and how long to take."""

    def __init__(self, root: Path, work: Path, plots: Path, quick: bool) -> None:
        self.root = root
        self.work = work
        self.plots = plots
        self.quick = quick
        self.cargo = Cargo(root)
        self.shared = root.parent / "shared"
        self.scenes = Scenes(self.cargo, self.shared, work)
        self._fills: dict[str, tuple[Path, dict[str, float]]] = {}
        self._walks: dict[str, Walk] = {}

    @cached_property
    def holodeck(self) -> Path:
        """Returns the program, which is built on first use."""
        return self.cargo.build("holodeck")

    @cached_property
    def _converged(self) -> Converged:
        return Converged(self.root / "target/truths", self.holodeck)

    def recorded(self, name: str) -> Part | None:
        """Returns a part of the document as it was measured last."""
        return Document(self.root / "docs", [name]).part(name)

    @property
    def pictures_at(self) -> tuple[float, ...]:
        return QUICK_PICTURES_AT if self.quick else PICTURES_AT

    def seconds(self, full: float) -> float:
        return full / 10 if self.quick else full

    def paths(self, full: int) -> int:
        return max(full // 10, 2) if self.quick else full

    def render(
        self, case: Case, name: str, *options: str | Path, size: str = ""
    ) -> tuple[Path, dict[str, float]]:
        """Renders a picture of the case's view without a file; returns it and the report of `render
        --json`.
        """
        path = self.work / f"{case.name}-{name}.pfm"
        command = [
            self.holodeck, "render", *case.scene, *case.view.options(), "--size", size or case.size
        ]
        return path, run([*command, *options, "--json", "--quiet", "-o", path]).json()

    def reference(self, case: Case, threads: int | None = None) -> Reference:
        """Returns the independent reference, or a long render of this program, which is kept until
        the scene changes. `threads`: how many may render it.
        """
        return case.reference or self._converged.picture(case, self.paths(REFERENCE_PATHS), threads)

    def truth(self, case: Case) -> Path:
        """Returns the picture of the independent reference, or such a render with as many paths in
        all as TRUTH_PATHS.
        """
        if case.reference:
            return case.reference.picture
        width, height = (int(side) for side in case.size.split("x"))
        return self._converged.picture(
            case, max(self.paths(TRUTH_PATHS) // (width * height), 2)
        ).picture

    def fill(
        self, name: str, case: Case, seconds: float, *options: str
    ) -> tuple[Path, dict[str, float]]:
        """Returns a file filled in batch, which is made once for all measurements, and the report
        of `fill --json`.
        """
        if name not in self._fills:
            path = self.work / f"{name}.holo"
            time = f"{self.seconds(seconds)}s"
            command = [
                self.holodeck, "fill", *case.scene, *options, "-o", path, "--time", time, "--json",
                "--quiet"
            ]
            self._fills[name] = path, run(command).json()
        return self._fills[name]

    def cornell_direct(self) -> tuple[Path, dict[str, float]]:
        return self.fill("cornell-direct", self.scenes.cornell(), 10, "--bounces", "0")

    def room_filled(self) -> tuple[Path, dict[str, float]]:
        return self.fill("room", self.scenes.room(), 40)

    def picture(
        self, file: Path, options: list[str], size: str, name: str
    ) -> tuple[Path, dict[str, float], float]:
        """Makes a picture from a file; returns it, the report of `picture --json`, and the
        program's seconds.
        """
        path = self.work / f"{name}.pfm"
        ended = run(
            [self.holodeck, "picture", file, *options, "--size", size, "--json", "-o", path]
        )
        return path, ended.json(), ended.seconds

    def walk(self, case: Case, moving: bool) -> Walk:
        """Returns a session at the case's view, from an empty file. `moving`: it begins at another
        view.
        """
        name = f"{case.name}-{'moved' if moving else 'start'}"
        if name not in self._walks:
            self._walks[name] = self._walk(case, name, moving)
        return self._walks[name]

    def _walk(self, case: Case, name: str, moving: bool) -> Walk:
        asked = self.pictures_at
        pictures = [self.work / f"{name}-{seconds}.pfm" for seconds in asked]
        lines = [f"0 view {case.view.line()}"]
        if moving:
            lines = [f"0 view {case.before.line()}", f"{self.seconds(5)} view {case.view.line()}"]
        lines += [f"{seconds} picture {path}" for seconds, path in zip(asked, pictures)]
        script = self.work / f"{name}.txt"
        script.write_text("\n".join([*lines, "quit", ""]), encoding="utf-8")
        file, last, again = (
            self.work / f"{name}{end}" for end in (".holo", "-last.pfm", "-replay.pfm")
        )
        common = ["--headless", "--size", case.size, "--json"]
        found = session(
            [
                self.holodeck, "view", *case.scene, *common, "--script", script, "--keep", file,
                "-o", last
            ]
        )
        run([self.holodeck, "replay", file, *common, *case.view.options(), "-o", again])
        same = differing_pixels(last, again) <= found.reports[-1]["uncovered_pixels"]
        return Walk(found, asked, pictures, same, file)


def differing_pixels(one: Path, other: Path) -> int:
    """Returns how many pixels of two colour .pfm files of one size differ in any bit."""
    *one_head, one_pixels = one.read_bytes().split(b"\n", 3)
    *other_head, other_pixels = other.read_bytes().split(b"\n", 3)
    if one_head != other_head:
        raise Failed(f"{one} and {other} are of different sizes")
    return sum(
        one_pixels[at : at + 12] != other_pixels[at : at + 12]
        for at in range(0, len(one_pixels), 12)
    )
