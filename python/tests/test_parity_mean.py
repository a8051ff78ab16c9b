"""`liestat mean` and liestat.mean on the same files: fields, values, defaults, verdict."""

import os
import tempfile
import unittest
import warnings

import numpy as np
from parity import ParityTest, plain, program

import liestat

DATA = os.path.join(os.path.dirname(__file__), "..", "..", "examples", "data")
# Fields of the file that the measurements come from.
OF_THE_FILE = {"format", "n_normalised", "largest_norm_error"}
#: Attributes that have the module's types in place of the fields' parts.
TYPED = {"mean", "rivals", "near_ties", "farthest"}


class MeanParity(ParityTest):
    def assert_equal_means(self, path, options=(), codes=(0, 3), kind=None, use=(), **arguments):
        """The fields of the program's JSON are those of the result, with equal values. `use` names what the call takes
        from the file: weights, covariances, times. Returns JSON and result."""
        json = program("mean", path, *options, codes=codes)
        rows = liestat.read_features(path, kind)
        arguments.update({name: rows[name] for name in use})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            result = liestat.mean(rows.features, **arguments)
        theirs = {name: value for name, value in json.items() if name not in OF_THE_FILE}
        ours = result.as_dict()
        # Rows of a file are lines, those of an array have an index.
        for a, b in zip(theirs["farthest"], ours["farthest"]):
            self.assertEqual(rows.lines[b.pop("index")], a.pop("line"))
        self.assert_equal_results(theirs, ours)
        self.assertEqual(theirs["exit_code"] == 0, result.status in ("ok", "not_applicable"))
        for name in set(ours) - TYPED:
            self.assertEqual(plain(getattr(result, name)), plain(ours[name]), name)
        self.assertEqual(result.unique == "unique", bool(result.unique))
        return json, result

    def written(self, text):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        path = os.path.join(directory.name, "f.csv")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def table(self, header, rows):
        return self.written(header + "\n" + "\n".join(",".join(repr(float(v)) for v in row) for row in rows) + "\n")

    def test_examples(self):
        json, result = self.assert_equal_means(os.path.join(DATA, "rotations.csv"))
        self.assertEqual((json["status"], json["time_dependence_tested"]), ("ok", False))
        self.assertIs(result.unique == True, True)  # noqa: E712: as it was a bool
        self.assertTrue(result.unique)

    def test_crystals(self):
        path = os.path.join(DATA, "rotations.csv")
        json, result = self.assert_equal_means(path, ["--symmetry", "m-3m"], symmetry="m-3m")
        self.assertEqual((json["symmetry"], json["feature"], result.symmetry), ("432", "crystal_orientation", "432"))

    def test_times(self):
        """Poses of a camera at rest: the errors of successive rows depend on each other."""
        path = os.path.join(DATA, "camera_at_rest.tum")
        for kind, feature in ((liestat.SE3, "se3"), (liestat.Frame3, "frame")):
            json, plainly = self.assert_equal_means(path, ("--feature", feature), kind=kind, use=["times"])
            self.assertGreater(plainly.correlation_factor, 1)
            self.assertTrue(any("not independent" in note for note in plainly.notes))
            _, inflated = self.assert_equal_means(
                path, ("--feature", feature, "--inflate"), kind=kind, use=["times"], inflate=True
            )
            self.assertTrue(inflated.inflated)
            factor = plainly.correlation_factor
            gain = np.linalg.solve(plainly.covariance, inflated.covariance)  # each principal axis has a factor
            self.assertAlmostEqual(np.trace(gain) / 6 / factor, 1, 9)
        with self.assertRaisesRegex(ValueError, "dependence of errors on time cannot be tested"):
            liestat.mean(liestat.R3(np.eye(3)), times=[0, 1, 2], inflate=True)

    def test_weights(self):
        rng = np.random.default_rng(1)
        rows = np.column_stack([rng.normal(size=(30, 3)), rng.uniform(0.5, 2, 30)])
        rows[3, 3] = 0
        json, result = self.assert_equal_means(self.table("x,y,z,weight", rows), use=["weights"])
        self.assertEqual((json["criterion"], json["weighted"], json["n"]), ("wlsq", True, 29))
        self.assertIn("1 measurement has no weight", result.notes[0])

    def covariances(self, n, k, rng, scale=1e-3):
        """Header and rows of covariances."""
        root = rng.normal(size=(n, k, k)) + 3 * np.eye(k)
        c = scale * root @ np.swapaxes(root, 1, 2)
        upper = np.triu_indices(k)
        return ",".join(f"cov_{i}{j}" for i, j in zip(*upper)), c[:, upper[0], upper[1]]

    def test_mahalanobis(self):
        rng = np.random.default_rng(2)
        names, values = self.covariances(20, 3, rng, 1e-2)
        rows = np.column_stack([[0.3, 0.2, 0.1] + 0.1 * rng.normal(size=(20, 3)), values])
        json, result = self.assert_equal_means(self.table("rx,ry,rz," + names, rows), use=["covariances"])
        self.assertEqual((json["criterion"], json["covariance_law"]), ("maha", "chi2"))
        self.assertEqual(result.law.name, json["covariance_law"])
        self.assertIsNotNone(result.fit_p)
        self.assert_equal_means(
            self.table("rx,ry,rz," + names, rows), ("--criterion", "lsq"), use=["covariances"], criterion="lsq"
        )
        names, values = self.covariances(20, 6, rng)
        path = self.table(
            "tx,ty,tz,rx,ry,rz," + names, np.column_stack([0.1 * rng.normal(size=(20, 6)), values])
        )
        for at in ("measured", "estimated"):
            json, _ = self.assert_equal_means(
                path, ("--covariance-at", at), kind=liestat.Frame3, use=["covariances"], covariance_at=at
            )
            self.assertEqual(json["covariance_at"], at)
        self.assert_equal_means(
            path, ("--covariance-at", "measured", "--likelihood"), kind=liestat.Frame3, use=["covariances"],
            covariance_at="measured", likelihood=True,
        )
        self.assert_equal_means(
            path, ("--feature", "se3", "--criterion", "maha"), kind=liestat.SE3, use=["covariances"]
        )

    def test_poor_fit(self):
        """Covariances that say a hundredth of the variance."""
        rng = np.random.default_rng(3)
        rows = np.column_stack([rng.normal(size=(20, 3)), np.tile([0.01, 0, 0, 0.01, 0, 0.01], (20, 1))])
        path = self.table("x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22", rows)
        json, result = self.assert_equal_means(path, use=["covariances"])
        self.assertIn("scatter more than their covariances say", result.notes[-1])
        self.assertLess(json["fit_p"], 1e-3)
        self.assertEqual((json["status"], json["covariance"]), ("inconsistent", None))
        json, _ = self.assert_equal_means(
            path, ("--criterion", "lsq", "--refuted", "residuals"), use=["covariances"], criterion="lsq",
            refuted="residuals",
        )
        self.assertEqual((json["status"], json["covariance_from"]), ("ok", "residuals"))
        with self.assertRaisesRegex(ValueError, "refuted"):
            liestat.mean(liestat.R3(rows[:, :3]), covariances=0.01 * np.eye(3), criterion="maha", refuted="residuals")

    def test_birges_factor(self):
        """Covariances that say half of the variance of few measurements: doubtful, not refuted."""
        rows = np.column_stack([[[0, 0, 0], [2.2, 0, 0], [0, 2.3, 0]], np.tile([0.5, 0, 0, 0.5, 0, 0.5], (3, 1))])
        path = self.table("x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22", rows)
        plain, _ = self.assert_equal_means(path, use=["covariances"])
        scaled, _ = self.assert_equal_means(path, ("--birge",), use=["covariances"], birge=True)
        self.assertEqual((plain["status"], plain["noise_scaled"], scaled["noise_scaled"]), ("ok", False, True))
        self.assertIn("Birge's factor", plain["notes"][-1])
        np.testing.assert_allclose(
            np.array(scaled["covariance"]), plain["fit_factor"] * np.array(plain["covariance"]), rtol=1e-12
        )

    def test_skewed_errors(self):
        """Exponential errors: a note, and on request a wider region."""
        rng = np.random.default_rng(5)
        path = self.table("rx,ry,rz", 0.05 * rng.exponential(size=(60, 3)))
        plain, _ = self.assert_equal_means(path)
        self.assertEqual((plain["region"], plain["skew_factor"]), ("law", 1))
        self.assertLess(plain["skewness_p"], 1e-3)
        self.assertIn("skewed", plain["notes"][-1])
        wide, _ = self.assert_equal_means(path, ("--region", "bootstrap"), region="bootstrap")
        self.assertEqual(wide["region"], "bootstrap")
        self.assertGreater(wide["skew_factor"], 1)
        np.testing.assert_allclose(
            np.array(wide["covariance"]), wide["skew_factor"] ** 2 * np.array(plain["covariance"]), rtol=1e-12
        )
        with self.assertRaisesRegex(ValueError, "region"):
            liestat.mean(liestat.R3(np.eye(3)), covariances=0.01 * np.eye(3), region="bootstrap")

    def test_ambiguous(self):
        path = self.written("rx,ry,rz\n0,0,1.5707963267948966\n0,0,-1.5707963267948966\n")
        json, result = self.assert_equal_means(path)
        self.assertEqual((json["unique"], json["status"]), ("ambiguous", "ambiguous"))
        self.assertFalse(result.unique)
        self.assertEqual(len(json["rivals"]), len(result.rivals))
        # Two clouds half a turn apart: the next sample may say the opposite.
        rng = np.random.default_rng(4)
        angles = np.concatenate([rng.normal(-np.pi / 2, 0.1, 12), rng.normal(np.pi / 2, 0.1, 11)])
        path = self.table("rx,ry,rz", np.column_stack([0.1 * rng.normal(size=(23, 2)), angles]))
        json, result = self.assert_equal_means(path)
        self.assertEqual(json["status"], "ambiguous")
        self.assertEqual([tie["z"] for tie in json["near_ties"]], list(result.near_tie_z))

    def test_ill_defined(self):
        rng = np.random.default_rng(5)
        directions = rng.normal(size=(8, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        json, result = self.assert_equal_means(self.table("dx,dy,dz", directions))
        self.assertIsNone(json["covariance"])
        self.assertIsNone(result.covariance)
        self.assertNotEqual(json["status"], "ok")
        self.assertEqual(result.reason, json["reason"])

    def test_few_and_equal(self):
        json, _ = self.assert_equal_means(self.written("x,y,z\n1,2,3\n"))
        self.assertEqual((json["status"], json["notes"]), ("not_applicable", ["one measurement is its own mean"]))
        self.assert_equal_means(self.written("x,y,z\n" + 5 * "1,2,3\n"))
        self.assert_equal_means(self.written("x,y,z\n1,2,3\n1,3,3\n1,5,3\n2,2,3\n7,1,3\n"))
        rng = np.random.default_rng(6)
        for kind, feature in (
            (liestat.SemiOrientedFrame3, "semi_oriented_frame"),
            (liestat.NonOrientedFrame3, "non_oriented_frame"),
        ):
            path = self.table("tx,ty,tz,rx,ry,rz", 0.1 * rng.normal(size=(12, 6)))
            self.assert_equal_means(path, ("--feature", feature), kind=kind)


class FormerNames(unittest.TestCase):
    """Python's names of before: they work, with a warning where a name is gone."""

    def test_unique_is_a_word_and_a_truth(self):
        x = liestat.SO3.exp([[0.31, 0.02, -0.11], [0.28, 0.05, -0.13], [0.33, 0.01, -0.08], [0.30, 0.04, -0.12]])
        result = liestat.mean(x)
        self.assertEqual(result.unique, "unique")
        self.assertEqual(result.unique, True)
        with self.assertWarnsRegex(DeprecationWarning, "unique"):
            self.assertEqual(result.uniqueness, "unique")
        with self.assertWarnsRegex(DeprecationWarning, "rivals_complete"):
            self.assertIs(result.more_rivals, False)
        for word in ("ambiguous", "not_certified"):
            self.assertFalse(liestat.Uniqueness(word))
            self.assertEqual(liestat.Uniqueness(word), False)
            self.assertNotEqual(liestat.Uniqueness(word), True)
        several = liestat.mean(liestat.SO3.stack([x, x]), axis=1)
        self.assertTrue((several.unique == "unique").all())
        self.assertEqual(np.count_nonzero(several.unique), 2)
        self.assertTrue(np.isnan(several.fit).all())
        self.assertEqual(several.notes.shape, (2,))

    def test_law(self):
        with self.assertWarnsRegex(DeprecationWarning, "degrees_of_freedom"):
            self.assertEqual(liestat.Law(3).dof, 3)
        with self.assertWarnsRegex(DeprecationWarning, "degrees_of_freedom"):
            self.assertEqual(liestat.Law(dof=3, samples=9), liestat.Law(3, 9))

    def test_copies(self):
        import copy
        import pickle

        result = liestat.mean(liestat.R3(np.eye(3)), covariances=np.eye(3))
        for other in (copy.deepcopy(result), pickle.loads(pickle.dumps(result))):
            self.assertEqual(plain(other.as_dict()), plain(result.as_dict()))
            self.assertTrue(other.unique)


if __name__ == "__main__":
    unittest.main()
