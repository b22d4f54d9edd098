"""Building and running the `holodeck` program, and measuring its memory."""

from __future__ import annotations

import json
import os
import platform
import re
import resource
import subprocess
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Sequence

MIB = 1 << 20

# Seconds between measurements of memory. The kernel records the peak of each process, so only what
# it takes just before its end can be missed.
SAMPLE_MEMORY_EVERY = 0.1


class Failed(Exception):
    """A command failed; the message says which and why."""


@dataclass(frozen=True)
class Finished:
    """A command that has ended successfully."""

    stdout: str
    seconds: float
    # Processor seconds of the command and the processes that it started.
    processor: float

    def json(self) -> dict[str, Any]:
        try:
            return json.loads(self.stdout)
        except ValueError as error:
            raise Failed(f"not JSON ({error}): {self.stdout[:200]}") from error


def run(
    command: Sequence[str | Path], folder: Path | None = None, memory: int | None = None
) -> Finished:
    """Runs a command to its end. `seconds` is from its start to its exit. `memory`: most bytes that
    it may map.
    """
    words = [str(word) for word in command]
    before = _children_ran()
    start = time.monotonic()
    bound = (lambda: resource.setrlimit(resource.RLIMIT_AS, (memory, memory))) if memory else None
    ended = subprocess.run(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False,
        preexec_fn=bound
    )  # fmt: skip
    seconds = time.monotonic() - start
    if ended.returncode != 0:
        raise Failed(
            f"`{' '.join(words)}` ended with status {ended.returncode}:\n{ended.stderr.strip()}"
        )
    return Finished(ended.stdout, seconds, _children_ran() - before)


def _children_ran() -> float:
    """Returns the processor seconds of all processes that were waited for, and of their
    descendants.
    """
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True)
class Cargo:
    """Release builds of the workspace."""

    root: Path

    def build(self, package: str, *target: str) -> Path:
        """Builds a program or example and returns its path; compiler messages go to the terminal.
        """
        command = ["cargo", "build", "--release", "--locked", "-p", package, *target]
        built = subprocess.run(
            [*command, "--message-format=json-render-diagnostics"],
            cwd=self.root, stdout=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
        if built.returncode != 0:
            raise Failed(f"`{' '.join(command)}` failed")
        wanted = target[-1] if target else package
        messages = (json.loads(line) for line in built.stdout.splitlines() if line.startswith("{"))
        for message in messages:
            if message.get("executable") and message["target"]["name"] == wanted:
                return Path(message["executable"])
        raise Failed(f"`{' '.join(command)}` made no program named {wanted}")


def compare(
    holodeck: Path, picture: Path, reference: Path, *options: str | Path
) -> dict[str, float]:
    """Returns the measures of `picture` against `reference`, from the program itself."""
    return run([holodeck, "compare", picture, reference, "--json", *options]).json()


@dataclass(frozen=True)
class Session:
    """An interactive session that has ended successfully."""

    # The viewer's report on every picture, in order.
    reports: list[dict[str, Any]]
    # Seconds from the start of the program to the first of these reports.
    first_report: float
    # Peak resident memory in MiB: "holodeck and viewer", "holoserver", "rtworker".
    memory: dict[str, float]


def session(command: Sequence[str | Path]) -> Session:
    """Runs `holodeck view … --json`; records when each report comes, and the memory of its
    processes.
    """
    words = [str(word) for word in command]
    start = time.monotonic()
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        memory = PeakMemory(process.pid)
        memory.start()
        errors: list[str] = []
        drain = threading.Thread(target=lambda: errors.extend(process.stderr or ()))
        drain.start()
        reports, first_report = [], 0.0
        for line in process.stdout or ():
            if not reports:
                first_report = time.monotonic() - start
            reports.append(json.loads(line))
        drain.join()
        memory.stop()
        process.wait()
    if process.returncode != 0 or not reports:
        raise Failed(
            f"`{' '.join(words)}` ended with status"
            f" {process.returncode}:\n{''.join(errors).strip()}"
        )
    return Session(reports, first_report, memory.peaks)


class PeakMemory(threading.Thread):
    """Peak resident memory (VmHWM) of a process and of its children, while they run."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.peaks: dict[str, float] = {}
        self._pid = pid
        self._stopped = threading.Event()

    def run(self) -> None:
        while not self._stopped.wait(SAMPLE_MEMORY_EVERY):
            self._note(self._pid, "holodeck and viewer")
            for pid in _children(self._pid):
                self._note(pid, _first_argument(pid))

    def stop(self) -> None:
        """Ends the measurement; `peaks` is complete then."""
        self._stopped.set()
        self.join()

    def _note(self, pid: int, role: str) -> None:
        kib = _status(pid).get("VmHWM", "").split()
        if kib and role:
            self.peaks[role] = max(self.peaks.get(role, 0.0), int(kib[0]) * 1024 / MIB)


def _status(pid: int) -> dict[str, str]:
    try:
        text = Path(f"/proc/{pid}/status").read_text(encoding="utf-8", errors="replace")
    except OSError:  # It has ended.
        return {}
    return {
        key: value.strip() for key, _, value in (line.partition(":") for line in text.splitlines())
    }


def _children(parent: int) -> list[int]:
    pids = (int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit())
    return [pid for pid in pids if _status(pid).get("PPid") == str(parent)]


def _first_argument(pid: int) -> str:
    """Returns the first argument: `rtworker` of `holodeck rtworker …`, by which the program starts
    its processes.
    """
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return words[1].decode(errors="replace") if len(words) > 1 else ""


def conditions(root: Path) -> dict[str, str]:
    """Returns the machine and the version that are measured."""
    return {
        "date": time.strftime("%Y-%m-%d"),
        "CPU": _find("/proc/cpuinfo", r"model name\s*:\s*(.+)") or platform.machine(),
        "cores": str(len(os.sched_getaffinity(0))),
        "memory": _memory(),
        "kernel": platform.release(),
        "rustc": _said(["rustc", "--version"], root).removeprefix("rustc "),
        "commit": _commit(root),
    }


def version(folder: Path, commit: str) -> tuple[str, int | None]:
    """Returns the date of a commit, and the number of commits since; `None` if it is unknown."""
    date = _said(["git", "show", "-s", "--format=%as", commit], folder)
    since = _said(["git", "rev-list", "--count", f"{commit}..HEAD"], folder)
    return date, int(since) if since else None


def available_memory() -> int:
    """Returns the bytes that programs can still take."""
    kib = _find("/proc/meminfo", r"MemAvailable:\s*(\d+)")
    return int(kib) * 1024 if kib else 0


def _memory() -> str:
    kib = _find("/proc/meminfo", r"MemTotal:\s*(\d+)")
    return f"{int(kib) * 1024 / (1 << 30):.1f} GiB" if kib else "unknown"


def _find(path: str, pattern: str) -> str | None:
    found = re.search(pattern, Path(path).read_text(encoding="utf-8", errors="replace"))
    return found.group(1).strip() if found else None


def _commit(root: Path) -> str:
    commit = _said(["git", "rev-parse", "--short=12", "HEAD"], root)
    # The document itself changes while it is being made.
    changed = _said(["git", "status", "--porcelain", "--", ".", ":!docs"], root)
    return f"{commit} with changes" if changed else commit or "unknown"


def _said(command: list[str], folder: Path) -> str:
    try:
        return run(command, folder).stdout.strip()
    except (Failed, OSError):
        return ""


def median_of(times: int, once: Callable[[], tuple[float, Any]]) -> tuple[float, Any]:
    """Returns the run with the median time of several."""
    runs = sorted((once() for _ in range(times)), key=lambda timed: timed[0])
    return runs[len(runs) // 2]
