"""Statistics on Lie groups and homogeneous manifolds over NumPy arrays."""

from typing import Any, Callable, ClassVar, Iterable, Iterator, Literal, Self, Sequence, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Array = NDArray[np.float64]
_T = TypeVar("_T")
_M = TypeVar("_M", bound="Manifold")
_G = TypeVar("_G", bound="Group")
_Shape = int | Sequence[int]
_Axis = int | tuple[int, ...] | None
_Rng = np.random.Generator | "CounterRng" | int | None
_CovarianceAt = Literal["measured", "estimated"] | None
_Convention = Literal[
    "body", "left", "world", "rotation_first", "left_rotation_first", "world_rotation_first", "chart"
]
_Alignment = Literal["none", "origin", "posyaw", "se3", "sim3", "scale"]
_PoseRelation = Literal[
    "full", "trans_part", "rot_part", "angle_deg", "angle_rad", "point_distance", "point_distance_error_ratio"
]

CONVENTIONS: tuple[str, ...]

class Manifold:
    parameters: ClassVar[int]
    dof: ClassVar[int]
    tangent_names: ClassVar[tuple[str, ...]]
    def __init_subclass__(cls, core: str | None = None, **keywords: Any) -> None: ...
    def __init__(self: _M, params: ArrayLike | _M) -> None: ...
    @classmethod
    def identity(cls: type[_M], shape: _Shape = ()) -> _M: ...
    @classmethod
    def stack(cls: type[_M], elements: Iterable[_M], axis: int = 0) -> _M: ...
    @classmethod
    def concatenate(cls: type[_M], elements: Iterable[_M], axis: int = 0) -> _M: ...
    @property
    def params(self) -> _Array: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def ndim(self) -> int: ...
    @property
    def size(self) -> int: ...
    @property
    def single(self) -> bool: ...
    def __len__(self) -> int: ...
    def __getitem__(self: _M, index: Any) -> _M: ...
    def __setitem__(self: _M, index: Any, value: _M) -> None: ...
    def __iter__(self: _M) -> Iterator[_M]: ...
    def __copy__(self: _M) -> _M: ...
    def __deepcopy__(self: _M, memo: Any) -> _M: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def reshape(self: _M, *shape: Any) -> _M: ...
    def copy(self: _M) -> _M: ...
    def allclose(self: _M, other: _M, atol: float = 1e-9) -> bool: ...
    def retract(self: _M, v: ArrayLike, threads: int = 1) -> _M: ...
    def local(self: _M, other: _M, threads: int = 1) -> _Array: ...
    def local_jacobians(self: _M, other: _M, threads: int = 1) -> tuple[_Array, _Array]: ...
    def interpolate(self: _M, other: _M, s: ArrayLike, threads: int = 1) -> _M: ...
    def moved(self: _M, by: Any, threads: int = 1) -> _M: ...

class _Metric:
    def distance(self: _T, other: _T, threads: int = 1) -> Any: ...

class Group(Manifold):
    dimension: ClassVar[int]
    @classmethod
    def exp(cls: type[_G], v: ArrayLike, threads: int = 1) -> _G: ...
    def log(self, threads: int = 1) -> _Array: ...
    def inv(self: _G, threads: int = 1) -> _G: ...
    def product(self: _G, other: _G, threads: int = 1) -> _G: ...
    @overload
    def __mul__(self: _G, other: _G) -> _G: ...
    @overload
    def __mul__(self: _G, other: Gaussian) -> Gaussian: ...
    def __truediv__(self: _G, other: _G) -> _G: ...
    def act(self, points: ArrayLike, threads: int = 1) -> _Array: ...
    def as_matrix(self, threads: int = 1) -> _Array: ...
    def Adj(self, threads: int = 1) -> _Array: ...
    @classmethod
    def ad(cls, v: ArrayLike, threads: int = 1) -> _Array: ...
    @classmethod
    def left_jacobian(cls, v: ArrayLike, threads: int = 1) -> _Array: ...
    @classmethod
    def right_jacobian(cls, v: ArrayLike, threads: int = 1) -> _Array: ...
    @classmethod
    def left_jacobian_inverse(cls, v: ArrayLike, threads: int = 1) -> _Array: ...
    @classmethod
    def right_jacobian_inverse(cls, v: ArrayLike, threads: int = 1) -> _Array: ...

class SO3(_Metric, Group):
    @classmethod
    def from_quat(cls, quaternion: ArrayLike, *, scalar_first: bool = False) -> SO3: ...
    def as_quat(self, *, canonical: bool = False, scalar_first: bool = False) -> _Array: ...
    @classmethod
    def from_matrix(cls, matrix: ArrayLike, *, fit: bool = False) -> SO3: ...
    @classmethod
    def from_rotvec(cls, rotvec: ArrayLike, *, degrees: bool = False) -> SO3: ...
    def as_rotvec(self, *, degrees: bool = False) -> _Array: ...
    @classmethod
    def from_euler(cls, seq: str, angles: ArrayLike, *, degrees: bool = False) -> SO3: ...
    def as_euler(self, seq: str, *, degrees: bool = False) -> _Array: ...
    def magnitude(self) -> Any: ...
    @classmethod
    def from_scipy(cls, rotation: Any) -> SO3: ...
    def to_scipy(self) -> Any: ...

class _Pose:
    @classmethod
    def from_components(cls: type[_T], translation: ArrayLike, rotation: Any) -> _T: ...
    @classmethod
    def from_matrix(cls: type[_T], matrix: ArrayLike) -> _T: ...
    def as_matrix(self, threads: int = 1) -> _Array: ...
    @property
    def rotation(self) -> SO3: ...
    @property
    def translation(self) -> _Array: ...
    @classmethod
    def from_scipy(cls: type[_T], transform: Any) -> _T: ...
    def to_scipy(self) -> Any: ...

class SE3(_Pose, Group):
    @property
    def frame(self) -> Frame3: ...

class _Frame(_Metric, _Pose, Manifold):
    @property
    def se3(self) -> SE3: ...

class Frame3(_Frame): ...

class SemiOrientedFrame3(_Frame):
    def canonical(self) -> SemiOrientedFrame3: ...

class NonOrientedFrame3(_Frame):
    def canonical(self) -> NonOrientedFrame3: ...

class SE2(Group):
    @classmethod
    def from_components(cls, translation: ArrayLike, angle: ArrayLike) -> SE2: ...
    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> SE2: ...
    @property
    def translation(self) -> _Array: ...
    @property
    def angle(self) -> Any: ...

class SE23(Group):
    @classmethod
    def from_components(cls, position: ArrayLike, rotation: Any, velocity: ArrayLike) -> SE23: ...
    @property
    def rotation(self) -> SO3: ...
    @property
    def position(self) -> _Array: ...
    @property
    def velocity(self) -> _Array: ...

class S2(_Metric, Manifold):
    @classmethod
    def from_vector(cls, vector: ArrayLike) -> S2: ...
    def tangent_basis(self) -> _Array: ...

class R3(_Metric, Manifold):
    def moved(self, by: R3 | SO3 | SE3, threads: int = 1) -> R3: ...

class Law:
    degrees_of_freedom: int
    samples: int | None
    def __init__(
        self, degrees_of_freedom: int | None = None, samples: int | None = None, *, dof: int | None = None
    ) -> None: ...
    @property
    def dof(self) -> int: ...
    def __eq__(self, other: object) -> bool: ...
    @property
    def name(self) -> Literal["chi2", "hotelling"]: ...
    def quantile(self, probability: float) -> float: ...
    def survival(self, squared_distance: ArrayLike) -> Any: ...
    def mean(self) -> float: ...

class ConfidenceRegion:
    mean: Any
    covariance: _Array
    probability: float
    law: Law
    threshold: float
    semi_axes: _Array
    directions: _Array
    def __init__(self, mean: Manifold, covariance: _Array, probability: float, law: Law) -> None: ...
    def contains(self, x: Manifold) -> Any: ...

class Uniqueness(str):
    def __bool__(self) -> bool: ...
    def __eq__(self, other: object) -> bool: ...
    def __ne__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

class MeanResult:
    criterion: str
    shape: tuple[int, ...]
    def __init__(self, kind: Any, criterion: str, answers: Any, shape: tuple[int, ...]) -> None: ...
    def __getattr__(self, name: str) -> Any: ...
    def __dir__(self) -> list[str]: ...
    def keys(self) -> list[str]: ...
    def as_dict(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> MeanResult: ...
    @property
    def sigma(self) -> _Array | None: ...
    def confidence_region(self, probability: float = 0.95) -> ConfidenceRegion: ...
    def p_value(self, x: Manifold) -> Any: ...
    def _repr_html_(self) -> str: ...

class Gaussian:
    mean: Any
    covariance: _Array
    def __init__(self, mean: Manifold, covariance: ArrayLike, convention: _Convention = "body") -> None: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def sigma(self) -> _Array: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: Any) -> Gaussian: ...
    def __mul__(self, other: Gaussian | Group) -> Gaussian: ...
    def __rmul__(self, other: Group) -> Gaussian: ...
    def product_fourth_order(self, other: Gaussian | Group) -> Gaussian: ...
    def inv(self) -> Gaussian: ...
    def between(self, other: Gaussian | Group) -> Gaussian: ...
    def moved(self, by: Any) -> Gaussian: ...
    def transported(self, to: Manifold) -> Gaussian: ...
    def in_convention(self, convention: _Convention) -> _Array: ...
    def mahalanobis(self, x: Manifold | Gaussian) -> Any: ...
    def confidence_region(self, probability: float = 0.95, law: Law | None = None) -> ConfidenceRegion: ...
    def sample(self, size: _Shape | None = None, rng: _Rng = None) -> Any: ...

class CounterRng:
    seed: int
    trial: int
    stream: int
    def __init__(self, seed: int, trial: int = 0, stream: int = 0) -> None: ...
    def standard_normal(self, shape: Sequence[int]) -> _Array: ...
    def uniform(self, shape: Sequence[int]) -> _Array: ...

class ValidationReport:
    passed: bool
    verdict: str
    reason: str
    index: float
    expected_index: float
    index_se: float
    index_p_value: float
    coverage: dict[float, float]
    ks_statistic: float
    ks_p_value: float
    trials: int
    failures: int
    exceptions: int
    distances: _Array
    law: Law
    def __init__(self, fields: dict[str, Any], distances: _Array, law: Law) -> None: ...

def mean(
    x: Manifold,
    weights: ArrayLike | None = None,
    covariances: ArrayLike | None = None,
    axis: _Axis = None,
    criterion: Literal["lsq", "wlsq", "maha", "barycentre"] | None = None,
    certify: bool = True,
    *,
    covariance_at: _CovarianceAt = None,
    likelihood: bool = False,
    times: ArrayLike | None = None,
    inflate: bool = False,
    budget: int | None = None,
    threads: int = 0,
) -> MeanResult: ...
def validate_split(
    x: Manifold,
    weights: ArrayLike | None = None,
    covariances: ArrayLike | None = None,
    times: ArrayLike | None = None,
    criterion: Literal["lsq", "wlsq", "maha", "barycentre"] | None = None,
    *,
    covariance_at: _CovarianceAt = None,
    likelihood: bool = False,
    splits: int = 200,
    blocks: int = 10,
    seed: int = 1,
    threads: int = 0,
) -> Result: ...
def group_mean(
    x: Group,
    weights: ArrayLike | None = None,
    axis: _Axis = None,
    certify: bool = True,
    *,
    budget: int | None = None,
    threads: int = 0,
) -> MeanResult: ...
def mahalanobis(
    x: Manifold, covariance: ArrayLike, y: Manifold, y_covariance: ArrayLike | None = None, threads: int = 1
) -> Any: ...
def fuse(
    x: Manifold | Gaussian,
    covariances: ArrayLike | None = None,
    axis: _Axis = None,
    *,
    covariance_at: _CovarianceAt = None,
) -> Gaussian: ...
def convert_covariance(
    x: Manifold,
    covariance: ArrayLike,
    to: _Convention = "body",
    *,
    source: _Convention = "body",
    threads: int = 1,
) -> _Array: ...
def propagate(
    function: Callable[..., Any],
    *inputs: Any,
    jacobian: Any = None,
    joint_covariance: ArrayLike | None = None,
    step: float = 6e-6,
) -> Any: ...
def sample(mean: _M, covariance: ArrayLike, size: _Shape | None = None, rng: _Rng = None) -> _M: ...
def random_rotations(size: _Shape | None = None, rng: _Rng = None) -> SO3: ...
def random_directions(size: _Shape | None = None, rng: _Rng = None) -> S2: ...
def validate(
    estimator: Callable[[Any], Any],
    draw: Callable[[np.random.Generator], tuple[Any, Any]],
    *,
    trials: int = 1000,
    seed: int = 0,
    law: Law | None = None,
    false_alarm: float = 1e-5,
    tolerance: float = 0.0,
    failure_fraction: float = 0.0,
    ks_tolerance: float = 0.0,
    tail: float = 0.0,
) -> ValidationReport: ...

class Result:
    def __init__(self, title: str, *, renamed: dict[str, str] | None = None, **parts: Any) -> None: ...
    @classmethod
    def of(cls, title: str, parts: dict[str, Any], renamed: dict[str, str] | None = None) -> Self: ...
    def keys(self) -> list[str]: ...
    def __getitem__(self, name: str) -> Any: ...
    def __getattr__(self, name: str) -> Any: ...

class CalibratedPose(Result):
    @property
    def mean(self) -> SE3: ...
    @property
    def gaussian(self) -> Gaussian: ...

class TwoViewResult(Result):
    @property
    def relative_pose(self) -> Result | None: ...

class InitialisedWindow(Result):
    def block(self, row: str, column: str | None = None) -> _Array: ...

VI_BLOCKS: dict[str, int]

class Camera:
    fu: float
    fv: float
    cu: float
    cv: float
    distortion: str
    coefficients: tuple[float, ...]
    width: int
    height: int
    def __init__(
        self,
        fu: float,
        fv: float,
        cu: float,
        cv: float,
        distortion: Literal["none", "radtan", "equidistant"] = "none",
        coefficients: Sequence[float] = (0, 0, 0, 0),
        width: int = 0,
        height: int = 0,
    ) -> None: ...
    def bearings(self, pixels: ArrayLike, sigma: float = 1.0) -> tuple[_Array, _Array]: ...

def preintegrate(
    times: ArrayLike,
    rates: ArrayLike,
    forces: ArrayLike,
    begin: ArrayLike,
    end: ArrayLike,
    *,
    noise: ArrayLike = (0.0, 0.0),
    bias: ArrayLike | None = None,
    scheme: Literal["averaged", "held", "cubic"] = "averaged",
    max_gap: float = 0.1,
    threads: int = 0,
    truth: tuple[ArrayLike, SE23] | tuple[ArrayLike, SE23, ArrayLike] | None = None,
    gravity: float = 9.81,
) -> Result: ...
class TrajectoryEvaluation(Result):
    @property
    def consistency(self) -> Result | None: ...

def evaluate_trajectory(
    reference: SE3,
    estimate: SE3,
    covariances: ArrayLike | None = None,
    *,
    reference_times: ArrayLike | None = None,
    times: ArrayLike | None = None,
    reference_covariances: ArrayLike | None = None,
    association: Literal["interpolate", "nearest"] = "interpolate",
    interpolation: Literal["geodesic", "slerp"] = "geodesic",
    max_gap: float | None = None,
    t_max_diff: float = 0.01,
    t_offset: float = 0.0,
    t_start: float | None = None,
    t_end: float | None = None,
    pose_relation: _PoseRelation = "trans_part",
    alignment: _Alignment = "none",
    verdict_alignment: _Alignment | None = None,
    n_to_align: int = 0,
    project_to_plane: Literal["xy", "xz", "yz"] | None = None,
    change_unit: Literal["mm", "cm", "m", "km", "deg", "rad"] | None = None,
    downsample: int = 0,
    motion_filter: tuple[float, float] | None = None,
    delta: float = 1.0,
    delta_unit: Literal["f", "d", "r", "m"] = "f",
    delta_tol: float = 0.1,
    all_pairs: bool = False,
    pairs_from_reference: bool = False,
    pairs_model: Literal["independent", "chain"] | None = None,
) -> TrajectoryEvaluation: ...
def hand_eye(
    a: SE3,
    b: SE3,
    a_covariance: ArrayLike,
    b_covariance: ArrayLike,
    *,
    relative: bool = False,
    known_noise: bool = True,
    find_outliers: bool = True,
    gate: float = 22.457744484825327,
    samples: int = 80,
    seed: int = 1,
) -> Result: ...
def two_view(
    matches: ArrayLike,
    sigma: float = 1.0,
    camera: Camera | None = None,
    second_camera: Camera | None = None,
    *,
    image_size: Sequence[float] | None = None,
    seed: int = 1,
) -> Result: ...
def robust_two_view(
    model: Literal["homography", "fundamental", "pose"],
    matches: ArrayLike,
    sigma: float | tuple[float, float],
    *,
    confidence: float = 0.9999,
    threshold: float = 0.0,
    max_draws: int = 100000,
    seed: int = 1,
) -> Result: ...
def motion(
    frames: ArrayLike,
    tracks: ArrayLike,
    points: ArrayLike,
    sigma: float,
    *,
    flow: str = "automatic",
    filter: str = "automatic",
    frames_apart: int = 1,
    starts: int = 32,
    outliers: bool = False,
    bias: bool = False,
    bias_sigma: float = 0.02,
    process_noise: float = 1e-5,
    rotation_noise: float = 1e-6,
    passes: int = 1,
    gyroscope: ArrayLike | None = None,
    gyroscope_covariance: ArrayLike | None = None,
    seconds: float = 1.0,
    truth: SE3 | None = None,
    min_motion: float = 0.1,
    span: int | None = None,
    essential: bool | None = None,
) -> Result: ...
def vi_init(
    times: ArrayLike,
    rates: ArrayLike,
    forces: ArrayLike,
    noise: ArrayLike,
    image_times: ArrayLike,
    images: ArrayLike,
    tracks: ArrayLike,
    bearings: ArrayLike,
    sigmas: ArrayLike,
    *,
    body_T_camera: SE3 | None = None,
    cameras: ArrayLike | None = None,
    window: float = 2.0,
    stride: float = 0.0,
    image_rate: float = 10.0,
    consensus: bool = True,
    refinement: bool = True,
    stretch: float = 12.0,
    gravity: float | None = 9.81,
    gyroscope_sigma: float = 0.1,
    accelerometer_sigma: float = 0.15,
    seed: int = 1,
    truth: tuple[ArrayLike, SE23] | tuple[ArrayLike, SE23, ArrayLike] | None = None,
) -> Result: ...
def columns(x: Manifold) -> dict[str, _Array]: ...
def from_columns(kind: type[_M], table: Any) -> _M: ...
def read_features(
    path: Any,
    kind: type[Manifold] | None = None,
    *,
    format: str = "auto",
    norm_tolerance: float = 1e-3,
    angles: Literal["radians", "degrees"] | None = None,
    ignore_unknown: bool = False,
    columns: dict[str, str] | None = None,
) -> Result: ...
def read_imu(path: Any) -> Result: ...
def read_calibration(*paths: Any) -> Result: ...
def read_imu_noise(path: Any) -> _Array: ...
def read_ground_truth(path: Any, *, start_ns: int = 0) -> Result: ...
def read_stereo_tracks(path: Any) -> Result: ...
def read_camera_poses(path: Any) -> Result: ...
def read_stereo_camera(path: Any) -> Result: ...
def read_landmarks(path: Any) -> R3: ...
def read_matches(path: Any) -> _Array: ...
def read_pose_pairs(
    path_a: Any, path_b: Any, *, by_row: bool = False, tolerance: float = 0.01, norm_tolerance: float = 1e-3
) -> Result: ...
def read_trajectory(
    path: Any,
    convention: str | None = None,
    *,
    format: str = "auto",
    covariance_file: Any = None,
    layout: Literal["full36", "upper21", "lower21", "blocks12", "diag6"] | None = None,
    unmeasured_above: float = 9e4,
    columns: dict[str, str] | None = None,
    ignore_unknown: bool = False,
    norm_tolerance: float = 1e-3,
) -> Result: ...
def read_pose_graph(path: Any, *, ignore_unknown: bool = False, norm_tolerance: float = 1e-3) -> Result: ...
def write_trajectory(
    path: Any,
    poses: SE3,
    covariances: ArrayLike | None = None,
    *,
    format: str,
    times: Sequence[float | str] | _Array | None = None,
    convention: str | None = None,
    source: str = "right",
    frames: Sequence[str] = (),
) -> Result: ...
def convert_trajectory(
    poses: SE3,
    matrices: ArrayLike,
    source: str,
    to: str = "right",
    *,
    assume_uncorrelated: bool = False,
    sampled: bool = False,
    samples: int = 2000,
    seed: int = 1,
    lines: Sequence[int] | _Array | None = None,
) -> Result: ...
def diagnose_conventions(
    estimate: SE3 | Sequence[SE3],
    matrices: ArrayLike | Sequence[ArrayLike],
    truth: SE3 | None = None,
    *,
    times: ArrayLike | Sequence[ArrayLike] | None = None,
    truth_times: ArrayLike | None = None,
    no_truth: bool = False,
    plan: bool = False,
    all_units: bool = False,
    align: Literal["none", "posyaw", "se3", "sim3"] = "none",
    at: float | None = None,
    alpha: float = 1e-3,
    order: Literal["tr", "rt"] | None = None,
    content: Literal["covariance", "information", "sigmas"] | None = None,
    edges: bool = False,
    association: Literal["interpolate", "nearest"] = "interpolate",
    interpolation: Literal["geodesic", "slerp"] = "geodesic",
    max_gap: float | None = None,
    max_difference: float = 0.01,
    offset: float = 0.0,
) -> Result: ...
def read_tracks(path: Any, image_times: Any = "", *, start_ns: int = 0) -> Result: ...
