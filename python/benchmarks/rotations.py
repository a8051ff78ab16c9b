"""Operations on arrays beside scipy.spatial.transform.Rotation, in one run.

PYTHONPATH=build/release/python python3 python/benchmarks/rotations.py

Times are the least of several runs, ms for a million elements on one thread.
"""

import time

import numpy as np

import liestat
from scipy.spatial.transform import Rotation


def milliseconds(function, repetitions=7):
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def main(n=1_000_000):
    rng = np.random.default_rng(0)
    v = 0.2 * rng.standard_normal((n, 3))
    points = rng.standard_normal((n, 3))
    x, r = liestat.SO3.exp(v), Rotation.from_rotvec(v)
    y, s = liestat.SO3.exp(v[::-1]), Rotation.from_rotvec(v[::-1])
    rows = {
        "exp": (lambda: liestat.SO3.exp(v), lambda: Rotation.from_rotvec(v)),
        "log": (x.log, r.as_rotvec),
        "product": (lambda: x * y, lambda: r * s),
        "inverse": (x.inv, r.inv),
        "action on a point": (lambda: x.act(points), lambda: r.apply(points)),
        "matrix": (x.as_matrix, r.as_matrix),
        "mean, covariance, no certificate": (lambda: liestat.mean(x, certify=False, threads=1), r.mean),
        "mean, covariance, certificate": (lambda: liestat.mean(x, threads=1), None),
    }
    print(f"{n} rotations, NumPy {np.__version__}")
    print(f"{'':34s}{'liestat':>9s}{'SciPy':>9s}")
    for name, (ours, theirs) in rows.items():
        other = f"{milliseconds(theirs):9.1f}" if theirs else "        -"
        print(f"{name:34s}{milliseconds(ours):9.1f}{other}")
    print("SciPy's mean is the chordal one and has no covariance.")


if __name__ == "__main__":
    main()
