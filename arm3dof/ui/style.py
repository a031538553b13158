"""One look for all figures: colours that colour-blind readers can tell apart, quiet axes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

# Okabe and Ito's palette without its yellow, which is too pale for a line on white
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DARK_COLORS = ("#56B4E9", "#FF9052", "#2FD0A2", "#E29BC4", "#F5C04A", "#9BD4F5", "#E6EBF1")
DASHES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))  # for more joints than colours

INK = "#18222F"
SOFT = "#5B6878"
GRID = "#E3E8ED"
LIMIT = "#9C1C1C"
SETTLED = "#00694E"
SETTLED_BAND = "#D8F1E8"

STYLE: Mapping[Any, Any] = MappingProxyType(
    {
        "figure.dpi": 150,
        "figure.facecolor": "white",
        "savefig.facecolor": "white",
        "font.family": "DejaVu Sans",
        "font.size": 9.5,
        "text.color": INK,
        "axes.titlesize": 11.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.titlepad": 10,
        "axes.labelsize": 9.5,
        "axes.labelcolor": INK,
        "axes.edgecolor": SOFT,
        "axes.linewidth": 0.8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.xmargin": 0,
        "grid.color": GRID,
        "grid.linewidth": 0.8,
        "xtick.color": SOFT,
        "ytick.color": SOFT,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "lines.linewidth": 1.8,
        "lines.solid_capstyle": "round",
        "legend.frameon": False,
        "legend.fontsize": 9.5,
    }
)
