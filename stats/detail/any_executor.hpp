// One type for all executors of one process: an estimator that is slow to compile is instantiated once, whoever runs it.
#pragma once

#include <stats/executor.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <type_traits>
#include <utility>

namespace liestat::detail {

/// An executor that sends the chunks' results to other processes (MPI) needs their types and says so by a member
/// `distributed`.
template <class E>
concept InProcessExecutor = Executor<E> && !requires {
  E::distributed;
};

/// Refers to an executor of this process, which must outlive it. A single chunk, all that a small problem has, is
/// evaluated at once; each of several costs an allocation.
class AnyExecutor {
 public:
  template <InProcessExecutor E>
    requires(!std::is_same_v<E, AnyExecutor>)
  explicit AnyExecutor(const E& executor)
      : reduce_([&executor](std::size_t n_chunks, const Map& map, const Combine& combine) {
          return executor.reduce(n_chunks, map, combine);
        }) {}

  template <class M, class C>
  ChunkResult<M> reduce(std::size_t n_chunks, M&& map, C&& combine) const {
    using T = ChunkResult<M>;
    if (n_chunks == 0) return T{};
    if (n_chunks == 1) return std::invoke(map, std::size_t{0});
    const Part whole = reduce_(
        n_chunks, [&](std::size_t chunk) -> Part { return std::make_shared<T>(std::invoke(map, chunk)); },
        [&](Part& left, const Part& right) {
          combineInto(combine, *static_cast<T*>(left.get()), T(std::move(*static_cast<T*>(right.get()))));
        });
    return std::move(*static_cast<T*>(whole.get()));
  }

 private:
  using Part = std::shared_ptr<void>;
  using Map = std::function<Part(std::size_t)>;
  using Combine = std::function<void(Part&, const Part&)>;

  std::function<Part(std::size_t, const Map&, const Combine&)> reduce_;
};

/// The executor as estimators that are slow to compile see it.
template <Executor E>
decltype(auto) erased(const E& executor) {
  if constexpr (InProcessExecutor<E> && !std::is_same_v<E, AnyExecutor>) {
    return AnyExecutor(executor);
  } else {
    return (executor);
  }
}

}  // namespace liestat::detail
