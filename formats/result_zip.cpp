#include <formats/result_zip.hpp>

#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstring>
#include <limits>

namespace liestat {
namespace {

void putLittle(std::string& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>((value >> (8 * i)) & 0xff);
}
std::uint32_t takeLittle(std::string_view bytes, std::size_t at, int count) {
  std::uint32_t value = 0;
  for (int i = 0; i < count; ++i) {
    value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + static_cast<std::size_t>(i)])) << (8 * i);
  }
  return value;
}

constexpr std::uint32_t local_header = 0x04034b50, central_header = 0x02014b50, end_of_directory = 0x06054b50;
constexpr std::uint32_t first_of_1980 = 0x00210000;  // date in the high word, midnight in the low one

/// The fields that local and central header share, from the needed version on.
void putCommon(std::string& out, const ZipMember& member, std::uint32_t crc) {
  putLittle(out, 20, 2);     // version needed
  putLittle(out, 0x800, 2);  // names are UTF-8
  putLittle(out, 0, 2);      // stored
  putLittle(out, first_of_1980, 4);
  putLittle(out, crc, 4);
  putLittle(out, member.content.size(), 4);
  putLittle(out, member.content.size(), 4);
  putLittle(out, member.name.size(), 2);
  putLittle(out, 0, 2);  // no extra field
}

}  // namespace

std::uint32_t crc32(std::string_view bytes) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xedb88320u ^ (c >> 1) : c >> 1;
      t[i] = c;
    }
    return t;
  }();
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) crc = table[(crc ^ static_cast<unsigned char>(byte)) & 0xff] ^ (crc >> 8);
  return crc ^ 0xffffffffu;
}

std::string zipArchive(const std::vector<ZipMember>& members, const std::string& path) {
  std::string archive, directory;
  if (members.size() > 0xffff) throw InputError(path, 0, "more than 65535 members", "fewer");
  for (const ZipMember& member : members) {
    if (archive.size() + member.content.size() + 1024 > std::numeric_limits<std::uint32_t>::max()) {
      throw InputError(path, 0, "the archive would exceed 4 GiB", "fewer poses");
    }
    const std::uint32_t crc = crc32(member.content);
    const auto offset = archive.size();
    putLittle(archive, local_header, 4);
    putCommon(archive, member, crc);
    archive += member.name;
    archive += member.content;
    putLittle(directory, central_header, 4);
    putLittle(directory, 0x0314, 2);  // made by: Unix, 2.0
    putCommon(directory, member, crc);
    putLittle(directory, 0, 2);               // no comment
    putLittle(directory, 0, 2);               // disk
    putLittle(directory, 0, 2);               // internal attributes
    putLittle(directory, 0100644u << 16, 4);  // a file, rw-r--r--
    putLittle(directory, offset, 4);
    directory += member.name;
  }
  const auto begin = archive.size();
  archive += directory;
  putLittle(archive, end_of_directory, 4);
  putLittle(archive, 0, 4);  // disks
  putLittle(archive, members.size(), 2);
  putLittle(archive, members.size(), 2);
  putLittle(archive, directory.size(), 4);
  putLittle(archive, begin, 4);
  putLittle(archive, 0, 2);  // no comment
  return archive;
}

std::vector<ZipMember> readZipArchive(std::string_view archive, const std::string& path) {
  const auto fail = [&](const char* what) { throw InputError(path, 0, what, "a ZIP archive of stored members"); };
  if (archive.size() < 22 || takeLittle(archive, archive.size() - 22, 4) != end_of_directory)
    fail("no end of directory");
  const std::size_t end = archive.size() - 22, count = takeLittle(archive, end + 10, 2);
  std::size_t at = takeLittle(archive, end + 16, 4);
  std::vector<ZipMember> members;
  for (std::size_t k = 0; k < count; ++k) {
    if (at + 46 > end || takeLittle(archive, at, 4) != central_header) fail("a broken directory");
    const std::size_t size = takeLittle(archive, at + 20, 4), name_size = takeLittle(archive, at + 28, 2);
    const std::size_t local = takeLittle(archive, at + 42, 4), crc = takeLittle(archive, at + 16, 4);
    if (takeLittle(archive, at + 10, 2) != 0) fail("a compressed member");
    const std::size_t content = local + 30 + name_size;
    if (at + 46 + name_size > end || content + size > end || takeLittle(archive, local, 4) != local_header) {
      fail("a member beyond the end");
    }
    members.push_back({std::string(archive.substr(at + 46, name_size)), std::string(archive.substr(content, size))});
    if (crc32(members.back().content) != crc) fail("a wrong checksum");
    at += 46 + name_size + takeLittle(archive, at + 30, 2) + takeLittle(archive, at + 32, 2);
  }
  return members;
}

std::string npyArray(std::span<const double> values, std::size_t columns) {
  const std::size_t rows = columns > 0 ? values.size() / columns : 0;
  const std::string shape = columns == 1 ? fmt::format("({},)", rows) : fmt::format("({}, {})", rows, columns);
  std::string header = fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': {}, }}", shape);
  // Magic, version and length are ten bytes; the data begin at a multiple of 64.
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  putLittle(out, header.size(), 2);
  out += header;
  for (const double value : values) putLittle(out, std::bit_cast<std::uint64_t>(value), 8);
  return out;
}

}  // namespace liestat
