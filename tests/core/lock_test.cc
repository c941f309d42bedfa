#include "core/disk/lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/folder_state.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

TEST(RequireNoWriter, NamesAFileThatAnotherProgramHolds) {
  const testing::TempDir folder;
  const std::string path = folder / "a.h5";
  testing::Put(path, "bytes");
  const int other = open(path.c_str(), O_RDWR);
  RequireNoWriter(path);
  flock(other, LOCK_SH);  // as readers do
  RequireNoWriter(path);
  flock(other, LOCK_EX);
  EXPECT_THROW(RequireNoWriter(path), LockedError);
  close(other);
  RequireNoWriter(path);
  RequireNoWriter(folder / "none");
}

/// Whether another process may write there.
bool IsFreeForOthers(const std::string& path) {
  const pid_t child = fork();
  if (child == 0) {
    try {
      const OutputLock mine(path);
    } catch (...) {
      _exit(1);
    }
    ReleaseIdleOutputs();  // scopes are inherited
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

TEST(OutputLockScope, KeepsOthersOutUntilTheRecordIsWritten) {
  const testing::TempDir folder;
  const std::string outer = folder / "a/outer", inner = folder / "b/inner";
  {
    const OutputLockScope run;
    { const OutputLock lock(outer); }
    EXPECT_FALSE(IsFreeForOthers(outer));
    {
      const OutputLockScope stage;
      { const OutputLock lock(inner); }
      { const OutputLock again(inner); }
      EXPECT_FALSE(IsFreeForOthers(inner));
    }
    EXPECT_TRUE(IsFreeForOthers(inner)) << "the stage is over";
    EXPECT_FALSE(IsFreeForOthers(outer));
    const OutputLock held(inner);
    ReleaseIdleOutputs();
    EXPECT_TRUE(IsFreeForOthers(outer)) << "for a child that writes there";
    EXPECT_FALSE(IsFreeForOthers(inner)) << "in use";
  }
  EXPECT_TRUE(IsFreeForOthers(inner));
  EXPECT_EQ(testing::Entries(folder.path()), std::set<std::string>({}));
}

}  // namespace
}  // namespace mvstudio
