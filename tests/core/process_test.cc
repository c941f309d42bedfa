#include "core/process.h"

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/run_in_copy.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

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
  return mvstudio::testing::RunInCopy([&folder] {
    Processes shared(ProcessGroup::kShared);
    shared.Start({"sh", "-c", "echo $$ > one.part; mv one.part one; exec sleep 60"},
                 {"/dev/null", "", false, folder.path(), true});
    std::thread runner([&] {
      try {
        RunProcess({"sh", "-c", kStubborn}, {folder / "log", "", false, folder.path()});
      } catch (const Error&) {
      }
    });
    for (const char* name : {"one", "two"}) {
      while (!std::filesystem::exists(folder / name)) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EndChildren();
    runner.join();
    std::ifstream in(folder / "two");
    std::string first, second, other;
    in >> first >> second;
    std::ifstream(folder / "one") >> other;
    const auto any = [&] { return Runs(first) || Runs(second) || Runs(other); };
    // What was killed may take a moment to be gone on a busy machine; the scripts would run for a minute.
    for (int i = 0; i < 500 && any(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (any()) return 11;
    try {
      RunProcess({"true"}, {folder / "log"});
      return 12;
    } catch (const CancelledError&) {
      return 0;
    }
  });
}

TEST(EndChildren, EndsThemAllWithTheirGroupsAndLetsNoneBegin) {
  const TempDir folder;
  EXPECT_EQ(EndChildrenInACopy(folder), 0);
}

TEST(RunProcess, AProgramThatIsNotThereIsNamed) {
  const TempDir folder;
  EXPECT_THROW(RunProcess({folder / "none"}, {folder / "out", folder / "err"}), IoError);
}

/// Waits for a file that a script writes by renaming.
bool WaitForFile(const std::string& path) {
  for (int i = 0; i < 3000 && !std::filesystem::exists(path); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return std::filesystem::exists(path);
}

/// What was killed may take a moment to be gone on a busy machine.
bool WaitForEnd(const std::string& pid) {
  for (int i = 0; i < 500 && Runs(pid); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return !Runs(pid);
}

TEST(Processes, RunBesideEachOtherAndReturnEachStatus) {
  const TempDir folder;
  Processes two;
  // Each waits for the file of the other: one after the other would never end.
  for (const std::string names : {"a b", "b a"})
    two.Start({"sh", "-c", "set -- " + names + "; touch $1; while [ ! -e $2 ]; do sleep 0.02; done; echo $1 done"},
              {folder / (names.substr(0, 1) + ".log"), "", false, folder.path()});
  EXPECT_EQ(two.Wait(), (std::vector<int>{0, 0}));
  EXPECT_EQ(ReadFile(folder / "a.log"), "a done\n");
  EXPECT_EQ(ReadFile(folder / "b.log"), "b done\n");
  EXPECT_TRUE(two.Wait().empty()) << "they are awaited once";
}

TEST(Processes, OneThatFailsEndsTheOthers) {
  const TempDir folder;
  Processes three;
  three.Start({"sh", "-c", "trap 'echo saved; exit 0' TERM; touch ready; while :; do sleep 0.05; done"},
              {folder / "first", "", false, folder.path()});
  ASSERT_TRUE(WaitForFile(folder / "ready"));
  three.Start({"sh", "-c", kStubborn}, {folder / "second", "", false, folder.path()});
  ASSERT_TRUE(WaitForFile(folder / "two"));
  EXPECT_FALSE(three.AnyEnded());
  three.Start({"sh", "-c", "exit 7"}, {folder / "third"});
  EXPECT_EQ(three.Wait(), (std::vector<int>{Processes::kWasEnded, Processes::kWasEnded, 7}));
  EXPECT_THAT(ReadFile(folder / "first"), ::testing::EndsWith("saved\n"));  // some shells say of their `sleep`: Terminated
  std::ifstream in(folder / "two");
  std::string parent, child;
  in >> parent >> child;
  EXPECT_TRUE(WaitForEnd(parent));
  EXPECT_TRUE(WaitForEnd(child));
}

TEST(Processes, EndWithTheirOwner) {
  const TempDir folder;
  std::string first, second;
  {
    Processes one(ProcessGroup::kShared);
    one.Start({"sh", "-c", "echo $$ $(cut -d' ' -f5 /proc/$$/stat) > one.part; mv one.part one; exec sleep 60"},
              {"/dev/null", "", false, folder.path(), true});
    ASSERT_TRUE(WaitForFile(folder / "one"));
    std::ifstream(folder / "one") >> first >> second;
    EXPECT_TRUE(Runs(first));
    EXPECT_EQ(second, std::to_string(getpgrp())) << "Ctrl-C reaches it as it does this process";
  }
  EXPECT_FALSE(Runs(first));
}

TEST(Processes, OneThatEndsIsSeenBeforeItIsAwaited) {
  const TempDir folder;
  Processes one;
  one.Start({"sh", "-c", "echo here >&2; exit 3"}, {folder / "out", folder / "err"});
  for (int i = 0; i < 3000 && !one.AnyEnded(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_TRUE(one.AnyEnded());
  EXPECT_EQ(one.Wait(), std::vector<int>{3});
  EXPECT_EQ(ReadFile(folder / "err"), "here\n");
}

TEST(Processes, StartingOneThatIsNotThereLeavesTheOthers) {
  const TempDir folder;
  Processes two;
  two.Start({"true"}, {folder / "out"});
  EXPECT_THROW(two.Start({folder / "none"}, {folder / "out"}), IoError);
  EXPECT_EQ(two.Wait(), std::vector<int>{0});
}

}  // namespace
}  // namespace mvstudio
