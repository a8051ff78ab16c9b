"""Poses with covariances: the convention of a sender, fusion, a chain of uncertain motions, a function of a user's."""

import numpy as np

import liestat


def main() -> None:
    # Three estimates of a pose, their covariances along the axes of the world with the rotation first.
    poses = liestat.Frame3.identity().retract(
        [[1.0, 2.0, 0.5, 0.1, 0.0, 0.2], [1.1, 1.9, 0.5, 0.12, 0.01, 0.2], [0.9, 2.0, 0.6, 0.09, 0.0, 0.22]]
    )
    world = np.diag([0.02, 0.02, 0.02, 0.1, 0.1, 0.1]) ** 2
    estimates = liestat.Gaussian(poses, world, convention="world_rotation_first")
    fused = liestat.fuse(estimates, covariance_at="measured")
    print("fused      ", fused.mean)
    print("sigma      ", fused.sigma.round(4), "m, rad")

    # A chain of motions, and the distance of its end from a landmark.
    noise = np.diag([0.01, 0.01, 0.01, 0.002, 0.002, 0.01]) ** 2
    step = liestat.Gaussian(liestat.SE3.exp([1.0, 0, 0, 0, 0, 0.1]), noise)
    end = step
    for _ in range(9):
        end = end * step
    landmark = np.array([5.0, 5.0, 0.0])
    distance, variance = liestat.propagate(lambda pose: np.linalg.norm(pose.translation - landmark), end)
    print("distance   ", round(float(distance), 3), "+-", round(float(np.sqrt(variance[0, 0])), 3), "m")


if __name__ == "__main__":
    main()
