"""Statistics on Lie groups and homogeneous manifolds over NumPy arrays."""

from typing import Any, Callable, ClassVar, Iterable, Iterator, Literal, NamedTuple, Self, Sequence, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Array = NDArray[np.float64]
_Several = np.ndarray[Any, np.dtype[Any]]  # a value for each of several means
_T = TypeVar("_T")
_M = TypeVar("_M", bound="Manifold")
_G = TypeVar("_G", bound="Group")
_Shape = int | Sequence[int]
_Axis = int | tuple[int, ...] | None
_Rng = np.random.Generator | "CounterRng" | int | None
_CovarianceAt = Literal["measured", "estimated"] | None
_ConventionWord = Literal[
    "body", "left", "world", "rotation_first", "left_rotation_first", "world_rotation_first", "chart"
]
_AlignmentWord = Literal["none", "origin", "posyaw", "se3", "sim3", "scale"]
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
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> _Array: ...
    def __eq__(self, other: object) -> Any: ...
    def __ne__(self, other: object) -> Any: ...
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

class SO2(_Metric, Group):
    @classmethod
    def from_angle(cls, angle: ArrayLike, *, degrees: bool = False) -> SO2: ...
    def as_angle(self, *, degrees: bool = False) -> Any: ...

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

class MeanResult(_MeanSummary):
    law: Law
    labels: NDArray[Any]
    near_tie_z: _Array | _Several
    cost: float | _Several
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
    def plot(self, x: Manifold | None = None, ax: Any = None, probability: float = 0.95) -> Any: ...
    def p_value(self, x: Manifold) -> Any: ...
    def _repr_html_(self) -> str: ...

class Gaussian:
    mean: Any
    covariance: _Array
    factor: _Array | None
    def __init__(self, mean: Manifold, covariance: ArrayLike, convention: _ConventionWord = "body") -> None: ...
    @classmethod
    def from_factor(cls, mean: Manifold, factor: ArrayLike) -> Gaussian: ...
    @classmethod
    def from_deviations(cls, mean: Manifold, deviations: ArrayLike) -> Gaussian: ...
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
    def in_convention(self, convention: _ConventionWord) -> _Array: ...
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

class State:
    def __init__(
        self,
        feature: Literal["heading", "direction", "rotation"],
        after: State | None = None,
        *,
        largest_weight: float = 1.0,
    ) -> None: ...
    @classmethod
    def from_bytes(cls, data: Any) -> State: ...
    def add(self, x: Any, weights: ArrayLike | None = None) -> State: ...
    def result(self) -> dict[str, Any]: ...
    @property
    def feature(self) -> Literal["heading", "direction", "rotation"]: ...
    @property
    def kind(self) -> Literal["moments", "sums"]: ...
    @property
    def passes(self) -> int: ...
    @property
    def n(self) -> int: ...
    @property
    def left_out(self) -> int: ...
    def __add__(self, other: State) -> State: ...
    def __radd__(self, other: int) -> State: ...
    def __bytes__(self) -> bytes: ...
    def __eq__(self, other: object) -> bool: ...
    __hash__: ClassVar[None]  # type: ignore[assignment]
    def __reduce__(self) -> Any: ...

def mean(
    x: Any,
    weights: ArrayLike | None = None,
    covariances: ArrayLike | None = None,
    axis: _Axis = None,
    criterion: Literal["lsq", "wlsq", "maha", "barycentre"] | None = None,
    certify: bool = True,
    *,
    factors: ArrayLike | None = None,
    deviations: ArrayLike | None = None,
    covariance_at: _CovarianceAt = None,
    likelihood: bool = False,
    times: ArrayLike | None = None,
    refuted: Literal["withheld", "residuals"] = "withheld",
    birge: bool = False,
    weights_are: Literal["precision", "importance", "frequency"] = "precision",
    region: Literal["law", "bootstrap"] = "law",
    inflate: bool = False,
    budget: int | None = None,
    threads: int = 0,
    symmetry: str | None = None,
    hexagonal_axes: Literal["a", "a*"] = "a",
    keepdims: bool = False,
    by: ArrayLike | None = None,
    robust: Literal["huber", "median"] | None = None,
    nan_policy: Literal["raise", "omit"] = "raise",
) -> MeanResult: ...
class _Split(_SplitSummary):
    verdict: str
    causes: list[str]

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
) -> _Split: ...
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
def fit(
    points: ArrayLike, model: str, sigma: float | None = None, *, birge: bool = False
) -> _FitSummary: ...
def fit_law(x: Manifold, law: str, *, seed: int = 1) -> _LawFit: ...
def compare(
    *groups: Manifold,
    by: ArrayLike | None = None,
    paired: bool = False,
    level: float = 0.05,
    seed: int = 1,
) -> _GroupComparison: ...
def fuse(
    x: Manifold | Gaussian,
    covariances: ArrayLike | None = None,
    axis: _Axis = None,
    *,
    factors: ArrayLike | None = None,
    deviations: ArrayLike | None = None,
    covariance_at: _CovarianceAt = None,
) -> Gaussian: ...
class FuseResult(NamedTuple):
    estimate: Gaussian
    status: Any
    fit: Any
    fit_dof: int
    fit_p: Any
    fit_factor: Any

def tested_fuse(
    x: Manifold | Gaussian,
    covariances: ArrayLike | None = None,
    axis: _Axis = None,
    *,
    factors: ArrayLike | None = None,
    deviations: ArrayLike | None = None,
    covariance_at: _CovarianceAt = None,
) -> FuseResult: ...
def convert_covariance(
    x: Manifold,
    covariance: ArrayLike,
    to: _ConventionWord = "body",
    *,
    source: _ConventionWord = "body",
    threads: int = 1,
) -> _Array: ...
def mean_about(x: _M, weights: ArrayLike, reference: _M) -> Gaussian: ...
def unscented_transform(
    function: Callable[[Any], Any], gaussian: Gaussian, c: float = 3.0
) -> tuple[Any, _Array]: ...
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
    failure_fraction: float | None = None,
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

# fields of results, written by ./run generate
class _MeanSummary:
    feature: str | _Several  # text; the type of the measurements
    # text; orientations of crystals: the proper point group that they are modulo; R and R k are equal
    symmetry: str | _Several
    criterion: str | _Several  # text; lsq, wlsq, maha, barycentre, huber or median
    # text or null; frame of the measurements' covariances; null where it does not matter
    covariance_at: str | _Several | None
    likelihood: bool | _Several  # bool; whether the volume element is in the criterion
    # text or null; precision, importance or frequency: what the weights mean to a covariance from residuals
    weights_are: str | _Several | None
    weighted: bool | _Several  # bool; whether weights were used
    n: int | _Several  # integer; measurements that count: those with a weight
    # text; ok, not_converged, ambiguous, ill_defined, inconsistent or too_few; not_applicable: a mean, but no covariance can be computed
    status: str | _Several
    reason: str | _Several | None  # text or null; in words, where status is not ok
    verdict: str | _Several  # text; a sentence: the mean with its certificate, or why it is not to be trusted
    # bool; the verdict: whether the mean may be used; unique says no more than its certificate
    trusted: bool | _Several
    converged: bool | _Several  # bool
    iterations: int | _Several  # integer
    residual: float | _Several  # number; norm of the last step
    tolerance: float | _Several  # number; of the norm of the last step
    mean: Any  # object; the parts that the feature has
    covariance: _Array | None  # n×n or null; of the mean, in its own axes; null where it is withheld
    covariance_factor: _Array  # n×n; F with F Fᵀ the covariance, where factors or deviations were given
    covariance_status: str | _Several  # text; why there is no covariance; otherwise ok
    covariance_order: str | _Several  # text; coordinates of the covariance, with units
    covariance_side: str | _Several  # text; on which its errors are applied
    covariance_frame: str | _Several  # text; its axes
    tangent_basis: _Array | None  # 3×2 or null; directions: the axes of the two tangent coordinates, in columns
    covariance_from: str | _Several | None  # text or null; noise or residuals
    covariance_law: str | _Several | None  # text or null; of squared distances from the truth: chi2 or hotelling
    # number or null; measurements for Hotelling's law: n, fewer in effect where weights are no precisions
    covariance_law_n: float | _Several | None
    # text or null; law or bootstrap: what the covariance with the 95 % quantile of covariance_law is a region by
    region: str | _Several | None
    # number or null; by which a bootstrap widened the standard deviations for the noise's skewness; 1: not at all
    skew_factor: float | _Several | None
    # by name or null; along the axes of the mean: rotation_deg, translation_m, point_m, direction_deg
    standard_deviations: dict[str, Any] | _Several | None
    # by name or null; translation_m of frames along the axes of the world
    standard_deviations_world: dict[str, Any] | _Several | None
    dispersion: _Array | None  # n×n or null; the measurements' covariance about the mean
    # by name or null; as standard_deviations_world
    dispersion_standard_deviations_world: dict[str, Any] | _Several | None
    dispersion_standard_deviations: dict[str, Any] | _Several | None  # by name or null; as standard_deviations
    # list of objects; the farthest measurement in each part of the tangent vector
    farthest: list[dict[str, Any]] | _Several
    unique: Uniqueness | _Several  # text; unique, ambiguous or not_certified
    proof: str | _Several  # text; of uniqueness, in words
    rivals: Any  # list of objects; other minimisers of equal cost
    rivals_complete: bool | _Several  # bool; false: there are more, such as a circle, or the search ended early
    r_star: float | _Several  # number; radius in which the criterion is convex and has no other minimum; rad
    cells: int | _Several  # integer; of the global search; 0: it was not needed
    near_ties: Any  # list of objects; other minima that the noise does not exclude, which make the status ambiguous
    cut_locus_mass: float | _Several  # number; fraction of the measurements near the cut locus of the mean
    hessian_change: float | _Several  # number; relative decrease of the Hessian averaged over the confidence region
    # number; by which the confidence region was widened to the features that explain the data as well; 1: not at all
    region_factor: float | _Several
    # object or null; the farthest of these that was found, on a ring or in a valley; null without
    valley: dict[str, Any] | _Several | None
    valley_angle: float | _Several | None  # number or null; its angle from the mean; rad
    # list of objects; of a robust mean: the median distance from the geodesic median over that of a normal law
    scales: list[dict[str, Any]] | _Several
    # list of objects; of a robust mean: measurements with a family-wise p below 0.05, the surest first
    outliers: list[dict[str, Any]] | _Several
    # number; of a robust mean: probability of outliers so much on one side if errors are symmetric
    shift_p: float | _Several
    # number or null; χ² of the measurements under the noise that is stated for them; null: not tested
    fit: float | _Several | None
    fit_dof: float | _Several | None  # number or null; its degrees of freedom
    # number or null; probability of so large a χ²; below 0.001 the stated noise is refuted
    fit_p: float | _Several | None
    fit_factor: float | _Several | None  # number or null; Birge's factor max(1, χ²/ν) of the stated covariances
    noise_scaled: bool | _Several  # bool; whether the covariance is multiplied by it
    lag_correlation: float | _Several | None  # number or null; of successive measurements' errors
    # number or null; correlation of log weights with p·r², in standard deviations; beyond 3.3 the weights are no inverse variances
    weight_z: float | _Several | None
    lag_z: float | _Several | None  # number or null; the same in standard deviations; above 2.45 a note says so
    skewness: float | _Several | None  # number or null; Mardia's, of the errors; zero but for chance if symmetric
    skewness_p: float | _Several | None  # number or null; probability of so large a one of normal errors
    time_dependence: str | _Several  # text; in words
    time_dependence_tested: bool | _Several  # bool; whether
    independence: float | _Several  # number; probability that the errors are independent in time; null: untested
    correlated_share: float | _Several  # number; of the variance, where they are not
    correlation_time: float | _Several  # number; s
    unequal_axes: bool | _Several  # bool; the errors' sizes are not in the stated ratios
    correlation_factor: float | _Several  # number; mean factor of the variances that dependence and sizes ask for
    inflated: bool | _Several  # bool; whether the covariance is widened by the dependence on time
    notes: list[str] | _Several  # list of text; what is remarkable, in sentences

class _SplitSeries(Result):
    splits: int  # that were done
    failures: int  # splits without an estimate, left out
    index: float  # mean squared distance of the halves
    index_expected: float
    index_se: float  # standard error of the index
    effective_dof: float  # degrees of freedom of the index
    p: float  # probability of so large an index, if errors are independent
    factor: float  # index over what is expected
    factor_low: float  # lower end of its 95 % interval
    factor_high: float  # upper end

class _FeatureValue(Result):
    quaternion_xyzw: _Array  # w >= 0
    rotation_vector: _Array  # rad
    translation: _Array  # m
    velocity: _Array  # m/s
    point: _Array  # m
    direction: _Array  # unit vector
    heading_deg: float  # from 0 to 360; deg
    parameters: _Array  # of features that have none of these

class _SplitHalf(Result):
    n: int  # measurements
    mean: _FeatureValue
    covariance: _Array | None  # of the mean, in its own axes
    standard_deviations: Result | None  # by parts, in degrees and metres

class _SplitSummary(Result):
    feature: str  # the type of the measurements
    dof: int  # degrees of freedom of a measurement
    known_noise: bool  # covariances follow from those of the measurements, not from residuals
    splits: int  # of each kind
    blocks: int  # of time
    random: _SplitSeries  # halves drawn at random
    by_blocks: _SplitSeries  # halves made of alternating blocks of time
    inflation: float  # by which the covariance of the mean is too small
    inflation_low: float  # lower end of its 95 % interval
    inflation_high: float  # upper end
    false_alarm: float  # probability that independent errors fail
    passed: bool  # halves made of blocks agree; false after an interrupt
    interrupted: bool  # only then
    trials_done: int  # splits of both kinds
    trials_planned: int  # splits of both kinds
    n: int  # measurements
    criterion: str
    covariance_at: str | None  # frame of the measurements' covariances; null where it does not matter
    covariance_order: str  # coordinates of the covariance, with units
    covariance_side: str  # on which its errors are applied
    covariance_frame: str  # its axes
    first: _SplitHalf  # the first half in time
    second: _SplitHalf
    merged: _SplitHalf  # both halves fused
    squared_distance: float  # of the halves in time
    law: str  # of that distance: chi2 or hotelling
    p: float  # probability of a larger distance

class _ErrorStatistics(Result):
    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    sse: float  # sum of squares

class _Alignment(Result):
    model: str  # none, origin, posyaw, se3, sim3 or scale
    weighted: bool  # by the covariances
    ok: bool  # the poses determine it
    scale: float  # of the estimate
    translation: _Array  # of the world; m
    quaternion_xyzw: _Array  # of the world
    parameters: int  # that were estimated
    poses: int  # from which it was estimated
    condition: float  # of the information matrix
    covariance: _Array  # m, rad, 1
    covariance_order: str  # in words

class _MisfitExplanation(Result):
    faults: list[str]  # that hold together
    text: str  # in words, with what undoes them
    explained: float  # share of the squared errors
    delay: float  # to be added to the estimate's times; s
    delay_sigma: float  # its sd; s
    time_factor: float  # of the estimate's times
    scale: float  # of the estimate's positions
    scale_sigma: float  # its sd
    body_translation: _Array  # estimate's body to the reference's; m
    body_quaternion_xyzw: _Array  # likewise
    world_translation: _Array  # the estimate's world in the reference's; m
    world_quaternion_xyzw: _Array  # likewise
    position_rmse: float  # that remains; m
    rotation_rmse: float  # that remains; rad

class _MisfitSearch(Result):
    searched: bool  # faults of the whole trajectory were looked for
    reason: str  # why not
    sentence: str  # what explains the errors; empty: nothing
    position_rmse: float  # before; m
    rotation_rmse: float  # before; rad
    explanations: list[_MisfitExplanation]  # several cannot be told apart by the motion

class _ResidualTest(Result):
    statistic: float
    degrees_of_freedom: float
    ratio: float  # 1 is expected
    p: float  # probability of a statistic as extreme, if the covariances are right

class _WhitenedResidualTests(Result):
    joint_nees: _ResidualTest
    position_nees: _ResidualTest
    rotation_nees: _ResidualTest
    mean: _ResidualTest
    covariance: _ResidualTest
    tail: _ResidualTest
    lag: _ResidualTest
    gross: _ResidualTest  # NEES that a fifth of the poses exceed; p holds whatever the dependence of the errors

class _SegmentErrors(Result):
    length: float  # along the reference; m
    pairs: int  # segments
    translation: _ErrorStatistics  # m
    rotation: _ErrorStatistics  # deg

class _TrajectoryEvaluation(Result):
    reference_poses: int  # their number
    association: str  # in words
    ape_unit: str  # m, deg, … or empty
    rpe_unit: str  # likewise
    pairs_model: str | None  # independent or chain: the errors of a pair
    verdict: str  # the verdict in a sentence
    consistent: bool | None  # whether; null: no verdict
    causes: list[str]  # tests that speak against it, each with its likely cause
    poses: int  # of the estimate
    matched: int  # of them that have a partner
    by_time: bool  # false: pose i with pose i
    ape: _ErrorStatistics  # absolute errors
    rpe: _ErrorStatistics  # relative errors
    rpe_pairs: int  # pairs of RPE
    alignment: _Alignment  # of APE and RPE
    interpolation_position: float  # error of the interpolated reference, rms; m
    interpolation_rotation: float  # likewise; rad
    weighted_alignment: _Alignment  # of the verdict
    covariance_convention: str | None  # of the file; null: it has no covariances
    misfit: _MisfitSearch  # faults of the whole run that are no noise
    judged: str  # components of the errors that carry noise
    omissions: list[str]  # the other components, with the reason
    tests: _WhitenedResidualTests  # of the whitened errors
    rpe_nees: _ResidualTest | None  # of relative motions
    indefinite: _Array  # matched poses whose covariance is not positive definite
    notes: list[str]  # what is remarkable, in sentences
    segments: list[_SegmentErrors]  # errors by the length of a segment
    rows: _Array  # of the estimate
    times: _Array  # s
    ape_errors: _Array  # ape_unit
    rpe_errors: _Array  # of the pairs; rpe_unit
    pairs_from: _Array
    pairs_to: _Array
    position_errors: _Array  # m
    rotation_errors: _Array  # rad
    errors: _Array  # after the weighted alignment, translation before rotation, body axes; m, rad
    covariances: _Array  # of the errors, row by row; m, rad
    nees: _Array  # chi-squared of the number of judged components

class _Convention(Result):
    name: str  # as --cov-from takes it
    order: str  # of the coordinates
    perturbation: str  # the side and the frame of the errors
    unit: str  # of the rotation
    content: str  # covariance or information
    layout: str  # of the numbers in a row

class _UnconvertedMatrix(Result):
    fault: str
    row: int  # of the pose, from 0
    found: str  # in words
    expected: str

class _TrajectoryConversion(Result):
    covariances: int  # their number
    covariance_from: _Convention | None  # null: the file has no covariances
    covariance_to: _Convention | None
    unknown: int  # matrices without any known entry
    partly_unknown: int  # matrices with some unknown entries
    assumed_uncorrelated: int  # matrices whose missing blocks were taken to be zero
    indefinite: int  # matrices that are not positive semidefinite
    zero_variances: int  # matrices with a variance of 0
    round_trip_bound: float  # rounding of there and back; sigma
    largest_rotation_sigma_rad: float  # rad
    beyond_first_order: int  # rotations for which the first order fails
    sampling_error: float  # standard error of sampled variances, relative
    notes: list[str]
    matrices: _Array  # in the convention of the result
    faults: list[_UnconvertedMatrix]  # matrices that were not converted

class _ChainFit(Result):
    convention: str  # as --cov-from takes it
    indefinite: float  # share of the steps in which the covariance shrinks

class _ChainDiagnosis(Result):
    steps: int  # from pose to pose
    is_chain: bool  # some convention makes it dead reckoning
    accepted: list[str]  # conventions that do
    reason: str  # in words
    increments_nees: float  # of the steps, over its degrees of freedom
    increments_p: float  # probability of a NEES as extreme
    fits: list[_ChainFit]  # conventions, the smallest share first

class _ScaleProfile(Result):
    convention: str  # in which the scales are measured
    translation: float  # scale of the block, in variance
    rotation: float  # scale of the block, in variance
    relative_sigma: float  # of each
    words: list[str]  # the scales by their names

class _HypothesisFit(Result):
    convention: str  # as --cov-from takes it
    fault: str  # in how the matrices were written, which was undone first
    log_likelihood: float  # relative to the best one; nats
    nees_ratio: float  # NEES over its degrees of freedom
    indefinite: int  # matrices that are not positive definite

class _PlanRow(Result):
    convention: str  # the truth
    nearest: str  # the other convention that is hardest to exclude
    divergence: float  # of the nearest; nats per pose
    poses: float  # that tell them apart; 0: none
    equal: list[str]  # conventions that write the same matrices here

class _CovarianceDiagnosis(Result):
    file_notes: list[str]  # what is remarkable in the files
    sentence: str  # the verdict in a sentence
    # one convention, and the errors follow it; false: they do not; null: undecidable. True for a plan
    decided: bool | None
    mode: str  # diagnosis, chain or plan
    what: str  # the matrices belong to: poses, edges, or runs at a time
    n: int  # matrices
    structure: list[str]  # the looks of the matrices
    indefinite: int  # matrices that are not positive definite
    misfit: _MisfitSearch  # faults of the whole run that are no noise
    chain: _ChainDiagnosis  # whether it is dead reckoning
    verdict: str  # identified, undecidable, inconsistent or none
    reason: str  # in words
    notes: list[str]  # further findings
    accepted: list[str]  # that explain the errors
    fault: str  # in how the matrices were written
    skipped: int  # poses without a usable matrix
    margin: float  # within which hypotheses are accepted; nats
    correlated: bool  # neighbouring errors are, so that absolute errors decide nothing
    exact_coordinates: bool  # of each hypothesis, as the errors are large
    increments_as_absolute: bool  # the matrices are those of single steps
    growth: float  # NEES of the second half over the first
    tests: _WhitenedResidualTests  # under the best hypothesis
    generic_p: float  # of the best hypothesis against alternatives outside of the list
    scale: _ScaleProfile | None  # scales of the blocks, where they are free
    hypotheses: list[_HypothesisFit]  # the best first; empty if correlated
    plan: list[_PlanRow]  # with --plan: a row for each convention

class _RecordingWindow(Result):
    begin: float  # s
    status: str  # ok, or the fault of the readings
    duration: float  # s
    largest_gap: float  # between readings; s
    fault_time: float  # of the reading that is at fault, if any; the fields below are then missing; s
    quaternion_xyzw: _Array
    rotation_vector: _Array  # rad
    position: _Array  # m
    velocity: _Array  # m/s
    covariance: _Array | None  # 9 errors in m, rad, m/s; null without noise
    rate: float  # of the readings: the variance of one is the square of the density times this; Hz
    sampling: str  # adequate, untested, rough, undersampled or bunched
    # squared length of the integration scheme's error, which the covariance has, in standard deviations of the noise
    scheme_error: float | None
    bias_jacobian: _Array  # by the biases of gyroscope and accelerometer
    error: _Array  # with a truth: position, rotation, velocity; m, rad, m/s
    squared_distance: float  # of the error, 9 expected; with a truth and noise

class _RecordingWindows(Result):
    covariance_order: str  # of the windows' covariances
    covariance_side: str  # on which errors are applied
    covariance_frame: str  # in words
    windows: list[_RecordingWindow]
    notes: list[str]  # what the readings say about the increments, besides their faults
    squared_distance: float  # with a truth and noise: sum over the windows
    degrees_of_freedom: float  # of the sum
    p: float  # probability of a larger sum
    verdict: str  # the verdict in a sentence
    consistent: bool | None  # whether; null: no verdict
    causes: list[str]  # tests that speak against it, each with its likely cause

class _ClosedFormSolution(Result):
    velocity: _Array  # m/s
    gravity: _Array  # m/s²
    accelerometer_bias_change: _Array  # against the one with which the readings were integrated; m/s²
    roll: float  # rad
    pitch: float  # rad
    cost: float  # chi-squared, or squared residuals
    negative_depths: int  # features behind a camera
    features: _Array  # a row for each track; null: not used; m

class _TrackedFeature(Result):
    track: int  # its name
    observations: int  # images that see it
    used: bool
    residual: float  # of its equations
    parallax: float  # rad
    depth_deviation: float  # standard deviation of its depth; m

class _SecondMotion(Result):
    tracks: int  # that agree on it
    velocity: _Array  # m/s
    gravity: _Array  # m/s²
    covariance: _Array  # if it is known

class _TimedState(Result):
    t: float  # s
    quaternion_xyzw: _Array
    position: _Array  # m
    velocity: _Array  # m/s

class _TimedRefinement(Result):
    status: str  # refined, or why not: then the fields from scale_sigma on are missing
    consistent: bool  # the cost is that of the stated noise
    cost: float  # chi-squared
    degrees_of_freedom: int  # of the cost
    features_used: int
    scale_sigma: float  # predicted standard deviation of the scale, relative
    tilt_sigma: float  # that of the vertical; rad
    prior_p: float  # of the biases under their prior
    velocity: _Array  # m/s
    gravity: _Array  # m/s²
    gyroscope_bias: _Array  # at the first image; rad/s
    accelerometer_bias: _Array  # at the first image; m/s²
    last_gyroscope_bias: _Array  # at the last image: another one if biases follow a random walk; rad/s
    last_accelerometer_bias: _Array  # m/s²
    covariance: _Array  # at the first image
    covariance_order: str  # in words
    covariance_frame: str  # in words
    covariance_content: str  # noise that it accounts for
    last_covariance: _Array  # at the last image
    last_covariance_order: str  # in words
    last_covariance_side: str  # in words
    states: list[_TimedState]  # at all images
    features: _Array  # those that were used; m

class _InitialisationError(Result):
    speed: float  # m/s
    gravity: float  # of its direction; rad
    scale: float  # relative

class _ComparedWindow(Result):
    begin: float  # s
    end: float  # s
    status: str  # of the whole window
    ok: bool  # the window is to be trusted
    images: int  # the number of those used
    tracks: int  # the number of those used
    fault_time: float  # of readings at fault; the fields below are then missing; s
    closed_form_status: str
    in_words: str  # the status of the closed form
    consistent: bool  # its cost is that of the stated noise
    null_dimension: int  # of the scaled linear system
    singular_values: _Array
    largest_singular_value: float
    solutions: list[_ClosedFormSolution]  # both, if there are two
    features: list[_TrackedFeature]  # of the tracks
    features_used: int  # their number
    features_rejected: int  # outliers
    images_used: int  # their number
    hypotheses: int  # random samples of the consensus
    degrees_of_freedom: int
    covariance: _Array | None  # of the closed form
    covariance_content: str  # noise that it accounts for
    covariance_order: str  # in words
    scale_deviation: float  # predicted standard deviation of the scale, relative
    tilt_deviation: float  # that of the vertical; rad
    # of a stationary window: uniform speed per metre of depth above which motion would have been detected; 1/s
    unseen_speed_per_depth: float
    second_motion: _SecondMotion | None  # of an ambiguous window: that on which another group of tracks agrees
    integrated_gyroscope_bias: _Array  # with which the readings were integrated; rad/s
    integrated_accelerometer_bias: _Array  # likewise; m/s²
    gyroscope_bias: _Array  # that was estimated; rad/s
    gyroscope_bias_status: str  # in words
    refined: _TimedRefinement | None  # by all measurements
    closed_form_error: _InitialisationError  # with a truth
    refined_error: _InitialisationError  # with a truth
    gyroscope_bias_error: float  # with a truth; rad/s
    nees: float  # with a truth: of velocity and gravity, 5 expected
    reason: str  # the status in words
    velocity: _Array | None  # at the first image, the best known; m/s
    gravity: _Array | None  # likewise; m/s²
    best_gyroscope_bias: _Array  # rad/s
    accelerometer_bias: _Array  # m/s²
    joint_covariance: _Array | None  # its blocks by `block`; None where the window was not refined
    scale_sigma: float  # relative
    tilt_sigma: float  # rad
    chi2: float
    image_indices: _Array
    track_names: _Array
    inliers: _Array

class _ComparedStretch(Result):
    begin: float  # s
    end: float  # s
    windows: int  # their number
    chi2: float  # of their disagreement
    degrees_of_freedom: int  # of chi2
    p: float  # probability of a larger chi2
    ok: bool  # windows met, and p is 0.001 or more, or the covariance was inflated
    status: str  # ok, inconsistent, untested (a single window: nothing could contradict it) or no_state
    inflation: float  # factor by which the covariances are too small
    inflated: bool  # the covariance was multiplied by it
    gravity_direction: _Array  # unit vector, downwards
    velocity: _Array  # m/s
    gyroscope_bias: _Array  # rad/s
    accelerometer_bias: _Array  # m/s²
    covariance: _Array
    covariance_order: str  # in words
    covariance_frame: str  # in words
    speed_error: float | None  # null without a truth; m/s
    gravity_error: float | None  # likewise; rad
    gyroscope_bias_error: float | None  # likewise; rad/s
    accelerometer_bias_error: float | None  # likewise; m/s²
    nees: float | None  # 11 expected

class _NoiseFactor(Result):
    factor: float  # of the densities
    low: float  # lower end of its 95 % interval; null: no bound
    high: float  # upper end

class _ImuNoise(Result):
    gyroscope: float  # rad/s/√Hz
    accelerometer: float  # m/s²/√Hz
    gyroscope_walk: float  # rad/s²/√Hz
    accelerometer_walk: float  # m/s³/√Hz

class _NoiseCalibration(Result):
    status: str
    # confirmed: the windows agree with the given densities; calibrated: they refute them; unverified_noise: they tell neither
    evidence: str
    windows: int  # that were refined
    meetings: int  # of windows, whose states must agree
    chi2: float  # with the given densities
    calibrated_chi2: float  # with those that were used
    degrees_of_freedom: int  # of both
    common: _NoiseFactor  # one factor for both sensors
    common_p: float  # probability that two factors explain so much more than one, if they are one
    separable: bool  # the windows tell the sensors apart
    gyroscope: _NoiseFactor
    accelerometer: _NoiseFactor
    noise: _ImuNoise  # the densities that were used

class _InitialisationErrors(Result):
    windows: int  # that were compared
    speed_median: float  # m/s
    speed_95: float  # 95 % quantile; m/s
    gravity_deg_median: float  # deg
    gravity_deg_95: float  # deg
    scale_percent_median: float  # %
    scale_percent_95: float  # %

class _FilterStart(Result):
    status: str  # ok, untested (of a single window), inconsistent or no_state
    convention: str  # of the covariance: liestat, openvins, gtsam or basalt
    t: float  # s
    from_rest: bool  # the body rests
    quaternion_xyzw: _Array  # body in the world, z upwards
    position: _Array  # in the world; m
    velocity: _Array  # in the world; m/s
    gyroscope_bias: _Array  # rad/s
    accelerometer_bias: _Array  # m/s²
    covariance: _Array  # position and heading are free: as the options say
    covariance_order: str  # in words

class _ComparedRecording(Result):
    ok: bool  # the result is to be trusted
    in_words: str  # the verdict
    causes: list[str]  # with a truth: tests that speak against it, each with its likely cause
    notes: list[str]  # on what the covariances rest on: unverified_noise
    # what the windows say of the densities; null: not asked for, or could not be
    noise_calibration: _NoiseCalibration | None
    images_outside: int  # that the readings do not cover
    bearing_noise: float  # standard deviation of the bearings; rad
    interrupted: bool  # only then
    windows_left: int  # not estimated, because of an interrupt
    gravity: float | None  # that was given; null: it was free; m/s²
    statuses: Result  # number of windows of each status
    closed_form_errors: _InitialisationErrors  # with a truth
    refined_errors: _InitialisationErrors  # with a truth
    gyroscope_bias_error_median: float  # with a truth; rad/s
    gyroscope_bias_error_95: float  # with a truth: 95 % quantile; rad/s
    nees_mean: float  # with a truth: 5 expected
    refined_chi2_per_degree: float  # 1 expected
    filter_start: _FilterStart  # state and covariance from which a filter starts
    frame: str  # in words
    windows: list[InitialisedWindow]
    fusions: list[_FusedWindows]  # of disjoint windows, for each stretch

class _PoseSigmas(Result):
    translation_m: _Array  # m
    rotation_vector_deg: _Array  # deg

class _LocalPoseSigmas(Result):
    translation_m: _Array  # m
    rotation_deg: _Array  # deg

class _CalibratedPose(Result):
    translation: _Array  # m
    quaternion_xyzw: _Array  # w >= 0
    rotation_vector: _Array  # rad
    covariance: _Array | None  # of local errors, m and rad
    covariance_frame: str  # in words
    # along the parent's axes; null along axes in which an open direction has a component
    standard_deviations: _PoseSigmas
    standard_deviations_local: _LocalPoseSigmas  # of the local errors, likewise

class _HandEyeInterpolation(Result):
    in_gaps: int  # pairs that keep the row nearby
    rms_translation: float  # of the error; m
    rms_rotation: float  # rad

class _OpenDirection(Result):
    excitation: float  # as in excitations
    weak: bool  # excited, but not enough to be trusted
    twist: _Array  # of X; m, rad
    frame: str  # of the twist
    twist_of_Y: _Array  # AX = YB; m, rad
    frame_of_Y: str  # of the twist of Y
    description: str  # in words
    rotates: bool  # it rotates X

class _HandEyeSuspectTest(Result):
    name: str
    unit: str  # of the estimate; empty: a ratio
    estimate: float  # that the residuals ask for; null: the parameters explain all that it would do
    standard_deviation: float  # of the estimate
    z: float  # deviation from zero in standard deviations
    p: float  # probability of a larger |z|
    significant: bool  # whether
    in_group: bool  # of the suspects that can't be told from the strongest
    prior_standard_deviation: float  # 0: taken for known; null: an unknown without a prior
    value: float  # that the calibration has taken
    value_standard_deviation: float
    shift_of_X: _Array  # local movement of X per unit of it; m, rad

class _PoseCoordinates(Result):
    translation: _Array  # m
    quaternion_xyzw: _Array  # w >= 0
    rotation_vector: _Array  # rad

class _HandEyeResult(Result):
    status: str  # ok, undetermined, ambiguous, inconsistent, not_converged or bad_input
    ok: bool  # the calibration is to be trusted
    in_words: str  # the status
    problem: str  # AX = YB or AX = XB
    X: CalibratedPose  # gripper_T_camera
    Y: CalibratedPose | None  # base_T_target
    covariance_order: str  # of the covariances
    covariance_side: str  # of the errors
    covariance_frame: str  # in words
    joint_covariance: _Array | None  # of X and Y
    joint_covariance_order: str | None  # in words
    chi2: float  # squared distance of the inliers from their corrected poses, in units of their noise
    degrees_of_freedom: int  # of chi2
    p: float  # probability of a larger chi2; null: the noise is not known
    variance_factor: float  # by which the given covariances were multiplied
    noise: str  # given or scaled
    time_dependence: str  # in words
    time_dependence_tested: bool  # whether
    independence: float  # probability that the errors are independent in time; null: untested
    correlated_share: float  # of the variance, where they are not
    correlation_time: float  # s
    unequal_axes: bool  # the errors' sizes are not in the stated ratios
    correlation_factor: float  # mean factor of the variances that dependence and sizes ask for
    interpolation: _HandEyeInterpolation | None  # of A at the times of B; null: rows nearby
    excitations: _Array  # of the six directions, ascending
    open_directions: list[_OpenDirection]  # that the motions leave open
    suspects: list[_HandEyeSuspectTest]  # what the equations take for known
    suspects_in_words: str  # those that the residuals speak for; empty: none
    X_over_suspects: CalibratedPose | None  # X as the mixture over the suspects that cannot be told apart
    X_over_suspects_covariance: _Array | None  # of local errors, m and rad
    rival: CalibratedPose | None  # X of a second solution
    starts: int  # that were compared
    outliers: _Array  # numbers of the wrong pairs, from 0
    errors: _Array  # of the pairs; m, rad
    pair_chi2: _Array  # 6 expected

class _PhysicalParameters(Result):
    names: list[str]
    units: list[str]  # rad or px
    values: _Array
    deviations: _Array  # standard deviations
    covariance: _Array  # of the values

class _RelativePose(Result):
    quaternion_xyzw: _Array
    direction: _Array  # of the translation, of length 1
    covariance: _Array  # of the tangent; rad
    covariance_order: str  # in words

class _TwoViewRival(Result):
    model: str
    inliers: int  # their number
    matrix: _Array  # homography or fundamental matrix of undistorted pixels, of norm 1
    matrix_acts_on: str  # its equation, in words
    matrix_covariance: _Array | None  # of its entries column after column
    # physical ones of the model; two sets for the two poses of a plane, otherwise one or none
    parameters: list[_PhysicalParameters]
    second_T_first: _RelativePose | None  # of the models with a pose
    curvature: str  # of the model on the scale of the noise: untested, small, widened or large

class _TwoViewSuspectTest(Result):
    name: str
    unit: str  # of the estimate; empty: a ratio
    estimate: float  # that the residuals ask for; null: the parameters explain all that it would do
    standard_deviation: float  # of the estimate
    z: float  # deviation from zero in standard deviations
    p: float  # probability of a larger |z|
    significant: bool  # whether
    in_group: bool  # of the suspects that can't be told from the strongest
    shift: float  # movement of the estimate per unit of the suspect, in standard deviations
    prior_standard_deviation: float  # 0: taken for known

class _TwoViewModelRow(Result):
    model: str
    parents: list[str]  # more general models
    free_parameters: int
    equations: int  # of a match
    evaluated: bool  # its draws came to their end
    draws: int  # random samples
    status: str | None  # of its estimate; null: there is none, and the fields below are missing
    inliers: int  # their number
    relevance: float  # by which models are compared
    chi2: float  # over its own inliers
    degrees_of_freedom: float  # of chi2
    rms: float  # noise that its inliers show; px
    excess_noise: float  # its variance over that of sigma; covariances are multiplied by it where it exceeds 1
    unsupported: bool  # its inliers could be chance
    rejection: str  # why the model was not chosen
    rejected_by: str | None  # the model that did it

class _TwoViewMotionEstimate(Result):
    matches: int  # all that were given
    sigma: float  # of each coordinate; px
    calibrated: bool  # with the cameras' intrinsics
    image_corner: _Array  # the upper left one; zero where the size is known; px
    image_size: _Array  # px
    size_from_matches: bool  # it is that of the matches' box
    repeated: int  # matches equal to another one, which counts for them
    contradicted: int  # matches that take no part, because they contradict each other
    status: str  # ok, too_few, not_applicable, not_converged, ill_defined, contested or inconsistent
    reason: str | None  # in words, where status is not ok
    model: str  # the chosen one
    inliers: int  # their number
    matrix: _Array  # homography or fundamental matrix of undistorted pixels, of norm 1
    matrix_acts_on: str  # its equation, in words
    matrix_covariance: _Array | None  # of its entries column after column
    # physical ones of the model; two sets for the two poses of a plane, otherwise one or none
    parameters: list[_PhysicalParameters]
    second_T_first: _RelativePose | None  # of the models with a pose
    curvature: str  # of the model on the scale of the noise: untested, small, widened or large
    rivals: list[_TwoViewRival]  # where status is contested: the other models of which one may be right
    # where status is contested: those of the chosen model that all rivals have, with a covariance that covers each
    shared_parameters: _PhysicalParameters | None
    suspects: list[_TwoViewSuspectTest]  # what the model takes for known of the cameras
    lattice: list[_TwoViewModelRow]  # all models
    inlier: _Array  # of each match
    squared_errors: _Array  # of each match, in units of the noise
    threshold: float  # of the chosen model, on squared errors

class _TwoViewStructure(Result):
    model: str
    status: str  # of the estimate from its own inliers
    reason: str | None  # in words, where status is not ok
    inliers: int  # their number
    rms: float  # noise that its inliers show; px
    matrix: _Array  # homography or fundamental matrix of undistorted pixels, of norm 1
    matrix_acts_on: str  # its equation, in words
    matrix_covariance: _Array | None  # of its entries column after column
    # physical ones of the model; two sets for the two poses of a plane, otherwise one or none
    parameters: list[_PhysicalParameters]
    second_T_first: _RelativePose | None  # of the models with a pose
    curvature: str  # of the model on the scale of the noise: untested, small, widened or large
    rivals: list[_TwoViewRival]  # where status is contested: the other models of which one may be right
    # where status is contested: those of the chosen model that all rivals have, with a covariance that covers each
    shared_parameters: _PhysicalParameters | None
    suspects: list[_TwoViewSuspectTest]  # what the model takes for known of the cameras

class _TwoViewMotions(Result):
    matches: int  # all that were given
    sigma: float  # of each coordinate; px
    calibrated: bool  # with the cameras' intrinsics
    image_corner: _Array  # the upper left one; zero where the size is known; px
    image_size: _Array  # px
    size_from_matches: bool  # it is that of the matches' box
    repeated: int  # matches equal to another one, which counts for them
    contradicted: int  # matches that take no part, because they contradict each other
    status: str  # as without --motions
    reason: str | None
    motions: list[_TwoViewStructure]  # in the order in which they were found
    motion: _Array  # of each match: the number of its motion, 0 for none

class _MotionFrame(Result):
    frame: int  # its number
    usable: bool  # the direction may be used
    meaning: str  # velocity: in the axes half-way; translation: over the interval, in the axes at its end
    filter: str  # in charge
    direction: _Array  # unit vector of the points' motion
    direction_covariance: _Array  # local frame of S2 at the estimate; rad^2
    rotation_vector: _Array  # over one frame; rad
    rotation_covariance: _Array  # along the first frame's camera axes; rad^2
    mean_inverse_depth: float  # |V|/Z, per frame
    sign_evidence: float  # for positive depths, in its standard deviations; above 2 it is decided
    innovation: float  # cost before the update over its degrees of freedom: 1 expected
    pairs: int  # usable pairs of points
    inliers: int  # those that the update used
    covariance_judged: bool  # the covariance claims to bound the error
    flags: list[str]  # that are raised
    no_gyroscope: str  # why there is no rotation of the gyroscope, if there is none
    gyroscope_bias: _Array  # if it is estimated: measured minus true, in the sensor's axes; rad/s
    gyroscope_bias_covariance: _Array  # rad^2/s^2
    direction_error_deg: float | None  # with a truth; null: unknown, or hardly any motion; deg
    rotation_error_deg: float | None  # with a truth, per frame; deg

class _MotionResult(Result):
    status: str  # ok if any frame may be used
    verdict: str  # how many frames may be used
    causes: list[str]  # flags that forbid the others
    frames_usable: int  # their number
    passes: int  # over the sequence
    with_gyroscope: bool  # rotations of a gyroscope were given
    frames_apart: int  # longest interval of a pair
    observations_outside: int  # without a ray ahead of the camera
    frames_without_gyroscope: int  # with a gyroscope: frames that have no rotation of it
    hand_overs: int  # to the essential filter
    fall_backs: int  # to the subspace filter
    motion_of: str  # in words
    covariance_order: str  # in words
    covariance_side: str  # on which errors are applied
    covariance_frame: str  # in words
    gyroscope_bias_of: str  # if it is estimated, in words
    frames: list[_MotionFrame]  # the motion of each
    median_direction_error_deg: float  # with a truth; deg
    median_rotation_error_deg: float  # with a truth, per frame; deg
    frame: _Array
    usable: _Array
    meaning: _Array
    filter: _Array
    direction: _Array
    direction_covariance: _Array
    rotation: _Array
    rotation_covariance: _Array
    mean_inverse_depth: _Array
    sign_evidence: _Array
    innovation: _Array
    pairs: _Array
    inliers: _Array
    covariance_judged: _Array
    bad_input: _Array
    too_few: _Array
    standstill: _Array
    degenerate: _Array
    ambiguous: _Array
    undecided_sign: _Array
    lost: _Array
    misfit: _Array
    gyroscope_refuted: _Array
    outliers: _Array

class _FitSummary(Result):
    model: str
    points: int
    status: str  # the status
    end: str  # how the iteration ended
    verdict: str  # the verdict in a sentence
    consistent: bool | None  # whether; null: no verdict
    causes: list[str]  # tests that speak against it, each with its likely cause
    names: list[str]  # of the parameters
    parameter: _Array
    covariance: _Array
    sigma: float  # standard deviation of a coordinate: stated, or that of the residuals
    sigma_stated: bool  # sigma was stated, and chi-squared tests it
    chi2: float
    degrees_of_freedom: int
    fit_p: float  # probability of a larger chi-squared; null: no sigma was stated
    birge_factor: float  # of the variances, where refuted noise is scaled
    curvature: str  # untested, small, widened or large
    widening: float  # factor of the covariance that the curvature asks for
    iterations: int
    distances: _Array  # of the points from the model, in their order

class _LawTest(Result):
    statistic: float
    degrees_of_freedom: int  # of chi-squared
    p: float

class _LawFit(Result):
    law: str
    n: int
    status: str  # the status
    reason: str
    verdict: str  # the verdict in a sentence
    consistent: bool | None  # whether; null: no verdict
    causes: list[str]  # tests that speak against it, each with its likely cause
    location: _Array  # mean direction, mode, or pole of a girdle: cos sin, x y z, or x y z w
    location_covariance: _Array  # in the local frame; rad²
    confidence_angles: _Array  # half axes of the 95 % region, the longest first; rad
    names: list[str]  # of kappa
    kappa: _Array  # concentrations
    kappa_covariance: _Array
    axes: _Array  # columns that kappa belongs to
    girdle: bool  # of bingham: the location is the pole of a great circle
    mean_resultant: float  # length of the mean vector; of vmf and von-mises
    log_likelihood: float  # relative to the uniform law
    uniformity: _LawTest  # likelihood ratio against the uniform law
    kind: _LawTest  # of bingham: a girdle against a symmetric cluster, or a cluster against a symmetric girdle
    symmetry: _LawTest  # against rotational symmetry about the location
    goodness: _LawTest  # moments against those of the law
    replicates: int  # of the bootstrap behind goodness.p; 0: by chi-squared

class _ComparedGroup(Result):
    name: str
    n: int
    offset: _Array  # of the group's mean, in the tangent space at the pooled mean
    dispersion: _Array  # covariance of a feature of the group

class _EqualityTest(Result):
    statistic: float
    numerator_dof: float  # of F; null: by resampling
    denominator_dof: float  # of F; null: by resampling
    p: float

class _ComparedPair(Result):
    first: int  # index of a group
    second: int  # index of a group
    difference: _Array  # of the means, second less first
    covariance: _Array  # of the difference
    means: _EqualityTest
    adjusted_p: float  # family-wise over all pairs, by Holm

class _GroupComparison(Result):
    status: str  # the status
    reason: str
    verdict: str  # the verdict in a sentence
    consistent: bool | None  # whether; null: no verdict
    causes: list[str]  # tests that speak against it, each with its likely cause
    paired: bool
    level: float  # of the verdict
    pooled_mean: _Array  # parameters of the feature in whose tangent space all is
    groups: list[_ComparedGroup]
    means: _EqualityTest  # equality of means, whatever the dispersions
    means_if_alike: _EqualityTest  # equality of means if dispersions are equal: Hotelling's or Wilks'
    dispersions: _EqualityTest  # equality of dispersions, by permutation
    pairs: list[_ComparedPair]  # of groups

# end of fields

class CalibratedPose(_CalibratedPose):
    @property
    def mean(self) -> SE3: ...
    @property
    def gaussian(self) -> Gaussian: ...

class TwoViewResult(_TwoViewMotionEstimate):
    @property
    def relative_pose(self) -> Result | None: ...

class InitialisedWindow(_ComparedWindow):
    states: SE23
    def block(self, row: str, column: str | None = None) -> _Array: ...

class _FusedWindows(_ComparedStretch):
    window_indices: _Array

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

class _Preintegrated(_RecordingWindows):
    increment: SE23
    covariance: _Array
    covariance_with_bias: _Array
    bias_jacobian: _Array
    faults: list[str]
    ok: Any

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
    rate: float = 0.0,
    world_rate: ArrayLike = (0.0, 0.0, 0.0),
) -> _Preintegrated: ...
class TrajectoryEvaluation(_TrajectoryEvaluation):
    pairs: _Array
    position: _ErrorStatistics
    rotation: _ErrorStatistics
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
    interpolation: Literal["cubic", "geodesic", "slerp"] = "cubic",
    max_gap: float | None = None,
    t_max_diff: float = 0.01,
    t_offset: float = 0.0,
    t_start: float | None = None,
    t_end: float | None = None,
    pose_relation: _PoseRelation = "trans_part",
    alignment: _AlignmentWord = "none",
    verdict_alignment: _AlignmentWord | None = None,
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
    misfit: bool = False,
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
    times: ArrayLike | None = None,
    suspect_sigmas: dict[str, float] | None = None,
    stream_of_a: tuple[ArrayLike, SE3] | None = None,
    interpolate: bool = False,
    largest_delay: float = 0.0,
) -> _HandEyeResult: ...
def two_view(
    matches: ArrayLike,
    sigma: float = 1.0,
    camera: Camera | None = None,
    second_camera: Camera | None = None,
    *,
    image_size: Sequence[float] | None = None,
    noise_is_known: bool = False,
    focal_sigma: float = 0.0,
    k1_sigma: float = 0.0,
    seed: int = 1,
) -> TwoViewResult: ...
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
class _Motion(_MotionResult):
    direction: Any  # S2
    rotation: Any  # SO3

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
) -> _Motion: ...
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
    calibrate_noise: bool = True,
    inflate: bool = False,
    filter_convention: Literal["liestat", "openvins", "gtsam", "basalt"] = "liestat",
    position_sigma: float = 1e-3,
    heading_sigma: float = 1e-3,
) -> _ComparedRecording: ...
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
def find_recording(folder: Any, camera: str | None = None) -> Result: ...
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
    time_unit: Literal["s", "ms", "us", "ns"] | None = None,
    duplicates: Literal["drop", "mean"] | None = None,
    largest_file: float = 1.0,
    frames: str | None = None,
) -> Result: ...
def read_bag(
    path: Any,
    topic: str | None = None,
    convention: str | None = None,
    *,
    frames: str | None = None,
    largest_file: float = 1.0,
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
class _Conversion(_TrajectoryConversion):
    sentence: str
    decided: bool | None

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
) -> _Conversion: ...
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
    misfit: bool = False,
    association: Literal["interpolate", "nearest"] = "interpolate",
    interpolation: Literal["cubic", "geodesic", "slerp"] = "cubic",
    max_gap: float | None = None,
    max_difference: float = 0.01,
    offset: float = 0.0,
    start: float | None = None,
    end: float | None = None,
) -> _CovarianceDiagnosis: ...
def read_two_view_pair(path: Any, family: Literal["homogr", "kusvod2", "adelaide-rmf", "evd"]) -> Result: ...
def read_two_view_pairs(directory: Any) -> list[Result]: ...
def track(
    paths: Any, times: Any = "", *, every: int = 1, tracks: int = 300, least: int = 8
) -> Result: ...
def read_tracks(path: Any, image_times: Any = "", *, start_ns: int = 0) -> Result: ...
