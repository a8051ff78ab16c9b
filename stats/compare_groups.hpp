// compareGroups: do groups of features have one mean, and one dispersion? Two and k samples on every manifold that has a
// mean, and pairs. The core is compiled once, in liestat::laws (Random123); the front is a template over the manifold.
//
//   const GroupComparison found = compareGroups(std::vector{rotations, others});
//   if (found.verdict().isNo()) std::cout << found.means.p << '\n';
//
// Features are taken to the tangent space at the pooled mean, where group means are compared as those of points. Docs:
// docs/comparing_groups.md.
#pragma once

#include <lie/manifold.hpp>
#include <stats/compare_groups_types.hpp>
#include <stats/detail/compiled_laws.hpp>
#include <stats/concentration.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <vector>

namespace liestat {

/// The comparison of groups of vectors, in rows: what compareGroups() does once features are vectors. At least two groups
/// of one dimension d. `too_few`: a group has fewer than max(10, 4 d) rows, from where on levels were validated; fewer than
/// d + 2 are not compared at all. `ill_defined`: a dispersion is singular.
LIESTAT_LAWS_API GroupComparison compareVectors(const std::vector<Eigen::MatrixXd>& groups,
                                                const ComparisonOptions& options = {});
/// The same of pairs, row by row.
LIESTAT_LAWS_API GroupComparison compareVectorPairs(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                                                    const ComparisonOptions& options = {});

namespace detail {

/// The groups in the tangent space at their pooled mean; of fewer than two, or without a mean, none and a reason.
template <Homogeneous M>
std::vector<Eigen::MatrixXd> tangentGroups(const std::vector<std::vector<M>>& groups, GroupComparison& result) {
  std::vector<M> all;
  for (const std::vector<M>& group : groups) all.insert(all.end(), group.begin(), group.end());
  if (groups.size() < 2 || std::any_of(groups.begin(), groups.end(), [](const auto& g) { return g.empty(); })) {
    result.reason = "there are fewer than two groups with features";
    return {};
  }
  M centre = ManifoldTraits<M>::origin();
  auto status = Status::not_converged;
  bool concentrated = true;
  if constexpr (Metric<M>) {
    const auto found = liestat::mean(all);
    centre = found.mean, status = found.status;
    concentrated = !converged(status) || concentration(all, centre).concentrated;
  } else {
    const auto found = groupMean(all);
    centre = found.mean, status = found.status;
  }
  if (status != Status::ok || !concentrated) {
    result.status = concentrated ? status : Status::ill_defined;
    result.reason = concentrated ? "the iteration for the pooled mean found none, or a number is not finite"
                                 : "all features together are as scattered as uniform ones: there is no pooled mean in "
                                   "whose tangent space groups could be compared";
    return {};
  }
  if constexpr (requires { centre.params(); }) {
    result.pooled_mean = centre.params().template cast<double>();
  } else {
    result.pooled_mean = centre.template cast<double>();
  }
  std::vector<Eigen::MatrixXd> tangents;
  for (const std::vector<M>& group : groups) {
    Eigen::MatrixXd& rows = tangents.emplace_back(static_cast<Eigen::Index>(group.size()), ManifoldTraits<M>::DoF);
    Eigen::Index i = 0;
    for (const M& x : group) rows.row(i++) = log(centre, x).transpose().template cast<double>();
  }
  return tangents;
}

inline GroupComparison withMean(GroupComparison compared, const GroupComparison& mean) {
  compared.pooled_mean = mean.pooled_mean;
  return compared;
}

}  // namespace detail

/// Do groups of features have one mean, and one dispersion? Beyond compareVectors(): `ill_defined` where all features
/// together are as scattered as uniform ones, `not_converged` where they are not finite.
template <Homogeneous M>
LIESTAT_LAWS_API GroupComparison compareGroups(const std::vector<std::vector<M>>& groups,
                                               const ComparisonOptions& options = {}) {
  GroupComparison result;
  const std::vector<Eigen::MatrixXd> tangents = detail::tangentGroups(groups, result);
  return tangents.empty() ? result : detail::withMean(compareVectors(tangents, options), result);
}

/// Do features that were measured in pairs, first[i] and second[i], have one mean? Lists of two lengths: not_applicable.
template <Homogeneous M>
LIESTAT_LAWS_API GroupComparison comparePairs(const std::vector<M>& first, const std::vector<M>& second,
                                              const ComparisonOptions& options = {}) {
  GroupComparison result;
  result.paired = true;
  if (first.size() != second.size()) {
    result.status = Status::not_applicable, result.reason = "pairs of lists of two lengths";
    return result;
  }
  const std::vector<Eigen::MatrixXd> tangents = detail::tangentGroups<M>({first, second}, result);
  return tangents.empty() ? result : detail::withMean(compareVectorPairs(tangents[0], tangents[1], options), result);
}

}  // namespace liestat
