#!/usr/bin/env python3
"""Writes pose_conventions.txt: one covariance in every convention and layout, by mpmath.

Each convention is written here as the exact error coordinates of its definition; the Jacobian is a central difference
of 60 digits. Nothing is shared with the library, which has the Jacobians in closed form.
"""
import pathlib
from mpmath import asin, atan2, cos, eye, matrix, mp, mpf, norm, pi, sin, sqrt, zeros

mp.dps = 60


def hat(v):
    return matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def exp_so3(v):
    a, K = norm(v), hat(v)
    return eye(3) if a == 0 else eye(3) + sin(a) / a * K + (1 - cos(a)) / a**2 * K * K


def log_so3(R):
    v = matrix([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    s, c = norm(v), (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2
    return v if s == 0 else v * (atan2(s, c) / s)


def left_jacobian(v):
    a, K = norm(v), hat(v)
    return eye(3) if a == 0 else eye(3) + (1 - cos(a)) / a**2 * K + (a - sin(a)) / a**3 * K * K


def exp_se3(xi):
    rho, phi = matrix(xi[0:3]), matrix(xi[3:6])
    return exp_so3(phi), left_jacobian(phi) * rho


def log_se3(T):
    phi = log_so3(T[0])
    return list(left_jacobian(phi) ** -1 * T[1]) + list(phi)


def product(A, B):
    return A[0] * B[0], A[0] * B[1] + A[1]


def inverse(A):
    return A[0].T, -(A[0].T * A[1])


def rpy(R):
    return [atan2(R[2, 1], R[2, 2]), -asin(R[2, 0]), atan2(R[1, 0], R[0, 0])]


def difference(f, T_hat, T):
    return [a - b for a, b in zip(f(T[0]), f(T_hat[0]))]


def position(T_hat, T):
    return list(T[1] - T_hat[1])


def world_turn(T_hat, T):
    return list(log_so3(T[0] * T_hat[0].T))


def body_turn(T_hat, T):
    return list(log_so3(T_hat[0].T * T[0]))


def half(v):
    return [x / 2 for x in v]


# name: (order, content, coordinates translation, coordinates rotation)
CONVENTIONS = {
    "right": ("tr", "covariance", lambda h, T: log_se3(product(inverse(h), T))),
    "left": ("tr", "covariance", lambda h, T: log_se3(product(T, inverse(h)))),
    "ros-fixed": ("tr", "covariance", lambda h, T: position(h, T) + world_turn(h, T)),
    "ros-rpy": ("tr", "covariance", lambda h, T: position(h, T) + difference(rpy, h, T)),
    "mrpt-ypr": ("tr", "covariance", lambda h, T: position(h, T) + difference(rpy, h, T)[::-1]),
    "ros-body-ori": ("tr", "covariance", lambda h, T: position(h, T) + body_turn(h, T)),
    "g2o-half": ("tr", "information", lambda h, T: list(h[0].T * (T[1] - h[1])) + half(body_turn(h, T))),
    "g2o-full": ("tr", "information", lambda h, T: log_se3(product(inverse(h), T))),
    "ceres-quat": ("tr", "covariance", lambda h, T: position(h, T) + half(world_turn(h, T))),
    "ceres-posegraph": ("tr", "covariance", lambda h, T: position(h, T) + [-x for x in world_turn(h, T)]),
    "opencv-rvec": ("rt", "covariance",
                    lambda h, T: position(h, T) + difference(lambda R: list(log_so3(R)), h, T)),
    "gtsam": ("rt", "covariance", lambda h, T: log_se3(product(inverse(h), T))),
    "pytransform3d": ("rt", "covariance", lambda h, T: log_se3(product(T, inverse(h)))),
    "toro": ("tr", "information", lambda h, T: position(h, T) + difference(rpy, h, T)),
}

LAYOUTS = {
    "full36": [(i, j) for i in range(6) for j in range(6)],
    "upper21": [(i, j) for i in range(6) for j in range(i, 6)],
    "lower21": [(i, j) for i in range(6) for j in range(i + 1)],
    "blocks12": [(b + i, b + j) for b in (0, 3) for i in range(3) for j in range(i, 3)],
    "diag6": [(i, i) for i in range(6)],
}

# A rotation of 1.02 rad, a position 1.88 m away, and a full covariance whose entries are exact decimals.
PHI = matrix([mpf("0.55"), mpf("-0.6"), mpf("0.61")])
P = matrix([mpf("1.2"), mpf("-0.9"), mpf("1.13")])
ROOT = matrix([[mpf(x) / 100 for x in row] for row in [
    [12, 3, -2, 5, 1, 2], [-4, 15, 3, 2, -6, 1], [2, -3, 9, 1, 4, -5],
    [3, 1, -4, 8, 2, 1], [-1, 2, 3, -2, 11, 3], [5, -2, 1, 3, -1, 10]]])
SIGMA = ROOT * ROOT.T


def text(x):
    return mp.nstr(x, 20, strip_zeros=False, min_fixed=0, max_fixed=0)


def main():
    T_hat = (exp_so3(PHI), P)
    lines = ["# One pose and covariance in every convention and layout, by pose_conventions.py with 60 digits.",
             "phi " + " ".join(map(text, PHI)), "p " + " ".join(map(text, P)),
             "sigma " + " ".join(text(SIGMA[i, j]) for i, j in LAYOUTS["full36"])]
    h = mpf(10) ** -20
    for name, (order, content, coordinates) in CONVENTIONS.items():
        J = zeros(6)
        for k in range(6):
            d = [h if i == k else mpf(0) for i in range(6)]
            up = coordinates(T_hat, product(T_hat, exp_se3(d)))
            down = coordinates(T_hat, product(T_hat, exp_se3([-x for x in d])))
            for i in range(6):
                J[i, k] = (up[i] - down[i]) / (2 * h)
        C = J * SIGMA * J.T
        if content == "information":
            C = C ** -1
        at = list(range(6)) if order == "tr" else [3, 4, 5, 0, 1, 2]
        for layout, entries in LAYOUTS.items():
            lines.append(f"{name} {layout} " + " ".join(text(C[at[i], at[j]]) for i, j in entries))
    pathlib.Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n")


main()
