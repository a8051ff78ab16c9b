#include <formats/detail/gzip.hpp>

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstddef>
#include <string>
#include <string_view>

#include <formats/input_error.hpp>
#include <formats/features.hpp>
#include <formats/text.hpp>
#include <support/temporary_directory.hpp>

namespace liestat {
namespace {

/// One member, as zlib writes it.
std::string zipped(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string input = text, output(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(output.data());
  stream.avail_out = static_cast<uInt>(output.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  output.resize(stream.total_out);
  deflateEnd(&stream);
  return output;
}

std::string rows(int n) {
  std::string text = "x,y,z\n";
  for (int i = 0; i < n; ++i) text += std::to_string(i * 7919 % 1000) + ",2," + std::to_string(i) + "\n";
  return text;
}

TEST(Gzip, MembersOfAnySizeWithPadding) {
  // Beyond the blocks in which zlib is fed and emptied: many bytes that say little, and bytes that say as much.
  for (const int n : {0, 1, 5000, 200000}) {
    const std::string text = rows(n);
    EXPECT_EQ(detail::decompressed(zipped(text), "f"), text) << n;
    EXPECT_EQ(detail::decompressed(zipped(text) + zipped(rows(3)), "f"), text + rows(3)) << n;
    EXPECT_EQ(detail::decompressed(zipped(text) + std::string(512, '\0'), "f"), text) << n;
  }
  const std::string zeros(std::size_t{1} << 22, '\0');
  EXPECT_EQ(detail::decompressed(zipped(zeros), "f"), zeros);
  EXPECT_EQ(detail::decompressed(zipped(""), "f"), "");
}

TEST(Gzip, TruncatedDamagedAndFollowed) {
  const std::string whole = zipped(rows(40));
  for (std::size_t size = 2; size < whole.size(); ++size) {
    EXPECT_EQ(errorOf([&] { detail::decompressed(whole.substr(0, size), "f.gz"); }),
              "f.gz: the compressed data end too early, expected a complete gzip file")
        << size;
  }
  // Beyond the header, whose time stamp may be any, each byte is watched by the checksum or the length.
  for (std::size_t i = 10; i < whole.size(); ++i) {
    std::string other = whole;
    other[i] = static_cast<char>(other[i] ^ 0x10);
    EXPECT_NE(errorOf([&] { detail::decompressed(other, "f.gz"); }), "") << i;
  }
  EXPECT_EQ(errorOf([&] { detail::decompressed(whole + "x,y,z\n", "f.gz"); }),
            "f.gz: something follows the end of the compressed data, expected a gzip file alone");
}

TEST(Gzip, FilesAreReadAsTheirContent) {
  const TemporaryDirectory directory;
  const std::string path = directory.write("points.csv.gz", zipped(rows(20)));
  EXPECT_EQ(loadText(path).text, rows(20));
  const TextFile file = loadText(path);
  EXPECT_EQ(readFeatures(file.text, file.name, {}).size(), 20U);
  const std::string bad = directory.write("bad.gz", zipped("x,y,z\n1,2,a\n"));
  EXPECT_EQ(errorOf([&] {
              const TextFile wrong = loadText(bad);
              (void)readFeatures(wrong.text, wrong.name, {});
            }),
            bad + ":2: z is 'a', expected a number");
}

}  // namespace
}  // namespace liestat
