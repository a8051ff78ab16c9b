"""The readers of files."""

import os
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
        tracks = liestat.read_tracks(self.write("frame,track,u,v,t_s,sigma", [[*row, 0.1] for row in rows]))
        np.testing.assert_array_equal(tracks.sigmas, [0.1, 0.1, 0.1])

    def test_track(self):
        texture = np.random.default_rng(1).integers(0, 255, (30, 40)).repeat(8, 0).repeat(8, 1).astype(np.uint8)
        with tempfile.TemporaryDirectory() as directory:
            names = [os.path.join(directory, f"{i}.pgm") for i in range(3)]
            for i, name in enumerate(names):
                with open(name, "wb") as file:
                    file.write(b"P5\n300 220\n255\n" + texture[10 : 230, 10 + i : 310 + i].tobytes())
            try:
                tracks = liestat.track(directory)
            except ValueError as error:
                # Built without OpenCV.
                self.assertIn("libopencv-video-dev", str(error))
                return
            self.assertEqual(tracks.frames.tolist(), [0, 1, 2])
            last = tracks.pixels[tracks.images == 2] - tracks.pixels[tracks.images == 0]
            np.testing.assert_allclose(last, np.tile([-2.0, 0.0], (len(last), 1)), atol=0.02)
            self.assertGreater(len(last), 50)
            self.assertTrue(np.all((tracks.sigmas > 0) & (tracks.sigmas < 0.1)))
            with self.assertRaisesRegex(ValueError, "there is one image"):
                liestat.track(names[:1])

    def test_bag(self):
        path = ROOT / "tests/data/bags/unindexed.mcap"
        try:
            bag = liestat.read_bag(path)
        except ValueError as error:
            self.skipTest(str(error))
        self.assertEqual([t.topic for t in bag.topics][:3], ["/imu", "/moved", "/odom"])
        self.assertEqual((bag.topics[2].type, bag.topics[2].messages, bag.notes), ("nav_msgs/Odometry", 5, []))
        imu = liestat.read_bag(path, "/imu")
        np.testing.assert_allclose(imu.times, 0.005 * np.arange(25), atol=1e-12)
        odometry = liestat.read_bag(path, "/odom", "ros-fixed")
        self.assertEqual((odometry.convention, odometry.frames), ("ros-fixed", ["odom", "base_link"]))
        self.assertEqual((odometry.covariances.shape, odometry.time_texts[4]), ((5, 6, 6), "1700000000.100000000"))
        chain = liestat.read_bag(path, frames="odom:base_link")
        np.testing.assert_allclose(chain.poses.params, odometry.poses.params, atol=1e-15)
        with self.assertRaisesRegex(ValueError, "there is no topic '/x', expected one of /imu"):
            liestat.read_bag(path, "/x")

    def test_calibration(self):
        self.path.write_text(
            "cam0:\n  camera_model: pinhole\n  intrinsics: [460, 458, 367, 248]\n  distortion_model: radtan\n"
            "  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]\n  resolution: [752, 480]\n  timeshift_cam_imu: 0.01\n"
            "  T_cam_imu:\n  - [0, -1, 0, 0.1]\n  - [1, 0, 0, 0.2]\n  - [0, 0, 1, 0.3]\n  - [0, 0, 0, 1]\n"
            "imu0:\n  gyroscope_noise_density: 1.0e-4\n  accelerometer_noise_density: 2.0e-3\n"
            "  gyroscope_random_walk: 3.0e-5\n  accelerometer_random_walk: 4.0e-3\n"
        )
        calibration = liestat.read_calibration(self.path)
        (cam0,) = calibration.cameras
        self.assertEqual((cam0.name, cam0.timeshift, cam0.camera.distortion), ("cam0", 0.01, "radtan"))
        self.assertEqual((cam0.camera.fu, cam0.camera.cv, cam0.camera.width), (460, 248, 752))
        # The inverse of T_cam_imu: Rᵀ and -Rᵀ t.
        np.testing.assert_allclose(cam0.imu_T_camera.translation, [-0.2, 0.1, -0.3], atol=1e-15)
        np.testing.assert_array_equal(calibration.imu_noise, [1e-4, 2e-3, 3e-5, 4e-3])
        np.testing.assert_array_equal(liestat.read_imu_noise(self.path), calibration.imu_noise)
        with self.assertRaisesRegex(ValueError, r"file\.csv"):
            liestat.read_calibration(self.write("x", [[1]]))

    def test_ground_truth(self):
        x = support.features("SE23", 3)
        q = x.params[:, :4]
        rows = np.column_stack([x.params[:, 4:7], q[:, 3], q[:, :3], x.params[:, 7:], np.arange(18.0).reshape(3, 6)])
        lines = [f"{10**18 + k * 10**8}," + ",".join(f"{v:.17g}" for v in row) for k, row in enumerate(rows)]
        self.path.write_text("#timestamp\n" + "\n".join(lines) + "\n")
        truth = liestat.read_ground_truth(self.path, start_ns=10**18)
        np.testing.assert_allclose(truth.times, [0, 0.1, 0.2], atol=1e-12)
        np.testing.assert_allclose(truth.states.params, x.params, atol=1e-12)
        np.testing.assert_array_equal(truth.biases, rows[:, 10:])

    def test_stereo_recording(self):
        rows = [[0, 7, 1, 2, 3, 4], [2, 9, 5, 6, 7, 8]]
        tracks = liestat.read_stereo_tracks(self.write("frame,track,uL,vL,uR,vR", rows))
        self.assertEqual((tracks.frames.tolist(), tracks.tracks.tolist()), ([0, 2], [7, 9]))
        np.testing.assert_array_equal(tracks.pixels, np.array(rows)[:, 2:])
        x = support.features("SO3", 2)
        header = "frame,t_s," + ",".join(f"R{i}{j}" for i in range(3) for j in range(3)) + ",cx,cy,cz"
        rows = np.column_stack([[3, 5], [0.5, 0.75], x.as_matrix().reshape(2, 9), [[1, 2, 3], [4, 5, 6]]])
        poses = liestat.read_camera_poses(self.write(header, rows))
        self.assertEqual((poses.frames.tolist(), poses.times.tolist()), ([3, 5], [0.5, 0.75]))
        # The file has world to camera, and the centre of the camera.
        np.testing.assert_allclose(poses.world_T_camera.translation, rows[:, 11:])
        turn = SO3(poses.world_T_camera.params[:, :4]) * x
        np.testing.assert_allclose(turn.log(), 0, atol=1e-12)
        self.path.write_text("name,value\nfu,700\nfv,701\ncu,320\ncv,240\nb,0.12\n")
        camera = liestat.read_stereo_camera(self.path)
        self.assertEqual((camera.fu, camera.cv, camera.baseline, camera.pixel_variance), (700, 240, 0.12, None))
        points = liestat.read_landmarks(self.write("x,y,z", [[1, 2, 3], [4, 5, 6]]))
        np.testing.assert_array_equal(points.params, [[1, 2, 3], [4, 5, 6]])
        matches = liestat.read_matches(self.write("x1,y1,x2,y2,note", [[1, 2, 3, 4, 0]]))
        np.testing.assert_array_equal(matches, [[1, 2, 3, 4]])

        tracks = [[4, 7, 1, 2, 0.1], [4, 8, 5, 6, 0.1], [9, 7, 3, 4, 0.1], [9, 9, 0, 0, 0.1]]
        matches = liestat.read_matches(self.write("frame,track,u,v,sigma", tracks))
        np.testing.assert_array_equal(matches, [[1, 2, 3, 4]])

    def test_recording(self):
        root = self.path.parent
        for place in ("cam0/data", "imu0", "left"):
            (root / "mav0" / place).mkdir(parents=True)
        (root / "mav0/cam0/data/1600000000000000000.png").write_bytes(b"")
        (root / "mav0/left/1.jpg").write_bytes(b"")
        (root / "mav0/imu0/data.csv").write_text("#timestamp [ns]\n1600000000000000000,0,0,0,0,0,9.8\n")
        found = liestat.find_recording(root)
        self.assertEqual((found.camera, found.images), ("cam0", str(root / "mav0/cam0/data")))
        self.assertEqual((found.imu, found.truth), (str(root / "mav0/imu0/data.csv"), None))
        self.assertEqual((found.image_times, found.calibration), (None, []))
        self.assertIn("left", found.notes[0])
        self.assertEqual(liestat.find_recording(root, "left").images, str(root / "mav0/left"))
        with self.assertRaisesRegex(ValueError, "no such folder"):
            liestat.find_recording(root / "none")

    def test_pairs_of_poses(self):
        a, b = support.features("SE3", 4), support.features("SE3", 4)
        header = "t,qx,qy,qz,qw,tx,ty,tz"
        first = self.write(header, np.column_stack([[0, 1, 2, 3], a.params])).rename(self.path.with_name("a.csv"))
        second = self.write(header, np.column_stack([[1.001, 2.002, 3, 9], b.params]))
        pairs = liestat.read_pose_pairs(first, second)
        self.assertEqual((pairs.rows.tolist(), pairs.unmatched_a, pairs.unmatched_b), ([[1, 0], [2, 1], [3, 2]], 1, 1))
        np.testing.assert_array_equal(pairs.times, [1, 2, 3])
        np.testing.assert_allclose(pairs.a.params, a.params[1:], atol=1e-15)
        np.testing.assert_allclose(pairs.b.params, b.params[:3], atol=1e-15)
        self.assertAlmostEqual(pairs.largest_gap, 0.002)
        pairs = liestat.read_pose_pairs(first, second, by_row=True)
        self.assertEqual((len(pairs.a), pairs.times), (4, None))

    def test_labelled_pairs_of_images(self):
        folder = self.path.with_name("evd")
        folder.mkdir()
        rows = [[1, 2, 3, 4, 1], [5, 6, 7, 8, 0]]
        path = self.write("x1,y1,x2,y2,inlier", rows).rename(folder / "a.csv")
        pair = liestat.read_two_view_pair(path, "evd")
        np.testing.assert_array_equal(pair.matches, np.array(rows)[:, :4])
        self.assertEqual((pair.family, pair.name, pair.labels.tolist(), len(pair.validation)), ("evd", "a", [1, 0], 0))
        self.assertEqual((pair.corner.tolist(), pair.size.tolist()), ([1, 2], [6, 6]))
        self.path.with_name("manifest.csv").write_text("family,pair,note\nevd,a,imsize=480x640\n")
        (only,) = liestat.read_two_view_pairs(self.path.parent)
        self.assertEqual((only.name, only.corner.tolist(), only.size.tolist()), ("a", [0, 0], [640, 480]))
        with self.assertRaisesRegex(ValueError, "no column 'structure'"):
            liestat.read_two_view_pair(path, "adelaide-rmf")
        with self.assertRaisesRegex(ValueError, "expected one of"):
            liestat.read_two_view_pair(path, "other")

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
