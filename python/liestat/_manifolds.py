"""The types: one element, or an N-d array of elements, over a NumPy array."""

import math
import numbers

import numpy as np

from . import _core
from ._operate import as_numbers, operate, require_finite

_EULER_AXES = {
    axes: float(i)
    for i, axes in enumerate(
        ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz")
    )
}


class Manifold:
    """Elements of a manifold: a NumPy array whose last axis holds the parameters of one element.

    The other axes are the elements' own: `shape` is `()` for a single element, `(n,)` for n of them. An array of
    float64 is used where it is, without a copy, and kept alive; other numbers are converted, which copies. Results of
    operations own their data. Operations on several operands follow NumPy's rules of broadcasting.

    Parameters
    ----------
    params : array_like, shape (..., parameters), or an object of the same class
        Parameters of the elements, in the order of the class's documentation. Unit quaternions and unit vectors must
        be of unit norm to 1e-6; the constructors named ``from_...`` normalise.

    Raises
    ------
    ValueError
        If the shape is wrong, a number is not finite, or a norm is not one.
    """

    __slots__ = ("_data", "__weakref__")
    # NumPy leaves `array * x` to this class.
    __array_ufunc__ = None

    #: Parameters of an element, the length of the array's last axis.
    parameters = 0
    #: Dimension of the tangent space.
    dof = 0
    #: Names of the tangent coordinates, in their order.
    tangent_names: tuple = ()
    _unit = slice(0, 0)  # the parameters of unit norm

    def __init_subclass__(cls, core=None, **keywords):
        super().__init_subclass__(**keywords)
        if core is not None:
            cls.parameters, cls.dof, cls._operations = _core.types[core]
            cls._core_name = core

    def __init__(self, params):
        if isinstance(params, Manifold):
            if not isinstance(params, type(self)):
                raise TypeError(f"{type(self).__name__}: cannot be made of {type(params).__name__}")
            self._data = params._data
            return
        if isinstance(params, (list, tuple)) and params and isinstance(params[0], Manifold):
            self._data = type(self).stack(params)._data
            return
        caller = f"{type(self).__name__}: params"
        data = require_finite(as_numbers(params, caller, (self.parameters,)), caller)
        if self._unit.stop > 0 and data.size > 0:
            part = data[..., self._unit]
            error = np.abs(np.sqrt(np.einsum("...i,...i->...", part, part)) - 1.0)
            if not (error <= 1e-6).all():
                where = np.unravel_index(int(np.argmax(error)), error.shape) if error.shape else ()
                raise ValueError(
                    f"{caller}, shape {data.shape}: expected unit norm in columns {self._unit.start} to "
                    f"{self._unit.stop - 1}, it is off by {error.max():.3g}"
                    + (f" at index {tuple(int(i) for i in where)}" if where else "")
                    + "; the constructors from_... normalise"
                )
        self._data = data

    @classmethod
    def _of(cls, data):
        """Wraps parameters that are known to be right."""
        self = object.__new__(cls)
        self._data = data
        return self

    @classmethod
    def identity(cls, shape=()):
        """The identity, or the origin of the manifold, for each element of an array of the given shape."""
        shape = (shape,) if isinstance(shape, numbers.Integral) else tuple(shape)
        data = np.zeros((*shape, cls.parameters))
        data[..., :] = cls._origin
        return cls._of(data)

    @classmethod
    def stack(cls, elements, axis=0):
        """Elements of equal shape along a new axis.

        Parameters
        ----------
        elements : iterable of the class
        axis : int
            Where the new axis is in the result's shape.
        """
        return cls._of(_joined(cls, np.stack, elements, axis, 1))

    @classmethod
    def concatenate(cls, elements, axis=0):
        """Elements along an axis that they have."""
        return cls._of(_joined(cls, np.concatenate, elements, axis, 0))

    # --- The array ----------------------------------------------------------------------------------------------------

    @property
    def params(self):
        """ndarray, shape (..., parameters): the parameters themselves; writing to them changes the elements."""
        return self._data

    @property
    def shape(self):
        """Shape of the array of elements, `()` for a single one."""
        return self._data.shape[:-1]

    @property
    def ndim(self):
        """Number of axes of the array of elements."""
        return self._data.ndim - 1

    @property
    def size(self):
        """Number of elements."""
        return math.prod(self._data.shape[:-1])

    @property
    def single(self):
        """Whether this is one element rather than an array."""
        return self._data.ndim == 1

    def __len__(self):
        if self._data.ndim == 1:
            raise TypeError(f"a single {type(self).__name__} has no len()")
        return self._data.shape[0]

    def _index(self, index):
        if not isinstance(index, tuple):
            index = (index,)
        if any(i is Ellipsis for i in index):
            return (*index, slice(None))
        return (*index, Ellipsis, slice(None))

    def __getitem__(self, index):
        if self._data.ndim == 1 and index != () and index is not Ellipsis and index is not None:
            raise TypeError(f"a single {type(self).__name__} is not subscriptable")
        return type(self)._of(self._data[self._index(index)])

    def __array__(self, dtype=None, copy=None):
        """The parameters, for ``np.asarray``: a view where nothing asks for another type or a copy."""
        data = self._data if dtype is None else self._data.astype(dtype, copy=False)
        if copy is False and data is not self._data:
            raise ValueError(f"{type(self).__name__}: another dtype needs a copy")
        return data.copy() if copy and data is self._data else data

    def __eq__(self, other):
        """Whether parameters are equal to the bit, element by element; q and -q are one rotation. `allclose` has a
        tolerance."""
        if not isinstance(other, Manifold):
            return NotImplemented
        if type(other) is not type(self):
            return False
        a, b = np.broadcast_arrays(self._data, other._data)
        equal = (a == b).all(axis=-1)
        unit = self._unit
        if unit.stop - unit.start == 4:
            equal |= (a[..., unit] == -b[..., unit]).all(axis=-1) & (
                np.delete(a, unit, axis=-1) == np.delete(b, unit, axis=-1)
            ).all(axis=-1)
        return equal if equal.shape else bool(equal)

    def __ne__(self, other):
        equal = self.__eq__(other)
        return equal if equal is NotImplemented else not equal if isinstance(equal, bool) else ~equal

    __hash__ = None

    def __setitem__(self, index, value):
        if not isinstance(value, type(self)):
            raise TypeError(f"expected {type(self).__name__}, got {type(value).__name__}")
        self._data[self._index(index)] = value._data

    def __iter__(self):
        if self._data.ndim == 1:
            raise TypeError(f"a single {type(self).__name__} is not iterable")
        return (type(self)._of(row) for row in self._data)

    def reshape(self, *shape):
        """The same elements in another shape; a view where NumPy gives one."""
        if len(shape) == 1 and not isinstance(shape[0], numbers.Integral):
            shape = tuple(shape[0])
        n = self.size
        if -1 in shape:
            rest = -math.prod(shape)
            if shape.count(-1) > 1 or rest == 0 or n % rest:
                raise ValueError(f"cannot reshape {n} elements into {shape}")
            shape = tuple(n // rest if s == -1 else s for s in shape)
        return type(self)._of(self._data.reshape(*shape, self.parameters))

    def copy(self):
        """The same elements in memory of their own."""
        return type(self)._of(self._data.copy())

    def __reduce__(self):
        return (_unpickled, (type(self), np.ascontiguousarray(self._data)))

    def __copy__(self):
        return self.copy()

    def __deepcopy__(self, memo):
        return self.copy()

    def __repr__(self):
        name = type(self).__name__
        if self._data.ndim == 1:
            return f"{name}([{', '.join(f'{v:.6g}' for v in self._data)}])"
        shape = "×".join(map(str, self.shape))
        first = ""
        if self.size:
            row = self._data[(0,) * self.ndim]
            first = f": [{', '.join(f'{v:.6g}' for v in row)}]" + (" …" if self.size > 1 else "")
        return f"<{shape} {name}{first}>"

    def allclose(self, other, atol=1e-9):
        """Whether each element is within `atol` (norm of the tangent vector, rad and m) of the other.

        Returns
        -------
        bool
        """
        v = self.local(other)
        return bool((np.sqrt(np.einsum("...i,...i->...", v, v)) <= atol).all())

    # --- The manifold -------------------------------------------------------------------------------------------------

    def _operand(self, other, name):
        if not isinstance(other, type(self)):
            raise TypeError(f"{type(self).__name__}: {name} must be {type(self).__name__}, not {type(other).__name__}")
        return other._data

    def _call(self, name, operands, tail, threads=1):
        cls = type(self)
        return operate(
            cls._operations[name],
            f"{cls.__name__}.{name}",
            [("self", self._data, (cls.parameters,)), *operands],
            tail,
            threads,
        )

    def retract(self, v, threads=1):
        """The element that a tangent vector leads to, ``exp(self, v)``; for a group ``self * exp(v)``.

        Parameters
        ----------
        v : array_like, shape (..., dof)
            Tangent coordinates in the axes of `self` ("body frame"), m and rad.
        threads : int
            Threads for large arrays; 0 for as many as the machine has. The result does not depend on it.
        """
        k = (self.dof,)
        v = as_numbers(v, f"{type(self).__name__}.retract: v", k)
        return type(self)._of(self._call("retract", [("v", v, k)], (self.parameters,), threads))

    def local(self, other, threads=1):
        """The tangent vector at `self` that leads to `other`; for a group ``(self.inv() * other).log()``.

        Returns
        -------
        ndarray, shape (..., dof)
            Tangent coordinates in the axes of `self`, m and rad.
        """
        data = self._operand(other, "other")
        return self._call("local", [("other", data, (self.parameters,))], (self.dof,), threads)

    def local_jacobians(self, other, threads=1):
        """Derivatives of ``self.local(other)``.

        Returns
        -------
        by_self, by_other : ndarray, shape (..., dof, dof)
            With respect to tangent vectors at `self` and at `other`.
        """
        operands = [("other", self._operand(other, "other"), (self.parameters,))]
        tail = (self.dof, self.dof)
        return (
            self._call("local_by_self", operands, tail, threads),
            self._call("local_by_other", operands, tail, threads),
        )

    def interpolate(self, other, s, threads=1):
        """The element at fraction `s` of the way from `self` to `other`: `self` at 0, `other` at 1.

        Parameters
        ----------
        other : the same class
        s : array_like
            Fractions; broadcast against the elements.
        """
        s = as_numbers(s, f"{type(self).__name__}.interpolate: s", ())
        operands = [("other", self._operand(other, "other"), (self.parameters,)), ("s", s, ())]
        return type(self)._of(self._call("interpolate", operands, (self.parameters,), threads))

    def moved(self, by, threads=1):
        """The elements moved by transformations of the group that acts on them, from the left.

        Parameters
        ----------
        by : SO3 for SO3 and S2, SE3 for frames, the class itself for other groups
        """
        group = self._group()
        if not isinstance(by, group):
            raise TypeError(f"{type(self).__name__}.moved: by must be {group.__name__}, not {type(by).__name__}")
        operands = [("by", by._data, (group.parameters,))]
        return type(self)._of(self._call("moved", operands, (self.parameters,), threads))

    @classmethod
    def _group(cls):
        return cls


def _joined(cls, join, elements, axis, more):
    arrays = []
    for i, element in enumerate(elements):
        if not isinstance(element, cls):
            raise TypeError(f"{cls.__name__}: element {i} is {type(element).__name__}")
        arrays.append(element._data)
    if not arrays:
        raise ValueError(f"{cls.__name__}: no elements")
    if axis < 0:
        axis += arrays[0].ndim - 1 + more
    return join(arrays, axis=axis)


def _unpickled(cls, data):
    return cls._of(data)


class _Metric:
    """What manifolds with an invariant Riemannian metric have in addition."""

    __slots__ = ()

    def distance(self, other, threads=1):
        """Geodesic distances to `other`, rad or m; of frames the square root of the sum of both squares.

        Returns
        -------
        ndarray, shape (...), or float
        """
        result = self._call("distance", [("other", self._operand(other, "other"), (self.parameters,))], (), threads)
        return result[()]


class Group(Manifold):
    """Elements of a Lie group that acts on points. Perturbations are on the right: ``x * exp(v)``."""

    __slots__ = ()
    #: Dimension of the points on which the group acts.
    dimension = 3
    _matrix = 3

    @classmethod
    def _exp_call(cls, name, v, tail, threads):
        k = (cls.dof,)
        caller = f"{cls.__name__}.{name}"
        return operate(cls._operations[name], caller, [("v", as_numbers(v, f"{caller}: v", k), k)], tail, threads)

    @classmethod
    def exp(cls, v, threads=1):
        """The group's exponential.

        Parameters
        ----------
        v : array_like, shape (..., dof)
            Tangent vectors, translation before rotation, m and rad.
        threads : int
            Threads for large arrays; 0 for as many as the machine has. The result does not depend on it.
        """
        return cls._of(cls._exp_call("exp", v, (cls.parameters,), threads))

    def log(self, threads=1):
        """Tangent vectors v with ``exp(v) == self``, rotation angle in [0, pi].

        Returns
        -------
        ndarray, shape (..., dof)
        """
        return self._call("log", [], (self.dof,), threads)

    def inv(self, threads=1):
        """The inverses."""
        return type(self)._of(self._call("inverse", [], (self.parameters,), threads))

    def product(self, other, threads=1):
        """``self * other``: `other` first, then `self`."""
        operands = [("other", self._operand(other, "other"), (self.parameters,))]
        return type(self)._of(self._call("product", operands, (self.parameters,), threads))

    def __mul__(self, other):
        if not isinstance(other, type(self)):
            return NotImplemented
        return self.product(other)

    def __truediv__(self, other):
        if not isinstance(other, type(self)):
            return NotImplemented
        return self.product(other.inv())

    def act(self, points, threads=1):
        """The points moved by the elements.

        Parameters
        ----------
        points : array_like, shape (..., dimension)

        Returns
        -------
        ndarray, shape (..., dimension)
        """
        d = (self.dimension,)
        points = as_numbers(points, f"{type(self).__name__}.act: points", d)
        return self._call("act", [("points", points, d)], d, threads)

    def as_matrix(self, threads=1):
        """Rotation or homogeneous matrices.

        Returns
        -------
        ndarray, shape (..., m, m)
        """
        return self._call("matrix", [], (self._matrix, self._matrix), threads)

    def Adj(self, threads=1):
        """Adjoint matrices: ``x * exp(v) == exp(x.Adj() @ v) * x``.

        Returns
        -------
        ndarray, shape (..., dof, dof)
        """
        return self._call("Adj", [], (self.dof, self.dof), threads)

    @classmethod
    def ad(cls, v, threads=1):
        """Matrices of the Lie bracket with `v`, shape (..., dof, dof)."""
        return cls._exp_call("ad", v, (cls.dof, cls.dof), threads)

    @classmethod
    def left_jacobian(cls, v, threads=1):
        """J with ``exp(v + d) = exp(J d + O(d²)) * exp(v)``, shape (..., dof, dof)."""
        return cls._exp_call("left_jacobian", v, (cls.dof, cls.dof), threads)

    @classmethod
    def right_jacobian(cls, v, threads=1):
        """J with ``exp(v + d) = exp(v) * exp(J d + O(d²))``, shape (..., dof, dof)."""
        return cls._exp_call("right_jacobian", v, (cls.dof, cls.dof), threads)

    @classmethod
    def left_jacobian_inverse(cls, v, threads=1):
        """Inverse of `left_jacobian`, regular at angle pi, singular at 2 pi."""
        return cls._exp_call("left_jacobian_inverse", v, (cls.dof, cls.dof), threads)

    @classmethod
    def right_jacobian_inverse(cls, v, threads=1):
        """Inverse of `right_jacobian`: ``log(exp(v) * exp(d)) = v + J d + O(d²)``."""
        return cls._exp_call("right_jacobian_inverse", v, (cls.dof, cls.dof), threads)

    @classmethod
    def _normalized(cls, params, name):
        p = (cls.parameters,)
        result = operate(
            cls._operations["normalized"], f"{cls.__name__}.{name}", [("params", as_numbers(params, name, p), p)], p
        )
        return cls._of(require_finite(result, f"{cls.__name__}.{name}: normalised parameters"))


def _quaternions(quaternion, name, scalar_first=False):
    q = require_finite(as_numbers(quaternion, name, (4,)), name)
    if scalar_first:
        q = np.roll(q, -1, axis=-1)
    norm = np.sqrt(np.einsum("...i,...i->...", q, q))
    if not (norm > 0).all():
        raise ValueError(f"{name}, shape {q.shape}: a quaternion is zero")
    return q / norm[..., None]


class SO3(_Metric, Group, core="SO3"):
    """Rotations of space, as unit quaternions x y z w, SciPy's order.

    Tangent vectors are rotation vectors (rad) in body axes.

    Examples
    --------
    >>> import numpy as np, liestat
    >>> x = liestat.SO3.exp([[0.31, 0.02, -0.11], [0.28, 0.05, -0.13]])
    >>> x.shape, len(x)
    ((2,), 2)
    >>> np.round((x[0].inv() * x[1]).log(), 4)
    array([-0.0312,  0.0247, -0.0245])
    """

    __slots__ = ()
    tangent_names = ("rx", "ry", "rz")
    _unit = slice(0, 4)
    _origin = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_quat(cls, quaternion, *, scalar_first=False):
        """From quaternions of any positive norm, which are normalised.

        Parameters
        ----------
        quaternion : array_like, shape (..., 4)
            x y z w, or w x y z with `scalar_first`.
        """
        return cls._of(_quaternions(quaternion, "SO3.from_quat: quaternion", scalar_first))

    def as_quat(self, *, canonical=False, scalar_first=False):
        """Unit quaternions x y z w, a copy.

        Parameters
        ----------
        canonical : bool
            Choose the sign with w > 0 (first nonzero of x y z positive where w is 0), as SciPy does.
        scalar_first : bool
            In the order w x y z.
        """
        q = self._data.copy()
        if canonical:
            key = np.where(q[..., 3] != 0, q[..., 3], 0)
            for i in range(3):
                key = np.where(key == 0, q[..., i], key)
            q *= np.where(key < 0, -1.0, 1.0)[..., None]
        return np.roll(q, 1, axis=-1) if scalar_first else q

    @classmethod
    def from_matrix(cls, matrix, *, fit=False):
        """From rotation matrices.

        Parameters
        ----------
        matrix : array_like, shape (..., 3, 3)
        fit : bool
            Take any matrix that has one nearest rotation in the Frobenius norm, and that one. Zeros, a matrix of rank one
            and a reflection have many. Otherwise a matrix that is not a rotation to 1e-6 is an error.
        """
        name = "SO3.from_matrix: matrix"
        m = require_finite(as_numbers(matrix, name, (3, 3)), name)
        if fit:
            _require_one_nearest(m, name)
        else:
            _require_rotations(m, name)
        operation = cls._operations["fit_matrix" if fit else "from_matrix"]
        return cls._of(operate(operation, "SO3.from_matrix", [("matrix", m, (3, 3))], (4,)))

    @classmethod
    def from_rotvec(cls, rotvec, *, degrees=False):
        """`exp`, under SciPy's name.

        Parameters
        ----------
        rotvec : array_like, shape (..., 3)
            Rotation vectors, rad.
        degrees : bool
            They are in degrees.
        """
        v = as_numbers(rotvec, "SO3.from_rotvec: rotvec", (3,))
        return cls.exp(np.deg2rad(v) if degrees else v)

    def as_rotvec(self, *, degrees=False):
        """`log`, under SciPy's name."""
        return np.rad2deg(self.log()) if degrees else self.log()

    @classmethod
    def _axes(cls, seq):
        """Intrinsic axes of a sequence in SciPy's notation, and whether the angles are in reverse."""
        intrinsic = seq.isupper() if isinstance(seq, str) else None
        axes = seq.lower() if isinstance(seq, str) else ""
        if intrinsic is None or len(axes) != 3 or not (seq.isupper() or seq.islower()):
            raise ValueError(f"seq: expected three axes such as 'ZYX' (intrinsic) or 'xyz' (extrinsic), got {seq!r}")
        reverse = not intrinsic
        if reverse:
            axes = axes[::-1]
        if axes not in _EULER_AXES:
            raise ValueError(f"seq: {seq!r} repeats an axis or names another one than x, y, z")
        return np.asarray(_EULER_AXES[axes]), reverse

    @classmethod
    def from_euler(cls, seq, angles, *, degrees=False):
        """From one to three Euler angles.

        Parameters
        ----------
        seq : str
            One to three axes: capitals are intrinsic, lower case extrinsic, as in SciPy.
        angles : array_like, shape (..., 3), (..., 2), or for one axis any shape
            rad, or degrees. For one axis a last dimension of one beside others is dropped, as by SciPy.
        """
        if isinstance(seq, str) and len(seq) in (1, 2) and (seq.isupper() or seq.islower()):
            return cls._from_few_angles(seq, angles, degrees)
        axes, reverse = cls._axes(seq)
        a = as_numbers(angles, "SO3.from_euler: angles", (3,))
        a = np.deg2rad(a) if degrees else a
        a = a[..., ::-1] if reverse else a
        operands = [("angles", a, (3,)), ("axes", axes, ())]
        return cls._of(operate(cls._operations["from_euler"], "SO3.from_euler", operands, (4,)))

    @classmethod
    def _from_few_angles(cls, seq, angles, degrees):
        axes = seq.lower()
        if not set(axes) <= set("xyz") or len(set(axes)) != len(axes):
            raise ValueError(f"seq: {seq!r} repeats an axis or names another one than x, y, z")
        a = as_numbers(angles, "SO3.from_euler: angles", () if len(axes) == 1 else (2,))
        a = np.deg2rad(a) if degrees else a
        if len(axes) == 1 and not (a.ndim > 1 and a.shape[-1] == 1):
            a = a[..., None]
        turns = [cls.exp(a[..., i, None] * np.eye(3)["xyz".index(axis)]) for i, axis in enumerate(axes)]
        if len(turns) == 1:
            return turns[0]
        return turns[0] * turns[1] if seq.isupper() else turns[1] * turns[0]

    def as_euler(self, seq, *, degrees=False):
        """Euler angles; the first and the last in [-pi, pi]. At gimbal lock both have the same absolute value.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        axes, reverse = self._axes(seq)
        a = self._call("to_euler", [("axes", axes, ())], (3,))
        a = a[..., ::-1] if reverse else a
        return np.rad2deg(a) if degrees else a

    def magnitude(self):
        """Angles of rotation in [0, pi], rad."""
        v = self.log()
        return np.sqrt(np.einsum("...i,...i->...", v, v))[()]

    @classmethod
    def from_scipy(cls, rotation):
        """From a ``scipy.spatial.transform.Rotation``."""
        return cls.from_quat(rotation.as_quat())

    def to_scipy(self):
        """A ``scipy.spatial.transform.Rotation`` (SciPy before 1.17 takes one axis at most)."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self._data)


def _require_rotations(m, name):
    defect = np.abs(np.swapaxes(m, -1, -2) @ m - np.eye(3)).max(axis=(-1, -2))
    bad = ~(defect <= 1e-6) | (np.linalg.det(m) <= 0)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0]) if bad.shape else ()
        raise ValueError(
            f"{name}, shape {m.shape}: not a rotation matrix"
            + (f" at index {where}" if where else "")
            + " (SO3.from_matrix(m, fit=True) gives the nearest one)"
        )


def _require_one_nearest(m, name):
    """Raises where the rotation nearest to a matrix is not unique: σ₂ + σ₃ sign(det) is zero."""
    s = np.linalg.svd(m, compute_uv=False)
    bad = ~(s[..., 1] + s[..., 2] * np.sign(np.linalg.det(m)) > 1e-12 * s[..., 0])
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0]) if bad.shape else ()
        raise ValueError(
            f"{name}, shape {m.shape}: many rotations are as near"
            + (f" at index {where}" if where else "")
            + ": zeros, a matrix of rank one or a reflection has no nearest one"
        )


class _Pose:
    """What poses of space share: quaternion x y z w, then translation."""

    __slots__ = ()
    _unit = slice(0, 4)
    _origin = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    tangent_names = ("tx", "ty", "tz", "rx", "ry", "rz")

    @classmethod
    def from_components(cls, translation, rotation):
        """From translations and rotations, in SciPy's order of arguments.

        Parameters
        ----------
        translation : array_like, shape (..., 3)
            m.
        rotation : SO3, or a ``scipy.spatial.transform.Rotation``
        """
        name = f"{cls.__name__}.from_components: translation"
        t = require_finite(as_numbers(translation, name, (3,)), name)
        q = rotation.params if isinstance(rotation, SO3) else SO3.from_scipy(rotation).params
        lead = np.broadcast_shapes(t.shape[:-1], q.shape[:-1])
        data = np.empty((*lead, 7))
        data[..., :4] = q
        data[..., 4:] = t
        return cls._of(data)

    @classmethod
    def from_matrix(cls, matrix):
        """From homogeneous matrices whose rotations are orthogonal to 1e-6.

        Parameters
        ----------
        matrix : array_like, shape (..., 4, 4)
        """
        name = f"{cls.__name__}.from_matrix: matrix"
        m = require_finite(as_numbers(matrix, name, (4, 4)), name)
        if not (m[..., 3, :] == (0.0, 0.0, 0.0, 1.0)).all():
            raise ValueError(f"{name}, shape {m.shape}: the last row is not 0 0 0 1")
        _require_rotations(m[..., :3, :3], name)
        return cls.from_components(m[..., :3, 3], SO3.from_matrix(m[..., :3, :3]))

    def as_matrix(self, threads=1):
        """Homogeneous matrices.

        Returns
        -------
        ndarray, shape (..., 4, 4)
        """
        m = np.zeros((*self.shape, 4, 4))
        m[..., :3, :3] = self.rotation.as_matrix(threads)
        m[..., :3, 3] = self._data[..., 4:]
        m[..., 3, 3] = 1.0
        return m

    @property
    def rotation(self):
        """SO3: a view of the rotations."""
        return SO3._of(self._data[..., :4])

    @property
    def translation(self):
        """ndarray, shape (..., 3): a view of the translations, m."""
        return self._data[..., 4:]

    @classmethod
    def from_scipy(cls, transform):
        """From a ``scipy.spatial.transform.RigidTransform`` (SciPy 1.16)."""
        return cls.from_components(transform.translation, SO3.from_scipy(transform.rotation))

    def to_scipy(self):
        """A ``scipy.spatial.transform.RigidTransform`` (SciPy 1.16)."""
        from scipy.spatial.transform import RigidTransform

        return RigidTransform.from_components(self.translation, self.rotation.to_scipy())


class SE3(_Pose, Group, core="SE3"):
    """Rigid motions of space as a group: quaternion x y z w, then translation.

    Tangent vectors are (translation m, rotation rad), and `exp` is the screw motion. For poses under the product
    metric, with geodesic distances and Fréchet means, see `Frame3`; `frame` converts without a copy.
    """

    __slots__ = ()
    _matrix = 4

    @property
    def frame(self):
        """Frame3: the same data under the product metric."""
        return Frame3._of(self._data)


class _Frame(_Metric, _Pose, Manifold):
    """What frames share."""

    __slots__ = ()

    @classmethod
    def _group(cls):
        return SE3

    @property
    def se3(self):
        """SE3: the same data as rigid motions."""
        return SE3._of(self._data)


class Frame3(_Frame, core="Frame3"):
    """Poses of space under the product metric d² = |translation|² + angle²: quaternion x y z w, then translation.

    Tangent vectors are (translation m, rotation rad) in the axes of the frame.
    """

    __slots__ = ()


class SemiOrientedFrame3(_Frame, core="SemiOrientedFrame3"):
    """Poses of space up to a half-turn about their z axis. Storage and tangent vectors as `Frame3`."""

    __slots__ = ()

    def canonical(self):
        """The representatives that do not depend on which one was given."""
        return type(self)._of(self._call("canonical", [], (7,)))


class NonOrientedFrame3(_Frame, core="NonOrientedFrame3"):
    """Poses of space up to half-turns about each of their axes. Storage and tangent vectors as `Frame3`."""

    __slots__ = ()

    def canonical(self):
        """The representatives that do not depend on which one was given."""
        return type(self)._of(self._call("canonical", [], (7,)))


class SO2(_Metric, Group, core="SO2"):
    """Headings, rotations of the plane: angles of which 359° and 1° are neighbours, as cos sin.

    Tangent vectors are angles (rad), shape (..., 1).

    Examples
    --------
    >>> import liestat
    >>> wind = liestat.SO2.from_angle([350, 355, 5, 10, 30], degrees=True)
    >>> round(float(liestat.mean(wind).mean.as_angle(degrees=True)), 3)
    6.0
    """

    __slots__ = ()
    dimension = 2
    tangent_names = ("r",)
    _matrix = 2
    _unit = slice(0, 2)
    _origin = (1.0, 0.0)

    @classmethod
    def from_angle(cls, angle, *, degrees=False):
        """From angles, shape (...), rad or degrees, of which multiples of 90° are exact."""
        a = require_finite(as_numbers(angle, "SO2.from_angle: angle", ()), "angle")
        if degrees:
            return cls._of(_core.state_headings(np.ascontiguousarray(a).reshape(-1)).reshape(*a.shape, 2))
        return cls._of(np.stack([np.cos(a), np.sin(a)], axis=-1))

    def as_angle(self, *, degrees=False):
        """Angles in [0, 2 pi), or in [0, 360)."""
        a = np.arctan2(self._data[..., 1], self._data[..., 0])
        turn = 360.0 if degrees else 2 * np.pi
        a = np.where(a < 0, a + 2 * np.pi, a) * (turn / (2 * np.pi))
        return np.where(a < turn, a, 0.0)[()]


class SE2(Group, core="SE2"):
    """Rigid motions of the plane as a group: cos sin tx ty. Tangent vectors are (translation m, angle rad)."""

    __slots__ = ()
    dimension = 2
    tangent_names = ("tx", "ty", "r")
    _unit = slice(0, 2)
    _origin = (1.0, 0.0, 0.0, 0.0)

    @classmethod
    def from_components(cls, translation, angle):
        """From translations (m), shape (..., 2), and angles (rad), shape (...)."""
        t = require_finite(as_numbers(translation, "SE2.from_components: translation", (2,)), "translation")
        a = require_finite(as_numbers(angle, "SE2.from_components: angle", ()), "angle")
        data = np.empty((*np.broadcast_shapes(t.shape[:-1], a.shape), 4))
        data[..., 0] = np.cos(a)
        data[..., 1] = np.sin(a)
        data[..., 2:] = t
        return cls._of(data)

    @classmethod
    def from_matrix(cls, matrix):
        """From homogeneous matrices, shape (..., 3, 3), whose rotations are orthogonal to 1e-6."""
        name = "SE2.from_matrix: matrix"
        m = require_finite(as_numbers(matrix, name, (3, 3)), name)
        defect = np.abs(np.swapaxes(m[..., :2, :2], -1, -2) @ m[..., :2, :2] - np.eye(2))
        if not (m[..., 2, :] == (0.0, 0.0, 1.0)).all() or (defect > 1e-6).any() or (np.linalg.det(m) <= 0).any():
            raise ValueError(f"{name}, shape {m.shape}: not a rigid motion of the plane")
        return cls._normalized(
            np.stack([m[..., 0, 0], m[..., 1, 0], m[..., 0, 2], m[..., 1, 2]], axis=-1), "from_matrix"
        )

    @property
    def translation(self):
        """ndarray, shape (..., 2): a view of the translations, m."""
        return self._data[..., 2:]

    @property
    def angle(self):
        """Angles in [-pi, pi], rad."""
        return np.arctan2(self._data[..., 1], self._data[..., 0])[()]


class SE23(Group, core="SE23"):
    """Rotation, position and velocity as a group: quaternion x y z w, position, velocity.

    Tangent vectors are (position m, rotation rad, velocity m/s).
    """

    __slots__ = ()
    tangent_names = ("px", "py", "pz", "rx", "ry", "rz", "vx", "vy", "vz")
    _unit = slice(0, 4)
    _origin = (0.0, 0.0, 0.0, 1.0) + (0.0,) * 6
    _matrix = 5

    @classmethod
    def from_components(cls, position, rotation, velocity):
        """From positions (m) and velocities (m/s), shape (..., 3), and rotations (SO3)."""
        p = require_finite(as_numbers(position, "SE23.from_components: position", (3,)), "position")
        v = require_finite(as_numbers(velocity, "SE23.from_components: velocity", (3,)), "velocity")
        q = rotation.params if isinstance(rotation, SO3) else SO3.from_scipy(rotation).params
        data = np.empty((*np.broadcast_shapes(p.shape[:-1], q.shape[:-1], v.shape[:-1]), 10))
        data[..., :4], data[..., 4:7], data[..., 7:] = q, p, v
        return cls._of(data)

    @property
    def rotation(self):
        """SO3: a view of the rotations."""
        return SO3._of(self._data[..., :4])

    @property
    def position(self):
        """ndarray, shape (..., 3): a view of the positions, m."""
        return self._data[..., 4:7]

    @property
    def velocity(self):
        """ndarray, shape (..., 3): a view of the velocities, m/s."""
        return self._data[..., 7:]


class S2(_Metric, Manifold, core="S2"):
    """Directions of space, as unit vectors. Tangent vectors have two coordinates (rad) along `tangent_basis`."""

    __slots__ = ()
    tangent_names = ("a", "b")
    _unit = slice(0, 3)
    _origin = (0.0, 0.0, 1.0)

    @classmethod
    def _group(cls):
        return SO3

    @classmethod
    def from_vector(cls, vector):
        """The directions of vectors of any positive length, shape (..., 3)."""
        v = as_numbers(vector, "S2.from_vector: vector", (3,))
        if not (np.abs(v).max(axis=-1, initial=0) > 0).all():
            raise ValueError(f"S2.from_vector: vector, shape {v.shape}: a vector is zero")
        return cls._of(operate(cls._operations["normalized"], "S2.from_vector", [("vector", v, (3,))], (3,)))

    def tangent_basis(self):
        """ndarray, shape (..., 3, 2): the axes of the tangent coordinates in the columns."""
        return self._call("tangent_basis", [], (3, 2))


class R3(_Metric, Manifold, core="R3"):
    """Points of space, m. Tangent vectors are differences."""

    __slots__ = ()
    tangent_names = ("x", "y", "z")
    _origin = (0.0, 0.0, 0.0)

    def moved(self, by, threads=1):
        """The points moved by translations, SO3 or SE3."""
        if isinstance(by, R3):
            return R3._of(self._data + by._data)
        return R3._of(by.act(self._data, threads=threads))
