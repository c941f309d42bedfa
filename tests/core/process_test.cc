#include "core/process.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/files.h"
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

TEST(RunProcess, AProgramThatIsNotThereIsNamed) {
  const TempDir folder;
  EXPECT_THROW(RunProcess({folder / "none"}, {folder / "out", folder / "err"}), IoError);
}

}  // namespace
}  // namespace mvstudio
