"""The types and their operations on arrays."""

import copy
import gc
import pickle
import sys
import threading
import unittest
import weakref

import numpy as np
import support
from scipy.spatial.transform import Rotation

import liestat
from liestat import SE3, SO3, Frame3


class AgainstSciPy(unittest.TestCase):
    """scipy.spatial.transform as a witness; both round, so a few ulp."""

    def setUp(self):
        self.v = support.generator().standard_normal((200, 3))
        self.x = SO3.exp(self.v)
        self.r = Rotation.from_rotvec(self.v)

    def test_exp_and_log(self):
        np.testing.assert_allclose(self.x.as_matrix(), self.r.as_matrix(), atol=4e-15)
        np.testing.assert_allclose(self.x.log(), self.r.as_rotvec(), atol=2e-14)
        np.testing.assert_allclose(self.x.magnitude(), self.r.magnitude(), atol=4e-15)

    def test_product_inverse_action(self):
        y = SO3.exp(self.v[::-1])
        s = Rotation.from_rotvec(self.v[::-1])
        np.testing.assert_allclose((self.x * y).as_matrix(), (self.r * s).as_matrix(), atol=4e-15)
        np.testing.assert_allclose((self.x / y).as_matrix(), (self.r * s.inv()).as_matrix(), atol=4e-15)
        np.testing.assert_allclose(self.x.act(self.v), self.r.apply(self.v), atol=2e-14)

    def test_euler_angles_of_every_sequence(self):
        sequences = [a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if a != b and b != c]
        self.assertEqual(len(sequences), 12)
        for sequence in [*sequences, *(s.upper() for s in sequences)]:
            with self.subTest(sequence):
                ours = SO3.from_euler(sequence, self.v)
                np.testing.assert_allclose(
                    ours.as_matrix(), Rotation.from_euler(sequence, self.v).as_matrix(), atol=4e-15
                )
                # SciPy 1.10 loses half of the digits near gimbal lock.
                np.testing.assert_allclose(self.x.as_euler(sequence), self.r.as_euler(sequence), atol=1e-7)
                np.testing.assert_allclose(
                    SO3.from_euler(sequence, self.x.as_euler(sequence)).as_matrix(), self.x.as_matrix(), atol=4e-15
                )
        degrees = self.x.as_euler("ZYX", degrees=True)
        for sequence in ("z", "X", "xy", "ZX"):
            angles = self.v[:, 0] if len(sequence) == 1 else self.v[:, :2]
            np.testing.assert_allclose(
                SO3.from_euler(sequence, angles).as_matrix(), Rotation.from_euler(sequence, angles).as_matrix(), atol=4e-15
            )
        self.assertEqual(SO3.from_euler("z", 0.3).shape, ())
        self.assertEqual(SO3.from_euler("z", [[0.3], [0.2]]).shape, (2,))
        back = SO3.from_euler("ZYX", degrees, degrees=True)
        np.testing.assert_allclose(back.as_matrix(), self.x.as_matrix(), atol=1e-14)

    def test_conversion(self):
        self.assertTrue(SO3.from_scipy(self.r).allclose(self.x, 1e-14))
        np.testing.assert_allclose(self.x.to_scipy().as_matrix(), self.x.as_matrix(), atol=4e-15)
        canonical = self.x.as_quat(canonical=True)
        self.assertTrue((canonical[:, 3] >= 0).all())
        scalar_first = SO3.from_quat(canonical[:, [3, 0, 1, 2]], scalar_first=True)
        np.testing.assert_allclose(scalar_first.params, canonical, atol=1e-15)

    def test_matrices(self):
        m = self.r.as_matrix()
        self.assertTrue(SO3.from_matrix(m).allclose(self.x, 1e-14))
        scaled = 3 * m + 1e-3
        self.assertTrue(SO3.from_matrix(scaled, fit=True).allclose(self.x, 2e-3))
        for matrix in (np.zeros((3, 3)), np.outer([1, 2, 3], [3, 1, 2]), np.diag([1.0, 1, -1]), -np.eye(3)):
            with self.assertRaisesRegex(ValueError, "many rotations are as near"):
                SO3.from_matrix(matrix, fit=True)
        flat = SO3.from_matrix(self.x.as_matrix() * [1, 1, 0], fit=True)
        self.assertTrue(flat.allclose(self.x, 1e-9))
        message = r"SO3.from_matrix: matrix, shape \(200, 3, 3\): not a rotation.*\(0,\)"
        with self.assertRaisesRegex(ValueError, message):
            SO3.from_matrix(scaled)


class AgainstCpp(unittest.TestCase):
    """The bits are those of the C++ library with the same flags and instruction set."""

    def check(self, operation, values, ours, tail):
        theirs = support.reference(operation, values, tail)
        if theirs is None:
            self.skipTest("LIESTAT_REFERENCE names no program")
        np.testing.assert_array_equal(theirs, ours)

    def test_operations(self):
        v = support.generator(1).standard_normal((500, 6))
        x = SE3.exp(v)
        self.check("so3_exp", v[:, :3], SO3.exp(v[:, :3]).params, (4,))
        self.check("se3_exp", v, x.params, (7,))
        self.check("se3_log", x.params, x.log(), (6,))
        self.check("se3_square", x.params, (x * x).params, (7,))
        self.check("se3_left_jacobian", v, SE3.left_jacobian(v), (6, 6))


class Algebra(unittest.TestCase):
    """Properties of every type."""

    def test_retract_and_local_are_inverse(self):
        for name, k in support.TYPES.items():
            with self.subTest(name):
                x = support.features(name, 40)
                v = 0.3 * support.generator(2).standard_normal((40, k))
                np.testing.assert_allclose(x.local(x.retract(v)), v, atol=2e-14)
                self.assertTrue(x.interpolate(x[::-1], 0).allclose(x, 1e-14))
                self.assertTrue(x.interpolate(x[::-1], 1).allclose(x[::-1], 1e-13))

    def test_group_axioms(self):
        for name, k in support.GROUPS.items():
            with self.subTest(name):
                x = support.features(name, 40)
                y = support.features(name, 40, seed=1)
                kind = type(x)
                self.assertTrue((x * x.inv()).allclose(kind.identity(40), 1e-14))
                self.assertTrue(kind.exp(x.log()).allclose(x, 1e-13))
                np.testing.assert_allclose((x * y).as_matrix(), x.as_matrix() @ y.as_matrix(), atol=1e-13)
                v = support.generator(3).standard_normal((40, k))
                adjoint = np.einsum("nij,nj->ni", x.Adj(), v)
                self.assertTrue((x * kind.exp(v)).allclose(kind.exp(adjoint) * x, 1e-12))
                identity = kind.left_jacobian(v) @ kind.left_jacobian_inverse(v)
                np.testing.assert_allclose(identity, np.broadcast_to(np.eye(k), identity.shape), atol=1e-12)
                np.testing.assert_allclose(kind.right_jacobian(v), kind.left_jacobian(-v), atol=0)

    def test_jacobians_of_local_by_differences(self):
        for name, k in support.TYPES.items():
            with self.subTest(name):
                x, y = support.features(name, 5), support.features(name, 5, seed=1)
                by_self, by_other = x.local_jacobians(y)
                h = 1e-6
                for i in range(k):
                    e = h * np.eye(k)[i]
                    slope = (x.local(y.retract(e)) - x.local(y.retract(-e))) / (2 * h)
                    np.testing.assert_allclose(by_other[..., i], slope, atol=1e-8)
                    if name != "S2":  # there the axes are carried in parallel, and those of retract are not
                        slope = (x.retract(e).local(y) - x.retract(-e).local(y)) / (2 * h)
                        np.testing.assert_allclose(by_self[..., i], slope, atol=1e-8)

    def test_distance_is_invariant(self):
        for name in support.METRIC:
            with self.subTest(name):
                x, y = support.features(name, 30), support.features(name, 30, seed=1)
                by = support.features({"R3": "R3", "S2": "SO3", "SO2": "SO2", "SO3": "SO3"}.get(name, "SE3"), 30, seed=2)
                np.testing.assert_allclose(x.moved(by).distance(y.moved(by)), x.distance(y), atol=1e-13)

    def test_quotients_forget_half_turns(self):
        x = support.features("SemiOrientedFrame3", 20)
        turn = SE3.exp([0, 0, 0, 0, 0, np.pi])
        other = liestat.SemiOrientedFrame3((x.se3 * turn).params)
        np.testing.assert_allclose(x.distance(other), 0, atol=1e-14)
        np.testing.assert_allclose(np.abs(np.sum(x.canonical().params[:, :4] * other.canonical().params[:, :4], 1)), 1)


class Arrays(unittest.TestCase):
    def test_no_copy_and_lifetime(self):
        q = SO3.exp(support.generator().standard_normal((50, 3))).as_quat()
        x = SO3(q)
        self.assertIs(x.params, q)
        self.assertTrue(np.shares_memory(x[3:7].params, q))
        self.assertTrue(np.shares_memory(SE3.identity(4).rotation.params, SE3.identity(4).params) is False)
        pose = SE3.identity(4)
        self.assertTrue(np.shares_memory(pose.rotation.params, pose.params))
        self.assertTrue(np.shares_memory(pose.frame.params, pose.params))
        # A view keeps its base alive, and nothing else does.
        expected = q[3].copy()
        gone = weakref.ref(x)
        view = x[3]
        del x, q
        gc.collect()
        self.assertIsNone(gone())
        np.testing.assert_array_equal(view.params, expected)

    def test_results_own_their_data(self):
        x = support.features("SE3", 10)
        for result in (x.inv(), x * x, x.copy(), SE3.exp(x.log())):
            self.assertFalse(np.shares_memory(result.params, x.params))
        self.assertFalse(np.shares_memory(support.features("SO3", 3).as_quat(), x.params))

    def test_references_do_not_leak(self):
        v = support.generator().standard_normal((5, 3))
        x = SO3.exp(v)
        data = x.params

        def work():
            for _ in range(50):
                (x * x).log()
                x.act(v)
                with self.assertRaises(ValueError):
                    SO3.exp(np.full((2, 3), np.nan))

        work()
        before = sys.getrefcount(v), sys.getrefcount(data)
        work()
        self.assertEqual((sys.getrefcount(v), sys.getrefcount(data)), before)

    def test_shapes_and_broadcasting(self):
        v = support.generator().standard_normal((4, 1, 5, 3))
        x = SO3.exp(v)
        self.assertEqual((x.shape, x.ndim, x.size, len(x)), ((4, 1, 5), 3, 20, 4))
        y = SO3.exp(support.generator(1).standard_normal((6, 1, 3)))
        z = x * y
        self.assertEqual(z.shape, (4, 6, 5))
        for i, j, k in ((0, 0, 0), (3, 5, 4), (2, 1, 3)):
            np.testing.assert_array_equal(z[i, j, k].params, (x[i, 0, k] * y[j, 0]).params)
        self.assertEqual(x.act([1.0, 0, 0]).shape, (4, 1, 5, 3))
        self.assertEqual(x.interpolate(y, [0.0, 0.25, 0.5, 0.75, 1.0]).shape, (4, 6, 5))
        self.assertEqual((x[0].shape, x[..., 0].shape, x[:, None].shape), ((1, 5), (4, 1), (4, 1, 1, 5)))
        self.assertEqual(x[v[..., 0] > 0].shape, (int((v[..., 0] > 0).sum()),))
        self.assertEqual(x.reshape(-1).shape, (20,))
        self.assertEqual(x.reshape(2, -1).shape, (2, 10))
        self.assertEqual(len(list(x)), 4)
        self.assertEqual(SO3.stack([x, x], axis=1).shape, (4, 2, 1, 5))
        self.assertEqual(SO3.concatenate([x, x], axis=-1).shape, (4, 1, 10))
        with self.assertRaisesRegex(ValueError, r"SO3.product: shapes of self \(4, 1, 5\) and other \(3,\)"):
            x * SO3.identity(3)

    def test_equality(self):
        """Element by element, to the bit; a quaternion of either sign is one rotation, a vector is not its negative."""
        for name in support.TYPES:
            with self.subTest(name):
                x = support.features(name, 4)
                np.testing.assert_array_equal(x == x.copy(), [True] * 4)
                np.testing.assert_array_equal(x != x[0], [False, True, True, True])
                self.assertIs(x[0] == x[1], False)
                self.assertIs(x[1] == x[1].copy(), True)
                self.assertIs(x[1] != x[1].copy(), False)
                moved = x.copy()
                moved.params[2, -1] = np.nextafter(moved.params[2, -1], 9)
                np.testing.assert_array_equal(x == moved, [True, True, False, True])
                with self.assertRaises(TypeError):
                    hash(x)
        pose = support.features("SE3", 2)
        other = pose.params.copy()
        other[:, :4] *= -1
        np.testing.assert_array_equal(pose == SE3(other), [True, True])
        other[0, 4] *= -1
        np.testing.assert_array_equal(pose == SE3(other), [False, True])
        direction = support.features("S2", 1)
        self.assertFalse((direction == liestat.S2(-direction.params)).any())
        self.assertFalse(SO3.identity() == 3)
        self.assertIs(SO3.identity() == Frame3.identity(), False)

    def test_numpy_array(self):
        x = support.features("Frame3", 3)
        self.assertIs(np.asarray(x), x.params)
        self.assertEqual(np.asarray(x, dtype=np.float32).dtype, np.float32)
        self.assertFalse(np.shares_memory(np.array(x), x.params))
        np.testing.assert_array_equal(Frame3(list(x)).params, x.params)

    def test_single(self):
        x = SO3.exp([0.1, 0.2, 0.3])
        self.assertTrue(x.single)
        self.assertEqual((x.shape, x.size), ((), 1))
        for use in (len, list, lambda s: s[0]):
            with self.assertRaises(TypeError):
                use(x)
        self.assertEqual(x.log().shape, (3,))
        self.assertIsInstance(x.magnitude(), float)

    def test_empty(self):
        for name, k in support.TYPES.items():
            with self.subTest(name):
                x = getattr(liestat, name).identity((0,))
                self.assertEqual((len(x), x.local(x).shape, x[:0].shape), (0, (0, k), (0,)))
                self.assertEqual(x.retract(np.empty((0, k))).shape, (0,))
                self.assertIn("0", repr(x))
        self.assertEqual((SO3.identity((3, 0)) * SO3.identity(())).shape, (3, 0))

    def test_layouts(self):
        """The same bits from float32, Fortran order, strides, read-only and byte-swapped memory."""
        v = support.generator().standard_normal((60, 3)).astype(np.float32)
        expected = SO3.exp(v.astype(np.float64)).params
        wide = np.zeros((120, 7))
        wide[::2, 2:5] = v
        backwards = np.ascontiguousarray(wide[::-1])[::-1]
        read_only = v.astype(np.float64)
        read_only.flags.writeable = False
        memory = np.frombuffer(b"x" + v.astype(np.float64).tobytes(), dtype=np.uint8)
        unaligned = memory[1:].view(np.float64).reshape(60, 3)
        self.assertFalse(unaligned.flags.aligned)
        layouts = {
            "float32": v,
            "list": v.tolist(),
            "fortran": np.asfortranarray(v.astype(np.float64)),
            "strided": wide[::2, 2:5],
            "backwards": backwards[::2, 2:5],
            "read-only": read_only,
            "swapped": v.astype(">f8"),
            "unaligned": unaligned,
        }
        for name, layout in layouts.items():
            with self.subTest(name):
                np.testing.assert_array_equal(SO3.exp(layout).params, expected)
        half = SO3(expected[::-2])
        np.testing.assert_array_equal(half.log(), SO3(expected).log()[::-2])
        self.assertEqual(SO3(expected.astype(np.float32)).params.dtype, np.float64)

    def test_pickling_and_copies(self):
        for name in support.TYPES:
            x = support.features(name, (2, 3))[:, ::2]
            y = pickle.loads(pickle.dumps(x))
            self.assertIs(type(y), type(x))
            np.testing.assert_array_equal(y.params, x.params)
            z = copy.deepcopy(x)
            z[0] = z[1]
            self.assertFalse(np.array_equal(z.params, x.params))

    def test_repr_is_one_line(self):
        for name in support.TYPES:
            for x in (support.features(name, 3), support.features(name, 3)[0], support.features(name, (2, 2))):
                self.assertNotIn("\n", repr(x))
                self.assertIn(name, repr(x))

    def test_threads_give_the_same_bits(self):
        v = support.generator().standard_normal((20000, 6))
        np.testing.assert_array_equal(SE3.exp(v, threads=2).params, SE3.exp(v).params)

    def test_other_python_threads_run_meanwhile(self):
        v = support.generator().standard_normal((400000, 6))
        n = 0
        done = threading.Event()

        def count():
            nonlocal n
            while not done.wait(0.001):
                n += 1

        thread = threading.Thread(target=count)
        interval = sys.getswitchinterval()
        sys.setswitchinterval(60)  # the GIL is not taken away: who counts meanwhile was given it
        try:
            thread.start()
            before = n
            SE3.exp(v)
            after = n
        finally:
            done.set()
            sys.setswitchinterval(interval)
            thread.join()
        self.assertGreater(after - before, 3)


class Refusals(unittest.TestCase):
    """Messages name the argument and its shape."""

    def test_shapes(self):
        with self.assertRaisesRegex(ValueError, r"SO3.exp: v: expected shape \(\.\.\., 3\), got \(4, 2\)"):
            SO3.exp(np.zeros((4, 2)))
        with self.assertRaisesRegex(ValueError, r"SO3: params: expected shape \(\.\.\., 4\), got \(3,\)"):
            SO3([0, 0, 1])
        with self.assertRaisesRegex(ValueError, r"SE3.act: points: expected shape \(\.\.\., 3\), got \(2,\)"):
            SE3.identity().act([1, 2])

    def test_not_finite(self):
        v = np.zeros((5, 6, 3))
        v[2, 3, 1] = np.nan
        with self.assertRaisesRegex(ValueError, r"SO3.exp: v, shape \(5, 6, 3\), is not finite at index \(2, 3\)"):
            SO3.exp(v)
        v[2, 3, 1] = np.inf
        with self.assertRaisesRegex(ValueError, r"SO3.exp: v, shape \(5, 6, 3\), is not finite at index \(2, 3\)"):
            SO3.exp(v, threads=2)
        with self.assertRaisesRegex(ValueError, r"SE3: params, shape \(7,\): not finite at index \(6,\)"):
            SE3([0, 0, 0, 1, 0, 0, np.nan])
        with self.assertRaisesRegex(ValueError, r"SO3.act: points, shape \(1, 3\), is not finite at index \(0,\)"):
            SO3.identity((4, 3)).act([[np.nan, 0, 0]])

    def test_norms(self):
        with self.assertRaisesRegex(ValueError, r"SO3: params, shape \(2, 4\): expected unit norm.* at index \(1,\)"):
            SO3([[0, 0, 0, 1], [0, 0, 0, 1.01]])
        with self.assertRaisesRegex(ValueError, "a quaternion is zero"):
            SO3.from_quat([0, 0, 0, 0])
        with self.assertRaisesRegex(ValueError, "a vector is zero"):
            liestat.S2.from_vector([0, 0, 0])

    def test_types(self):
        with self.assertRaisesRegex(TypeError, "other must be SO3, not SE3"):
            SO3.identity().local(SE3.identity())
        with self.assertRaises(TypeError):
            SO3.identity() * SE3.identity()
        with self.assertRaises(TypeError):
            SO3.identity() * np.eye(3)
        with self.assertRaisesRegex(TypeError, "Frame3.moved: by must be SE3, not SO3"):
            Frame3.identity().moved(SO3.identity())
        with self.assertRaisesRegex(TypeError, "expected numbers"):
            SO3.exp("abc")
        with self.assertRaisesRegex(ValueError, "seq"):
            SO3.from_euler("Zyx", [0, 0, 0])


if __name__ == "__main__":
    unittest.main()
