"""Results of estimators."""

import html
import warnings

import numpy as np

from . import _core


class Result:
    """A result with named parts, which are attributes; `keys()` lists them. The names are those of the program's JSON.

    `renamed` are former names of parts, here and in the results inside: they work, with a DeprecationWarning.
    """

    def __init__(self, title, *, renamed=None, **parts):
        self._title = title
        self._renamed = renamed or {}
        self.__dict__.update(parts)

    @classmethod
    def of(cls, title, parts, renamed=None):
        """A dictionary of the extension's, dictionaries inside it being results as well."""

        def wrapped(name, value):
            if isinstance(value, dict):
                return Result.of(name.replace("_", " "), value, renamed)
            if isinstance(value, list):
                return [wrapped(name, element) for element in value]
            return value

        return cls(title, renamed=renamed, **{name: wrapped(name, value) for name, value in parts.items()})

    def keys(self):
        """Names of the parts."""
        return [name for name in self.__dict__ if not name.startswith("_")]

    def __getitem__(self, name):
        return self.__dict__[name] if name in self.__dict__ else getattr(self, name)

    def __getattr__(self, name):
        new = self.__dict__.get("_renamed", {}).get(name)
        if new in self.__dict__:
            warnings.warn(f"liestat: the part {name!r} is called {new!r} now", DeprecationWarning, stacklevel=2)
            return self.__dict__[new]
        raise AttributeError(f"no part {name!r}; there are {', '.join(self.keys())}")

    def __repr__(self):
        status = self.__dict__.get("status")
        return f"<{self._title}{'' if status is None else f': {status}'}; {', '.join(self.keys())}>"


class Law:
    """The law of a squared Mahalanobis distance: χ² where the noise was known, Hotelling's T² where the covariance came
    from the residuals of `samples` features.

    Parameters
    ----------
    dof : int
        Dimension k of the error.
    samples : int, optional
        Number of features whose residuals gave the covariance; none: χ².
    """

    __slots__ = ("dof", "samples")

    def __init__(self, dof, samples=None):
        self.dof = int(dof)
        self.samples = int(samples) if samples else None

    @property
    def name(self):
        """'chi2' or 'hotelling', as in the program's JSON."""
        return "hotelling" if self.samples else "chi2"

    def quantile(self, probability):
        """The squared distance that is not exceeded with the given probability; NaN where the law has none."""
        return _core.law_quantile(self.dof, self.samples or 0, float(probability))

    def survival(self, squared_distance):
        """The probability that the squared distance is exceeded; elementwise."""
        values = np.asarray(squared_distance, dtype=np.float64)
        flat = [_core.law_survival(self.dof, self.samples or 0, float(v)) for v in values.ravel()]
        return np.array(flat).reshape(values.shape)[()]

    def mean(self):
        """The expectation."""
        return _core.law_mean(self.dof, self.samples or 0)

    def __repr__(self):
        return f"Law(dof={self.dof}" + (f", samples={self.samples})" if self.samples else ")")

    def __eq__(self, other):
        return isinstance(other, Law) and (self.dof, self.samples) == (other.dof, other.samples)

    __hash__ = None


class ConfidenceRegion:
    """An ellipsoid in the tangent space at an estimate that covers the truth with a given probability.

    Attributes
    ----------
    probability : float
    law : Law
    threshold : float
        Squared Mahalanobis distance of the surface.
    semi_axes : ndarray, shape (k,)
        Lengths (m, rad), the longest first.
    directions : ndarray, shape (k, k)
        Unit vectors in the columns, in the order of the lengths, in the axes of the estimate.
    """

    __slots__ = ("mean", "covariance", "probability", "law", "threshold", "semi_axes", "directions")

    def __init__(self, mean, covariance, probability, law):
        if not 0 < probability < 1:
            raise ValueError(f"probability: expected a number between 0 and 1, got {probability}")
        self.mean, self.covariance, self.probability, self.law = mean, covariance, float(probability), law
        self.threshold = law.quantile(probability)
        self.semi_axes, self.directions, valid = _core.ellipsoid(covariance, self.threshold)
        if not valid:
            raise ValueError(f"no confidence region: {law} has no quantile, or the covariance is not one")

    def contains(self, x):
        """Whether elements are inside.

        Returns
        -------
        bool or ndarray of bool, shape of `x`
        """
        from ._statistics import mahalanobis

        return mahalanobis(self.mean, self.covariance, x) ** 2 <= self.threshold

    def __repr__(self):
        axes = ", ".join(f"{a:.3g}" for a in self.semi_axes)
        return f"<{100 * self.probability:g} % region of a {type(self.mean).__name__}: semi-axes {axes}>"


class MeanResult:
    """A mean with its certificates and its covariance.

    For a reduction along some of several axes the attributes have the shape of the axes that are left; otherwise they
    are those of a single mean.

    Attributes
    ----------
    mean : the type of the features
    covariance : ndarray, shape (..., k, k), or None
        Covariance of the mean in its own axes, m² and rad²; None (NaN in an array) where it is withheld.
    status : str
        'ok', 'ambiguous', 'ill_defined', 'too_few', 'not_converged' or 'not_applicable'.
    reason : str
        Why there is no covariance, in words; empty if there is one.
    unique : bool
        Whether the mean is proven to be the only one.
    uniqueness, proof : str
        'unique', 'ambiguous' or 'not_certified', and the certificate in words.
    rivals : the type of the features, shape (m,)
        Other minimisers of equal cost.
    near_ties : the type of the features, shape (m,)
        Other minima that the measurements do not exclude.
    dispersion : ndarray, shape (..., k, k)
        Covariance of the features about the mean.
    law : Law
        The law of the squared Mahalanobis distance of the truth.
    criterion : str
        'lsq', 'maha' or 'barycentre'.
    n, iterations : int
    cells : int
        Of the global search; 0 where it was not needed.
    cost, residual, tolerance, r_star, fit, fit_dof : float
        As in C++: `fit` is the sum of squared Mahalanobis distances for 'maha', χ² with `fit_dof` degrees of freedom if
        the covariances are right.
    """

    _scalars: tuple = ("status", "reason", "uniqueness", "proof", "n", "iterations", "cost", "residual", "tolerance")
    _scalars += ("r_star", "cells")

    def __init__(self, kind, criterion, answers, shape):
        self._kind, self.criterion, self.shape = kind, criterion, shape
        self._answers = answers
        k = kind.dof
        if shape == ():
            answer = answers[0]
            self.mean = kind._of(answer["mean"])
            self.covariance = answer["covariance"]
            self.dispersion = answer["dispersion"]
            self.rivals = kind._of(answer["rivals"])
            self.near_ties = kind._of(answer["near_ties"])
            self.law = Law(k, answer["law_samples"])
            self.more_rivals = answer["more_rivals"]
            self.fit, self.fit_dof = answer["fit"], answer["fit_dof"]
            for name in self._scalars:
                setattr(self, name, answer[name])
            self.unique = self.uniqueness == "unique"
            return
        nan = np.full((k, k), np.nan)

        def matrices(name):
            return _array([a[name] if a[name] is not None else nan for a in answers], (*shape, k, k))

        def objects(values):
            array = np.empty(len(answers), dtype=object)
            array[:] = values
            return array.reshape(shape)

        self.mean = kind._of(_array([a["mean"] for a in answers], (*shape, kind.parameters)))
        self.covariance = matrices("covariance")
        self.dispersion = matrices("dispersion")
        self.rivals = objects([kind._of(a["rivals"]) for a in answers])
        self.near_ties = objects([kind._of(a["near_ties"]) for a in answers])
        self.law = objects([Law(k, a["law_samples"]) for a in answers])
        for name in (*self._scalars, "fit", "fit_dof", "more_rivals"):
            setattr(self, name, np.array([a[name] for a in answers]).reshape(shape))
        self.unique = self.uniqueness == "unique"

    def __len__(self):
        if self.shape == ():
            raise TypeError("the result of a single mean has no len()")
        return self.shape[0]

    def __getitem__(self, index):
        """The result of one or some of several means."""
        if self.shape == ():
            raise TypeError("the result of a single mean is not subscriptable")
        numbers = np.arange(len(self._answers)).reshape(self.shape)[index]
        return MeanResult(self._kind, self.criterion, [self._answers[i] for i in np.ravel(numbers)], numbers.shape)

    @property
    def sigma(self):
        """ndarray, shape (..., k): standard deviations of the mean in its own axes; None where withheld."""
        if self.covariance is None:
            return None
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    def confidence_region(self, probability=0.95):
        """The ellipsoid that covers the true feature with the given probability, under the law of the covariance.

        Returns
        -------
        ConfidenceRegion

        Raises
        ------
        ValueError
            If the covariance is withheld.
        """
        self._single("confidence_region")
        if self.covariance is None:
            raise ValueError(f"no confidence region: {self.reason}")
        return ConfidenceRegion(self.mean, self.covariance, probability, self.law)

    def p_value(self, x):
        """The probability that an estimate is as far from the truth as this one is from `x`, were `x` the truth.

        Returns
        -------
        float or ndarray, shape of `x`
        """
        from ._statistics import mahalanobis

        self._single("p_value")
        if self.covariance is None:
            raise ValueError(f"no test: {self.reason}")
        return self.law.survival(mahalanobis(self.mean, self.covariance, x) ** 2)

    def _single(self, what):
        if self.shape != ():
            raise TypeError(f"{what} is that of one mean: index the result first")

    def _rows(self):
        names = self._kind.tangent_names
        rows = [("status", self.status), ("uniqueness", f"{self.uniqueness}: {self.proof}" if self.proof else "")]
        if self.reason:
            rows.append(("reason", self.reason))
        rows.append(("mean", np.array2string(self.mean.params, precision=6)))
        if self.covariance is not None:
            rows.append(("sigma, body axes", ", ".join(f"{n} {s:.4g}" for n, s in zip(names, self.sigma))))
        if self.dispersion is not None:
            spread = np.sqrt(np.diag(self.dispersion))
            rows.append(("dispersion, body axes", ", ".join(f"{n} {s:.4g}" for n, s in zip(names, spread))))
        rows.append(("features", str(self.n)))
        if len(self.rivals) or len(self.near_ties):
            rows.append(("rivals", f"{len(self.rivals)} of equal cost, {len(self.near_ties)} near ties"))
        return rows

    def __repr__(self):
        if self.shape:
            ok = int(np.count_nonzero(self.status == "ok"))
            return f"<MeanResult of {'×'.join(map(str, self.shape))} {self._kind.__name__}: {ok} ok>"
        return f"<MeanResult: {self.mean!r}, {self.status}, {self.uniqueness}, n = {self.n}>"

    def _repr_html_(self):
        if self.shape:
            return f"<code>{html.escape(repr(self))}</code>"
        left = "style='text-align:left'"
        rows = "".join(
            f"<tr><th {left}>{html.escape(k)}</th><td {left}>{html.escape(v)}</td></tr>" for k, v in self._rows()
        )
        title = f"Mean of {self.n} {self._kind.__name__} ({self.criterion})"
        return f"<table><caption>{html.escape(title)}</caption>{rows}</table>"


def _array(rows, shape):
    return np.array(rows, dtype=np.float64).reshape(shape)
