"""Features with covariances: conventions, propagation, fusion, sampling, validation."""

import math
import numbers
import typing
import warnings

import numpy as np

from . import _core
from ._manifolds import R3, S2, SO3, Group, Manifold
from ._operate import as_numbers, operate, require_finite
from ._results import ConfidenceRegion, Law
from ._statistics import _FRAMES, _axes, _covariances, _factored, _grouped, mahalanobis, require_manifold

#: Conventions of covariances that `convert_covariance` knows.
CONVENTIONS = ("body", "left", "world", "rotation_first", "left_rotation_first", "world_rotation_first", "chart")


def convert_covariance(x, covariance, to="body", *, source="body", threads=1):
    """A covariance at `x` from one convention to another.

    Parameters
    ----------
    x : an array of features
    covariance : array_like, shape (..., k, k)
    to, source : str
        'body'
            The library's: x·Exp(e), translation before rotation, axes of `x`.
        'left'
            Exp(e)·x, groups only (Barfoot).
        'world'
            Each part along the axes of the world, R ← Exp(δ)·R, t ← t + τ (ROS' PoseWithCovariance).
        'rotation_first', 'left_rotation_first', 'world_rotation_first'
            The same with rotation before translation (GTSAM: 'rotation_first').
        'chart'
            Of the principal chart, the logarithm at the origin (Pennec's report; ``np.cov`` of rotation vectors).

    Returns
    -------
    ndarray, shape (..., k, k)
    """
    x = require_manifold(x, "convert_covariance")
    kind = type(x)
    k = (kind.dof, kind.dof)
    c = _covariances(covariance, "convert_covariance: covariance", kind)
    for name, value in (("to", to), ("source", source)):
        if value not in CONVENTIONS:
            raise ValueError(f"convert_covariance: {name}: expected one of {', '.join(CONVENTIONS)}, got {value!r}")

    def call(name, at_feature):
        if name not in kind._operations:
            raise ValueError(f"convert_covariance: {kind.__name__} has no convention {name.split('_', 1)[1]!r}")
        operands = [("x", x.params, (kind.parameters,))] if at_feature else []
        return operate(kind._operations[name], "convert_covariance", [*operands, ("covariance", c, k)], k, threads)

    if source.endswith("rotation_first"):
        c = call("from_rotation_first", False)
        source = source[: -len("rotation_first")].rstrip("_") or "body"
    if source != "body":
        c = call("from_world_axes" if source == "world" else f"from_{source}", True)
    target = to[: -len("rotation_first")].rstrip("_") or "body" if to.endswith("rotation_first") else to
    if target != "body":
        c = call("to_world_axes" if target == "world" else f"to_{target}", True)
    if to.endswith("rotation_first"):
        c = call("to_rotation_first", False)
    return np.broadcast_to(c, np.broadcast_shapes((*x.shape, *k), c.shape)).copy() if c.shape[:-2] != x.shape else c


class Gaussian:
    """Features with the covariances of their errors, x·Exp(e), e ~ N(0, covariance).

    Parameters
    ----------
    mean : an array of features
    covariance : array_like, shape (..., k, k)
        In the axes of `mean` ("body"), m² and rad², translation before rotation; broadcast to the shape of `mean`.
    convention : str
        That of the given covariance, see `convert_covariance`.

    Attributes
    ----------
    factor : ndarray, shape (..., k, k), or None
        A with A Aᵀ the covariance, where it was made of one: the small variances have more digits in it. `fuse` uses it.
    """

    __slots__ = ("mean", "covariance", "factor")

    def __init__(self, mean, covariance, convention="body"):
        mean = require_manifold(mean, "Gaussian")
        c = _covariances(covariance, "Gaussian: covariance", type(mean), mean.shape)
        if convention != "body":
            c = convert_covariance(mean, c, source=convention)
        self.mean = mean
        self.factor = None
        self.covariance = c if c.shape[:-2] == mean.shape else np.broadcast_to(c, (*mean.shape, *c.shape[-2:]))

    @classmethod
    def _of(cls, mean, covariance, factor=None):
        self = object.__new__(cls)
        self.mean, self.covariance, self.factor = mean, covariance, factor
        return self

    @classmethod
    def from_factor(cls, mean, factor):
        """The Gaussian of the covariances A Aᵀ; ``factor`` is A, shape (..., k, k), broadcast to the shape of `mean`."""
        mean = require_manifold(mean, "Gaussian.from_factor")
        k = (mean.dof, mean.dof)
        a, _ = _factored("Gaussian.from_factor", None, factor, None, type(mean))
        a = np.broadcast_to(a, (*mean.shape, *k))
        c = a @ a.swapaxes(-1, -2)
        return cls._of(mean, (c + c.swapaxes(-1, -2)) / 2, a)

    @classmethod
    def from_deviations(cls, mean, deviations):
        """The Gaussian of standard deviations along the axes of `mean`, shape (..., k), m and rad."""
        mean = require_manifold(mean, "Gaussian.from_deviations")
        return cls.from_factor(mean, _factored("Gaussian.from_deviations", None, None, deviations, type(mean))[0])

    @property
    def shape(self):
        """Shape of the array of features."""
        return self.mean.shape

    @property
    def sigma(self):
        """ndarray, shape (..., k): standard deviations in the axes of the mean."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    def __len__(self):
        return len(self.mean)

    def __getitem__(self, index):
        mean = self.mean[index]
        if not isinstance(index, tuple):
            index = (index,)
        tail = (slice(None), slice(None)) if any(i is Ellipsis for i in index) else (Ellipsis, slice(None), slice(None))
        return Gaussian._of(mean, self.covariance[(*index, *tail)])

    def __repr__(self):
        sigma = ""
        if self.mean.single:
            sigma = ", sigma " + ", ".join(f"{s:.3g}" for s in self.sigma)
        return f"Gaussian({self.mean!r}{sigma})"

    def _call(self, name, operands, threads=1):
        kind = type(self.mean)
        k = (kind.dof, kind.dof)
        first = [("mean", self.mean.params, (kind.parameters,)), ("covariance", self.covariance, k)]
        return operate(kind._operations[name], f"Gaussian.{name}", [*first, *operands], k, threads)

    def _other(self, other):
        kind = type(self.mean)
        return [
            ("other", other.mean.params, (kind.parameters,)),
            ("other covariance", other.covariance, (kind.dof, kind.dof)),
        ]

    def _group(self, other):
        if isinstance(other, Group):
            other = Gaussian._of(other, np.zeros((*other.shape, other.dof, other.dof)))
        if not isinstance(other, Gaussian) or type(other.mean) is not type(self.mean):
            return None
        return other if isinstance(self.mean, Group) else None

    def __mul__(self, other):
        """The product of independent factors, covariance to first order; an exact factor may be a plain element."""
        other = self._group(other)
        if other is None:
            return NotImplemented
        return Gaussian._of(self.mean * other.mean, self._call("product_covariance", self._other(other)))

    def __rmul__(self, other):
        other = self._group(other)
        return NotImplemented if other is None else other * self

    def product_fourth_order(self, other):
        """The product of independent factors, covariance to fourth order in the noise (Barfoot and Furgale)."""
        other = self._group(other)
        if other is None:
            raise TypeError("product_fourth_order: expected a Gaussian of the same group")
        return Gaussian._of(
            self.mean * other.mean, self._call("product_covariance_fourth_order", self._other(other))
        )

    def inv(self):
        """The inverse; exact."""
        if not isinstance(self.mean, Group):
            raise TypeError(f"{type(self.mean).__name__} is not a group")
        return Gaussian._of(self.mean.inv(), self._call("inverse_covariance", []))

    def between(self, other):
        """``self.inv() * other`` of independent factors, first order."""
        other = self._group(other)
        if other is None:
            raise TypeError("between: expected a Gaussian of the same group")
        return Gaussian._of(self.mean.inv() * other.mean, self._call("between_covariance", self._other(other)))

    def moved(self, by):
        """Moved by exact transformations of the group that acts on the features."""
        group = type(self.mean)._group()
        if isinstance(self.mean, R3):
            return propagate(lambda x: x.moved(by), self)
        mean = self.mean.moved(by)
        return Gaussian._of(mean, self._call("moved_covariance", [("by", by.params, (group.parameters,))]))

    def transported(self, to):
        """The covariance carried to other features (parallel transport on the sphere, unchanged elsewhere)."""
        kind = type(self.mean)
        covariance = self._call("transported_covariance", [("to", self.mean._operand(to, "to"), (kind.parameters,))])
        return Gaussian._of(to, covariance)

    def in_convention(self, convention):
        """ndarray, shape (..., k, k): the covariance in another convention, see `convert_covariance`."""
        return convert_covariance(self.mean, self.covariance, convention)

    def mahalanobis(self, x):
        """Mahalanobis distances of features, or of Gaussians under both covariances."""
        if isinstance(x, Gaussian):
            return mahalanobis(self.mean, self.covariance, x.mean, x.covariance)
        return mahalanobis(self.mean, self.covariance, x)

    def confidence_region(self, probability=0.95, law=None):
        """The ellipsoid that covers the truth, under χ² or the given law; of a single feature."""
        if not self.mean.single:
            raise TypeError("confidence_region is that of one feature: index first")
        law = Law(self.mean.dof) if law is None else law
        return ConfidenceRegion(self.mean, np.ascontiguousarray(self.covariance), probability, law)

    def sample(self, size=None, rng=None):
        """See `sample`."""
        return sample(self.mean, self.covariance, size, rng)


class CounterRng:
    """The library's random numbers, functions of a counter (Philox 4×32-10).

    Element i of an array is drawn from ``(seed, trial + i, stream)``: the same numbers as in C++, however the work is
    divided. Each call counts on from the last.

    Parameters
    ----------
    seed, trial, stream : int
    """

    __slots__ = ("seed", "trial", "stream")

    def __init__(self, seed, trial=0, stream=0):
        self.seed, self.trial, self.stream = int(seed), int(trial), int(stream)

    def _draw(self, function, shape):
        rows = math.prod(shape[:-1])
        result = function(self.seed, self.trial, self.stream, rows, shape[-1]).reshape(shape)
        self.trial += rows
        return result

    def standard_normal(self, shape):
        """Standard normals of a shape (..., k), k from each counter."""
        return self._draw(_core.counter_normals, tuple(shape))

    def uniform(self, shape):
        """Uniform numbers in (0, 1) of a shape (..., k), k from each counter."""
        return self._draw(_core.counter_uniforms, tuple(shape))

    def __repr__(self):
        return f"CounterRng({self.seed}, trial={self.trial}, stream={self.stream})"


def _normals(rng, shape, caller):
    if rng is None:
        rng = np.random.default_rng()
    if isinstance(rng, numbers.Integral):
        rng = CounterRng(rng)
    if not hasattr(rng, "standard_normal"):
        raise TypeError(f"{caller}: rng: expected a numpy.random.Generator, a CounterRng or a seed")
    return rng.standard_normal(shape)


def sample(mean, covariance, size=None, rng=None):
    """Random features mean·exp(e), e ~ N(0, covariance).

    Parameters
    ----------
    mean : an array of features
    covariance : array_like, shape (..., k, k)
        May be singular.
    size : int or tuple of ints, optional
        Shape of the result, to which `mean` and `covariance` are broadcast; None: theirs.
    rng : numpy.random.Generator, CounterRng or int, optional
        An int is the seed of a CounterRng. None: a fresh generator.
    """
    mean = require_manifold(mean, "sample")
    kind = type(mean)
    k = (kind.dof, kind.dof)
    c = _covariances(covariance, "sample: covariance", kind)
    lead = np.broadcast_shapes(mean.shape, c.shape[:-2])
    if size is not None:
        size = (size,) if isinstance(size, numbers.Integral) else tuple(size)
        lead = np.broadcast_shapes(size, lead)
    operands = [
        ("mean", mean.params, (kind.parameters,)),
        ("covariance", c, k),
        ("normals", _normals(rng, (*lead, kind.dof), "sample"), (kind.dof,)),
    ]
    return kind._of(operate(kind._operations["sampled"], "sample", operands, (kind.parameters,)))


def random_rotations(size=None, rng=None):
    """Uniform random rotations.

    Parameters
    ----------
    size : int or tuple of ints, optional
        None: a single one.
    rng : numpy.random.Generator, CounterRng or int, optional

    Returns
    -------
    SO3
    """
    shape = () if size is None else (size,) if isinstance(size, numbers.Integral) else tuple(size)
    return SO3.from_quat(_normals(rng, (*shape, 4), "random_rotations"))


def random_directions(size=None, rng=None):
    """Uniform random directions; see `random_rotations`.

    Returns
    -------
    S2
    """
    shape = () if size is None else (size,) if isinstance(size, numbers.Integral) else tuple(size)
    return S2.from_vector(_normals(rng, (*shape, 3), "random_directions"))


def _fused(caller, x, covariances, factors, deviations, axis, covariance_at):
    """The Gaussians, statuses, χ², degrees of freedom and p, and the shape of the results."""
    if isinstance(x, Gaussian):
        if any(v is not None for v in (covariances, factors, deviations)):
            raise TypeError(f"{caller}: a Gaussian has its covariances already")
        x, covariances, factors = x.mean, None if x.factor is not None else x.covariance, x.factor
    x = require_manifold(x, caller)
    covariances, factored = _factored(caller, covariances, factors, deviations, type(x))
    if covariances is None:
        raise TypeError(f"{caller}: covariances are missing")
    if covariance_at not in ((None,) if not isinstance(x, _FRAMES) else ()) + ("measured", "estimated"):
        raise ValueError(
            f"{caller}: covariance_at: say 'measured' (covariances in the axes of each measurement) or 'estimated'"
        )
    kind = type(x)
    if x.ndim == 0:
        x = x.reshape(1)
    axes = _axes(axis, x.ndim, caller)
    k = (kind.dof, kind.dof)
    c = covariances if factored else _covariances(covariances, f"{caller}: covariances", kind, x.shape)
    c = np.broadcast_to(c, (*x.shape, *k))
    features, lead = _grouped(require_finite(x.params, f"{caller}: x"), axes, x.ndim)
    if features.shape[1] == 0:
        raise ValueError(f"{caller}: x, shape {x.shape}: there are no features")
    c = _grouped(c, axes, x.ndim)[0]
    mean, covariance, factor, statuses, chi2, p = _core.fuse(
        kind._core_name,
        np.ascontiguousarray(features),
        np.ascontiguousarray(c),
        factored,
        covariance_at != "estimated",
    )
    estimate = Gaussian._of(
        kind._of(mean.reshape(*lead, -1)), covariance.reshape(*lead, *k), factor.reshape(*lead, *k) if factored else None
    )
    return estimate, np.array(statuses), chi2, kind.dof * (features.shape[1] - 1), p, lead


def fuse(x, covariances=None, axis=None, *, factors=None, deviations=None, covariance_at=None):
    """Independent estimates of one feature, fused: the mean of least Mahalanobis distances with its covariance.

    Faster than ``mean(x, covariances=...)``, which looks for other minima, too.

    Parameters
    ----------
    x : an array of features, or a Gaussian
    covariances : array_like, shape (..., k, k)
        Broadcast to ``x.shape``.
    factors, deviations : array_like, shapes (..., k, k) and (..., k)
        In place of covariances, as for `mean`; the result has a `factor`, too.
    axis : None, int or tuple of ints
        Axes along which features are fused; None: all of them.
    covariance_at : {'measured', 'estimated'}
        For frames: the axes of the covariances, see `mean`.

    Returns
    -------
    Gaussian

    Warns
    -----
    UserWarning
        Where the covariance is withheld (NaN): estimates that lie farther apart than their covariances say (`tested_fuse`
        has the test), directions or rotations as scattered as uniform ones, or a criterion that is flat where the truth
        may be.
    """
    estimate, status, _, _, _, lead = _fused("fuse", x, covariances, factors, deviations, axis, covariance_at)
    refuted = status == "inconsistent"
    for matrices in (estimate.covariance, estimate.factor):
        if matrices is not None:
            matrices[refuted.reshape(lead)] = np.nan
    bad = int(np.count_nonzero(~np.isfinite(estimate.covariance).all(axis=(-2, -1))))
    if bad:
        n_refuted = int(np.count_nonzero(refuted))
        why = "the measurements do not determine it"
        if n_refuted:
            why = "they lie farther apart than their covariances say"
            if n_refuted < bad:
                why += f" ({n_refuted}), or do not determine it ({bad - n_refuted})"
        warnings.warn(f"liestat.fuse: no covariance of {bad} of {len(status)} results: {why}", UserWarning, stacklevel=2)
    return estimate


class FuseResult(typing.NamedTuple):
    """What `tested_fuse` returns; arrays of the shape of the results, numbers for a single one."""

    #: The means with their covariances, those of the stated covariances also where the fit refutes them.
    estimate: Gaussian
    #: 'ok', 'inconsistent', 'ill_defined', ...
    status: typing.Any
    #: χ² of the estimates under their covariances.
    fit: typing.Any
    #: Its degrees of freedom; 0 for a single estimate, which nothing tests.
    fit_dof: int
    #: Probability of so large a χ²; below 0.001 the covariances are refuted.
    fit_p: typing.Any
    #: Birge's factor max(1, χ²/ν), by which the covariances are too small if all are so by the same factor.
    fit_factor: typing.Any


def tested_fuse(x, covariances=None, axis=None, *, factors=None, deviations=None, covariance_at=None):
    """The same as `fuse`, with the test of the covariances by the scatter of the estimates, and without a warning.

    Returns
    -------
    FuseResult
    """
    estimate, status, chi2, dof, p, lead = _fused(
        "tested_fuse", x, covariances, factors, deviations, axis, covariance_at
    )
    factor = np.maximum(1, chi2 / dof) if dof > 0 else np.ones_like(chi2)
    shaped = [array.reshape(lead)[()] for array in (status, chi2, p, factor)]
    return FuseResult(estimate, str(shaped[0]) if lead == () else shaped[0], shaped[1], dof, shaped[2], shaped[3])


def _tangent_of(value):
    """Dimension of a result of a user's function, how to compare two of them."""
    if isinstance(value, Manifold):
        if not value.single:
            raise ValueError(f"propagate: the function returned {value!r}; expected one feature or a vector")
        return value.dof, lambda a, b: a.local(b)
    vector = np.asarray(value, dtype=np.float64)
    if vector.ndim > 1:
        raise ValueError(f"propagate: the function returned an array of shape {vector.shape}; expected a vector")
    return vector.size, lambda a, b: np.ravel(np.asarray(b, dtype=np.float64) - np.asarray(a, dtype=np.float64))


def mean_about(x, weights, reference):
    """The y near `reference` where the weighted residuals Σ w y.local(x) vanish, for weights of any sign.

    Parameters
    ----------
    x : an array of features, shape (n,)
    weights : array_like, shape (n,)
        Their sum must not be zero; it is divided by.
    reference : a single feature of that type

    Returns
    -------
    Gaussian, with the weighted covariance Σ w z zᵀ / Σ w of the residuals, which has any sign.
    """
    x = require_manifold(x, "mean_about")
    w = require_finite(as_numbers(weights, "mean_about: weights", ()), "mean_about: weights")
    if x.ndim != 1 or w.shape != x.shape or len(w) == 0:
        raise ValueError(f"mean_about: x, shape {x.shape}, and weights, shape {w.shape}: expected one list each")
    size, total = np.abs(w).sum(), w.sum()
    if not abs(total) > 1e-12 * size:
        raise ValueError("mean_about: the weights add up to zero")
    y, factor = reference, 1.0
    step = w @ y.local(x) / total
    tolerance = 8 * np.finfo(float).eps * (1 + np.abs(reference.params).max()) * size / abs(total)
    for _ in range(100):
        if not np.linalg.norm(step) > tolerance or factor < 1e-6:
            break
        there = y.retract(factor * step)
        left = w @ there.local(x) / total
        if np.linalg.norm(left) < np.linalg.norm(step):
            y, step, factor = there, left, 1.0
        else:
            factor /= 2
    if not np.linalg.norm(step) <= 100 * tolerance:
        raise ArithmeticError("mean_about: no such feature was found near the reference")
    z = y.local(x)
    return Gaussian._of(y, (w / total * z.T) @ z)


def unscented_transform(function, gaussian, c=3.0):
    """The image of a Gaussian under a function by 2k + 1 sigma points; the mean is exact to third order.

    Parameters
    ----------
    function : callable
        Takes an array of features, returns an array of features or vectors of the same length.
    gaussian : Gaussian
        Of a single feature.
    c : float
        Sigma points are √c standard deviations from the mean, whose own weight 1 - k/c may be negative.

    Returns
    -------
    image : Gaussian, or (mean, covariance) for vectors
    cross : ndarray, shape (d, k)
        Covariance of the image's error with that of the argument.
    """
    if not isinstance(gaussian, Gaussian) or not gaussian.mean.single:
        raise ValueError("unscented_transform: expected the Gaussian of a single feature")
    k = gaussian.mean.dof
    if not c > 0:
        raise ValueError(f"unscented_transform: c: expected a number above zero, got {c!r}")
    try:
        steps = math.sqrt(c) * np.linalg.cholesky(gaussian.covariance).T
    except np.linalg.LinAlgError:
        raise ValueError("unscented_transform: the covariance is not positive definite") from None
    v = np.concatenate([np.zeros((1, k)), steps, -steps])
    w = np.full(2 * k + 1, 0.5 / c)
    w[0] = 1 - k / c
    images = function(gaussian.mean.retract(v))
    if isinstance(images, Manifold):
        image = mean_about(images, w, images[0])
        z, covariance = image.mean.local(images), image.covariance
    else:
        images = as_numbers(images, "unscented_transform: the function's result", ())
        images = images.reshape(2 * k + 1, -1)
        mean = w @ images
        z = images - mean
        covariance = (w * z.T) @ z
        image = (mean, covariance)
    if np.linalg.eigvalsh(covariance)[0] < -1e-9 * np.trace(np.abs(covariance)):
        raise ArithmeticError(
            "unscented_transform: the middle's negative weight leaves no covariance: the function bends too much within "
            "the sigma points; a larger c has a smaller weight"
        )
    return image, (w * z.T) @ v


def propagate(function, *inputs, jacobian=None, joint_covariance=None, step=6e-6):
    """The covariance of a function of uncertain features, to first order.

    The function is called by this thread with the GIL held.

    Parameters
    ----------
    function : callable
        Takes the means of `inputs`, returns a feature, a number or a vector.
    *inputs : Gaussian, or (mean, covariance) with a vector or number for a mean
        Single features, independent of each other.
    jacobian : array_like or callable, optional
        Derivative with respect to the tangent vectors of all inputs, shape (result, inputs), in local axes, or a
        function of the means that returns it. None: central differences.
    joint_covariance : array_like, optional
        Of all inputs together, where they are correlated.
    step : float
        Of the differences, in units of the tangent coordinates (rad, m).

    Returns
    -------
    Gaussian, or (value, covariance) for numbers and vectors
    """
    means, blocks = [], []
    for i, x in enumerate(inputs):
        mean, covariance = (x.mean, x.covariance) if isinstance(x, Gaussian) else x
        if isinstance(mean, Manifold):
            if not mean.single:
                raise ValueError(f"propagate: input {i}: expected one feature, got shape {mean.shape}")
            dof = mean.dof
        else:
            mean = require_finite(as_numbers(mean, f"propagate: input {i}", ()), f"propagate: input {i}")
            dof = mean.size
        name = f"propagate: covariance {i}"
        square = np.reshape(covariance, (1, 1)) if dof == 1 else covariance
        c = require_finite(as_numbers(square, name, (dof, dof)), name)
        means.append(mean)
        blocks.append(c)
    sizes = [len(b) for b in blocks]
    total = sum(sizes)
    if joint_covariance is not None:
        name = "propagate: joint_covariance"
        sigma = require_finite(as_numbers(joint_covariance, name, (total, total)), name)
    else:
        sigma = np.zeros((total, total))
        at = 0
        for block in blocks:
            sigma[at : at + len(block), at : at + len(block)] = block
            at += len(block)
    value = function(*means)
    rows, difference = _tangent_of(value)
    if jacobian is not None:
        J = jacobian(*means) if callable(jacobian) else jacobian
        if np.ndim(J) < 2:
            J = np.reshape(J, (rows, total))
        J = require_finite(as_numbers(J, "propagate: jacobian", (rows, total)), "propagate: jacobian")
    else:
        J = np.empty((rows, total))
        column = 0
        for i, mean in enumerate(means):
            for j in range(sizes[i]):
                ends = []
                for sign in (-1.0, 1.0):
                    e = np.zeros(sizes[i])
                    e[j] = sign * step
                    moved = list(means)
                    moved[i] = mean.retract(e) if isinstance(mean, Manifold) else mean + e.reshape(mean.shape)
                    ends.append(difference(value, function(*moved)))
                J[:, column] = (ends[1] - ends[0]) / (2 * step)
                column += 1
        require_finite(J, "propagate: derivative of the function by differences")
    covariance = J @ sigma @ J.T
    if isinstance(value, Manifold):
        return Gaussian._of(value, covariance)
    return value, covariance


class ValidationReport:
    """What a Monte-Carlo validation found; `str` gives the table.

    Attributes
    ----------
    passed : bool
    verdict, reason : str
    index, expected_index, index_se, index_p_value : float
        Mean squared Mahalanobis distance of the truth, and its expectation under the law.
    coverage : dict
        Observed frequency of the law's 50, 90, 95 and 99 % regions.
    ks_statistic, ks_p_value : float
        Kolmogorov-Smirnov distance from the law.
    trials, failures, exceptions : int
    distances : ndarray
        Squared Mahalanobis distances in the order of the trials, NaN for failed ones.
    """

    def __init__(self, fields, distances, law):
        self._table = fields.pop("table")
        self.__dict__.update(fields)
        self.distances, self.law = distances, law

    def __str__(self):
        return self._table

    def __repr__(self):
        index = f"index {self.index:.3g} of {self.expected_index:.3g}"
        return f"<ValidationReport: {self.verdict}, {index}, {self.trials} trials>"


def validate(
    estimator,
    draw,
    *,
    trials=1000,
    seed=0,
    law=None,
    false_alarm=1e-5,
    tolerance=0.0,
    failure_fraction=None,
    ks_tolerance=0.0,
    tail=0.0,
):
    """Whether an estimator's covariance is right: Monte Carlo over scenes with known truth.

    The functions are called by this thread with the GIL held.

    Parameters
    ----------
    estimator : callable
        Takes a scene's measurements and returns a Gaussian, a MeanResult, or (mean, covariance); None if it gives up.
        An exception fails the trial.
    draw : callable
        Takes a ``numpy.random.Generator`` made for the trial alone and returns (truth, measurements).
    trials, seed : int
        Trial i draws from a generator seeded with (seed, i).
    law : Law, optional
        The law of the squared distances; None: χ², or that of the first MeanResult.
    false_alarm : float
        Probability that a correct estimator fails.
    tolerance, failure_fraction, ks_tolerance, tail : float
        Allowed relative deviation of the index, probability of a failed trial, distance from the law and excess beyond
        its 99.9 % quantile. By default no trial may fail, but for estimates that are `inconsistent` with the noise
        stated for them: at the level 0.001 the library refutes right noise, too.

    Returns
    -------
    ValidationReport
    """
    distances = np.full(int(trials), np.nan)
    exceptions = refuted = 0
    dof = 0
    for i in range(int(trials)):
        truth, measurements = draw(np.random.default_rng((int(seed), i)))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                estimate = estimator(measurements)
        except Exception:
            exceptions += 1
            continue
        if estimate is None:
            continue
        refuted += getattr(estimate, "status", None) == "inconsistent"
        if hasattr(estimate, "covariance"):
            mean, covariance = estimate.mean, estimate.covariance
        else:
            mean, covariance = estimate
        if covariance is None:
            continue
        if law is None and isinstance(getattr(estimate, "law", None), Law):
            law = estimate.law
        if isinstance(truth, Manifold):
            dof = truth.dof
            distances[i] = mahalanobis(mean, covariance, truth) ** 2
        else:
            error = np.atleast_1d(np.asarray(truth, dtype=np.float64) - mean)
            dof = error.size
            distances[i] = error @ np.linalg.solve(np.reshape(covariance, (dof, dof)), error)
    law = Law(dof) if law is None else law
    if failure_fraction is None:
        # Other failures than refutations are not excused.
        others = np.count_nonzero(np.isnan(distances)) - refuted
        failure_fraction = _core.refutation_level if refuted > 0 and others == 0 else 0.0
    fields = _core.validation_report(
        distances,
        exceptions,
        law.degrees_of_freedom,
        law.samples or 0,
        float(false_alarm),
        float(tolerance),
        float(ks_tolerance),
        float(failure_fraction),
        float(tail),
    )
    return ValidationReport(fields, distances, law)
