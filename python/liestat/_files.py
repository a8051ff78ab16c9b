"""Files that the program reads, as arrays."""

import os

import numpy as np

from . import _core
from ._manifolds import R3, S2, SE3, SO3, Frame3, NonOrientedFrame3, SemiOrientedFrame3
from ._sensors import Result

_KINDS = {
    "point": R3,
    "rotation": SO3,
    "frame": Frame3,
    "direction": S2,
}
_POSES: tuple = (Frame3, SE3, SemiOrientedFrame3, NonOrientedFrame3)


def _reader(name):
    if not hasattr(_core, name):
        raise NotImplementedError(
            f"{name}: the module was built without the libraries that readers of files need: {{fmt}} and zlib, and for "
            "trajectories nlohmann/json and yaml-cpp"
        )
    return getattr(_core, name)


def read_features(
    path, kind=None, *, format="auto", norm_tolerance=1e-3, angles=None, ignore_unknown=False, columns=None
):
    """Features from a file of the program: CSV, TUM, EuRoC or KITTI (docs/program.md).

    Parameters
    ----------
    path : str or path
    kind : type, optional
        Of poses: Frame3 (default), SE3, SemiOrientedFrame3 or NonOrientedFrame3.
    format : str
        'auto' looks at the first lines.
    norm_tolerance : float
        Quaternions and directions off their norm by more are an error.
    angles : {'radians', 'degrees'}, optional
        Unit of rotation vectors.
    ignore_unknown : bool
        Pass over unknown columns.
    columns : dict, optional
        Names of columns that are not ours: ours to theirs.

    Returns
    -------
    Result
        `features`, `weights`, `times` (s), `covariances`, each None where the file has none, `lines`, `format`.

    Raises
    ------
    ValueError
        With file, line and what was expected.
    """
    d = _reader("read_features")(
        os.fspath(path),
        format,
        float(norm_tolerance),
        angles or "",
        bool(ignore_unknown),
        [f"{ours}={theirs}" for ours, theirs in (columns or {}).items()],
    )
    of_file = _KINDS[d["kind"]]
    if kind is not None and kind is not of_file and not (of_file is Frame3 and kind in _POSES):
        raise ValueError(f"read_features: {path} has {of_file.__name__}, not {kind.__name__}")
    if of_file is Frame3:
        params = np.concatenate([d["rotations"], d["positions"]], axis=1)
    else:
        params = d[{R3: "positions", SO3: "rotations", S2: "directions"}[of_file]]

    def present(array):
        return array if array.size else None

    return Result(
        "features of a file",
        features=(kind or of_file)._of(params),
        weights=present(d["weights"]),
        times=present(d["times"]),
        covariances=present(d["covariances"]),
        lines=d["lines"],
        format=d["format"],
    )


def read_imu(path):
    """Readings of an inertial sensor from EuRoC's format or CSV with t wx wy wz ax ay az.

    Returns
    -------
    Result
        `times` (s, since `start_ns`), `rates` (rad/s), `forces` (m/s²), `start_ns`, `format`.
    """
    d = _reader("read_imu")(os.fspath(path))
    r = d["readings"]
    return Result(
        "inertial readings",
        times=r[:, 0].copy(),
        rates=r[:, 1:4].copy(),
        forces=r[:, 4:7].copy(),
        start_ns=d["start_ns"],
        format=d["format"],
    )


def read_tracks(path, image_times="", *, start_ns=0):
    """Tracks of points in images: CSV with frame, track, u, v and t_s, or a file of image times beside it.

    Returns
    -------
    Result
        `image_times` (s, less `start_ns`), and for each observation `images` (index into the times), `tracks` (counted
        from 0), `pixels`; `frames` and `track_ids` are the numbers in the file.
    """
    return Result("tracks", **_reader("read_tracks")(os.fspath(path), os.fspath(image_times), int(start_ns)))
