// Images by OpenCV: a shared module that the program opens when a command needs images (formats/image_library.hpp), so
// that no other command loads OpenCV.
#include <fusion/targets/target_pose.hpp>
#include <fusion/tracking/images.hpp>

#ifdef LIESTAT_HAS_APRILTAG
#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
#endif
#ifdef LIESTAT_HAS_OPENCV
#include <opencv2/calib3d.hpp>
#endif
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <opencv2/videoio.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <utility>

namespace liestat {
namespace {

constexpr int window = 15, levels = 3;
/// Grey values to which the flow's images are brought, so that light that changes as a whole is no motion.
constexpr double flow_mean = 120, flow_deviation = 45, least_deviation = 4;
/// Share of the strongest corner's eigenvalue, a tenth of its contrast.
constexpr double quality = 0.01;

/// Grey values of 8 bits of an image of any kind.
class Grey {
 public:
  const std::string& fault() const { return fault_; }

  GreyView view(const cv::Mat& image) {
    fault_.clear();
    cv::Mat grey = image;
    if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    if (image.channels() == 4) cv::cvtColor(image, grey, cv::COLOR_BGRA2GRAY);
    if (grey.channels() != 1) return fail("it has " + std::to_string(grey.channels()) + " channels");
    if (grey.depth() != CV_8U) {
      if (scale_ == 0) {
        double largest = 0;
        cv::minMaxLoc(grey, nullptr, &largest);
        scale_ = largest > 0 ? 255 / largest : 1;
      }
      grey.convertTo(grey, CV_8U, scale_);
    }
    grey_ = grey;
    return {grey_.data, grey_.cols, grey_.rows, static_cast<std::ptrdiff_t>(grey_.step)};
  }
  GreyView fail(std::string why) {
    fault_ = std::move(why);
    return {};
  }

 private:
  cv::Mat grey_;
  double scale_ = 0;
  std::string fault_;
};

class Files : public ImageSequence {
 public:
  explicit Files(std::vector<std::string> files) : files_(std::move(files)) {}

  GreyView next() override {
    if (place_ == files_.size()) return {};
    try {
      const cv::Mat image = cv::imread(files_[place_++], cv::IMREAD_UNCHANGED);
      return image.empty() ? grey_.fail("it is no image that can be read") : grey_.view(image);
    } catch (const cv::Exception& error) {
      return grey_.fail("it is no image that can be read: " + error.err);
    }
  }
  bool skip() override { return place_ < files_.size() && ++place_ > 0; }
  double time() const override { return std::numeric_limits<double>::quiet_NaN(); }
  const std::string& fault() const override { return grey_.fault(); }

 private:
  std::vector<std::string> files_;
  std::size_t place_ = 0;
  Grey grey_;
};

class Video : public ImageSequence {
 public:
  explicit Video(cv::VideoCapture capture) : capture_(std::move(capture)) {}

  GreyView next() override {
    if (!skip()) return {};
    if (!capture_.retrieve(image_) || image_.empty()) return grey_.fail("a frame can't be decoded");
    return grey_.view(image_);
  }
  bool skip() override {
    if (!capture_.grab()) return false;
    // The stamp is that of the frame that was grabbed.
    time_ = capture_.get(cv::CAP_PROP_POS_MSEC) / 1000;
    return true;
  }
  double time() const override { return time_; }
  const std::string& fault() const override { return grey_.fault(); }

 private:
  cv::VideoCapture capture_;
  cv::Mat image_;
  Grey grey_;
  double time_ = std::numeric_limits<double>::quiet_NaN();
};

class Flow : public PointFlow {
 public:
  void take(const GreyView& image) override {
    const cv::Mat whole(image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels),
                        static_cast<std::size_t>(image.stride));
    cv::Scalar mean, deviation;
    cv::meanStdDev(whole, mean, deviation);
    const double gain = flow_deviation / std::max(deviation[0], least_deviation);
    whole.convertTo(last_, CV_8U, gain, flow_mean - gain * mean[0]);
    std::swap(before_, now_);
    cv::buildOpticalFlowPyramid(last_, now_, {window, window}, levels);
  }

  std::vector<Eigen::Vector2i> corners(const std::vector<Eigen::Vector2d>& taken, std::size_t most, double apart,
                                       int margin) override {
    cv::Mat mask = cv::Mat::zeros(last_.size(), CV_8U);
    if (mask.rows <= 2 * margin || mask.cols <= 2 * margin) return {};
    mask(cv::Rect(margin, margin, mask.cols - 2 * margin, mask.rows - 2 * margin)) = 255;
    for (const Eigen::Vector2d& t : taken) {
      cv::circle(mask, cv::Point2d(t.x(), t.y()), static_cast<int>(std::ceil(apart)), 0, cv::FILLED);
    }
    std::vector<cv::Point2f> found;
    cv::goodFeaturesToTrack(last_, found, static_cast<int>(most), quality, apart, mask, 7);
    std::vector<Eigen::Vector2i> pixels;
    for (const cv::Point2f& p : found) pixels.emplace_back(std::lround(p.x), std::lround(p.y));
    return pixels;
  }

  std::vector<Eigen::Vector2d> follow(const std::vector<Eigen::Vector2d>& from,
                                      const std::vector<Eigen::Vector2d>& guess, double apart) override {
    std::vector<cv::Point2f> start, end, back;
    for (const Eigen::Vector2d& p : from) start.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
    for (const Eigen::Vector2d& p : guess) end.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
    std::vector<unsigned char> there, here;
    std::vector<float> error;
    const cv::TermCriteria stop(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 12, 0.05);
    const int how = cv::OPTFLOW_USE_INITIAL_FLOW;
    cv::calcOpticalFlowPyrLK(before_, now_, start, end, there, error, {window, window}, levels, stop, how);
    // Back from the guess, too: the start itself would always look right.
    for (std::size_t i = 0; i < end.size(); ++i) {
      const Eigen::Vector2f moved = (guess[i] - from[i]).cast<float>();
      back.push_back(end[i] - cv::Point2f(moved.x(), moved.y()));
    }
    cv::calcOpticalFlowPyrLK(now_, before_, end, back, here, error, {window, window}, levels, stop, how);
    std::vector<Eigen::Vector2d> to;
    for (std::size_t i = 0; i < from.size(); ++i) {
      const bool good = there[i] && here[i] && std::hypot(back[i].x - start[i].x, back[i].y - start[i].y) <= apart;
      const double none = std::numeric_limits<double>::quiet_NaN();
      to.emplace_back(good ? end[i].x : none, good ? end[i].y : none);
    }
    return to;
  }

 private:
  cv::Mat last_;
  std::vector<cv::Mat> before_, now_;
};

#ifdef LIESTAT_HAS_OPENCV
std::vector<SeenTarget> findChessboard(const cv::Mat& image, const Target& target) {
  std::vector<cv::Point2f> corners;
  const cv::Size size(target.columns, target.rows);
  constexpr int how = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FILTER_QUADS;
  if (!cv::findChessboardCorners(image, size, corners, how)) return {};
  SeenTarget seen;
  for (const cv::Point2f& c : corners) seen.pixels.emplace_back(c.x, c.y);
  return {seen};
}
#endif

#ifdef LIESTAT_HAS_APRILTAG
struct TagFamily {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};
constexpr TagFamily tag_families[] = {{"16h5", tag16h5_create, tag16h5_destroy},
                                      {"25h9", tag25h9_create, tag25h9_destroy},
                                      {"36h10", tag36h10_create, tag36h10_destroy},
                                      {"36h11", tag36h11_create, tag36h11_destroy},
                                      {"Standard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
                                      {"Standard52h13", tagStandard52h13_create, tagStandard52h13_destroy}};

/// A family's tables take a moment to make, and are kept.
class TagDetector {
 public:
  explicit TagDetector(const TagFamily& family)
      : family_(family.create(), family.destroy), detector_(apriltag_detector_create(), apriltag_detector_destroy) {
    // Two wrong bits would find tags in noise.
    apriltag_detector_add_family_bits(detector_.get(), family_.get(), 1);
    detector_->quad_decimate = 1;
  }

  std::vector<SeenTarget> find(const cv::Mat& image) const {
    image_u8_t view{image.cols, image.rows, static_cast<int32_t>(image.step), image.data};
    const std::unique_ptr<zarray_t, void (*)(zarray_t*)> found(apriltag_detector_detect(detector_.get(), &view),
                                                               apriltag_detections_destroy);
    std::vector<SeenTarget> seen;
    for (int i = 0; i < zarray_size(found.get()); ++i) {
      apriltag_detection_t* tag = nullptr;
      zarray_get(found.get(), i, &tag);
      SeenTarget target;
      target.id = tag->id;
      // Its y points down in the tag, and its pixels have their centres at a half.
      for (const auto& [x, y] : {std::pair(-1., -1.), {1., -1.}, {1., 1.}, {-1., 1.}}) {
        const auto row = [&, x = x, y = y](unsigned k) {
          return MATD_EL(tag->H, k, 0) * x + MATD_EL(tag->H, k, 1) * y + MATD_EL(tag->H, k, 2);
        };
        target.pixels.emplace_back(row(0) / row(2) - 0.5, row(1) / row(2) - 0.5);
      }
      // The library would draw a tag, and Debian's hides the function that frees the image.
      const int side = family_->total_width, border = family_->width_at_border, first = (side - border) / 2;
      target.side = side, target.border = border;
      const auto at = [&](int x, int y) -> std::uint8_t& {
        return target.cells[static_cast<std::size_t>(y * side + x)];
      };
      target.cells.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 0);
      // A white ring: outside of a black border, or the border itself.
      const int low = first - (family_->reversed_border ? 0 : 1), high = side - 1 - low;
      for (int k = low; k <= high; ++k) at(k, low) = at(k, high) = at(low, k) = at(high, k) = 1;
      for (unsigned k = 0; k < family_->nbits; ++k) {
        const bool white = (family_->codes[tag->id] >> (family_->nbits - 1 - k) & 1) != 0;
        at(first + static_cast<int>(family_->bit_x[k]), first + static_cast<int>(family_->bit_y[k])) = white;
      }
      seen.push_back(std::move(target));
    }
    return seen;
  }

 private:
  std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)> family_;
  std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector_;
};

std::vector<SeenTarget> findTags(const cv::Mat& image, const Target& target, std::string& lacking) {
  static std::map<std::string, TagDetector> detectors;
  for (const TagFamily& family : tag_families) {
    if (target.family != family.name) continue;
    return detectors.try_emplace(family.name, family).first->second.find(image);
  }
  lacking = "the family " + target.family + " of tags is none of";
  for (const TagFamily& family : tag_families) lacking += std::string(" ") + family.name;
  return {};
}
#endif

class OpenCv : public ImageLibrary {
 public:
  std::vector<SeenTarget> findTargets(const GreyView& view, const Target& target, std::string& lacking) const override {
    const cv::Mat image(view.height, view.width, CV_8U, const_cast<std::uint8_t*>(view.pixels),
                        static_cast<std::size_t>(view.stride));
    if (target.kind == Target::Kind::april) {
#ifdef LIESTAT_HAS_APRILTAG
      return findTags(image, target, lacking);
#else
      lacking = "libapriltag-dev when liestat is built";
#endif
    } else {
#ifdef LIESTAT_HAS_OPENCV
      return findChessboard(image, target);
#else
      lacking = "libopencv-calib3d-dev when liestat is built";
#endif
    }
    return {};
  }
  std::unique_ptr<ImageSequence> openFiles(std::vector<std::string> files) const override {
    return std::make_unique<Files>(std::move(files));
  }
  std::unique_ptr<ImageSequence> openVideo(const std::string& file) const override {
    cv::VideoCapture capture;
    try {
      if (!capture.open(file)) return nullptr;
    } catch (const cv::Exception&) {
      return nullptr;
    }
    return std::make_unique<Video>(std::move(capture));
  }
  std::unique_ptr<PointFlow> pointFlow() const override { return std::make_unique<Flow>(); }
};

}  // namespace
}  // namespace liestat

/// The module's one function. One core is used, and decoders keep their remarks to themselves.
extern "C" __attribute__((visibility("default"))) const liestat::ImageLibrary* liestat_image_library() {
  cv::setNumThreads(1);
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  static const liestat::OpenCv library;
  return &library;
}
