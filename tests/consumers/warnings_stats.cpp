// A user's unit that takes liestat through -I, not -isystem, and has warnings on: none may come from the headers. It
// instantiates the estimators for each kind of manifold and of range; run.sh compiles it with the compilers that there
// are.
#include <lie/lie.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/charts.hpp>
#include <stats/conventions.hpp>
#include <stats/covariance.hpp>
#include <stats/cut_locus.hpp>
#include <stats/dispersion.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/printed.hpp>
#include <stats/propagation.hpp>
#include <stats/uniqueness.hpp>

#include <deque>
#include <list>
#include <vector>

using namespace liestat;

namespace {

template <class M>
bool means() {
  const std::vector<M> features(5);
  const std::vector<double> weights(5, 1.0);
  const MeanResult<M> plain = mean(features), weighted = mean(features, weights);
  const std::vector<SquareOf<M>> noise(5, SquareOf<M>::Identity());
  const SquareOf<M> covariance = covarianceFromNoise(weighted, weights, noise) + covarianceFromNoise(plain, noise) +
                                 covarianceFromResiduals(plain) + covarianceFromResiduals(plain, ResidualNoise::any) +
                                 covarianceFromCommonNoise(plain, noise[0]) + empiricalCovariance(features, plain.mean);
  const std::vector<Gaussian<M>> gaussians(5, Gaussian<M>{plain.mean, covariance});
  return certifiedMean(features, weights).status == certifiedMaha(gaussians, CovarianceAt::measured).status &&
         maha(gaussians, CovarianceAt::estimated, {.likelihood = true}).status == Status::ok &&
         fuse(gaussians, CovarianceAt::measured).covariance.allFinite() &&
         printed::covarianceFromResiduals(plain).allFinite();
}

template <class G>
bool groupMeans() {
  const std::list<G> elements(4);
  const Eigen::VectorXd weights = Eigen::VectorXd::Ones(4);
  const GroupMeanResult<G> result = groupMean(elements, weights);
  const Gaussian<G> g{result.mean, result.covarianceFromResiduals()};
  return certifiedGroupMean(elements).status == result.status && compose(g, inverse(g)).covariance.allFinite();
}

}  // namespace

int main() {
  const std::deque<SO3d> deque(3);
  const Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Random(3, 6);
  const std::vector<Eigen::Quaterniond> quaternions(3, Eigen::Quaterniond::Identity());
  std::vector<Eigen::Map<const SO3d>> views;
  for (const SO3d& x : deque) views.emplace_back(x.data());
  const bool ranges = mean(deque, std::vector<int>(3, 1)).n == mean(quaternions).n && mean(views).n == 3 &&
                      mean(points.colwise()).n == 6;
  const bool kinds = means<SO3d>() && means<Frame3d>() && means<SemiOrientedFrame3d>() && means<S2d>() &&
                     means<OrientedPointd>() && means<Frame2d>() && means<SO2d>() && means<Eigen::Vector3d>() &&
                     means<SO3f>() && groupMeans<SE3d>() && groupMeans<SE2d>() && groupMeans<Sim3d>();
  return ranges && kinds ? 0 : 1;
}
