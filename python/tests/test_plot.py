"""MeanResult.plot(), where matplotlib is installed."""

import sys
import unittest
from unittest import mock

import numpy as np

import liestat

try:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as pyplot
except ImportError:
    pyplot = None


def features(kind, n=25):
    rng = np.random.default_rng(5)
    return kind.identity((n,)).retract(0.2 * rng.normal(size=(n, kind.identity().dof)))


def line(ax, label):
    (found,) = [one for one in ax.lines if one.get_label() == label]
    return np.stack(found.get_data(), axis=-1)


@unittest.skipUnless(pyplot, "matplotlib is not installed (Debian: python3-matplotlib)")
class Plots(unittest.TestCase):
    def tearDown(self):
        pyplot.close("all")

    def test_every_kind_is_drawn(self):
        for kind in (liestat.SO3, liestat.R3, liestat.SE3, liestat.SE2, liestat.SE23, liestat.Frame3, liestat.SO2):
            x = features(kind)
            ax = liestat.mean(x).plot(x)
            self.assertEqual(ax.get_title(), "ok, n = 25")
            self.assertGreaterEqual(len(ax.lines), 2, kind)
            pyplot.close("all")

    def test_the_region_of_a_direction_is_its_edge(self):
        x = features(liestat.S2)
        result = liestat.mean(x)
        ax = result.plot(x, probability=0.9)
        # Back from the plane: a point at the distance r = 2 tan(angle/2).
        plane = np.radians(line(ax, "90 %"))
        r = np.linalg.norm(plane, axis=-1)
        angle = 2 * np.arctan(r / 2)
        tangent = plane * (angle / r)[:, None]
        edge = result.mean.retract(tangent)
        squared = liestat.mahalanobis(result.mean, result.covariance, edge) ** 2
        np.testing.assert_allclose(squared, result.law.quantile(0.9), rtol=1e-6)
        self.assertEqual(len(line(ax, "features")), 25)

    def test_the_arc_of_a_heading_is_its_interval(self):
        result = liestat.mean(features(liestat.SO2))
        arc = line(result.plot(), "95 %")
        half = np.sqrt(result.law.quantile(0.95) * result.covariance[0, 0])
        ends = np.arctan2(arc[[0, -1], 1], arc[[0, -1], 0]) - float(result.mean.as_angle())
        np.testing.assert_allclose((ends + np.pi) % (2 * np.pi) - np.pi, [-half, half], atol=1e-9)

    def test_without_a_covariance_there_is_no_region(self):
        with self.assertWarns(UserWarning):
            result = liestat.mean(features(liestat.S2, 1))
        self.assertNotIn("95 %", [one.get_label() for one in result.plot().lines])

    def test_wrong_axes_and_features_are_refused(self):
        result = liestat.mean(features(liestat.SO3))
        with self.assertRaisesRegex(ValueError, "plot: ax: SO3 needs axes with projection='3d'"):
            result.plot(ax=pyplot.subplots()[1])
        with self.assertRaisesRegex(TypeError, "plot: x: expected SO3, got S2"):
            result.plot(features(liestat.S2))
        several = liestat.mean(features(liestat.SO3).reshape(5, 5), axis=0)
        with self.assertRaisesRegex(TypeError, "index the result first"):
            several.plot()


class WithoutMatplotlib(unittest.TestCase):
    def test_the_package_is_named(self):
        result = liestat.mean(features(liestat.S2))
        with mock.patch.dict(sys.modules, {"matplotlib": None, "matplotlib.pyplot": None}):
            with self.assertRaisesRegex(ImportError, "python3-matplotlib"):
                result.plot()


if __name__ == "__main__":
    unittest.main()
