// The errors of a preintegrated increment by blocks: their covariance, and their derivatives by the biases.
#pragma once

#include <lie/detail/small_columns.hpp>

#include <Eigen/Core>

namespace liestat::detail {

/// Blocks of position, rotation and velocity by the biases of gyroscope and accelerometer, in the axes of the start:
/// derivatives, or covariances with them, all transposed: a row belongs to a coordinate of the bias. The rotation does not
/// feel the accelerometer.
template <class S>
struct BiasBlocks {
  using Columns = detail::Columns<S>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  Columns gp = Columns::zero(), ap = Columns::zero(), gr = Columns::zero();
  Columns gv = Columns::zero(), av = Columns::zero();

  void operator+=(const BiasBlocks& other) {
    gp += other.gp, ap += other.ap, gr += other.gr, gv += other.gv, av += other.av;
  }
  BiasBlocks scaled(const S& gyroscope, const S& accelerometer) const {
    return {gp * gyroscope, ap * accelerometer, gr * gyroscope, gv * gyroscope, av * accelerometer};
  }
  /// p ← p - [u] r + h v, then v ← v - [w] r, in which a transposed block meets [u] on its right.
  void carry(const S& h, const Vector3& u, const Vector3& w) {
    gp.addScaled(gv, h);
    gp.addTimesSkew(gr, u);
    ap.addScaled(av, h);
    gv.addTimesSkew(gr, w);
  }
};

/// Blocks of position, rotation and velocity, in the axes of the start. pp is not symmetric: half of it and its
/// transpose is the covariance, for no other block is made of it.
template <class S>
struct IncrementCovariance {
  using Columns = detail::Columns<S>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
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

  /// Carries it over a step of h seconds with gains u of position and w of velocity, without noise.
  void carry(const S& h, const Vector3& u, const Vector3& w) {
    // With p' = p - [u] r + h v: pp' = pp + Yᵀ + Y', Y = pr [u] + h pv of before and Y' of after; pp is kept up to a skew
    // part, so Yᵀ may be Y. All skew matrices stand on the right: -[u] rr = (rr [u])ᵀ, for rr is symmetric, and
    // -[u] vrᵀ = (vr [u])ᵀ.
    pp.addTimesSkew(pr, u);
    pp.addScaled(pv, h);
    pr.addScaled(vr, h);
    pr += rr.timesSkew(u).transposed();
    pv.addScaled(vv, h);
    pv += vr.timesSkew(u).transposed();
    pp.addTimesSkew(pr, u);
    pp.addScaled(pv, h);
    // v' = v - [w] r.
    pv.addTimesSkew(pr, w);
    vv += vr.timesSkew(w).transposed();
    vr += rr.timesSkew(w).transposed();
    vv.addTimesSkew(vr, w);
  }

  /// Adds what the drift of the biases does through a response J to them: with C their covariance with the errors,
  /// `walk` before and `now` = C + q t J after, P += C Jᵀ + J Cᵀ + q t J Jᵀ.
  void drift(const BiasBlocks<S>& walk, const BiasBlocks<S>& now, const BiasBlocks<S>& J) {
    const Columns pg = now.gp.transposed(), pa = now.ap.transposed(), rg = now.gr.transposed(),
                  vg = now.gv.transposed(), va = now.av.transposed();
    const Columns J_pg = J.gp.transposed(), J_pa = J.ap.transposed(), J_rg = J.gr.transposed(),
                  J_vg = J.gv.transposed(), J_va = J.av.transposed();
    pp += pg * J.gp + J_pg * walk.gp + pa * J.ap + J_pa * walk.ap;
    pr += pg * J.gr + J_pg * walk.gr;
    pv += pg * J.gv + J_pg * walk.gv + pa * J.av + J_pa * walk.av;
    rr += rg * J.gr + J_rg * walk.gr;
    vr += vg * J.gr + J_vg * walk.gr;
    vv += vg * J.gv + J_vg * walk.gv + va * J.av + J_va * walk.av;
  }
};

}  // namespace liestat::detail
