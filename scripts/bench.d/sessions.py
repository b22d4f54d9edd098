"""Sessions of processes that are started one by one: a server, workers of one thread, a display.

Invariant: all processes have ended when a function returns.
"""

from __future__ import annotations

import json
import resource
import shutil
import signal
import subprocess
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, Sequence

from harness import Bench
from program import Failed, run
from scenes import Case, View

SIZE = "640x480"
# The options that choose each driver. `cells` is the first paper's Voronoi driver.
DRIVERS = {
    "quadtree": ("--driver", "quadtree"),
    "cells": ("--cells", "constant"),
    "mesh": ("--driver", "mesh"),
    "surfaces": ("--driver", "surfaces", "--denoise", "off"),
    "pointimage": ("--driver", "pointimage"),
}
# The views of a session, degrees from that of its scene. The first is where it begins, and does not
# count.
TURNS = (0.0, 18.0, 36.0)
# Seconds at least at each view, and at most until its stored samples have come.
STAY, MOST_RECALL = 0.8, 2.0
# Seconds without further stored samples after which a view has all of them: they come in rounds.
NO_MORE = 0.7
# Seconds until a process has ended by itself.
PATIENCE = 60.0


@dataclass(frozen=True)
class Rates:
    """Samples a second."""

    rendered: float
    recalled: float


class Served:
    """A server of a file, and workers of one thread each."""

    def __init__(self, bench: Bench, file: Path, workers: int, *options: str) -> None:
        command = [bench.holodeck, "holoserver", file, "--listen", "127.0.0.1:0", "--json"]
        self.server = start([*command, *options])
        self.address = ""
        for line in self.server.stdout or ():
            if line.startswith("listening on "):
                self.address = line.split()[-1]
                break
        if not self.address:
            raise Failed(f"the server of {file} says no address")
        worker = [bench.holodeck, "rtworker", "--connect", self.address, "--threads", "1"]
        self.workers = [start([*worker, "--quiet"]) for _ in range(workers)]

    def summary(self) -> dict[str, Any]:
        """Waits for the server's end; returns what it reports."""
        text = (self.server.stdout or []).read()
        self.server.wait(timeout=PATIENCE)
        return json.loads(text[text.index("{") :])

    def close(self) -> None:
        for process in (self.server, *self.workers):
            if process.poll() is None and process is self.server:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def start(command: Sequence[str | Path]) -> subprocess.Popen:
    words = [str(word) for word in command]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        words, text=True, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, bufsize=1
    )


@contextmanager
def served(bench: Bench, file: Path, workers: int, *options: str) -> Iterator[Served]:
    found = Served(bench, file, workers, *options)
    try:
        yield found
    finally:
        found.close()


class Display:
    """A display without a screen that follows lines."""

    def __init__(self, bench: Bench, address: str, driver: str) -> None:
        self.picture = bench.work / "session.pfm"
        command = [
            bench.holodeck, "holoview", "--connect", address, "--size", SIZE, *DRIVERS[driver],
            "--script", "-", "--json", "--quiet",
        ]  # fmt: skip
        self.process = start(command)

    def say(self, line: str) -> None:
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def look(self, view: View) -> None:
        self.say(f"view {view.line()}")

    def report(self) -> dict[str, Any]:
        """Returns the report on a picture that is drawn now."""
        self.say(f"picture {self.picture}")
        line = self.process.stdout.readline()
        if not line:
            raise Failed("the display has ended early")
        return json.loads(line)

    def close(self) -> None:
        self.process.stdin.close()
        try:
            self.process.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def rates(bench: Bench, file: Path, views: list[View], driver: str, workers: int) -> Rates:
    """Returns the samples that a session renders and recalls a second, at all but the first view."""
    # A session with workers adds to the file.
    own = file
    if workers:
        own = bench.work / "session.holo"
        shutil.copyfile(file, own)
    with served(bench, own, workers) as server:
        display = Display(bench, server.address, driver)
        try:
            first, *others = views
            display.look(first)
            recall(display)
            stored = traced = 0
            recalling = staying = 0.0
            for view in others:
                display.look(view)
                begin = time.monotonic()
                count, seconds = recall(display)
                time.sleep(max(0.0, STAY - (time.monotonic() - begin)))
                last = display.report()
                stored, recalling = stored + count, recalling + seconds
                traced, staying = traced + last["traced"], staying + last["seconds"]
        finally:
            display.close()
    return Rates(traced / staying, stored / max(recalling, 1e-6))


def recall(display: Display) -> tuple[int, float]:
    """Draws pictures until a view has all its stored samples. Returns their number, and the seconds
    until the last ones came.
    """
    most, at = 0, 0.0
    while True:
        report = display.report()
        if report["stored"] > most:
            most, at = report["stored"], report["seconds"]
        seconds = report["seconds"]
        if seconds > MOST_RECALL or (most and seconds - at > NO_MORE):
            return most, at


def batch_rate(bench: Bench, case: Case, seconds: float, workers: int) -> tuple[float, float]:
    """Returns the samples a second that workers add to an empty file, and the processor seconds of
    them and their server.
    """
    file = bench.work / "batch.holo"
    file.unlink(missing_ok=True)
    run([bench.holodeck, "fill", *case.scene, "-o", file, "--samples", "1k", "--quiet", "--json"])
    before = processor()
    with served(bench, file, workers, "--fill", "--time", f"{seconds}s") as server:
        summary = server.summary()
    return summary["added"] / summary["seconds"], processor() - before


def processor() -> float:
    """Returns the processor seconds of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
