#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <string_view>

namespace liestat::cli {

/// A progress bar with the time left on standard error. It is drawn only when that is a terminal, a few times a second
/// and no wider than it, and removed when the work is done, so that it leaves nothing in logs and pipes. An interrupt
/// (SIGINT, Ctrl-C) ends its line before it ends the program, or before StopOnInterrupt stops the trials.
class Progress {
 public:
  /// `total` is the amount of work in the units of advance().
  Progress(std::string label, std::uint64_t total, std::FILE* stream = stderr);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Some work was done. Any thread may say so.
  void advance(std::uint64_t n = 1);

  /// Removes the bar.
  void finish();

  std::uint64_t done() const { return done_.load(std::memory_order_relaxed); }

 private:
  using Clock = std::chrono::steady_clock;

  void draw();

  std::string label_;
  std::uint64_t total_;
  std::FILE* stream_;
  bool visible_;
  Clock::time_point start_;
  std::atomic<std::uint64_t> done_{0};
  std::atomic<Clock::rep> next_draw_{0};
  std::mutex drawing_;
  bool drawn_ = false;
};

/// While it lives, the first interrupt (SIGINT, Ctrl-C) stops the trials of the experiments (experiments/interruption.hpp)
/// in place of the program, and says so on standard error; the second one ends the program. Interrupts that are ignored,
/// as under nohup, stay so.
class StopOnInterrupt {
 public:
  StopOnInterrupt();
  ~StopOnInterrupt();
  StopOnInterrupt(const StopOnInterrupt&) = delete;
  StopOnInterrupt& operator=(const StopOnInterrupt&) = delete;
};

/// One line of a progress bar, no longer than `width`: without the bar, then with less of the label, where that is
/// narrow.
std::string progressLine(std::string_view label, std::uint64_t done, std::uint64_t total, double elapsed_s,
                         std::size_t width = 79);

}  // namespace liestat::cli
