// Files compressed by gzip (RFC 1952), by zlib.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

namespace liestat::detail {

/// True if a file begins as gzip files do, which no text does.
inline bool isGzip(std::string_view bytes) { return bytes.substr(0, 2) == "\x1F\x8B"; }

/// The content of a gzip file, of all its members one after the other; zeros after the last are padding. Throws
/// InputError in the name of the file where it is damaged, ends too early, or something else follows. Nothing if it is
/// longer than `limit` bytes.
std::optional<std::string> decompressed(std::string_view bytes, const std::string& file,
                                        std::size_t limit = std::numeric_limits<std::size_t>::max());

}  // namespace liestat::detail
