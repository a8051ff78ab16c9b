#include <cli/show/progress.hpp>

#include <fmt/format.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <report/table.hpp>
#include <experiments/interruption.hpp>

namespace liestat::cli {
namespace {

constexpr auto redraw_period = std::chrono::milliseconds(200);

std::string duration(double seconds) {
  const auto whole = static_cast<std::uint64_t>(std::min(std::ceil(seconds), 3.6e8));
  const std::uint64_t hours = whole / 3600;
  const std::uint64_t minutes = whole / 60 % 60;
  if (hours > 0) return fmt::format("{}:{:02}:{:02}", hours, minutes, whole % 60);
  return fmt::format("{}:{:02}", minutes, whole % 60);
}

/// Columns but one: a full line would make some terminals begin the next.
std::size_t widthOf(std::FILE* terminal) {
  winsize size{};
  const bool known = ::ioctl(::fileno(terminal), TIOCGWINSZ, &size) == 0 && size.ws_col > 0;
  return known ? size.ws_col - std::size_t{1} : 79;
}

std::atomic<int> interrupted_terminal{-1};

/// The shell's prompt goes below the bar. Resets itself, and the signal that is raised again ends the program.
extern "C" void endLineOnInterrupt(int signal) {
  const int terminal = interrupted_terminal.load();
  if (terminal >= 0 && ::write(terminal, "\n", 1) < 0) interrupted_terminal.store(-1);
  ::raise(signal);
}

/// The end of the bar's line, and a line of its own. Resets itself, so that the next interrupt ends the program.
extern "C" void stopOnInterrupt(int /*signal*/) {
  experiments::trials_of_run.stop.store(true);
  constexpr std::string_view note =
      "\nliestat: interrupted; what was computed is shown and written. Another interrupt ends the program at once.\n";
  const std::size_t skip = ::isatty(STDERR_FILENO) == 1 ? 0 : 1;
  if (::write(STDERR_FILENO, note.data() + skip, note.size() - skip) < 0) return;
}

/// Handles the next interrupt, where nobody else, such as nohup, has said what an interrupt does.
bool handleNextInterrupt(void (*handler)(int)) {
  struct sigaction present {};
  if (::sigaction(SIGINT, nullptr, &present) != 0 || present.sa_handler != SIG_DFL) return false;
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  sigemptyset(&action.sa_mask);
  return ::sigaction(SIGINT, &action, nullptr) == 0;
}
void leaveInterrupts(void (*handler)(int)) {
  struct sigaction present {};
  if (::sigaction(SIGINT, nullptr, &present) != 0 || present.sa_handler != handler) return;
  ::signal(SIGINT, SIG_DFL);
}

}  // namespace

StopOnInterrupt::StopOnInterrupt() { handleNextInterrupt(stopOnInterrupt); }
StopOnInterrupt::~StopOnInterrupt() { leaveInterrupts(stopOnInterrupt); }

std::string progressLine(std::string_view label, std::uint64_t done, std::uint64_t total, double elapsed_s,
                         std::size_t width) {
  done = std::min(done, total);
  const double share = total == 0 ? 1 : static_cast<double>(done) / static_cast<double>(total);
  std::string left;
  if (done > 0 && done < total) left = duration(elapsed_s * (1 - share) / share) + " left";
  const std::string numbers = fmt::format(" {:3}%  {:>12}", static_cast<int>(100 * share), left);
  const std::size_t taken = displayWidth(label) + 3 + numbers.size();
  if (taken >= width) {
    const std::string short_numbers = numbers.substr(numbers.size() > width ? numbers.size() - width : 0);
    return std::string(label.substr(0, width - short_numbers.size())) + short_numbers;
  }
  const std::size_t bar = std::min<std::size_t>(width - taken, 40);
  const auto filled = static_cast<std::size_t>(share * static_cast<double>(bar));
  return fmt::format("{} [{}{}]{}", label, std::string(filled, '='), std::string(bar - filled, ' '), numbers);
}

Progress::Progress(std::string label, std::uint64_t total, std::FILE* stream)
    : label_(std::move(label)),
      total_(total),
      stream_(stream),
      visible_(::isatty(::fileno(stream)) == 1),
      start_(Clock::now()) {}

Progress::~Progress() { finish(); }

void Progress::advance(std::uint64_t n) {
  done_.fetch_add(n, std::memory_order_relaxed);
  if (visible_ && (Clock::now() - start_).count() >= next_draw_.load(std::memory_order_relaxed)) draw();
}

void Progress::draw() {
  // Who comes while another thread draws has better things to do than to wait for it.
  const std::unique_lock lock(drawing_, std::try_to_lock);
  if (!lock.owns_lock() || !visible_ || experiments::runStopped()) return;
  const Clock::duration elapsed = Clock::now() - start_;
  next_draw_.store((elapsed + redraw_period).count(), std::memory_order_relaxed);
  const double seconds = std::chrono::duration<double>(elapsed).count();
  const std::string line = progressLine(label_, done(), total_, seconds, widthOf(stream_));
  if (!drawn_ && handleNextInterrupt(endLineOnInterrupt)) interrupted_terminal.store(::fileno(stream_));
  std::fputs(("\r" + line + "\x1b[K").c_str(), stream_);
  std::fflush(stream_);
  drawn_ = true;
}

void Progress::finish() {
  const std::lock_guard lock(drawing_);
  if (drawn_) {
    // The line of a bar that was interrupted has ended.
    if (!experiments::runStopped()) std::fputs("\r\x1b[K", stream_);
    std::fflush(stream_);
    leaveInterrupts(endLineOnInterrupt);
  }
  drawn_ = false;
  visible_ = false;
}

}  // namespace liestat::cli
