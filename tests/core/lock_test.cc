#include "core/disk/lock.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include "tests/support/folder_state.h"
#include "tests/support/temp_dir.h"

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

}  // namespace
}  // namespace mvstudio
