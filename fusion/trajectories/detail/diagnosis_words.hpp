// Definitions of fusion/convention_diagnosis_types.hpp: names, words and verdicts.
#pragma once

#include <fusion/convention_diagnosis_types.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>

namespace liestat {

LIESTAT_FUSION_INLINE std::string describe(const Convention& c) {
  static const std::map<Perturbation, const char*> frames{
      {Perturbation::right, "along the body's axes (right)"},
      {Perturbation::left, "about the world's origin (left)"},
      {Perturbation::body_axes, "along the body's axes"},
      {Perturbation::world_axes, "along the world's axes (ROS, fixed axes)"},
      {Perturbation::world_body_axes, "position along the world's axes, rotation along the body's"},
      {Perturbation::roll_pitch_yaw, "position along the world's axes, roll, pitch, yaw"},
      {Perturbation::yaw_pitch_roll, "position along the world's axes, yaw, pitch, roll"},
      {Perturbation::rotation_vector, "position along the world's axes, rotation vector"},
      {Perturbation::world_axes_reversed, "along the world's axes, rotation reversed"},
      {Perturbation::transposed_axes, "axes rotated by the transposed rotation"}};
  std::string text = c.order == CovarianceOrder::translation_rotation ? "translation first, " : "rotation first, ";
  text += frames.at(c.perturbation);
  text += c.unit == RotationUnit::radian         ? ", rad"
          : c.unit == RotationUnit::half_angle   ? ", half angles"
          : c.unit == RotationUnit::double_angle ? ", double angles"
                                                 : ", degrees";
  text += c.content == CovarianceContent::covariance    ? ", covariance"
          : c.content == CovarianceContent::information ? ", information"
                                                        : ", sigmas";
  return text;
}

LIESTAT_FUSION_INLINE const char* name(DiagnosisVerdict verdict) {
  switch (verdict) {
    case DiagnosisVerdict::identified:
      return "identified";
    case DiagnosisVerdict::undecidable:
      return "undecidable";
    case DiagnosisVerdict::inconsistent:
      return "inconsistent";
    case DiagnosisVerdict::none:
      return "none";
  }
  return "";
}

namespace detail {

struct FaultText {
  const char *name, *words;
};
inline const FaultText& faultText(MatrixFault fault) {
  static const std::array<FaultText, 24> texts{{
      {"none", "no fault"},
      {"cross_sign", "the cross block has the wrong sign"},
      {"cross_transposed", "the cross block is transposed: the blocks were exchanged without it"},
      {"off_diagonal_half", "the off-diagonal entries are half as large as they should be: a triangle was symmetrised"},
      {"off_diagonal_twice", "the off-diagonal entries are doubled: both triangles were added"},
      {"factor", "the numbers are those of the Cholesky factor, not of the covariance"},
      {"factor_averaged", "the numbers are those of a Cholesky factor, symmetrised"},
      {"factor_transposed", "the factor was transposed: L'L was written instead of L L'"},
      {"information_factor", "the numbers are the square root of the information matrix"},
      {"squared", "variances were taken for sigmas and squared once more"},
      {"matrix_squared", "the covariance was multiplied by itself"},
      {"inverse_diagonal", "only the diagonal was inverted"},
      {"reversed", "the six coordinates are in reverse order"},
      {"axes_ned_enu", "x and y are exchanged and z is reversed: NED axes were read as ENU"},
      {"axes_optical", "the axes are those of a camera (z forward), read as those of a body (x forward)"},
      {"axes_from_optical", "the axes are those of a body (x forward), read as those of a camera (z forward)"},
      {"axes_y_up", "y and z are exchanged: y-up axes were read as z-up"},
      {"lever_arm_sign", "the adjoint was applied with the wrong sign of its lever arm"},
      {"adjoint_inverse", "the adjoint of the inverse pose was applied"},
      {"adjoint_transposed", "the transposed adjoint was applied"},
      {"previous_row", "each pose has the matrix of the row before it"},
      {"next_row", "each pose has the matrix of the row after it"},
      {"diagonal_alone", "the off-diagonal entries are not those of the errors"},
      {"blocks_alone", "the cross block is not that of the errors"},
  }};
  return texts[static_cast<std::size_t>(fault)];
}

}  // namespace detail

LIESTAT_FUSION_INLINE const char* describe(MatrixFault fault) { return detail::faultText(fault).words; }
LIESTAT_FUSION_INLINE const char* name(MatrixFault fault) { return detail::faultText(fault).name; }
LIESTAT_FUSION_INLINE const char* name(DiagnosisMode mode) {
  constexpr std::array names{"diagnosis", "chain", "plan"};
  return names[static_cast<std::size_t>(mode)];
}

namespace detail {

inline std::string scaleWord(const char* block, double k, double sigma, bool rotation) {
  const auto near = [&](double value) { return std::abs(std::log(k / value)) < 3 * sigma; };
  const std::string part(block);
  if (rotation) {
    if (near(0.25)) return part + " block: a quarter of what it should be: half angles, or sigmas twice too small";
    if (near(4)) return part + " block: four times what it should be: double angles, or sigmas twice too large";
    if (near(3282.8063500117437)) return part + " block: in degrees";
    if (near(1 / 3282.8063500117437)) return part + " block: divided by (180/pi) squared: radians converted twice";
  } else {
    if (near(1e6)) return part + " block: in millimetres";
    if (near(1e4)) return part + " block: in centimetres";
    if (near(1e-6)) return part + " block: in kilometres";
  }
  return part + " block: " + (k > 1 ? "inflated (underconfident)" : "too small (overconfident)") + " by a factor of " +
         significant(k > 1 ? k : 1 / k, 3) + " in variance";
}

}  // namespace detail

LIESTAT_FUSION_INLINE std::vector<std::string> ScaleProfile::words() const {
  const double of_t = std::abs(std::log(translation)) / relative_sigma,
               of_r = std::abs(std::log(rotation)) / relative_sigma;
  if (std::abs(std::log(translation / rotation)) < 3 * std::sqrt(2.) * relative_sigma &&
      std::log(translation) * std::log(rotation) > 0 && std::max(of_t, of_r) > 3) {
    const double k = std::sqrt(translation * rotation);
    return {std::string("both blocks: ") + (k > 1 ? "inflated (underconfident)" : "too small (overconfident)") +
            " by a factor of " + significant(k > 1 ? k : 1 / k, 3) + " in variance"};
  }
  std::vector<std::string> words;
  if (of_t > 3) words.push_back(detail::scaleWord("translation", translation, relative_sigma, false));
  if (of_r > 3) words.push_back(detail::scaleWord("rotation", rotation, relative_sigma, true));
  return words;
}

LIESTAT_FUSION_INLINE std::vector<std::string> MatrixStructure::words() const {
  std::vector<std::string> lines;
  const auto count = [](std::size_t k) { return std::to_string(k) + (k == 1 ? " matrix is " : " matrices are "); };
  if (asymmetric > 0)
    lines.push_back(count(asymmetric) + "not symmetric: a factor, one column or one triangle was written");
  if (indefinite > 0) {
    lines.push_back(count(indefinite) +
                    "not positive definite: too few digits, a row dropped without its off-diagonals, "
                    "or entries at wrong indices");
  }
  std::string zeros;
  for (std::size_t i = 0; i < 6; ++i) {
    if (zero_variance[i]) zeros += (zeros.empty() ? "" : ", ") + std::to_string(i + 1);
  }
  if (!zeros.empty())
    lines.push_back("the variances of coordinates " + zeros + " are zero in every row: wrong indices, or not filled");
  if (rank_one && zeros.empty()) lines.push_back("the matrices have rank one: a vector of sigmas was multiplied out");
  if (blocks_only) lines.push_back("the cross block is unknown: only the two blocks are tested");
  if (constant) lines.push_back("all matrices are the same: a constant, not the filter's covariance");
  if (isotropic_blocks) {
    lines.push_back("both blocks are multiples of the identity: they say nothing about axes");
  } else if (diagonal) {
    lines.push_back("all matrices are diagonal: correlations were dropped, or never known");
  } else if (no_cross && !blocks_only) {
    lines.push_back("the cross block is zero: correlations of position and rotation were dropped, or never known");
  }
  return lines;
}

LIESTAT_FUSION_INLINE std::vector<Convention> CovarianceDiagnosis::accepted() const {
  if (diagnosis) return diagnosis->accepted;
  return chain ? chain->accepted : std::vector<Convention>();
}

LIESTAT_FUSION_INLINE std::optional<Convention> CovarianceDiagnosis::best() const {
  if (const std::vector<Convention> list = accepted(); !list.empty()) return list.front();
  if (!diagnosis || diagnosis->fits.empty() || std::isinf(diagnosis->fits.front().log_likelihood)) return std::nullopt;
  return diagnosis->fits.front().convention;
}

LIESTAT_FUSION_INLINE Verdict CovarianceDiagnosis::verdict() const {
  if (mode == DiagnosisMode::plan) {
    const auto n = static_cast<double>(structure.n);
    const auto decided = std::count_if(plan.begin(), plan.end(), [n](const PlanRow& row) {
      return row.equal.empty() && row.poses > 0 && row.poses <= n;
    });
    return Verdict::yes("With its " + std::to_string(structure.n) + " " + what + " this file tells " +
                        std::to_string(decided) + " of " + std::to_string(plan.size()) +
                        " conventions from all others.");
  }
  if (!diagnosis) {
    if (!chain) return Verdict::none("UNDECIDABLE: nothing was diagnosed");
    if (!chain->is_chain || chain->accepted.size() != 1) return Verdict::none("UNDECIDABLE: " + chain->reason);
    return Verdict::yes("identified: " + describe(chain->accepted.front()));
  }
  std::string word = name(diagnosis->verdict);
  if (misfit.found()) {
    std::vector<std::string> notes = diagnosis->notes;
    notes.insert(notes.begin(), word + ": " + diagnosis->reason);
    const std::string text =
        "MISFIT: " + misfit.sentence() + "; until that is undone the errors say nothing of covariances";
    return diagnosis->verdict == DiagnosisVerdict::inconsistent || diagnosis->verdict == DiagnosisVerdict::none
               ? Verdict::no(text, notes)
               : Verdict::none(text, notes);
  }
  if (diagnosis->verdict == DiagnosisVerdict::identified) return Verdict::yes(word + ": " + diagnosis->reason);
  std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::toupper(c); });
  const std::string text = word + ": " + diagnosis->reason;
  return diagnosis->verdict == DiagnosisVerdict::undecidable ? Verdict::none(text, diagnosis->notes)
                                                             : Verdict::no(text, diagnosis->notes);
}

}  // namespace liestat
