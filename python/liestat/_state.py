"""Means that merge: states of a few hundred bytes, for data that are somewhere else, or too many."""

import numpy as np

from . import _core
from ._manifolds import S2, SO2, SO3

_MANIFOLDS = {"heading": 1, "direction": 2, "rotation": 3}
_FEATURES = {number: name for name, number in _MANIFOLDS.items()}
_MOMENTS, _SUMS = 1, 2


class State:
    """What a mean needs to know of any number of headings, directions or rotations.

    States of parts are added to each other (``+``, ``sum``) in any order, to the same bytes, and travel as
    ``bytes(state)`` or by pickle. A first pass makes moments, whose result is the chordal mean with a covariance; with
    the state of a pass as `after` the next one makes sums, whose result is the Fréchet mean, certified.

    Parameters
    ----------
    feature : {'heading', 'direction', 'rotation'}
        Headings are given in degrees, directions as unit vectors or `S2`, rotations as quaternions x y z w or `SO3`.
    after : State, optional
        The state of the pass before, of all parts: its mean is the reference of the sums.
    largest_weight : float
        Weights are at most this, rounded up to a power of two; with `after` it is that of the pass before.

    Examples
    --------
    >>> import liestat
    >>> north = liestat.State("heading").add([350, 355]) + liestat.State("heading").add([5, 10, 30])
    >>> round(north.result()["degrees"], 3)
    5.913
    """

    def __init__(self, feature, after=None, *, largest_weight=1.0):
        if feature not in _MANIFOLDS:
            raise ValueError(f"State: feature: expected 'heading', 'direction' or 'rotation', got {feature!r}")
        if after is None:
            self._state = _core.state_empty(_MANIFOLDS[feature], _MOMENTS, None, float(largest_weight), 0)
            return
        if not isinstance(after, State) or after.feature != feature:
            raise ValueError(f"State: after: expected a State of {feature}s, got {after!r}")
        mean = after.result()["mean"]
        if not np.isfinite(mean).all():
            raise ValueError("State: the pass before has no mean to take sums at")
        exponent = int.from_bytes(after._state[12:14], "little", signed=True)
        self._state = _core.state_empty(_MANIFOLDS[feature], _SUMS, mean, 2.0**exponent, after.passes)

    @classmethod
    def from_bytes(cls, data):
        """The state that these bytes are. Raises ValueError where they are none, damaged, or of a newer version."""
        state = cls.__new__(cls)
        state._state = _core.state_read(bytes(data))
        return state

    def add(self, x, weights=None):
        """Adds features, with weights (inverse variances) or without, and returns the state.

        Rows that are not finite, or whose norm is off by more than 1e-3, are counted in `left_out`. Raises ValueError,
        and adds nothing, where a weight is not finite, negative or above the largest one.
        """
        typed = isinstance(x, (SO2, S2, SO3))
        if typed:
            if not isinstance(x, (SO2, S2, SO3)[_MANIFOLDS[self.feature] - 1]):
                raise ValueError(f"State.add: {type(x).__name__} for a state of {self.feature}s")
            x = x._data
        rows = np.asarray(x, dtype=np.float64)
        k = _MANIFOLDS[self.feature] + 1
        if self.feature == "heading" and not typed:
            shape = rows.shape
            rows = _core.state_headings(np.ascontiguousarray(rows).reshape(-1))
        elif rows.ndim == 0 or rows.shape[-1] != k:
            raise ValueError(f"State.add: expected shape (..., {k}), got {rows.shape}")
        else:
            shape = rows.shape[:-1]
            rows = rows.reshape(-1, k)
            if rows.strides[1] != 8 or rows.strides[0] % 8 or rows.strides[0] < 8 * k:
                rows = np.ascontiguousarray(rows)
        if weights is not None:
            weights = np.ascontiguousarray(np.broadcast_to(np.asarray(weights, np.float64), shape)).reshape(-1)
        _core.state_add(self._state, rows, weights)
        return self

    def result(self):
        """The mean of what was added: a dictionary.

        ``mean`` (heading: cos, sin), for headings ``degrees`` from 0 to 360, ``covariance`` (rad², None unless
        ``status`` is 'ok'), ``resultant`` (moments: the length of the mean vector) or ``step`` and ``another_pass``
        (sums: whether a state `after` this one is needed), ``n``, ``left_out``, ``status`` and ``reason``.
        """
        result = _core.state_finish(self._state)
        if result["status"] != "ok":
            result["covariance"] = None
        for name in ("resultant",) if self.kind == "sums" else ("step", "another_pass"):
            del result[name]
        if self.feature == "heading":
            # The remainder of a tiny negative angle is 360.
            degrees = np.degrees(np.arctan2(result["mean"][1], result["mean"][0])) % 360.0
            result["degrees"] = float(degrees) if degrees != 360.0 else 0.0
        return result

    @property
    def feature(self):
        """'heading', 'direction' or 'rotation'."""
        return _FEATURES[self._state[8]]

    @property
    def kind(self):
        """'moments' or 'sums'."""
        return "moments" if self._state[9] == _MOMENTS else "sums"

    @property
    def passes(self):
        """Passes up to this state: 1 for moments."""
        return 1 + int.from_bytes(self._state[14:16], "little")

    @property
    def n(self):
        """Rows that count."""
        return int.from_bytes(self._state[16:24], "little")

    @property
    def left_out(self):
        """Bad rows."""
        return int.from_bytes(self._state[24:32], "little")

    def __add__(self, other):
        if not isinstance(other, State):
            return NotImplemented
        result = State.from_bytes(self._state)
        _core.state_merge(result._state, other._state)
        return result

    def __radd__(self, other):
        # sum() begins with 0.
        return State.from_bytes(self._state) if isinstance(other, int) and other == 0 else NotImplemented

    def __bytes__(self):
        return bytes(self._state)

    def __eq__(self, other):
        return self._state == other._state if isinstance(other, State) else NotImplemented

    __hash__ = None

    def __reduce__(self):
        return State.from_bytes, (bytes(self._state),)

    def __repr__(self):
        return f"<liestat.State: {self.kind} of {self.n} {self.feature}s, pass {self.passes}, {self.left_out} left out>"
