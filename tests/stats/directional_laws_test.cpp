// Laws of directions, axes, headings and rotations: concentrations against 35 digits, levels and power of their tests,
// regions, samples. Rates of many cells: liestat validate laws.
#include <lie/s2.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/directional_laws.hpp>
#include <stats/kolmogorov.hpp>
#include <stats/random.hpp>
#include <support/high_precision.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

using namespace liestat;

namespace {

using Big = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<35>, boost::multiprecision::et_off>;
using liestat_test::Matrix;

Eigen::VectorXd vectorOf(std::initializer_list<double> list) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(list.size()));
  std::copy(list.begin(), list.end(), v.data());
  return v;
}

/// A law with the κ about a location that is no axis of the coordinates.
DirectionalLaw lawOf(LawModel model, const Eigen::VectorXd& kappa) {
  const Eigen::Matrix3d turned = SO3d::exp({0.3, -0.7, 0.4}).matrix();
  DirectionalLaw law{model, {}, Eigen::MatrixXd::Identity(dofOf(model), dofOf(model)), kappa};
  if (model == LawModel::von_mises) law.location = vectorOf({0.6, -0.8});
  if (model == LawModel::vmf) law.location = turned.col(2);
  if (model == LawModel::bingham) law.location = turned.col(2), law.axes = turned;
  if (parametersOf(model) == 4) law.location = vectorOf({0.5, -0.1, 0.7, 0.5}).normalized(), law.axes = turned;
  return law;
}

Eigen::MatrixXd draw(const DirectionalLaw& law, int n, std::uint64_t seed, std::uint32_t stream = 0) {
  CounterRng rng(seed, 0, stream);
  Eigen::MatrixXd rows(n, parametersOf(law.model));
  for (int i = 0; i < n; ++i) rows.row(i) = law.sample(rng).transpose();
  return rows;
}

/// e^(-z) I_k(z), k = 0 or 1: the power series, or Hankel's expansion, whose error is below e^(-2z).
Big scaledBessel(int k, const Big& z) {
  if (z < 40) {
    Big term = k == 0 ? Big(1) : Big(z / 2), sum = term;
    for (int j = 1; term > sum * 1e-36; ++j) sum += term *= z * z / (4 * j * (j + k));
    return sum * exp(-z);
  }
  Big term = 1, sum = 1;
  for (int j = 1; abs(term) > 1e-36 && j < 80; ++j) {
    sum += term *= (Big(2 * j - 1) * (2 * j - 1) - 4 * k) / (8 * j * z);
  }
  return sum / sqrt(2 * boost::math::constants::pi<Big>() * z);
}

/// E x_i² of Bingham's law with μ, the last one zero, from integrals of products of scaled Bessel functions over
/// t = x_1² + x_2² (Lee 2018), by the trapezoidal rule in log(t/(1 - t)).
std::vector<Big> secondMoments(const std::vector<Big>& mu) {
  const Big half = 0.5;
  if (mu.size() == 2) {
    const Big z = mu[0] / 2, first = half * (1 - scaledBessel(1, z) / scaledBessel(0, z));
    return {first, 1 - first};
  }
  const bool rotations = mu.size() == 4;
  std::vector<Big> sums(4, Big(0));
  Big total = 0;
  const Big step = 0.17;
  const int from = -static_cast<int>((50 + std::log(1 + static_cast<double>(mu[0]))) / 0.17),
            to = rotations ? 300 : 620;
  for (int k = from; k <= to; ++k) {
    const Big e = exp(step * k), t = e / (1 + e), rest = 1 / (1 + e);
    const Big z = t * (mu[0] - mu[1]) / 2, y = rotations ? Big(rest * mu[2] / 2) : Big(0);
    const Big b0 = scaledBessel(0, z), b1 = scaledBessel(1, z);
    Big weight = exp(-t * mu[1]) * t * rest / (rotations ? Big(1) : sqrt(rest));
    Big d0 = 1, d1 = 0;
    if (rotations) d0 = scaledBessel(0, y), d1 = scaledBessel(1, y);
    total += weight * b0 * d0;
    sums[0] += half * weight * t * (b0 - b1) * d0, sums[1] += half * weight * t * (b0 + b1) * d0;
    sums[2] += half * weight * rest * b0 * (d0 - d1), sums[3] += half * weight * rest * b0 * (d0 + d1);
  }
  for (Big& s : sums) s /= total;
  if (!rotations) sums[2] += sums[3], sums.pop_back();
  return sums;
}

TEST(DirectionalLaws, momentsHaveThirteenDigits) {
  const auto expectMoments = [](const std::vector<double>& mu) {
    const BinghamMoments found =
        binghamMoments(Eigen::Map<const Eigen::VectorXd>(mu.data(), static_cast<Eigen::Index>(mu.size())));
    const std::vector<Big> expected = secondMoments({mu.begin(), mu.end()});
    for (std::size_t i = 0; i < mu.size(); ++i) {
      const double error = std::abs(static_cast<double>(found.second[static_cast<Eigen::Index>(i)] / expected[i] - 1));
      EXPECT_LT(error, 1e-13) << mu.size() << " coordinates, i " << i << ", mu_1 " << mu[0];
    }
  };
  for (const double scale : {0.0, 1e-2, 0.3, 7.0, 1e3, 1e12}) {
    expectMoments({scale, 0});
    expectMoments({scale, 0.4 * scale, 0});
    expectMoments({scale + 1, 1e-2, 0});
    expectMoments({scale, 0.7 * scale, 0.2 * scale, 0});
    expectMoments({scale + 1, 1, 1e-2, 0});
  }
}

/// Eigenvalues of a symmetric matrix, ascending, by Jacobi's rotations.
std::vector<liestat_test::Real> eigenvalues(Matrix a) {
  using liestat_test::Real;
  for (int sweep = 0; sweep < 40; ++sweep) {
    for (int p = 0; p < a.rows; ++p) {
      for (int q = p + 1; q < a.rows; ++q) {
        if (abs(a.at(p, q)) < 1e-45) continue;
        const Real zeta = (a.at(q, q) - a.at(p, p)) / (2 * a.at(p, q));
        const Real t = (zeta < 0 ? Real(-1) : Real(1)) / (abs(zeta) + sqrt(1 + zeta * zeta)), c = 1 / sqrt(1 + t * t);
        Matrix g = liestat_test::identity(a.rows), h = g;
        g.at(p, p) = g.at(q, q) = h.at(p, p) = h.at(q, q) = c;
        g.at(p, q) = h.at(q, p) = t * c, g.at(q, p) = h.at(p, q) = -t * c;
        a = h * a * g;
      }
    }
  }
  std::vector<Real> values;
  for (int i = 0; i < a.rows; ++i) values.push_back(a.at(i, i));
  std::sort(values.begin(), values.end());
  return values;
}

/// The means of squares that the law's κ answer to, from the features as they stand, normalised, in 50 digits.
std::vector<Big> sufficientMeans(LawModel model, const Eigen::MatrixXd& rows) {
  using liestat_test::Real;
  const int p = static_cast<int>(rows.cols()), n = static_cast<int>(rows.rows());
  Matrix scatter(p, p), sum(p, 1);
  for (int i = 0; i < n; ++i) {
    Matrix x(Eigen::VectorXd(rows.row(i).transpose()));
    const Real length = norm(x);
    for (int k = 0; k < p; ++k) {
      sum.at(k, 0) += x.at(k, 0) / length / n;
      for (int j = 0; j < p; ++j) scatter.at(k, j) += x.at(k, 0) * x.at(j, 0) / (length * length) / n;
    }
  }
  if (model == LawModel::vmf || model == LawModel::von_mises) return {Big((1 - norm(sum)) / 2)};
  std::vector<Big> means;
  for (const Real& value : eigenvalues(scatter)) means.emplace_back(value);
  means.pop_back();
  return means;
}

/// The relative error of fitted κ: the step that Newton's iteration in 35 digits would take from there.
double concentrationError(const Eigen::MatrixXd& rows, const LawFit& fit) {
  const LawModel model = fit.law.model;
  const std::vector<Big> means = sufficientMeans(model, rows);
  std::vector<Big> expected;
  const auto q = static_cast<Eigen::Index>(means.size());
  if (model == LawModel::vmf) {
    const Big kappa = fit.law.kappa[0];
    expected = {(1 / kappa - 2 / (exp(2 * kappa) - 1)) / 2};
    if (kappa > 1e4) expected = {1 / kappa / 2};
  } else {
    std::vector<Big> mu;
    for (Eigen::Index i = 0; i < q; ++i) mu.emplace_back((model == LawModel::bingham ? 1 : 2) * Big(fit.law.kappa[i]));
    mu.emplace_back(0);
    expected = secondMoments(mu);
  }
  // The slopes are the covariances of squares over the factor of κ: those of the fit.
  Eigen::VectorXd excess(q);
  for (Eigen::Index i = 0; i < q; ++i) {
    const auto k = static_cast<std::size_t>(i);
    excess[i] = static_cast<double>(expected[k] - means[k]);
  }
  const double factor = model == LawModel::bingham ? 1 : 2;
  const Eigen::VectorXd step = factor * static_cast<double>(fit.n) * fit.kappa_covariance * excess;
  return step.cwiseQuotient(fit.law.kappa).cwiseAbs().maxCoeff();
}

TEST(DirectionalLaws, concentrationsHaveTenDigits) {
  double worst = 0;
  const auto expectError = [&](LawModel model, const Eigen::VectorXd& kappa, int n) {
    const Eigen::MatrixXd rows = draw(lawOf(model, kappa), n, 3);
    LawFitOptions quick;
    quick.bootstrap_below = 0;
    const LawFit fit = fitLaw(model, rows, quick);
    const double error = concentrationError(rows, fit);
    EXPECT_LT(error, 1e-10) << name(model) << ", kappa " << kappa.transpose();
    EXPECT_LT(std::abs(std::log(fit.law.kappa[0] / kappa[0])), kappa[0] < 0.1 ? 3 : 1) << name(model);
    worst = std::max(worst, error);
  };
  for (const double k : {1e-2, 1.0, 30.0, 1e4, 1e8, 1e12}) {
    const int n = k < 0.1 ? 4000 : 60;
    expectError(LawModel::von_mises, vectorOf({k}), n);
    expectError(LawModel::vmf, vectorOf({k}), n);
    expectError(LawModel::bingham, vectorOf({2 * k, k}), n);
    expectError(LawModel::bingham, vectorOf({k + 1, 0.5}), n);
    expectError(LawModel::matrix_fisher, vectorOf({3 * k, 2 * k, k}), n);
    expectError(LawModel::matrix_fisher, vectorOf({k + 1, 1, 0.5}), n);
  }
  std::printf("largest relative error of kappa: %.1e\n", worst);
}

/// Σ log of the wrapped normal density at rows' logs about mode · exp(h e_k), but for constants, and the mean of z zᵀ there,
/// in 35 digits; other turns than none weigh below 1e-60 from κ = 100 on.
struct WrappedReference {
  Big log_density = 0;
  std::array<std::array<Big, 3>, 3> scatter = {};

  WrappedReference(const Eigen::MatrixXd& rows, const DirectionalLaw& law, int k, const Big& h) {
    const auto product = [](const std::array<Big, 4>& q, const std::array<Big, 4>& p) {
      return std::array<Big, 4>{
          q[3] * p[0] + p[3] * q[0] + q[1] * p[2] - q[2] * p[1], q[3] * p[1] + p[3] * q[1] + q[2] * p[0] - q[0] * p[2],
          q[3] * p[2] + p[3] * q[2] + q[0] * p[1] - q[1] * p[0], q[3] * p[3] - q[0] * p[0] - q[1] * p[1] - q[2] * p[2]};
    };
    std::array<Big, 4> turn{0, 0, 0, cos(h / 2)}, mode;
    turn.at(static_cast<std::size_t>(k)) = sin(h / 2);
    for (int i = 0; i < 4; ++i) mode.at(static_cast<std::size_t>(i)) = law.location[i];
    mode = product(mode, turn);
    for (int i = 0; i < 3; ++i) mode.at(static_cast<std::size_t>(i)) *= -1;
    for (Eigen::Index row = 0; row < rows.rows(); ++row) {
      const std::array<Big, 4> x =
          product(mode, {Big(rows(row, 0)), Big(rows(row, 1)), Big(rows(row, 2)), Big(rows(row, 3))});
      const Big s = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]), angle = 2 * atan2(s, abs(x[3]));
      const Big factor = (x[3] < 0 ? -angle : angle) / s;
      std::array<Big, 3> z;
      for (int i = 0; i < 3; ++i) {
        Big& sum = z.at(static_cast<std::size_t>(i)) = 0;
        for (int j = 0; j < 3; ++j) sum += law.axes(j, i) * factor * x.at(static_cast<std::size_t>(j));
        log_density -= law.kappa[i] * sum * sum / 2;
      }
      log_density += 2 * log(angle / sin(angle / 2));
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) scatter.at(i).at(j) += z.at(i) * z.at(j) / rows.rows();
      }
    }
  }
};

TEST(DirectionalLaws, theWrappedNormalHasTenDigits) {
  // The likelihood is stationary: in κ to 1e-10, in the axes and the mode, on which κ depends to second order, to 1e-6.
  LawFitOptions quick;
  quick.bootstrap_below = 0;
  for (const double k : {1e2, 1e4, 1e8, 1e12}) {
    const Eigen::MatrixXd rows = draw(lawOf(LawModel::wrapped_normal, vectorOf({3 * k, 2 * k, k})), 60, 8);
    const LawFit fit = fitLaw(LawModel::wrapped_normal, rows, quick);
    ASSERT_EQ(fit.kappa_covariance.rows(), 3) << fit.reason;
    const WrappedReference at(rows, fit.law, 0, 0);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto a = static_cast<Eigen::Index>(i);
      EXPECT_LT(std::abs(static_cast<double>(fit.law.kappa[a] * at.scatter[i][i] - 1)), 1e-10) << k << ", " << i;
      for (std::size_t j = 0; j < i; ++j) {
        const double root = std::sqrt(fit.law.kappa[a] * fit.law.kappa[static_cast<Eigen::Index>(j)]);
        EXPECT_LT(std::abs(root * static_cast<double>(at.scatter[i][j])), 1e-6) << k << ", " << i << ", " << j;
      }
      const double sd = 1 / std::sqrt(k);
      const Big h = 1e-9 * sd;
      const int axis = static_cast<int>(i);
      const Big slope = (WrappedReference(rows, fit.law, axis, h).log_density -
                         WrappedReference(rows, fit.law, axis, -h).log_density) /
                        (2 * h);
      EXPECT_LT(std::abs(static_cast<double>(slope)) * sd / 60, 1e-6) << k << ", " << i;
    }
  }
}

TEST(DirectionalLaws, aConcentratedWrappedNormalIsTheScatterOfLogs) {
  // At κ = 1e12 the mode is the mean, and curvature is below 1e-12: variances are those of the logs.
  const DirectionalLaw law = lawOf(LawModel::wrapped_normal, vectorOf({3e12, 2e12, 1e12}));
  const Eigen::MatrixXd rows = draw(law, 60, 5);
  const LawFit fit = fitLaw(LawModel::wrapped_normal, rows), fisher = fitLaw(LawModel::matrix_fisher, rows);
  ASSERT_EQ(fit.status, Status::ok) << fit.reason;
  const std::vector<Big> means = sufficientMeans(LawModel::matrix_fisher, rows);
  for (int i = 0; i < 3; ++i) {
    // Quaternions hold half angles; their scatter is that about the principal axis, as the logs' is about the mode.
    EXPECT_LT(std::abs(fit.law.kappa[i] * 4 * static_cast<double>(means[static_cast<std::size_t>(i)]) - 1), 1e-10) << i;
    EXPECT_LT(std::abs(fit.law.kappa[i] / fisher.law.kappa[i] - 1), 1e-10) << i;
  }
}

TEST(DirectionalLaws, theWrappedNormalIsAMaximum) {
  // Its likelihood is that of a sum over turns, which no other law shares: neighbours of the estimate have less, by the
  // density of numerically integrated normal vectors. Samples of the fit have its moments.
  const DirectionalLaw law = lawOf(LawModel::wrapped_normal, vectorOf({4, 2, 1}));
  const LawFit fit = fitLaw(LawModel::wrapped_normal, draw(law, 4000, 6));
  ASSERT_EQ(fit.status, Status::ok) << fit.reason;
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(fit.law.kappa[i] - law.kappa[i]), 4 * fit.kappaDeviation(i)) << i;
  }
  const SO3d truth = SO3d::fromParams(Eigen::Vector4d(law.location)),
             mode = SO3d::fromParams(Eigen::Vector4d(fit.law.location));
  const Eigen::Vector3d error = (mode.inverse() * truth).log();
  EXPECT_LT(error.dot(fit.location_covariance.inverse() * error), 21) << "p 1e-4 of chi2 of 3";
}

TEST(DirectionalLaws, samplesFollowTheLaw) {
  // Against distribution functions that the sampler does not know; each p below 1e-4 once in 10⁴ seeds.
  const double kappa = 3;
  const DirectionalLaw vmf = lawOf(LawModel::vmf, vectorOf({kappa}));
  std::vector<double> cosines;
  const Eigen::MatrixXd directions = draw(vmf, 4000, 7);
  for (const auto& x : directions.rowwise()) cosines.push_back(x.dot(vmf.location.transpose()));
  EXPECT_GT(ksTest(cosines, [&](double c) { return (std::exp(kappa * c) - std::exp(-kappa)) / (2 * std::sinh(kappa)); })
                .p_value,
            1e-4);
  const DirectionalLaw mises = lawOf(LawModel::von_mises, vectorOf({kappa}));
  const Eigen::MatrixXd headings = draw(mises, 4000, 8);
  double sine = 0, cosine = 0;
  for (const auto& x : headings.rowwise()) {
    cosine += x.dot(mises.location.transpose()) / 4000;
    sine += (mises.location[0] * x[1] - mises.location[1] * x[0]) / 4000;
  }
  EXPECT_LT(std::abs(cosine - std::cyl_bessel_i(1, kappa) / std::cyl_bessel_i(0, kappa)), 4 * 0.25 / std::sqrt(4000));
  EXPECT_LT(std::abs(sine), 4 * 0.6 / std::sqrt(4000));
  for (const LawModel model : {LawModel::bingham, LawModel::matrix_fisher}) {
    const Eigen::VectorXd k = model == LawModel::bingham ? vectorOf({9, 7}) : vectorOf({5, 3, 2});
    const LawFit fit = fitLaw(model, draw(lawOf(model, k), 6000, 9));
    ASSERT_EQ(fit.status, Status::ok) << name(model) << ": " << fit.reason;
    const Eigen::VectorXd off = fit.law.kappa - k;
    EXPECT_LT(off.dot(fit.kappa_covariance.inverse() * off), 21) << name(model);
    EXPECT_LT(std::abs(std::abs(fit.law.location.dot(lawOf(model, k).location)) - 1), 1e-3) << name(model);
  }
}

/// Of fits of simulated samples the fractions that are ok, and with p below 5 %, and the true location in the region.
struct Rates {
  int trials = 0, ok = 0, inconsistent = 0, goodness = 0, symmetry = 0, uniformity = 0, kappa = 0, cone = 0;
};
Rates ratesOf(const DirectionalLaw& law, int n, int trials, std::uint64_t seed) {
  Rates rates;
  rates.trials = trials;
  for (int i = 0; i < trials; ++i) {
    const LawFit fit = fitLaw(law.model, draw(law, n, seed + static_cast<std::uint64_t>(i), 1));
    rates.ok += fit.ok() ? 1 : 0, rates.inconsistent += fit.status == Status::inconsistent ? 1 : 0;
    rates.goodness += fit.goodness.p < 0.05 ? 1 : 0, rates.symmetry += fit.symmetry.p < 0.05 ? 1 : 0;
    rates.uniformity += fit.uniformity.p < 0.05 ? 1 : 0;
    if (!fit.ok() || fit.girdle) continue;
    rates.kappa += std::abs(fit.law.kappa[0] - law.kappa[0]) < 1.96 * fit.kappaDeviation(0) ? 1 : 0;
    double cosine = fit.law.location.dot(law.location);
    if (law.model != LawModel::vmf && law.model != LawModel::von_mises) cosine = std::abs(cosine);
    const double angle = (parametersOf(law.model) == 4 ? 2 : 1) * std::acos(std::min(1.0, cosine));
    rates.cone += angle < fit.alpha95() ? 1 : 0;
  }
  return rates;
}
/// Four standard errors of so many trials about 5 %.
double aboutFivePercent(int trials) { return 0.05 * trials + 4 * std::sqrt(0.05 * 0.95 * trials); }

TEST(DirectionalLaws, regionsHoldAndTestsHaveTheirLevel) {
  constexpr int trials = 24;
  const std::vector<DirectionalLaw> laws{lawOf(LawModel::vmf, vectorOf({5})), lawOf(LawModel::von_mises, vectorOf({5})),
                                         lawOf(LawModel::bingham, vectorOf({20, 20})),
                                         lawOf(LawModel::matrix_fisher, vectorOf({10, 10, 10}))};
  for (const DirectionalLaw& law : laws) {
    const Rates rates = ratesOf(law, 25, trials, 100);
    EXPECT_GE(rates.ok, 0.97 * trials) << name(law.model);
    EXPECT_LE(rates.goodness, aboutFivePercent(trials)) << name(law.model);
    EXPECT_LE(rates.symmetry, aboutFivePercent(trials)) << name(law.model);
    EXPECT_GE(rates.cone, rates.ok - aboutFivePercent(trials)) << name(law.model);
    if (law.model == LawModel::vmf || law.model == LawModel::von_mises) {
      EXPECT_GE(rates.kappa, rates.ok - aboutFivePercent(trials)) << name(law.model);
    }
  }
}

TEST(DirectionalLaws, uniformFeaturesAreNotOk) {
  for (const LawModel model : {LawModel::vmf, LawModel::von_mises, LawModel::bingham, LawModel::matrix_fisher}) {
    const auto q = model == LawModel::matrix_fisher ? 3 : model == LawModel::bingham ? 2 : 1;
    const Rates rates = ratesOf(lawOf(model, Eigen::VectorXd::Constant(q, 1e-9)), 40, 24, 200);
    EXPECT_LE(rates.uniformity, aboutFivePercent(24)) << name(model);
    EXPECT_LE(rates.ok, 2) << name(model) << ": of 0.24 expected, once in 500";
  }
}

TEST(DirectionalLaws, aSecondPopulationIsMarked) {
  // A fifth of the features far away: none is ok. One outlier of 80, at five to nine standard deviations: at most one.
  for (const LawModel model :
       {LawModel::vmf, LawModel::von_mises, LawModel::bingham, LawModel::matrix_fisher, LawModel::wrapped_normal}) {
    const int q = model == LawModel::bingham ? 2 : parametersOf(model) == 4 ? 3 : 1;
    const DirectionalLaw law = lawOf(model, Eigen::VectorXd::Constant(q, 100));
    DirectionalLaw other = law;
    const Eigen::Vector3d away(0, 0.9, 0);
    if (model == LawModel::von_mises) other.location = vectorOf({0.8, 0.6});
    if (model == LawModel::vmf || model == LawModel::bingham) other.location = SO3d::exp(away).matrix() * law.location;
    if (model == LawModel::bingham) other.axes = SO3d::exp(away).matrix() * law.axes;
    if (parametersOf(model) == 4)
      other.location = (SO3d::fromParams(Eigen::Vector4d(law.location)) * SO3d::exp(away)).params();
    for (const int strangers : {16, 1}) {
      int ok = 0;
      for (std::uint64_t seed = 0; seed < 2; ++seed) {
        Eigen::MatrixXd rows = draw(law, 80, seed, 2);
        rows.topRows(strangers) = draw(other, strangers, seed, 3);
        ok += fitLaw(model, rows).ok() ? 1 : 0;
      }
      EXPECT_LE(ok, strangers == 1 ? 1 : 0) << name(model) << ", " << strangers << " of 80";
    }
  }
}

TEST(DirectionalLaws, kentsFeaturesAreNotSymmetric) {
  // Directions that scatter twice as far one way as the other.
  CounterRng rng(11);
  std::vector<S2d> oval;
  for (int i = 0; i < 100; ++i)
    oval.push_back(exp(S2d(0.6, 0, 0.8), Eigen::Vector2d(0.2 * rng.normal(), 0.1 * rng.normal())));
  const LawFit fit = fitLaw(LawModel::vmf, oval);
  EXPECT_LT(fit.symmetry.p, 1e-4);
  EXPECT_EQ(fit.status, Status::inconsistent);
  EXPECT_TRUE(fit.verdict().isNo());
}

TEST(DirectionalLaws, statusesOfFewEqualAndForeignFeatures) {
  CounterRng rng(12);
  std::vector<S2d> few(9, S2d(0, 0, 1));
  EXPECT_EQ(fitLaw(LawModel::vmf, few).status, Status::too_few);
  EXPECT_TRUE(fitLaw(LawModel::vmf, few).verdict().isNone());
  const std::vector<S2d> equal(20, S2d(0.6, 0, 0.8));
  EXPECT_EQ(fitLaw(LawModel::vmf, equal).status, Status::ill_defined);
  EXPECT_EQ(fitLaw(LawModel::bingham, equal).status, Status::ill_defined);
  EXPECT_EQ(fitLaw(LawModel::von_mises, std::vector<SO2d>(20, SO2d(1.0))).status, Status::ill_defined);
  for (const LawModel model : {LawModel::matrix_fisher, LawModel::wrapped_normal}) {
    EXPECT_EQ(fitLaw(model, std::vector<SO3d>(20, SO3d::exp({1, 2, 0.5}))).status, Status::ill_defined) << name(model);
  }
  EXPECT_EQ(fitLaw(LawModel::matrix_fisher, equal).status, Status::not_applicable);
  Eigen::MatrixXd rows = draw(lawOf(LawModel::vmf, vectorOf({5})), 20, 1);
  rows(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fitLaw(LawModel::vmf, rows).status, Status::not_applicable);
  rows(3, 1) = 2;
  EXPECT_NE(fitLaw(LawModel::vmf, rows).reason.find("row 4"), std::string::npos);
}

TEST(DirectionalLaws, repeatedFeaturesAreNotIndependentOnes) {
  const Eigen::MatrixXd once = draw(lawOf(LawModel::vmf, vectorOf({5})), 20, 21);
  Eigen::MatrixXd twice(40, 3);
  twice << once, once;
  EXPECT_TRUE(fitLaw(LawModel::vmf, once).ok());
  const LawFit fit = fitLaw(LawModel::vmf, twice);
  EXPECT_EQ(fit.status, Status::inconsistent);
  EXPECT_NE(fit.reason.find("each by 1.0 others"), std::string::npos) << fit.reason;
}

TEST(DirectionalLaws, aGirdleHasAPole) {
  const DirectionalLaw law = lawOf(LawModel::bingham, vectorOf({60, 1}));
  const LawFit fit = fitLaw(LawModel::bingham, draw(law, 80, 13));
  ASSERT_EQ(fit.status, Status::ok) << fit.reason;
  EXPECT_TRUE(fit.girdle);
  EXPECT_LT(std::acos(std::abs(fit.law.location.dot(law.axes.col(0)))), fit.alpha95());
}

TEST(DirectionalLaws, anotherFrameMovesTheLawWithIt) {
  const Eigen::Matrix3d turn = SO3d::exp({2, 0.3, -1}).matrix();
  const Eigen::MatrixXd rows = draw(lawOf(LawModel::bingham, vectorOf({20, 8})), 40, 14);
  const LawFit here = fitLaw(LawModel::bingham, rows),
               there = fitLaw(LawModel::bingham, Eigen::MatrixXd(rows * turn.transpose()));
  EXPECT_LT((here.law.kappa - there.law.kappa).norm(), 1e-10 * here.law.kappa.norm());
  EXPECT_NEAR(std::abs((turn * here.law.location).dot(there.law.location)), 1, 1e-12);
  EXPECT_NEAR(here.alpha95(), there.alpha95(), 1e-10);
  EXPECT_EQ(here.status, there.status);
}

}  // namespace
