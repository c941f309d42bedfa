#include "core/disk/trace.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

using Paths = std::set<std::string>;

TEST(DiskTrace, SeesWhatIsReadAndWhatAppears) {
  const TempDir folder;
  const std::string real = std::filesystem::canonical(folder.path()).string();
  WriteFileAtomic(folder / "before", "1");
  const DiskTrace trace;
  ReadFile(folder / "./before");
  WriteFileAtomic(folder / "file", "1");
  {
    AtomicFolder whole(folder / "whole", false);
    WriteFile(whole.work_path() + "/a", "1");
    whole.Commit();
  }
  const AtomicFolder given_up(folder / "never", false);
  EXPECT_EQ(trace.published(), Paths({real + "/file", real + "/whole"}));
  EXPECT_EQ(trace.read().count(real + "/before"), 1u);
}

/// Memory does not grow with a take: a folder stands for its many files.
TEST(DiskTrace, ManyFilesOfAFolderAreTheFolder) {
  const TempDir folder;
  const std::string real = std::filesystem::canonical(folder.path()).string();
  MakeFolder(folder / "many");
  for (int i = 0; i < 300; ++i) WriteFileAtomic(folder / ("many/" + std::to_string(i)), "1");
  WriteFileAtomic(folder / "one", "1");
  const DiskTrace trace;
  for (int i = 0; i < 300; ++i) ReadFile(folder / ("many/" + std::to_string(i)));
  ReadFile(folder / "one");
  EXPECT_EQ(trace.read(), Paths({real + "/many", real + "/one"}));
}

TEST(DiskTrace, TheInnermostSeesAndCachesLeaveNone) {
  const TempDir folder;
  const DiskTrace outer;
  {
    const DiskTrace inner;
    WriteFileAtomic(folder / "a", "1");
    EXPECT_EQ(inner.published().size(), 1u);
  }
  {
    const UntracedScope cache;
    WriteFileAtomic(folder / "b", "1");
  }
  EXPECT_TRUE(outer.published().empty());
  WriteFileAtomic(folder / "c", "1");
  EXPECT_EQ(outer.published().size(), 1u);
}

}  // namespace
}  // namespace mvstudio
