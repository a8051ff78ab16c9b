"""`liestat validate split` and liestat.validate_split on the same files: fields, values, defaults, verdict."""

import inspect
import os
import subprocess
import tempfile
import unittest

import numpy as np
from parity import PROGRAM, ParityTest, program

import liestat

DATA = os.path.join(os.path.dirname(__file__), "..", "..", "examples", "data")


class SplitParity(ParityTest):
    function = "validate_split"

    def assert_equal_splits(self, path, options=(), kind=None, use=(), **arguments):
        """Equal fields, and the verdict is that of the terminal. Returns JSON and result."""
        json = program("validate", "split", path, *options, codes=(0, 1))
        rows = liestat.read_features(path, kind)
        arguments.update({name: rows[name] for name in use})
        result = liestat.validate_split(rows.features, **arguments)
        self.assert_equal_results(json, result, series=("verdict", "causes"))
        self.assertEqual(json["exit_code"] == 0, result.passed)
        shown = subprocess.run([PROGRAM, "validate", "split", path, *options], capture_output=True, text=True).stdout
        for sentence in (result.verdict, *result.causes):
            self.assertIn(" ".join(sentence.split()), " ".join(shown.split()))
        return json, result

    def table(self, header, rows):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        path = os.path.join(directory.name, "f.csv")
        np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=header, comments="")
        return path

    def test_examples(self):
        _, result = self.assert_equal_splits(os.path.join(DATA, "rotations.csv"))
        self.assertTrue(result.passed)
        self.assertTrue(result.verdict.startswith("PASSED: "))
        path = os.path.join(DATA, "camera_at_rest.tum")
        for kind, feature in ((liestat.SE3, "se3"), (liestat.Frame3, "frame")):
            _, result = self.assert_equal_splits(path, ("--feature", feature), kind=kind, use=["times"])
            self.assertFalse(result.passed)
            self.assertTrue(result.verdict.startswith("FAILED: "))
            self.assertGreater(result.inflation, 1)

    def test_options(self):
        rng = np.random.default_rng(1)
        rows = np.column_stack([rng.permutation(40), rng.normal(size=(40, 3)), rng.uniform(0.5, 2, 40)])
        self.assert_equal_splits(
            self.table("t,x,y,z,weight", rows), ("--splits", "17", "--blocks", "8", "--seed", "5"),
            use=["times", "weights"], splits=17, blocks=8, seed=5,
        )

    def test_known_noise(self):
        """Covariances that say a hundredth of the variance: already halves at random differ."""
        rng = np.random.default_rng(2)
        rows = np.column_stack([0.1 * rng.normal(size=(30, 3)), np.tile([1e-4, 0, 0, 1e-4, 0, 1e-4], (30, 1))])
        path = self.table("rx,ry,rz,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22", rows)
        _, result = self.assert_equal_splits(path, use=["covariances"])
        self.assertEqual((result.criterion, result.law, len(result.causes)), ("maha", "chi2", 1))
        self.assert_equal_splits(path, ("--criterion", "lsq"), use=["covariances"], criterion="lsq")

    def test_types_of_the_module_alone(self):
        """Motions of the plane and extended poses, which no file of the program has."""
        rng = np.random.default_rng(3)
        for kind in (liestat.SE2, liestat.SE23):
            x = kind.exp(0.1 * rng.normal(size=(40, kind.dof)))
            result = liestat.validate_split(x, splits=20)
            self.assertEqual((result.feature, result.dof), (kind.__name__.lower(), kind.dof))
            self.assertEqual(result.by_blocks.splits, 20)
            found = liestat.mean(x, times=np.arange(40))
            self.assertTrue(found.time_dependence_tested)

    def test_refusals(self):
        x = liestat.R3(np.eye(3))
        for message, arguments in (
            ("3 measurements, too few to be split: 10 at least", {}),
            ("blocks must be even", {"blocks": 3}),
            ("splits", {"splits": 0}),
        ):
            with self.assertRaisesRegex(ValueError, message):
                liestat.validate_split(x, **arguments)

    def test_defaults(self):
        """Those that the program's help states."""
        run = subprocess.run([PROGRAM, "validate", "split", "--help"], capture_output=True, text=True)
        text = " ".join(run.stdout.split())
        defaults = {n: p.default for n, p in inspect.signature(liestat.validate_split).parameters.items()}
        self.assertIn(f"Splits of each kind (default {defaults['splits']})", text)
        self.assertIn(f"Blocks of time, an even number (default {defaults['blocks']})", text)
        json = program("validate", "split", os.path.join(DATA, "rotations.csv"), codes=(0, 1))
        self.assertEqual(json["seed"], defaults["seed"])


if __name__ == "__main__":
    unittest.main()
