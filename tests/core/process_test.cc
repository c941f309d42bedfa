#include "core/process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/temp_dir.h"

namespace mvstudio {
namespace {

using testing::TempDir;

TEST(RunProcess, ReturnsStatusAndKeepsBothStreamsApart) {
  const TempDir folder;
  const auto run = [&](const std::string& script) {
    return RunProcess({"sh", "-c", script}, {folder / "out", folder / "err"});
  };
  EXPECT_EQ(run("echo one; echo two >&2; exit 7"), 7);
  EXPECT_EQ(ReadFile(folder / "out"), "one\n");
  EXPECT_EQ(ReadFile(folder / "err"), "two\n");
  EXPECT_EQ(run("cat"), 0) << "stdin is empty";
  EXPECT_EQ(ReadFile(folder / "out"), "") << "overwritten";
  EXPECT_EQ(run("kill -9 $$"), 137);
  EXPECT_EQ(RunProcess({"printf", "%s|", "a b", "$HOME"}, {folder / "out", folder / "err"}), 0);
  EXPECT_EQ(ReadFile(folder / "out"), "a b|$HOME|") << "no shell";
  EXPECT_EQ(run("[ $(cut -d' ' -f5 /proc/$$/stat) = $$ ]"), 0) << "a group of its own: Ctrl-C is not for it";
}

TEST(RunProcess, AppendsBothStreamsToOneFileFromAnotherFolder) {
  const TempDir folder;
  const ProcessFiles files = {folder / "log", "", true, folder.path()};
  EXPECT_EQ(RunProcess({"sh", "-c", "echo one; echo two >&2; echo > here"}, files), 0);
  EXPECT_EQ(RunProcess({"echo", "three"}, files), 0);
  EXPECT_EQ(ReadFile(folder / "log"), "one\ntwo\nthree\n");
  EXPECT_EQ(ReadFile(folder / "here"), "\n");
}

TEST(RunProcess, AThrowingPollEndsTheProgram) {
  const TempDir folder;
  int calls = 0;
  const auto poll = [&] {
    if (++calls == 3) throw CancelledError("enough");
  };
  EXPECT_THROW(RunProcess({"sh", "-c", "trap 'echo saved; exit 0' TERM; while :; do sleep 0.05; done"},
                          {folder / "out", folder / "err"}, poll),
               CancelledError);
  EXPECT_EQ(ReadFile(folder / "out"), "saved\n") << "it may save before it ends";
}

/// Whether a process does anything any more; one that has ended and is not awaited yet does not.
bool Runs(const std::string& pid) {
  std::ifstream in("/proc/" + pid + "/stat");
  std::string number, name, state;
  return static_cast<bool>(in >> number >> name >> state) && state != "Z";
}

/// A script that starts another process and waits for it; both do not care about SIGTERM. Their numbers are in `two`.
const char* const kStubborn = "trap '' TERM; sleep 60 & echo $$ $! > two.part; mv two.part two; wait; sleep 60";

TEST(RunProcess, AThrowingPollEndsWhatTheProgramStartedToo) {
  const TempDir folder;
  const auto poll = [&] {
    if (std::filesystem::exists(folder / "two")) throw CancelledError("enough");
  };
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(RunProcess({"sh", "-c", kStubborn}, {folder / "log", "", false, folder.path()}, poll), CancelledError);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
  std::ifstream in(folder / "two");
  std::string parent, child;
  in >> parent >> child;
  EXPECT_FALSE(child.empty());
  EXPECT_FALSE(Runs(parent));
  EXPECT_FALSE(Runs(child));
}

TEST(RunProcess, AnIgnoredChildSignalIsAnErrorAndNotASuccess) {
  const TempDir folder;
  const auto before = signal(SIGCHLD, SIG_IGN);
  EXPECT_THROW(RunProcess({"sh", "-c", "exit 7"}, {folder / "out", folder / "err"}), IoError);
  signal(SIGCHLD, before);
}

TEST(RunProcess, TheProgramGetsTheUsualSignals) {
  const TempDir folder;
  const auto before = signal(SIGPIPE, SIG_IGN);
  EXPECT_EQ(RunProcess({"sh", "-c", "kill -PIPE $$; exit 3"}, {folder / "out", folder / "err"}), 128 + SIGPIPE);
  signal(SIGPIPE, before);
}

/// Ends the test's own process, so it runs in a copy of it. Exit status 0: as it should be.
int EndChildrenInACopy(const TempDir& folder) {
  const pid_t copy = fork();
  if (copy == 0) {
    pid_t other = 0;
    const char* const words[] = {"sleep", "60", nullptr};
    if (posix_spawnp(&other, "sleep", nullptr, nullptr, const_cast<char**>(words), environ) != 0) _exit(10);
    AddChild(other, false);
    std::thread runner([&] {
      try {
        RunProcess({"sh", "-c", kStubborn}, {folder / "log", "", false, folder.path()});
      } catch (const Error&) {
      }
    });
    while (!std::filesystem::exists(folder / "two")) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EndChildren();
    runner.join();
    std::ifstream in(folder / "two");
    std::string first, second;
    in >> first >> second;
    const auto any = [&] { return Runs(first) || Runs(second) || Runs(std::to_string(other)); };
    // What was killed may take a moment to be gone on a busy machine; the scripts would run for a minute.
    for (int i = 0; i < 500 && any(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (any()) _exit(11);
    try {
      RunProcess({"true"}, {folder / "log"});
      _exit(12);
    } catch (const CancelledError&) {
      _exit(0);
    }
  }
  int status = 0;
  waitpid(copy, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(EndChildren, EndsThemAllWithTheirGroupsAndLetsNoneBegin) {
  const TempDir folder;
  EXPECT_EQ(EndChildrenInACopy(folder), 0);
}

TEST(RunProcess, AProgramThatIsNotThereIsNamed) {
  const TempDir folder;
  EXPECT_THROW(RunProcess({folder / "none"}, {folder / "out", folder / "err"}), IoError);
}

}  // namespace
}  // namespace mvstudio
