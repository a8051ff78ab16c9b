#include <formats/evo_result.hpp>

#include <formats/result_zip.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace liestat {
namespace {

using Json = nlohmann::ordered_json;

std::string textOf(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; }

/// The fields of a described result that are numbers.
struct JsonFields {
  Json json = Json::object();

  JsonFields& operator()(const char* field, double value, const char* = "", const char* = "") {
    json[field] = value;
    return *this;
  }
};

const char* wordsOfRelation(PoseRelation relation) {
  switch (relation) {
    case PoseRelation::full:
      return "full transformation";
    case PoseRelation::trans_part:
      return "translation part";
    case PoseRelation::rot_part:
      return "rotation part";
    case PoseRelation::angle_deg:
      return "rotation angle in degrees";
    case PoseRelation::angle_rad:
      return "rotation angle in radians";
    case PoseRelation::point_distance:
      return "point distance";
    case PoseRelation::point_distance_error_ratio:
      return "point distance error ratio";
  }
  return "";
}

/// evo's words after the title, or others where evo has no such alignment.
std::string alignmentTitle(const EvaluationOptions& how, AlignmentModel model) {
  std::string title = model == AlignmentModel::se3      ? "\n(with SE(3) Umeyama alignment)"
                      : model == AlignmentModel::sim3   ? "\n(with Sim(3) Umeyama alignment)"
                      : model == AlignmentModel::scale  ? "\n(scale corrected)"
                      : model == AlignmentModel::origin ? ""
                      : model == AlignmentModel::posyaw ? "\n(with position and yaw alignment)"
                                                        : "\n(not aligned)";
  if (how.n_to_align > 0 && model != AlignmentModel::none && model != AlignmentModel::origin) {
    title += fmt::format(" (aligned poses: {})", how.n_to_align);
  }
  if (model == AlignmentModel::origin) title += "\n(with origin alignment)";
  if (how.project_to_plane) title += fmt::format("\n(projected to {} plane)", name(*how.project_to_plane));
  if (how.association.rule != AssociationRule::nearest) title += "\n(reference interpolated)";
  return title;
}
/// A float as Python prints it, frames as integers.
std::string deltaOf(const RelativeOptions& r) {
  if (r.unit == DeltaUnit::frames) return fmt::format("{}", static_cast<long long>(r.delta));
  const std::string text = fmt::format("{}", r.delta);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}
const char* deltaWord(DeltaUnit unit) {
  switch (unit) {
    case DeltaUnit::frames:
      return "frames";
    case DeltaUnit::degrees:
      return "deg";
    case DeltaUnit::radians:
      return "rad";
    case DeltaUnit::meters:
      return "m";
  }
  return "";
}

/// The title, which names the unit in which the errors are first computed.
std::string titleOf(const TrajectoryEvaluation& e, const EvaluationOptions& how, bool relative) {
  const char* const part = wordsOfRelation(how.pose_relation);
  if (!relative) return fmt::format("APE w.r.t. {} ({}){}", part, e.ape_unit, alignmentTitle(how, e.alignment.model));
  return fmt::format("RPE w.r.t. {} ({})\nfor delta = {} ({}) using {} pairs{}", part, e.rpe_unit,
                     deltaOf(how.relative), deltaWord(how.relative.unit),
                     how.relative.all_pairs ? "all" : "consecutive", alignmentTitle(how, e.alignment.model));
}

std::vector<double> distancesAlong(const std::vector<SE3d>& poses) {
  std::vector<double> along(poses.size(), 0);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    along[i] = along[i - 1] + (poses[i].translation() - poses[i - 1].translation()).norm();
  }
  return along;
}

/// Eight numbers a line, single blanks, no blank at the end and no blank last line: what evo reads.
std::string tumText(const std::vector<double>& times, const std::vector<SE3d>& poses) {
  std::string text;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d t = poses[i].translation();
    const Eigen::Vector4d q = poses[i].so3().params();
    text +=
        fmt::format("{}{} {} {} {} {} {} {} {}", i > 0 ? "\n" : "", times[i], t[0], t[1], t[2], q[0], q[1], q[2], q[3]);
  }
  return text;
}

}  // namespace

std::string evoResult(const TrajectoryEvaluation& e, const EvaluationOptions& how, EvoErrors wanted,
                      const EvoNames& names, const std::string& path) {
  const bool relative = wanted == EvoErrors::rpe;
  const std::vector<double>& errors = relative ? e.rpe : e.ape;
  std::vector<std::size_t> rows;
  if (relative) {
    rows.push_back(0);
    for (const auto& [i, j] : e.pairs) rows.push_back(j);
  } else {
    for (std::size_t i = 0; i < e.matched.size(); ++i) rows.push_back(i);
  }
  std::vector<SE3d> reference, estimate;
  std::vector<double> times, seconds;
  for (const std::size_t i : rows) {
    reference.push_back(e.matched.reference.mean(i));
    estimate.push_back(e.alignment(e.matched.estimate.mean(i)));
    times.push_back(e.times[i]), seconds.push_back(e.times[i] - e.times[rows.front()]);
  }
  const std::vector<double> along_reference = distancesAlong(reference), along_estimate = distancesAlong(estimate);
  // Values begin at the second pose of each pair, trajectories at the first pose.
  const auto tail = [relative](const std::vector<double>& list) {
    return npyArray(std::span(list).subspan(relative && !list.empty() ? 1 : 0));
  };
  // Two files of one name would be one trajectory.
  const std::string est_name = names.estimate == names.reference ? names.estimate + "_estimate" : names.estimate;
  Json info;
  info["title"] = titleOf(e, how, relative);
  info["ref_name"] = names.reference, info["est_name"] = est_name;
  info["label"] = fmt::format("{} ({})", relative ? "RPE" : "APE", relative ? e.rpe_unit : e.ape_unit);
  JsonFields stats;
  describe(stats, relative ? e.rpe_statistics : e.ape_statistics);
  std::vector<ZipMember> members{{"info.json", textOf(info)}, {"stats.json", textOf(stats.json)}};
  members.push_back({"error_array.npy", npyArray(errors)});
  members.push_back({"seconds_from_start.npy", tail(seconds)});
  members.push_back({"timestamps.npy", tail(times)});
  members.push_back({"distances_from_start.npy", tail(along_reference)});
  members.push_back({"distances.npy", tail(along_estimate)});
  if (e.alignment.model != AlignmentModel::none) {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> sim3 = e.alignment.transform.matrix();
    sim3.topLeftCorner<3, 3>() *= e.alignment.scale;
    members.push_back({"alignment_transformation_sim3.npy", npyArray(std::span(sim3.data(), 16), 4)});
  }
  if (!relative && e.consistency.ok) {
    std::vector<double> nees;
    for (const PoseError& p : e.consistency.errors) nees.push_back(p.nees);
    members.push_back({"nees.npy", npyArray(nees)});
    std::string csv = "t";
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) csv += fmt::format(",cov_{}{}", i, j);
    }
    for (std::size_t k = 0; k < e.matched.size(); ++k) {
      csv += fmt::format("\n{}", e.times[k]);
      const NoisyPoses::Covariance V = e.matched.estimate.covariance(k);
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) csv += fmt::format(",{}", V(i, j));
      }
    }
    members.push_back({"covariances.csv", csv + "\n"});
  }
  members.push_back({names.reference + ".tum", tumText(times, reference)});
  members.push_back({est_name + ".tum", tumText(times, estimate)});
  return zipArchive(members, path);
}

}  // namespace liestat
