#include <experiments/two_view_rules.hpp>

#include <fusion/two_view/models.hpp>
#include <stats/hierarchy.hpp>
#include <stats/model_choice.hpp>
#include <stats/model_choice_f_test.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numeric>

namespace liestat::experiments {
namespace {

using Search = Hierarchy<Eigen::Vector4d, TwoViewMotionModel>;

/// A rule's name, and the number of the model that it chooses.
struct Rule {
  const char* name;
  std::function<std::size_t(const Search&, double sigma)> choose;
};

template <class Phi>
Rule tests(const char* name, double guard, const Phi& phi) {
  return {name, [=](const Search& search, double) { return search.best(SupportTest{.guard = guard}, phi); }};
}
/// The model with the smallest value of a criterion.
template <class Criterion>
Rule smallest(const char* name, const Criterion& criterion) {
  return {name, [=](const Search& search, double sigma) {
            std::size_t best = search.nullModel();
            double least = std::numeric_limits<double>::infinity();
            for (std::size_t m = 0; m < search.models().size(); ++m) {
              const auto& state = search.state(m);
              if (!state.hasEstimate()) continue;
              const TwoViewModel& model = *search.models()[m];
              const CriterionInput input{state.errors, model.measurementDimension(), model.equations(),
                                         model.freeParameters()};
              const double value = criterion(input, state.threshold, sigma);
              if (value < least) least = value, best = m;
            }
            return best;
          }};
}

const std::vector<Rule>& rules() {
  constexpr double no_guard = std::numeric_limits<double>::infinity();
  static const std::vector<Rule> all = {
      {"support and cost, exp(-8.8 d/r): default", [](const Search& search, double) { return search.best(); }},
      tests("support, guard 9, exp(-8.8 d/r)", 9, ExponentialPhi{}),
      tests("support without guard, exp(-8.8 d/r)", 1, ExponentialPhi{}),
      tests("support without guard, exp(-3.1 d/r)", 1, ExponentialPhi{3.1}),
      tests("support, guard 9, F test 0.999", 9, FTestPhi{}),
      tests("support without guard, F test 0.999", 1, FTestPhi{}),
      tests("support without guard, F test 0.99", 1, FTestPhi{0.99}),
      tests("majority alone, F test 0.999", no_guard, FTestPhi{}),
      tests("support, guard 9, Phi = 1", 9, [](double, double) { return 1.0; }),
      smallest("information criterion", [](const CriterionInput& input, double threshold,
                                           double sigma) { return informationCriterion(input, threshold, sigma); }),
      smallest("GRIC", [](const CriterionInput& input, double, double) { return gric(input); }),
      smallest("geometric AIC",
               [](const CriterionInput& input, double threshold, double) { return geometricAic(input, threshold); })};
  return all;
}

}  // namespace

double TwoViewRuleRow::share(std::size_t motion) const {
  return static_cast<double>(right[motion]) / static_cast<double>(trials[motion]);
}
double TwoViewRuleRow::average() const {
  const auto sum = [](const OfMotions& list) {
    return static_cast<double>(std::accumulate(list.begin(), list.end(), std::size_t{0}));
  };
  return sum(right) / sum(trials);
}
std::size_t TwoViewRuleRow::worst() const {
  std::size_t worst = 0;
  for (std::size_t k = 1; k < right.size(); ++k) {
    if (share(k) < share(worst)) worst = k;
  }
  return worst;
}

std::vector<TwoViewRuleRow> compareTwoViewRules(const TwoViewRuleComparison& comparison, const RunProgress& progress) {
  std::vector<TwoViewRuleRow> rows;
  for (const Rule& rule : rules()) rows.push_back({rule.name, {}, {}});
  CellRun run(comparison.run, std::vector<CellSize>(default_two_view_motions.size(), {comparison.run.trials, 1}),
              progress);
  for (std::size_t k = 0; k < default_two_view_motions.size(); ++k) {
    const TwoViewSceneOptions options{.motion = default_two_view_motions[k],
                                      .matches = comparison.matches,
                                      .outliers = comparison.outliers,
                                      .sigma = comparison.sigma};
    // A trial has a bit for each rule that was right.
    const auto trials = run.outcomes([&](std::uint64_t number) {
      const std::uint64_t seed = comparison.run.seed * 1000003 + number;
      const TwoViewScene scene(options, seed);
      const double sigma = options.sigma / options.focal_length;
      const TwoViewImages images{{sigma, sigma}, Eigen::Vector2d(options.width, options.height) / options.focal_length};
      Search search(twoViewModels(images), {.seed = seed, .all_models = true});
      search.add(scene.matches);
      while (search.iterate()) {
      }
      std::uint64_t right = 0;
      for (std::size_t r = 0; r < rules().size(); ++r) {
        const bool one = search.models()[rules()[r].choose(search, sigma)]->name() == nameOf(options.motion);
        right |= std::uint64_t{one} << r;
      }
      return right;
    });
    if (run.ended()) continue;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      rows[r].trials[k] = trials.size();
      for (const std::uint64_t right : trials) rows[r].right[k] += right >> r & 1;
    }
  }
  if (rows.front().trials[0] == 0) rows.clear();
  return rows;
}

Verdict verdictOf(const std::vector<TwoViewRuleRow>& rows) {
  const auto best = std::max_element(rows.begin(), rows.end(), [](const TwoViewRuleRow& a, const TwoViewRuleRow& b) {
    return a.average() < b.average();
  });
  const double right = rows.front().average();
  return Verdict::yes(fmt::format(
      "The default rule chooses the right model in {:.1f} % of the trials{}. Nothing is promised of the rules.",
      100 * right,
      best->average() > right ? fmt::format(", and '{}' in {:.1f} %", best->rule, 100 * best->average())
                              : ", and no other rule in more"));
}

}  // namespace liestat::experiments
