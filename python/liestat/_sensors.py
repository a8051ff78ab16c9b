"""Sensors and estimators: preintegration, visual-inertial initialisation, two views, hand-eye."""

import numbers
import warnings

import numpy as np

from . import _core
from ._gaussians import Gaussian
from ._manifolds import S2, SE3, SE23, SO3
from ._operate import as_numbers, require_finite
from ._results import Result
from ._statistics import _covariances


def _numbers(value, name, tail):
    return np.asarray(require_finite(as_numbers(value, name, tail), name), order="C")


def _rows(value, name, columns):
    array = _numbers(value, name, (columns,))
    if array.ndim != 2:
        raise ValueError(f"{name}: expected shape (n, {columns}), got {array.shape}")
    return array


def _vector(value, name):
    array = _numbers(value, name, ())
    if array.ndim != 1:
        raise ValueError(f"{name}: expected shape (n,), got {array.shape}")
    return array


def _same_length(caller, **arrays):
    sizes = {name: len(a) for name, a in arrays.items()}
    if len(set(sizes.values())) > 1:
        raise ValueError(f"{caller}: lengths differ: " + ", ".join(f"{n} {s}" for n, s in sizes.items()))


def _readings(caller, times, rates, forces):
    t = _vector(times, f"{caller}: times")
    w = _rows(rates, f"{caller}: rates", 3)
    f = _rows(forces, f"{caller}: forces", 3)
    _same_length(caller, times=t, rates=w, forces=f)
    return np.ascontiguousarray(np.concatenate([t[:, None], w, f], axis=1))


def _noise(caller, noise):
    array = _vector(noise, f"{caller}: noise")
    if len(array) not in (2, 4) or (array < 0).any():
        raise ValueError(
            f"{caller}: noise: expected (gyroscope, accelerometer), or these with their walks, none negative, "
            f"got {array}"
        )
    return np.concatenate([array, np.zeros(4 - len(array))])


def _truth(caller, truth):
    """Rows of (times, states) or (times, states, biases); none without a truth."""
    if truth is None:
        return np.empty((0, 17))
    if len(truth) not in (2, 3):
        raise ValueError(f"{caller}: truth: expected (times, states), or these with the biases")
    t = _vector(truth[0], f"{caller}: times of the truth")
    states = truth[1]
    if not isinstance(states, SE23) or states.ndim != 1:
        shape = f" of shape {states.shape}" if hasattr(states, "shape") else ""
        raise TypeError(f"{caller}: truth: expected SE23 of shape (n,), got {type(states).__name__}{shape}")
    biases = np.zeros((len(t), 6)) if len(truth) == 2 else _rows(truth[2], f"{caller}: biases of the truth", 6)
    _same_length(caller, times=t, states=states, biases=biases)
    if not (np.diff(t) > 0).all():
        raise ValueError(f"{caller}: times of the truth: expected ascending ones, each once")
    return np.ascontiguousarray(np.concatenate([t[:, None], states.params, biases], axis=1))


def preintegrate(
    times,
    rates,
    forces,
    begin,
    end,
    *,
    noise=(0.0, 0.0),
    bias=None,
    scheme="averaged",
    max_gap=0.1,
    threads=0,
    truth=None,
    gravity=9.81,
    rate=0.0,
    world_rate=(0.0, 0.0, 0.0),
):
    """Preintegrated motions of many intervals of one inertial recording.

    Parameters
    ----------
    times : array_like, shape (n,)
        s, ascending.
    rates, forces : array_like, shape (n, 3)
        Angular rate (rad/s) and specific force (m/s²) in the sensor's axes.
    begin, end : float or array_like, shape (m,)
        s; the ends of the intervals.
    noise : sequence
        Densities: gyroscope (rad/s/√Hz), accelerometer (m/s²/√Hz), and of the random walks of their biases
        (rad/s²/√Hz, m/s³/√Hz).
    bias : array_like, shape (6,), optional
        Gyroscope (rad/s), accelerometer (m/s²); taken off every reading. By default that of the truth at `begin`, or
        zero.
    scheme : {'averaged', 'held', 'cubic'}
        How motion goes on between readings.
    max_gap : float
        s; readings further apart than this make an interval not usable.
    truth : (times, states) or (times, states, biases), optional
        s, ascending; SE23 of shape (m,), world_T_body with the velocity in the world; (m, 6): gyroscope (rad/s),
        accelerometer (m/s²).
    gravity : float
        m/s², downwards along z in the truth's world.
    rate : float
        Hz, readings per second of the sensor: the variance of a reading is density² · rate. By default measured.
    world_rate : array_like, shape (3,)
        rad/s, rotation of the truth's world in its axes (the Earth's: 7.292e-5 (0, cos φ, sin φ), φ the latitude).

    Returns
    -------
    Result
        `increment` (SE23: rotation, position, velocity), `covariance` (..., 9, 9) in its tangent (position, rotation,
        velocity), `covariance_with_bias` (..., 15, 15), `bias_jacobian` (..., 9, 6), `faults` (list of str, empty
        where there is none) and `ok`; and the fields of ``liestat preintegrate --json`` (docs/program.md): `windows`,
        `verdict`, `consistent`, `causes`, ….

    Warns
    -----
    UserWarning
        Where an interval is not usable: its covariance is NaN. Where the errors against the truth are larger than the
        covariances explain.
    """
    readings = _readings("preintegrate", times, rates, forces)
    b, e = np.broadcast_arrays(
        _numbers(begin, "preintegrate: begin", ()), _numbers(end, "preintegrate: end", ())
    )
    lead = b.shape
    bias = np.empty(0) if bias is None else _vector(bias, "preintegrate: bias")
    if bias.shape not in ((0,), (6,)):
        raise ValueError(f"preintegrate: bias: expected shape (6,), got {bias.shape}")
    d = _core.preintegrate(
        readings,
        np.ascontiguousarray(b).ravel(),
        np.ascontiguousarray(e).ravel(),
        _noise("preintegrate", noise),
        bias,
        scheme,
        float(max_gap),
        int(threads),
        _truth("preintegrate", truth),
        float(gravity),
        float(rate),
        _numbers(world_rate, "preintegrate: world_rate", (3,)),
    )
    ok = np.array([not fault for fault in d["faults"]], dtype=bool)
    if not ok.all():
        first = int(np.argmin(ok))
        warnings.warn(
            f"liestat.preintegrate: {np.count_nonzero(~ok)} of {len(ok)} intervals are not usable; {first}: "
            f"{d['faults'][first]}",
            UserWarning,
            stacklevel=2,
        )
        for name in ("covariance", "covariance_with_bias", "bias_jacobian"):
            d[name][~ok] = np.nan
    if d["consistent"] is False:
        warnings.warn(f"liestat.preintegrate: {d['verdict']}", UserWarning, stacklevel=2)
    d["increment"] = SE23._of(d["increment"].reshape(*lead, 10))
    for name, shape in (("covariance", (9, 9)), ("covariance_with_bias", (15, 15)), ("bias_jacobian", (9, 6))):
        d[name] = d[name].reshape(*lead, *shape)
    return Result.of("preintegrated motion", d | {"ok": ok.reshape(lead)[()]})


class CalibratedPose(Result):
    """A pose with the fields of the program's JSON: `translation` (m), `quaternion_xyzw`, `rotation_vector` (rad), and
    for an estimate `covariance` (None where there is none), `standard_deviations`, `standard_deviations_local`.

    Attributes
    ----------
    mean : SE3
    gaussian : Gaussian
        Its methods are those of the pose, too. Without a covariance it has NaN.
    """

    @property
    def mean(self):
        return SE3._of(np.concatenate([self.quaternion_xyzw, self.translation]))

    @property
    def gaussian(self):
        covariance = self.__dict__.get("covariance")
        return Gaussian._of(self.mean, np.full((6, 6), np.nan) if covariance is None else covariance)

    def __getattr__(self, name):
        if name.startswith("_") or "quaternion_xyzw" not in self.__dict__:
            raise AttributeError(name)
        return getattr(self.gaussian, name)


#: Former names of parts of hand_eye().
_HAND_EYE_NAMES = {"reason": "in_words", "covariance": "joint_covariance", "directions": "open_directions"}


def hand_eye(
    a,
    b,
    a_covariance,
    b_covariance,
    *,
    relative=False,
    known_noise=True,
    find_outliers=True,
    gate=22.457744484825327,
    samples=80,
    seed=1,
    times=None,
    suspect_sigmas=None,
    stream_of_a=None,
    interpolate=False,
    largest_delay=0.0,
):
    """Hand-eye calibration from pairs of poses that both carry noise.

    Parameters
    ----------
    a, b : SE3, shape (n,)
        base_T_gripper and target_T_camera (A X = Y B); with `relative` independent motions of both (A X = X B).
    a_covariance, b_covariance : array_like, shape (6, 6) or (n, 6, 6)
        m² and rad², body axes, translation before rotation. One of them may be zero.
    relative : bool
    known_noise : bool
        False: the covariances are known up to a common factor, which is estimated.
    find_outliers : bool
    gate : float
        Squared error of a pair beyond which it is an outlier; χ²₆ at 0.999 by default.
    samples, seed : int
        Of the search for outliers.
    times : array_like, shape (n,), optional
        Times of the pairs, s: the covariance is then widened by the dependence of successive errors that shows.
    suspect_sigmas : dict, optional
        Suspects ('delay', 'scale', 'focal_length', 'principal_x', 'principal_y') that are estimated, each with the
        standard deviation of its prior, s or a ratio; inf: without one. The others are taken for known and tested.
    stream_of_a : tuple of array_like, shape (m,), and SE3, shape (m,), optional
        Times and poses of the stream that `a` is from, without which there is no delay.
    interpolate : bool
        `a` is replaced by the stream's poses at `times`, those of `b`; the error of interpolation is added.
    largest_delay : float
        The delay is sought from where angular speeds agree best within so many seconds.

    Returns
    -------
    Result
        The fields of ``liestat hand-eye --json`` (docs/program.md), `X` and `Y` of type CalibratedPose:
        gripper_T_camera, base_T_target (None with `relative`); and `errors` and `pair_chi2` of the pairs.

    Warns
    -----
    UserWarning
        Where the status is not 'ok'.
    """
    for name, value in (("a", a), ("b", b)):
        if not isinstance(value, SE3) or value.ndim != 1:
            shape = f" of shape {value.shape}" if hasattr(value, "shape") else ""
            raise TypeError(f"hand_eye: {name}: expected SE3 of shape (n,), got {type(value).__name__}{shape}")
    _same_length("hand_eye", a=a, b=b)
    n = len(a)
    covariances = []
    for name, value in (("a_covariance", a_covariance), ("b_covariance", b_covariance)):
        c = _covariances(value, f"hand_eye: {name}", SE3, (n,))
        covariances.append(np.ascontiguousarray(np.broadcast_to(c, (n, 6, 6))))
    t = np.empty(0) if times is None else _vector(times, "hand_eye: times")
    if times is not None:
        _same_length("hand_eye", times=t, a=a)
    names = ("delay", "scale", "focal_length", "principal_x", "principal_y")
    sigmas = {} if suspect_sigmas is None else dict(suspect_sigmas)
    for name in sigmas:
        if name not in names:
            raise ValueError(f"hand_eye: suspect_sigmas: expected some of {', '.join(names)}, got {name!r}")
    stream_times, stream_poses = np.empty(0), np.empty((0, 7))
    if stream_of_a is not None:
        stream_times = _vector(stream_of_a[0], "hand_eye: times of stream_of_a")
        _same_length("hand_eye", stream_times=stream_times, stream_poses=stream_of_a[1])
        stream_poses = np.ascontiguousarray(stream_of_a[1].params)
    if (interpolate or largest_delay > 0) and (times is None or stream_of_a is None):
        raise ValueError("hand_eye: interpolate and largest_delay need times and stream_of_a")
    d = _core.hand_eye(
        np.ascontiguousarray(a.params),
        covariances[0],
        np.ascontiguousarray(b.params),
        covariances[1],
        not relative,
        bool(known_noise),
        bool(find_outliers),
        float(gate),
        int(samples),
        int(seed),
        t,
        [float(sigmas.get(name, 0)) for name in names],
        stream_times,
        stream_poses,
        bool(interpolate),
        float(largest_delay),
    )
    if d["status"] != "ok":
        warnings.warn(f"liestat.hand_eye: {d['status']}: {d['in_words']}", UserWarning, stacklevel=2)
    for name in ("X", "Y", "rival", "X_over_suspects"):
        if d[name] is not None:
            d[name] = CalibratedPose.of(name, d[name])
    d["outliers"] = d["outliers"].tolist()
    return Result.of("hand-eye calibration", d, _HAND_EYE_NAMES)


class Camera:
    """A central camera: pinhole, or with a lens that bends rays.

    Parameters
    ----------
    fu, fv, cu, cv : float
        Focal lengths and principal point, pixels.
    distortion : {'none', 'radtan', 'equidistant', 'omni', 'double_sphere', 'eucm'}
    coefficients : sequence of 4 floats
        k1 k2 p1 p2 of 'radtan', k1 k2 k3 k4 of 'equidistant', xi k1 k2 p1 p2 of 'omni', xi alpha of 'double_sphere',
        alpha beta of 'eucm'.
    width, height : int
        Pixels; 0 where they are not known.
    """

    _names = ("none", "radtan", "equidistant", "omni", "double_sphere", "eucm")
    _counts = {"omni": 5, "double_sphere": 2, "eucm": 2}

    def __init__(self, fu, fv, cu, cv, distortion="none", coefficients=(0, 0, 0, 0), width=0, height=0):
        if distortion not in self._names:
            raise ValueError(f"Camera: distortion: expected one of {', '.join(self._names)}, got {distortion!r}")
        if not (fu > 0 and fv > 0):
            raise ValueError(f"Camera: focal lengths must be positive, got {fu} and {fv}")
        self.fu, self.fv, self.cu, self.cv = float(fu), float(fv), float(cu), float(cv)
        self.distortion = distortion
        self.coefficients = tuple(float(c) for c in _vector(coefficients, "Camera: coefficients"))
        expected = self._counts.get(distortion, 4)
        if len(self.coefficients) != expected:
            raise ValueError(f"Camera: coefficients: expected {expected} numbers, got {len(self.coefficients)}")
        self.width, self.height = int(width), int(height)

    def _list(self):
        distortion = float(self._names.index(self.distortion))
        mirror, own = (self.coefficients[0], self.coefficients[1:]) if self.distortion == "omni" else (0, self.coefficients)
        own = (*own, 0, 0)[:4]
        numbers = [self.fu, self.fv, self.cu, self.cv, distortion, *own, self.width, self.height, mirror]
        return np.array(numbers, dtype=float)

    def __repr__(self):
        return f"Camera({self.fu:g}, {self.fv:g}, {self.cu:g}, {self.cv:g}, {self.distortion!r})"

    def bearings(self, pixels, sigma=1.0):
        """Unit vectors of pixels with their standard deviations.

        Parameters
        ----------
        pixels : array_like, shape (n, 2)
        sigma : float
            Standard deviation of each coordinate, pixels.

        Returns
        -------
        bearings : ndarray, shape (n, 3)
            In the camera's axes: x right, y down, z ahead. NaN where no direction is seen at a pixel.
        sigmas : ndarray, shape (n,)
            rad.
        """
        rows = _core.bearings(self._list(), _rows(pixels, "Camera.bearings: pixels", 2), float(sigma))
        return rows[:, :3].copy(), rows[:, 3].copy()


def _relative_pose(d):
    if d is None:
        return None
    return Result(
        "relative pose",
        rotation=SO3._of(d["quaternion"]),
        direction=S2._of(d["direction"]),
        covariance=d["covariance"],
    )


class TwoViewResult(Result):
    """The result of two_view()."""

    @property
    def relative_pose(self):
        """Deprecated: `second_T_first` as `rotation` (SO3), `direction` (S2) and `covariance`."""
        warnings.warn(
            "liestat: the part 'relative_pose' is called 'second_T_first' now", DeprecationWarning, stacklevel=2
        )
        pose = self.second_T_first
        return None if pose is None else _relative_pose({"quaternion": pose.quaternion_xyzw, **pose.__dict__})


#: Former names of parts of two_view().
_TWO_VIEW_NAMES = {"physical": "parameters", "errors": "squared_errors", "name": "model"}


def two_view(
    matches,
    sigma=1.0,
    camera=None,
    second_camera=None,
    *,
    image_size=None,
    noise_is_known=False,
    focal_sigma=0.0,
    k1_sigma=0.0,
    seed=1,
):
    """The motion between two images from matches of which some are wrong, its model chosen from several.

    Parameters
    ----------
    matches : array_like, shape (n, 4)
        x y x' y', pixels.
    sigma : float
        Standard deviation of each coordinate, pixels.
    camera, second_camera : Camera, optional
        Of the first image, and of the second if it is another one.
    image_size : (width, height), optional
    noise_is_known : bool
        `sigma` is exact: the noise that the matches show does not replace it, and shorter baselines are told.
    focal_sigma, k1_sigma : float
        Standard deviations of the focal lengths, relative, and of the distortion k1; the covariances contain them.
    seed : int

    Returns
    -------
    Result
        The fields of ``liestat two-view --json`` (docs/program.md): `status`, `model`, `matrix`, `parameters`,
        `second_T_first` (x' = R x + t), `inlier`, …; and the `threshold` on squared errors.

    Warns
    -----
    UserWarning
        Where the status is not 'ok'.
    """
    m = _rows(matches, "two_view: matches", 4)
    if not sigma > 0:
        raise ValueError(f"two_view: sigma: expected a positive number, got {sigma}")
    nothing = np.empty(0)
    size = nothing if image_size is None else _vector(image_size, "two_view: image_size")
    d = _core.two_view(
        m,
        float(sigma),
        nothing if camera is None else camera._list(),
        nothing if second_camera is None else second_camera._list(),
        size,
        bool(noise_is_known),
        float(focal_sigma),
        float(k1_sigma),
        int(seed),
    )
    if d["status"] != "ok":
        warnings.warn(f"liestat.two_view: {d['status']}: {d['reason']}", UserWarning, stacklevel=2)
    return TwoViewResult.of("two-view motion", d, _TWO_VIEW_NAMES)


def robust_two_view(model, matches, sigma, *, confidence=0.9999, threshold=0.0, max_draws=100000, seed=1):
    """One model of two views from matches of which some are wrong.

    Parameters
    ----------
    model : {'homography', 'fundamental', 'pose'}
        'pose' takes matches in normalised coordinates, (pixel - centre) / focal length.
    matches : array_like, shape (n, 4)
        x y x' y'.
    sigma : float or (float, float)
        Standard deviation of the coordinates in each image, in the unit of the matches.

    Returns
    -------
    Result
        `status`, `matrix` (H, F or E), `matrix_covariance`, `relative_pose`, `inliers`, `score`, `chi2`, `confidence`,
        `draws`.
    """
    if model not in ("homography", "fundamental", "pose"):
        raise ValueError(f"robust_two_view: model: expected 'homography', 'fundamental' or 'pose', got {model!r}")
    first, second = (sigma, sigma) if isinstance(sigma, numbers.Real) else sigma
    d = _core.robust_two_view(
        model,
        _rows(matches, "robust_two_view: matches", 4),
        float(first),
        float(second),
        float(confidence),
        float(threshold),
        int(max_draws),
        int(seed),
    )
    if d["status"] != "ok":
        warnings.warn(f"liestat.robust_two_view: {d['status']}", UserWarning, stacklevel=2)
    d["relative_pose"] = _relative_pose(d["relative_pose"])
    return Result(model, **d)


#: Blocks of the joint covariance of a refined window: name and first row; three rows each.
VI_BLOCKS = {
    "velocity": 0,
    "last_position": 3,
    "last_rotation": 6,
    "last_velocity": 9,
    "gravity": 12,
    "gyroscope_bias": 15,
    "accelerometer_bias": 18,
    "last_gyroscope_bias": 21,
    "last_accelerometer_bias": 24,
}


class InitialisedWindow(Result):
    """A window of a visual-inertial recording, in the body's axes at its first image.

    The fields of the program's JSON: `status`, `ok`, `begin`, `end` (s), `images` and `tracks` (numbers of them),
    `solutions` and `covariance` of the closed form, `refined` (a Result, or None), with a truth `refined_error` …; and
    the best known of the window:

    Attributes
    ----------
    reason : str
    velocity, gravity : ndarray, shape (3,), or None
        At the first image, m/s and m/s².
    best_gyroscope_bias, accelerometer_bias : ndarray, shape (3,)
    states : SE23, shape (images,)
    joint_covariance : ndarray, shape (27, 27), or None
        See `block`; None where the window was not refined.
    scale_sigma, tilt_sigma, chi2 : float
    image_indices, track_names, inliers : ndarray of int
    """

    def block(self, row, column=None):
        """ndarray, shape (3, 3): the covariance of a block by its name (`VI_BLOCKS`), or of two blocks."""
        if self.joint_covariance is None:
            raise ValueError(f"no covariance: {self.reason}")
        i, j = VI_BLOCKS[row], VI_BLOCKS[row if column is None else column]
        return self.joint_covariance[i : i + 3, j : j + 3]


def vi_init(
    times,
    rates,
    forces,
    noise,
    image_times,
    images,
    tracks,
    bearings,
    sigmas,
    *,
    body_T_camera=None,
    cameras=None,
    window=2.0,
    stride=0.0,
    image_rate=10.0,
    consensus=True,
    refinement=True,
    stretch=12.0,
    gravity=9.81,
    gyroscope_sigma=0.1,
    accelerometer_sigma=0.15,
    seed=1,
    truth=None,
    calibrate_noise=True,
    inflate=False,
    filter_convention="liestat",
    position_sigma=1e-3,
    heading_sigma=1e-3,
):
    """Velocity, gravity, scale and biases of a visual-inertial recording, window by window, without a first guess.

    Parameters
    ----------
    times, rates, forces : array_like
        Inertial readings: s, rad/s, m/s², as in `preintegrate`.
    noise : sequence
        Densities as in `preintegrate`; both white ones positive.
    image_times : array_like, shape (m,)
        s, ascending.
    images, tracks : array_like of int, shape (n,)
        Which image and which track each bearing belongs to.
    bearings : array_like, shape (n, 3)
        In the camera's axes; `Camera.bearings` makes them of pixels.
    sigmas : float or array_like, shape (n,)
        Their standard deviations, rad.
    body_T_camera : SE3, optional
        Pose of the camera, or of each camera, in the body.
    cameras : array_like of int, shape (n,), optional
        Which camera each bearing belongs to.
    window, stride, image_rate, stretch : float
        s, s (0: the window), Hz, s.
    consensus, refinement : bool
        Tracks may be wrong; refine the closed form.
    gravity : float or None
        m/s²; None: unknown.
    gyroscope_sigma, accelerometer_sigma : float
        Priors of the biases, rad/s and m/s².
    truth : (times, states) or (times, states, biases), optional
        As in `preintegrate`: windows and stretches are compared with it.
    calibrate_noise : bool
        Test the densities where windows meet, and multiply them by the factors at which windows agree if they refute
        them (`noise_calibration`).
    inflate : bool
        Multiply the covariance of a stretch whose windows contradict each other by the factor at which they would not.
    filter_convention : {"liestat", "openvins", "gtsam", "basalt"}
        Order and errors of the covariance of `filter_start`, from which a filter starts.
    position_sigma, heading_sigma : float
        m and rad: standard deviations of position and heading of `filter_start`, which are free.

    Returns
    -------
    Result
        The fields of ``liestat vi-init --json`` (docs/program.md): `ok` and `in_words`, `windows` (list of
        InitialisedWindow), `fusions` of disjoint windows (with `window_indices`), ….
    """
    readings = _readings("vi_init", times, rates, forces)
    stamps = _vector(image_times, "vi_init: image_times")
    rays = _rows(bearings, "vi_init: bearings", 3)
    n = len(rays)
    indices = np.zeros((n, 3), dtype=np.int64)
    for column, (name, value) in enumerate((("images", images), ("tracks", tracks), ("cameras", cameras))):
        if value is None:
            continue
        array = np.asarray(value)
        if array.shape != (n,) or not np.issubdtype(array.dtype, np.integer) or (array < 0).any():
            found = f"{array.dtype} {array.shape}"
            raise ValueError(f"vi_init: {name}: expected integers of shape ({n},), none negative, got {found}")
        indices[:, column] = array
    rows = np.empty((n, 4))
    rows[:, :3] = rays
    rows[:, 3] = _numbers(sigmas, "vi_init: sigmas", ())
    poses = SE3.identity(1) if body_T_camera is None else body_T_camera
    poses = poses.reshape(-1)
    d = _core.vi_init(
        readings,
        _noise("vi_init", noise),
        stamps,
        np.ascontiguousarray(poses.params),
        indices,
        rows,
        float(window),
        float(stride),
        float(image_rate),
        bool(consensus),
        bool(refinement),
        float(stretch),
        0.0 if gravity is None else float(gravity),
        float(gyroscope_sigma),
        float(accelerometer_sigma),
        int(seed),
        _truth("vi_init", truth),
        bool(calibrate_noise),
        bool(inflate),
        str(filter_convention),
        float(position_sigma),
        float(heading_sigma),
    )
    for one in d["windows"]:
        one["states"] = SE23._of(one["states"])
    d["windows"] = [InitialisedWindow.of("window", one) for one in d["windows"]]
    return Result.of("visual-inertial initialisation", d, {"stretches": "fusions"})
