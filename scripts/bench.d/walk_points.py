"""The render cache in a real browser on the same machine, while a worker traces."""

from __future__ import annotations

import time
from statistics import median

from document import Bar, Part, Table
from harness import Bench
from walk_live import KEEP, Served

# Seconds of standing still, and of walking.
LOOKING, WALKING = 5.0, 6.0
# Pixels of the page: those of the other walks in a browser, and those of the second paper.
SIZES = ((1280, 720), (512, 512))
# Frames a second, of the first of these sizes.
LEAST_FRAMES = 30.0


def walk_points(bench: Bench) -> Part:
    """Frames a second of the render cache in a page, with a worker on the same cores."""
    part = Part(
        "The render cache in a browser",
        [
            (
                "`view --driver pointimage` of a scene, with a worker on all cores and Chromium"
                " (without a window and without a GPU) on the same ones. *Frames* are distinct ones"
                " in a second while a key is held. Each frame shows all pixels, unless the least"
                " width says otherwise. The second paper has 14 frames a second at 512 × 512 on two"
                " processors of 2001, and 12 on one."
            ),
        ],
    )
    columns = [["scene", ""], ["pixels", ""], ["frames/s", ".1f"], ["least width, pixels", "d"],
               ["looking, ms", ".1f"], ["drawing, ms", ".1f"]]  # fmt: skip
    table = Table("The render cache while one walks", columns)
    for case in (bench.scenes.interior(), bench.scenes.room()):
        for size in SIZES:
            name = f"{size[0]} × {size[1]}"
            view = [*case.view.any_shape().options(), "--no-open", "--driver", "pointimage"]
            with Served([bench.holodeck, "view", *case.scene, *view], size) as served:
                browser = served.browser
                browser.wait("header")
                time.sleep(bench.seconds(LOOKING))
                browser.value(KEEP)
                browser.key("KeyE", True)
                time.sleep(bench.seconds(WALKING))
                browser.key("KeyE", False)
                moving = [frame for frame in browser.value("kept") if not frame[2]]
            seconds = (moving[-1][1] - moving[0][1]) / 1e3
            frames = (len({frame[0] for frame in moving}) - 1) / max(seconds, 1e-3)
            times = [median(frame[4][stage] for frame in moving) for stage in ("look", "draw")]
            table.rows.append([case.title, name, frames, min(frame[3] for frame in moving), *times])
            if size == SIZES[0]:
                bar = Bar(
                    f"frames while moving, pointimage, {case.title}", f"{frames:.1f}/s",
                    f"≥ {LEAST_FRAMES:g}/s", frames >= LEAST_FRAMES
                )
                part.bars.append(bar)
    part.tables.append(table)
    return part
