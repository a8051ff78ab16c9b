"""Hand-eye calibration: the pose of a camera on a gripper from pairs of noisy poses, with its covariance."""

import numpy as np

import liestat


def main() -> None:
    rng = np.random.default_rng(1)
    gripper_T_camera = liestat.SE3.exp([0.05, 0.0, 0.1, 0.0, 0.3, 0.0])
    base_T_target = liestat.SE3.exp([0.8, 0.1, 0.0, 0.0, 0.0, 1.0])
    covariance = np.diag([0.001, 0.001, 0.001, 0.002, 0.002, 0.002]) ** 2

    base_T_gripper = liestat.SE3.exp(np.concatenate([rng.uniform(-0.5, 0.5, (20, 3)), rng.normal(0, 0.5, (20, 3))], 1))
    target_T_camera = base_T_target.inv() * base_T_gripper * gripper_T_camera
    result = liestat.hand_eye(
        liestat.sample(base_T_gripper, covariance, rng=rng),
        liestat.sample(target_T_camera, covariance, rng=rng),
        covariance,
        covariance,
    )
    print("status     ", result.status)
    print("X          ", result.X.mean)
    print("sigma      ", result.X.sigma, "m, rad")
    distance = float(result.X.mahalanobis(gripper_T_camera))
    print("error      ", result.X.mean.local(gripper_T_camera), "Mahalanobis distance", round(distance, 2))


if __name__ == "__main__":
    main()
