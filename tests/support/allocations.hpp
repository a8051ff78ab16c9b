// Every allocation of a test program, counted. Included by its one source file, for the operators replace the program's.
#pragma once

#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace liestat::tests {

/// Calls of operator new so far, the bytes that are held now, and the most that were.
inline std::atomic<std::size_t> allocations = 0, bytes_held = 0, most_bytes_held = 0;

inline void* countedAllocation(void* memory) noexcept {
  if (memory == nullptr) return nullptr;
  ++allocations;
  const std::size_t now = bytes_held += malloc_usable_size(memory);
  most_bytes_held = std::max(most_bytes_held.load(), now);
  return memory;
}

inline void* allocatedOrThrow(void* memory) {
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

inline void* countedAligned(std::size_t size, std::align_val_t to) noexcept {
  const auto step = static_cast<std::size_t>(to);
  return countedAllocation(std::aligned_alloc(step, (size + step - 1) / step * step));
}

inline void countedRelease(void* memory) noexcept {
  if (memory != nullptr) bytes_held -= malloc_usable_size(memory);
  std::free(memory);
}

}  // namespace liestat::tests

// All forms of each operator: a sanitizer brings its own for those that are missing, and then finds memory of the one
// freed by the other. Not inlined, for g++ takes malloc and free for a pair that does not belong to new and delete.
[[gnu::noinline]] void* operator new(std::size_t size) {
  return liestat::tests::allocatedOrThrow(liestat::tests::countedAllocation(std::malloc(size)));
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return liestat::tests::countedAllocation(std::malloc(size));
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t to) {
  return liestat::tests::allocatedOrThrow(liestat::tests::countedAligned(size, to));
}
[[gnu::noinline]] void* operator new(std::size_t size, std::align_val_t to, const std::nothrow_t&) noexcept {
  return liestat::tests::countedAligned(size, to);
}
[[gnu::noinline]] void* operator new[](std::size_t size) { return operator new(size); }
[[gnu::noinline]] void* operator new[](std::size_t size, const std::nothrow_t& tag) noexcept {
  return operator new(size, tag);
}
[[gnu::noinline]] void* operator new[](std::size_t size, std::align_val_t to) { return operator new(size, to); }
[[gnu::noinline]] void* operator new[](std::size_t size, std::align_val_t to, const std::nothrow_t& tag) noexcept {
  return operator new(size, to, tag);
}
[[gnu::noinline]] void operator delete(void* at) noexcept { liestat::tests::countedRelease(at); }
[[gnu::noinline]] void operator delete(void* at, std::size_t) noexcept { liestat::tests::countedRelease(at); }
[[gnu::noinline]] void operator delete(void* at, const std::nothrow_t&) noexcept { liestat::tests::countedRelease(at); }
[[gnu::noinline]] void operator delete(void* at, std::align_val_t) noexcept { liestat::tests::countedRelease(at); }
[[gnu::noinline]] void operator delete(void* at, std::size_t, std::align_val_t) noexcept {
  liestat::tests::countedRelease(at);
}
[[gnu::noinline]] void operator delete(void* at, std::align_val_t, const std::nothrow_t&) noexcept {
  liestat::tests::countedRelease(at);
}
[[gnu::noinline]] void operator delete[](void* at) noexcept { operator delete(at); }
[[gnu::noinline]] void operator delete[](void* at, std::size_t) noexcept { operator delete(at); }
[[gnu::noinline]] void operator delete[](void* at, const std::nothrow_t&) noexcept { operator delete(at); }
[[gnu::noinline]] void operator delete[](void* at, std::align_val_t) noexcept { operator delete(at); }
[[gnu::noinline]] void operator delete[](void* at, std::size_t, std::align_val_t) noexcept { operator delete(at); }
[[gnu::noinline]] void operator delete[](void* at, std::align_val_t, const std::nothrow_t&) noexcept {
  operator delete(at);
}
