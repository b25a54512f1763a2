"""Tables in memory as the program reads them."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from typing import Any


def is_table(value: Any) -> bool:
    """True for frames of pandas and polars, and for dictionaries of columns."""
    return isinstance(value, Mapping) or (
        hasattr(value, "columns") and hasattr(value, "__getitem__")
    )


def write_table(table: Any, path: str) -> None:
    """Writes columns as CSV, numbers to the last digit; what is missing is an empty cell."""
    names = list(table) if isinstance(table, Mapping) else list(table.columns)
    columns = [_values(table[name]) for name in names]
    lengths = {len(column) for column in columns}
    if len(lengths) > 1:
        counts = ", ".join(f"{name}: {len(each)}" for name, each in zip(names, columns))
        raise ValueError(f"the columns of the table differ in length ({counts})")
    if not names:
        raise ValueError("the table has no columns")
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(str(name) for name in names)
        writer.writerows(zip(*columns))


def _values(column: Any) -> list[Any]:
    values = column.tolist() if hasattr(column, "tolist") else list(column)
    return [_cell(value) for value in values]


def _cell(value: Any) -> Any:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    # Times of pandas, polars and the standard library; those of pandas may be missing.
    if hasattr(value, "isoformat"):
        text = value.isoformat()
        return "" if text == "NaT" else text
    return value
