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


def _renamed(old, new):
    warnings.warn(f"liestat: {old!r} is called {new!r} now", DeprecationWarning, stacklevel=3)


class Law:
    """The law of a squared Mahalanobis distance: χ² where the noise was known, Hotelling's T² where the covariance came
    from the residuals of `samples` features.

    Parameters
    ----------
    degrees_of_freedom : int
        Dimension k of the error; `dof` is its former name.
    samples : int, optional
        Number of features whose residuals gave the covariance; none: χ².
    """

    __slots__ = ("degrees_of_freedom", "samples")

    def __init__(self, degrees_of_freedom=None, samples=None, *, dof=None):
        if dof is not None:
            _renamed("dof", "degrees_of_freedom")
            degrees_of_freedom = dof
        if degrees_of_freedom is None:
            raise TypeError("Law: degrees_of_freedom is missing")
        self.degrees_of_freedom = int(degrees_of_freedom)
        self.samples = int(samples) if samples else None

    @property
    def dof(self):
        """Former name of `degrees_of_freedom`."""
        _renamed("dof", "degrees_of_freedom")
        return self.degrees_of_freedom

    @property
    def name(self):
        """'chi2' or 'hotelling', as in the program's JSON."""
        return "hotelling" if self.samples else "chi2"

    def quantile(self, probability):
        """The squared distance that is not exceeded with the given probability; NaN where the law has none."""
        return _core.law_quantile(self.degrees_of_freedom, self.samples or 0, float(probability))

    def survival(self, squared_distance):
        """The probability that the squared distance is exceeded; elementwise."""
        values = np.asarray(squared_distance, dtype=np.float64)
        flat = [_core.law_survival(self.degrees_of_freedom, self.samples or 0, float(v)) for v in values.ravel()]
        return np.array(flat).reshape(values.shape)[()]

    def mean(self):
        """The expectation."""
        return _core.law_mean(self.degrees_of_freedom, self.samples or 0)

    def __repr__(self):
        samples = f", samples={self.samples}" if self.samples else ""
        return f"Law(degrees_of_freedom={self.degrees_of_freedom}{samples})"

    def __eq__(self, other):
        if not isinstance(other, Law):
            return False
        return (self.degrees_of_freedom, self.samples) == (other.degrees_of_freedom, other.samples)

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


class Uniqueness(str):
    """'unique', 'ambiguous' or 'not_certified'. Only the first is true, and equals True.

    The part `unique` of a result was a bool before it was a word: ``if result.unique:`` means what it meant.
    """

    __slots__ = ()

    def __bool__(self):
        return str.__eq__(self, "unique")

    def __eq__(self, other):
        if isinstance(other, (bool, np.bool_)):
            return bool(self) == bool(other)
        return str.__eq__(self, other)

    def __ne__(self, other):
        return not self == other

    __hash__ = str.__hash__


class MeanResult:
    """A mean with its certificates and its covariance.

    The attributes are the fields of ``liestat mean --json``, with the same names and values; features are of their
    types. `as_dict()` has them as the program writes them. For a reduction along some of several axes the attributes
    have the shape of the axes that are left; otherwise they are those of a single mean.

    Attributes
    ----------
    mean : the type of the features
    covariance : ndarray, shape (..., k, k), or None
        Covariance of the mean in its own axes, m² and rad²; None (NaN in an array) where it is withheld.
    covariance_from, covariance_law : str or None
        'noise' or 'residuals', and with it 'chi2' or 'hotelling'.
    status : str
        'ok', 'ambiguous', 'ill_defined', 'inconsistent' (the features scatter more than the covariances that are stated
        for them), 'too_few', 'not_converged', or 'not_applicable': there is a mean, but no covariance of it can be
        computed.
    reason : str or None
        Why there is no covariance, in words; None if there is one.
    verdict, trusted : str, bool
        The verdict on the mean in a sentence, and as a word: what `status` and `unique` say together.
    unique : Uniqueness
        The certificate of the criterion's minimum, 'unique', 'ambiguous' or 'not_certified'; true if it is 'unique'. A
        unique minimum may be a near tie, which `trusted` says. An array of words for several means.
    proof : str
        The certificate in words.
    rivals : the type of the features, shape (m,)
        Other minimisers of equal cost; all of them if `rivals_complete`.
    near_ties : the type of the features, shape (m,)
        Other minima that the measurements do not exclude; by `near_tie_z` standard deviations they are the worse.
    dispersion : ndarray, shape (..., k, k)
        Covariance of the features about the mean.
    farthest : list of dict
        The farthest feature in each part of the tangent vector, with its index; empty with ``certify=False``.
    standard_deviations, standard_deviations_world : dict
        Of the mean by parts, in degrees and metres, along its own axes and along those of the world.
    law : Law
        The law of the squared Mahalanobis distance of the truth.
    criterion : str
        'lsq', 'wlsq', 'maha', 'barycentre', 'huber' or 'median'.
    outliers, scales : list of dict
        With `robust`: the features that the noise of the others does not explain, the surest first, and the scale of
        the features along an axis in each part of the tangent vector.
    shift_p : float
        With `robust`: the probability of outliers so much on one side if errors are symmetric.
    n, iterations : int
    cells : int
        Of the global search; 0 where it was not needed.
    cut_locus_mass, hessian_change : float
        Fraction of the features near the cut locus of the mean, and by how much the Hessian averaged over the
        confidence region is lower than at the mean, relative: what a covariance is withheld for as 'ill_defined'.
    region_factor, valley, valley_angle : float, dict or None, float or None
        The factor by which the confidence region was widened, as features beyond it explain the measurements as well (1:
        not at all), the farthest of these that was found, with its z, and its angle from the mean in rad.
    fit, fit_dof, fit_p, fit_factor : float or None
        χ² of the features under the covariances that are stated for them, its degrees of freedom, the probability of so
        large a χ² (below 0.001 the covariances are refuted) and Birge's factor max(1, χ²/ν); None (NaN in an array)
        where nothing was tested.
    noise_scaled : bool
        The covariance is multiplied by Birge's factor.
    time_dependence, time_dependence_tested : str, bool
        With `times`: whether errors depend on them, in words, and whether that was tested.
    independence, correlated_share, correlation_time, correlation_factor : float or None
        The probability that errors are independent in time; where they are not, the share of their variance that
        depends on time, its time constant (in the unit of `times`), and the factor by which the variances of the mean
        are too small.
    inflated : bool
        The covariance is widened by that.
    notes : list of str
        What is remarkable about the result.
    labels : ndarray
        With `by`: the label of each mean.
    cost, residual, tolerance, r_star : float
        As in C++.
    """

    #: Features and numbers that the fields have in another form.
    _features: tuple = ("mean", "rivals", "near_ties")
    _values: tuple = ("near_tie_z", "cost")

    def __init__(self, kind, criterion, answers, shape):
        self._kind, self.criterion, self.shape = kind, criterion, shape
        self._answers = answers

    def _names(self):
        return [n for n in (self._answers[0] if self._answers else _core.mean_fields) if n != "_values"]

    def __dir__(self):
        return [*super().__dir__(), *self._names(), *self._values, "law"]

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        if name == "uniqueness":
            _renamed("uniqueness", "unique")
            return self.unique
        if name == "more_rivals":
            _renamed("more_rivals", "rivals_complete, its contrary,")
            return not self.rivals_complete if self.shape == () else np.logical_not(self.rivals_complete)
        if name != "law" and name not in self._values and name not in self._names():
            raise AttributeError(f"no part {name!r}; there are {', '.join((*self._names(), *self._values))}, law")
        parts = [self._part(answer, name) for answer in self._answers]
        value = parts[0] if self.shape == () else self._stacked(name, parts)
        self.__dict__[name] = value
        return value

    def _part(self, answer, name):
        """A part of one mean."""
        if name in self._features:
            params = answer["_values"][name]
            # There is no mean of nothing.
            return self._kind._of(np.full_like(params, np.nan) if name == "mean" and answer["n"] == 0 else params)
        if name in self._values:
            return answer["_values"][name]
        if name == "law":
            return Law(self._kind.dof, answer["_values"]["law_samples"])
        return Uniqueness(answer[name]) if name == "unique" else answer[name]

    def _stacked(self, name, parts):
        """The parts of several means as an array of their shape."""
        k, shape = self._kind.dof, self.shape
        if name == "mean":
            return self._kind._of(_array([x.params for x in parts], (*shape, self._kind.parameters)))
        if name in ("covariance", "covariance_factor", "dispersion"):
            nan = np.full((k, k), np.nan)
            return _array([nan if m is None else m for m in parts], (*shape, k, k))
        if name in ("fit", "fit_dof", "fit_p", "fit_factor"):
            return _array([np.nan if v is None else v for v in parts], shape)
        if name != "unique" and parts and all(isinstance(v, (bool, int, float, str)) for v in parts):
            return np.array(parts).reshape(shape)
        array = np.empty(len(parts), dtype=object)
        for i, part in enumerate(parts):  # not array[:], which looks into lists
            array[i] = part
        return array.reshape(shape)

    def keys(self):
        """Names of the fields."""
        return self._names()

    def as_dict(self):
        """The fields of a single mean as the program writes them to JSON, features by their parts.

        Returns
        -------
        dict
        """
        self._single("as_dict")
        return {name: self._answers[0][name] for name in self._names()}

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

    def plot(self, x=None, ax=None, probability=0.95):
        """Draws a single mean and its confidence region with matplotlib: a direction stereographically about itself, a
        heading on the circle, a rotation as its three axes, a position or a pose with the ellipsoid of its position.
        Regions are those of all coordinates together, as `confidence_region`, seen along what is drawn.

        Parameters
        ----------
        x : the type of the features, optional
            Features to draw as dots.
        ax : matplotlib axes, optional
            With ``projection="3d"`` but for directions, headings and SE2. Default: those of a new figure.
        probability : float
            Of the region; there is none where the covariance is withheld.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        from ._plot import plot_mean

        self._single("plot")
        return plot_mean(self, x, ax, probability)

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
        rows = [("status", self.status), ("uniqueness", self.proof)]
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
        rows += [("note", note) for note in self.notes]
        return rows

    def __repr__(self):
        if self.shape:
            ok = int(np.count_nonzero(self.status == "ok"))
            return f"<MeanResult of {'×'.join(map(str, self.shape))} {self._kind.__name__}: {ok} ok>"
        return f"<MeanResult: {self.mean!r}, {self.status}, {self.unique}, n = {self.n}>"

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
