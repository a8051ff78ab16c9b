"""The readers of files."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
import support

import liestat
from liestat import SE3, SO3, Frame3

ROOT = Path(__file__).resolve().parents[2]


class Files(unittest.TestCase):
    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.path = Path(directory.name) / "file.csv"

    def write(self, header, rows):
        np.savetxt(self.path, rows, delimiter=",", header=header, comments="", fmt="%.17g")
        return self.path

    def test_rotations(self):
        x = support.features("SO3", 5)
        rows = np.column_stack([x.params, np.arange(1.0, 6)])
        file = liestat.read_features(self.write("qx,qy,qz,qw,weight", rows))
        np.testing.assert_allclose(file.features.params, x.params, atol=1e-15)
        np.testing.assert_array_equal(file.weights, rows[:, 4])
        self.assertEqual((type(file.features), file.times, file.covariances), (SO3, None, None))
        self.assertEqual(file.lines.tolist(), [2, 3, 4, 5, 6])
        names = dict(zip(("qx", "qy", "qz", "qw"), "abcd"))
        file = liestat.read_features(self.write("a,b,c,d", x.params), columns=names)
        self.assertEqual(len(file.features), 5)

    def test_files_of_the_repository(self):
        rest = liestat.read_features(ROOT / "examples/data/camera_at_rest.tum")
        self.assertIs(type(rest.features), Frame3)
        self.assertEqual((rest.format, len(rest.times)), ("tum", len(rest.features)))
        self.assertIs(type(liestat.read_features(ROOT / "examples/data/camera_at_rest.tum", SE3).features), SE3)
        result = liestat.mean(rest.features)
        # The README's figures of `liestat mean`.
        np.testing.assert_allclose(result.mean.translation, [0.999203933, 0.501621467, 2.0018481], atol=1e-8)

    def test_imu_and_tracks(self):
        rows = np.column_stack([np.arange(4) * 0.01, np.full((4, 3), 0.1), np.tile([0, 0, 9.8], (4, 1))])
        imu = liestat.read_imu(self.write("t,wx,wy,wz,ax,ay,az", rows))
        np.testing.assert_allclose(np.column_stack([imu.times, imu.rates, imu.forces]), rows)
        rows = [[0, 7, 1, 2, 0], [1, 7, 3, 4, 0.1], [1, 9, 5, 6, 0.1]]
        tracks = liestat.read_tracks(self.write("frame,track,u,v,t_s", rows))
        self.assertEqual((tracks.images.tolist(), tracks.tracks.tolist()), ([0, 1, 1], [0, 0, 1]))
        np.testing.assert_array_equal(tracks.pixels, [[1, 2], [3, 4], [5, 6]])
        np.testing.assert_array_equal(tracks.track_ids, [7, 9])

    def test_messages(self):
        path = self.write("qx,qy,qz,qw", [[0, 0, 0, 1], [0, 0, 0, 2]])
        with self.assertRaisesRegex(ValueError, r"file\.csv:3: "):
            liestat.read_features(path)
        with self.assertRaisesRegex(ValueError, "has SO3, not SE3"):
            liestat.read_features(self.write("qx,qy,qz,qw", [[0, 0, 0, 1]]), SE3)
        with self.assertRaises(ValueError):
            liestat.read_features(self.path.with_name("none.csv"))


if __name__ == "__main__":
    unittest.main()
