// The errors of a preintegrated increment by blocks: their covariance, and their derivatives by the biases.
#pragma once

#include <lie/detail/small_columns.hpp>

#include <Eigen/Core>

namespace liestat::detail {

/// Blocks of position, rotation and velocity by the biases of gyroscope and accelerometer, in the axes of the start:
/// derivatives, or covariances with them. The rotation does not feel the accelerometer.
template <class S>
struct BiasBlocks {
  using Columns = detail::Columns<S>;

  Columns pg = Columns::zero(), pa = Columns::zero(), rg = Columns::zero();
  Columns vg = Columns::zero(), va = Columns::zero();

  void operator+=(const BiasBlocks& other) {
    pg += other.pg, pa += other.pa, rg += other.rg, vg += other.vg, va += other.va;
  }
  BiasBlocks scaled(const S& gyroscope, const S& accelerometer) const {
    return {pg * gyroscope, pa * accelerometer, rg * gyroscope, vg * gyroscope, va * accelerometer};
  }
  /// p ← p - U r + h v, then v ← v - W r.
  void carry(const S& h, const Columns& U, const Columns& W) {
    pg += vg * h;
    pg -= U * rg;
    pa += va * h;
    vg -= W * rg;
  }
};

/// Blocks of position, rotation and velocity, in the axes of the start. pp is not symmetric: half of it and its
/// transpose is the covariance, for no other block is made of it.
template <class S>
struct IncrementCovariance {
  using Columns = detail::Columns<S>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Matrix9 = Eigen::Matrix<S, 9, 9>;

  Columns pp = Columns::zero(), pr = Columns::zero(), pv = Columns::zero();
  Columns rr = Columns::zero(), vr = Columns::zero(), vv = Columns::zero();

  /// The 9×9 matrix, each block between T and Tᵀ; symmetric to the last bit.
  Matrix9 assembled(const Matrix3& T) const {
    const auto turned = [&T](const Columns& block) { return Matrix3(T * block.matrix() * T.transpose()); };
    Matrix9 m;
    m << turned(pp), turned(pr), turned(pv), Matrix3::Zero(), turned(rr), turned(vr).transpose(), Matrix3::Zero(),
        Matrix3::Zero(), turned(vv);
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < j; ++i) m(i, j) = S(0.5) * (m(i, j) + m(j, i));
    }
    for (int j = 0; j < 9; ++j) {
      for (int i = 0; i < j; ++i) m(j, i) = m(i, j);
    }
    return m;
  }

  /// Carries it over a step of h seconds with gains u of position (U = [u]) and w of velocity (W = [w]), without noise.
  void carry(const S& h, const Columns& U, const Columns& W) {
    // With p' = p - [u] r + h v: pp' = pp + Yᵀ + Y', Y = pr U + h pv of before and Y' of after; pp is kept up to a skew
    // part, so Yᵀ may be Y. A skew matrix is its own transpose's negative: X Uᵀ = -X U.
    pp.addProduct(pr, U);
    pp += pv * h;
    pr += vr * h;
    pr -= U * rr;
    pv += vv * h;
    pv -= U.timesTransposed(vr);
    pp.addProduct(pr, U);
    pp += pv * h;
    // v' = v - [w] r.
    pv.addProduct(pr, W);
    vv -= W.timesTransposed(vr);
    vr -= W * rr;
    vv.addProduct(vr, W);
  }

  /// Adds what the drift of the biases does through a response J to them: with C their covariance with the errors,
  /// `walk` before and `now` = C + q t J after, P += C Jᵀ + J Cᵀ + q t J Jᵀ.
  void drift(const BiasBlocks<S>& walk, const BiasBlocks<S>& now, const BiasBlocks<S>& J) {
    pp += now.pg.timesTransposed(J.pg) + J.pg.timesTransposed(walk.pg) + now.pa.timesTransposed(J.pa) +
          J.pa.timesTransposed(walk.pa);
    pr += now.pg.timesTransposed(J.rg) + J.pg.timesTransposed(walk.rg);
    pv += now.pg.timesTransposed(J.vg) + J.pg.timesTransposed(walk.vg) + now.pa.timesTransposed(J.va) +
          J.pa.timesTransposed(walk.va);
    rr += now.rg.timesTransposed(J.rg) + J.rg.timesTransposed(walk.rg);
    vr += now.vg.timesTransposed(J.rg) + J.vg.timesTransposed(walk.rg);
    vv += now.vg.timesTransposed(J.vg) + J.vg.timesTransposed(walk.vg) + now.va.timesTransposed(J.va) +
          J.va.timesTransposed(walk.va);
  }
};

}  // namespace liestat::detail
