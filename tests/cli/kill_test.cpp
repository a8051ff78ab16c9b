// Runs of `liestat validate` that are killed, whose disk is full, or that are of another run than their file.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>
#include <chrono>
#include <filesystem>
#include <random>
#include <string>
#include <thread>

#include <cli/program_output.hpp>

namespace liestat::cli {
namespace {

#ifndef LIESTAT_KILLS
#define LIESTAT_KILLS 3
#endif

double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

/// A process of the program: its CPU time and how it ended. `life`: seconds until it is killed; none: it is left alone.
struct Life {
  double cpu = 0;
  int status = 0;

  Life(const Words& words, const std::string& output, const std::string& errors, double life) {
    const pid_t child = ::fork();
    if (child == 0) {
      Words copies = Words{LIESTAT_PROGRAM} + words;
      std::vector<char*> pointers;
      for (std::string& copy : copies) pointers.push_back(copy.data());
      pointers.push_back(nullptr);
      if (std::freopen(output.c_str(), "w", stdout) == nullptr ||
          std::freopen(errors.c_str(), "w", stderr) == nullptr) {
        ::_exit(127);
      }
      ::execv(pointers[0], pointers.data());
      ::_exit(127);
    }
    if (life > 0) {
      std::this_thread::sleep_for(std::chrono::duration<double>(life));
      ::kill(child, SIGKILL);
    }
    rusage usage{};
    ::wait4(child, &status, 0, &usage);
    cpu = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  }
};

const Words command = wordsOf("validate motion --method gyroscope --trials 100");

nlohmann::json jsonOf(const std::string& path) {
  auto json = nlohmann::json::parse(contentOf(path));
  json.erase("command_line");
  return json;
}

TEST(Kills, ARunGoesOnToTheSameBytes) {
  const TemporaryDirectory directory;
  const auto path = [&](const char* name) { return directory / name; };
  const Life whole(command + Words{"--threads", "1", "--json", path("whole.json")}, path("whole"), path("errors"), 0);
  ASSERT_TRUE(WIFEXITED(whole.status)) << contentOf(path("errors"));
  std::mt19937 random(7);
  std::uniform_real_distribution<double> life(0, 2);
  const Words kept = command + Words{"--checkpoint", path("run.state")};
  double cpu = 0;
  int kills = 0, runs = 1;
  for (int i = 0; kills < LIESTAT_KILLS; ++i) {
    const Life one(kept + Words{"--threads", i % 2 == 0 ? "1" : "2"}, path("out"), path("errors"), life(random));
    cpu += one.cpu;
    if (WIFSIGNALED(one.status)) {
      ++kills;
      continue;
    }
    // It was faster than its end: another run begins.
    ASSERT_EQ(contentOf(path("out")), contentOf(path("whole")));
    std::filesystem::remove(path("run.state"));
    ++runs;
  }
  const Life last(kept + Words{"--threads", "2", "--json", path("last.json")}, path("last"), path("errors"), 0);
  cpu += last.cpu;
  EXPECT_EQ(last.status, whole.status);
  EXPECT_EQ(contentOf(path("last")), contentOf(path("whole")));
  EXPECT_EQ(jsonOf(path("last.json")), jsonOf(path("whole.json")));
  // Work that was done again, of up to two threads.
  const double again = (cpu - runs * whole.cpu) / kills;
  RecordProperty("cpu_seconds_again_per_kill", fmt::format("{:.2f}", again));
  std::printf("%d kills of %d runs of %.1f s, %.2f s of CPU done again per kill\n", kills, runs, whole.cpu, again);
  EXPECT_LT(again, 10);
  // It has all results now.
  const Life once_more(kept, path("last"), path("errors"), 0);
  EXPECT_LT(once_more.cpu, 0.5 * whole.cpu);
  EXPECT_EQ(contentOf(path("last")), contentOf(path("whole")));
  EXPECT_NE(contentOf(path("errors")).find("the run goes on from there"), std::string::npos);
  // Kills leave no files behind but one at most, which the next run takes.
  EXPECT_FALSE(std::filesystem::exists(path("run.state.new")));
}

TEST(Kills, AFullDiskLeavesTheLastGoodState) {
  const TemporaryDirectory directory;
  const std::string small = "validate propagation --feature rotation --operation inverse --spread 0.05 --trials ";
  const Words checkpoint{"--checkpoint", directory / "run.state"};
  ASSERT_EQ(run(wordsOf(small + "2000") + checkpoint).exit_code, 0);
  const std::string good = contentOf(directory / "run.state");
  // Files of 8 KB at most: as on a full disk, the next state cannot be written.
  const ProgramResult full =
      runProgram(Words{"sh", "-c", "trap '' XFSZ; ulimit -f 16; exec \"$0\" \"$@\"", LIESTAT_PROGRAM} +
                     wordsOf(small + "2000") + checkpoint,
                 directory.path().string());
  EXPECT_GT(good.size(), 16384U);
  EXPECT_EQ(full.status, 2);
  EXPECT_NE(full.errors.find("run.state: cannot be written: File too large"), std::string::npos) << full.errors;
  EXPECT_EQ(contentOf(directory / "run.state"), good);
  EXPECT_FALSE(std::filesystem::exists(directory / "run.state.new"));
}

TEST(Kills, AStateOfAnotherRunIsRefused) {
  const TemporaryDirectory directory;
  const std::string file = directory / "1.state";
  const std::string subject = "validate propagation --feature rotation --operation inverse --spread 0.05 --trials ";
  const auto refused = [&](const Words& words, const std::string& expected) {
    const ProgramOutput output = run(words);
    EXPECT_EQ(output.exit_code, 2) << expected;
    EXPECT_NE(output.error.find(expected), std::string::npos) << output.error;
    EXPECT_EQ(std::count(output.error.begin(), output.error.end(), '\n'), 1) << output.error;
  };
  const auto part = [&](const std::string& which, const std::string& to) {
    return Words{"--part", which, "--state", to};
  };
  const ProgramOutput first = run(wordsOf(subject + "2000") + part("1/2", file));
  ASSERT_EQ(first.exit_code, 0) << first.error;
  EXPECT_EQ(first.output, fmt::format("part 1/2: 4 of the run's 8 tasks are in {}\n", file));
  const Words merge{"--merge", file};
  refused(wordsOf(subject + "2000") + merge, "part 2/2 is in no file");
  refused(wordsOf(subject + "2000 --seed 2") + merge, "of another run");
  refused(wordsOf(subject + "4000") + Words{"--checkpoint", file}, "of another run");
  refused(wordsOf(subject + "2000") + part("2/2", file), "this is part 1/2");
  refused(wordsOf(subject + "2000") + part("0/2", directory / "x"), "'0/2' is no part");
  refused(wordsOf(subject + "2000") + part("1/2", directory / "x") + Words{"--json", "-"}, "has no rows of its own");
  refused(wordsOf(subject + "2000 --part 1/2"), "--state");
  refused(wordsOf("validate vi-init --scene fig2 --report r") + part("1/2", directory / "x"), "--part");
  const std::string good = contentOf(file);
  refused(wordsOf(subject + "2000") + Words{"--merge", directory.write("cut", good.substr(0, good.size() - 9))},
          "damaged or not complete");
  std::string other = good;
  other[good.size() / 2] ^= 1;
  refused(wordsOf(subject + "2000") + Words{"--merge", directory.write("bad", other)}, "damaged or not complete");
  refused(wordsOf(subject + "2000") + Words{"--merge", directory.write("text", "x,y,z\n")}, "no state of a run");
  other = good;
  other[good.find("version 1") + 8] = '2';
  refused(wordsOf(subject + "2000") + Words{"--merge", directory.write("new", other)}, "another version");
  refused(wordsOf(subject + "2000") + Words{"--merge", directory / "nowhere"}, "nowhere");
}

TEST(Kills, TasksOfMpirunAreToldToTakeParts) {
  const TemporaryDirectory directory;
  const auto of = [&](const Words& words) {
    return runProgram(Words{"env", "OMPI_COMM_WORLD_SIZE=2", LIESTAT_PROGRAM} +
                          wordsOf("validate propagation --feature rotation --operation inverse --trials 10") + words,
                      directory.path().string());
  };
  const ProgramResult refused = of({});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.errors.find("--part"), std::string::npos);
  EXPECT_EQ(of({"--part", "2/2", "--state", "2.state"}).status, 0);
}

}  // namespace
}  // namespace liestat::cli
