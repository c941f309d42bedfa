#include "core/files.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "tests/support/temp_dir.h"

namespace mvstudio {
namespace {

namespace fs = std::filesystem;
using testing::TempDir;

size_t CountEntries(const std::string& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(ReadFile, ReturnsEveryByteOrThrows) {
  const TempDir folder;
  const std::string content("\0\r\n\xff text", 9);
  WriteFileAtomic(folder / "a", content);
  EXPECT_EQ(ReadFile(folder / "a"), content);
  WriteFileAtomic(folder / "empty", "");
  EXPECT_EQ(ReadFile(folder / "empty"), "");
  EXPECT_THROW(ReadFile(folder / "none"), IoError);
  EXPECT_THROW(ReadFile(folder.path()), IoError);
}

TEST(WriteFileAtomic, CreatesFoldersAndReplaces) {
  const TempDir folder;
  const std::string path = folder / "a/b/c.json";
  WriteFileAtomic(path, "one");
  WriteFileAtomic(path, "two");
  EXPECT_EQ(ReadFile(path), "two");
  EXPECT_EQ(CountEntries(folder / "a/b"), 1u) << "no temporary file stays";
}

TEST(WriteFileAtomic, GivesTheWriterAPathWithTheSameExtension) {
  const TempDir folder;
  std::string temporary;
  WriteFileAtomic(folder / "picture.png", [&](const std::string& path) {
    temporary = path;
    EXPECT_FALSE(fs::exists(folder / "picture.png"));
    std::ofstream(path) << "png";
  });
  EXPECT_EQ(fs::path(temporary).extension(), ".png");
  EXPECT_EQ(fs::path(temporary).parent_path(), folder.path());
  EXPECT_EQ(ReadFile(folder / "picture.png"), "png");
}

TEST(WriteFileAtomic, OldContentSurvivesAFailingWriter) {
  const TempDir folder;
  const std::string path = folder / "a.txt";
  WriteFileAtomic(path, "old");
  const auto half_written = [](const std::string& temporary) {
    std::ofstream(temporary) << "ha";
    throw std::runtime_error("stop");
  };
  EXPECT_THROW(WriteFileAtomic(path, half_written), std::runtime_error);
  EXPECT_THROW(WriteFileAtomic(path, [](const std::string&) {}), IoError) << "a writer that wrote nothing";
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_EQ(CountEntries(folder.path()), 1u);
}

TEST(WriteFileAtomic, OldContentSurvivesAFullDisk) {
  const TempDir folder;
  const std::string path = folder / "a.txt";
  WriteFileAtomic(path, "old");
  // The kernel's limit on the size of files stands in for a full disk.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{4096, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(WriteFileAtomic(path, std::string(100000, 'x')), Error);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_EQ(CountEntries(folder.path()), 1u);
}

TEST(WriteFileAtomic, DeviceFullIsAResourceError) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "needs /dev/full";
  try {
    AppendLine("/dev/full", "text");
    FAIL() << "accepted";
  } catch (const ResourceError& error) {
    EXPECT_NE(std::string(error.what()).find("/dev/full"), std::string::npos);
  }
}

TEST(WriteFileAtomic, UnwritablePlacesAreIoErrors) {
  const TempDir folder;
  WriteFileAtomic(folder / "file", "x");
  EXPECT_THROW(WriteFileAtomic(folder / "file/below", "y"), IoError);
  fs::create_directory(folder / "taken");
  WriteFileAtomic(folder / "taken/inside", "x");
  EXPECT_THROW(WriteFileAtomic(folder / "taken", "y"), IoError);
  EXPECT_EQ(ReadFile(folder / "taken/inside"), "x");
}

// --- The seam for faults ---

std::vector<std::string> steps;
int fail_at = 0;  // 1 for the first step; 0 for none

int RecordStep(const char* operation, const std::string& path) {
  steps.push_back(std::string(operation) + " " + fs::path(path).filename().string());
  return static_cast<int>(steps.size()) == fail_at ? ENOSPC : 0;
}

/// Counts the steps of file operations while it lives and lets one of them fail.
struct Recording {
  explicit Recording(int failing_step = 0) {
    steps.clear(), fail_at = failing_step;
    before = SetIoFault(RecordStep);
  }
  ~Recording() { SetIoFault(before); }
  IoFault before;
};

TEST(SetIoFault, SeesEveryStepInItsOrder) {
  const TempDir folder;
  const Recording recording;
  WriteFileAtomic(folder / "a", std::string(600000, 'x'));  // three pieces
  FlushToDisk(folder.path());
  RemoveFile(folder / "a");
  std::vector<std::string> kinds;
  for (const std::string& step : steps) kinds.push_back(step.substr(0, step.find(' ')));
  const std::vector<std::string> expected = {"folder", "create", "write",  "write", "write",
                                             "close",  "flush",  "rename", "flush", "remove"};
  EXPECT_EQ(kinds, expected);
  EXPECT_EQ(steps[7], "rename a");
}

TEST(SetIoFault, AFullDiskAtAnyStepLeavesTheOldContent) {
  const TempDir folder;
  WriteFileAtomic(folder / "a", "old");
  int step = 1;
  for (bool failed = true; failed; ++step) {
    const Recording recording(step);
    failed = false;
    try {
      WriteFileAtomic(folder / "a", std::string(600000, 'x'));
    } catch (const ResourceError&) {
      failed = true;
      EXPECT_EQ(ReadFile(folder / "a"), "old") << steps.back();
    }
    EXPECT_EQ(CountEntries(folder.path()), 1u) << steps.back();
  }
  EXPECT_EQ(step, 10) << "eight steps can fail";
  EXPECT_EQ(ReadFile(folder / "a").size(), 600000u);
}

TEST(RemoveFile, IsContentWhenThereIsNothing) {
  const TempDir folder;
  WriteFileAtomic(folder / "a", "x");
  RemoveFile(folder / "a");
  EXPECT_FALSE(fs::exists(folder / "a"));
  EXPECT_NO_THROW(RemoveFile(folder / "a"));
  EXPECT_THROW(RemoveFile(folder.path()), IoError);
}

TEST(AppendLine, AddsWholeLines) {
  const TempDir folder;
  AppendLine(folder / "log/provenance.jsonl", "{}");
  AppendLine(folder / "log/provenance.jsonl", "[]");
  EXPECT_EQ(ReadFile(folder / "log/provenance.jsonl"), "{}\n[]\n");
}

TEST(Glob, SortsAndFindsNothingQuietly) {
  const TempDir folder;
  for (const char* name : {"cam2/b.png", "cam1/b.png", "cam1/a.png", "cam1/a.txt", "other/a.png"})
    WriteFileAtomic(folder / name, "");
  const std::vector<std::string> expected = {folder / "cam1/a.png", folder / "cam1/b.png", folder / "cam2/b.png"};
  EXPECT_EQ(Glob(folder / "cam?/*.png"), expected);
  EXPECT_TRUE(Glob(folder / "*.jpg").empty());
  const std::vector<std::string> all = {folder / "cam1/a.png", folder / "cam1/a.txt", folder / "cam1/b.png"};
  EXPECT_EQ(Glob(folder / "cam1"), all);
  EXPECT_TRUE(Glob(folder.path()).empty()) << "folders are not files";
  const std::vector<std::string> one = {folder / "cam1/a.txt"};
  EXPECT_EQ(Glob(folder / "cam1/a.txt"), one);
}

TEST(AtomicFolder, AppearsOnCommitOnly) {
  const TempDir root;
  const std::string path = root / "run/out";
  {
    AtomicFolder folder(path, false);
    std::ofstream(folder.work_path() + "/a") << "x";
    EXPECT_FALSE(fs::exists(path));
    folder.Commit();
    EXPECT_TRUE(fs::exists(path + "/a"));
  }
  EXPECT_TRUE(fs::exists(path + "/a"));
  EXPECT_EQ(CountEntries(root / "run"), 1u);
}

TEST(AtomicFolder, LeavesNothingWithoutCommit) {
  const TempDir root;
  {
    AtomicFolder folder(root / "out", false);
    std::ofstream(folder.work_path() + "/a") << "x";
  }
  EXPECT_EQ(CountEntries(root.path()), 0u);
}

TEST(AtomicFolder, ReplacesOnlyWhenAskedAndKeepsTheOldOneTillThen) {
  const TempDir root;
  WriteFileAtomic(root / "out/old", "x");
  EXPECT_THROW(AtomicFolder(root / "out", false), UsageError);
  {
    AtomicFolder abandoned(root / "out", true);
    std::ofstream(abandoned.work_path() + "/new") << "y";
    EXPECT_TRUE(fs::exists(root / "out/old"));
  }
  EXPECT_TRUE(fs::exists(root / "out/old"));
  AtomicFolder folder(root / "out/", true);
  std::ofstream(folder.work_path() + "/new") << "y";
  folder.Commit();
  EXPECT_FALSE(fs::exists(root / "out/old"));
  EXPECT_EQ(ReadFile(root / "out/new"), "y");
  EXPECT_EQ(CountEntries(root.path()), 1u);
  EXPECT_NO_THROW(AtomicFolder(root / "new", false));
}

TEST(AtomicFolder, TheOldFolderIsBackWhenTheSwapFails) {
  const TempDir root;
  WriteFileAtomic(root / "out/old", "x");
  int step = 1;
  for (bool failed = true; failed; ++step) {
    AtomicFolder folder(root / "out", true);
    std::ofstream(folder.work_path() + "/new") << "y";
    const Recording recording(step);
    failed = false;
    try {
      folder.Commit();
    } catch (const ResourceError&) {
      failed = true;
      EXPECT_TRUE(fs::exists(root / "out/old")) << steps.back();
    }
  }
  EXPECT_EQ(step, 4) << "both renames were tried";
  EXPECT_EQ(ReadFile(root / "out/new"), "y");
  EXPECT_EQ(CountEntries(root.path()), 1u);
}

TEST(AtomicFolder, AnEmptyFolderMayBeFilled) {
  const TempDir root;
  fs::create_directory(root / "out");
  AtomicFolder folder(root / "out", false);
  std::ofstream(folder.work_path() + "/a") << "x";
  folder.Commit();
  EXPECT_TRUE(fs::exists(root / "out/a"));
}

}  // namespace
}  // namespace mvstudio
