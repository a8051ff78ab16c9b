#include <cli/means_experiment.hpp>
#include <lie/lie.hpp>

namespace liestat::cli {
namespace detail {

template <class M>
std::vector<ValidationReport> runTrials(const MeansExperiment&, int,
                                        const std::function<void(std::size_t, std::size_t)>&);

}  // namespace detail

std::string name(Feature feature) {
  switch (feature) {
    case Feature::point:
      return "point";
    case Feature::rotation:
      return "rotation";
    case Feature::frame:
      return "frame";
    case Feature::semi_oriented_frame:
      return "semi_oriented_frame";
    case Feature::non_oriented_frame:
      return "non_oriented_frame";
    case Feature::direction:
      return "direction";
  }
  return "";
}

std::string name(Noise noise) {
  switch (noise) {
    case Noise::iid:
      return "iid";
    case Noise::isd:
      return "isd";
    case Noise::idd:
      return "idd";
    case Noise::exp:
      return "exp";
  }
  return "";
}

std::string name(Criterion criterion) {
  switch (criterion) {
    case Criterion::lsq:
      return "lsq";
    case Criterion::wlsq:
      return "wlsq";
    case Criterion::maha:
      return "maha";
  }
  return "";
}

std::string name(CovarianceAt at) { return at == CovarianceAt::measured ? "measured" : "estimated"; }

std::size_t methodIndex(const Method& method) {
  std::size_t i = 0;
  while (i + 1 < methods.size() &&
         !(methods[i].criterion == method.criterion && methods[i].corrected == method.corrected &&
           methods[i].known_noise == method.known_noise)) {
    ++i;
  }
  return i;
}

int degreesOfFreedom(Feature feature) {
  switch (feature) {
    case Feature::point:
    case Feature::rotation:
      return 3;
    case Feature::direction:
      return 2;
    default:
      return 6;
  }
}

std::vector<ValidationReport> run(const MeansExperiment& experiment, int threads,
                                  const std::function<void(std::size_t, std::size_t)>& progress) {
  switch (experiment.feature) {
    case Feature::point:
      return detail::runTrials<Eigen::Vector3d>(experiment, threads, progress);
    case Feature::rotation:
      return detail::runTrials<SO3d>(experiment, threads, progress);
    case Feature::frame:
      return detail::runTrials<Frame3d>(experiment, threads, progress);
    case Feature::semi_oriented_frame:
      return detail::runTrials<SemiOrientedFrame3d>(experiment, threads, progress);
    case Feature::non_oriented_frame:
      return detail::runTrials<NonOrientedFrame3d>(experiment, threads, progress);
    case Feature::direction:
      return detail::runTrials<S2d>(experiment, threads, progress);
  }
  return {};
}

}  // namespace liestat::cli
