#include "core/disk/files.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

namespace fs = std::filesystem;

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
  EXPECT_EQ(Entries(folder / "a/b"), std::set<std::string>({"c.json"})) << "no temporary file stays";
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
    WriteFile(temporary, "ha");
    throw std::runtime_error("stop");
  };
  EXPECT_THROW(WriteFileAtomic(path, half_written), std::runtime_error);
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_EQ(Entries(folder.path()), std::set<std::string>({"a.txt"}));
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
  EXPECT_EQ(Entries(folder.path()), std::set<std::string>({"a.txt"}));
}

TEST(WriteFileAtomic, DevicesAreNeverReplaced) {
  EXPECT_THROW(AppendLine("/dev/full", "text"), Error);
  EXPECT_THROW(WriteFileAtomic("/dev/null", "text"), Error);
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST(WriteFileAtomic, NeverReplacesWhatItDidNotWrite) {
  const TempDir folder;
  Put(folder / "mine.txt", "mine");
  EXPECT_THROW(WriteFileAtomic(folder / "mine.txt", "theirs"), UsageError);
  EXPECT_THROW(AppendLine(folder / "mine.txt", "theirs"), UsageError);
  EXPECT_EQ(ReadFile(folder / "mine.txt"), "mine");
  EXPECT_EQ(Entries(folder.path()), std::set<std::string>({"mine.txt"})) << "not even a list of files is left";
}

TEST(WriteFileAtomic, NeverReplacesWhatWasChangedSince) {
  const TempDir folder;
  WriteFileAtomic(folder / "a.txt", "ours");
  Put(folder / "a.txt", "edited by hand");
  EXPECT_THROW(WriteFileAtomic(folder / "a.txt", "new"), UsageError);
  EXPECT_EQ(ReadFile(folder / "a.txt"), "edited by hand");
  Put(folder / "a.txt", "ours");
  WriteFileAtomic(folder / "a.txt", "new");
  EXPECT_EQ(ReadFile(folder / "a.txt"), "new");
}

TEST(WriteFileAtomic, ReplacesNoLinkAndWritesThroughNone) {
  const TempDir folder;
  Put(folder / "target.txt", "mine");
  fs::create_symlink(folder / "target.txt", folder / "link.txt");
  EXPECT_THROW(WriteFileAtomic(folder / "link.txt", "theirs"), UsageError);
  EXPECT_TRUE(fs::is_symlink(folder / "link.txt"));
  EXPECT_EQ(ReadFile(folder / "target.txt"), "mine");
}

TEST(WriteFile, OnlyInRoomsOfOurOwn) {
  const TempDir folder;
  EXPECT_THROW(WriteFile(folder / "a.txt", "x"), ContractViolation);
  EXPECT_THROW(AppendToFile(folder / "a.txt", "x"), ContractViolation);
  EXPECT_THROW(MakeSymbolicLink("x", folder / "a.txt"), ContractViolation);
  EXPECT_TRUE(Entries(folder.path()).empty());
}

TEST(ReadFile, PipesAreReadAndThoseWithoutAWriterAreRefused) {
  const TempDir folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(ReadFile(folder / "pipe"), FormatError);
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  ASSERT_EQ(write(ends[1], "content", 7), 7);
  close(ends[1]);
  EXPECT_EQ(ReadFile("/dev/fd/" + std::to_string(ends[0])), "content");
  close(ends[0]);
  EXPECT_THROW(ReadFile("/dev/zero"), FormatError);
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

TEST(SetIoFault, AFullDiskAtAnyStepLeavesTheOldOrTheNewContent) {
  const TempDir folder;
  const std::string old = "old", long_text(600000, 'x');
  WriteFileAtomic(folder / "a", old);
  int step = 1;
  for (bool failed = true, replaced = false; failed; ++step) {
    const Recording recording(step);
    failed = false;
    try {
      WriteFileAtomic(folder / "a", long_text);
    } catch (const ResourceError&) {
      failed = true;
    }
    replaced = ReadFile(folder / "a") == long_text;
    EXPECT_TRUE(replaced || (failed && ReadFile(folder / "a") == old)) << steps.back();
    EXPECT_TRUE(!replaced || !failed || steps.back().find("rename") == std::string::npos) << steps.back();
    EXPECT_EQ(Entries(folder.path()), std::set<std::string>({"a"})) << steps.back();
  }
  EXPECT_GT(step, 12) << "folder, create, write, flush, close and rename, of the file and of the list of files";
}

TEST(AppendLine, AddsWholeLines) {
  const TempDir folder;
  AppendLine(folder / "log/provenance.jsonl", "{}");
  AppendLine(folder / "log/provenance.jsonl", "[]");
  EXPECT_EQ(ReadFile(folder / "log/provenance.jsonl"), "{}\n[]\n");
}

}  // namespace
}  // namespace mvstudio
