"""Trajectories in files, and the conventions of their covariances: the program's `convert` and `doctor`."""

import os
import warnings

import numpy as np

from . import _core
from ._files import _reader, read_imu
from ._manifolds import SE3
from ._operate import as_numbers
from ._results import Result

_LAYOUTS = (None, "full36", "upper21", "lower21", "blocks12", "diag6")


def _choice(caller, name, value, allowed):
    if value not in allowed:
        raise ValueError(f"{caller}: {name}: expected one of {', '.join(map(repr, allowed))}, got {value!r}")


def _poses(caller, name, value):
    if not isinstance(value, SE3) or value.ndim != 1:
        shape = f" of shape {value.shape}" if hasattr(value, "shape") else ""
        raise TypeError(f"{caller}: {name}: expected SE3 of shape (n,), got {type(value).__name__}{shape}")
    return np.ascontiguousarray(value.params)


def _matrices(caller, value, n):
    """Matrices of a file; what is unknown is NaN."""
    matrices = as_numbers(value, f"{caller}: matrices", (6, 6))
    if matrices.shape not in ((6, 6), (n, 6, 6)):
        raise ValueError(f"{caller}: matrices: expected shape ({n}, 6, 6), got {matrices.shape}")
    return np.ascontiguousarray(np.broadcast_to(matrices, (n, 6, 6)))


def _times(caller, name, value, n):
    times = as_numbers(value, f"{caller}: {name}", ())
    if times.shape != (n,) or not (np.diff(times) > 0).all():
        raise ValueError(f"{caller}: {name}: expected {n} ascending times, each once")
    return np.ascontiguousarray(times)


def read_trajectory(
    path,
    convention=None,
    *,
    format="auto",
    covariance_file=None,
    layout=None,
    unmeasured_above=9e4,
    columns=None,
    ignore_unknown=False,
    norm_tolerance=1e-3,
    time_unit=None,
    duplicates=None,
    largest_file=1.0,
    frames=None,
):
    """Poses, times and covariances from a file of any format that the program reads (docs/formats.md).

    Parameters
    ----------
    path : str or path
        Of a bag with its topic: 'run.bag:/odom' (docs/bags.md).
    convention : str, optional
        That of the file's covariances, 'ros-fixed' or 'right,order=rt' (docs/which_convention.md); by default what the
        file or its format states. 'unknown' leaves the matrices as they are: `covariances` is None.
    format : str
        'auto' looks at the first lines; tum, kitti, euroc, csv, openvins, ros-json, ros-yaml, ros-csv, mavlink-json,
        mavlink-csv, matrix, colmap, g2o, toro, bag.
    covariance_file : str or path, optional
        A side file; by default the file's name with .cov after it, if there is one.
    layout : {'full36', 'upper21', 'lower21', 'blocks12', 'diag6'}, optional
        The numbers that follow TUM's eight.
    unmeasured_above : float
        Variances in messages from which on a component was not measured (m² or rad²).
    columns, ignore_unknown, norm_tolerance
        As in `read_features`.
    time_unit : {'s', 'ms', 'us', 'ns'}, optional
        Of stamps that are no seconds; stamps since 1970 are recognised.
    duplicates : {'drop', 'mean'}, optional
        Puts the rows in the order of their times, each time once; of a stamp with several poses the first is taken, or
        their mean. By default the rows are those of the file.
    largest_file : float
        Size of a text that is read, expanded, GB.
    frames : str, optional
        Of a bag without a topic: 'map:base_link', the pose of base_link in map by /tf and /tf_static.

    Returns
    -------
    Result
        `poses` (SE3), `times` (s) and `time_texts` (their digits), `covariances` (m² and rad², body axes, translation
        before rotation; NaN: unknown), `matrices` (as the file has them), `convention` in which they were read,
        `stated_convention` of the file, `order` that its format fixes, `format`, `lines`, `frames`, `notes`. Parts that
        the file does not have are None.

    Raises
    ------
    ValueError
        With file, line, what was found and what was expected; also where nothing says what the covariances mean.
    """
    caller = "read_trajectory"
    _choice(caller, "layout", layout, _LAYOUTS)
    _choice(caller, "time_unit", time_unit, (None, "s", "ms", "us", "ns"))
    _choice(caller, "duplicates", duplicates, (None, "drop", "mean"))
    if not 0 < largest_file < float("inf"):
        raise ValueError(f"{caller}: largest_file: expected a finite positive number, got {largest_file!r}")
    read = _reader(caller)
    _choice(caller, "format", format, _core.TRAJECTORY_FORMATS)
    d = read(
        os.fspath(path),
        convention or "",
        format,
        os.fspath(covariance_file or ""),
        layout or "",
        float(unmeasured_above),
        [f"{ours}={theirs}" for ours, theirs in (columns or {}).items()],
        bool(ignore_unknown),
        float(norm_tolerance),
        time_unit or "",
        duplicates or "",
        float(largest_file),
        frames or "",
    )
    return Result("trajectory of a file", poses=SE3._of(d.pop("poses")), **d)


def read_bag(path, topic=None, convention=None, *, frames=None, largest_file=1.0):
    """The topics of a bag of ROS 1 or 2, or what one of them has (docs/bags.md).

    Parameters
    ----------
    path : str or path
        A file .bag, .db3, .mcap, or .zstd around one, or the directory of a ROS 2 bag.
    topic : str, optional
        Of PoseStamped, PoseWithCovarianceStamped, Odometry, TransformStamped or Imu messages; nothing lists the topics.
    convention : str, optional
        That of the covariances, as in `read_trajectory`, 'ros-fixed' or 'ros-rpy'; 'unknown' leaves them as they are.
    frames : str, optional
        'map:base_link': the pose of base_link in map by /tf and /tf_static, or by the topic and its _static.
    largest_file : float
        GB that a .zstd file expands to.

    Returns
    -------
    Result
        As of `read_trajectory`, or of `read_imu`; without topic and frames `topics`, a list of Results with `topic`,
        `type`, `encoding`, `messages`, `first` and `last` (s, when they were recorded), and `notes`.

    Raises
    ------
    ValueError
        With file, number of the message, what was found and what was expected; where the module was built without the
        library that a bag needs, the package that has it.
    """
    path = os.fspath(path)
    if topic is None and frames is None:
        d = _reader("list_bag")(path, float(largest_file))
        return Result("bag", topics=[Result("topic", **t) for t in d["topics"]], notes=d["notes"])
    if frames is None:
        known = {t["topic"]: t["type"] for t in _reader("list_bag")(path, float(largest_file))["topics"]}
        if known.get(topic) == "sensor_msgs/Imu":
            return read_imu(f"{path}:{topic}")
    at = path if topic is None else f"{path}:{topic}"
    return read_trajectory(at, convention, frames=frames, largest_file=largest_file)


def read_pose_graph(path, *, ignore_unknown=False, norm_tolerance=1e-3):
    """Vertices and edges of a pose graph in a file of g2o or TORO.

    Returns
    -------
    Result
        `ids` and `poses` of the vertices; `sources`, `targets`, `measurements` (SE3, source_T_target) and `matrices` of
        the edges, as the file has them; `planar`, `stated_convention`, `lines` of the edges, `format`.
    """
    d = _reader("read_pose_graph")(os.fspath(path), bool(ignore_unknown), float(norm_tolerance))
    poses, measurements = SE3._of(d.pop("poses")), SE3._of(d.pop("measurements"))
    return Result("pose graph", poses=poses, measurements=measurements, **d)


def write_trajectory(
    path, poses, covariances=None, *, format, times=None, convention=None, source="right", frames=()
):
    """Writes poses and covariances as a file of another program.

    TUM, KITTI and EuRoC files get their covariances in `path`.cov.

    Parameters
    ----------
    path : str or path
    poses : SE3, shape (n,)
    covariances : array_like, shape (n, 6, 6), optional
        In the convention `source`, the library's by default; NaN: unknown.
    format : str
        As in `read_trajectory`.
    times : sequence, optional
        Seconds, as numbers or as texts whose digits are kept.
    convention : str, optional
        That of the file's covariances; 'right' by default where the file can say so, needed elsewhere.
    frames : sequence of str
        Name of the frame of ROS' messages.

    Returns
    -------
    Result
        `files` that were written, `conversion` (see `convert_trajectory`; None without covariances), `notes`.

    Raises
    ------
    ValueError
        Where a covariance is not one in the convention, or has no place in the format; nothing is written.
    """
    caller = "write_trajectory"
    params = _poses(caller, "poses", poses)
    write = _reader("format_trajectory")
    _choice(caller, "format", format, _core.WRITTEN_TRAJECTORY_FORMATS[1:])
    texts = [t if isinstance(t, str) else repr(float(t)) for t in (() if times is None else times)]
    if texts and len(texts) != len(params):
        raise ValueError(f"{caller}: {len(texts)} times of {len(params)} poses")
    target, conversion, matrices = "", None, None
    if covariances is not None:
        target = _core.convention_to_write(format, convention or "")
        conversion = _convert(caller, params, covariances, source, target)
        if conversion.faults:
            fault = conversion.faults[0]
            expected = fault.expected or "another convention"
            raise ValueError(f"{caller}: pose {fault.row}: {fault.found}, expected {expected}")
        matrices = conversion.matrices
        if conversion.decided is False:
            warnings.warn(f"liestat.{caller}: {conversion.sentence}", UserWarning, stacklevel=2)
    text, side, notes = write(params, matrices, texts, format, target, list(frames))
    files = [(os.fspath(path), text)] + ([(os.fspath(path) + ".cov", side)] if side else [])
    for name, content in reversed(files):
        with open(name, "w", encoding="utf-8", newline="") as file:
            file.write(content)
    return Result("written trajectory", files=[name for name, _ in files], conversion=conversion, notes=notes)


def convert_trajectory(
    poses, matrices, source, to="right", *, assume_uncorrelated=False, sampled=False, samples=2000, seed=1, lines=None
):
    """Covariances of poses, or of the edges of a graph, from one convention to another, and what is lost.

    Parameters
    ----------
    poses : SE3, shape (n,)
    matrices : array_like, shape (n, 6, 6)
        In the convention `source`, NaN for what is unknown: `read_trajectory(path).matrices`.
    source, to : str
        Conventions: 'right' is the library's; docs/which_convention.md has the others.
    assume_uncorrelated : bool
        Unknown correlations between known components are 0.
    sampled : bool
        Second moments by sampling, for rotations with a sigma above 0.1 rad.
    samples, seed : int
        Of `sampled`; samples for each pose.
    lines : sequence of int, optional
        Lines of the poses in a file, for sentences.

    Returns
    -------
    Result
        `matrices` in the convention `to`; `faults` (`row`, `fault`, `found`, `expected`) of those that could not be
        converted and are NaN; the fields of ``liestat convert --json`` (docs/program.md). The verdict: `sentence`, and
        `decided`, True, False (faults, indefinite matrices) or None (no covariances).

    Warns
    -----
    UserWarning
        Where the verdict is no.
    """
    caller = "convert_trajectory"
    params = _poses(caller, "poses", poses)
    result = _convert(caller, params, matrices, source, to, assume_uncorrelated, sampled, samples, seed, lines)
    if result.decided is False:
        warnings.warn(f"liestat.{caller}: {result.sentence}", UserWarning, stacklevel=2)
    return result


def _convert(
    caller, params, matrices, source, to, assume_uncorrelated=False, sampled=False, samples=2000, seed=1, lines=None
):
    lines = [] if lines is None else [int(line) for line in lines]
    if lines and len(lines) != len(params):
        raise ValueError(f"{caller}: {len(lines)} lines of {len(params)} poses")
    d = _core.convert_trajectory(
        params,
        _matrices(caller, matrices, len(params)),
        source,
        to,
        bool(assume_uncorrelated),
        bool(sampled),
        int(samples),
        int(seed),
        lines,
    )
    d["matrices"] = np.array(d["matrices"]).reshape(-1, 6, 6)
    return Result.of("conversion", d)


def diagnose_conventions(
    estimate,
    matrices,
    truth=None,
    *,
    times=None,
    truth_times=None,
    no_truth=False,
    plan=False,
    all_units=False,
    align="none",
    at=None,
    alpha=1e-3,
    order=None,
    content=None,
    edges=False,
    misfit=False,
    association="interpolate",
    interpolation="cubic",
    max_gap=None,
    max_difference=0.01,
    offset=0.0,
    start=None,
    end=None,
):
    """Which conventions explain the errors of poses under the matrices that a file gives for them.

    Parameters
    ----------
    estimate : SE3, shape (n,), or a list of them
        Several runs give one residual each, at one time.
    matrices : array_like, shape (n, 6, 6), or a list of them
        As the file has them: `read_trajectory(path, "unknown").matrices`.
    truth : SE3, shape (n,), or shape (m,) with times
    times, truth_times : array_like, optional
        Seconds, ascending; `times` is a list of them for several runs. Without `truth_times` row i belongs to row i.
    no_truth : bool
        Dead reckoning without a truth: the covariance may only grow.
    plan : bool
        What the file can decide, with how many poses; `all_units`: half and double angles and degrees too.
    align : {'none', 'posyaw', 'se3', 'sim3'}
        The truth is in another world.
    at : float, optional
        Seconds: the time of the residuals of several runs; the last common one.
    alpha : float
        Probability of rejecting the true convention.
    order : {'tr', 'rt'}, optional
        The order that the format fixes: `read_trajectory(path).order`.
    content : {'covariance', 'information', 'sigmas'}, optional
        The content that the format fixes; information for edges.
    edges : bool
        The poses are edges of a graph, and the truth their true relative poses.
    misfit : bool
        Of one run: look first for faults that are no noise, as `evaluate_trajectory` does.
    association : {'interpolate', 'nearest'}
        The truth at the times of the estimate, or its nearest stamps, at most `max_difference` (s) away.
    interpolation : {'cubic', 'geodesic', 'slerp'}
    max_gap : float, optional
        Seconds between two stamps of the truth to interpolate between; five median steps.
    offset : float
        Seconds that are added to `times`.
    start, end : float, optional
        Seconds: the part of the truth that is used.

    Returns
    -------
    Result
        The fields of ``liestat doctor --json`` (docs/program.md): `file_notes` (what reading has changed is in the
        `notes` of `read_trajectory`), and those of the diagnosis, or `chain`, or `plan`. The verdict in words is
        `sentence`; `decided` is True (one convention, and the errors follow it), False (they do not) or None
        (undecidable).
    """
    caller = "diagnose_conventions"
    _choice(caller, "align", align, ("none", "posyaw", "se3", "sim3"))
    _choice(caller, "order", order, (None, "tr", "rt"))
    _choice(caller, "content", content, (None, "covariance", "information", "sigmas"))
    _choice(caller, "association", association, ("interpolate", "nearest"))
    _choice(caller, "interpolation", interpolation, ("cubic", "geodesic", "slerp"))
    if not 1e-12 <= alpha <= 0.5:
        raise ValueError(f"{caller}: alpha: expected 1e-12 to 0.5, got {alpha}")
    if no_truth and plan:
        raise ValueError(f"{caller}: no_truth and plan exclude each other")
    if truth is None and not (no_truth or plan):
        raise ValueError(f"{caller}: no ground truth: expected truth, or no_truth=True, or plan=True")
    mode = "plan" if plan else "chain" if no_truth else "diagnosis"
    several = not isinstance(estimate, SE3)
    estimates, tables, stamps = (estimate, matrices, times) if several else ([estimate], [matrices], [times])
    stamps = [None] * len(estimates) if stamps is None else stamps
    if not len(estimates) == len(tables) == len(stamps):
        raise ValueError(f"{caller}: expected an estimate, matrices and times for each run")
    if len(estimates) > 1 and (mode != "diagnosis" or align != "none" or edges):
        raise ValueError(f"{caller}: several runs: expected a truth, runs in its world, and no edges")
    exact = at_truth = None
    if mode == "diagnosis":
        exact = _poses(caller, "truth", truth)
        if truth_times is not None:
            at_truth = _times(caller, "truth_times", truth_times, len(exact))
        elif start is not None or end is not None:
            raise ValueError(f"{caller}: start and end: expected truth_times")
    runs = []
    for run, table, run_times in zip(estimates, tables, stamps):
        params = _poses(caller, "estimate", run)
        table = _matrices(caller, table, len(params))
        run_times = None if run_times is None else _times(caller, "times", run_times, len(params))
        if at_truth is not None and run_times is None:
            raise ValueError(f"{caller}: truth_times without times")
        if exact is not None and at_truth is None and len(exact) != len(params):
            raise ValueError(f"{caller}: {len(exact)} true poses of {len(params)}, expected one for each, or times")
        runs.append((np.ascontiguousarray(params), np.ascontiguousarray(table), run_times))
    how = {"association": association, "interpolation": interpolation, "max_gap": max_gap}
    how |= {"max_difference": max_difference, "offset": offset, "start": start, "end": end}
    if edges and content is None:
        content = "information"
    at = None if at is None else float(at)
    d = _core.diagnose_conventions(
        *(runs, exact, at_truth, how, mode, align, float(alpha), at, bool(all_units)),
        *(order, content, bool(edges), bool(misfit)),
    )
    return Result.of("diagnosis", d)
