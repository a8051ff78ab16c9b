#include <experiments/two_view_pairs.hpp>

#include <fusion/two_view/contradictions.hpp>
#include <fusion/two_view/models.hpp>
#include <stats/repeated_extraction.hpp>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace liestat::experiments {
namespace {

using Search = Hierarchy<Eigen::Vector4d, TwoViewMotionModel>;
using Extraction = RepeatedExtraction<Eigen::Vector4d, TwoViewMotionModel>;
constexpr double infinity = std::numeric_limits<double>::infinity();

double median(std::vector<double> values) {
  if (values.empty()) return infinity;
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// Twice as many hypotheses as by default are refined: where the noise is larger than it is said to be, their estimates
/// differ.
HierarchyOptions optionsOf(std::uint64_t seed) { return {.seed = seed, .refined_hypotheses = 10}; }

/// A pair with coordinates centred and in units of the longer side of the image.
struct Normalised {
  const TwoViewPair* pair;
  double unit;
  std::vector<Eigen::Vector4d> all, kept, validation;
  TwoViewImages images;

  Normalised(const TwoViewPair& of, const TwoViewPairsValidation& how) : pair(&of), unit(of.size.maxCoeff()) {
    const Eigen::Vector4d centre = (of.corner + 0.5 * of.size).replicate<2, 1>();
    const auto normalise = [&](const std::vector<Eigen::Vector4d>& pixels, std::vector<Eigen::Vector4d>& to) {
      for (const Eigen::Vector4d& m : pixels) to.emplace_back((m - centre) / unit);
    };
    normalise(of.matches, all), normalise(of.validation, validation);
    images = {{how.sigma / unit, how.sigma / unit}, of.size / unit};
    for (const std::size_t i : independentMatches(all, images.noise, how.contradicted)) kept.push_back(all[i]);
  }
  double pixels(double squared_error) const { return std::sqrt(squared_error) * unit; }
  TwoViewModels models() const { return twoViewModels(images, TwoViewCalibration::uncalibrated); }
  TwoViewModels homographies() const {
    TwoViewModels list;
    for (const auto& model : models()) {
      if (model->equations() == 2) list.push_back(model);
    }
    return list;
  }
};

/// The homography of three matches under an epipolar geometry: H = A - e' (M⁻¹ b)ᵀ (R. Hartley and A. Zisserman, Multiple
/// View Geometry, result 13.6).
Eigen::Matrix3d homographyOfThree(const Eigen::Matrix3d& F, std::span<const Eigen::Vector4d* const> matches) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU);
  const Eigen::Vector3d epipole = svd.matrixU().col(2);
  Eigen::Matrix3d A, M;
  for (int k = 0; k < 3; ++k) A.col(k) = epipole.cross(F.col(k));
  Eigen::Vector3d b;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector4d& m = *matches[static_cast<std::size_t>(k)];
    const Eigen::Vector3d x(m[0], m[1], 1), y(m[2], m[3], 1), across = y.cross(epipole);
    M.row(k) = x.transpose();
    b[k] = y.cross(A * x).dot(across) / across.squaredNorm();
  }
  const Eigen::Vector3d v = M.partialPivLu().solve(b);
  return A - epipole * v.transpose();
}

/// True if five of the seven matches that made F are on one plane (O. Chum, T. Werner and J. Matas, Two-view geometry
/// estimation unaffected by a dominant plane, CVPR 2005): the planes of five triplets are enough to look at.
bool isDegenerate(const Eigen::Matrix3d& F, const std::vector<Eigen::Vector4d>& sample, const MatchNoise& noise) {
  constexpr std::size_t triplets[5][3] = {{0, 1, 2}, {3, 4, 5}, {0, 1, 6}, {3, 4, 6}, {2, 5, 6}};
  const double threshold = -2 * std::log(0.01);  // that χ² of two degrees of freedom exceeds in one of a hundred cases
  for (const auto& triplet : triplets) {
    const Eigen::Vector4d* three[] = {&sample[triplet[0]], &sample[triplet[1]], &sample[triplet[2]]};
    const Eigen::Matrix3d H = homographyOfThree(F, three);
    std::size_t on = 0, on_negative = 0;
    for (const Eigen::Vector4d& m : sample) {
      on += homographyError(H, m, noise) < threshold;
      on_negative += homographyError(-H, m, noise) < threshold;
    }
    if (std::max(on, on_negative) >= 5) return true;
  }
  return false;
}

struct ChoiceRun {
  std::array<char, 32> chosen{};  ///< the model's name
  bool right = false, degenerate = false;
  double homography_inliers = 0, fundamental_inliers = 0, far = 0, explained = 0, allowed = 0;
  double homography_cost = 0, fundamental_cost = 0, validation_error = infinity;
};

ChoiceRun runChoice(const Normalised& pair, std::uint64_t seed) {
  const HierarchyOptions options = optionsOf(seed);
  Search search(pair.models(), options);
  const std::vector<Search::Id> ids = search.add(pair.kept);
  while (search.iterate()) {
  }
  const std::size_t h = search.find("homography"), f = search.find("fundamental");
  const auto &H = search.state(h), &F = search.state(f);
  const bool planar = pair.pair->family == PairFamily::homogr;
  ChoiceRun run;
  search.models()[search.best()]->name().copy(run.chosen.data(), run.chosen.size() - 1);
  run.right = search.best() == (planar ? h : f);
  run.homography_inliers = static_cast<double>(H.inliers.size());
  run.fundamental_inliers = static_cast<double>(F.inliers.size());
  if (H.hasEstimate() && F.hasEstimate()) {
    ModelFit fit_h{0, 0, 8}, fit_f{0, 0, 7};
    std::size_t far = 0, explained = 0;
    const double guard = std::clamp(F.excess_noise, 1.0, max_excess_noise);
    for (std::size_t i = 0; i < H.errors.size(); ++i) {
      const bool in_f = F.errors[i] < F.threshold, is_far = !(H.errors[i] <= guard * H.threshold);
      far += is_far, explained += is_far && in_f;
      if (!in_f || !(H.errors[i] < H.threshold)) continue;
      fit_h.chi2 += H.errors[i], fit_h.equations += 2;
      fit_f.chi2 += F.errors[i], fit_f.equations += 1;
    }
    const auto& model = *search.models()[f];
    run.far = static_cast<double>(far), run.explained = static_cast<double>(explained);
    run.allowed = static_cast<double>(options.choice.support.explained(far, model.freedomBeyond(*search.models()[h]),
                                                                       model.equations(), model.chance(F.threshold)));
    run.homography_cost = fit_h.normalised(), run.fundamental_cost = fit_f.normalised();
  }
  if (F.hypothesis && F.sample.size() == 7) {
    std::vector<Eigen::Vector4d> sample;
    for (const Search::Id id : F.sample) {
      sample.push_back(pair.kept[static_cast<std::size_t>(std::find(ids.begin(), ids.end(), id) - ids.begin())]);
    }
    run.degenerate = isDegenerate(F.hypothesis->matrix, sample, pair.images.noise);
  }
  std::size_t judged = planar ? h : f;
  if (!search.state(judged).hasEstimate()) judged = search.best();
  if (search.state(judged).hasEstimate() && search.models()[judged]->equations() == (planar ? 2 : 1)) {
    const Eigen::Matrix3d& M = search.state(judged).estimate.parameter.matrix;
    std::vector<double> distances;
    for (const Eigen::Vector4d& m : pair.validation) {
      distances.push_back(pair.pixels(planar ? homographyError(M, m, {}) : epipolarError(M, m, {})));
    }
    run.validation_error = median(distances);
  }
  return run;
}

/// Which structure explains each match best, counted from 1; 0: none.
std::vector<std::size_t> ownersOf(const Normalised& pair, const std::vector<Extraction::Structure>& structures) {
  std::vector<std::size_t> owners(pair.all.size(), 0);
  std::vector<double> least(pair.all.size(), infinity);
  for (std::size_t k = 0; k < structures.size(); ++k) {
    for (std::size_t i = 0; i < pair.all.size(); ++i) {
      const double e = homographyError(structures[k].estimate.parameter.matrix, pair.all[i], pair.images.noise);
      if (e < structures[k].state.threshold && e < least[i]) owners[i] = k + 1, least[i] = e;
    }
  }
  return owners;
}

std::vector<Extraction::Structure> extract(const Normalised& pair, std::uint64_t seed, std::size_t most) {
  RepeatedExtractionOptions options{.hierarchy = optionsOf(seed)};
  options.max_structures = std::min(most, options.max_structures);
  Extraction extraction(pair.homographies(), pair.kept, options);
  while (extraction.iterate()) {
  }
  return extraction.structures();
}

struct StructuresRun {
  double found = 0, wrong = 0, purity = 0, coverage = 0, first_wrong = 0;
};

StructuresRun compareLabels(const Normalised& pair, const std::vector<Extraction::Structure>& structures) {
  const std::vector<std::size_t>& labels = pair.pair->labels;
  const std::vector<std::size_t> owners = ownersOf(pair, structures);
  const std::size_t n_labels = *std::max_element(labels.begin(), labels.end());
  Eigen::MatrixXd overlaps =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(structures.size()), static_cast<Eigen::Index>(n_labels));
  for (std::size_t i = 0; i < owners.size(); ++i) {
    if (owners[i] == 0 || labels[i] == 0) continue;
    overlaps(static_cast<Eigen::Index>(owners[i]) - 1, static_cast<Eigen::Index>(labels[i]) - 1) += 1;
  }
  const std::vector<std::size_t> assignment = bestAssignment(overlaps);
  StructuresRun run;
  double inliers = 0, labelled = 0, right = 0;
  for (std::size_t i = 0; i < owners.size(); ++i) {
    // A structure without a label of its own is wrong wherever it is.
    const std::size_t given = owners[i] == 0 ? 0 : assignment[owners[i] - 1] + 1;
    const bool same = given == labels[i];
    run.wrong += !same;
    inliers += owners[i] != 0, labelled += labels[i] != 0, right += same && labels[i] != 0;
  }
  run.found = static_cast<double>(structures.size());
  run.purity = inliers > 0 ? right / inliers : 0;
  run.coverage = labelled > 0 ? right / labelled : 0;
  return run;
}

StructuresRun runStructures(const Normalised& pair, std::uint64_t seed) {
  StructuresRun run = compareLabels(pair, extract(pair, seed, std::numeric_limits<std::size_t>::max()));
  run.first_wrong = compareLabels(pair, extract(pair, seed, 1)).wrong;
  return run;
}

struct PlaneRun {
  double inliers = 0, right = 0, label_error = infinity;
  bool supported = false;
};

PlaneRun runPlane(const Normalised& pair, std::uint64_t seed) {
  const auto structures = extract(pair, seed, 1);
  PlaneRun run;
  if (structures.empty()) return run;
  run.supported = true;
  const auto& structure = structures.front();
  std::vector<double> distances;
  for (std::size_t i = 0; i < pair.all.size(); ++i) {
    const double e = homographyError(structure.estimate.parameter.matrix, pair.all[i], pair.images.noise);
    const bool in = e < structure.state.threshold, labelled = pair.pair->labels[i] != 0;
    run.inliers += in, run.right += in && labelled;
    if (labelled) distances.push_back(pair.pixels(e) * pair.images.noise.first);
  }
  run.label_error = median(distances);
  return run;
}

/// The median over runs of one of their numbers.
template <class Run>
double medianOf(const std::vector<Run>& runs, double Run::*number) {
  std::vector<double> values;
  values.reserve(runs.size());
  for (const Run& run : runs) values.push_back(run.*number);
  return median(values);
}

PairChoice summarise(const Normalised& pair, const std::vector<ChoiceRun>& runs) {
  PairChoice row;
  row.family = pair.pair->family, row.name = pair.pair->name;
  row.tentative = pair.all.size(), row.kept = pair.kept.size(), row.runs = runs.size();
  for (const ChoiceRun& run : runs) {
    row.right += run.right, row.degenerate += run.degenerate;
    const auto known =
        std::find_if(row.chosen.begin(), row.chosen.end(), [&](const auto& c) { return c.first == run.chosen.data(); });
    if (known == row.chosen.end()) {
      row.chosen.emplace_back(run.chosen.data(), 1);
    } else {
      ++known->second;
    }
  }
  std::stable_sort(row.chosen.begin(), row.chosen.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  row.homography_inliers = medianOf(runs, &ChoiceRun::homography_inliers);
  row.fundamental_inliers = medianOf(runs, &ChoiceRun::fundamental_inliers);
  row.far = medianOf(runs, &ChoiceRun::far), row.explained = medianOf(runs, &ChoiceRun::explained);
  row.allowed = medianOf(runs, &ChoiceRun::allowed);
  row.homography_cost = medianOf(runs, &ChoiceRun::homography_cost);
  row.fundamental_cost = medianOf(runs, &ChoiceRun::fundamental_cost);
  row.validation_error = medianOf(runs, &ChoiceRun::validation_error);
  return row;
}

PairStructures summarise(const Normalised& pair, const std::vector<StructuresRun>& runs) {
  PairStructures row;
  row.name = pair.pair->name, row.matches = pair.all.size();
  std::vector<std::size_t> labels = pair.pair->labels;
  std::sort(labels.begin(), labels.end());
  labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
  row.labelled = static_cast<std::size_t>(std::count_if(labels.begin(), labels.end(), [](auto l) { return l != 0; }));
  row.found = medianOf(runs, &StructuresRun::found), row.wrong = medianOf(runs, &StructuresRun::wrong);
  row.purity = medianOf(runs, &StructuresRun::purity), row.coverage = medianOf(runs, &StructuresRun::coverage);
  row.first_wrong = medianOf(runs, &StructuresRun::first_wrong);
  return row;
}

PairPlane summarise(const Normalised& pair, const std::vector<PlaneRun>& runs) {
  PairPlane row;
  row.name = pair.pair->name, row.matches = pair.all.size(), row.runs = runs.size();
  for (const std::size_t label : pair.pair->labels) row.labelled += label != 0;
  for (const PlaneRun& run : runs) row.supported += run.supported;
  row.inliers = medianOf(runs, &PlaneRun::inliers), row.right = medianOf(runs, &PlaneRun::right);
  row.label_error = medianOf(runs, &PlaneRun::label_error);
  return row;
}

/// The promises: shares of the twelve pairs of each kind, rounded in favour of the promise where there are others.
std::vector<Promise> checksOf(const TwoViewPairsResult& result) {
  std::vector<Promise> checks;
  const auto add = [&](std::string text, double value, double bound, bool at_least) {
    checks.push_back({std::move(text), at_least ? value >= bound : value <= bound, {}, value, bound});
  };
  double n[2] = {0, 0}, right[2] = {0, 0}, beyond[2] = {0, 0}, by_rule[2] = {0, 0};
  for (const PairChoice& row : result.choices) {
    const std::size_t k = row.family == PairFamily::homogr ? 0 : 1;
    n[k] += 1, right[k] += row.chosenRight();
    by_rule[k] += (2 * row.degenerate > row.runs) == (k == 0);
    beyond[k] += !(row.validation_error <= (k == 0 ? 2.0 : 1.3));
  }
  if (n[0] > 0) {
    add("homogr: pairs with a homography", right[0], std::ceil(7 * n[0] / 12), true);
    add("homogr: pairs with a validation error beyond 2.0 px", beyond[0], std::ceil(n[0] / 12), false);
  }
  if (n[1] > 0) {
    add("kusvod2: pairs with a fundamental matrix", right[1], std::ceil(8 * n[1] / 12), true);
    add("kusvod2: pairs with a validation error beyond 1.3 px", beyond[1], std::ceil(n[1] / 6), false);
  }
  for (const std::size_t k : {std::size_t{0}, std::size_t{1}}) {
    if (n[k] == 0) continue;
    checks.push_back({std::string(name(static_cast<PairFamily>(k))) + ": pairs that DEGENSAC's rule tells right",
                      {},
                      {},
                      by_rule[k]});
  }
  if (n[0] > 0 && n[1] > 0) {
    add("both: pairs with the right choice", right[0] + right[1], std::ceil(2 * (n[0] + n[1]) / 3), true);
  }
  for (const PairStructures& row : result.structures) {
    if (row.name == "bonython") add("bonython: wrong labels", row.first_wrong, 4, false);
    if (row.name == "unionhouse") add("unionhouse: wrong labels", row.first_wrong, 6, false);
  }
  return checks;
}

}  // namespace

std::vector<std::size_t> bestAssignment(const Eigen::MatrixXd& overlaps) {
  // The Hungarian method with potentials (H. Kuhn 1955; J. Munkres 1957), rows one after the other, on costs that are
  // squared up with zeros. Places count from 1, 0 is where a path begins.
  const std::size_t rows = static_cast<std::size_t>(overlaps.rows()),
                    columns = static_cast<std::size_t>(overlaps.cols());
  const std::size_t n = std::max(rows, columns);
  const auto cost = [&](std::size_t i, std::size_t j) {
    if (i > rows || j > columns) return 0.0;
    return -overlaps(static_cast<Eigen::Index>(i) - 1, static_cast<Eigen::Index>(j) - 1);
  };
  std::vector<double> u(n + 1, 0), v(n + 1, 0);
  std::vector<std::size_t> row_of(n + 1, 0), before(n + 1, 0);
  for (std::size_t i = 1; i <= n; ++i) {
    std::vector<double> slack(n + 1, infinity);
    std::vector<char> used(n + 1, 0);
    std::size_t column = 0;
    row_of[0] = i;
    do {
      used[column] = 1;
      std::size_t next = 0;
      double delta = infinity;
      for (std::size_t j = 1; j <= n; ++j) {
        if (used[j]) continue;
        const double reduced = cost(row_of[column], j) - u[row_of[column]] - v[j];
        if (reduced < slack[j]) slack[j] = reduced, before[j] = column;
        if (slack[j] < delta) delta = slack[j], next = j;
      }
      for (std::size_t j = 0; j <= n; ++j) {
        if (used[j]) {
          u[row_of[j]] += delta, v[j] -= delta;
        } else {
          slack[j] -= delta;
        }
      }
      column = next;
    } while (row_of[column] != 0);
    for (; column != 0; column = before[column]) row_of[column] = row_of[before[column]];
  }
  std::vector<std::size_t> assignment(rows, columns);
  for (std::size_t j = 1; j <= columns; ++j) {
    if (row_of[j] >= 1 && row_of[j] <= rows && cost(row_of[j], j) < 0) assignment[row_of[j] - 1] = j - 1;
  }
  return assignment;
}

TwoViewPairsResult validateTwoViewPairs(const std::vector<TwoViewPair>& pairs, const TwoViewPairsValidation& validation,
                                        const RunProgress& progress) {
  TwoViewPairsResult result;
  std::vector<CellSize> cells;
  for (const TwoViewPair& pair : pairs)
    cells.push_back({validation.run.trials, static_cast<double>(pair.matches.size())});
  CellRun run(validation.run, cells, progress);
  for (const TwoViewPair& pair : pairs) {
    if (runStopped()) break;
    const Normalised normalised(pair, validation);
    const auto add = [&](auto& rows, const auto& runOnce) {
      // All runs of a pair or none: a pair takes seconds.
      const auto runs =
          run.outcomes([&](std::uint64_t k) { return runOnce(normalised, validation.run.seed + k); }, true);
      if (!run.ended()) rows.push_back(summarise(normalised, runs));
    };
    if (pair.family == PairFamily::adelaide) {
      add(result.structures, runStructures);
    } else if (pair.family == PairFamily::evd) {
      add(result.planes, runPlane);
    } else {
      add(result.choices, runChoice);
    }
  }
  result.checks = checksOf(result);
  return result;
}

Judgement judgementOf(const TwoViewPairsResult& result) {
  return {.promises = result.checks, .where = "of promises", .false_alarm = 0};
}

}  // namespace liestat::experiments
