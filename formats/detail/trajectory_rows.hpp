// The rows of files of trajectories: what their readers share.
#pragma once

#include <formats/trajectory.hpp>

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

namespace liestat::detail {

/// A pose from position and quaternion (x y z w), whose norm is checked and counted in the trajectory. Throws InputError.
SE3d poseOf(const Eigen::Vector3d& position, const Eigen::Vector4d& xyzw, double norm_tolerance, Trajectory& trajectory,
            std::size_t line);

/// A number or `nan`, which stands for what is unknown. Anything else is an InputError that names the column.
double numberOrUnknown(std::string_view field, std::string_view column, const std::string& file, std::size_t line);

/// Appends the matrix of a layout's numbers; of full36 both triangles must agree. Throws InputError.
void appendCovariance(Trajectory& trajectory, const Convention& layout, std::span<const double> numbers,
                      std::size_t line);

/// The conventions of messages that say "unknown": NaN or -1 as the first number, or zeros throughout, for the whole
/// matrix; a variance of `unmeasured` or more for that component.
void applySentinels(std::vector<double>& numbers, CovarianceLayout layout, double unmeasured, Trajectory& trajectory);

/// Adds a time, in seconds as text. Throws InputError if it is no finite number.
void appendTime(Trajectory& trajectory, std::string_view seconds, std::size_t line);

/// Seconds as text from units of 10^-decimals s as text (nanoseconds: 9), and the other way round to whole units, digit by
/// digit. The latter cuts off what is smaller than the unit and says so by `exact`.
std::string secondsOfTicks(std::string_view ticks, std::size_t decimals);
std::string ticksOfSeconds(std::string_view seconds, std::size_t decimals, bool& exact);
/// True if a field is a whole number of zero or more.
bool isWhole(std::string_view field);

/// Adds a time in whole units of 10^-decimals s. Throws InputError if it is not a whole number.
void appendTicks(Trajectory& trajectory, std::string_view ticks, std::size_t decimals, std::size_t line);

/// Reads `# key: value` lines of a liestat-covariance header into a convention; nothing if the text has no such header.
/// Throws InputError for a header that is incomplete or has unknown values.
std::optional<Convention> statedConvention(std::string_view text, const std::string& file);
/// The lines of such a header.
std::string conventionHeader(const Convention& convention);

/// Reads the side file of a trajectory into it: rows are matched by identical times, or by their number where the
/// trajectory has no times. Throws InputError.
void readSideFile(const std::string& path, Trajectory& trajectory, const TrajectoryOptions& options);

}  // namespace liestat::detail
