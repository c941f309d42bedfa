#include "core/disk/replace.h"

#include <fstream>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(ReplaceScope, KeepsWhatAnEarlierRunWrote) {
  const TempDir folder;
  const std::string path = folder / "sync.json";
  SetWriterName("sync", "1");
  WriteFileAtomic(path, "old");
  {
    const ReplaceScope keep(false);
    const std::string message = MessageOf<UsageError>([&] { WriteFileAtomic(path, "new"); });
    EXPECT_NE(message.find("is a result of an earlier run of `mvstudio sync`"), std::string::npos) << message;
    EXPECT_THROW(OutputFolder(folder.path(), {}, {"sync.json"}), UsageError);
    EXPECT_THROW(OutputFiles({path}, {}), UsageError);
  }
  EXPECT_EQ(ReadFile(path), "old");
  const ReplaceScope replace(true);
  WriteFileAtomic(path, "new");
  EXPECT_EQ(ReadFile(path), "new");
}

TEST(ReplaceScope, ARunMayWriteItsOwnFilesAgain) {
  const TempDir folder;
  const ReplaceScope keep(false);
  WriteFileAtomic(folder / "history.csv", "1");
  WriteFileAtomic(folder / "history.csv", "12");
  AppendLine(folder / "history.csv", "3");
  EXPECT_EQ(ReadFile(folder / "history.csv"), "12\n3\n");
}

TEST(ReplaceScope, ARunOfTheSameProcessIsAnEarlierRun) {
  const TempDir folder;
  {
    const ReplaceScope keep(false);
    WriteFileAtomic(folder / "a.json", "1");
  }
  const ReplaceScope keep(false);
  EXPECT_THROW(WriteFileAtomic(folder / "a.json", "2"), UsageError);
}

TEST(ReplaceScope, TheOutermostDecides) {
  const TempDir folder;
  WriteFileAtomic(folder / "a.json", "1");
  const ReplaceScope outer(true);
  {
    const ReplaceScope inner(false);
    WriteFileAtomic(folder / "a.json", "2");
  }
  EXPECT_TRUE(MayReplace());
  EXPECT_EQ(ReadFile(folder / "a.json"), "2");
}

TEST(ReplaceScope, FoldersAsAWholeAreKeptToo) {
  const TempDir folder;
  const std::string path = folder / "markers";
  {
    AtomicFolder markers(path, false);
    WriteFile(markers.work_path() + "/a.trc", "1");
    markers.Commit();
  }
  const ReplaceScope keep(false);
  EXPECT_THROW(AtomicFolder(path, true), UsageError);
  EXPECT_EQ(ReadFile(path + "/a.trc"), "1");
}

TEST(ReplaceScope, FilesOfOthersAreKeptWhateverIsAsked) {
  const TempDir folder;
  std::ofstream(folder / "notes.json") << "mine";
  const ReplaceScope replace(true);
  EXPECT_THROW(WriteFileAtomic(folder / "notes.json", "2"), UsageError);
  EXPECT_EQ(ReadFile(folder / "notes.json"), "mine");
}

}  // namespace
}  // namespace mvstudio
