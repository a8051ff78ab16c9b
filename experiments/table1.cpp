#include <experiments/table1.hpp>

#include <experiments/vi_init_errors.hpp>
#include <fusion/init/closed_form.hpp>
#include <experiments/closed_form_cases.hpp>
#include <experiments/scene_readings.hpp>
#include <stats/inference.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <string_view>

namespace liestat::experiments {
namespace {

using S = FusionStatus;
constexpr double bearing_noise = 1. / 450;

/// The outcome for a scene.
struct Recognised {
  S status = S::bad_input;
  SolutionCount solutions = SolutionCount::infinite;
  bool null_right = true, wrong = false;
};

/// True if the second solution, a scaled copy of the first, has its features in front of the camera; known only for a
/// constant acceleration and for three images.
std::optional<bool> secondInFront(const ClosedFormCase& c, const InertialScene& scene) {
  const SceneMotion motion = c.scene.motion;
  if (c.bias || c.null != 1 || !c.solved || c.scene.layout == SceneLayout::ahead) return {};
  if (c.scene.images != 3 && motion != SceneMotion::constant_acceleration && motion != SceneMotion::free_fall)
    return {};
  const auto& images = scene.window.images;
  const std::size_t last = images.size() - 1;
  return secondSolutionScale(meanSpecificForce(images[last / 2], images[last]), scene.gravity) > 0;
}

/// Few images in one plane may leave a null line that the sphere of gravity cuts: once or twice in front of the camera.
SolutionCount countOf(const ClosedFormResult& r) {
  if (r.status != S::coplanar || r.solutions.empty()) return solutionsOf(r.status);
  const auto in_front = std::count_if(r.solutions.begin(), r.solutions.end(),
                                      [](const ClosedFormSolution& s) { return s.negative_depths == 0; });
  return in_front > 1 ? SolutionCount::two : SolutionCount::one;
}

Recognised recognise(const ClosedFormCase& c, CounterRng& rng) {
  const InertialScene scene(c.scene, rng());
  const ClosedFormResult r = solveClosedForm(scene.window, {.closed_form = {.estimate_bias = c.bias}});
  Recognised found{.status = r.status, .solutions = countOf(r), .null_right = r.null_dimension == c.null};
  found.wrong = !found.null_right || (r.status != c.status && r.status != c.or_status);
  if (c.solved) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const ClosedFormSolution& s : r.solutions) {
      nearest = std::min(nearest, (s.velocity - scene.velocity).norm() / std::max(1., scene.velocity.norm()) +
                                      (s.gravity - scene.gravity).norm() / InertialScene::g);
    }
    // Two solutions that nearly meet keep half of the digits.
    found.wrong = found.wrong || !(nearest < 1e-6);
  }
  if (const auto two = secondInFront(c, scene)) {
    found.wrong = found.wrong || found.solutions != (*two ? SolutionCount::two : SolutionCount::one);
  }
  return found;
}

Recognised recognise(const NoisyClosedFormCase& c, CounterRng& rng) {
  InertialScene scene(c.scene, rng());
  measure(scene, vi_init_imu, rng);
  scene.addNoise(bearing_noise, rng);
  const ClosedFormResult r =
      solveClosedForm(scene.window, {.bearing_noise = bearing_noise,
                                     .prior = {.accelerometer_sigma = c.bias_sigma},
                                     .closed_form = {.estimate_bias = c.bias, .singular_values = false}});
  Recognised found{.status = r.status, .solutions = countOf(r)};
  found.wrong = std::find(c.expected.begin(), c.expected.end(), r.status) == c.expected.end();
  return found;
}

template <class Case>
void fill(Table1Row& row, const Case& c, std::uint64_t seed, CellRun& run) {
  row.images = c.scene.images;
  row.features = c.scene.features;
  row.bias = c.bias;
  const std::vector<Recognised> all = run.outcomes([&](std::uint64_t number) {
    CounterRng rng(seed, number);
    return recognise(c, rng);
  });
  row.scenes = all.size();
  for (const Recognised& r : all) {
    row.null_right += r.null_right;
    row.wrong += r.wrong;
    ++row.solutions[static_cast<std::size_t>(r.solutions)];
    const auto found =
        std::find_if(row.statuses.begin(), row.statuses.end(), [&](const auto& s) { return s.first == r.status; });
    if (found == row.statuses.end()) {
      row.statuses.emplace_back(r.status, 1);
    } else {
      ++found->second;
    }
  }
  std::stable_sort(row.statuses.begin(), row.statuses.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
}

}  // namespace

SolutionCount solutionsOf(FusionStatus status) {
  switch (status) {
    case S::ok:
      return SolutionCount::one;
    case S::ambiguous:
    case S::double_root:
    case S::mirror_gravity:
      return SolutionCount::two;
    default:
      return SolutionCount::infinite;
  }
}

const std::vector<Table1Entry>& table1Entries() {
  // The letters of a case's corrections stand behind a bar.
  const auto cases = [](std::initializer_list<std::string_view> texts) {
    std::vector<std::pair<std::string, std::string>> list;
    for (const std::string_view text : texts) {
      const std::size_t bar = text.find(" | ");
      list.emplace_back(text.substr(0, bar), bar == text.npos ? std::string_view() : text.substr(bar + 3));
    }
    return list;
  };
  static const std::vector<Table1Entry> entries{
      {"varying acceleration, not coplanar; n = 4, N ≥ 2; n ≥ 5", "unique",
       cases({"n=4", "n=5, one feature", "general", "many", "straight | h", "planar motion | h", "planar features | h",
              "collinear features | h", "no rotation", "lever arm"}),
       cases({"general", "general, one second", "general, five images", "no rotation"})},
      {"varying acceleration, not coplanar; n = 3, N ≥ 2; n = 4, N = 1", "two",
       cases({"n=3, two features | a", "n=3 | a", "n=4, one feature | b"}), cases({"three images | a"})},
      {"constant acceleration, not 0, not coplanar; n = 3, N ≥ 2; n ≥ 4", "two",
       cases({"constant acceleration, n=3 | a", "constant acceleration, n=4, one feature | a",
              "constant acceleration | a", "free fall | a"}),
       cases({"constant acceleration | a", "level acceleration | c", "free fall | a"})},
      {"no acceleration, any layout; any n, any N", "infinite",
       cases({"constant velocity, n=3 | d", "constant velocity | d", "constant velocity, n=4, one feature | e",
              "constant velocity, n=7, one feature | e", "at rest, n=3 | f", "at rest | f", "at rest, one feature"}),
       cases({"constant velocity | d", "constant velocity, one second | d", "constant velocity, four seconds | d",
              "constant velocity, one feature | e", "at rest | f"})},
      {"any motion, any layout; n ≤ 2; n = 3, N = 1", "infinite",
       cases({"n=2, one feature", "n=2", "n=3, one feature"}), cases({"two images", "three images, one feature"})},
      {"features and positions coplanar (the text's exception)", "not full rank",
       cases({"coplanar, n=3, two features", "coplanar, n=4, one feature", "coplanar, n=5, one feature | g",
              "coplanar, n=3, three features | ga", "coplanar, n=4 | g", "coplanar, n=6, one feature | g",
              "straight, n=4, one feature | i", "straight, n=5, one feature | i", "straight, n=6, one feature | i"}),
       cases({"coplanar, one feature | g"})},
      {"features where they do not help (not in the paper)", "", cases({"straight at a feature | j"}),
       cases({"straight at a feature | j", "features 1e3 times farther | k", "features 1e6 times farther | k"})},
      {"with the accelerometer's bias (section 4, which counts no solutions)", "",
       cases({"bias, n=3, one feature | l", "bias, n=3 | l", "bias, n=4, one feature | l", "bias, n=4 | l",
              "bias, n=5, one feature | l", "bias, n=5", "bias, n=6, one feature", "bias", "bias, one axis | m",
              "bias, no rotation | n", "bias, constant acceleration | a", "bias, constant velocity | d"}),
       cases({"bias", "bias, one axis | m", "bias, one axis, no prior | m", "bias, no rotation | n",
              "bias, constant velocity | d"})},
  };
  return entries;
}

const std::vector<Table1Correction>& table1Corrections() {
  static const std::vector<Table1Correction> list{
      {'a', true,
       "the second solution is the same scene scaled, and in front of the camera only if the (mean) specific force "
       "is larger than g; else one"},
      {'b', false, "the second solution is not a scaled copy; it is in front of the camera in some 40 % of the scenes"},
      {'c', true, "an acceleration at a right angle to gravity: the two solutions meet in a double root"},
      {'d', true, "only the scale is free: gravity and the direction of V are unique"},
      {'e', true, "with one feature gravity is not determined either"},
      {'f', true, "at rest V = 0 and gravity are known, and each depth is free"},
      {'g', true,
       "coplanar layouts lose rank only with few images: n = 3, N = 2; n = 4 and 5, N = 1. Beyond, it is harmless"},
      {'h', false,
       "what moves or lies in a line or plane is as general, unless features and positions share the plane"},
      {'i', false, "one feature and a motion along a line always share a plane: unique from n = 6 on"},
      {'j', false, "the depth of a feature on the line of motion is free, and nothing else"},
      {'k', false, "the metric part of far features is lost in noise"},
      {'l', false, "with the bias two images more are needed"},
      {'m', true,
       "rotation about one axis: gravity and its mirror image, with biases that differ; the bias's prior decides"},
      {'n', false, "without rotation the bias can't be told from a shift of gravity: the answer rests on its prior"},
  };
  return list;
}

std::vector<Table1Row> recogniseTable1(const RunSize& size, const RunProgress& progress) {
  const auto& entries = table1Entries();
  std::vector<CellSize> sizes;
  for (const Table1Entry& entry : entries) {
    sizes.insert(sizes.end(), entry.exact.size(), {size.trials, 1});
    sizes.insert(sizes.end(), entry.noisy.size(), {size.trials, 9});
  }
  CellRun run(size, sizes, progress);
  const double false_alarm =
      run_false_alarm / static_cast<double>(closedFormCases().size() + noisyClosedFormCases().size());
  std::vector<Table1Row> rows;
  // The next case; `allowed` of its scenes may come out otherwise.
  const auto add = [&](std::size_t e, const auto& cases, const auto& wanted, bool noisy, const auto& expect) {
    const auto c = std::find_if(cases.begin(), cases.end(), [&](const auto& one) { return one.name == wanted.first; });
    if (c == cases.end()) return;
    Table1Row row;
    row.entry = e, row.name = wanted.first, row.corrections = wanted.second, row.noisy = noisy;
    const double allowed = expect(row, *c);
    fill(row, *c, size.seed, run);
    if (run.ended()) return;
    row.passed = binomialSurvival(row.wrong, row.scenes, allowed) >= false_alarm;
    rows.push_back(std::move(row));
  };
  for (std::size_t e = 0; e < entries.size(); ++e) {
    for (const auto& wanted : entries[e].exact) {
      add(e, closedFormCases(), wanted, false, [](Table1Row& row, const ClosedFormCase& c) {
        row.null = c.null;
        row.expected = {c.status};
        if (c.or_status != c.status) row.expected.push_back(c.or_status);
        return table1_near_another_case;
      });
    }
    for (const auto& wanted : entries[e].noisy) {
      add(e, noisyClosedFormCases(), wanted, true, [](Table1Row& row, const NoisyClosedFormCase& c) {
        row.expected = c.expected;
        return 1 - c.share;
      });
    }
  }
  return rows;
}

Judgement judgementOf(const std::vector<Table1Row>& rows) {
  Judgement judgement{.promises = {}, .where = "of the corrected table"};
  for (const Table1Row& row : rows) {
    judgement.promises.push_back(
        {fmt::format("{}, {}", row.name, row.noisy ? "with noise" : "exact"), row.passed,
         fmt::format("{} of {} scenes came out otherwise than the corrected table says", row.wrong, row.scenes),
         static_cast<double>(row.wrong)});
  }
  return judgement;
}

}  // namespace liestat::experiments
