"""Converged pictures of our own tracer, for views without an independent reference.

A picture is rendered in passes with different seeds. Each finished pass is kept, so that an
interrupted run continues where it stopped.

Invariants: a picture is named after its view, its paths and the bytes of its scene. A file under
its final name is complete.
"""

from __future__ import annotations

import math
import shutil
import zlib
from array import array
from pathlib import Path
from statistics import fmean, stdev
from typing import Sequence

from program import run
from scenes import Case, Reference

# Each takes some minutes of one core at most. Their spread is the mean's standard error.
PASSES = 8


class Converged:
    """The converged pictures in one folder."""

    def __init__(self, folder: Path, holodeck: Path) -> None:
        self._folder = folder
        self._holodeck = holodeck

    def picture(self, case: Case, paths: int, threads: int | None = None) -> Reference:
        """Returns the picture of the case's view with about so many paths a pixel. Renders what is
        missing of it, on all cores unless `threads` is given.
        """
        kept = self._folder / f"{case.name}-{case.size}-{paths}-{stamp(case):08x}"
        picture, error = kept.with_suffix(".pfm"), kept.with_name(f"{kept.name}-se.pfm")
        if not (picture.exists() and error.exists()):
            kept.mkdir(parents=True, exist_ok=True)
            share = math.ceil(paths / PASSES)
            passes = [
                self._render(case, kept / f"{seed}.pfm", share, seed, threads)
                for seed in range(1, PASSES + 1)
            ]
            header = passes[0][0]
            pixels = list(zip(*(values for _, values in passes)))
            write(error, header + array("f", map(standard_error, pixels)).tobytes())
            write(picture, header + array("f", map(fmean, pixels)).tobytes())
            shutil.rmtree(kept)
        return Reference(picture, error)

    def _render(
        self, case: Case, made: Path, paths: int, seed: int, threads: int | None
    ) -> tuple[bytes, array]:
        """Returns header and values of one pass, which is rendered unless it is kept."""
        if not made.exists():
            unfinished = made.with_name("unfinished.pfm")
            command = [
                self._holodeck, "render", *case.scene, *case.view.options(), "--size", case.size
            ]
            command += ["--spp", str(paths), "--seed", str(seed)]
            command += ["--threads", str(threads)] if threads else []
            run([*command, "--quiet", "-o", unfinished])
            unfinished.rename(made)
        return pfm(made)


def stamp(case: Case) -> int:
    """Returns a number that follows from the bytes of the case's scene."""
    scene = next(path for path in map(Path, case.scene) if path.suffix in (".obj", ".toml"))
    return zlib.crc32(
        b"".join(scene.with_suffix(suffix).read_bytes() for suffix in (".obj", ".mtl"))
    )


def standard_error(values: Sequence[float]) -> float:
    """Returns the standard error of the mean."""
    return stdev(values) / math.sqrt(len(values))


def pfm(path: Path) -> tuple[bytes, array]:
    """Returns header and values of a little-endian PFM file."""
    data = path.read_bytes()
    start = 0
    for _ in range(3):
        start = data.index(b"\n", start) + 1
    return data[:start], array("f", data[start:])


def write(path: Path, data: bytes) -> None:
    """Writes a file that appears under its name only when it is complete."""
    unfinished = path.with_name(f"{path.name}.unfinished")
    unfinished.write_bytes(data)
    unfinished.rename(path)
