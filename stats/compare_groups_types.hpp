// The result of compareGroups() (stats/compare_groups.hpp): what programs and pages read.
#pragma once

#include <stats/status.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace liestat {

/// Options of compareGroups() and comparePairs().
struct ComparisonOptions {
  double level = 0.05;           ///< of the verdict
  std::size_t resamples = 1999;  ///< at most, of a bootstrap and of permutations; they end early where p is large
  std::uint64_t seed = 1;        ///< of these
};

/// A test of equality: a statistic with the law of F or, without degrees of freedom, by resampling. NaN where there is none.
struct EqualityTest {
  double statistic = std::numeric_limits<double>::quiet_NaN();
  double numerator_dof = std::numeric_limits<double>::quiet_NaN();  ///< of F
  double denominator_dof = std::numeric_limits<double>::quiet_NaN();
  double p = std::numeric_limits<double>::quiet_NaN();
};
template <class V>
void describe(V& v, const EqualityTest& x) {
  v("statistic", x.statistic)("numerator_dof", x.numerator_dof, "of F; null: by resampling");
  v("denominator_dof", x.denominator_dof, "of F; null: by resampling")("p", x.p);
}

/// A group in the tangent space at the pooled mean.
struct ComparedGroup {
  std::string name = {};
  std::size_t n = 0;
  Eigen::VectorXd offset = {};      ///< of the group's mean from the pooled one
  Eigen::MatrixXd dispersion = {};  ///< covariance of one feature of the group
};
template <class V>
void describe(V& v, const ComparedGroup& x) {
  v("name", x.name)("n", x.n);
  v("offset", x.offset, "of the group's mean, in the tangent space at the pooled mean");
  v("dispersion", x.dispersion, "covariance of a feature of the group");
}

/// Two of several groups.
struct ComparedPair {
  std::size_t first = 0, second = 0;
  Eigen::VectorXd difference = {};  ///< of the means, second less first
  Eigen::MatrixXd covariance = {};  ///< of the difference, whatever the dispersions
  EqualityTest means = {};
  double adjusted_p = std::numeric_limits<double>::quiet_NaN();  ///< family-wise over all pairs (Holm)
};
template <class V>
void describe(V& v, const ComparedPair& x) {
  v("first", x.first, "index of a group")("second", x.second, "index of a group");
  v("difference", x.difference, "of the means, second less first")("covariance", x.covariance, "of the difference");
  v("means", x.means)("adjusted_p", x.adjusted_p, "family-wise over all pairs, by Holm");
}

/// The result of compareGroups() and comparePairs().
struct GroupComparison {
  Status status = Status::too_few;
  std::string reason = {};  ///< of another status than ok
  bool paired = false;
  double level = 0.05;
  Eigen::VectorXd pooled_mean = {};  ///< the parameters of the feature in whose tangent space all is
  std::vector<ComparedGroup> groups = {};
  EqualityTest means = {};               ///< whatever the dispersions; of pairs Hotelling's of the differences
  EqualityTest means_if_alike = {};      ///< if dispersions are equal: Hotelling's, of more groups Wilks'
  EqualityTest dispersions = {};         ///< of covariances, by permutation; not of pairs
  std::vector<ComparedPair> pairs = {};  ///< all pairs of groups

  bool ok() const { return status == Status::ok; }
  /// Yes: consistent with one mean. No: the means differ at the level. None: the status is not ok.
  Verdict verdict() const;
};
template <class V>
void describe(V& v, const GroupComparison& x) {
  v("status", name(x.status), "the status")("reason", x.reason);
  describe(v, x.verdict());
  v("paired", x.paired)("level", x.level, "of the verdict");
  v("pooled_mean", x.pooled_mean, "parameters of the feature in whose tangent space all is");
  v("groups", x.groups);
  v("means", x.means, "equality of means, whatever the dispersions");
  v("means_if_alike", x.means_if_alike, "equality of means if dispersions are equal: Hotelling's or Wilks'");
  v("dispersions", x.dispersions, "equality of dispersions, by permutation");
  v("pairs", x.pairs, "of groups");
}

}  // namespace liestat
