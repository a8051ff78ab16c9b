#include <formats/recording.hpp>

#include <formats/calibration.hpp>
#include <formats/detail/rows.hpp>
#include <formats/images.hpp>
#include <formats/input_error.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>

namespace liestat {
namespace {

/// CSV files of recordings, by their first lines.
enum class RecordedKind { other, readings, times, truth };

RecordedKind recordedKind(const std::string& path) {
  std::string head(4096, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  LineReader lines(head);
  if (!lines.next()) return RecordedKind::other;
  std::vector<std::string_view> fields;
  splitFields(lines.line(), Separator::comma, fields);
  if (detail::isNanoseconds(fields[0])) {
    const std::size_t all = fields.size();
    if (all == 2 && isImageName(std::string(fields[1]))) return RecordedKind::times;
    if (!detail::looksNumeric(fields)) return RecordedKind::other;
    // ns, rates and forces; ns, position, quaternion, velocity, and EuRoC's biases.
    return all == 7 ? RecordedKind::readings : all >= 11 ? RecordedKind::truth : RecordedKind::other;
  }
  const auto has = [&](std::string_view name) { return std::find(fields.begin(), fields.end(), name) != fields.end(); };
  if (has("wx") && has("ax")) return RecordedKind::readings;
  return has("t_s") && !has("track") ? RecordedKind::times : RecordedKind::other;
}

/// The folders and the files of a folder, by their natural order; none of what can't be read.
struct FolderContents {
  std::vector<std::string> folders, files;
  bool images = false;

  explicit FolderContents(const std::string& folder) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
      std::error_code dangling;
      const std::string path = entry.path().string();
      if (entry.is_directory(dangling)) folders.push_back(path);
      if (!entry.is_regular_file(dangling)) continue;
      if (isImageName(path)) {
        images = true;
      } else {
        files.push_back(path);
      }
    }
    if (error) throw InputError(folder, 0, "it can't be read: " + error.message());
    std::sort(folders.begin(), folders.end(), naturallyBefore);
    std::sort(files.begin(), files.end(), naturallyBefore);
  }
};

std::string nameOf(const std::string& path) { return std::filesystem::path(path).filename().string(); }
std::string parentOf(const std::string& path) { return std::filesystem::path(path).parent_path().string(); }
bool endsWith(const std::string& text, std::string_view end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// Chooses the images: the camera of that name, or the first.
void chooseImages(FoundRecording& found, const std::vector<std::pair<std::string, std::string>>& cameras,
                  const std::string& wanted) {
  if (cameras.empty()) return;
  auto chosen = std::find_if(cameras.begin(), cameras.end(), [&](const auto& c) { return c.first == wanted; });
  if (chosen == cameras.end()) chosen = cameras.begin();
  found.camera = chosen->first, found.images = chosen->second;
  std::vector<std::string> others;
  for (const auto& camera : cameras) {
    if (camera.first != chosen->first) others.push_back(camera.first);
  }
  if (!others.empty() && found.camera != wanted) {
    found.notes.push_back(fmt::format("images of {} are passed over: --camera chooses", joined(others, ", ")));
  }
}

/// One of several files of a kind: that in the folder of the name, else the only one.
std::string chooseFile(FoundRecording& found, const std::vector<std::string>& files, const std::string& folder,
                       const std::string& what) {
  for (const std::string& file : files) {
    if (nameOf(parentOf(file)).rfind(folder, 0) == 0) return file;
  }
  if (files.size() == 1) return files[0];
  if (files.empty()) return {};
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const std::string& file : files) names.push_back(found.shortly(file));
  found.notes.push_back(fmt::format("none of {} files of {} is used: {}", files.size(), what, joined(names, ", ")));
  return {};
}

void chooseCalibration(FoundRecording& found, const std::vector<std::string>& files) {
  const std::string own = nameOf(found.images) == "data" ? parentOf(found.images) : found.images;
  const auto isOwn = [&](const std::string& file) {
    const std::string folder = parentOf(file);
    return nameOf(file) == "sensor.yaml" && (folder == own || (!found.imu.empty() && folder == parentOf(found.imu)));
  };
  std::vector<std::string> order = files;
  std::stable_partition(order.begin(), order.end(), isOwn);
  std::string camera_from, imu_from;
  for (const std::string& file : order) {
    const bool is_own = isOwn(file);
    // Other cameras, and what stands beside: a truth, a laser.
    if (!is_own && nameOf(file) == "sensor.yaml") continue;
    Calibration contents;
    try {
      contents = readCalibration({file});
    } catch (const InputError& error) {
      if (is_own) throw;
      if (error.line() > 0) {
        found.notes.push_back(
            fmt::format("{} is passed over: line {}: {}", found.shortly(file), error.line(), error.found()));
      }
      continue;
    }
    const bool camera = !contents.cameras.empty(), imu = contents.imu.has_value();
    if ((camera && !camera_from.empty()) || (imu && !imu_from.empty())) {
      const bool twice = camera && !camera_from.empty();
      found.notes.push_back(fmt::format("{} is passed over: {} has {}, too", found.shortly(file),
                                        found.shortly(twice ? camera_from : imu_from),
                                        twice ? "a camera" : "the noise"));
      continue;
    }
    if (camera) camera_from = file;
    if (imu) imu_from = file;
    found.calibration.push_back(file);
  }
}

}  // namespace

std::string FoundRecording::shortly(const std::string& path) const {
  return path.size() > folder.size() + 1 && path.rfind(folder + "/", 0) == 0 ? path.substr(folder.size() + 1) : path;
}

FoundRecording findRecording(const std::string& folder, const std::string& camera) {
  namespace fs = std::filesystem;
  std::error_code error;
  const bool there = fs::exists(folder, error);
  if (!there || !fs::is_directory(folder, error)) {
    throw InputError(folder, 0, there ? "it is no folder" : "there is no such folder",
                     "a recording: mav0 of EuRoC, or images and a CSV of readings");
  }
  FoundRecording found;
  found.folder = folder;
  while (found.folder.size() > 1 && found.folder.back() == '/') found.folder.pop_back();
  const std::string inner = found.folder + "/mav0";
  const bool has_inner = fs::is_directory(inner, error);
  const FolderContents top(has_inner ? inner : found.folder);

  std::vector<std::pair<std::string, std::string>> cameras;  // names, folders
  std::vector<std::string> files = top.files;
  if (has_inner) {
    const FolderContents outer(found.folder);
    files.insert(files.end(), outer.files.begin(), outer.files.end());
    for (const std::string& sub : outer.folders) {
      if (sub == inner) continue;
      const FolderContents contents(sub);
      files.insert(files.end(), contents.files.begin(), contents.files.end());
    }
  }
  if (top.images)
    cameras.emplace_back(nameOf(fs::absolute(found.folder, error).lexically_normal().string()), found.folder);
  for (const std::string& sub : top.folders) {
    const FolderContents contents(sub);
    files.insert(files.end(), contents.files.begin(), contents.files.end());
    if (contents.images) cameras.emplace_back(nameOf(sub), sub);
    if (std::find(contents.folders.begin(), contents.folders.end(), sub + "/data") == contents.folders.end()) continue;
    const FolderContents data(sub + "/data");
    if (data.images) cameras.emplace_back(nameOf(sub), sub + "/data");
  }
  chooseImages(found, cameras, camera);

  std::vector<std::string> readings, times, truths, yaml;
  for (const std::string& file : files) {
    if (endsWith(file, ".yaml") || endsWith(file, ".yml")) yaml.push_back(file);
    if (!endsWith(file, ".csv") && !endsWith(file, ".txt")) continue;
    const RecordedKind kind = recordedKind(file);
    if (kind == RecordedKind::readings) readings.push_back(file);
    if (kind == RecordedKind::times) times.push_back(file);
    if (kind == RecordedKind::truth) truths.push_back(file);
  }
  found.imu = chooseFile(found, readings, "imu0", "readings");
  found.truth = chooseFile(found, truths, "state_groundtruth_estimate0", "truth");
  // The times of other cameras are none of this one's.
  std::erase_if(times, [&](const std::string& file) {
    return std::any_of(cameras.begin(), cameras.end(),
                       [&](const auto& c) { return c.first != found.camera && nameOf(parentOf(file)) == c.first; });
  });
  if (!found.images.empty()) found.image_times = chooseFile(found, times, found.camera, "times of images");
  chooseCalibration(found, yaml);
  return found;
}

}  // namespace liestat
