// Files compressed by gzip (RFC 1952), by zlib.
#pragma once

#include <string>
#include <string_view>

namespace liestat::detail {

/// True if a file begins as gzip files do, which no text does.
inline bool isGzip(std::string_view bytes) { return bytes.substr(0, 2) == "\x1F\x8B"; }

/// The content of a gzip file, of all its members one after the other; zeros after the last are padding. Throws
/// InputError in the name of the file where it is damaged, ends too early, or something else follows.
std::string decompressed(std::string_view bytes, const std::string& file);

}  // namespace liestat::detail
