"""Several machines: what a server and its connections can carry, with workers that only pretend."""

from __future__ import annotations

from document import Bar, Part, Table
from harness import Bench
from program import run

INGEST_BAR = 6e6
RECALL_BAR = 20.0
TLS_BAR = 0.15
FIRST_BAR = 100.0
EFFICIENCY_BAR = 0.95


def network(bench: Bench) -> Part:
    """A server over TCP: ingest, stored samples, encryption, and a new view's first samples."""
    example = bench.cargo.build("holo-server", "--example", "network")
    seconds, changes = bench.seconds(10), 20 if bench.quick else 300
    found = run([example, f"{seconds:g}", str(changes)]).json()
    part = Part(
        "Several machines",
        [
            "`crates/serve/holoserver/examples/network.rs`: a server and its peers in one process of "
            "two threads, over TCP on loopback. *Ingest*: a worker returns each packet at once; "
            "the server checks, stores and counts the samples; the file has 32 samples a beam. An "
            "empty file is filled by packets of 4 rays at first, so that all beams get some at "
            "once. *Recall*: a view's 250,000 stored samples into a display's memory, from the "
            f"second time on. *Encrypted*: the same over TLS 1.3. *A new view*: {changes} views "
            "that share no beam, with 64 workers of 0.5 ms a ray that are busy with the view "
            "before; from the request to the first samples traced for it. *Efficiency*: workers "
            "of 20 µs a ray fill that file; the samples stored, as a share of those that they "
            "could trace.",
        ],
    )  # fmt: skip
    table = Table("", [["", ""], ["plain", ",.1f"], ["encrypted", ",.1f"]])
    plain, secure = found["ingest"], found["ingest_secure"]
    table.rows.append(["ingest, M samples/s", plain / 1e6, secure / 1e6])
    table.rows.append(
        ["the first second of an empty file, M samples", found["first_second"] / 1e6, None]
    )
    table.rows.append(["recall, ms (median)", found["recall_ms"], found["recall_secure_ms"]])
    half, most = found["first_ms"]["half"], found["first_ms"]["of_100_99"]
    table.rows.append(["a new view's first samples, ms (median)", half, None])
    table.rows.append(["a new view's first samples, ms (99 of 100)", most, None])
    part.tables.append(table)
    crews = Table("", [["workers", ",d"], ["efficiency", ".1%"]])
    crews.rows += found["efficiency"]
    part.tables.append(crews)
    crew, share = found["efficiency"][-1]
    cost = 1.0 - secure / plain
    part.bars += [
        Bar("ingest of one worker", f"{plain / 1e6:.1f} M samples/s",
            f"≥ {INGEST_BAR / 1e6:g} M samples/s", plain >= INGEST_BAR),
        Bar("ingest that encryption costs", f"{cost:.0%}", f"≤ {TLS_BAR:.0%}", cost <= TLS_BAR),
        Bar("250,000 stored samples to a display", f"{found['recall_ms']:.1f} ms",
            f"≤ {RECALL_BAR:g} ms", found["recall_ms"] <= RECALL_BAR),
        Bar(f"efficiency of {crew} workers", f"{share:.1%}", f"≥ {EFFICIENCY_BAR:.0%}",
            share >= EFFICIENCY_BAR),
        Bar("first samples of a new view, 99 of 100", f"{most:.0f} ms", f"≤ {FIRST_BAR:g} ms",
            most <= FIRST_BAR),
    ]  # fmt: skip
    return part
