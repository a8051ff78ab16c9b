"""Is the covariance of an estimator right? One that is, and one that ignores that its errors share a part."""

from typing import Any

import numpy as np

import liestat


def draw(rng: np.random.Generator) -> tuple[liestat.SO3, liestat.SO3]:
    truth = liestat.random_rotations(rng=rng)
    return truth, truth.retract(0.05 * rng.standard_normal((10, 3)))


def draw_with_shared_error(rng: np.random.Generator) -> tuple[liestat.SO3, liestat.SO3]:
    truth, measured = draw(rng)
    return truth, measured * liestat.SO3.exp(0.05 * rng.standard_normal(3))


def estimate(measured: liestat.SO3) -> Any:
    return liestat.mean(measured)


def main() -> None:
    report = liestat.validate(estimate, draw, trials=300)
    print(report)
    assert report.passed
    report = liestat.validate(estimate, draw_with_shared_error, trials=300)
    print(report)
    assert not report.passed


if __name__ == "__main__":
    main()
