"""Learns the weights of the filter's network from examples, and writes them as Rust.

Usage: learn.py FOLDER WEIGHTS. FOLDER has files of `Gathered::examples`, whose documentation lists
the quantities.

The loss is the squared error of radiance as displayed (gamma 2.2, white at the 95th percentile)
beside other samples of the same square. Their noise is independent of the picture's, so the least
expected loss is that of the best picture (Lehtinen et al. 2018). It is taken at the picture's own
brightness, where the display's curve is nearly straight, so that this noise causes no bias.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import torch

SCALES, INPUTS, HIDDEN = 6, 15, 16
HEAD, OF_SCALE = 13, 4 + INPUTS
# The number of the input that has the significance of a scale's detail.
SIGNIFICANCE = 2
STEPS = 6000
# Files and examples of each step.
FILES, EXAMPLES = 6, 2048
RATE = 3e-3
LUMINANCE = torch.tensor([0.2126, 0.7152, 0.0722])
GAMMA = 2.2
# Radiance below this share of white is displayed by a straight line.
DARK = 1 / 400
# Largest displayed error of an example. Single paths may be very bright.
MOST_ERROR = 3.0
# Other samples at which an example counts by half.
CONFIRMED = 4.0


class Examples:
    """The examples of one file."""

    def __init__(self, path: Path) -> None:
        self.name = path.stem
        values = np.fromfile(path, np.float32).reshape(-1, HEAD + SCALES * OF_SCALE)
        self.values = torch.from_numpy(values)
        part = slice(None, None, 3)
        one, other = (self._radiance(self.values[part], self._scales(part)[:, n, :3]) for n in (2, 4))
        self.white = torch.quantile(other @ LUMINANCE, 0.95).item()
        # Files count by how much the choice of a scale matters in them.
        differ = (((one - other) * self._slope(other)) ** 2).sum(1)
        self.matter = differ.clamp(max=torch.quantile(differ, 0.98)).mean().item()

    def inputs(self) -> torch.Tensor:
        return self._scales(slice(None, None, 53))[..., 4:].reshape(-1, INPUTS)

    def loss(self, net: "Network", which: torch.Tensor | slice) -> torch.Tensor:
        values, scales = self.values[which], self._scales(which)
        # The square root of Wiener's share, as in `Detail::significant_share`.
        real = (2 ** scales[..., 4 + SIGNIFICANCE] - 2).clamp(min=1e-6)
        shares = net(scales[..., 4:]) * scales[..., 3] * (real / (real + 1)).sqrt()
        light = values[:, 10:13]
        for scale in reversed(range(SCALES)):
            light = light + shares[:, scale, None] * (scales[:, scale, :3] - light)
        found = self._radiance(values, light.clamp(min=0))
        true = self._radiance(values, values[:, 7:10])
        errors = ((found - true) * self._slope(found.detach())).clamp(-MOST_ERROR, MOST_ERROR)
        weights = values[:, 6] / (values[:, 6] + CONFIRMED)
        return ((errors * errors).sum(1) * weights).mean() / self.matter

    def _scales(self, which: torch.Tensor | slice) -> torch.Tensor:
        return self.values[which, HEAD:].reshape(-1, SCALES, OF_SCALE)

    @staticmethod
    def _radiance(values: torch.Tensor, light: torch.Tensor) -> torch.Tensor:
        return values[:, 3:6] + values[:, 0:3] * light

    def _slope(self, radiance: torch.Tensor) -> torch.Tensor:
        """Returns the slope of the display's curve; 0 for what is displayed as white."""
        shown = radiance / self.white
        slope = shown.clamp(DARK, 1) ** (1 / GAMMA - 1) / GAMMA
        return torch.where(shown < 1, slope, torch.zeros(())) / self.white


class Network(torch.nn.Module):
    """The network of filter/network.rs, with inputs scaled to similar sizes."""

    def __init__(self, inputs: torch.Tensor) -> None:
        super().__init__()
        self.mean, self.spread = inputs.mean(0), inputs.std(0) + 1e-3
        self.first = torch.nn.Linear(INPUTS, HIDDEN)
        self.second = torch.nn.Linear(HIDDEN, HIDDEN)
        self.last = torch.nn.Linear(HIDDEN, 1)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        units = torch.relu(self.first((inputs - self.mean) / self.spread))
        sums = self.last(torch.relu(self.second(units)))[..., 0]
        return 0.5 + 0.5 * sums / (1 + sums * sums).sqrt()

    def rust(self) -> str:
        """Returns the weights, with the scaling of the inputs in them."""
        first = self.first.weight / self.spread
        bias = self.first.bias - first @ self.mean
        return f"""//! The network's weights. Made by `scripts/train-filter`.

use super::size::{{HIDDEN, INPUTS}};

pub(super) const FIRST: [[f32; INPUTS]; HIDDEN] = {literal(first)};

pub(super) const FIRST_BIAS: [f32; HIDDEN] = {literal(bias)};

pub(super) const SECOND: [[f32; HIDDEN]; HIDDEN] = {literal(self.second.weight)};

pub(super) const SECOND_BIAS: [f32; HIDDEN] = {literal(self.second.bias)};

pub(super) const LAST: [f32; HIDDEN] = {literal(self.last.weight[0])};

pub(super) const LAST_BIAS: f32 = {literal(self.last.bias[0])};
"""


def literal(values: torch.Tensor) -> str:
    if values.dim():
        return f"[{', '.join(literal(value) for value in values)}]"
    text = f"{values.item():.6g}"
    return text if "." in text or "e" in text else f"{text}.0"


def main(folder: Path, target: Path) -> None:
    torch.manual_seed(0)
    numbers = np.random.default_rng(0)
    files = [Examples(path) for path in sorted(folder.glob("*.f32"))]
    net = Network(torch.cat([file.inputs() for file in files]))
    optimizer = torch.optim.Adam(net.parameters(), lr=RATE)
    rates = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS)
    total = 0.0
    for step in range(1, STEPS + 1):
        chosen = [files[n] for n in numbers.choice(len(files), min(FILES, len(files)), False)]
        loss = torch.zeros(())
        for file in chosen:
            which = torch.from_numpy(numbers.integers(0, len(file.values), EXAMPLES))
            loss = loss + file.loss(net, which) / len(chosen)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        rates.step()
        total += loss.item()
        if step % 500 == 0:
            print(f"step {step} of {STEPS}: loss {total / 500:.4f}, most of it noise", flush=True)
            total = 0.0
    with torch.no_grad():
        for file in files:
            loss = file.loss(net, slice(None, None, 3)).item()
            print(f"{file.name}: {len(file.values):,} examples, loss {loss:.3f}")
        target.write_text(net.rust(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
