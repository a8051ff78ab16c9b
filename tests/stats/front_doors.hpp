#pragma once

// All estimators that take an executor, on data that give every executor something to do; shared by the executors'
// tests, which compare the bits.

#include <lie/lie.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/executor.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace liestat::test {

/// Numbers by name, so that a difference says where it is.
using NamedNumbers = std::vector<std::pair<std::string, double>>;

class NumberList {
 public:
  void add(const std::string& name, double x) { list_.emplace_back(name, x); }
  template <class D>
  void add(const std::string& name, const Eigen::PlainObjectBase<D>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) add(name + "[" + std::to_string(i) + "]", m.data()[i]);
  }
  template <class M>
  void add(const std::string& name, const UniquenessResult<M>& u) {
    add(name + ".unique", static_cast<double>(u.unique));
    add(name + ".minimiser", typename M::Params(u.minimiser.params()));
    add(name + ".r_star", u.r_star);
    add(name + ".cells", static_cast<double>(u.cells));
    add(name + ".rivals", static_cast<double>(u.rivals.size()));
    for (const M& rival : u.rivals) add(name + ".rival", typename M::Params(rival.params()));
  }
  template <class Certified>
  void addCertified(const std::string& name, const Certified& c) {
    add(name + ".uniqueness", c.uniqueness);
    add(name + ".status", static_cast<double>(c.status));
    add(name + ".mass", c.cut_locus.mass);
    add(name + ".cut_locus.hessian_change", c.cut_locus.hessian_change);
    add(name + ".hessian_change", c.hessian_change);
    add(name + ".region_factor", c.region_factor);
    add(name + ".near_ties", static_cast<double>(c.near_ties.size()));
    for (const auto& tie : c.near_ties) add(name + ".near_ties.z", tie.z);
    if (c.estimate) add(name + ".covariance", c.estimate->covariance);
  }
  const NamedNumbers& list() const { return list_; }

 private:
  NamedNumbers list_;
};

/// The results of every front door.
template <Executor E>
NamedNumbers frontDoors(const E& executor) {
  std::mt19937_64 engine(5);
  std::normal_distribution<double> gauss;
  const auto normal = [&](auto tag) {
    decltype(tag) v;
    for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = gauss(engine);
    return v;
  };
  // More than a chunk of data, tight; and some hundreds that only branch and bound certifies.
  std::vector<SO3d> tight, wide;
  std::vector<double> weights;
  std::vector<SE3d> poses;
  for (int i = 0; i < 2500; ++i) {
    tight.push_back(SO3d::rotX(1) * SO3d::exp(0.3 * normal(Eigen::Vector3d())));
    poses.push_back(SE3d::transX(3) * SE3d::exp(0.2 * normal(Eigen::Matrix<double, 6, 1>())));
    weights.push_back(0.5 + std::abs(gauss(engine)));
  }
  for (int i = 0; i < 300; ++i) wide.push_back(SO3d::exp(1.1 * normal(Eigen::Vector3d())));
  std::vector<Gaussian<SO3d>> measured;
  for (std::size_t i = 0; i < tight.size(); ++i) {
    measured.push_back({tight[i], 0.09 / weights[i] * Eigen::Matrix3d::Identity()});
  }

  NumberList numbers;
  const auto best = mean(executor, tight, weights);
  numbers.add("mean", SO3d::Params(best.mean.params()));
  numbers.add("mean.hessian", best.hessian);
  numbers.add("mean.scatter", best.scatter);
  const auto scattered = mean(executor, wide);
  numbers.add("uniqueness", uniqueness(executor, wide, scattered));
  numbers.add("uniqueness of weighted", uniqueness(executor, tight, weights, best));
  numbers.addCertified("certifiedMean", certifiedMean(executor, tight, weights));
  numbers.addCertified("certifiedMean of wide data", certifiedMean(executor, wide));
  const auto barycentre = groupMean(executor, poses, weights);
  numbers.add("groupMean", SE3d::Params(barycentre.mean.params()));
  numbers.add("groupMean.covariance", barycentre.covarianceFromResiduals());
  numbers.addCertified("certifiedGroupMean", certifiedGroupMean(executor, poses, weights));
  const auto certified = certifiedMaha(executor, measured, CovarianceAt::measured);
  numbers.addCertified("certifiedMaha", certified);
  numbers.add("certifiedMaha.fit", certified.fit.chi2);
  return numbers.list();
}

/// The first number in which two lists differ, in words; empty if they are the same to the bit.
inline std::string firstDifference(const NamedNumbers& a, const NamedNumbers& b) {
  if (a.size() != b.size()) return "the lists differ in length";
  for (std::size_t i = 0; i < a.size(); ++i) {
    const bool same = a[i].second == b[i].second || (std::isnan(a[i].second) && std::isnan(b[i].second));
    if (a[i].first != b[i].first || !same) return a[i].first;
  }
  return "";
}

}  // namespace liestat::test
