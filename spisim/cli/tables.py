"""Tables of results for people."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from reconstruction.depth import DEPTH_METHODS
from reconstruction.image import image_method

from .console import results


def print_errors(metrics: Mapping[str, Any]) -> None:
    """Print image, range and depth errors, as `reconstruction.evaluate` returns them."""
    images = metrics["images"].values()
    table = plain_table("image", *(image_method(name).title for name in metrics["images"]))
    names = {"correlation": "correlation", "nrmse": "NRMSE", "psnr_db": "PSNR, dB"}
    for key, name in names.items():
        table.add_row(name, *(_number(values[key]) for values in images))
    results.print(table)
    error = _percent(metrics["truth"]["image_error"])
    results.print(f"standard error of the true image, RMS: {error}\n", style="dim")
    for spots in metrics["spots"].values():
        table = plain_table("spot", "true, m", "measured, m", "error, cm", "sigma, cm")
        for k, spot in enumerate(spots):
            measured = _number(spot["range_m"]) if spot["status"] == "ok" else spot["status"]
            metres = _number(spot["true_m"]), measured
            centimetres = (_centimetres(spot[key]) for key in ("error_m", "sigma_m"))
            table.add_row(str(k), *metres, *centimetres)
        results.print(table)
    if metrics["depths"]:
        maps = metrics["depths"].items()
        table = plain_table("depth", *(DEPTH_METHODS[name].title for name, _ in maps))
        names = {"mae_m": "mean error, m", "rmse_m": "RMS error, m"}
        shares = {
            "median_relative": "median error",
            "within_25_percent": "within 25 % of truth",
            "coverage": "pixels with a value",
        }
        for key, name in names.items():
            table.add_row(name, *(_number(values[key]) for _, values in maps))
        for key, name in shares.items():
            table.add_row(name, *(_percent(values[key]) for _, values in maps))
        results.print(table)


def plain_table(first: str, *columns: str, least: int = 11) -> Table:
    """A table without lines: a column of words, and others for numbers of `least` characters."""
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    table.add_column(first, min_width=21)
    for column in columns:
        width = max(least, *(len(word) for word in column.split()))
        table.add_column(column, justify="right", min_width=width)
    return table


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def _centimetres(value_m: float | None) -> str:
    return "–" if value_m is None else f"{100 * value_m:.1f}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"
