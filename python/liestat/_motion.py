"""Recursive motion from point tracks."""

import warnings

import numpy as np

from . import _core
from ._manifolds import S2, SE3, SO3
from ._results import Result
from ._sensors import _rows, _same_length
from ._statistics import _covariances

# Shapes of a frame's row in the series.
_ROWS = {"direction": (3,), "direction_covariance": (2, 2), "rotation": (4,), "rotation_covariance": (3, 3)}
# Remedies for faults of the options.
_REMEDIES = {
    "the composition takes successive frames": "filter 'subspace' or 'essential' with frames_apart",
    "a bias is that of a gyroscope, and there is none": "a gyroscope",
    "no time passes between frames": "seconds above zero",
}


def _choice(value, name, choices):
    if value not in choices:
        raise ValueError(f"motion: {name}: expected one of {', '.join(map(repr, choices))}, got {value!r}")
    return choices.index(value)


def _deprecated(old, new):
    warnings.warn(f"liestat.motion: {old} is {new} now", DeprecationWarning, stacklevel=3)


def motion(
    frames,
    tracks,
    points,
    sigma,
    *,
    flow="automatic",
    filter="automatic",
    frames_apart=1,
    starts=32,
    outliers=False,
    bias=False,
    bias_sigma=0.02,
    process_noise=1e-5,
    rotation_noise=1e-6,
    passes=1,
    gyroscope=None,
    gyroscope_covariance=None,
    seconds=1.0,
    truth=None,
    min_motion=0.1,
    span=None,
    essential=None,
):
    """Direction of motion and rotation of a camera, frame by frame, from point tracks.

    Options, defaults and results are those of the program's `liestat motion`.

    Parameters
    ----------
    frames, tracks : array_like of int, shape (n,)
        Which frame (0 to the last, in any order) and which track each point belongs to.
    points : array_like, shape (n, 2)
        Calibrated coordinates, (pixel - centre) / focal length.
    sigma : float
        Their standard deviation.
    flow : {'automatic', 'forward', 'midpoint', 'discrete'}
        How two positions of a point become its flow; automatic: midpoint, with a gyroscope discrete.
    filter : {'automatic', 'composition', 'subspace', 'essential'}
        composition: the subspace filter until it has settled, then the essential filter. It takes successive frames;
        automatic is the composition for them, and the subspace filter with `frames_apart` above 1.
    frames_apart : int
        Pairs join a track's newest position with its oldest within so many frames. Results are per frame all the same.
    starts : int
        Directions to start from.
    outliers : bool
        Expect wrong tracks.
    bias : bool
        The gyroscope's bias is a state.
    bias_sigma : float
        rad/s, of the bias at the start.
    process_noise, rotation_noise : float
        rad² per frame of the direction (1e-5 nearly constant, 1e-3 manoeuvring) and of the rotation.
    passes : int
        Run a short sequence again from its own end.
    gyroscope : array_like, shape (m, 3), optional
        Apparent rotation vector of the points from the frame before to each frame, rad, for any `frames_apart`: the
        prior of an interval is made of them. The first one is not used.
    gyroscope_covariance : array_like, shape (3, 3) or (m, 3, 3), optional
        rad², of each.
    seconds : float
        Between two frames: the unit of the bias and of `bias_sigma`.
    truth : SE3, shape (m,), optional
        Poses of the camera (world_T_camera, m) for each frame, to compare with.
    min_motion : float
        m; directions of less are not compared.
    span, essential :
        Deprecated: `frames_apart`, and `filter` 'composition' (True) or 'subspace' (False).

    Returns
    -------
    Result
        The fields of the program's JSON: `status`, `verdict` with `causes`, `frames_usable`, `hand_overs`,
        `fall_backs`, … and `frames`, a list with the fields of each frame after the first.

        Beside them arrays with one row for each frame from 0 on (frames up to the first one with points are not
        usable): `usable`, `direction` (S2) with `direction_covariance` (m, 2, 2), `meaning` ('velocity' or
        'translation': of what the direction is, and in which axes), `rotation` (SO3, second_R_first over one frame)
        with `rotation_covariance` (m, 3, 3), `mean_inverse_depth`, `sign_evidence`, `innovation`, `pairs`, `inliers`,
        `filter` (in charge), `covariance_judged`, and the flags `bad_input`, `too_few`, `standstill`, `degenerate`,
        `ambiguous`, `undecided_sign`, `lost`, `misfit`, `gyroscope_refuted`, `outliers`. `ok` is a deprecated name of
        `usable`.

        A velocity is per frame, in the axes half-way through the interval of the pairs; a translation is that over the
        interval, in the axes at its end.

    Raises
    ------
    ValueError
        If no filter serves the options: the composition with `frames_apart` above 1, a bias without a gyroscope.
    """
    if span is not None:
        _deprecated("span", "frames_apart")
        frames_apart = span
    if essential is not None:
        _deprecated("essential", "filter='composition' or 'subspace'")
        filter = "composition" if essential else "subspace"
    f = np.asarray(frames)
    t = np.asarray(tracks)
    p = _rows(points, "motion: points", 2)
    for name, value in (("frames", f), ("tracks", t)):
        if value.ndim != 1 or not np.issubdtype(value.dtype, np.integer) or (value < 0).any():
            found = f"{value.dtype} {value.shape}"
            raise ValueError(f"motion: {name}: expected integers of shape (n,), none negative, got {found}")
    _same_length("motion", frames=f, tracks=t, points=p)
    for name, value in (("sigma", sigma), ("bias_sigma", bias_sigma)):
        if not value > 0:
            raise ValueError(f"motion: {name}: expected a positive number, got {value}")
    for name, value in (("frames_apart", frames_apart), ("starts", starts), ("passes", passes)):
        if not value >= 1:
            raise ValueError(f"motion: {name}: expected 1 or more, got {value}")
    n = int(f.max()) + 1 if len(f) else 0
    order = np.argsort(f, kind="stable")
    offsets = np.searchsorted(f[order], np.arange(n + 1)).astype(np.int64)
    g, c = np.empty((0, 3)), np.empty((0, 3, 3))
    if gyroscope is not None:
        g = _rows(gyroscope, "motion: gyroscope", 3)
        if len(g) != n:
            raise ValueError(f"motion: gyroscope: expected shape ({n}, 3), one for each frame, got {g.shape}")
        if gyroscope_covariance is None:
            raise ValueError("motion: gyroscope_covariance is missing")
        c = np.ascontiguousarray(
            np.broadcast_to(_covariances(gyroscope_covariance, "motion: gyroscope_covariance", SO3, (n,)), (n, 3, 3))
        )
    R, centres = np.empty((0, 3, 3)), np.empty((0, 3))
    if truth is not None:
        if not isinstance(truth, SE3) or truth.shape != (n,):
            raise ValueError(f"motion: truth: expected SE3 of shape ({n},), one for each frame")
        R = np.ascontiguousarray(truth.rotation.inv().as_matrix())
        centres = np.ascontiguousarray(truth.translation)
    d = _core.motion(
        offsets,
        np.ascontiguousarray(t[order], dtype=np.int64),
        np.ascontiguousarray(p[order]),
        float(sigma),
        _choice(flow, "flow", _core.motion_flows),
        _choice(filter, "filter", _core.motion_filters),
        int(frames_apart),
        int(starts),
        bool(outliers),
        bool(bias),
        float(bias_sigma),
        float(process_noise),
        float(rotation_noise),
        int(passes),
        g,
        c,
        float(seconds),
        R,
        centres,
        float(min_motion),
    )
    fault = d.pop("fault")
    if fault:
        raise ValueError(f"motion: {fault}, expected {_REMEDIES[fault]}")
    for name, shape in _ROWS.items():
        d[name] = np.array(d[name], dtype=np.float64).reshape(-1, *shape)
    for name in ("meaning", "filter"):
        d[name] = np.array(d[name], dtype=str)
    d["direction"] = S2._of(d["direction"])
    d["rotation"] = SO3._of(d["rotation"])
    return Result.of("motion of a camera", d, {"ok": "usable"})
