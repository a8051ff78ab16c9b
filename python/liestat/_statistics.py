"""Means, fusion and distances."""

import math
import numbers
import warnings

import numpy as np

from . import _core
from ._manifolds import SO3, Frame3, Manifold, NonOrientedFrame3, SemiOrientedFrame3
from ._operate import as_numbers, operate, require_finite
from ._results import MeanResult, Result

#: Types with an invariant metric, whose default criterion is least squares.
_METRIC = ("R3", "S2", "SO3", "Frame3", "SemiOrientedFrame3", "NonOrientedFrame3")
_FRAMES: tuple = (Frame3, SemiOrientedFrame3, NonOrientedFrame3)


def _elements(x):
    """A SciPy Rotation, and lists of those or of elements, as one array of a type; other values as they are."""
    if type(x).__name__ == "Rotation" and type(x).__module__.startswith("scipy."):
        return SO3.from_scipy(x)
    if isinstance(x, (list, tuple)) and x:
        parts = [_elements(part) for part in x]
        if isinstance(parts[0], Manifold):
            return type(parts[0]).stack(parts)
    return x


def require_manifold(x, caller):
    x = _elements(x)
    if not isinstance(x, Manifold):
        kind = f"an ndarray of shape {x.shape}" if isinstance(x, np.ndarray) else type(x).__name__
        raise TypeError(f"{caller}: x is {kind}; wrap parameters in their type, liestat.SO3(x) for quaternions")
    return x


def _covariances(value, name, kind, shape=None):
    k = (kind.dof, kind.dof)
    c = require_finite(as_numbers(value, name, k), name)
    asymmetry = np.abs(c - np.swapaxes(c, -1, -2)).max(initial=0)
    if asymmetry > 1e-9 * max(np.abs(c).max(initial=0), 1e-300):
        raise ValueError(f"{name}, shape {c.shape}: not symmetric (by {asymmetry:.3g})")
    if shape is not None:
        try:
            np.broadcast_to(c, (*shape, *k))
        except ValueError:
            raise ValueError(f"{name}, shape {c.shape}: does not broadcast to {(*shape, *k)}") from None
    return c


def _factored(caller, covariances, factors, deviations, kind):
    """Covariances or what is given in their place, and whether that is factors of them."""
    given = [v for v in (covariances, factors, deviations) if v is not None]
    if len(given) > 1:
        raise ValueError(f"{caller}: covariances, factors and deviations: give one of them")
    if deviations is not None:
        s = require_finite(as_numbers(deviations, f"{caller}: deviations", (kind.dof,)), f"{caller}: deviations")
        if not (s > 0).all():
            raise ValueError(f"{caller}: deviations, shape {s.shape}: one is not above zero")
        factors = s[..., :, None] * np.eye(kind.dof)
    if factors is None:
        return covariances, False
    return require_finite(as_numbers(factors, f"{caller}: factors", (kind.dof, kind.dof)), f"{caller}: factors"), True


def _axes(axis, ndim, caller):
    """The axes that are reduced, in order; all of them for None."""
    if axis is None:
        return tuple(range(ndim))
    axes = (axis,) if isinstance(axis, numbers.Integral) else tuple(axis)
    out = []
    for a in axes:
        if not isinstance(a, numbers.Integral) or not -ndim <= a < ndim:
            raise ValueError(f"{caller}: axis {a!r} is out of bounds for shape with {ndim} axes")
        out.append(int(a) % ndim)
    if len(set(out)) != len(out):
        raise ValueError(f"{caller}: axis {axis!r} names an axis twice")
    return tuple(sorted(out))


def _grouped(array, axes, ndim):
    """The reduced axes as one, after the axes that are left: shape (groups, n, tail…)."""
    left = tuple(i for i in range(ndim) if i not in axes)
    tail = tuple(range(ndim, array.ndim))
    moved = array.transpose((*left, *axes, *tail))
    lead = tuple(array.shape[i] for i in left)
    n = math.prod(array.shape[i] for i in axes)
    return moved.reshape((math.prod(lead), n, *array.shape[ndim:])), lead


def mean(
    x,
    weights=None,
    covariances=None,
    axis=None,
    criterion=None,
    certify=True,
    *,
    factors=None,
    deviations=None,
    covariance_at=None,
    likelihood=False,
    times=None,
    refuted="withheld",
    birge=False,
    weights_are="precision",
    region="law",
    inflate=False,
    budget=None,
    threads=0,
    symmetry=None,
    hexagonal_axes="a",
    keepdims=False,
    by=None,
    robust=None,
    nan_policy="raise",
):
    """The mean of features, with its covariance and a certificate that it is the only one.

    Parameters
    ----------
    x : SO3, SE3, SE2, SE23, S2, R3, Frame3, SemiOrientedFrame3 or NonOrientedFrame3
        An array of features, or a list of single ones or of arrays of one shape. A
        ``scipy.spatial.transform.Rotation``, or a list of them, stands for SO3.
    weights : array_like, optional
        Relative weights, zero or more, inversely proportional to variances; broadcast to ``x.shape``.
    covariances : array_like, shape (..., k, k), optional
        Covariances of the features' errors, m² and rad², translation before rotation; broadcast to ``x.shape``.
    factors : array_like, shape (..., k, k), optional
        In place of covariances matrices A with A Aᵀ the covariance. Where standard deviations differ by factors of
        thousands 'maha' keeps the digits of the small ones, and returns `covariance_factor`.
    deviations : array_like, shape (..., k), optional
        In place of covariances standard deviations along the axes of the features, m and rad: diagonal factors.
    axis : None, int or tuple of ints, optional
        Axes along which means are computed; None: of all features.
    criterion : {'lsq', 'maha', 'barycentre'}, optional
        Least squares of geodesic distances (with `weights` weighted; with `covariances` they are the known noise that
        the covariance of the mean follows from), least Mahalanobis distances to features with `covariances`, or the
        group's exponential barycentre. Default: 'maha' with covariances, else 'lsq', for groups without an invariant
        metric (SE2, SE3, SE23) 'barycentre'.
    certify : bool
        Certify that the mean is the only one, by a global search if need be, and that the covariance can be trusted.
        Without, the iteration and its covariance alone: a tenth of the time for a million features. (The program's
        --no-certify leaves out the global search, and nothing else.)
    covariance_at : {'measured', 'estimated'}, optional
        For frames and 'maha': the axes of the covariances, those of each measurement (a sensor's) or those of the
        estimate (an object's). Both are the same for other types.
    likelihood : bool
        For 'maha': add the logarithm of the volume element, for the maximum of the likelihood.
    times : array_like, optional
        Of the features, in whatever unit; broadcast to ``x.shape``. Tells whether the errors of successive features are
        independent, as the covariance supposes (`time_dependence` of the result, with a note where they are not); from
        20 to 200 000 features.
    refuted : {'withheld', 'residuals'}
        What becomes of the covariance where the features scatter more than `covariances` say (`fit_p` below 0.001): it
        is withheld, with status 'inconsistent', or it is computed from the residuals. Not for 'maha', whose weights are
        the refuted covariances.
    birge : bool
        Multiply a covariance from `covariances` that are not refuted by ``fit_factor``, max(1, χ²/ν).
    weights_are : {'precision', 'importance', 'frequency'}
        What `weights` mean to a covariance from the residuals: inverse variances; anything else, whatever the noise (by
        the jackknife, with the degrees of freedom that the weights leave, `covariance_law_n`; less than eight features
        of equal weight in effect have no covariance); or counts of features that were measured several times.
    region : {'law', 'bootstrap'}
        What makes ``covariance`` with the 95 % quantile of its law a region, where it is from the residuals: Hotelling's
        law, for symmetric noise, or a bootstrap that widens the covariance by ``skew_factor`` squared for skewed noise.
        The same features give the same bits.
    inflate : bool
        Widen the covariance by the dependence of the errors on `times`; none is left where errors hold on for so long
        that the features are worth too few independent ones.
    budget : int, optional
        Of the global search: looks at a datum from a cell, some 30 ns each. Default: 1e8, for 'maha' 1e7 at most.
    threads : int
        0 for as many as the machine has. The result has the same bits for any number.
    symmetry : str, optional
        Rotations are orientations of crystals of this point group or Laue class ('432', 'm-3m', '6/mmm' …), whose
        proper group the result names. A rotation takes coordinates along the crystal's axes to the sample's; R and R k
        are the same for every k of the group. The mean is one of its copies, and `covariance` is along the crystal's
        axes there.
    hexagonal_axes : {'a', 'a*'}
        What the x axis of hexagonal and trigonal crystals is along; z is along c.
    keepdims : bool
        Leave the axes that are reduced in the result's shape, with length one.
    by : array_like, optional
        Labels of the features, of the shape of `x`: one mean for each of them, in the order of ``result.labels``, the
        sorted labels. Indices in `farthest` and `outliers` count the features of a label. Not with `axis`.
    robust : {'huber', 'median'}, optional
        Huber's mean or the geodesic median, which outliers do not break, in place of `criterion`: each part of the
        metric, translation and rotation, by its own distance and scale (`scales`); SE2 and SE3 as frames. `outliers`
        lists the features that the noise of the others does not explain, with family-wise p. A covariance needs 20
        features whose outliers are not on one side: else it is withheld, with status 'inconsistent'.
    nan_policy : {'raise', 'omit'}
        What becomes of features that are not finite, or that have a weight, time or covariance that is not, as `fuse`
        returns where it refuses: an error, or they are left out with all that belongs to them. Indices of features
        count those that are left.

    Returns
    -------
    MeanResult

    Warns
    -----
    UserWarning
        Where the covariance is withheld: the result's `status` and `reason` say why.

    Examples
    --------
    >>> import liestat
    >>> x = liestat.SO3.exp([[0.31, 0.02, -0.11], [0.28, 0.05, -0.13], [0.33, 0.01, -0.08], [0.30, 0.04, -0.12]])
    >>> result = liestat.mean(x)
    >>> result.status, result.unique
    ('ok', 'unique')
    >>> result.mean.log().round(4)
    array([ 0.305,  0.03 , -0.11 ])
    """
    if robust is not None:
        if robust not in ("huber", "median"):
            raise ValueError(f"mean: robust: expected 'huber' or 'median', got {robust!r}")
        others = dict(weights=weights, covariances=covariances, factors=factors, deviations=deviations, times=times)
        others.update(criterion=criterion, inflate=inflate or None, region=None if region == "law" else region)
        named = [other for other, value in others.items() if value is not None]
        if named:
            raise ValueError(f"mean: robust={robust!r} takes no {', '.join(named)}")
        if require_manifold(x, "mean")._core_name == "SE23":
            raise ValueError("mean: robust: SE23 has no metric; the rotations, positions or velocities by themselves")
    if symmetry is not None and criterion is None:
        criterion = "lsq"
    if by is not None and (axis is not None or keepdims):
        raise ValueError("mean: by: labels reduce all axes; no axis or keepdims")
    if nan_policy not in ("raise", "omit"):
        raise ValueError(f"mean: nan_policy: expected 'raise' or 'omit', got {nan_policy!r}")
    if nan_policy == "omit":
        x, marked = _marked(
            x, weights=weights, covariances=covariances, factors=factors, deviations=deviations, times=times
        )
        weights, covariances, factors, deviations, times = marked.values()
    kind, criterion, groups, lead = _requests(
        "mean",
        x,
        weights,
        covariances,
        axis,
        criterion,
        covariance_at,
        likelihood,
        times,
        factors,
        deviations,
        nan_policy == "omit",
    )
    if robust is not None:
        criterion, groups = robust, [dict(group, criterion=robust) for group in groups]
    if inflate and times is None:
        raise ValueError("mean: inflate needs times")
    if weights_are not in ("precision", "importance", "frequency"):
        raise ValueError(
            f"mean: weights_are: expected 'precision', 'importance' or 'frequency', got {weights_are!r}"
        )
    if region not in ("law", "bootstrap"):
        raise ValueError(f"mean: region: expected 'law' or 'bootstrap', got {region!r}")
    if region == "bootstrap" and any(c is not None for c in (covariances, factors, deviations)):
        raise ValueError("mean: region='bootstrap': with covariances the region is that of chi-squared")
    if refuted not in ("withheld", "residuals"):
        raise ValueError(f"mean: refuted: expected 'withheld' or 'residuals', got {refuted!r}")
    if (birge or refuted == "residuals") and covariances is None:
        raise ValueError(f"mean: {'birge' if birge else 'refuted'} needs covariances")
    if refuted == "residuals" and criterion == "maha":
        raise ValueError("mean: refuted='residuals': the weights of 'maha' are the refuted covariances; criterion 'lsq'")
    labels = None
    if by is not None:
        labels, groups = _by_label(groups[0], np.asarray(by), np.shape(require_manifold(x, "mean").params)[:-1])
        lead = labels.shape
    if nan_policy == "omit":
        groups = [_finite(group) for group in groups]
    if symmetry is not None:
        if kind is not SO3:
            raise TypeError(f"mean: symmetry is that of rotations, SO3, not of {kind.__name__}")
        if criterion not in (None, "lsq", "wlsq", "huber", "median"):
            raise ValueError(f"mean: symmetry: criterion 'lsq', got {criterion!r}")
        if hexagonal_axes not in ("a", "a*"):
            raise ValueError(f"mean: hexagonal_axes: expected 'a' or 'a*', got {hexagonal_axes!r}")
        proper = _core.point_group(str(symmetry), hexagonal_axes == "a")
        if proper is None:
            raise ValueError(
                f"mean: symmetry: no point group {symmetry!r}; 1, 2, 222, 3, 32, 4, 422, 6, 622, 23, 432, another of "
                "the 32 point groups or a Laue class"
            )
        groups = [dict(group, type="CrystalOrientation", symmetry=proper) for group in groups]
    answers = [
        _core.mean(
            **group,
            residuals_if_refuted=refuted == "residuals",
            birge=bool(birge),
            weights_are=weights_are,
            bootstrap=region == "bootstrap",
            certify=bool(certify),
            inflate=bool(inflate),
            budget=int(budget or 0),
            threads=int(threads),
        )
        for group in groups
    ]
    if inflate and not all(a["time_dependence_tested"] for a in answers):
        raise ValueError(
            "mean: inflate, but the dependence of errors on time cannot be tested: that needs 20 to 200000 features "
            "with times, and a mean with a covariance"
        )
    if keepdims:
        x = require_manifold(x, "mean")
        reduced = _axes(axis, max(x.ndim, 1), "mean")
        lead = tuple(1 if i in reduced else n for i, n in enumerate(x.shape or (1,)))
    result = MeanResult(kind, criterion, answers, lead)
    if labels is not None:
        result.labels = labels
    withheld = [a for a in answers if a["covariance"] is None]
    if withheld:
        which = "" if lead == () else f" for {len(withheld)} of {len(answers)} means"
        warnings.warn(f"liestat.mean: no covariance{which}: {withheld[0]['reason']}", UserWarning, stacklevel=2)
    return result


def _finite(group):
    """The arguments of the extension without the features that are not finite."""
    kept = np.isfinite(group["features"]).all(axis=-1)
    lists = ("features", "weights", "covariances", "times")
    return dict(group, **{name: group[name][kept] for name in lists if len(group[name]) == len(kept)})


def _marked(x, **arrays):
    """The features, not finite where something that belongs to them is not, and what belongs to them, finite."""
    x = require_manifold(x, "mean")
    bad = np.zeros(x.shape, dtype=bool)
    tails = {"covariances": 2, "factors": 2, "deviations": 1}
    for name, value in arrays.items():
        if value is None:
            continue
        a = as_numbers(value, f"mean: {name}", (x.dof,) * tails.get(name, 0))
        tail = tuple(range(-tails.get(name, 0), 0))
        wrong = ~np.isfinite(a).all(axis=tail)
        try:
            bad |= wrong
        except ValueError:
            raise ValueError(f"mean: {name}, shape {a.shape}: does not broadcast to the features' {x.shape}") from None
        filler = np.eye(x.dof) if len(tail) == 2 else 1.0
        arrays[name] = np.where(wrong[(..., *[None] * len(tail))], filler, a)
    params = np.where(bad[..., None], np.nan, x.params)
    return type(x)._of(params), arrays


def _by_label(group, by, shape):
    """The sorted labels, and the arguments of the extension for the features of each."""
    if by.shape != shape:
        raise ValueError(f"mean: by, shape {by.shape}: expected that of x, {shape}")
    labels, number, counts = np.unique(by, return_inverse=True, return_counts=True)
    order = np.argsort(np.ravel(number), kind="stable")
    ends = np.cumsum(counts)
    # Lists that are empty, and a covariance that all features share, are not sliced.
    lists = ("features", "weights", "covariances", "times")
    sliced = {name: group[name][order] for name in lists if len(group[name]) == len(order)}
    return labels, [
        dict(group, **{name: values[end - n : end] for name, values in sliced.items()}) for n, end in zip(counts, ends)
    ]


def _requests(
    caller,
    x,
    weights,
    covariances,
    axis,
    criterion,
    covariance_at,
    likelihood,
    times,
    factors=None,
    deviations=None,
    omits_nan=False,
):
    """The type, the criterion, the arguments of the extension for each mean, and the shape of the means."""
    x = require_manifold(x, caller)
    kind = type(x)
    covariances, factored = _factored(caller, covariances, factors, deviations, kind)
    name = kind._core_name
    if x.ndim == 0:
        x = x.reshape(1)
    metric = name in _METRIC
    if criterion is None:
        criterion = "maha" if covariances is not None else "lsq" if metric else "barycentre"
    elif criterion == "wlsq":
        criterion = "lsq"
    if criterion not in ("lsq", "maha", "barycentre"):
        raise ValueError(f"{caller}: criterion: expected 'lsq', 'maha' or 'barycentre', got {criterion!r}")
    if criterion == "lsq" and not metric:
        raise ValueError(f"{caller}: {name} has no invariant metric: criterion 'barycentre', or 'maha', or a Frame3")
    if criterion == "barycentre" and metric:
        if kind is not SO3:
            raise ValueError(f"{caller}: {name} is not a group: criterion 'lsq' or 'maha'")
        criterion = "lsq"  # the barycentre of rotations is their Fréchet mean
    if criterion == "maha":
        if covariances is None:
            raise ValueError(f"{caller}: criterion 'maha' needs covariances")
        if weights is not None:
            raise ValueError(f"{caller}: criterion 'maha' takes covariances, no weights")
        if covariance_at not in (None, "measured", "estimated"):
            raise ValueError(f"{caller}: covariance_at: expected 'measured' or 'estimated', got {covariance_at!r}")
        if covariance_at is None and isinstance(x, _FRAMES):
            raise ValueError(
                f"{caller}: covariance_at: for {name} say 'measured' (covariances in the axes of each measurement, a "
                "sensor's) or 'estimated' (in the axes of the estimate, an object's)"
            )
    elif likelihood:
        raise ValueError(f"{caller}: likelihood is that of criterion 'maha'")
    elif criterion == "barycentre" and covariances is not None:
        raise ValueError(f"{caller}: criterion 'barycentre' takes weights; covariances are for 'maha'")
    elif covariances is not None and isinstance(x, _FRAMES):
        if covariance_at == "measured":
            raise ValueError(f"{caller}: criterion 'lsq' takes covariances in the axes of the estimate, else 'maha'")
        covariance_at = "estimated"
    axes = _axes(axis, x.ndim, caller)
    if not omits_nan:
        require_finite(x.params, f"{caller}: x")
    features, lead = _grouped(np.ascontiguousarray(x.params), axes, x.ndim)

    def one_for_each(values, what):
        values = require_finite(as_numbers(values, f"{caller}: {what}", ()), f"{caller}: {what}")
        try:
            return _grouped(np.broadcast_to(values, x.shape), axes, x.ndim)[0]
        except ValueError:
            raise ValueError(f"{caller}: {what}, shape {values.shape}: does not broadcast to {x.shape}") from None

    w = t = c = np.empty((len(features), 0))
    if weights is not None:
        w = one_for_each(weights, "weights")
        if (w < 0).any():
            raise ValueError(f"{caller}: weights, shape {np.shape(weights)}: one is negative")
        criterion = "wlsq" if criterion == "lsq" else criterion
    if times is not None:
        t = one_for_each(times, "times")
    if covariances is not None:
        c = covariances if factored else _covariances(covariances, f"{caller}: covariances", kind)
        k = (kind.dof, kind.dof)
        try:
            np.broadcast_to(c, (*x.shape, *k))
        except ValueError:
            what = "factors" if factored else "covariances"
            raise ValueError(f"{caller}: {what}, shape {c.shape}: does not broadcast to {(*x.shape, *k)}") from None
        if math.prod(c.shape[:-2]) == 1 and criterion == "maha":
            c = np.broadcast_to(c.reshape(1, 1, *k), (len(features), 1, *k))
        else:
            c = _grouped(np.broadcast_to(c, (*x.shape, *k)), axes, x.ndim)[0]
    groups = [
        dict(
            type=name,
            criterion=criterion,
            features=np.ascontiguousarray(features[i]),
            weights=np.ascontiguousarray(w[i]),
            covariances=np.ascontiguousarray(c[i]),
            factored=factored,
            times=np.ascontiguousarray(t[i]),
            covariances_at_measurement=covariance_at != "estimated",
            likelihood=bool(likelihood),
        )
        for i in range(len(features))
    ]
    return kind, criterion, groups, lead


def validate_split(
    x,
    weights=None,
    covariances=None,
    times=None,
    criterion=None,
    *,
    covariance_at=None,
    likelihood=False,
    splits=200,
    blocks=10,
    seed=1,
    threads=0,
):
    """Whether the covariance of a mean is true of real measurements; ``liestat validate split`` for arrays.

    The measurements are split in two, at random and by blocks of time: do the means of the halves agree? Splits at random do not see errors that successive measurements share, splits by blocks of time do.

    Parameters
    ----------
    x, weights, covariances, criterion, covariance_at, likelihood
        As those of `mean`; all of `x` are measurements of one feature.
    times : array_like, optional
        Of the measurements; None: they are in order.
    splits : int
        Of each kind.
    blocks : int
        Of time; even.
    seed, threads : int
        The same seed gives the same bits on any number of threads.

    Returns
    -------
    Result
        The fields of ``liestat validate split --json`` (docs/validation.md): `passed`, `inflation`, `random`,
        `by_blocks`, …. Besides `verdict`, the verdict in words, and `causes`.
    """
    if blocks < 2 or blocks % 2:
        raise ValueError(f"validate_split: blocks must be even and positive, got {blocks}")
    if splits < 1:
        raise ValueError(f"validate_split: splits: expected at least 1, got {splits}")
    request = _requests(
        "validate_split", x, weights, covariances, None, criterion, covariance_at, likelihood, times
    )[2][0]
    fields = _core.split(**request, splits=int(splits), blocks=int(blocks), seed=int(seed), threads=int(threads))
    return Result.of("validation by splits", fields)


def group_mean(x, weights=None, axis=None, certify=True, *, budget=None, threads=0):
    """The exponential barycentre of elements of a group, certified; ``mean(x, criterion='barycentre')``.

    Equivariant under motions from both sides and under inversion, which no Fréchet mean of poses is.

    Returns
    -------
    MeanResult
    """
    return mean(x, weights, None, axis, "barycentre", certify, budget=budget, threads=threads)


def mahalanobis(x, covariance, y, y_covariance=None, threads=1):
    """Mahalanobis distance of `y` from `x`, in the axes of `x`.

    Parameters
    ----------
    x : an array of features
    covariance : array_like, shape (..., k, k)
        Covariances at `x`.
    y : the type of `x`
    y_covariance : array_like, shape (..., k, k), optional
        Covariances at `y`: the distance of two independent estimates under both.

    Returns
    -------
    float or ndarray
        NaN where a covariance is not positive definite.
    """
    x = require_manifold(x, "mahalanobis")
    kind = type(x)
    p, k = (kind.parameters,), (kind.dof, kind.dof)
    operands = [
        ("x", x.params, p),
        ("covariance", _covariances(covariance, "mahalanobis: covariance", kind), k),
        ("y", x._operand(y, "y"), p),
    ]
    name = "mahalanobis_squared"
    if y_covariance is not None:
        operands.append(("y_covariance", _covariances(y_covariance, "mahalanobis: y_covariance", kind), k))
        name = "mahalanobis_squared_both"
    return np.sqrt(operate(kind._operations[name], "mahalanobis", operands, (), threads))[()]


def fit(points, model, sigma=None, *, birge=False):
    """A curve, a surface or a map between images through noisy points, with its covariance.

    Parameters
    ----------
    points : array_like, shape (n, 2), (n, 3) or (n, 4)
        x y for 'circle', 'ellipse', 'conic' and 'line'; x y z for 'sphere', 'plane' and 'line3' (of space);
        x1 y1 x2 y2, matches, for 'homography' and 'fundamental'.
    model : str
    sigma : float, optional
        Standard deviation of every coordinate, which the points then test; by default that of the residuals.
    birge : bool
        Multiply the covariance by Birge's factor where the points scatter more than sigma says.

    Returns
    -------
    Result
        The fields of ``liestat fit --json`` (docs/constrained.md): `status`, `names` of the parameters, `parameter`,
        `covariance`, `chi2`, `fit_p`, `verdict`, `distances`, …

    Warns
    -----
    UserWarning
        Where there is no covariance.
    """
    columns = _core.fit_models()
    if model not in columns:
        raise ValueError(f"fit: model: expected one of {', '.join(columns)}, got {model!r}")
    width = len(columns[model])
    p = require_finite(as_numbers(points, "fit: points", (width,)), "fit: points")
    if p.ndim != 2:
        raise ValueError(f"fit: points: expected shape (n, {width}), got {p.shape}")
    if sigma is not None and not (sigma > 0 and math.isfinite(sigma)):
        raise ValueError(f"fit: sigma: expected a positive number, got {sigma}")
    d = _core.fit(model, np.ascontiguousarray(p), None if sigma is None else float(sigma), bool(birge))
    if d["status"] != "ok":
        warnings.warn(f"liestat.fit: {d['verdict']}", UserWarning, stacklevel=2)
    return Result.of(f"fit of a {model}", d)


_LAWS = {"vmf": "S2", "bingham": "S2", "von-mises": "SO2", "matrix-fisher": "SO3", "wrapped-normal": "SO3"}


def fit_law(x, law, *, seed=1):
    """The law of directions, axes, headings or rotations with the largest likelihood, with tests of it.

    Parameters
    ----------
    x : S2, SO2 or SO3, shape (n,)
    law : {'vmf', 'bingham', 'von-mises', 'matrix-fisher', 'wrapped-normal'}
        vmf and bingham of S2, von-mises of SO2, the others of SO3 (docs/laws.md).
    seed : int
        Of the bootstrap behind the p of the goodness of fit.

    Returns
    -------
    Result
        The fields of ``liestat fit --law --json`` (docs/laws.md): `status`, `location`, `kappa`, `kappa_covariance`,
        `confidence_angles`, `goodness`, `uniformity`, `symmetry`, `verdict`, ...

    Warns
    -----
    UserWarning
        Where the status is not ok.
    """
    if law not in _LAWS:
        raise ValueError(f"fit_law: law: expected one of {', '.join(_LAWS)}, got {law!r}")
    x = require_manifold(x, "fit_law")
    if type(x).__name__ != _LAWS[law] or x.ndim != 1:
        raise TypeError(f"fit_law: {law} is a law of {_LAWS[law]} of shape (n,), got {type(x).__name__} of {x.shape}")
    d = _core.fit_law(law, np.ascontiguousarray(require_finite(x.params, "fit_law: x")), int(seed))
    if d["status"] != "ok":
        warnings.warn(f"liestat.fit_law: {d['verdict']}", UserWarning, stacklevel=2)
    return Result.of(f"law {law}", d)


_COMPARED = {
    "R3": "point",
    "SO3": "rotation",
    "Frame3": "frame",
    "SemiOrientedFrame3": "semi_oriented_frame",
    "NonOrientedFrame3": "non_oriented_frame",
    "SE3": "se3",
    "S2": "direction",
    "SO2": "heading",
}


def compare(*groups, by=None, paired=False, level=0.05, seed=1):
    """Do groups of features have one mean, and one dispersion?

    Parameters
    ----------
    *groups : arrays of features of one type, each of shape (n,)
    by : array_like, shape (n,), optional
        Labels of the features of a single array, which makes groups of them in the order in which labels come.
    paired : bool
        Element i of both groups belongs together.
    level : float
        Of the verdict.
    seed : int
        Of permutations and of the bootstrap.

    Returns
    -------
    Result
        The fields of ``liestat compare --json`` (docs/comparing_groups.md): `status`, `means`, `means_if_alike`,
        `dispersions`, `groups`, `pairs`, `verdict`, ...

    Warns
    -----
    UserWarning
        Where the status is not ok.
    """
    groups = [require_manifold(x, "compare") for x in groups]
    names = [str(i + 1) for i in range(len(groups))]
    if by is not None:
        labels = np.asarray(by)
        if len(groups) != 1 or labels.shape != groups[0].shape:
            raise ValueError("compare: by: expected one array of features and a label for each")
        missing = [i for i, label in enumerate(labels.tolist()) if label is None or label != label or label == ""]
        if missing:
            raise ValueError(f"compare: by: {len(missing)} labels are missing, the first at index {missing[0]}")
        order = list(dict.fromkeys(labels.tolist()))
        groups, names = [groups[0][labels == label] for label in order], [str(label) for label in order]
    if len(groups) < 2 or any(type(x) is not type(groups[0]) or x.ndim != 1 for x in groups):
        raise ValueError("compare: expected two or more arrays of one type, each of shape (n,), or one with by=labels")
    kind = type(groups[0]).__name__
    if kind not in _COMPARED:
        raise TypeError(f"compare: expected one of {', '.join(_COMPARED)}, got {kind}")
    if paired and (len(groups) != 2 or groups[0].shape != groups[1].shape):
        raise ValueError("compare: paired: expected two arrays of one length")
    if not 0 < level < 1:
        raise ValueError(f"compare: level: expected a number between 0 and 1, got {level}")
    lists = [np.ascontiguousarray(require_finite(x.params, "compare: x")) for x in groups]
    d = _core.compare(_COMPARED[kind], lists, names, bool(paired), float(level), int(seed))
    if d["status"] != "ok":
        warnings.warn(f"liestat.compare: {d['verdict']}", UserWarning, stacklevel=2)
    return Result.of("comparison of groups", d)
