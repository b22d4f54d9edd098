"""A walk in a real browser on the same machine, while workers trace."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from devtools import Chromium
from document import Bar, Part, Table
from harness import Bench
from large_replay import LARGE, TIMES, large_replay
from scenes import Case
from stopped import TURNING, beside_picture, turn_and_stop

# Seconds of standing still before the walk.
LOOKING = 10.0
# Seconds of each kind of walking.
WALKING = 6.0
# Seconds between two inputs of a drag: a mouse's at 60 Hz, every other one.
INPUTS = 1 / 30
# Seconds over which the cost of an idle session is measured.
IDLE = 10.0

MOST_MEDIAN, MOST_LATE = 60.0, 120.0
LEAST_FRAMES = 20.0
MOST_REST = 200.0
MOST_FIRST = 3.0
MOST_PAGE = 200_000
MOST_IDLE = 0.02
# Decibels that the first frame of all pixels may be worse than a picture of the file.
MOST_BEHIND = 0.5
# Seconds until a large file's first picture.
MOST_REPLAY = 1.5

# Records the page's frames: number, time, rest or motion, width, and the times of its parts.
KEEP = (
    "window.kept = []; const drawn = draw; draw = (next, parts) => { next.times.decode ="
    " performance.now() - next.came; drawn(next, parts); kept.push([next.frame, performance.now(),"
    " next.rest, next.size[0], next.times]); }; latencies.length = 0; 0"
)

# Parts of a moving frame's way, as frames state them.
PARTS = {"look": "showing earlier frames from here", "wait": "waiting for the page",
         "tone": "tone mapping", "encode": "encoding", "decode": "decoding in the page"}  # fmt: skip


@dataclass
class Found:
    """What one walk showed."""

    first: float
    # The same from the page's request on.
    first_of_page: float
    latencies: list[float]
    frames: float
    width: int
    rest: float
    # Medians over frames that moved, milliseconds.
    parts: dict[str, float]
    # The driver's look and draw of a frame at rest, milliseconds.
    full: tuple[float, float]
    # Decibels of the first frame of all pixels, and of a picture of the file.
    stopped: tuple[float, float]


def walk_live(bench: Bench) -> Part:
    """A walk in a browser while workers trace: latency, quality, page, idle cost, large files."""
    part = Part(
        "A walk in a browser",
        [
            (
                "`view` of a scene, with a worker on all cores and Chromium (without a window and"
                " without a GPU) on the same ones, 1280 × 720. *Latency* is from an input in the"
                " page until the frame drawn from it is on the page's canvas; the inputs are those"
                " of a mouse that drags, 30 in a second. *Frames* are distinct ones in a second"
                " while a key is held. *Full quality* is the time from the last frame that moved"
                " until the first one of all pixels. *First light* is from the program's start"
                " until a picture of which most is known; *of the page*: from its request, without"
                " Chromium's own start."
            ),
            "*Idle* is the share of a core that `replay` takes with a page open and nothing to do.",
            (
                "*After stopping* is the display PSNR of the first frame of all pixels after"
                f" {TURNING:g} s of turning, as the page shows it, and of what `picture` makes of"
                " the file at the end of the session, both averaged down to 320 × 180, against"
                " a truth of our own whose noise is taken off."
            ),
            (
                f"*A large file* is `replay --no-open` of {LARGE / 1e9:g} GB, from the program's"
                " start until its address is printed, and until a page of a browser that is already"
                f" there shows a picture of which most is known: the median of {TIMES} runs, the"
                " file in the system's cache."
            ),
        ],
    )
    table = Table(
        "While one walks",
        [["scene", ""], ["first light, s", ".2f"], ["of the page, s", ".2f"],
         ["latency, median ms", ".0f"], ["99 of 100, ms", ".0f"],
         ["frames/s", ".1f"], ["least width, pixels", "d"], ["full quality, ms", ".0f"]],
    )  # fmt: skip
    where = Table(
        "Where the time of a frame goes, medians in ms",
        [
            ["scene", ""], *[[name, ".1f"] for name in PARTS.values()], ["at rest: casting", ".0f"],
            ["at rest: drawing", ".0f"]
        ],
    )
    stopped = Table(
        "After stopping", [["scene", ""], ["frame, dB", ".1f"], ["picture of the file, dB", ".1f"]]
    )
    for case in (bench.scenes.interior(), bench.scenes.room()):
        found = walk(bench, case)
        frame, picture = found.stopped
        stopped.rows.append([case.title, frame, picture])
        bar = Bar(
            f"first full frame beside a picture of the file, {case.title}",
            f"{frame - picture:+.1f} dB", f"≥ -{MOST_BEHIND:g} dB", frame >= picture - MOST_BEHIND
        )
        part.bars.append(bar)
        found.latencies.sort()
        middle = median(found.latencies)
        late = found.latencies[min(len(found.latencies) * 99 // 100, len(found.latencies) - 1)]
        table.rows.append(
            [
                case.title, found.first, found.first_of_page, middle, late, found.frames,
                found.width, found.rest
            ]
        )
        where.rows.append([case.title, *[found.parts[part] for part in PARTS], *found.full])
        for what, figure, unit, most in (
            ("latency, median", middle, "ms", MOST_MEDIAN),
            ("latency, 99 of 100", late, "ms", MOST_LATE),
            ("full quality after stopping", found.rest, "ms", MOST_REST),
            ("first light", found.first, "s", MOST_FIRST),
        ):
            digits = ".1f" if unit == "s" else ".0f"
            bar = Bar(
                f"{what}, {case.title}", f"{figure:{digits}} {unit}", f"≤ {most:g} {unit}",
                figure <= most
            )
            part.bars.append(bar)
        frames, least = found.frames, LEAST_FRAMES
        bar = Bar(
            f"frames while moving, {case.title}", f"{frames:.1f}/s", f"≥ {least:g}/s",
            frames >= least
        )
        part.bars.append(bar)
    part.tables += [table, where, stopped]
    page, idle = resting(bench)
    part.tables.append(
        Table("At rest", [["page, bytes", ",d"], ["idle, share of a core", ".2%"]], [[page, idle]])
    )
    part.bars.append(Bar("page", f"{page:,d} bytes", f"≤ {MOST_PAGE:,d} bytes", page <= MOST_PAGE))
    part.bars.append(Bar("idle", f"{idle:.1%} of a core", f"≤ {MOST_IDLE:.0%}", idle <= MOST_IDLE))
    size, printed, seen = large_replay(bench)
    columns = [["file, bytes", ",d"], ["address, s", ".2f"], ["picture, s", ".2f"]]
    part.tables.append(Table("A large file", columns, [[size, printed, seen]]))
    part.bars.append(
        Bar("picture of a large file", f"{seen:.2f} s", f"≤ {MOST_REPLAY:g} s", seen <= MOST_REPLAY)
    )
    return part


class Served:
    """A session with a page, and a browser that shows it."""

    def __init__(
        self, command: list[str | Path], size: tuple[int, int] = (1280, 720)
    ) -> None:
        self.start = time.monotonic()
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self.address = self.process.stdout.readline().strip()
        self.browser = Chromium(self.address, size)

    def __enter__(self) -> "Served":
        return self

    def __exit__(self, *_: object) -> None:
        self.browser.close()
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=120)


def walk(bench: Bench, case: Case) -> Found:
    """Returns what a walk through a scene showed."""
    file = bench.work / f"walk-live-{case.name}.holo"
    view = [*case.view.any_shape().options(), "--no-open", "--keep", file]
    with Served([bench.holodeck, "view", *case.scene, *view]) as served:
        browser = served.browser
        browser.wait("header && header.unknown < 0.5")
        first = time.monotonic() - served.start
        first_of_page = browser.value("performance.now() / 1e3")
        time.sleep(bench.seconds(LOOKING))
        browser.value(KEEP)
        latencies = drag(browser, bench.seconds(WALKING))
        browser.value("kept.length = 0; 0")
        browser.key("KeyE", True)
        time.sleep(bench.seconds(WALKING))
        browser.key("KeyE", False)
        browser.wait("kept.length && kept[kept.length - 1][2]")
        kept = browser.value("kept")
        stopped = turn_and_stop(browser, TURNING)
    moving = [frame for frame in kept if not frame[2]]
    seconds = (moving[-1][1] - moving[0][1]) / 1e3
    frames = (len({frame[0] for frame in moving}) - 1) / max(seconds, 1e-3)
    rest = next(frame[1] for frame in kept if frame[2] and frame[1] > moving[-1][1]) - moving[-1][1]
    parts = {part: median(frame[4][part] for frame in moving) for part in PARTS}
    times = next(frame[4] for frame in kept if frame[2] and frame[1] > moving[-1][1])
    least = min(frame[3] for frame in moving)
    return Found(
        first, first_of_page, latencies, frames, least, rest, parts, (times["look"], times["draw"]),
        beside_picture(bench, case, file, stopped)
    )


def drag(browser: Chromium, seconds: float) -> list[float]:
    """Drags to and fro; returns the latencies that the page measured, milliseconds."""
    browser.mouse("mousePressed", 640, 360, 1)
    end, step = time.monotonic() + seconds, 0
    latencies: list[float] = []
    while time.monotonic() < end:
        step += 1
        # A triangle: to the right for two seconds, then back.
        across = abs(step % 120 - 60) * 5
        began = time.monotonic()
        browser.mouse("mouseMoved", 490 + across, 360, 1)
        time.sleep(max(0.0, INPUTS - (time.monotonic() - began)))
        if step % 100 == 0:
            # The page keeps the last 200.
            latencies += browser.value("latencies.splice(0)")
    browser.mouse("mouseReleased", 640, 360, 0)
    return latencies + browser.value("latencies.splice(0)")


def resting(bench: Bench) -> tuple[int, float]:
    """Returns the page's bytes, and the share of a core that a replay takes with nothing to do."""
    file, _ = bench.room_filled()
    with Served([bench.holodeck, "replay", file, "--no-open"]) as served:
        browser = served.browser
        browser.wait("document.body.dataset.exact === 'true'")
        parts = (
            "['', 'walk.css', 'walk.js'].map(p => fetch('/' + p).then(r => r.text()).then(t =>"
            " t.length))"
        )
        page = browser.value(f"Promise.all({parts}).then(sizes => sizes.reduce((a, b) => a + b))")
        # All stored samples have arrived by then.
        time.sleep(bench.seconds(LOOKING))
        before, begin = processor_seconds(served.process.pid), time.monotonic()
        time.sleep(bench.seconds(IDLE))
        used = processor_seconds(served.process.pid) - before
        return page, used / (time.monotonic() - begin)


def processor_seconds(process: int) -> float:
    """Returns the processor time that a process has used."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
