"""Small plots as SVG: error over seconds, both logarithmic, and decibels over seconds, both linear.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 640, 380
LEFT, RIGHT, TOP, BOTTOM = 64, 24, 60, 48
COLOURS = ("#1f6feb", "#d1662b", "#2f8f5b", "#8250df", "#b02a6f")
# Greatest width of a name in the legend.
LEGEND = 140
INK, FAINT = "#24292f", "#d8dee4"

Series = dict[str, list[tuple[float, float]]]


class Axis:
    """A logarithmic axis over whole decades or parts of them, mapped to pixels."""

    def __init__(self, values: list[float], start: float, end: float) -> None:
        low, high = math.log10(min(values)), math.log10(max(values))
        margin = max(0.06 * (high - low), 0.05)
        self._low, self._high = low - margin, high + margin
        self._start, self._end = start, end

    def at(self, value: float) -> float:
        share = (math.log10(value) - self._low) / (self._high - self._low)
        return self._start + share * (self._end - self._start)

    def ticks(self) -> list[float]:
        """Returns powers of ten; if there are few, also twice and five times these."""
        decades = range(math.floor(self._low), math.ceil(self._high) + 1)
        steps = (1, 2, 5) if self._high - self._low < 2.5 else (1,)
        ticks = [step * 10.0**decade for decade in decades for step in steps]
        return [tick for tick in ticks if self._low <= math.log10(tick) <= self._high]


class Linear:
    """A linear axis over the values and a margin, mapped to pixels."""

    def __init__(self, values: list[float], start: float, end: float) -> None:
        low, high = min(values), max(values)
        margin = max(0.04 * (high - low), 0.01)
        self._low, self._high = low - margin, high + margin
        self._start, self._end = start, end

    def at(self, value: float) -> float:
        return self._start + (value - self._low) / (self._high - self._low) * (
            self._end - self._start
        )

    def ticks(self) -> list[float]:
        """Returns multiples of 1, 2 or 5 times a power of ten; at most ten."""
        size = 10.0 ** math.floor(math.log10((self._high - self._low) / 10))
        step = next(
            size * part for part in (1, 2, 5, 10) if size * part * 10 >= self._high - self._low
        )
        return [
            step * number
            for number in range(math.ceil(self._low / step), math.floor(self._high / step) + 1)
        ]


def error_over_seconds(path: Path, title: str, series: Series) -> None:
    """Draws one line per series, with a legend. Points that are not positive are left out."""
    series = {
        name: [(x, y) for x, y in points if x > 0 and y > 0] for name, points in series.items()
    }
    _draw(path, title, series, (Axis, Axis), "relMSE")


def decibels_over_seconds(
    path: Path, title: str, series: Series, across: type[Axis] | type[Linear] = Linear
) -> None:
    """Draws one line per series, with a legend. Seconds are linear unless `across` says otherwise.
    """
    _draw(path, title, series, (across, Linear), "PSNR, dB")


def _draw(
    path: Path, title: str, series: Series,
    axes: tuple[type[Axis] | type[Linear], type[Axis] | type[Linear]], upwards: str
) -> None:
    points = [point for line in series.values() for point in line]
    if not points:
        return
    across = axes[0]([x for x, _ in points], LEFT, WIDTH - RIGHT)
    up = axes[1]([y for _, y in points], HEIGHT - BOTTOM, TOP)
    legend = min(LEGEND, (WIDTH - LEFT - RIGHT) / len(series))
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"',
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="6" fill="white"/>',
        _text(LEFT, 24, title, 'font-size="14" font-weight="600"'),
        *_grid(across, up, upwards),
        *(
            part
            for number, line in enumerate(series.items())
            for part in _line(number, *line, across, up, legend)
        ),
        "</svg>\n",
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(parts), encoding="utf-8")


def _grid(across: Axis | Linear, up: Axis | Linear, upwards: str) -> list[str]:
    parts = []
    for tick in across.ticks():
        x = across.at(tick)
        parts.append(f'<path d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="{FAINT}"/>')
        parts.append(_text(x, HEIGHT - BOTTOM + 18, f"{tick:g}", 'text-anchor="middle"'))
    for tick in up.ticks():
        y = up.at(tick)
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="{FAINT}"/>')
        parts.append(_text(LEFT - 8, y + 4, f"{tick:g}", 'text-anchor="end"'))
    parts.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, "seconds", 'text-anchor="middle"'))
    middle = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(
        _text(16, middle, upwards, f'text-anchor="middle" transform="rotate(-90 16 {middle:.1f})"')
    )
    return parts


def _line(
    number: int,
    name: str,
    points: list[tuple[float, float]],
    across: Axis | Linear,
    up: Axis | Linear,
    legend: float,
) -> list[str]:
    colour = COLOURS[number % len(COLOURS)]
    placed = [(across.at(x), up.at(y)) for x, y in sorted(points)]
    path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in placed)
    parts = [
        f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2" stroke-linejoin="round"/>'
    ]
    parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>' for x, y in placed]
    # The legend lies between title and plot, where no line can cross it.
    x = LEFT + legend * number
    parts.append(f'<circle cx="{x + 4}" cy="44" r="4" fill="{colour}"/>')
    parts.append(_text(x + 14, 48, name, ""))
    return parts


def _text(x: float, y: float, text: str, attributes: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{INK}" {attributes}>{escape(text)}</text>'
