#include <formats/detail/bag_messages.hpp>

#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstddef>
#include <utility>

namespace liestat::detail {
namespace {

constexpr std::pair<std::string_view, BagType> bag_types[] = {
    {"geometry_msgs/PoseStamped", BagType::pose},
    {"geometry_msgs/PoseWithCovarianceStamped", BagType::pose_with_covariance},
    {"nav_msgs/Odometry", BagType::odometry},
    {"geometry_msgs/TransformStamped", BagType::transform},
    {"tf2_msgs/TFMessage", BagType::transforms},
    {"tf/tfMessage", BagType::transforms},
    {"nav_msgs/Path", BagType::path},
    {"sensor_msgs/Imu", BagType::imu}};

/// The fields of a message in their order. ROS 1 packs them; in CDR each number stands at a multiple of its size (of 4
/// at most in version 2) from the end of the four bytes that name the byte order, and texts end with a zero.
class MessageFields {
 public:
  MessageFields(const BagTopic& topic, std::string_view data, const std::string& file, std::size_t number)
      : topic_(topic), data_(data), file_(file), number_(number), cdr_(topic.encoding == "cdr") {
    if (!cdr_) return;
    // 0 and 1 are plain CDR, 6 and 7 its version 2; odd ones are little-endian.
    const auto kind = data.size() < 4 || data[0] != 0 ? 255 : static_cast<unsigned char>(data[1]);
    if (kind != 0 && kind != 1 && kind != 6 && kind != 7) complain("has no plain CDR's first bytes");
    big_ = kind % 2 == 0, widest_ = kind < 2 ? 8 : 4, at_ = origin_ = 4;
  }

  std::uint32_t u32() { return static_cast<std::uint32_t>(whole(4)); }
  double f64() { return std::bit_cast<double>(whole(8)); }
  std::string text() {
    std::size_t n = u32();
    if (n > data_.size() - at_) complain("ends within a text");
    const std::string_view text = data_.substr(at_, n);
    at_ += n;
    return std::string(text.substr(0, cdr_ ? text.find('\0') : n));
  }
  template <int N>
  Eigen::Matrix<double, N, 1> vector() {
    Eigen::Matrix<double, N, 1> v;
    for (double& x : v) x = f64();
    return v;
  }
  std::vector<double> covariance() {
    std::vector<double> numbers(36);
    for (double& x : numbers) x = f64();
    return numbers;
  }
  /// A header: its stamp and frame.
  void header(std::int64_t& stamp_ns, std::string& frame) {
    if (!cdr_) u32();  // a counter
    const std::uint32_t seconds = u32(), nanoseconds = u32();
    const std::int64_t whole = cdr_ ? std::int64_t{static_cast<std::int32_t>(seconds)} : std::int64_t{seconds};
    if (whole < 0 || nanoseconds > 999999999) {
      complain(fmt::format("has the stamp {} s and {} ns", whole, nanoseconds));
    }
    stamp_ns = whole * 1000000000 + nanoseconds, frame = text();
  }
  BagPose pose(bool named_child) {
    BagPose p;
    header(p.stamp_ns, p.frame);
    if (named_child) p.child = text();
    p.position = vector<3>(), p.xyzw = vector<4>();
    return p;
  }
  /// Ends the message: a rest longer than padding is that of another type.
  void end() const {
    if (data_.size() - at_ > (cdr_ ? 7U : 0U)) complain(fmt::format("has {} bytes too many", data_.size() - at_));
  }
  [[noreturn]] void complain(const std::string& what) const {
    throw InputError(file_, number_, "the message " + what, topic_.type + " in " + topic_.encoding);
  }

 private:
  std::uint64_t whole(std::size_t size) {
    if (cdr_) {
      const std::size_t step = std::min(size, widest_);
      at_ += (step - (at_ - origin_) % step) % step;
    }
    if (at_ > data_.size() || size > data_.size() - at_) {
      complain(fmt::format("ends after {} bytes", data_.size()));
    }
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      value = value << 8U | static_cast<unsigned char>(data_[at_ + (big_ ? i : size - 1 - i)]);
    }
    at_ += size;
    return value;
  }

  const BagTopic& topic_;
  std::string_view data_;
  const std::string& file_;
  std::size_t number_, at_ = 0, origin_ = 0, widest_ = 8;
  bool cdr_, big_ = false;
};

}  // namespace

std::optional<BagType> bagTypeOf(std::string_view name) {
  for (const auto& [text, type] : bag_types) {
    if (text == name) return type;
  }
  return std::nullopt;
}

std::vector<BagPose> posesOf(const BagTopic& topic, std::string_view data, const std::string& file,
                             std::size_t number) {
  MessageFields fields(topic, data, file, number);
  std::vector<BagPose> poses;
  const std::optional<BagType> type = bagTypeOf(topic.type);
  if (type == BagType::transforms) {
    // No list is longer than its bytes: each has two texts and seven numbers.
    for (std::uint32_t n = fields.u32(); n > 0; --n) poses.push_back(fields.pose(true));
  } else if (type == BagType::path) {
    BagPose whole;
    fields.header(whole.stamp_ns, whole.frame);
    for (std::uint32_t n = fields.u32(); n > 0; --n) {
      poses.push_back(fields.pose(false));
      if (poses.back().frame.empty()) poses.back().frame = whole.frame;
    }
  } else {
    poses.push_back(fields.pose(type == BagType::odometry || type == BagType::transform));
    if (type == BagType::odometry || type == BagType::pose_with_covariance) {
      poses[0].covariance = fields.covariance();
    }
    if (type == BagType::odometry) fields.vector<6>(), fields.covariance();
  }
  fields.end();
  return poses;
}

BagImu imuOf(const BagTopic& topic, std::string_view data, const std::string& file, std::size_t number) {
  MessageFields fields(topic, data, file, number);
  BagImu imu;
  std::string frame;
  fields.header(imu.stamp_ns, frame);
  fields.vector<4>(), fields.vector<9>();
  imu.rate = fields.vector<3>(), imu.rate_covariance = fields.vector<9>();
  imu.force = fields.vector<3>(), imu.force_covariance = fields.vector<9>();
  fields.end();
  return imu;
}

}  // namespace liestat::detail
