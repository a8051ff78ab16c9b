// Definitions of fusion/convention_diagnosis.hpp: the matrices of a file by themselves, and trajectories whose matrices
// grow along a chain; docs/theory/trajectories.md, section 7.
#pragma once

#include <fusion/convention_diagnosis.hpp>
#include <fusion/trajectories/detail/ranked_conventions.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

LIESTAT_FUSION_INLINE MatrixStructure matrixStructure(std::span<const DiagnosedPose> poses) {
  using detail::Matrix6d;
  MatrixStructure s;
  s.n = poses.size();
  if (poses.empty()) return s;
  s.constant = s.diagonal = s.no_cross = s.isotropic_blocks = s.rank_one = true;
  s.zero_variance.fill(true);
  const Matrix6d* first = nullptr;
  for (const DiagnosedPose& p : poses) {
    if (!detail::blocksFinite(p.matrix)) {
      ++s.unknown;
      continue;
    }
    const bool no_cross_given = detail::crossUnknown(p.matrix);
    s.blocks_only = s.blocks_only || no_cross_given;
    Matrix6d M = no_cross_given ? detail::withoutCross(p.matrix) : p.matrix;
    const auto unit = [&](int i, int j) { return std::sqrt(std::abs(M(i, i) * M(j, j))); };
    bool symmetric = true;
    for (int i = 0; i < 6; ++i) {
      s.zero_variance[static_cast<std::size_t>(i)] = s.zero_variance[static_cast<std::size_t>(i)] && M(i, i) == 0;
      for (int j = 0; j < i; ++j) {
        symmetric = symmetric && !(std::abs(M(i, j) - M(j, i)) > 1e-6 * unit(i, j));
        const bool zero = std::abs(M(i, j)) <= 1e-9 * unit(i, j);
        s.diagonal = s.diagonal && zero;
        s.no_cross = s.no_cross && (i / 3 == j / 3 || zero);
        s.isotropic_blocks =
            s.isotropic_blocks && zero && (i / 3 != j / 3 || std::abs(M(i, i) - M(j, j)) <= 1e-3 * unit(i, j));
        s.rank_one =
            s.rank_one && std::abs(M(i, j) * M(j, i) - M(i, i) * M(j, j)) <= 1e-9 * std::abs(M(i, i) * M(j, j));
      }
    }
    s.asymmetric += !symmetric;
    // Unknown entries are alike, too.
    const auto alike = [&](const Matrix6d& N) {
      return ((p.matrix.array() == N.array()) || (p.matrix.array().isNaN() && N.array().isNaN())).all();
    };
    if (first == nullptr) first = &p.matrix;
    s.constant = s.constant && alike(*first);
    // A coordinate that is filled with zeros is said to be so; it makes nothing indefinite.
    for (int i = 0; i < 6; ++i) {
      if ((M.row(i).array() == 0).all() && (M.col(i).array() == 0).all()) M(i, i) = 1;
    }
    s.indefinite += !detail::Cholesky<double, 6>(M).ok();
  }
  const std::size_t known = s.n - s.unknown;
  s.constant = s.constant && known > 1;
  if (known == 0) s.diagonal = s.no_cross = s.isotropic_blocks = s.rank_one = false, s.zero_variance.fill(false);
  return s;
}

LIESTAT_FUSION_INLINE ChainDiagnosis diagnoseChain(std::span<const DiagnosedPose> poses,
                                                   std::span<const Convention> hypotheses) {
  using namespace detail;
  ChainDiagnosis d;
  const DiagnosisData data(poses, false);
  const std::vector<Convention> all =
      hypotheses.empty() ? conventionHypotheses() : std::vector<Convention>(hypotheses.begin(), hypotheses.end());
  if (data.size() < 10) {
    d.reason = "fewer than ten poses";
    return d;
  }
  if (data.blocks_only) {
    d.reason = "the cross block is unknown, and the chain condition needs it";
    return d;
  }
  d.steps = data.size() - 1;
  std::vector<Matrix6d> A(data.size());
  for (std::size_t i = 1; i < data.size(); ++i) {
    A[i] = (data.poses[i].estimate.inverse() * data.poses[i - 1].estimate).Adj();
  }
  for (const Convention& c : all) {
    std::size_t indefinite = 0;
    const Matrix6d first = covarianceUnder(data, 0, {.convention = c});
    Matrix6d before = first;
    for (std::size_t i = 1; i < data.size(); ++i) {
      const Matrix6d now = covarianceUnder(data, i, {.convention = c});
      const Matrix6d carried = congruence(A[i], before);
      // Six printed digits lose 2e-5 of the largest entry of each block, in units of that block.
      Vector6d tolerance;
      const double t = std::max(now.topLeftCorner<3, 3>().diagonal().maxCoeff(),
                                carried.topLeftCorner<3, 3>().diagonal().maxCoeff());
      const double r = std::max(now.bottomRightCorner<3, 3>().diagonal().maxCoeff(),
                                carried.bottomRightCorner<3, 3>().diagonal().maxCoeff());
      tolerance << Eigen::Vector3d::Constant(2e-5 * t), Eigen::Vector3d::Constant(2e-5 * r);
      indefinite += !now.allFinite() || !semidefinite(now - carried, tolerance);
      before = now;
    }
    // A covariance that only stays as it is is that of no dead reckoning: over the whole run one block has to grow.
    const Matrix6d start =
        congruence((data.poses.back().estimate.inverse() * data.poses.front().estimate).Adj(), first);
    constexpr double least_growth = 1e-3;
    const auto grows = [&](int k) {
      const double then = start.block<3, 3>(k, k).trace(), now = before.block<3, 3>(k, k).trace();
      return now - then > least_growth * now;
    };
    if (!grows(0) && !grows(3)) indefinite = d.steps;
    d.fits.push_back({c, static_cast<double>(indefinite) / static_cast<double>(d.steps)});
  }
  std::stable_sort(d.fits.begin(), d.fits.end(),
                   [](const ChainFit& a, const ChainFit& b) { return a.indefinite < b.indefinite; });
  const double best = d.fits.front().indefinite;
  d.is_chain = best < 0.5;
  if (!d.is_chain) {
    d.reason = "under no convention does the covariance grow as in dead reckoning (" + significant(100 * best, 2) +
               " % of the steps shrink it at best): smoothed, or corrected often";
    return d;
  }
  const double bound = 2 * best + 0.02 + 2 / static_cast<double>(d.steps);
  for (const ChainFit& f : d.fits) {
    if (f.indefinite <= bound) d.accepted.push_back(f.convention);
  }
  d.reason = d.accepted.size() == 1 ? "one convention makes it dead reckoning"
                                    : std::to_string(d.accepted.size()) + " conventions make it dead reckoning";
  return d;
}

namespace detail {

/// Increments of a run, η_i = ξ_i - A ξ_{i-1}, with covariances made of two neighbours' matrices.
template <class Make>
std::vector<PosedResidual> incrementsOf(const DiagnosisData& data, const Make& covariance) {
  std::vector<PosedResidual> list;
  for (std::size_t i = 1; i < data.size(); ++i) {
    const SE3d motion = data.poses[i - 1].estimate.inverse() * data.poses[i].estimate;
    const SE3d truth = data.poses[i - 1].truth.inverse() * data.poses[i].truth;
    list.push_back(
        {{(motion.inverse() * truth).log(), covariance(i, Matrix6d(motion.inverse().Adj()))}, data.poses[i].estimate});
  }
  return list;
}

/// Ranks the accepted conventions of a chain by the likelihood of its increments, which are independent.
inline Agreement rankIncrements(const DiagnosisData& data, ChainDiagnosis& chain, double alpha) {
  const std::size_t h = chain.accepted.size();
  std::vector<std::vector<PosedResidual>> of;
  for (const Convention& c : chain.accepted) {
    of.push_back(incrementsOf(data, [&](std::size_t i, const Matrix6d& A) {
      const HypothesisFit f{.convention = c};
      return Matrix6d(covarianceUnder(data, i, f) - congruence(A, covarianceUnder(data, i - 1, f)));
    }));
  }
  // Those that are positive definite in all of the conventions.
  std::vector<double> likelihood(h, 0);
  std::size_t used = 0;
  for (std::size_t i = 0; i < of[0].size(); ++i) {
    std::vector<double> terms;
    for (std::size_t k = 0; k < h; ++k) {
      const Cholesky<double, 6> root(of[k][i].residual.covariance);
      if (!root.ok()) break;
      terms.push_back(-0.5 * (root.halfSolve<1>(of[k][i].residual.error).squaredNorm() + root.logDeterminant()));
    }
    if (terms.size() < h) continue;
    for (std::size_t k = 0; k < h; ++k) likelihood[k] += terms[k], of[k][used] = of[k][i];
    ++used;
  }
  Agreement agreement;
  if (used < 10) return agreement;
  const auto best =
      static_cast<std::size_t>(std::max_element(likelihood.begin(), likelihood.end()) - likelihood.begin());
  of[best].resize(used);
  const double margin = std::log(static_cast<double>(conventionHypotheses().size()) / alpha);
  std::vector<Convention> kept{chain.accepted[best]};
  for (std::size_t k = 0; k < h; ++k) {
    if (k != best && likelihood[k] > likelihood[best] - margin) kept.push_back(chain.accepted[k]);
  }
  chain.accepted = kept;
  agreement = agreementOf(of[best], {}, false);
  chain.increments = agreement.tests.joint;
  return agreement;
}

}  // namespace detail

}  // namespace liestat
