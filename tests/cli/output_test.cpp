#include <gtest/gtest.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <report/json.hpp>
#include <formats/output_file.hpp>
#include <cli/show/progress.hpp>
#include <report/table.hpp>
#include <support/temporary_directory.hpp>
#include <experiments/interruption.hpp>

namespace liestat::cli {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(OutputFile, ReplacesAsAWhole) {
  const TemporaryDirectory directory;
  const std::string path = directory.write("out.json", "a longer text than the next one");
  writeOutput(path, "new");
  EXPECT_EQ(contentOf(path), "new");
  const auto entries = std::distance(std::filesystem::directory_iterator(directory.path()), {});
  EXPECT_EQ(entries, 1) << "nothing is left over";
}

TEST(OutputFile, KeepsModeAndLink) {
  const TemporaryDirectory directory;
  const std::string path = directory.write("real", "old");
  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  std::filesystem::create_symlink(path, directory / "link");
  writeOutput(directory / "link", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(directory / "link"));
  EXPECT_EQ(contentOf(path), "new");
  EXPECT_EQ(static_cast<int>(std::filesystem::status(path).permissions()), 0640);
}

TEST(OutputFile, PathsThatCannotBeWritten) {
  const TemporaryDirectory directory;
  const std::string absent = directory / "absent/out.json";
  EXPECT_EQ(errorOf([&] { writeOutput(absent, "x"); }), absent + ": cannot be written: No such file or directory");
  EXPECT_EQ(errorOf([&] { writeOutput(directory.path().string(), "x"); }),
            directory.path().string() + ": cannot be written: Is a directory");
  EXPECT_EQ(errorOf([&] { writeOutput("/dev/full", "x"); }), "/dev/full: cannot be written: No space left on device");
  EXPECT_EQ(errorOf([&] { writeOutput("/dev/null", "x"); }), "");
  const std::string file = directory.write("file", "");
  EXPECT_EQ(errorOf([&] { createDirectory(file); }).substr(0, file.size() + 2), file + ": ");
}

TEST(JsonOutput, EnvelopeAndFields) {
  JsonObject object = jsonEnvelope("liestat mean f.csv", 7);
  const Eigen::Matrix2d matrix{{1, 0.5}, {nan, 2}};
  object.set("n", std::size_t{5})
      .set("converged", true)
      .set("offset", -3)
      .set("residual", infinity)
      .set("status", "ok");
  object.set("mean", JsonObject().set("point", Eigen::Vector3d(1, 2, 3))).set("covariance", matrix);
  object.set("row", Eigen::RowVector2d(1, 2)).set("nothing", nullptr).set("maybe", std::optional<double>());
  object.set("list", std::vector<double>{1, nan}).set("names", std::vector<std::string>{"a"});
  const auto json = nlohmann::ordered_json::parse(object.str());
  EXPECT_EQ(json["schema_version"], 2);
  EXPECT_EQ(json["program"], "liestat");
  EXPECT_EQ(json["version"], std::string(programVersion()));
  EXPECT_EQ(json["command_line"], "liestat mean f.csv");
  EXPECT_EQ(json["seed"], 7);
  EXPECT_EQ(json["n"], 5);
  EXPECT_EQ(json["converged"], true);
  EXPECT_EQ(json["offset"], -3);
  EXPECT_TRUE(json["residual"].is_null());
  EXPECT_EQ(json["mean"]["point"], (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(json["covariance"].dump(), "[[1.0,0.5],[null,2.0]]");
  EXPECT_EQ(json["row"].dump(), "[[1.0,2.0]]") << "only columns are lists";
  EXPECT_TRUE(json["nothing"].is_null() && json["maybe"].is_null());
  EXPECT_EQ(json["list"].dump(), "[1.0,null]");
  EXPECT_EQ(json.begin().key(), "schema_version") << "fields keep their order";
  EXPECT_FALSE(nlohmann::json::parse(jsonEnvelope("liestat").str()).contains("seed"));
}

TEST(JsonOutput, LargeSeedsAndOddBytes) {
  const std::uint64_t seed = std::numeric_limits<std::uint64_t>::max();
  const auto json = nlohmann::json::parse(jsonEnvelope("liestat mean \xFF.csv", seed).str());
  EXPECT_EQ(json["seed"].get<std::uint64_t>(), seed);
}

TEST(JsonOutput, TextHasOneLineForEachFieldAndRow) {
  JsonObject object;
  object.set("rows", std::vector<JsonObject>{JsonObject().set("n", 5).set("index", 3.25), JsonObject().set("n", 10)});
  object.set("matrix", Eigen::Matrix2d::Identity()).set("empty", JsonObject());
  EXPECT_EQ(object.str(),
            "{\n  \"rows\": [\n    {\"n\": 5, \"index\": 3.25},\n    {\"n\": 10}\n  ],\n"
            "  \"matrix\": [\n    [1.0, 0.0],\n    [0.0, 1.0]\n  ],\n  \"empty\": {}\n}\n");
}

TEST(JsonOutput, CommandLineCanBeTypedAgain) {
  const char* arguments[] = {"liestat", "mean", "my file.csv", "it's", "", "--n=5,10"};
  EXPECT_EQ(commandLine(6, arguments), "liestat mean 'my file.csv' 'it'\\''s' '' --n=5,10");
}

TEST(Table, AlignsAtTheDecimalPoint) {
  Table table({"feature", "n", "index"});
  table.row({"rotation", "5", "3.02"});
  table.row({"point", "100", "12.5"});
  table.row({"σ", "-", "n/a"});
  EXPECT_EQ(table.str(),
            "feature     n  index\n"
            "--------  ---  -----\n"
            "rotation    5   3.02\n"
            "point     100  12.5\n"
            "σ           -    n/a\n");
}

TEST(Table, NeverWiderThanAskedFor) {
  std::vector<std::string> headers = {"what"};
  std::vector<std::string> cells = {"a text that is much too long for a column of a table of eighty"};
  for (int i = 0; i < 14; ++i) {
    headers.push_back("column" + std::to_string(i));
    cells.push_back(std::to_string(1000.125 + i));
  }
  Table table(headers);
  table.row(cells);
  const std::string text = table.str();
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(displayWidth(line), 80U) << line;
  for (std::size_t i = 1; i < cells.size(); ++i)
    EXPECT_NE(text.find(cells[i]), std::string::npos) << "numbers are never cut";
  EXPECT_NE(text.find("…"), std::string::npos);
}

TEST(Table, WrappedText) {
  EXPECT_EQ(wrapped("aa bb cc", 5), "aa bb\ncc\n");
  EXPECT_EQ(wrapped("aa bb cc", 6, 2), "aa bb\n  cc\n");
  EXPECT_EQ(wrapped("σσ ττ υ", 5), "σσ ττ\nυ\n") << "columns, not bytes";
  EXPECT_EQ(wrapped("a-word-too-long b", 5), "a-word-too-long\nb\n");
  EXPECT_EQ(wrapped(""), "\n");
}

TEST(Table, Numbers) {
  EXPECT_EQ(number(3.14159), "3.142");
  EXPECT_EQ(number(nan), "n/a");
}

TEST(Progress, Line) {
  EXPECT_EQ(progressLine("trials", 25, 100, 10, 60),
            "trials [" + std::string(8, '=') + std::string(24, ' ') + "]  25%     0:30 left");
  EXPECT_EQ(progressLine("trials", 0, 100, 10, 40).find("left"), std::string::npos) << "nothing is known yet";
  EXPECT_NE(progressLine("trials", 1, 1000, 10).find("2:46:30 left"), std::string::npos);
  EXPECT_NE(progressLine("trials", 7, 7, 1).find("100%"), std::string::npos);
  EXPECT_NE(progressLine("trials", 0, 0, 0).find("100%"), std::string::npos);
  for (std::uint64_t done = 0; done <= 100; ++done) EXPECT_LE(progressLine("trials", done, 100, 5).size(), 79U);
  // Narrow: no bar, then less of the label, and the percentage and the time to the end.
  EXPECT_EQ(progressLine("validate two-view", 25, 100, 10, 36), "validate two-view  25%     0:30 left");
  EXPECT_EQ(progressLine("validate two-view", 25, 100, 10, 24), "valid  25%     0:30 left");
  for (std::size_t width = 0; width <= 100; ++width) {
    EXPECT_LE(progressLine("validate two-view", 25, 100, 10, width).size(), width) << width;
  }
}

/// A terminal of so many columns whose other end the test reads. Some containers have none to give: stream() is null there.
class Terminal {
 public:
  explicit Terminal(unsigned short columns) : master_(::posix_openpt(O_RDWR | O_NOCTTY)) {
    const char* name = nullptr;
    if (master_ >= 0 && ::grantpt(master_) == 0 && ::unlockpt(master_) == 0) name = ::ptsname(master_);
    if (name != nullptr) stream_ = std::fopen(name, "w");
    if (stream_ == nullptr) return;
    const winsize size{24, columns, 0, 0};
    EXPECT_EQ(::ioctl(master_, TIOCSWINSZ, &size), 0);
  }
  ~Terminal() {
    if (stream_ != nullptr) std::fclose(stream_);
    if (master_ >= 0) ::close(master_);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  std::FILE* stream() { return stream_; }
  std::string shown() {
    std::string text(4096, '\0');
    const ssize_t count = ::read(master_, text.data(), text.size());
    text.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    return text;
  }

 private:
  int master_;
  std::FILE* stream_ = nullptr;
};

constexpr const char* no_terminal = "no pseudo-terminal is to be had here: /dev/ptmx or /dev/pts is missing or full";

TEST(Progress, FitsTheTerminalAndIsRemoved) {
  Terminal terminal(30);
  if (terminal.stream() == nullptr) GTEST_SKIP() << no_terminal;
  {
    Progress progress("validate two-view", 100, terminal.stream());
    progress.advance(25);
  }
  EXPECT_EQ(terminal.shown(), "\rvalidate t  25%     0:01 left\x1b[K\r\x1b[K");
}

TEST(Progress, AnInterruptEndsTheLineAndTheProgram) {
  Terminal terminal(60);
  if (terminal.stream() == nullptr) GTEST_SKIP() << no_terminal;
  const auto interrupted = [&](auto disposition) {
    std::signal(SIGINT, disposition);
    Progress progress("work", 100, terminal.stream());
    progress.advance(25);
    std::raise(SIGINT);
    progress.finish();
    std::_Exit(std::signal(SIGINT, SIG_DFL) == disposition ? 7 : 8);
  };
  EXPECT_EXIT(interrupted(SIG_DFL), ::testing::KilledBySignal(SIGINT), "");
  const std::string shown = terminal.shown();
  EXPECT_EQ(shown.substr(0, 7), "\rwork [");
  EXPECT_EQ(shown.substr(shown.size() - 2), "\r\n") << "as a terminal shows the end of a line";
  // In the background of a shell, or under nohup, interrupts are ignored and stay so.
  EXPECT_EXIT(interrupted(SIG_IGN), ::testing::ExitedWithCode(7), "");
  EXPECT_EQ(terminal.shown().find('\n'), std::string::npos);
}

TEST(Progress, AnInterruptOfTrialsStopsThemAndTheNextOneTheProgram) {
  Terminal terminal(60);
  if (terminal.stream() == nullptr) GTEST_SKIP() << no_terminal;
  const auto interrupted = [&](int times) {
    std::signal(SIGINT, SIG_DFL);
    {
      const StopOnInterrupt watch;
      Progress progress("work", 100, terminal.stream());
      progress.advance(25);
      for (int i = 0; i < times; ++i) std::raise(SIGINT);
      progress.advance(25);
    }
    const bool handed_back = std::signal(SIGINT, SIG_DFL) == SIG_DFL;
    std::_Exit(experiments::runStopped() && handed_back ? 7 : 8);
  };
  EXPECT_EXIT(interrupted(1), ::testing::ExitedWithCode(7), "^liestat: interrupted; what was computed is shown");
  EXPECT_EQ(terminal.shown().find('\n'), std::string::npos) << "the line of the bar stays: the note ends it";
  EXPECT_EXIT(interrupted(2), ::testing::KilledBySignal(SIGINT), "");
  EXPECT_EXIT(interrupted(0), ::testing::ExitedWithCode(8), "^$");
}

TEST(Progress, CountsFromAllThreadsAndLeavesFilesAlone) {
  const TemporaryDirectory directory;
  const std::string path = directory / "stderr";
  std::FILE* stream = std::fopen(path.c_str(), "w");
  ASSERT_NE(stream, nullptr);
  {
    Progress progress("work", 4000, stream);
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        for (int k = 0; k < 1000; ++k) progress.advance();
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(progress.done(), 4000U);
  }
  std::fclose(stream);
  EXPECT_EQ(contentOf(path), "") << "a file is no terminal";
}

}  // namespace
}  // namespace liestat::cli
