"""Tables in memory as the program reads them."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def is_table(value: Any) -> bool:
    """True for frames of pandas and polars, tables of Arrow, structured arrays of NumPy, and
    dictionaries of columns."""
    if isinstance(value, Mapping) or getattr(getattr(value, "dtype", None), "names", None):
        return True
    return hasattr(value, "columns") and hasattr(value, "__getitem__")


def write_table(table: Any, path: str) -> None:
    """Writes columns as CSV, numbers to the last digit; what is missing is an empty cell."""
    if any(name is not None for name in getattr(getattr(table, "index", None), "names", [])):
        # A named index of pandas is a column, too.
        table = table.reset_index()
    names = _names(table)
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


def _names(table: Any) -> list[Any]:
    if isinstance(table, Mapping):
        return list(table)
    # Columns themselves are what Arrow has under the other name.
    for name in ("column_names", "columns"):
        if hasattr(table, name):
            return list(getattr(table, name))
    return list(table.dtype.names)


def _values(column: Any) -> list[Any]:
    if isinstance(column, np.ndarray) and column.dtype.kind == "M":
        texts = np.datetime_as_string(column).tolist()
        return ["" if text == "NaT" else text for text in texts]
    for method in ("tolist", "to_pylist"):
        if hasattr(column, method):
            return [_cell(value) for value in getattr(column, method)()]
    return [_cell(value) for value in column]


def _cell(value: Any) -> Any:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    # The missing value of pandas' own types.
    if type(value).__name__ == "NAType":
        return ""
    # Times of pandas, polars and the standard library; those of pandas may be missing.
    if hasattr(value, "isoformat"):
        text = value.isoformat()
        return "" if text == "NaT" else text
    return value
