"""Columns by name, for pandas, polars, structured arrays and dictionaries."""

import numpy as np

from ._manifolds import R3, S2, SE3, SE23, SO3, Frame3, NonOrientedFrame3, SemiOrientedFrame3
from ._operate import require_finite
from ._statistics import require_manifold

_QUATERNION = ("qx", "qy", "qz", "qw")
_POSE = (*_QUATERNION, "tx", "ty", "tz")
#: Names of the parameters, those of the program's files.
_NAMES = {
    SO3: _QUATERNION,
    SE3: _POSE,
    Frame3: _POSE,
    SemiOrientedFrame3: _POSE,
    NonOrientedFrame3: _POSE,
    SE23: (*_QUATERNION, "px", "py", "pz", "vx", "vy", "vz"),
    S2: ("dx", "dy", "dz"),
    R3: ("x", "y", "z"),
}


def _names(kind):
    for base, names in _NAMES.items():
        if issubclass(kind, base):
            return names
    raise TypeError(f"columns of {kind.__name__} have no names")


def columns(x):
    """The parameters as columns by name, the program's: ``pandas.DataFrame(columns(x))``.

    Parameters
    ----------
    x : SO3, SE3, SE23, S2, R3 or frames, shape (n,)

    Returns
    -------
    dict of str to ndarray, shape (n,)
        qx qy qz qw of rotations; with tx ty tz of poses; px py pz vx vy vz; dx dy dz of directions; x y z of points.
    """
    x = require_manifold(x, "columns")
    if x.ndim != 1:
        raise ValueError(f"columns: x: expected shape (n,), got {x.shape}")
    return {name: x.params[:, i].copy() for i, name in enumerate(_names(type(x)))}


def from_columns(kind, table):
    """Elements from columns by name; other columns are ignored.

    Parameters
    ----------
    kind : type
        SO3, SE3, SE23, S2, R3 or a frame.
    table : mapping, pandas or polars DataFrame, or structured array
        With the columns that `columns` gives. Quaternions and directions are normalised.

    Returns
    -------
    kind, shape (n,)
    """
    names = _names(kind)
    parts = []
    for name in names:
        try:
            part = np.asarray(table[name], dtype=np.float64)
        except Exception as error:
            needs = f"{kind.__name__} needs the columns {' '.join(names)}"
            raise ValueError(f"from_columns: {needs}; {name}: {error}") from None
        if part.ndim != 1:
            raise ValueError(f"from_columns: {name}: expected shape (n,), got {part.shape}")
        require_finite(part, f"from_columns: {name}")
        parts.append(part)
    if len({len(part) for part in parts}) > 1:
        raise ValueError(f"from_columns: lengths differ: {', '.join(f'{n} {len(p)}' for n, p in zip(names, parts))}")
    params = np.stack(parts, axis=1)
    unit = params[:, kind._unit]
    if unit.shape[1]:
        norm = np.linalg.norm(unit, axis=1)
        if not (norm > 0).all():
            raise ValueError(f"from_columns: row {int(np.argmin(norm))}: {' '.join(names[kind._unit])} are zero")
        params[:, kind._unit] = unit / norm[:, None]
    return kind(params)
