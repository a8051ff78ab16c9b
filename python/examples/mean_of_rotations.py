"""The mean of rotations with its covariance, beside SciPy's chordal mean."""

import numpy as np

import liestat


def main() -> None:
    rng = np.random.default_rng(0)
    truth = liestat.SO3.exp([0.3, 0.0, -0.1])
    measured = truth.retract(0.1 * rng.standard_normal((40, 3)))

    result = liestat.mean(measured)
    print("status     ", result.status, result.unique)
    print("mean       ", result.mean.log().round(4), "rad")
    print("sigma      ", result.sigma, "rad, body axes")
    print("95 % region", result.confidence_region(0.95))
    print("truth inside:", result.confidence_region(0.95).contains(truth), " p =", round(result.p_value(truth), 3))

    try:
        from scipy.spatial.transform import Rotation  # type: ignore[import]
    except ImportError:
        return
    chordal = liestat.SO3.from_scipy(Rotation.from_quat(measured.as_quat()).mean())
    print("SciPy's mean is", float(result.mean.distance(chordal)), "rad away")


if __name__ == "__main__":
    main()
