"""What the tests share."""

import os
import subprocess

import numpy as np

import liestat

GROUPS = {"SO2": 1, "SO3": 3, "SE2": 3, "SE3": 6, "SE23": 9}
METRIC = {"R3": 3, "S2": 2, "SO2": 1, "SO3": 3, "Frame3": 6, "SemiOrientedFrame3": 6, "NonOrientedFrame3": 6}
TYPES = {**GROUPS, **METRIC}


def generator(seed=0):
    return np.random.default_rng(seed)


def features(name, shape, sigma=0.2, seed=0):
    """Features about the origin, moved away from it."""
    kind = getattr(liestat, name)
    rng = generator(seed)
    centre = kind.identity().retract(rng.uniform(-1, 1, kind.dof))
    return centre.retract(sigma * rng.standard_normal((*np.atleast_1d(shape), kind.dof)))


def reference(operation, values, tail):
    """What the C++ library makes of the numbers, or None where the program is missing."""
    program = os.environ.get("LIESTAT_REFERENCE")
    if not program:
        return None
    values = np.ascontiguousarray(values)
    command = [program, operation, str(len(values))]
    run = subprocess.run(command, input=values.tobytes(), capture_output=True, check=True)
    return np.frombuffer(run.stdout).reshape(-1, *tail)
