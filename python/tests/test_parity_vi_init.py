"""`liestat vi-init` and `liestat.vi_init` on the same files."""

import os
import subprocess
import tempfile
import unittest

import numpy as np

import liestat
import parity

# A camera in the axes of the body: its pose has no rounding.
CALIBRATION = """cam0:
  T_imu_cam:
    - [1, 0, 0, 0]
    - [0, 1, 0, 0]
    - [0, 0, 1, 0]
    - [0, 0, 0, 1]
  camera_model: pinhole
  distortion_model: none
  distortion_coeffs: [0, 0, 0, 0]
  intrinsics: [450, 450, 376, 240]
  resolution: [752, 480]
  timeshift_cam_imu: 0
imu0:
  gyroscope_noise_density: 0.00016968
  gyroscope_random_walk: 1.9393e-05
  accelerometer_noise_density: 0.002
  accelerometer_random_walk: 0.003
"""
NOISE = (0.00016968, 0.002, 1.9393e-05, 0.003)
# Fields that describe the files.
OF_FILES = ("readings", "start_ns", "images", "tracks", "camera_pose_assumed", "tracks_seen_once", "found")
OF_FILES += ("observations_outside",)
WINDOW_SERIES = ("reason", "velocity", "gravity", "best_gyroscope_bias", "accelerometer_bias", "joint_covariance")
WINDOW_SERIES += ("scale_sigma", "tilt_sigma", "chi2", "image_indices", "track_names", "inliers", "states")


class ViInitParity(parity.ParityTest):
    function = "vi_init"

    @classmethod
    def setUpClass(cls):
        if not parity.PROGRAM:
            return
        cls.directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.directory.cleanup)
        path = {name: os.path.join(cls.directory.name, name) for name in ("chain.yaml", "vi")}
        with open(path["chain.yaml"], "w", encoding="utf-8") as file:
            file.write(CALIBRATION)
        parity.simulate("vi", "--output", path["vi"], "--calibration", path["chain.yaml"], "--end", 8, "--seed", 2)
        files = {name: os.path.join(path["vi"], f"{name}.csv") for name in ("imu", "tracks", "images", "truth")}
        cls.arguments = ["vi-init", "--imu", files["imu"], "--tracks", files["tracks"], "--calibration"]
        cls.arguments += [path["chain.yaml"], "--image-times", files["images"]]
        cls.truth_file = files["truth"]
        imu = liestat.read_imu(files["imu"])
        tracks = liestat.read_tracks(files["tracks"], files["images"], start_ns=imu.start_ns)
        rays, sigmas = liestat.Camera(450, 450, 376, 240, width=752, height=480).bearings(tracks.pixels)
        cls.measured = (imu.times, imu.rates, imu.forces, NOISE, tracks.image_times, tracks.images, tracks.tracks)
        cls.measured += (rays, sigmas)
        cls.truth = parity.truth_of(files["truth"], imu.start_ns)

    def run_both(self, *options, codes=(0,), **keywords):
        json = parity.program(*self.arguments, *options, codes=codes)
        for name in OF_FILES:
            json.pop(name)
        result = liestat.vi_init(*self.measured, **keywords)
        self.assertEqual(json["exit_code"] == 0, result.ok)
        self.assertEqual(parity.undeclared(result, self.function), [])
        plain = parity.plain(result)
        for window in plain["windows"]:
            for name in WINDOW_SERIES:
                window.pop(name)
        for stretch in plain["fusions"]:
            stretch.pop("window_indices")
        self.assert_equal_results(json, plain)
        return result

    def test_with_a_truth(self):
        result = self.run_both("--truth", self.truth_file, truth=self.truth)
        self.assertTrue(result.ok, result.in_words)
        self.assertIn("refined_error", result.windows[0].keys())
        self.assertGreater(result.nees_mean, 0)
        self.assertIsNotNone(result.fusions[0].nees)
        window = result.windows[0]
        np.testing.assert_array_equal(window.velocity, window.refined.velocity)
        np.testing.assert_array_equal(window.block("velocity"), window.refined.covariance[:3, :3])
        self.assertEqual(len(window.image_indices), window.images)

    def test_options(self):
        self.run_both("--window", 3, "--stride", 1, "--image-rate", 5, window=3.0, stride=1.0, image_rate=5.0)
        # No windows met: not tested.
        self.run_both(
            "--no-refinement", "--no-consensus", "--fuse", 0, codes=(3,), refinement=False, consensus=False, stretch=0.0
        )

    def test_what_is_not_to_be_trusted(self):
        result = self.run_both("--gravity", 5, codes=(3,), gravity=5.0)
        self.assertFalse(result.ok)
        self.assertTrue(result.in_words.startswith("Not to be trusted"), result.in_words)

    def test_errors_that_the_covariances_do_not_explain(self):
        # The velocity of the truth is 0.5 m/s off: each window by itself fits its measurements.
        wrong = os.path.join(self.directory.name, "wrong.csv")
        with open(self.truth_file, encoding="utf-8") as file, open(wrong, "w", encoding="utf-8") as output:
            for line in file:
                cells = line.strip().split(",")
                if not line.startswith("#"):
                    cells[8:11] = [repr(float(cell) + 0.5) for cell in cells[8:11]]
                output.write(",".join(cells) + "\n")
        imu_start = liestat.read_imu(self.arguments[2]).start_ns
        truth = parity.truth_of(wrong, imu_start)
        result = self.run_both("--truth", wrong, codes=(3,), truth=truth)
        self.assertFalse(result.ok)
        self.assertIn("INCONSISTENT with the truth", result.in_words)
        self.assertTrue(any(cause.startswith("velocity of windows") for cause in result.causes), result.causes)
        said = subprocess.run(
            [parity.PROGRAM, *self.arguments, "--truth", wrong], capture_output=True, text=True
        ).stdout
        for sentence in (result.in_words.partition(", but ")[2].removesuffix("."), *result.causes):
            self.assertIn(sentence, said)
        right = self.run_both("--truth", self.truth_file, truth=self.truth)
        self.assertEqual(right.causes, [])

    def test_noise_as_it_is_given(self):
        given = self.run_both("--no-calibrate-noise", calibrate_noise=False)
        self.assertIsNone(given.noise_calibration)
        self.assertTrue(given.notes[0].startswith("unverified_noise: "), given.notes)
        tested = self.run_both()
        self.assertEqual(tested.noise_calibration.meetings, len(tested.windows) - 1)
        self.assertIn(tested.noise_calibration.evidence, ("confirmed", "calibrated", "unverified_noise"))

    def test_start_of_a_filter(self):
        start = self.run_both().filter_start
        self.assertEqual((start.status, start.convention, start.from_rest), ("ok", "liestat", False))
        # Basalt turns the first three of our coordinates (position, rotation, velocity, biases) into the world.
        basalt = self.run_both("--filter-start", "basalt", filter_convention="basalt").filter_start
        turn = np.eye(15)
        for k in (0, 3, 6):
            turn[k : k + 3, k : k + 3] = liestat.SO3(start.quaternion_xyzw).as_matrix()
        np.testing.assert_allclose(basalt.covariance, turn @ start.covariance @ turn.T, rtol=0, atol=1e-12)
        free = ("--filter-start", "gtsam", "--position-sigma", 2, "--heading-sigma", 0.5)
        gtsam = self.run_both(*free, filter_convention="gtsam", position_sigma=2, heading_sigma=0.5).filter_start
        np.testing.assert_allclose(np.diag(gtsam.covariance)[3:6], 4)
        with self.assertRaisesRegex(ValueError, "filter_convention: no 'msckf'"):
            liestat.vi_init(*self.measured, filter_convention="msckf")

    def test_former_names(self):
        result = self.run_both()
        with self.assertWarnsRegex(DeprecationWarning, "'stretches' is called 'fusions' now"):
            self.assertIs(result.stretches, result.fusions)


if __name__ == "__main__":
    unittest.main()
