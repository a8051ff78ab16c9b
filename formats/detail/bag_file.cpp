#include <formats/detail/bag_file.hpp>

#include <formats/input_error.hpp>
#include <formats/result_zip.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#ifdef LIESTAT_HAS_BZ2
#include <bzlib.h>
#endif
#ifdef LIESTAT_HAS_LZ4
#include <lz4frame.h>
#endif
#ifdef LIESTAT_HAS_ZSTD
#include <zstd.h>
#endif
#ifdef LIESTAT_HAS_SQLITE_LIBRARY
#include <formats/detail/sqlite_file.hpp>
#endif
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>

namespace liestat::detail {
namespace {

constexpr std::string_view ros1_magic = "#ROSBAG V2.0\n", sqlite_magic{"SQLite format 3\0", 16};
constexpr std::string_view mcap_magic = "\x89MCAP0\r\n", zstd_magic = "\x28\xB5\x2F\xFD";
constexpr std::size_t largest_header = 1 << 20, no_topic = static_cast<std::size_t>(-1);

/// Bytes of a file, of which a window is in memory, or of a text.
class Bytes {
 public:
  explicit Bytes(std::string text) : window_(std::move(text)), size_(window_.size()) {}
  explicit Bytes(const std::string& path, const char*) : fd_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    struct stat info {};
    if (fd_ < 0 || ::fstat(fd_, &info) != 0 || !S_ISREG(info.st_mode)) {
      if (fd_ >= 0) ::close(fd_);
      throw InputError(sourceName(path), 0, fd_ < 0 ? "no such file, or it cannot be read" : "this is no file",
                       "a bag");
    }
    size_ = static_cast<std::uint64_t>(info.st_size);
  }
  ~Bytes() {
    if (fd_ >= 0) ::close(fd_);
  }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;

  std::uint64_t size() const { return size_; }
  /// Bytes from a place on, fewer at the end; until the next call.
  std::string_view at(std::uint64_t offset, std::size_t n) {
    if (offset >= size_) return {};
    n = static_cast<std::size_t>(std::min<std::uint64_t>(n, size_ - offset));
    if (fd_ >= 0 && (offset < begin_ || offset + n > begin_ + window_.size())) {
      window_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(std::max(n, window), size_ - offset)));
      begin_ = offset;
      std::size_t got = 0;
      while (got < window_.size()) {
        const ssize_t more = ::pread(fd_, window_.data() + got, window_.size() - got, static_cast<off_t>(offset + got));
        if (more <= 0) break;
        got += static_cast<std::size_t>(more);
      }
      window_.resize(got);
      n = std::min(n, got);
    }
    return std::string_view(window_).substr(static_cast<std::size_t>(offset - begin_), n);
  }

 private:
  static constexpr std::size_t window = 1 << 16;
  int fd_ = -1;
  std::string window_;
  std::uint64_t size_ = 0, begin_ = 0;
};

std::uint64_t littleEndian(std::string_view bytes, std::size_t at, std::size_t n) {
  std::uint64_t value = 0;
  if (at + n > bytes.size()) return 0;
  for (std::size_t i = n; i-- > 0;) value = value << 8U | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// --- ROS 1 and MCAP: records, chunks of records, and after each chunk the index of its messages ----------------------

enum class RecordKind { topic, message, chunk, index, end, other };

/// A record of either container.
struct Record {
  RecordKind kind = RecordKind::other;
  std::uint32_t id = 0;              ///< of the topic
  std::int64_t time = 0, last = 0;   ///< of a message; the first and the last of an index
  std::size_t count = 0;             ///< of an index
  std::uint64_t begin = 0, end = 0;  ///< the message, or the chunk's records
  std::uint64_t expanded = 0;        ///< the chunk's size, as it says
  std::uint32_t checksum = 0;        ///< of the chunk expanded; 0: it has none
  bool unclosed = false;             ///< the file says that it has no index
  std::string compression = {};      ///< none: ""
  BagTopic topic = {};
};

std::string rosType(std::string type) {
  if (const std::size_t msg = type.find("/msg/"); msg != std::string::npos) type.erase(msg, 4);
  return type;
}

/// First and last time of an index's entries of so many bytes.
void readIndex(std::string_view entries, std::size_t size, std::int64_t (*time)(std::string_view), Record& record) {
  for (std::size_t i = 0; i + size <= entries.size(); i += size) {
    const std::int64_t t = time(entries.substr(i, 8));
    record.time = record.count == 0 ? t : std::min(record.time, t);
    record.last = record.count == 0 ? t : std::max(record.last, t);
    ++record.count;
  }
}

std::int64_t ros1Time(std::string_view bytes) {
  return static_cast<std::int64_t>(littleEndian(bytes, 0, 4) * 1000000000 + littleEndian(bytes, 4, 4));
}
std::int64_t mcapTime(std::string_view bytes) { return static_cast<std::int64_t>(littleEndian(bytes, 0, 8)); }

/// The value of a field in a header of ROS 1.
std::string_view fieldOf(std::string_view header, std::string_view name) {
  while (header.size() >= 4) {
    const std::string_view field = header.substr(4, littleEndian(header, 0, 4));
    const std::size_t equals = field.find('=');
    if (field.substr(0, equals) == name && equals != std::string_view::npos) return field.substr(equals + 1);
    header.remove_prefix(4 + field.size());
  }
  return {};
}

/// Reads the record at a place and goes to the next; false if there is no whole one (of a chunk the beginning will do).
bool nextRos1(Bytes& bytes, std::uint64_t& at, std::uint64_t end, Record& record) {
  const std::string_view length = bytes.at(at, 4);
  const std::size_t n = littleEndian(length, 0, 4);
  if (end - at < 8 || length.size() < 4 || n > largest_header || n > end - at - 8) return false;
  const std::string_view header = bytes.at(at + 4, n + 4);
  if (header.size() < n + 4) return false;
  const std::string_view fields = header.substr(0, n), op = fieldOf(fields, "op");
  record.begin = at + 8 + n, record.end = record.begin + littleEndian(header, n, 4);
  if (op.size() != 1 || (record.end > end && op[0] != 5)) return false;
  const auto number = [&](std::string_view name) {
    return static_cast<std::uint32_t>(littleEndian(fieldOf(fields, name), 0, 4));
  };
  record.id = number("conn"), record.end = std::min(record.end, end);
  at = record.end;
  const auto data = [&] {
    return bytes.at(record.begin, static_cast<std::size_t>(std::min<std::uint64_t>(at - record.begin, largest_chunk)));
  };
  switch (op[0]) {
    case 2:
      record.kind = RecordKind::message, record.time = ros1Time(fieldOf(fields, "time"));
      break;
    case 3: {
      const std::uint64_t index = littleEndian(fieldOf(fields, "index_pos"), 0, 8);
      record.unclosed = index == 0 || index >= bytes.size();
      break;
    }
    case 4:
      record.kind = RecordKind::index, readIndex(data(), 12, ros1Time, record);
      break;
    case 5:
      record.kind = RecordKind::chunk, record.expanded = number("size");
      record.compression = fieldOf(fields, "compression");
      if (record.compression == "none") record.compression.clear();
      break;
    case 7:
      record.kind = RecordKind::topic, record.topic.name = fieldOf(fields, "topic"), record.topic.encoding = "ros1";
      record.topic.type = fieldOf(data(), "type");
      break;
    default:
      break;
  }
  return true;
}

class McapRecords {
 public:
  bool operator()(Bytes& bytes, std::uint64_t& at, std::uint64_t end, Record& record) {
    const std::string head(bytes.at(at, 9));
    const std::uint64_t n = littleEndian(head, 1, 8);
    if (head.size() < 9 || head[0] == 0 || end - at < 9) return false;
    const bool torn = n > end - at - 9;
    if (torn && head[0] != 6) return false;
    record.begin = at + 9, record.end = torn ? end : record.begin + n;
    at = record.end;
    // Names beyond this are cut off.
    const std::string_view body = bytes.at(
        record.begin,
        static_cast<std::size_t>(std::min(at - record.begin, std::uint64_t{head[0] == 7 ? largest_chunk : 8192})));
    std::size_t place = 0;
    const auto number = [&](std::size_t size) {
      place += size;
      return littleEndian(body, place - size, size);
    };
    const auto text = [&] {
      const std::size_t length = number(4), begin = std::min(place, body.size());
      place = begin + std::min(length, body.size() - begin);
      return std::string(body.substr(begin, length));
    };
    switch (head[0]) {
      case 2:
        record.kind = RecordKind::end;
        break;
      case 3: {
        const auto id = static_cast<std::uint16_t>(number(2));
        types_[id] = rosType(text());
        break;
      }
      case 4:
        record.kind = RecordKind::topic, record.id = static_cast<std::uint32_t>(number(2));
        record.topic.type = types_[static_cast<std::uint16_t>(number(2))];
        record.topic.name = text(), record.topic.encoding = text();
        break;
      case 5:
        record.kind = RecordKind::message, record.id = static_cast<std::uint32_t>(number(2)), number(4);
        record.time = static_cast<std::int64_t>(number(8));
        record.begin = std::min(record.begin + 22, record.end);
        break;
      case 6:
        record.kind = RecordKind::chunk, number(8), number(8);
        record.expanded = number(8), record.checksum = static_cast<std::uint32_t>(number(4));
        record.compression = text();
        record.begin = std::min(record.begin + place + 8, record.end);
        break;
      case 7:
        record.kind = RecordKind::index, record.id = static_cast<std::uint32_t>(number(2)), number(4);
        readIndex(body.substr(std::min(place, body.size())), 16, mcapTime, record);
        break;
      default:
        break;
    }
    return true;
  }

 private:
  std::map<std::uint16_t, std::string> types_;
};

/// Walks over the records of a container. A chunk is expanded or looked into unless the index behind it says that it
/// has nothing that is wanted; a bag without index is thus read as well.
template <class Next>
class ChunkedBag {
 public:
  ChunkedBag(Next next, std::string file, BagPass& pass)
      : next_(std::move(next)), file_(std::move(file)), pass_(pass) {}

  void read(Bytes& bytes, std::uint64_t begin) {
    const bool ended = walk(bytes, begin, bytes.size(), false);
    if (!ended) pass_.notes.push_back(file_ + " ends, or is damaged, " + torn_ + ": what stands before it is read");
    if (faults_ > 0) {
      pass_.notes.push_back(
          fmt::format("{}: {} chunk{} cannot be read to the end (the first at byte {}: {}): what "
                      "stands before it is read",
                      file_, faults_, faults_ == 1 ? "" : "s", first_fault_, fault_));
    }
    if (large_messages_ > 0) {
      pass_.notes.push_back(fmt::format("{}: {} messages of more than {} bytes are passed over", file_, large_messages_,
                                        largest_message));
    }
    if (unnamed_ > 0) {
      pass_.notes.push_back(fmt::format("{}: {} messages belong to no topic: passed over", file_, unnamed_));
    }
  }

 private:
  std::size_t topicOf(std::uint32_t id) const {
    const auto known = topics_.find(id);
    return known == topics_.end() ? no_topic : known->second;
  }

  void take(Bytes& bytes, const Record& r) {
    const std::size_t topic = topicOf(r.id);
    if (topic == no_topic) {
      ++unnamed_;
    } else if (pass_.counts()) {
      pass_.count(topic, 1, r.time, r.time);
    } else if (pass_.takes(topic)) {
      if (r.end - r.begin > largest_message) {
        ++large_messages_;
        return;
      }
      pass_.take(pass_.topics[topic], r.time, bytes.at(r.begin, static_cast<std::size_t>(r.end - r.begin)));
    }
  }

  void fault(std::uint64_t at, const std::string& why) {
    if (faults_++ == 0) first_fault_ = at, fault_ = why;
  }

  /// A chunk and the index that followed it.
  void settle(Bytes& bytes) {
    if (!chunk_) return;
    const Record chunk = *std::exchange(chunk_, std::nullopt);
    const std::vector<Record> indices = std::exchange(indices_, {});
    const bool indexed = !indices.empty() && std::all_of(indices.begin(), indices.end(),
                                                         [&](const Record& r) { return topicOf(r.id) != no_topic; });
    if (indexed && pass_.counts()) {
      for (const Record& r : indices) pass_.count(topicOf(r.id), r.count, r.time, r.last);
      return;
    }
    if (indexed && std::none_of(indices.begin(), indices.end(),
                                [&](const Record& r) { return r.count > 0 && pass_.takes(topicOf(r.id)); })) {
      return;
    }
    if (chunk.compression.empty()) {
      if (!walk(bytes, chunk.begin, chunk.end, true)) fault(chunk.begin, "its records end " + torn_);
      return;
    }
    const std::uint64_t size = chunk.end - chunk.begin;
    if (std::max(size, chunk.expanded) > largest_chunk) {
      fault(chunk.begin, fmt::format("it has {} bytes, {} at most", std::max(size, chunk.expanded), largest_chunk));
      return;
    }
    Expanded e = expanded(chunk.compression, bytes.at(chunk.begin, static_cast<std::size_t>(size)),
                          static_cast<std::size_t>(chunk.expanded), file_);
    if (e.fault.empty() && e.text.size() < chunk.expanded) {
      e.fault = fmt::format("{} bytes of {}", e.text.size(), chunk.expanded);
    }
    if (e.fault.empty() && chunk.checksum != 0 && crc32(e.text) != chunk.checksum) {
      fault(chunk.begin, "its checksum is not that of its records, none of which is read");
      return;
    }
    Bytes records(std::move(e.text));
    const bool whole = walk(records, 0, records.size(), true);
    if (!e.fault.empty()) {
      fault(chunk.begin, e.fault);
    } else if (!whole) {
      fault(chunk.begin, "its records end " + torn_);
    }
  }

  /// False if the records end before their end, which `torn_` then names.
  bool walk(Bytes& bytes, std::uint64_t at, std::uint64_t end, bool in_chunk) {
    while (at < end) {
      Record r;
      const std::uint64_t before = at;
      const bool whole = next_(bytes, at, end, r);
      if (!in_chunk && (!whole || r.kind != RecordKind::index)) settle(bytes);
      if (!whole) {
        torn_ = fmt::format("at byte {}", before);
        return false;
      }
      if (r.kind == RecordKind::end) return true;
      if (r.unclosed && !std::exchange(unclosed_, true))
        pass_.notes.push_back(file_ + " was not closed, or is cut off: it has no index at its end");
      if (r.kind == RecordKind::topic) {
        topics_[r.id] = pass_.topic(std::move(r.topic.name), std::move(r.topic.type), std::move(r.topic.encoding));
      } else if (r.kind == RecordKind::message) {
        take(bytes, r);
      } else if (r.kind == RecordKind::index && !in_chunk && chunk_) {
        indices_.push_back(std::move(r));
      } else if (r.kind == RecordKind::chunk && !in_chunk) {
        chunk_ = std::move(r);
      }
    }
    if (!in_chunk) settle(bytes);
    torn_ = fmt::format("at byte {}", end);
    // A whole file of MCAP has a last record; of ROS 1 the first says where its index is.
    return in_chunk || std::is_same_v<Next, decltype(&nextRos1)>;
  }

  Next next_;
  std::string file_;
  BagPass& pass_;
  std::unordered_map<std::uint32_t, std::size_t> topics_;
  std::optional<Record> chunk_;
  std::vector<Record> indices_;
  std::size_t faults_ = 0, large_messages_ = 0, unnamed_ = 0;
  std::uint64_t first_fault_ = 0;
  std::string fault_, torn_;
  bool unclosed_ = false;
};

// --- Compression -----------------------------------------------------------------------------------------------------

[[noreturn, maybe_unused]] void refuseCompression(const std::string& file, std::string_view what,
                                                  std::string_view package) {
  throw InputError(file, 0, fmt::format("it needs {}, without which this program was built", what),
                   fmt::format("a build with {} (docs/bags.md)", package));
}

/// Takes what a decompressor delivers in blocks: step(out, room) returns the bytes written, and says by `done` that
/// the text has ended, by `fault` why it cannot.
template <class Step>
Expanded expandBlocks(std::size_t limit, Step&& step) {
  Expanded e;
  std::string block(1 << 18, '\0');
  for (bool done = false; !done && e.fault.empty();) {
    const std::size_t n = step(block.data(), block.size(), done, e.fault);
    if (n > limit - e.text.size()) e.fault = fmt::format("it expands to more than the {} bytes that it states", limit);
    e.text.append(block, 0, std::min(n, limit - e.text.size()));
    if (n == 0 && !done && e.fault.empty()) e.fault = "it ends too early";
  }
  return e;
}

#ifdef LIESTAT_HAS_ZSTD
/// Expands the zstd frames of a file into a function.
template <class Take>
std::string expandZstdFile(Bytes& bytes, Take&& take) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), &ZSTD_freeDStream);
  std::string block(1 << 18, '\0');
  std::size_t result = 0;
  for (std::uint64_t at = 0; at < bytes.size();) {
    const std::string_view in = bytes.at(at, 1 << 16);
    ZSTD_inBuffer input{in.data(), in.size(), 0};
    ZSTD_outBuffer output{block.data(), block.size(), 0};
    do {
      output.pos = 0;
      result = ZSTD_decompressStream(stream.get(), &output, &input);
      if (ZSTD_isError(result) != 0) return ZSTD_getErrorName(result);
      take(std::string_view(block.data(), output.pos));
    } while (input.pos < input.size || output.pos == output.size);
    if (in.empty()) break;
    at += in.size();
  }
  return result == 0 ? "" : "it ends too early";
}
#endif

}  // namespace

Expanded expanded(std::string_view compression, [[maybe_unused]] std::string_view bytes,
                  [[maybe_unused]] std::size_t limit, const std::string& file) {
  if (compression == "bz2") {
#ifdef LIESTAT_HAS_BZ2
    bz_stream s{};
    if (BZ2_bzDecompressInit(&s, 0, 0) != BZ_OK) return {{}, "bz2 has no memory"};
    const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> ends(&s, &BZ2_bzDecompressEnd);
    std::string copy(bytes);
    s.next_in = copy.data(), s.avail_in = static_cast<unsigned>(copy.size());
    return expandBlocks(limit, [&](char* out, std::size_t room, bool& done, std::string& fault) {
      s.next_out = out, s.avail_out = static_cast<unsigned>(room);
      const int result = BZ2_bzDecompress(&s);
      done = result == BZ_STREAM_END;
      if (!done && result != BZ_OK) fault = "bz2's data are damaged";
      return room - s.avail_out;
    });
#else
    refuseCompression(file, "bz2", "libbz2-dev");
#endif
  }
  if (compression == "lz4") {
#ifdef LIESTAT_HAS_LZ4
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0U) return {{}, "lz4 has no memory"};
    const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> ends(context,
                                                                                    &LZ4F_freeDecompressionContext);
    return expandBlocks(limit, [&](char* out, std::size_t room, bool& done, std::string& fault) {
      std::size_t written = room, read = bytes.size();
      const std::size_t result = LZ4F_decompress(context, out, &written, bytes.data(), &read, nullptr);
      bytes.remove_prefix(read);
      if (LZ4F_isError(result) != 0U) {
        fault = fmt::format("lz4: {}", LZ4F_getErrorName(result));
        return std::size_t{0};
      }
      done = result == 0 && bytes.empty();
      return written;
    });
#else
    refuseCompression(file, "lz4", "liblz4-dev");
#endif
  }
  if (compression == "zstd") {
#ifdef LIESTAT_HAS_ZSTD
    const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), &ZSTD_freeDStream);
    ZSTD_inBuffer input{bytes.data(), bytes.size(), 0};
    return expandBlocks(limit, [&](char* out, std::size_t room, bool& done, std::string& fault) {
      ZSTD_outBuffer output{out, room, 0};
      const std::size_t result = ZSTD_decompressStream(stream.get(), &output, &input);
      if (ZSTD_isError(result) != 0) fault = fmt::format("zstd: {}", ZSTD_getErrorName(result));
      done = result == 0 && input.pos == input.size;
      return output.pos;
    });
#else
    refuseCompression(file, "zstd", "libzstd-dev");
#endif
  }
  throw InputError(file, 0, fmt::format("chunks compressed by '{}'", printable(compression)), "none, bz2, lz4 or zstd");
}

namespace {

// --- SQLite -----------------------------------------------------------------------------------------------------------

#ifdef LIESTAT_HAS_SQLITE_LIBRARY
/// The tables of rosbag2.
void readRosbag2(const SqliteFile& file, BagPass& pass) {
  std::string message;
  const auto each = [&](const char* sql, sqlite3_int64 parameter, auto&& row) {
    const bool whole = file.each(sql, parameter, row);
    if (!whole) message = file.message();
    return whole;
  };
  if (!file.hasTables("'topics','messages'", 2)) {
    const bool damaged = !file.each("SELECT count(*) FROM sqlite_schema", 0, [](sqlite3_stmt*) {});
    throw InputError(file.name(), 0, damaged ? file.message() : "it has no tables 'topics' and 'messages'",
                     "a bag of ROS 2");
  }
  std::map<sqlite3_int64, std::size_t> topics;
  bool whole = each("SELECT id, name, type, serialization_format FROM topics", 0, [&](sqlite3_stmt* s) {
    topics[sqlite3_column_int64(s, 0)] =
        pass.topic(SqliteFile::text(s, 1), rosType(SqliteFile::text(s, 2)), SqliteFile::text(s, 3));
  });
  std::size_t unread = 0;
  if (pass.counts()) {
    whole = each("SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id", 0,
                 [&](sqlite3_stmt* s) {
                   const auto topic = topics.find(sqlite3_column_int64(s, 0));
                   if (topic == topics.end()) return;
                   pass.count(topic->second, static_cast<std::size_t>(sqlite3_column_int64(s, 1)),
                              sqlite3_column_int64(s, 2), sqlite3_column_int64(s, 3));
                 }) &&
            whole;
  }
  for (const auto& entry : topics) {
    const std::size_t topic = entry.second;
    if (pass.counts() || !pass.takes(topic)) continue;
    const bool read = each("SELECT timestamp, data FROM messages WHERE topic_id=?", entry.first, [&](sqlite3_stmt* s) {
      std::string_view bytes = SqliteFile::blob(s, 1);
      Expanded e;
      if (bytes.starts_with(zstd_magic)) {
        e = expanded("zstd", bytes, largest_message, file.name());
        bytes = e.text;
      }
      if (bytes.size() > largest_message || !e.fault.empty()) {
        ++unread;
      } else {
        pass.take(pass.topics[topic], sqlite3_column_int64(s, 0), bytes);
      }
    });
    whole = whole && read;
  }
  if (!whole) {
    pass.notes.push_back(
        fmt::format("{} is damaged ({}): what can be read is read", file.name(), printable(message, 80)));
  }
  if (unread > 0) {
    pass.notes.push_back(fmt::format("{}: {} messages are damaged or of more than {} bytes: passed over", file.name(),
                                     unread, largest_message));
  }
}
#endif

void readOneFile(const std::string& path, const std::string& name, [[maybe_unused]] double largest, BagPass& pass) {
  Bytes bytes(path, "file");
  const std::string magic(bytes.at(0, 16));
  const std::string_view m = magic;
  if (m.starts_with(ros1_magic)) {
    ChunkedBag<decltype(&nextRos1)>(&nextRos1, name, pass).read(bytes, ros1_magic.size());
  } else if (m.starts_with(mcap_magic)) {
    ChunkedBag<McapRecords>(McapRecords{}, name, pass).read(bytes, mcap_magic.size());
  } else if (m.starts_with(sqlite_magic)) {
#ifdef LIESTAT_HAS_SQLITE_LIBRARY
    readRosbag2(SqliteFile(path, name), pass);
#else
    refuseCompression(name, "SQLite", "libsqlite3-dev");
#endif
  } else if (m.starts_with(zstd_magic)) {
#ifdef LIESTAT_HAS_ZSTD
    std::string copy = (std::filesystem::temp_directory_path() / "liestat-XXXXXX").string();
    const int fd = ::mkstemp(copy.data());
    if (fd < 0)
      throw InputError(copy, 0, "cannot be written", "a directory for files that last as long as the program");
    const std::unique_ptr<const char, int (*)(const char*)> removed(copy.c_str(), &::unlink);
    double written = 0;
    const std::string fault = expandZstdFile(bytes, [&](std::string_view block) {
      if ((written += static_cast<double>(block.size())) > 1e9 * largest) {
        ::close(fd);
        throw InputError(name, 0, "it expands to more",
                         fmt::format("at most {:g} GB, or --largest-file with more", largest));
      }
      while (!block.empty()) {
        const ssize_t n = ::write(fd, block.data(), block.size());
        if (n <= 0) {
          ::close(fd);
          throw InputError(copy, 0, "cannot be written: the disk is full?", "room for the expanded bag");
        }
        block.remove_prefix(static_cast<std::size_t>(n));
      }
    });
    ::close(fd);
    if (!fault.empty()) pass.notes.push_back(fmt::format("{}: zstd: {}: what stands before it is read", name, fault));
    if (Bytes(copy, "file").at(0, 4) == zstd_magic) throw InputError(name, 0, "zstd within zstd", "a bag");
    readOneFile(copy, name, largest, pass);
#else
    refuseCompression(name, "zstd", "libzstd-dev");
#endif
  } else {
    throw InputError(name, 0, m.starts_with("#ROSBAG") ? "a bag of an older format" : "this is no bag",
                     "#ROSBAG V2.0, MCAP, or SQLite of ROS 2");
  }
}

}  // namespace

std::size_t BagPass::topic(std::string name, std::string type, std::string encoding) {
  const auto [place, fresh] = places_.emplace(name + '\0' + type + '\0' + encoding, topics.size());
  if (fresh) {
    topics.push_back({.name = std::move(name), .type = std::move(type), .encoding = std::move(encoding)});
    taken_.push_back(wanted && wanted(topics.back()));
  }
  return place->second;
}

void BagPass::count(std::size_t topic, std::size_t n, std::int64_t first, std::int64_t last) {
  if (n == 0) return;
  BagTopic& t = topics[topic];
  t.first_ns = t.messages == 0 ? first : std::min(t.first_ns, first);
  t.last_ns = t.messages == 0 ? last : std::max(t.last_ns, last);
  t.messages += n;
}

bool beginsAsBag(const std::string& path) {
  try {
    Bytes bytes(path, "file");
    const std::string_view m = bytes.at(0, 16);
    return m.starts_with("#ROSBAG") || m.starts_with(mcap_magic) || m.starts_with(sqlite_magic) ||
           m.starts_with(zstd_magic);
  } catch (const InputError&) {
    return false;
  }
}

void readBagFile(const std::string& path, double largest, BagPass& pass) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) return readOneFile(path, sourceName(path), largest, pass);
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
    if (entry.is_regular_file(error) && isBag(entry.path().string())) files.push_back(entry.path().string());
  }
  // run_2 before run_10
  std::sort(files.begin(), files.end(),
            [](const std::string& a, const std::string& b) { return std::pair(a.size(), a) < std::pair(b.size(), b); });
  if (files.empty()) throw InputError(sourceName(path), 0, "the directory has no bag", "files .db3, .mcap or .bag");
  for (const std::string& file : files) readOneFile(file, sourceName(file), largest, pass);
}

}  // namespace liestat::detail

namespace liestat {

BagPath bagPath(const std::string& path) {
  const auto exists = [](const std::string& name) {
    std::error_code error;
    return std::filesystem::exists(name, error);
  };
  if (exists(path)) return {path, ""};
  for (std::size_t colon = path.find(':'); colon != std::string::npos; colon = path.find(':', colon + 1)) {
    const std::string file = path.substr(0, colon);
    if (exists(file) || file.ends_with(".bag") || file.ends_with(".db3") || file.ends_with(".mcap")) {
      return {file, path.substr(colon + 1)};
    }
  }
  return {path, ""};
}

bool isBag(const std::string& path) {
  const std::string file = bagPath(path).file;
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0) {
    return file.ends_with(".bag") || file.ends_with(".db3") || file.ends_with(".mcap");
  }
  if (S_ISDIR(info.st_mode)) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(file, error)) {
      if (entry.is_regular_file(error) && isBag(entry.path().string())) return true;
    }
    return false;
  }
  // A pipe can be read only once.
  return S_ISREG(info.st_mode) && detail::beginsAsBag(file);
}

BagContents listBag(const std::string& path, double largest) {
  detail::BagPass pass;
  detail::readBagFile(path, largest, pass);
  std::sort(pass.topics.begin(), pass.topics.end(),
            [](const BagTopic& a, const BagTopic& b) { return a.name < b.name; });
  for (BagTopic& t : pass.topics) t.name = printable(t.name, 200), t.type = printable(t.type, 200);
  return {std::move(pass.topics), std::move(pass.notes)};
}

}  // namespace liestat
