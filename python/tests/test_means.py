"""Means, their covariances and certificates."""

import os
import signal
import subprocess
import sys
import time
import unittest
import warnings

import numpy as np
import support
from scipy import stats
from scipy.spatial.transform import Rotation

import liestat
from liestat import SE3, SO3, Frame3


class Robust(unittest.TestCase):
    def test_bad_arguments_are_said(self):
        x = support.features("SE3", 30)
        for arguments, message in (
            (dict(robust="tukey"), "expected 'huber' or 'median'"),
            (dict(robust="huber", weights=np.ones(30)), "takes no weights"),
            (dict(robust="huber", criterion="lsq", times=np.arange(30)), "takes no times, criterion"),
            (dict(robust="median", region="bootstrap"), "takes no region"),
        ):
            with self.subTest(message), self.assertRaisesRegex(ValueError, message):
                liestat.mean(x, **arguments)
        with self.assertRaisesRegex(ValueError, "SE23 has no metric"):
            liestat.mean(support.features("SE23", 30), robust="huber")


class Means(unittest.TestCase):
    def test_gradient_vanishes(self):
        """Σ log(mean, x) = 0 characterises the Fréchet mean of these types, and the barycentre of a group."""
        for name in support.TYPES:
            with self.subTest(name):
                x = support.features(name, 40)
                result = liestat.mean(x)
                self.assertEqual(result.status, "ok")
                np.testing.assert_allclose(result.mean.local(x).sum(0), 0, atol=1e-11)
                # The dispersion is that of the tangent vectors.
                z = result.mean.local(x)
                np.testing.assert_allclose(result.dispersion, z.T @ z / 40, atol=1e-12)

    def test_bits_of_cpp(self):
        for operation, name, options in (
            ("so3_mean", "SO3", {}),
            ("frame3_mean", "Frame3", {}),
            ("frame3_maha", "Frame3", {"covariance_at": "estimated"}),
        ):
            x = support.features(name, 25)
            if operation.endswith("maha"):
                options["covariances"] = np.eye(6) * (0.01 * np.arange(1.0, 26.0))[:, None, None]
            theirs = support.reference(operation, x.params, ())
            if theirs is None:
                self.skipTest("LIESTAT_REFERENCE names no program")
            for threads in (1, 2, 0):
                result = liestat.mean(x, threads=threads, **options)
                np.testing.assert_array_equal(theirs.ravel(), [*result.mean.params, *result.covariance.ravel()])

    def test_euclidean(self):
        """Points: everything is known in closed form."""
        x = support.features("R3", 30)
        w = support.generator(1).uniform(0.5, 2, 30)
        result = liestat.mean(x, w)
        np.testing.assert_allclose(result.mean.params, np.average(x.params, axis=0, weights=w), atol=1e-14)
        plain = liestat.mean(x)
        np.testing.assert_allclose(plain.covariance, np.cov(x.params.T) / 30, rtol=1e-12)
        region = plain.confidence_region(0.9)
        f = stats.f.ppf(0.9, 3, 27) * 3 * 29 / 27
        self.assertAlmostEqual(region.threshold, f, places=10)
        np.testing.assert_allclose(region.semi_axes**2, np.sort(np.linalg.eigvalsh(plain.covariance))[::-1] * f)
        self.assertTrue(region.contains(plain.mean))
        edge = plain.mean.params + 1.001 * region.semi_axes[0] * region.directions[:, 0]
        self.assertFalse(region.contains(liestat.R3(edge)))
        self.assertAlmostEqual(plain.p_value(plain.mean), 1)

    def test_close_to_scipys_mean_of_tight_rotations(self):
        x = support.features("SO3", 100, sigma=1e-3)
        theirs = Rotation.from_quat(x.params).mean()
        self.assertLess(liestat.mean(x).mean.distance(SO3.from_scipy(theirs)), 1e-8)

    def test_axes_are_loops(self):
        x = support.features("SO3", (4, 5, 6))
        w = support.generator(1).uniform(0.5, 2, (5, 6))
        for axis in (0, 1, 2, -1, (0, 1), (2, 0), (0, 1, 2), None):
            with self.subTest(axis=axis):
                result = liestat.mean(x, w, axis=axis)
                axes = sorted(a % 3 for a in ((range(3)) if axis is None else np.atleast_1d(axis)))
                left = [i for i in range(3) if i not in axes]
                shape = tuple(x.shape[i] for i in left)
                self.assertEqual(result.mean.shape, shape)
                weights = np.broadcast_to(w, x.shape)
                for index in np.ndindex(shape):
                    where = [slice(None)] * 3
                    for i, at in zip(left, index):
                        where[i] = at
                    one = liestat.mean(x[tuple(where)].reshape(-1), weights[tuple(where)].ravel())
                    np.testing.assert_array_equal(result.mean[index].params if shape else result.mean.params,
                                                  one.mean.params)
                    np.testing.assert_array_equal(result.covariance[index], one.covariance)
                    self.assertEqual((result[index] if shape else result).status, "ok")
        with self.assertRaisesRegex(ValueError, "axis 3 is out of bounds"):
            liestat.mean(x, axis=3)

    def test_covariances(self):
        """Noise of known covariance: the squared distance of the truth follows χ²; trials 400, a false alarm 1e-6."""
        truth = Frame3.identity().retract([1, 2, 3, 0.3, 0.2, 0.1])
        rng = support.generator(5)
        root = np.diag([0.1, 0.2, 0.1, 0.1, 0.05, 0.1])
        covariance = root @ root
        x = truth.retract(rng.standard_normal((10, 400, 6)) @ root)
        result = liestat.mean(x, covariances=covariance, axis=0, covariance_at="estimated")
        self.assertTrue((result.status == "ok").all())
        mu2 = liestat.mahalanobis(result.mean, result.covariance, truth) ** 2
        self.assertEqual(result[0].law.name, "chi2")
        index = mu2.sum()
        self.assertLess(stats.chi2.ppf(5e-7, 2400), index)
        self.assertGreater(stats.chi2.isf(5e-7, 2400), index)
        known = liestat.mean(x[:, 0], covariances=covariance, criterion="lsq")
        np.testing.assert_allclose(known.covariance, covariance / 10, rtol=0.05, atol=1e-5)

    def test_withheld(self):
        half_turns = SO3.exp([[0, 0, 0], [0, 0, np.pi]])
        with self.assertWarnsRegex(UserWarning, "another feature explains the data as well"):
            result = liestat.mean(half_turns)
        self.assertIsNone(result.covariance)
        self.assertEqual((result.status, result.unique), ("ambiguous", False))
        self.assertEqual(len(result.rivals), 1)
        with self.assertRaisesRegex(ValueError, "no confidence region: another feature"):
            result.confidence_region()
        with self.assertWarns(UserWarning):
            few = liestat.mean(SO3.identity(2))
        self.assertEqual(few.status, "not_applicable")
        with self.assertWarnsRegex(UserWarning, "there are no features"):
            empty = liestat.mean(SO3.identity((0,)))
        self.assertEqual((empty.n, empty.status), (0, "too_few"))
        with self.assertWarnsRegex(UserWarning, "for 1 of 2 means"):
            two = liestat.mean(SO3.stack([half_turns, SO3.identity(2)]), axis=1, covariances=np.eye(3) * 1e-4)
        self.assertTrue(np.isnan(two.covariance[0]).all())
        self.assertFalse(np.isnan(two.covariance[1]).any())

    def test_result_shows_itself(self):
        result = liestat.mean(support.features("SE3", 30))
        self.assertNotIn("\n", repr(result))
        page = result._repr_html_()
        self.assertIn("<table>", page)
        self.assertIn("tx ", page)
        several = liestat.mean(support.features("SE3", (30, 2)), axis=0)
        self.assertEqual(len(several), 2)
        self.assertIn("2 ok", repr(several))
        self.assertIn("2 ok", several._repr_html_())

    def test_refusals(self):
        x = support.features("Frame3", 10)
        for message, error, call in (
            (r"mean: x is an ndarray of shape \(10, 7\)", TypeError, lambda: liestat.mean(x.params)),
            ("covariance_at", ValueError, lambda: liestat.mean(x, covariances=np.eye(6))),
            ("no invariant metric", ValueError, lambda: liestat.mean(x.se3, criterion="lsq")),
            (r"weights, shape \(3,\)", ValueError, lambda: liestat.mean(x, weights=[1, 2, 3])),
            ("one is negative", ValueError, lambda: liestat.mean(x, weights=-np.ones(10))),
            (r"weights, shape \(\): not finite", ValueError, lambda: liestat.mean(x, weights=np.nan)),
            (r"covariances: expected shape \(\.\.\., 6, 6\), got \(3, 3\)", ValueError,
             lambda: liestat.mean(x, covariances=np.eye(3), covariance_at="measured")),
            ("not symmetric", ValueError,
             lambda: liestat.mean(x, covariances=np.arange(36.0).reshape(6, 6), covariance_at="measured")),
            ("criterion", ValueError, lambda: liestat.mean(x, criterion="median")),
            ("not a group", ValueError, lambda: liestat.group_mean(x)),
        ):
            with self.subTest(message), self.assertRaisesRegex(error, message):
                call()

    def test_by_label(self):
        """Each label's mean is that of its features, with their weights, covariances and symmetry."""
        x = support.features("SO3", 24)
        labels = np.array(["b", "a", "c"] * 8)
        weights, noise = np.linspace(1, 3, 24), np.eye(3) * np.linspace(0.5, 1, 24)[:, None, None]
        for options in ({}, {"weights": weights}, {"covariances": noise}, {"symmetry": "2"}, {"covariances": noise[0]}):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                several = liestat.mean(x, by=labels, **options)
                self.assertEqual(list(several.labels), ["a", "b", "c"])
                for i, label in enumerate("abc"):
                    of = {k: v[labels == label] if np.shape(v)[:1] == (24,) else v for k, v in options.items()}
                    one = liestat.mean(x[labels == label], **of)
                    self.assertTrue(several.mean[i] == one.mean, (options, label))
                    self.assertEqual(several.status[i], one.status)
        np.testing.assert_array_equal(
            liestat.mean(x.reshape(2, 12), by=np.repeat([[5], [3]], 12, axis=1)).labels, [3, 5]
        )
        for wrong in ({"by": labels[:3]}, {"by": labels, "axis": 0}):
            with self.assertRaisesRegex(ValueError, "by"):
                liestat.mean(x, **wrong)

    def test_features_that_are_not_finite_are_left_out_if_asked(self):
        params = liestat.SO3.exp(0.1 * np.random.default_rng(3).normal(size=(4, 6, 3))).params.copy()
        params[0, 2] = params[3, 5, 1] = np.nan
        x, times = liestat.SO3._of(params), np.arange(24.0).reshape(4, 6)
        with self.assertRaisesRegex(ValueError, r"not finite at index \(0, 2, 0\)"):
            liestat.mean(x)
        with self.assertRaisesRegex(ValueError, "nan_policy: expected 'raise' or 'omit'"):
            liestat.mean(x, nan_policy="drop")
        kept = np.isfinite(params).all(axis=-1)
        good = liestat.SO3(params[kept])
        weights = np.linspace(1, 2, 24).reshape(4, 6)
        found = liestat.mean(x, weights=weights, times=times, nan_policy="omit")
        right = liestat.mean(good, weights=weights[kept], times=times[kept])
        self.assertEqual(found.n, 22)
        np.testing.assert_array_equal(found.covariance, right.covariance)
        self.assertEqual(liestat.mean(x, axis=1, nan_policy="omit").n.tolist(), [5, 6, 6, 5])
        labels = np.broadcast_to(np.arange(2).repeat(3), (4, 6))
        self.assertEqual(liestat.mean(x, by=labels, nan_policy="omit").n.tolist(), [11, 11])
        with self.assertWarns(UserWarning):
            nothing = liestat.mean(liestat.SO3._of(np.full((3, 4), np.nan)), nan_policy="omit")
        self.assertEqual(nothing.status, "too_few")
        self.assertTrue(np.isnan(nothing.mean.params).all())

    def test_features_whose_covariances_are_not_finite_are_left_out_if_asked(self):
        x = liestat.R3(0.1 * np.random.default_rng(4).normal(size=(30, 3)))
        c = np.broadcast_to(0.01 * np.eye(3), (30, 3, 3)).copy()
        c[4] = np.nan
        kept = np.arange(30) != 4
        right = liestat.mean(liestat.R3(x.params[kept]), covariances=c[kept])
        found = liestat.mean(x, covariances=c, nan_policy="omit")
        self.assertEqual(found.n, 29)
        np.testing.assert_array_equal(found.mean.params, right.mean.params)
        with self.assertRaisesRegex(ValueError, "not finite at index"):
            liestat.mean(x, covariances=c)
        deviations = np.full((30, 3), 0.1)
        deviations[7, 1] = np.inf
        self.assertEqual(liestat.mean(x, deviations=deviations, nan_policy="omit").n, 29)
        weights = np.where(np.arange(30) < 3, np.nan, 1.0)
        self.assertEqual(liestat.mean(x, weights=weights, nan_policy="omit").n, 27)

    def test_lists_and_keepdims(self):
        """Lists of elements, SciPy's rotations and lists of them are arrays; keepdims keeps the reduced axes."""
        x = support.features("SO3", 6)
        rotations = Rotation.from_quat(x.params)
        expected = liestat.mean(x)
        for same in (list(x), rotations, list(rotations), [x[:3], x[3:]]):
            result = liestat.mean(same)
            self.assertTrue(result.mean.allclose(expected.mean, 1e-12))
            np.testing.assert_allclose(result.covariance, expected.covariance, rtol=1e-9)
        with self.assertRaisesRegex(TypeError, "x is list"):
            liestat.mean([1.0, 2.0])
        with self.assertRaisesRegex(TypeError, "R3"):
            liestat.mean([x[0], liestat.R3(np.zeros(3))])
        table = SO3.stack([x, x, x])
        for axis, shape in ((1, (3, 1)), (0, (1, 6)), (None, (1, 1)), ((0, 1), (1, 1))):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                kept = liestat.mean(table, axis=axis, keepdims=True)
                plain = liestat.mean(table, axis=axis)
            self.assertEqual((kept.shape, kept.mean.shape), (shape, shape))
            np.testing.assert_array_equal(kept.mean.params.ravel(), plain.mean.params.ravel())

    def test_crystals(self):
        """Copies of noisy orientations: the mean of the copies nearest to it, whatever copies are given."""
        rng = np.random.default_rng(1)
        cubic = Rotation.create_group("O")
        grain = Rotation.from_rotvec([0.2, -0.4, 0.3])
        noisy = grain * Rotation.from_rotvec(0.02 * rng.normal(size=(30, 3)))
        copies = noisy * cubic[rng.integers(24, size=30)]
        result = liestat.mean(SO3(copies.as_quat()), symmetry="m-3m")
        self.assertEqual((result.status, result.symmetry), ("ok", "432"))
        expected = liestat.mean(SO3(noisy.as_quat()))
        turn = (Rotation.from_quat(expected.mean.params).inv() * Rotation.from_quat(result.mean.params)).reduce(cubic)
        self.assertLess(turn.magnitude(), 1e-7)
        np.testing.assert_allclose(
            np.linalg.eigvalsh(result.covariance), np.linalg.eigvalsh(expected.covariance), rtol=1e-6
        )
        with self.assertWarnsRegex(UserWarning, "no covariance"):
            trigonal = liestat.mean(SO3(copies.as_quat()), symmetry="32", hexagonal_axes="a*")
        self.assertEqual((trigonal.symmetry, trigonal.status), ("312", "ill_defined"))
        for wrong, error in (({"symmetry": "5"}, "no point group"), ({"symmetry": "432", "criterion": "maha"}, "maha")):
            with self.assertRaisesRegex(ValueError, error):
                liestat.mean(SO3(copies.as_quat()), **wrong)
        with self.assertRaisesRegex(TypeError, "rotations"):
            liestat.mean(liestat.R3(np.eye(3)), symmetry="432")

    def test_group_mean(self):
        x, g = support.features("SE3", 30), support.features("SE3", 1, seed=9)[0]
        a, b = liestat.group_mean(x), liestat.group_mean(g * x.inv() * g)
        self.assertTrue(b.mean.allclose(g * a.mean.inv() * g, 1e-10))
        rotations = support.features("SO3", 20)
        np.testing.assert_array_equal(liestat.group_mean(rotations).mean.params, liestat.mean(rotations).mean.params)

    def test_mahalanobis(self):
        x, y = support.features("SE3", 20), support.features("SE3", 20, seed=1)
        root = support.generator(2).standard_normal((20, 6, 8))
        covariance = root @ np.swapaxes(root, 1, 2)
        z = x.local(y)
        expected = np.sqrt(np.einsum("ni,nij,nj->n", z, np.linalg.inv(covariance), z))
        np.testing.assert_allclose(liestat.mahalanobis(x, covariance, y), expected, rtol=1e-9)
        by_self, by_other = x.local_jacobians(y)
        both = by_self @ covariance @ np.swapaxes(by_self, 1, 2) + by_other @ np.eye(6) @ np.swapaxes(by_other, 1, 2)
        expected = np.sqrt(np.einsum("ni,nij,nj->n", z, np.linalg.inv(both), z))
        np.testing.assert_allclose(liestat.mahalanobis(x, covariance, y, np.eye(6)), expected, rtol=1e-9)


class Interrupts(unittest.TestCase):
    def interrupted(self, code):
        """Seconds from Ctrl-C to KeyboardInterrupt in a process that runs `code`, after it has said that it begins."""
        program = (
            "import numpy as np, liestat, time, warnings\nwarnings.simplefilter('ignore')\n"
            "rng = np.random.default_rng(0)\n" + code[0] + "\nprint('begin', flush=True)\n"
            "try:\n    " + code[1] + "\nexcept KeyboardInterrupt:\n    print(time.time(), flush=True)\n"
        )
        process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
        try:
            self.assertEqual(process.stdout.readline().strip(), "begin")
            time.sleep(0.5)
            self.assertIsNone(process.poll())
            sent = time.time()
            process.send_signal(signal.SIGINT)
            output = process.communicate(timeout=60)[0]
        finally:
            process.kill()
        self.assertTrue(output, "the call ended before the signal")
        return float(output) - sent

    def test_branch_and_bound(self):
        scattered = ("x = liestat.SO3.exp(rng.normal(size=(1000, 3)) * 3)", "liestat.mean(x, budget=10**12, threads=1)")
        self.assertLess(self.interrupted(scattered), 1)

    def test_arrays(self):
        many = ("v = rng.normal(size=(10**6, 3))", "\n    ".join(["while True: liestat.SO3.left_jacobian_inverse(v)"]))
        self.assertLess(self.interrupted(many), 1)


if __name__ == "__main__":
    unittest.main()
