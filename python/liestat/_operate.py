"""Calls of the compiled operations with arrays of any shape."""

import math

import numpy as np

from . import _core


def as_numbers(value, name, tail):
    """`value` as float64 with the trailing shape `tail`, without a copy where it is one already."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: expected numbers, got {type(value).__name__}: {error}") from None
    if array.dtype.byteorder not in "=|" or not array.flags.aligned:
        array = np.array(array, dtype=np.float64)
    n = len(tail)
    if array.ndim < n or array.shape[array.ndim - n :] != tail:
        wanted = "(" + ", ".join(["...", *map(str, tail)]) + ")"
        raise ValueError(f"{name}: expected shape {wanted}, got {array.shape}")
    return array


def require_finite(array, name):
    """Raises where an array has NaN or an infinity."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}, shape {array.shape}: not finite at index {where}")
    return array


def _rows(array, lead, tail, full, n):
    columns = math.prod(tail)
    if lead == full:
        rows = array.reshape(n, columns)
    elif math.prod(lead) == 1:
        rows = array.reshape(1, columns)
    else:
        rows = np.broadcast_to(array, full + tail).reshape(n, columns)
    if columns > 1 and rows.strides[1] != 8:
        rows = np.ascontiguousarray(rows)
    return rows


def operate(operation, caller, operands, result_tail, threads=1):
    """Calls an operation by NumPy's rules of broadcasting.

    `operands` are tuples (name, array, trailing shape); the result has the shape of all the leading axes together,
    followed by `result_tail`.
    """
    leads = [array.shape[: array.ndim - len(tail)] for _, array, tail in operands]
    full = leads[0]
    for lead in leads[1:]:
        if lead != full:
            try:
                full = np.broadcast_shapes(*leads)
            except ValueError:
                shapes = " and ".join(f"{name} {lead}" for (name, _, _), lead in zip(operands, leads))
                raise ValueError(f"{caller}: shapes of {shapes} do not broadcast") from None
            break
    n = math.prod(full)
    rows = [_rows(array, lead, tail, full, n) for (_, array, tail), lead in zip(operands, leads)]
    try:
        result = operation(*rows, n=n, threads=threads)
    except _core.NotFinite as error:
        operand, row = error.args
        name, array, tail = operands[operand]
        lead = leads[operand]
        index = np.unravel_index(row, full) if full else ()
        # An axis that was broadcast has one entry in the caller's array.
        index = index[len(full) - len(lead) :]
        index = tuple(int(i) if size != 1 else 0 for i, size in zip(index, lead))
        where = f" at index {index}" if index else ""
        raise ValueError(f"{caller}: {name}, shape {array.shape}, is not finite{where}") from None
    return result.reshape(full + result_tail)
