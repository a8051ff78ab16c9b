"""Files that the program reads, as arrays."""

import os

import numpy as np

from . import _core
from ._manifolds import R3, S2, SE3, SE23, SO2, SO3, Frame3, NonOrientedFrame3, SemiOrientedFrame3
from ._results import Result
from ._sensors import Camera

_KINDS = {
    "point": R3,
    "rotation": SO3,
    "frame": Frame3,
    "direction": S2,
    "heading": SO2,
}
_POSES: tuple = (Frame3, SE3, SemiOrientedFrame3, NonOrientedFrame3)


def _reader(name):
    if not hasattr(_core, name):
        raise NotImplementedError(
            f"{name}: the module was built without the libraries that readers of files need: {{fmt}}, zlib, nlohmann/json "
            "and yaml-cpp"
        )
    return getattr(_core, name)


def read_features(
    path, kind=None, *, format="auto", norm_tolerance=1e-3, angles=None, ignore_unknown=False, columns=None
):
    """Features from a file of the program: CSV, TUM, EuRoC or KITTI (docs/formats.md).

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
        params = d[{R3: "positions", SO3: "rotations", S2: "directions", SO2: "headings"}[of_file]]

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


def find_recording(folder, camera=None):
    """The files of a recording as it lies on disk: EuRoC's mav0, or images and a CSV of readings (docs/euroc_folder.md).

    Parameters
    ----------
    folder : str or path
    camera : str, optional
        The name of a folder of images; the first by default.

    Returns
    -------
    Result
        `images` (a folder, for `track`), `image_times`, `imu` (for `read_imu`), `truth` (for `read_ground_truth`), each
        None where there is none; `calibration` (a list, for `read_calibration`), `camera`, `notes`.
    """
    d = _reader("find_recording")(os.fspath(folder), camera or "")
    return Result("files of a recording", **{name: value if value != "" else None for name, value in d.items()})


def read_imu(path):
    """Readings of an inertial sensor from EuRoC's format, CSV with t wx wy wz ax ay az, or a bag ('run.bag:/imu').

    Returns
    -------
    Result
        `times` (s, since `start_ns`), `rates` (rad/s), `forces` (m/s²), `start_ns`, `format`, `notes`.
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
        notes=d["notes"],
    )


def read_tracks(path, image_times="", *, start_ns=0):
    """Tracks of points in images: CSV with frame, track, u, v and t_s, or a file of image times beside it.

    Returns
    -------
    Result
        `image_times` (s, less `start_ns`), and for each observation `images` (index into the times), `tracks` (counted
        from 0), `pixels`, and `sigmas` (px) where the file has them; `frames` and `track_ids` are the numbers in the file.
    """
    return Result("tracks", **_reader("read_tracks")(os.fspath(path), os.fspath(image_times), int(start_ns)))


def track(paths, times="", *, every=1, tracks=300, least=8):
    """Tracks of corners through a video, a folder of images, or a list of them, with a standard deviation for each point.

    `times`: CSV frame,t_s or EuRoC's data.csv; `every`: takes one image of so many; `tracks`: at a time; `least`: images
    that must show a track. Raises ValueError, also where liestat was built without OpenCV (the message names the packages).

    Returns
    -------
    Result
        As `read_tracks`: `image_times` (s; NaN where not known), `frames`, and for each observation `images`, `tracks`,
        `pixels`, `sigmas` (px, of u and of v).
    """
    if every < 1 or tracks < 1 or least < 2:
        raise ValueError("every and tracks are 1 or more, least 2 or more")
    names = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    arguments = [os.fspath(p) for p in names], os.fspath(times), int(every), int(tracks), int(least)
    return Result("tracks", **_reader("track")(*arguments))


def read_calibration(*paths):
    """Cameras and noise of an inertial sensor, from one YAML file or several that belong together.

    Chains of Kalibr, OpenVINS and TUM-VI (cam0 ..., imu0), and EuRoC's sensor.yaml (docs/formats.md).

    Returns
    -------
    Result
        `cameras`, a list of Results with `name`, `camera` (Camera), `imu_T_camera` (SE3) and `timeshift`
        (s: t_imu = t_camera + timeshift); `imu_noise`, as `read_imu_noise` returns it, or None.
    """
    d = _reader("read_calibration")([os.fspath(path) for path in paths])
    cameras = []
    for c in d["cameras"]:
        fu, fv, cu, cv, distortion, coefficients, width, height, mirror = c["camera"]
        name = Camera._names[distortion]
        numbers = (mirror, *coefficients) if name == "omni" else coefficients[: Camera._counts.get(name, 4)]
        camera = Camera(fu, fv, cu, cv, name, numbers, width, height)
        pose = SE3._of(c["imu_T_camera"])
        cameras.append(Result("camera", name=c["name"], camera=camera, imu_T_camera=pose, timeshift=c["timeshift"]))
    return Result("calibration", cameras=cameras, imu_noise=d["imu_noise"])


def read_imu_noise(path):
    """Noise densities of an inertial sensor from a YAML file (EuRoC's sensor.yaml, or imu0 of a chain).

    Returns
    -------
    ndarray, shape (4,)
        Gyroscope (rad/s/√Hz), accelerometer (m/s²/√Hz), and the random walks of their biases (rad/s²/√Hz, m/s³/√Hz):
        the argument `noise` of `preintegrate` and `vi_init`.
    """
    return _reader("read_imu_noise")(os.fspath(path))


def read_ground_truth(path, *, start_ns=0):
    """True states of a body from EuRoC's state_groundtruth_estimate.

    Parameters
    ----------
    path : str or path
    start_ns : int
        Subtracted from the time stamps: `start_ns` of `read_imu`.

    Returns
    -------
    Result
        `times` (s), `states` (SE23) and `biases`, shape (n, 6), gyroscope before accelerometer; zeros where the file has
        none. `(r.times, r.states, r.biases)` is the argument `truth` of `preintegrate` and `vi_init`.
    """
    d = _reader("read_ground_truth")(os.fspath(path), int(start_ns))
    return Result("true states", times=d["times"], states=SE23._of(d["states"]), biases=d["biases"])


def read_stereo_tracks(path):
    """Tracks of a rectified stereo camera: CSV with frame, track, uL, vL, uR, vR.

    Returns
    -------
    Result
        `frames` and `tracks`, shape (n,), and `pixels`, shape (n, 4): uL, vL, uR, vR.
    """
    return Result("stereo tracks", **_reader("read_stereo_tracks")(os.fspath(path)))


def read_camera_poses(path):
    """Poses of a camera: CSV with frame, t_s, R00 ... R22 (world to camera), cx, cy, cz (its centre, m).

    Returns
    -------
    Result
        `frames`, `times` (s) and `world_T_camera` (SE3), each of shape (n,).
    """
    d = _reader("read_camera_poses")(os.fspath(path))
    return Result("camera poses", frames=d["frames"], times=d["times"], world_T_camera=SE3._of(d["world_T_camera"]))


def read_stereo_camera(path):
    """A rectified stereo pair: rows name,value with fu, fv, cu, cv, b and, where known, y_var0 ... y_var3.

    Returns
    -------
    Result
        `fu`, `fv`, `cu`, `cv` (px), `baseline` (m) and `pixel_variance` of uL, vL, uR, vR (px²), or None.
    """
    return Result("stereo camera", **_reader("read_stereo_camera")(os.fspath(path)))


def read_landmarks(path):
    """Points of R3 from CSV with x, y, z (m): row i is the landmark of track i."""
    return R3._of(_reader("read_landmarks")(os.fspath(path)))


def read_matches(path):
    """Matches of two images from CSV with x1, y1, x2, y2 (px), or from tracks of two images, shape (n, 4).

    They are the argument `matches` of `two_view`.
    """
    return _reader("read_matches")(os.fspath(path))


def read_two_view_pair(path, family):
    """Matches of a real pair of images, with labels or points that validate.

    Parameters
    ----------
    path : str or path
        CSV with x1, y1, x2, y2 (px) and, by the family, `validation`, `structure` or `inlier`.
    family : {'homogr', 'kusvod2', 'adelaide-rmf', 'evd'}

    Returns
    -------
    Result
        `family`, `name`; `matches`, shape (n, 4), and `validation`, shape (k, 4): x1 y1 x2 y2; `labels` of the matches (0:
        wrong; empty if the family has none), `corner` and `size` (px) of both images.
    """
    families = ("homogr", "kusvod2", "adelaide-rmf", "evd")
    if family not in families:
        raise ValueError(f"read_two_view_pair: family: expected one of {families}, got {family!r}")
    return Result("pair of images", **_reader("read_two_view_pair")(os.fspath(path), family))


def read_two_view_pairs(directory):
    """All pairs of a directory, in its folders homogr, kusvod2, adelaide-rmf and evd (docs/formats.md).

    Returns
    -------
    list of Result
        As of `read_two_view_pair`; the image sizes are those of `manifest.csv` if it has them.
    """
    return [Result("pair of images", **pair) for pair in _reader("read_two_view_pairs")(os.fspath(directory))]


def read_pose_pairs(path_a, path_b, *, by_row=False, tolerance=0.01, norm_tolerance=1e-3):
    """Poses of two files that belong together, for `hand_eye`.

    Parameters
    ----------
    path_a, path_b : str or path
    by_row : bool
        Row i belongs to row i even if both files have times; otherwise the rows whose times are nearest to each other
        in both directions.
    tolerance : float
        s, between times that belong together.
    norm_tolerance : float
        As in `read_features`.

    Returns
    -------
    Result
        `a` and `b` (SE3, shape (n,)), `rows` of the files, shape (n, 2), from 0; `times` (s, of the first file; None
        if rows were paired by their order), `largest_gap` (s), `unmatched_a`, `unmatched_b`.
    """
    d = _reader("read_pose_pairs")(
        os.fspath(path_a), os.fspath(path_b), bool(by_row), float(tolerance), float(norm_tolerance)
    )
    a, b, rows = SE3._of(d.pop("a")), SE3._of(d.pop("b")), d.pop("rows").astype(int)
    return Result("pairs of poses", a=a, b=b, rows=rows, **d)
