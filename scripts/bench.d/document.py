"""The document: figures as JSON, and Markdown made from them.

Invariants: everything in the Markdown is also in the JSON. Repeating a measurement replaces only
its own part of both.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from program import version

Figure = float | int | str | None

FORMAT = 1

# Commits after which a figure is marked as old.
OLD = 100

# Parts that are written in full, as NAME.md beside the page of bars.
OWN_PAGES = {"papers"}


@dataclass
class Table:
    """Rows of figures. A column is its heading and the format of its numbers (as in Python's
    `format`).
    """

    title: str
    columns: list[list[str]]
    rows: list[list[Figure]] = field(default_factory=list)
    # What the figures mean, if the part does not say so.
    note: str = ""

    def markdown(self) -> list[str]:
        formats = [spec for _, spec in self.columns]
        lines = [f"**{self.title}**", ""] if self.title else []
        lines += [self.note, ""] if self.note else []
        if not self.rows:
            return lines
        lines.append("| " + " | ".join(heading for heading, _ in self.columns) + " |")
        lines.append("|" + "|".join(" ---: " if spec else " --- " for spec in formats) + "|")
        for row in self.rows:
            lines.append(
                "| " + " | ".join(shown(figure, spec) for figure, spec in zip(row, formats)) + " |"
            )
        return [*lines, ""]


@dataclass
class Bar:
    """A figure and the target that it is compared with."""

    what: str
    figure: str
    wanted: str
    met: bool

    def verdict(self) -> str:
        return "yes" if self.met else "**no**"


@dataclass
class Plot:
    """A picture beside the document."""

    file: str
    caption: str


@dataclass
class Part:
    """The results of one measurement."""

    title: str
    # Explanations of the figures, one paragraph each.
    meaning: list[str]
    tables: list[Table] = field(default_factory=list)
    bars: list[Bar] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)
    # Measurements that were left out, with reasons.
    skipped: list[str] = field(default_factory=list)
    conditions: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def of_json(found: dict[str, Any]) -> "Part":
        nested = {"tables": Table, "bars": Bar, "plots": Plot}
        made = {key: [nested[key](**item) for item in found.get(key, ())] for key in nested}
        return Part(**{**found, **made})

    def to_json(self) -> dict[str, Any]:
        found = asdict(self)
        for table in found["tables"]:
            if not table["note"]:
                del table["note"]
        return found

    def markdown(self) -> list[str]:
        lines = [f"## {self.title}", ""]
        for paragraph in self.meaning:
            lines += [paragraph, ""]
        for table in self.tables:
            lines += table.markdown()
        for plot in self.plots:
            lines += [f"![{plot.caption}]({plot.file})", ""]
        for skipped in self.skipped:
            lines += [f"*Skipped: {skipped}*", ""]
        return lines


def shown(figure: Figure, spec: str) -> str:
    """Formats a figure for the document."""
    if figure is None:
        return "–"
    return figure if isinstance(figure, str) else format(figure, spec)


class Document:
    """`benchmarks.json` in a folder has every figure. `benchmarks.md`, made from it, has the figures
    that have a target. Plots go into `benchmarks/`.
    """

    def __init__(self, folder: Path, order: list[str]) -> None:
        self.folder = folder
        self._order = order
        self._json = folder / "benchmarks.json"
        self._parts: dict[str, Part] = {}
        if self._json.exists():
            found = json.loads(self._json.read_text(encoding="utf-8"))
            if found.get("format") != FORMAT:
                raise SystemExit(
                    f"{self._json}: another format than {FORMAT}; remove it and measure everything"
                    " again"
                )
            self._parts = {
                name: Part.of_json(part)
                for name, part in found["measurements"].items()
                if name in order
            }

    def replace(self, name: str, part: Part) -> bool:
        """Replaces a part and writes everything.

        If all of the new part was skipped, the old figures stay.
        """
        if not part.tables and name in self._parts:
            return False
        self._parts[name] = part
        self._parts = {name: self._parts[name] for name in self._order if name in self._parts}
        self.folder.mkdir(parents=True, exist_ok=True)
        content = {
            "format": FORMAT,
            "measurements": {name: part.to_json() for name, part in self._parts.items()},
        }
        self._json.write_text(
            json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        self.write_page()
        return True

    def show(self, name: str) -> str:
        """Returns a part in full as Markdown: every table, and what its figures mean."""
        part = self._parts.get(name)
        if part is None:
            return f"{name} has not been measured yet"
        conditions = ", ".join(f"{key} {value}" for key, value in part.conditions.items())
        return "\n".join([*part.markdown(), f"*{conditions}*"])

    def write_page(self) -> None:
        """Writes the page of bars, with the age that each figure has today, and the parts that have
        pages of their own.
        """
        page = "\n".join(self._page()) + "\n"
        (self.folder / "benchmarks.md").write_text(page, encoding="utf-8")
        for name in OWN_PAGES & self._parts.keys():
            page = self.show(name).replace("## ", "# ", 1) + "\n"
            (self.folder / f"{name}.md").write_text(page, encoding="utf-8")

    def part(self, name: str) -> Part | None:
        """Returns a part as it was measured last."""
        return self._parts.get(name)

    def _page(self) -> list[str]:
        lines = [
            "# Benchmarks",
            "",
            "Each row is a figure, the target it is compared with, and the version that was",
            "measured. All machines have two cores. `./scripts/bench` makes this page.",
            "`./scripts/bench NAME` measures one part again. `./scripts/bench --show NAME` prints",
            "all tables of a part from [benchmarks.json](benchmarks.json), with explanations.",
            "",
            f"† More than {OLD} commits have followed the measured version, or the version is",
            "unknown. The figure may no longer hold.",
            "",
            "Until 2026-11-28, fills and sessions used the engine `cached` unless a part names another.",
            "It is no more, and `gather` has taken its place.",
            "",
            "**relMSE** is the mean of (picture − reference)² / (reference² + 0.01·mean²), without",
            "the worst 0.1 % of pixels. **PSNR** is of the picture as displayed: clipped at the",
            "reference's 95th percentile, gamma 2.2. **Bias** is the relative error of the mean",
            "luminance over pixels no brighter than 20 times the reference's median.",
            "",
            "| part | bar | wanted | found | met | measured |",
            "|" + " --- |" * 6,
        ]
        for name, part in self._parts.items():
            measured = self._version(part)
            lines += [
                f"| {name} | {bar.what} | {bar.wanted} | {bar.figure} | {bar.verdict()} | {measured} |"
                for bar in part.bars
            ]
        lines += ["", "| part | what it measures | pictures |", "|" + " --- |" * 3]
        for name, part in self._parts.items():
            title = f"[{part.title}]({name}.md)" if name in OWN_PAGES else part.title
            pictures = (f"[{Path(plot.file).stem}]({plot.file})" for plot in part.plots)
            lines.append(f"| {name} | {title} | {', '.join(pictures)} |")
        return lines

    def _version(self, part: Part) -> str:
        """Returns the date, commit and processor of a part's figures, marked if they are old."""
        commit = part.conditions.get("commit", "unknown")
        date, age = version(self.folder, commit.split()[0])
        processor = part.conditions.get("CPU", "unknown").split("(")[0].strip()
        mark = "" if age is not None and age <= OLD else "†"
        return f"{part.conditions.get('date', date)} {commit[:7]} {processor}{mark}"
