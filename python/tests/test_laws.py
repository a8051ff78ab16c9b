"""`fit_law` and `compare`, and what the program says of the same features."""

import os
import tempfile
import unittest
import warnings

import numpy as np

import liestat
import parity


def around(kind, centre, sd, n, seed):
    noise = np.random.default_rng(seed)
    return centre.retract(sd * noise.standard_normal((n, kind.dof)))


def save(directory, name, header, rows):
    path = os.path.join(directory, name)
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.17g")
    return path


class LawParity(parity.ParityTest):
    function = "fit_law"

    def test_laws(self):
        features = {
            "vmf": around(liestat.S2, liestat.S2([0.6, 0, 0.8]), 0.2, 40, 1),
            "bingham": around(liestat.S2, liestat.S2([0.6, 0, 0.8]), 0.2, 40, 2),
            "matrix-fisher": around(liestat.SO3, liestat.SO3.exp([1, 0.2, 0]), 0.2, 40, 3),
            "wrapped-normal": around(liestat.SO3, liestat.SO3.exp([1, 0.2, 0]), 0.2, 40, 4),
        }
        with tempfile.TemporaryDirectory() as directory:
            for law, x in features.items():
                header = "dx,dy,dz" if law in ("vmf", "bingham") else "qx,qy,qz,qw"
                path = save(directory, law + ".csv", header, x.params)
                json = parity.program("fit", path, "--law", law, codes=(0, 3))
                # As the file has them: its reader makes norms one.
                x = liestat.read_features(path).features
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self.assert_equal_results(json, liestat.fit_law(x, law), ())

    def test_refused_arguments(self):
        x = around(liestat.S2, liestat.S2([0, 0, 1]), 0.2, 20, 5)
        with self.assertRaisesRegex(ValueError, "law: expected one of vmf"):
            liestat.fit_law(x, "gauss")
        with self.assertRaisesRegex(TypeError, "a law of SO3"):
            liestat.fit_law(x, "matrix-fisher")
        with self.assertWarnsRegex(UserWarning, "needs 10"):
            self.assertEqual(liestat.fit_law(x[:5], "vmf").status, "too_few")


class ComparisonParity(parity.ParityTest):
    function = "compare"

    def test_groups(self):
        a = around(liestat.SO3, liestat.SO3.exp([1, 0.2, 0]), 0.1, 30, 1)
        b = around(liestat.SO3, liestat.SO3.exp([1, 0.4, 0]), 0.1, 30, 2)
        with tempfile.TemporaryDirectory() as directory:
            files = [save(directory, f"{i}.csv", "qx,qy,qz,qw", x.params) for i, x in enumerate((a, b))]
            a, b = (liestat.read_features(path).features for path in files)
            for option, paired in ((), False), (("--paired",), True):
                json = parity.program("compare", *files, *option)
                result = liestat.compare(a, b, paired=paired)
                del json["feature"], json["files"]
                for group in json["groups"]:
                    group["name"] = "1" if group["name"] == files[0] else "2"
                self.assert_equal_results(json, result, ())
                self.assertLess(result.means.p, 1e-3)
        both = liestat.SO3(np.concatenate([a.params, b.params]))
        by = liestat.compare(both, by=["x"] * 30 + ["y"] * 30)
        self.assertEqual(by.means.p, liestat.compare(a, b).means.p)
        self.assertEqual([group.name for group in by.groups], ["x", "y"])

    def test_refused_arguments(self):
        a = around(liestat.S2, liestat.S2([0, 0, 1]), 0.1, 20, 1)
        for groups, keywords, said in (
            ((a,), {}, "two or more arrays"),
            ((a, liestat.SO3.exp(np.zeros((20, 3)))), {}, "of one type"),
            ((a,), {"by": [1, 2]}, "a label for each"),
            ((a, a[:5]), {"paired": True}, "one length"),
            ((a, a), {"level": 2}, "level"),
        ):
            with self.assertRaisesRegex(ValueError, said):
                liestat.compare(*groups, **keywords)


if __name__ == "__main__":
    unittest.main()
