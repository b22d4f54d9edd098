"""The document: figures as JSON, and Markdown made from them.

Invariants: everything in the Markdown is also in the JSON. Repeating a measurement replaces only
its own part of both.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

Figure = float | int | str | None

FORMAT = 1


@dataclass
class Table:
    """Rows of figures. A column is its heading and the format of its numbers (as in Python's
    `format`).
    """

    title: str
    columns: list[list[str]]
    rows: list[list[Figure]] = field(default_factory=list)

    def markdown(self) -> list[str]:
        formats = [spec for _, spec in self.columns]
        lines = [f"**{self.title}**", ""] if self.title else []
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
    """`benchmarks.json` in a folder, and `benchmarks.md` made from it; plots go into `benchmarks/`.
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
            "measurements": {name: asdict(part) for name, part in self._parts.items()},
        }
        self._json.write_text(
            json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        (self.folder / "benchmarks.md").write_text("\n".join(self._markdown()), encoding="utf-8")
        return True

    def _markdown(self) -> list[str]:
        lines = [
            "# Benchmarks",
            "",
            (
                "Made by `./scripts/bench` out of [benchmarks.json](benchmarks.json), which has the"
                " figures in full. `./scripts/bench NAME` measures one part again; `--list` names"
                " them."
            ),
            "",
            (
                "**relMSE** is the mean of (picture − reference)² / (reference² + 0.01·mean²),"
                " without the worst 0.1 % of pixels. **PSNR** is of the picture as displayed:"
                " clipped at the reference's 95th percentile, gamma 2.2. **Bias** is the relative"
                " error of the mean luminance over pixels no brighter than 20 times the reference's"
                " median. **The original** is Radiance 6.1 (rholo, rhpict), measured on another day"
                " on a 2-core machine of the same kind: ratios to it are not exact."
            ),
            "",
        ]
        bars = [(part.title, bar) for part in self._parts.values() for bar in part.bars]
        if bars:
            lines += ["## At a glance", ""]
            lines += ["| measurement | bar | wanted | found | met |", "|" + " --- |" * 5]
            for title, bar in bars:
                lines.append(
                    f"| {title} | {bar.what} | {bar.wanted} | {bar.figure} | {bar.verdict()} |"
                )
            lines.append("")
        lines += ["## Machine", "", *self._conditions()]
        for part in self._parts.values():
            lines += part.markdown()
        return lines

    def _conditions(self) -> list[str]:
        grouped: dict[tuple[tuple[str, str], ...], list[str]] = {}
        for name, part in self._parts.items():
            grouped.setdefault(tuple(part.conditions.items()), []).append(name)
        keys = list(dict.fromkeys(key for conditions in grouped for key, _ in conditions))
        table = Table("", [["measured", ""], *([key, ""] for key in keys)])
        for conditions, names in grouped.items():
            measured = "everything" if len(grouped) == 1 else ", ".join(names)
            table.rows.append([measured, *(dict(conditions).get(key) for key in keys)])
        return table.markdown()
