#pragma once

// Processes on one or many machines (needs any MPI 3, Debian: libopenmpi-dev; compile with mpicxx or link
// MPI::MPI_CXX).

#include <lie/instruction_set.hpp>
#include <stats/chunk_codec.hpp>
#include <stats/executor.hpp>

#include <mpi.h>

#include <algorithm>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

inline int mpiCount(std::size_t size) {
  if (size > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    throw std::length_error("MpiExecutor: a chunk's result is larger than 2 GiB, use smaller chunks");
  }
  return static_cast<int>(size);
}

/// A private copy of a communicator, so that our messages cannot meet the caller's.
class MpiChannel {
 public:
  explicit MpiChannel(MPI_Comm of) { MPI_Comm_dup(of, &comm_); }
  MpiChannel(const MpiChannel&) = delete;
  MpiChannel& operator=(const MpiChannel&) = delete;
  ~MpiChannel() { MPI_Comm_free(&comm_); }

  int rank() const {
    int rank = 0;
    MPI_Comm_rank(comm_, &rank);
    return rank;
  }
  int size() const {
    int size = 1;
    MPI_Comm_size(comm_, &size);
    return size;
  }

  /// Starts to send; `bytes` must live until the request is complete.
  MPI_Request startSend(const ChunkBytes& bytes, int to, int tag) const {
    MPI_Request request;
    MPI_Isend(bytes.data(), mpiCount(bytes.size()), MPI_BYTE, to, tag, comm_, &request);
    return request;
  }

  ChunkBytes receive(int from, int tag) const {
    MPI_Status status;
    MPI_Probe(from, tag, comm_, &status);
    int count = 0;
    MPI_Get_count(&status, MPI_BYTE, &count);
    ChunkBytes bytes(static_cast<std::size_t>(count));
    MPI_Recv(bytes.data(), count, MPI_BYTE, from, tag, comm_, MPI_STATUS_IGNORE);
    return bytes;
  }

  bool arrived(int from, int tag) const {
    int flag = 0;
    MPI_Iprobe(from, tag, comm_, &flag, MPI_STATUS_IGNORE);
    return flag != 0;
  }

  /// From rank 0 to all.
  void broadcast(ChunkBytes& bytes) const {
    unsigned long long size = bytes.size();
    MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, 0, comm_);
    bytes.resize(static_cast<std::size_t>(size));
    // In pieces, because MPI counts in int and the sum of many chunks may be a long list.
    constexpr std::size_t piece = std::size_t{1} << 30;
    for (std::size_t at = 0; at < bytes.size(); at += piece) {
      MPI_Bcast(bytes.data() + at, static_cast<int>(std::min(piece, bytes.size() - at)), MPI_BYTE, 0, comm_);
    }
  }

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
};

/// First byte of a message: whether a value or the text of an exception follows.
enum class MpiOutcome : unsigned char { value = 0, exception = 1 };

template <class Payload>
ChunkBytes mpiMessage(MpiOutcome outcome, const Payload& payload) {
  const auto content = std::as_bytes(std::span(payload));
  ChunkBytes message;
  message.reserve(content.size() + 1);
  message.push_back(static_cast<std::byte>(outcome));
  message.insert(message.end(), content.begin(), content.end());
  return message;
}

inline bool isException(const ChunkBytes& message) {
  return message.at(0) == static_cast<std::byte>(MpiOutcome::exception);
}

inline std::string mpiText(const ChunkBytes& message) {
  std::string text;
  for (std::size_t i = 1; i < message.size(); ++i) text.push_back(static_cast<char>(message[i]));
  return text;
}

inline std::string describe(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const std::exception& e) {
    return e.what();
  } catch (...) {
    return "unknown exception";
  }
}

}  // namespace detail

/// Chunk i is evaluated by rank i mod P of the communicator; rank 0 combines in the order of the chunks and sends the
/// result to all, so that every rank returns the same bits (the same as SerialExecutor's).
///
/// - MPI must be initialised. reduce is collective: every rank calls it with the same n_chunks.
/// - T is trivially copyable, a fixed-size Eigen matrix, a std::vector of trivially copyable elements, or Packable.
/// - The results of at most 16 chunks a rank are under way at any time, whatever the number of chunks.
/// - If map or combine throws anywhere, every rank throws: the rank where it happened its own exception, the others
///   std::runtime_error with the same text. Chunks that have not begun then are not evaluated.
struct MpiExecutor {
  static constexpr bool distributed = true;  ///< results cross processes (stats/detail/any_executor.hpp)
  MPI_Comm communicator = MPI_COMM_WORLD;

  /// The largest set of instructions that all ranks use (lie/instruction_set.hpp): kernels that run under this executor
  /// take it, so that machines with different processors make the same bits. Collective. For estimators that run inside
  /// a map, each on one rank, call useInstructionSet(executor.instructionSet()) once.
  InstructionSet instructionSet() const {
    int mine = static_cast<int>(liestat::instructionSet()), least = mine;
    MPI_Allreduce(&mine, &least, 1, MPI_INT, MPI_MIN, communicator);
    return static_cast<InstructionSet>(least);
  }

  template <class Map, class Combine>
  detail::ChunkResult<Map> reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    using T = detail::ChunkResult<Map>;
    static_assert(ChunkCodec<T>::supported,
                  "MpiExecutor: give the chunk result members pack() and unpack(), see liestat::Packable");
    if (n_chunks == 0) return T{};

    const detail::MpiChannel channel(communicator);
    std::optional<T> result;
    std::exception_ptr mine;
    ChunkBytes verdict;

    if (channel.rank() == 0) {
      verdict = gather(channel, n_chunks, map, combine, result, mine);
    } else {
      mine = contribute<T>(channel, n_chunks, map);
    }
    channel.broadcast(verdict);

    if (detail::isException(verdict)) {
      // Rank 0 told everybody to stop; the message has to be taken out before the channel goes away.
      if (channel.rank() != 0) channel.receive(0, stop_tag);
      if (mine) std::rethrow_exception(mine);
      throw std::runtime_error(detail::mpiText(verdict));
    }
    if (result) return std::move(*result);
    return ChunkCodec<T>::decode(std::span(verdict).subspan(1));
  }

 private:
  static constexpr int result_tag = 1;
  static constexpr int stop_tag = 2;
  static constexpr std::size_t max_under_way = 16;

  /// Rank 0: evaluates its own chunks, receives the others', combines; returns what to tell everybody.
  template <class T, class Map, class Combine>
  static ChunkBytes gather(const detail::MpiChannel& channel, std::size_t n_chunks, Map& map, Combine& combine,
                           std::optional<T>& result, std::exception_ptr& mine) {
    const auto ranks = static_cast<std::size_t>(channel.size());
    const ChunkBytes nothing;
    std::vector<MPI_Request> stops;
    std::string error;
    bool failed = false;
    const auto fail = [&](std::string text) {
      failed = true;
      error = std::move(text);
      for (int rank = 1; rank < channel.size(); ++rank) stops.push_back(channel.startSend(nothing, rank, stop_tag));
    };

    for (std::size_t chunk = 0; chunk < n_chunks; ++chunk) {
      const auto owner = static_cast<int>(chunk % ranks);
      // After a failure the other ranks' messages, one for each chunk, are still received, and thrown away.
      const ChunkBytes message = owner == 0 ? ChunkBytes() : channel.receive(owner, result_tag);
      if (failed) continue;
      if (owner != 0 && detail::isException(message)) {
        fail(detail::mpiText(message));
        continue;
      }
      try {
        T part = owner == 0 ? T(std::invoke(map, chunk)) : ChunkCodec<T>::decode(std::span(message).subspan(1));
        if (result) {
          detail::combineInto(combine, *result, std::move(part));
        } else {
          result.emplace(std::move(part));
        }
      } catch (...) {
        mine = std::current_exception();
        fail(detail::describe(mine));
      }
    }

    ChunkBytes verdict;
    if (!failed) {
      try {
        verdict = detail::mpiMessage(detail::MpiOutcome::value, ChunkCodec<T>::encode(*result));
      } catch (...) {
        mine = std::current_exception();
        fail(detail::describe(mine));
      }
    }
    if (failed) verdict = detail::mpiMessage(detail::MpiOutcome::exception, error);
    MPI_Waitall(static_cast<int>(stops.size()), stops.data(), MPI_STATUSES_IGNORE);
    return verdict;
  }

  /// Any other rank: sends one message for each of its chunks, whatever happens, because rank 0 counts on it.
  template <class T, class Map>
  static std::exception_ptr contribute(const detail::MpiChannel& channel, std::size_t n_chunks, Map& map) {
    const auto ranks = static_cast<std::size_t>(channel.size());
    std::exception_ptr mine;
    std::deque<std::pair<ChunkBytes, MPI_Request>> under_way;
    const auto waitForOldest = [&under_way] {
      MPI_Wait(&under_way.front().second, MPI_STATUS_IGNORE);
      under_way.pop_front();
    };

    for (auto chunk = static_cast<std::size_t>(channel.rank()); chunk < n_chunks; chunk += ranks) {
      ChunkBytes message;
      if (mine || channel.arrived(0, stop_tag)) {
        message = detail::mpiMessage(detail::MpiOutcome::exception, std::string("stopped"));
      } else {
        try {
          message = detail::mpiMessage(detail::MpiOutcome::value, ChunkCodec<T>::encode(std::invoke(map, chunk)));
          detail::mpiCount(message.size());
        } catch (...) {
          mine = std::current_exception();
          message = detail::mpiMessage(detail::MpiOutcome::exception, detail::describe(mine));
        }
      }
      if (under_way.size() == max_under_way) waitForOldest();
      // The buffer is in its final place before MPI learns its address; a deque does not move its elements.
      under_way.emplace_back(std::move(message), MPI_REQUEST_NULL);
      under_way.back().second = channel.startSend(under_way.back().first, 0, result_tag);
    }
    while (!under_way.empty()) waitForOldest();
    return mine;
  }
};

static_assert(Executor<MpiExecutor>);

}  // namespace liestat
