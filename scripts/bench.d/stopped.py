"""The first frame of all pixels after a motion, as the page shows it, against the picture that the
file of the same session gives for the same view.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from devtools import Chromium
from harness import Bench
from program import Failed
from rooms import TRUTH_SIZE, Pixels, decibels, decibels_of, read
from scenes import Case, View

# Seconds of turning before the eye stops.
TURNING = 1.0
# Paths of a pixel of each half of the truth.
TRUTH_PATHS = 64

# Shows light in proportion, and keeps the exposure, so that a page's pixels say what radiance they
# stand for. Copies the first frame at rest that follows one in motion.
WATCH = """
window.first = null; window.moved = false;
display.tone = 'linear'; display.locked = header.exposure; say('display', display);
{ const drawn = draw; draw = (next, parts) => {
  drawn(next, parts);
  if (!next.rest) window.moved = true;
  else if (window.moved && !window.first) {
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [picture.width, picture.height];
    canvas.getContext('2d').drawImage(picture, 0, 0);
    window.first = { options: next.options, exposure: next.exposure, canvas };
  }
}; }
0"""

# The radiance of that frame, averaged down to the truth's size, rows from the bottom.
AVERAGED = """
(([columns, rows]) => {
  const { canvas, exposure } = window.first, { width, height } = canvas;
  const step = width / columns;
  if (height / rows !== step || step % 1) return `a frame of ${width}×${height} pixels`;
  const light = Array.from({ length: 256 }, (_, byte) => {
    const c = byte / 255;
    return (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4) / exposure / step ** 2;
  });
  const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);
  const sums = new Float64Array(3 * columns * rows);
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++) {
      const to = 3 * ((rows - 1 - Math.floor(y / step)) * columns + Math.floor(x / step));
      for (let c = 0; c < 3; c++) sums[to + c] += light[data[4 * (y * width + x) + c]];
    }
  return [...sums];
})"""


def turn_and_stop(browser: Chromium, seconds: float) -> tuple[View, float, Pixels]:
    """Turns the eye and stops. Returns the view of the first frame of all pixels, its exposure, and
    its radiance at the truth's size.
    """
    browser.value(WATCH)
    # The page's look has arrived when a frame was drawn with it.
    time.sleep(1.0)
    browser.key("KeyE", True)
    time.sleep(seconds)
    # Tracing is paused before the stop: otherwise the file gets several times as many samples of a
    # new view until the page has shown the frame.
    browser.key("KeyP", True)
    browser.key("KeyP", False)
    browser.key("KeyE", False)
    browser.wait("window.first")
    options, exposure = browser.value("[window.first.options, window.first.exposure]")
    size = [int(side) for side in TRUTH_SIZE.split("x")]
    sums = browser.value(f"{AVERAGED}({size})")
    if not isinstance(sums, list):
        raise Failed(f"the page shows {sums}")
    return view_of(options), exposure, list(zip(sums[::3], sums[1::3], sums[2::3]))


def view_of(options: str) -> View:
    """Returns a perspective view from Radiance's options."""
    words = options.split()
    number = {"-vp": 3, "-vd": 3, "-vu": 3, "-vh": 1}
    found = {
        name: ",".join(words[words.index(name) + 1 :][:count]) for name, count in number.items()
    }
    return View(found["-vp"], found["-vd"], found["-vu"], float(found["-vh"]))


def beside_picture(
    bench: Bench, case: Case, file: Path, stopped: tuple[View, float, Pixels]
) -> tuple[float, float]:
    """Returns the decibels of the frame and of the picture that `file` gives for its view."""
    view, exposure, frame = stopped
    look = replace(case, name=f"{case.name}-stopped", view=view, size=TRUTH_SIZE)
    halves = []
    for seed in ("1", "2"):
        paths = str(bench.paths(TRUTH_PATHS))
        made, _ = bench.render(look, f"truth-{seed}", "--spp", paths, "--seed", seed)
        halves.append(read(made))
    truth = halves[0], halves[1]
    picture, _, _ = bench.picture(file, view.options(), "1280x720", look.name)
    # A page shows nothing brighter than white.
    return decibels_of(frame, truth), decibels(picture, truth, most=1 / exposure)
