// ZIP archives whose members are stored, not compressed, and arrays in NumPy's format: evo's result files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// A file in an archive.
struct ZipMember {
  std::string name;
  std::string content;
};

/// An archive of members in their order (PKWARE's APPNOTE 6.3: method 0, without ZIP64, so below 4 GiB and 65,535 members;
/// throws InputError above). Dated 1980-01-01, so that equal content gives equal bytes.
std::string zipArchive(const std::vector<ZipMember>& members, const std::string& path);

/// The members of an archive of stored members; throws InputError for what is none. For tests, and to read back what was
/// written.
std::vector<ZipMember> readZipArchive(std::string_view archive, const std::string& path);

/// A list of numbers, or with columns > 1 a matrix row by row, in NumPy's format 1.0 ('<f8').
std::string npyArray(std::span<const double> values, std::size_t columns = 1);

/// CRC-32 of ISO 3309.
std::uint32_t crc32(std::string_view bytes);

}  // namespace liestat
