"""Rotation vectors about their mean with the dispersion and the confidence region; a picture if matplotlib is there."""

import importlib
import sys

import numpy as np

import liestat


def main() -> None:
    measured = liestat.sample(liestat.SO3.exp([1.0, 0.5, 0.2]), np.diag([0.3, 0.15, 0.1]) ** 2, 60, rng=3)
    result = liestat.mean(measured)
    spread, covariance = result.dispersion, result.covariance
    if spread is None or covariance is None:
        sys.exit(f"no covariance: {result.reason}")
    points = result.mean.local(measured)
    region = result.confidence_region(0.95)
    angle = np.linspace(0, 2 * np.pi, 100)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    # The ellipses' shadows on the first two axes.
    dispersion = np.linalg.cholesky(spread[:2, :2]) @ circle
    of_mean = np.sqrt(region.threshold) * np.linalg.cholesky(covariance[:2, :2]) @ circle
    print(f"{len(points)} rotations, 1-sigma dispersion reaches {np.abs(dispersion).max():.3f} rad")
    print(f"the mean is known to {np.abs(of_mean).max():.3f} rad with 95 %")
    try:
        importlib.import_module("matplotlib").use("Agg")
        pyplot = importlib.import_module("matplotlib.pyplot")
    except ImportError:
        print("without matplotlib there is no picture")
        return

    figure, axes = pyplot.subplots()
    axes.plot(points[:, 0], points[:, 1], ".", label="rotations")
    axes.plot(*dispersion, label="dispersion, 1 sigma")
    axes.plot(*of_mean, label="mean, 95 %")
    axes.set(xlabel="about x, rad", ylabel="about y, rad", aspect="equal")
    axes.legend()
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "mean.svg")


if __name__ == "__main__":
    main()
