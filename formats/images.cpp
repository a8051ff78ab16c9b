#include <formats/images.hpp>

#include <formats/detail/rows.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <dlfcn.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <system_error>

namespace liestat {
namespace {

namespace fs = std::filesystem;

/// More digits are no number of an image but a stamp.
constexpr std::size_t most_digits = 9, stamp_digits = 16, largest_stamp_digits = 19;

bool isDigit(char c) { return c >= '0' && c <= '9'; }

std::vector<std::string> filesOf(const std::vector<std::string>& paths) {
  std::vector<std::string> files;
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
      std::error_code dangling;
      if (entry.is_regular_file(dangling) && isImageName(entry.path().string())) files.push_back(entry.path().string());
    }
    if (error) throw InputError(path, 0, "it can't be read: " + error.message());
    if (files.empty()) throw InputError(path, 0, "there is no image in it", "two or more (png, jpg, pgm, tif, bmp …)");
  }
  std::sort(files.begin(), files.end(), naturallyBefore);
  const auto twice = std::adjacent_find(files.begin(), files.end());
  if (twice != files.end()) throw InputError(*twice, 0, "it is given twice", "it once");
  return files;
}

/// The number at the end of a file's name; the digits before it are part of the rest.
struct Numbered {
  std::string rest, digits;
};
Numbered numberOf(const std::string& file) {
  const std::string stem = fs::path(file).stem().string();
  std::size_t end = stem.size();
  while (end > 0 && !isDigit(stem[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && isDigit(stem[begin - 1])) --begin;
  return {(fs::path(file).parent_path() / (stem.substr(0, begin) + "#" + stem.substr(end))).string(),
          stem.substr(begin, end - begin)};
}

/// Times of names that are nanoseconds; throws InputError for a gap in numbers.
std::vector<double> timesOfNames(const std::vector<std::string>& files) {
  std::vector<Numbered> names;
  names.reserve(files.size());
  for (const std::string& file : files) names.push_back(numberOf(file));
  const auto all = [&](auto&& holds) { return std::all_of(names.begin(), names.end(), holds); };
  if (all([](const Numbered& n) {
        return n.digits.size() >= stamp_digits && n.digits.size() <= largest_stamp_digits;
      })) {
    std::vector<double> times;
    times.reserve(names.size());
    for (const Numbered& n : names) times.push_back(1e-9 * static_cast<double>(std::stoull(n.digits)));
    return times;
  }
  if (!all([&](const Numbered& n) {
        return n.rest == names[0].rest && !n.digits.empty() && n.digits.size() <= most_digits;
      })) {
    return {};
  }
  long step = 0;
  for (std::size_t i = 1; i < names.size(); ++i) {
    const long here = std::stol(names[i].digits), apart = here - std::stol(names[i - 1].digits);
    if (step == 0 || apart < step) step = apart;
  }
  for (std::size_t i = 1; i < names.size(); ++i) {
    const long before = std::stol(names[i - 1].digits), apart = std::stol(names[i].digits) - before;
    if (apart == step) continue;
    const long first = before + step, last = before + apart - step;
    throw InputError(files[i], 0,
                     first == last ? fmt::format("image {} is missing before it", first)
                                   : fmt::format("images {} to {} are missing before it", first, last),
                     "numbers without a gap, or --times");
  }
  return {};
}

std::vector<double> timesIn(const std::string& path, const std::vector<std::string>& files) {
  const TextFile file = loadText(path);
  LineReader first(file.text);
  std::vector<std::string_view> fields;
  if (first.next()) splitFields(first.line(), Separator::comma, fields);
  std::vector<double> times;
  std::vector<std::size_t> lines;
  if (!fields.empty() && (detail::isNanoseconds(fields[0]) || fields[0].substr(0, 1) == "#")) {
    std::map<std::string, std::pair<double, std::size_t>> by_name;
    LineReader reader(file.text);
    while (reader.next()) {
      splitFields(reader.line(), Separator::comma, fields);
      if (fields.empty() || fields[0].substr(0, 1) == "#") continue;
      if (fields.size() < 2 || !detail::isNanoseconds(fields[0])) {
        throw InputError(file.name, reader.number(), "no stamp and name", "nanoseconds,file");
      }
      by_name[std::string(fields[1])] = {1e-9 * static_cast<double>(std::stoull(std::string(fields[0]))),
                                         reader.number()};
    }
    for (const std::string& image : files) {
      const auto found = by_name.find(fs::path(image).filename().string());
      if (found == by_name.end()) throw InputError(image, 0, "it has no time in " + file.name, "a row with its name");
      times.push_back(found->second.first);
      lines.push_back(found->second.second);
    }
  } else {
    const NumericTable table = parseTable(file.text, file.name, {"t_s"});
    for (std::size_t row = 0; row < table.rows(); ++row) {
      times.push_back(table(row, 0));
      lines.push_back(table.line(row));
    }
    if (!files.empty() && times.size() != files.size()) {
      throw InputError(file.name, 0, fmt::format("{} times of {} images", times.size(), files.size()), "one each");
    }
  }
  for (std::size_t i = 1; i < times.size(); ++i) {
    detail::requireAscending(times[i - 1], lines[i - 1], times[i], file.name, lines[i]);
  }
  return times;
}

}  // namespace

bool isImageName(const std::string& path) {
  static const std::set<std::string> known = {".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                              ".tiff", ".pgm", ".ppm",  ".pnm", ".webp"};
  std::string ending = fs::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return known.count(ending) > 0;
}

bool naturallyBefore(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (isDigit(a[i]) && isDigit(b[j])) {
      while (i < a.size() && a[i] == '0') ++i;
      while (j < b.size() && b[j] == '0') ++j;
      std::size_t m = i, n = j;
      while (m < a.size() && isDigit(a[m])) ++m;
      while (n < b.size() && isDigit(b[n])) ++n;
      if (m - i != n - j) return m - i < n - j;
      if (const int order = a.compare(i, m - i, b, j, n - j); order != 0) return order < 0;
      i = m, j = n;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

ImageRecording imagesOf(const std::vector<std::string>& paths, const std::string& times) {
  for (const std::string& path : paths) {
    std::error_code none;
    if (!fs::exists(path, none)) throw InputError(path, 0, "there is no such file or folder");
  }
  ImageRecording recording;
  if (paths.size() == 1 && !fs::is_directory(paths[0]) && !isImageName(paths[0])) {
    recording.video = paths[0];
    if (!times.empty()) recording.times = timesIn(times, {});
    return recording;
  }
  recording.files = filesOf(paths);
  if (recording.files.size() < 2) throw InputError(recording.files[0], 0, "there is one image", "two or more");
  recording.times = times.empty() ? timesOfNames(recording.files) : timesIn(times, recording.files);
  return recording;
}

const ImageLibrary& imageLibrary(const std::string& user) {
  static const ImageLibrary* library = nullptr;
  if (library != nullptr) return *library;
  constexpr const char* name = "liestat_opencv.so";
  std::vector<fs::path> places;
  std::error_code error;
  Dl_info self;
  if (dladdr(reinterpret_cast<const void*>(&imageLibrary), &self) != 0) {
    places.push_back(fs::weakly_canonical(self.dli_fname, error).parent_path());
  }
  places.push_back(fs::read_symlink("/proc/self/exe", error).parent_path());
  for (const fs::path& place : places) {
    for (const char* beside : {".", "../lib/liestat", "../.."}) {
      const fs::path file = place / beside / name;
      if (!fs::is_regular_file(file, error)) continue;
      void* const module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
      if (module == nullptr)
        throw InputError(file.string(), 0, dlerror(), "OpenCV's libraries, as it was built with them");
      const auto open = reinterpret_cast<const ImageLibrary* (*)()>(dlsym(module, "liestat_image_library"));
      if (open == nullptr) throw InputError(file.string(), 0, "it is no module of liestat's");
      return *(library = open());
    }
  }
  throw InputError(user, 0, "this build reads no images",
                   "OpenCV when liestat is built (Debian and Ubuntu: libopencv-video-dev libopencv-imgcodecs-dev "
                   "libopencv-videoio-dev)");
}

ImageReader::ImageReader(const std::vector<std::string>& paths, const std::string& times, std::size_t every,
                         const std::string& user)
    : recording_(imagesOf(paths, times)), name_(paths[0]), times_(times), every_(every), time_(std::nan("")) {
  const ImageLibrary& library = imageLibrary(user);
  images_ = recording_.files.empty() ? library.openVideo(recording_.video) : library.openFiles(recording_.files);
  if (!images_)
    throw InputError(recording_.video, 0, "it is no video that can be read", "a video, a folder, or images");
}

bool ImageReader::reads(const std::string& path) const {
  std::error_code none;
  const auto is = [&](const std::string& file) { return fs::equivalent(file, path, none); };
  return is(recording_.video) || is(times_) || std::any_of(recording_.files.begin(), recording_.files.end(), is);
}

GreyView ImageReader::next() {
  GreyView image;
  bool more = true;
  for (std::size_t i = 1; taken_ > 0 && more && i < every_; ++i) more = images_->skip();
  if (more) image = images_->next();
  if (taken_ > 0) frame_ += every_;
  const std::string file = recording_.files.empty()           ? fmt::format("{}: frame {}", name_, frame_)
                           : frame_ < recording_.files.size() ? recording_.files[frame_]
                                                              : name_;
  if (more && !images_->fault().empty()) throw InputError(file, 0, images_->fault(), "an image");
  if (image.pixels == nullptr) {
    if (taken_ >= 2) return image;
    throw InputError(name_, 0, taken_ == 0 ? "there is no frame in it" : "there is one image", "two or more");
  }
  if (taken_++ == 0) width_ = image.width, height_ = image.height;
  if (image.width != width_ || image.height != height_) {
    throw InputError(file, 0, fmt::format("it has {} x {} pixels", image.width, image.height),
                     fmt::format("{} x {}, as the first one has", width_, height_));
  }
  double time = images_->time();
  if (!recording_.times.empty()) {
    if (frame_ >= recording_.times.size()) {
      throw InputError(times_, 0, fmt::format("there are {} times and more frames", recording_.times.size()),
                       "a time a frame");
    }
    time = recording_.times[frame_];
  }
  // Some containers have no stamps.
  if (taken_ > 1 && !(time > time_) && !std::isnan(time)) {
    throw InputError(file, 0, "its stamp does not ascend", "--times with a time for each frame");
  }
  time_ = time;
  return image;
}

}  // namespace liestat
