"""`liestat preintegrate` and `liestat.preintegrate` on the same files."""

import os
import tempfile
import unittest
import warnings

import numpy as np

import liestat
import parity

SERIES = ("increment", "covariance", "covariance_with_bias", "bias_jacobian", "faults", "ok")
NOISE = (1.6968e-4, 2e-3, 1.9393e-5, 3e-3)


class PreintegrateParity(parity.ParityTest):
    function = "preintegrate"

    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.directory.cleanup)
        if not parity.PROGRAM:
            return
        parity.simulate("vi", "--output", cls.directory.name, "--overwrite", "--seed", 3, "--end", 12)
        imu = liestat.read_imu(os.path.join(cls.directory.name, "imu.csv"))
        cls.readings = (imu.times, imu.rates, imu.forces)
        cls.truth = parity.truth_of(os.path.join(cls.directory.name, "truth.csv"), imu.start_ns)

    def run_both(self, *options, codes=(0,), noise=NOISE, window=1.0, **keywords):
        imu = os.path.join(self.directory.name, "imu.csv")
        if noise is not None:
            options = ("--noise", ",".join(map(repr, noise)), *options)
        json = parity.program("preintegrate", "--imu", imu, "--window", window, *options, codes=codes)
        for name in ("format", "readings", "start_ns", "reading_notes"):
            json.pop(name)
        t = self.readings[0]
        begin = t[0] + np.arange(int((t[-1] - t[0]) / window * (1 + 1e-12))) * window
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = liestat.preintegrate(
                *self.readings, begin, begin + window, noise=(0.0, 0.0) if noise is None else noise, **keywords
            )
        return json, result, [str(w.message) for w in caught]

    def truth_file(self):
        return os.path.join(self.directory.name, "truth.csv")

    def test_with_a_truth(self):
        json, result, caught = self.run_both("--truth", self.truth_file(), truth=self.truth)
        self.assert_equal_results(json, result, SERIES)
        self.assertIs(result.consistent, True, result.verdict)
        self.assertEqual(result.degrees_of_freedom, 9 * len(result.windows))
        self.assertEqual(caught, [])
        np.testing.assert_array_equal(result.covariance[3], result.windows[3].covariance)

    def test_noise_that_is_too_small_is_inconsistent_everywhere(self):
        noise = tuple(0.4 * density for density in NOISE)
        json, result, caught = self.run_both("--truth", self.truth_file(), codes=(3,), noise=noise, truth=self.truth)
        self.assert_equal_results(json, result, SERIES)
        self.assertIs(result.consistent, False)
        self.assertTrue(result.verdict.startswith("INCONSISTENT with the truth"), result.verdict)
        self.assertGreater(len(result.causes), 0)
        self.assertEqual(caught, [f"liestat.preintegrate: {result.verdict}"])

    def test_options(self):
        bias = (0.001, 0.002, -0.001, 0.01, 0.02, 0.03)
        options = ("--truth", self.truth_file(), "--gyroscope-bias", "0.001,0.002,-0.001")
        options += ("--accelerometer-bias", "0.01,0.02,0.03", "--scheme", "cubic", "--gravity", "9.8")
        json, result, _ = self.run_both(
            *options, codes=(3,), truth=self.truth, bias=bias, scheme="cubic", gravity=9.8
        )
        self.assert_equal_results(json, result, SERIES)

    def test_no_verdict(self):
        json, result, _ = self.run_both()
        self.assert_equal_results(json, result, SERIES)
        self.assertIsNone(result.consistent)
        json, result, _ = self.run_both("--truth", self.truth_file(), noise=None, truth=self.truth)
        self.assert_equal_results(json, result, SERIES)
        self.assertIsNone(result.consistent)
        self.assertIn("noise is not known", result.verdict)

    def test_faults(self):
        json, result, caught = self.run_both("--max-gap", "1e-9", codes=(3,), max_gap=1e-9)
        self.assert_equal_results(json, result, SERIES)
        self.assertEqual(result.windows[0].status, "gap")
        self.assertEqual(len(caught), 1)


if __name__ == "__main__":
    unittest.main()
