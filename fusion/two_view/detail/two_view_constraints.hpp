// Constraints on the nine entries of H or F, or on the pose, in each model of fusion/two_view/models.hpp.
#pragma once

#include <fusion/two_view/models.hpp>
#include <fusion/two_view/upright.hpp>
#include <lie/detail/trig.hpp>
#include <lie/essential.hpp>
#include <stats/constrained_types.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace liestat::detail {

/// The entries of a 3×3 matrix, column after column.
using Entries = Eigen::Matrix<double, 9, 1>;

inline Entries entriesFrom(const Eigen::Matrix3d& M) { return Eigen::Map<const Entries>(M.data()); }
inline Eigen::Matrix3d matrixFrom(const Entries& entries) { return Eigen::Map<const Eigen::Matrix3d>(entries.data()); }
/// Where entry (row, column) is.
constexpr int entry(int row, int column) { return 3 * column + row; }

/// Up to P constraints on the entries; rows that are not used stay zero.
template <int P>
using EntryConstraints = ConstraintDerivatives<P, 9>;

/// Constraints that are written one after the other.
template <int P>
class ConstraintRows {
 public:
  explicit ConstraintRows(const Entries& q) : q_(q) { rows_.value.setZero(), rows_.by_parameter.setZero(); }
  /// a·q[i] + b·q[j] = c.
  void linear(int i, double a, int j, double b, double c) {
    rows_.value[next_] = a * q_[i] + b * q_[j] - c;
    rows_.by_parameter(next_, i) += a;
    rows_.by_parameter(next_, j) += b;
    ++next_;
  }
  void fixed(int i, double value) { linear(i, 1, i, 0, value); }
  void equal(int i, int j) { linear(i, 1, j, -1, 0); }
  void opposite(int i, int j) { linear(i, 1, j, 1, 0); }
  /// Any other, with its derivatives.
  void add(double value, const Eigen::Matrix<double, 1, 9>& by_entries) {
    rows_.value[next_] = value;
    rows_.by_parameter.row(next_++) = by_entries;
  }
  void norm(double squared) { add(q_.squaredNorm() - squared, 2 * q_.transpose()); }
  /// Rows i and j of the matrix have this dot product.
  void dot(int i, int j, double product) {
    Eigen::Matrix<double, 1, 9> J = Eigen::Matrix<double, 1, 9>::Zero();
    add(dotInto(i, j, 1, J) - product, J);
  }
  void equalLengths(int i, int j) {
    Eigen::Matrix<double, 1, 9> J = Eigen::Matrix<double, 1, 9>::Zero();
    const double difference = dotInto(i, i, 1, J) - dotInto(j, j, -1, J);
    add(difference, J);
  }
  const EntryConstraints<P>& rows() const { return rows_; }

 private:
  /// The product, its derivatives times a factor added to J.
  double dotInto(int i, int j, double factor, Eigen::Matrix<double, 1, 9>& J) const {
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      sum += q_[entry(i, k)] * q_[entry(j, k)];
      J[entry(i, k)] += factor * q_[entry(j, k)];
      J[entry(j, k)] += factor * q_[entry(i, k)];
    }
    return sum;
  }

  Entries q_;
  EntryConstraints<P> rows_;
  int next_ = 0;
};

/// Families of homographies, by the constraints on the entries of H.
enum class HomographyFamily {
  retinal_translation,
  zoom,
  retinal_displacement,
  rotation,
  homography,
  free_zoom,
  similarity,
  affine,
  rotation_zoom
};

struct HomographyConstraint {
  HomographyFamily family;
  static constexpr int P = 8;

  Eigen::Matrix<double, P, 1> operator()(const Entries& q) const { return linearize(q).value; }
  EntryConstraints<P> linearize(const Entries& q) const {
    ConstraintRows<P> rows(q);
    if (family == HomographyFamily::homography) {
      rows.norm(3);
    } else if (family == HomographyFamily::rotation) {
      // H Hᵀ = I, by its upper triangle.
      for (int i = 0; i < 3; ++i) {
        for (int j = i; j < 3; ++j) rows.dot(i, j, i == j ? 1 : 0);
      }
    } else if (family == HomographyFamily::rotation_zoom) {
      // H Hᵀ = diag(r², r², 1).
      rows.dot(0, 1, 0), rows.dot(0, 2, 0), rows.dot(1, 2, 0), rows.dot(2, 2, 1), rows.equalLengths(0, 1);
    } else {
      rows.fixed(entry(2, 0), 0), rows.fixed(entry(2, 1), 0), rows.fixed(entry(2, 2), 1);
      linearPart(rows, q);
    }
    return rows.rows();
  }

 private:
  /// The constraints on the upper rows of an image motion, whose last row is (0, 0, 1).
  void linearPart(ConstraintRows<P>& rows, const Entries& q) const {
    switch (family) {
      case HomographyFamily::retinal_displacement: {
        const double c = q[entry(0, 0)], s = q[entry(1, 0)];
        rows.equal(entry(0, 0), entry(1, 1)), rows.opposite(entry(0, 1), entry(1, 0));
        Eigen::Matrix<double, 1, 9> J = Eigen::Matrix<double, 1, 9>::Zero();
        J[entry(0, 0)] = 2 * c, J[entry(1, 0)] = 2 * s;
        rows.add(c * c + s * s - 1, J);
        break;
      }
      case HomographyFamily::similarity:
        rows.equal(entry(0, 0), entry(1, 1)), rows.opposite(entry(0, 1), entry(1, 0));
        break;
      case HomographyFamily::zoom:
        rows.fixed(entry(0, 2), 0), rows.fixed(entry(1, 2), 0);
        [[fallthrough]];
      case HomographyFamily::free_zoom:
        rows.fixed(entry(0, 1), 0), rows.fixed(entry(1, 0), 0), rows.equal(entry(0, 0), entry(1, 1));
        break;
      case HomographyFamily::retinal_translation:
        rows.fixed(entry(0, 1), 0), rows.fixed(entry(1, 0), 0);
        rows.fixed(entry(0, 0), 1), rows.fixed(entry(1, 1), 1);
        break;
      default:  // affine
        break;
    }
  }
};

/// Families of epipolar geometries, by the constraints on F: F = [t]× of a translation, zero upper left part of two
/// affine cameras, or det F = 0; ‖F‖² = 2.
enum class EpipolarFamily { translation, affine, fundamental };

struct EpipolarConstraint {
  EpipolarFamily family = EpipolarFamily::fundamental;
  static constexpr int P = 7;

  Eigen::Matrix<double, P, 1> operator()(const Entries& q) const { return linearize(q).value; }
  EntryConstraints<P> linearize(const Entries& q) const {
    ConstraintRows<P> rows(q);
    if (family == EpipolarFamily::translation) {
      for (int i = 0; i < 3; ++i) {
        rows.fixed(entry(i, i), 0);
        rows.opposite(entry(i, (i + 1) % 3), entry((i + 1) % 3, i));
      }
    } else if (family == EpipolarFamily::affine) {
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) rows.fixed(entry(i, j), 0);
      }
    } else {
      const Eigen::Matrix3d F = matrixFrom(q);
      Eigen::Matrix<double, 1, 9> J;
      for (int k = 0; k < 3; ++k) {
        J.segment<3>(3 * k) = F.col((k + 1) % 3).cross(F.col((k + 2) % 3)).transpose();
      }
      rows.add(J.head<3>().dot(F.col(0)), J);
    }
    rows.norm(2);
    return rows.rows();
  }
};

/// R first ~ second, verticals of length one: R first has no part across the second one.
class UprightConstraint {
 public:
  explicit UprightConstraint(const TwoViewVerticals& verticals) : first_(verticals.first.normalized()) {
    // The axes across are the other two rows of a rotation that takes the vertical to y.
    const Eigen::Matrix3d rotation = toVertical(verticals.second.normalized());
    across_.row(0) = rotation.row(0), across_.row(1) = rotation.row(2);
  }
  Eigen::Vector2d operator()(const Essentiald& q) const { return across_ * (q.so3().matrix() * first_); }
  ConstraintDerivatives<2, 5> linearize(const Essentiald& q) const {
    const Eigen::Matrix3d frame = ManifoldTraits<S2<double>>::placement(q.direction()).matrix();
    const Eigen::Vector3d turned = q.so3().matrix() * first_;
    ConstraintDerivatives<2, 5> result;
    result.value = across_ * turned;
    result.by_parameter.leftCols<2>().setZero();
    // R first moves by A v_r × R first.
    result.by_parameter.rightCols<3>() = -across_ * skew(turned) * frame;
    return result;
  }

 private:
  Eigen::Vector3d first_;
  Eigen::Matrix<double, 2, 3> across_;
};

}  // namespace liestat::detail
