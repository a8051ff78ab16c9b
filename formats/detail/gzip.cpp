#include <formats/detail/gzip.hpp>

#include <zlib.h>

#include <algorithm>
#include <vector>

#include <formats/input_error.hpp>

namespace liestat::detail {
namespace {

/// zlib's state, for as long as it is needed.
class Inflation {
 public:
  Inflation() : ready_(inflateInit2(&stream_, 16 + MAX_WBITS) == Z_OK) {}
  ~Inflation() {
    if (ready_) inflateEnd(&stream_);
  }
  Inflation(const Inflation&) = delete;
  Inflation& operator=(const Inflation&) = delete;

  bool ready() const { return ready_; }
  z_stream& stream() { return stream_; }

 private:
  z_stream stream_{};
  bool ready_;
};

}  // namespace

std::optional<std::string> decompressed(std::string_view bytes, const std::string& file, std::size_t limit) {
  Inflation inflation;
  if (!inflation.ready()) throw InputError(file, 0, "zlib refused to start", "a gzip file and memory to read it");
  z_stream& stream = inflation.stream();
  std::vector<unsigned char> input(std::size_t{1} << 16), output(std::size_t{1} << 18);
  std::string text;
  // The last four bytes say how long the last member is, modulo 2^32; memory that is only reserved costs nothing.
  std::size_t stated = 0;
  for (std::size_t k = 0; k < 4 && bytes.size() > 18; ++k) {
    stated |= std::size_t{static_cast<unsigned char>(bytes[bytes.size() - 4 + k])} << 8 * k;
  }
  text.reserve(std::min(stated, limit) + output.size());
  while (!bytes.empty()) {
    // zlib before 1.3 takes no pointer to constant bytes; what is passed is a copy.
    const std::size_t count = std::min(bytes.size(), input.size());
    std::copy_n(bytes.begin(), count, input.begin());
    stream.next_in = input.data();
    stream.avail_in = static_cast<uInt>(count);
    int code = Z_OK;
    do {
      stream.next_out = output.data();
      stream.avail_out = static_cast<uInt>(output.size());
      code = inflate(&stream, Z_NO_FLUSH);
      text.append(reinterpret_cast<const char*>(output.data()), output.size() - stream.avail_out);
      if (text.size() > limit) return std::nullopt;
    } while (code == Z_OK && stream.avail_out == 0);
    bytes.remove_prefix(count - stream.avail_in);
    if (code == Z_STREAM_END) {
      const std::size_t next = bytes.find_first_not_of('\0');
      if (next == std::string_view::npos) return text;
      if (next != 0 || !isGzip(bytes)) {
        throw InputError(file, 0, "something follows the end of the compressed data", "a gzip file alone");
      }
      inflateReset(&stream);
    } else if (code != Z_OK && code != Z_BUF_ERROR) {
      throw InputError(file, 0, "the compressed data are damaged", "an intact gzip file");
    }
  }
  throw InputError(file, 0, "the compressed data end too early", "a complete gzip file");
}

}  // namespace liestat::detail
