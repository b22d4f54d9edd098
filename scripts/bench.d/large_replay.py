"""A large holodeck that is replayed: seconds until its address and its first picture."""

from __future__ import annotations

import hashlib
import signal
import subprocess
import time
from pathlib import Path

from devtools import Chromium
from harness import Bench
from program import run
from scenes import Case

# Bytes of the file.
LARGE = 1_000_000_000
TIMES = 3


def large_replay(bench: Bench) -> tuple[int, float, float]:
    """Returns the file's bytes, the seconds until the address is printed, and those until the page
    shows a picture of which most is known: of several runs, that with the median time. A browser
    is already there.
    """
    file = filled(bench, bench.scenes.cornell())
    runs = sorted((opened(bench, file) for _ in range(TIMES)), key=lambda found: found[1])
    return file.stat().st_size, *runs[TIMES // 2]


def filled(bench: Bench, case: Case) -> Path:
    """Returns a file of about LARGE bytes, which is kept until the scene changes."""
    size = int(bench.seconds(LARGE))
    scene = Path(case.scene[0] if case.scene[0] != "--config" else case.scene[1])
    models = [scene.with_suffix(end) for end in (".obj", ".mtl")]
    state = hashlib.sha256(b"".join(model.read_bytes() for model in models)).hexdigest()[:12]
    kept = bench.root / "target/large-files" / f"{case.name}-{state}-{size}.holo"
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        making = kept.with_name("making.holo")
        making.unlink(missing_ok=True)
        # More samples than the file has room for: none is traced again instead. Direct light
        # alone, because what the samples hold does not matter here, and millions come in a second.
        limits = ["--enough", "10G", "--disk", str(size), "--bounces", "0"]
        run([bench.holodeck, "fill", *case.scene, *limits, "--quiet", "-o", making])
        making.rename(kept)
    return kept


def opened(bench: Bench, file: Path) -> tuple[float, float]:
    """Replays a file. Returns the seconds until the address and until the picture."""
    browser = Chromium("about:blank")
    try:
        start = time.monotonic()
        with subprocess.Popen(
            [bench.holodeck, "replay", file, "--http", "127.0.0.1:0", "--no-open"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        ) as process:  # fmt: skip
            try:
                address = process.stdout.readline().strip()
                printed = time.monotonic() - start
                browser.call("Page.navigate", url=address)
                browser.wait("header && header.unknown < 0.5")
                return printed, time.monotonic() - start
            finally:
                process.send_signal(signal.SIGINT)
    finally:
        browser.close()
