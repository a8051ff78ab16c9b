"""Pictures of means, with matplotlib where it is installed."""

import numpy as np

from ._manifolds import R3, S2, SE2, SE23, SO2, SO3

_GREY, _COLOURS = "0.6", ("tab:red", "tab:green", "tab:blue")
#: The step of the derivatives, m and rad.
_STEP = 1e-6


def _position(x):
    if isinstance(x, R3):
        return x.params
    return x.position if isinstance(x, SE23) else x.translation


def _rotation_matrix(x):
    return (x if isinstance(x, SO3) else x.rotation).as_matrix()


def _spread(mean, covariance, part):
    """The covariance of a part of the mean, linear in the tangent vector."""
    steps = _STEP * np.eye(mean.dof)
    J = np.stack([(part(mean.retract(h)) - part(mean.retract(-h))) / (2 * _STEP) for h in steps], axis=-1)
    return J @ covariance @ J.T


def _ellipse(covariance, threshold, n=73):
    """Offsets on the largest ellipse of a covariance that squared distances below the threshold reach."""
    values, vectors = np.linalg.eigh(covariance)
    t = np.linspace(0, 2 * np.pi, n)
    axes = vectors[:, -2:] * np.sqrt(threshold * np.maximum(values[-2:], 0))
    return np.stack([np.cos(t), np.sin(t)], axis=-1) @ axes.T


def _plot_directions(ax, mean, x, region):
    """Stereographic about the mean, in degrees from it."""
    centre = mean.params
    basis = np.asarray(mean.tangent_basis())
    basis = basis if basis.shape == (3, 2) else basis.T

    def plane(u):
        u = np.atleast_2d(u)
        return np.degrees(2 * (u @ basis) / (1 + u @ centre)[:, None])

    if x is not None:
        ahead = x.params.reshape(-1, 3)
        ahead = ahead[ahead @ centre > -0.99]  # the antipode has no place
        ax.plot(*plane(ahead).T, ".", color=_GREY, label="features")
    ax.plot(0, 0, "+", color="black", label="mean")
    if region is not None:
        offsets = _ellipse(region.covariance, region.threshold)
        ax.plot(*plane(mean.retract(offsets).params).T, color=_COLOURS[0], label=f"{100 * region.probability:g} %")
    ax.set_aspect("equal")
    ax.set_xlabel("stereographic, ° from the mean"), ax.set_ylabel("°")


def _plot_headings(ax, mean, x, region):
    """On the unit circle."""
    t = np.linspace(-np.pi, np.pi, 181)
    ax.plot(np.cos(t), np.sin(t), color=_GREY, lw=0.5)
    if x is not None:
        a = np.ravel(x.as_angle())
        ax.plot(np.cos(a), np.sin(a), ".", color=_GREY, label="features")
    centre = float(mean.as_angle())
    ax.plot([0, np.cos(centre)], [0, np.sin(centre)], color="black", label="mean")
    if region is not None:
        half = min(np.pi, np.sqrt(region.threshold * region.covariance[0, 0]))
        arc = centre + np.linspace(-half, half, 61)
        ax.plot(1.02 * np.cos(arc), 1.02 * np.sin(arc), color=_COLOURS[0], label=f"{100 * region.probability:g} %")
    ax.set_aspect("equal")


def _plot_axes(ax, mean, x, region, origin, length):
    """Axes of a rotation, their tips with the ellipses that the region gives them."""
    R = _rotation_matrix(mean)
    for k, (name, colour) in enumerate(zip("xyz", _COLOURS)):
        tip = origin + length * R[:, k]
        ax.plot(*np.stack([origin, tip], axis=-1), color=colour, label=f"{name} axis")
        if x is not None:
            ax.plot(*(origin + length * _rotation_matrix(x).reshape(-1, 3, 3)[:, :, k]).T, ".", color=_GREY, ms=2)
        if region is not None:
            C = _spread(mean, region.covariance, lambda y, k=k: _rotation_matrix(y)[:, k])
            ax.plot(*(tip + length * _ellipse(C, region.threshold)).T, color=colour, lw=1)


def _plot_ellipsoid(ax, centre, covariance, threshold):
    values, vectors = np.linalg.eigh(covariance)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    sphere = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    points = centre + sphere * np.sqrt(threshold * np.maximum(values, 0)) @ vectors.T
    ax.plot_wireframe(*np.moveaxis(points, -1, 0), color=_GREY, lw=0.5, label="region")


def plot_mean(result, x=None, ax=None, probability=0.95):
    """MeanResult.plot()."""
    try:
        import matplotlib.pyplot as pyplot
    except ImportError:
        raise ImportError("MeanResult.plot needs matplotlib, which is not installed (Debian: python3-matplotlib)") from None
    mean = result.mean
    if x is not None and type(x) is not type(mean):
        raise TypeError(f"plot: x: expected {type(mean).__name__}, got {type(x).__name__}")
    region = None if result.covariance is None else result.confidence_region(probability)
    flat = isinstance(mean, (S2, SO2, SE2))
    if ax is None:
        _, ax = pyplot.subplots(subplot_kw={} if flat else {"projection": "3d"})
    elif not flat and not hasattr(ax, "plot_wireframe"):
        raise ValueError(f"plot: ax: {type(mean).__name__} needs axes with projection='3d'")
    if isinstance(mean, S2):
        _plot_directions(ax, mean, x, region)
    elif isinstance(mean, SO2):
        _plot_headings(ax, mean, x, region)
    elif isinstance(mean, SO3):
        _plot_axes(ax, mean, x, region, np.zeros(3), 1.0)
    else:
        centre = np.asarray(_position(mean))
        if x is not None:
            points = np.asarray(_position(x)).reshape(-1, centre.size)
            ax.plot(*points.T, ".", color=_GREY, label="features")
        reach = [np.abs(points - centre).max()] if x is not None else []
        if region is not None:
            C = _spread(mean, region.covariance, lambda y: np.asarray(_position(y)))
            reach.append(np.sqrt(region.threshold * C.trace()))
            if flat:
                ax.plot(*(centre + _ellipse(C, region.threshold)).T, color=_COLOURS[0], label=f"{100 * probability:g} %")
            else:
                _plot_ellipsoid(ax, centre, C, region.threshold)
        ax.plot(*centre[:, None], "+", color="black", label="mean")
        length = max(reach, default=0.0) or 1.0
        if isinstance(mean, SE2):
            a = float(mean.angle)
            ax.plot(*np.stack([centre, centre + length * np.array([np.cos(a), np.sin(a)])], axis=-1), color="black")
            ax.set_aspect("equal")
        elif not isinstance(mean, R3):
            _plot_axes(ax, mean, None, region, centre, length)
        ax.set_xlabel("x, m"), ax.set_ylabel("y, m")
    ax.set_title(f"{result.status}, n = {result.n}")
    ax.legend(loc="best", fontsize="small")
    return ax
