#include "stages/input/fingerprint.h"

#include <filesystem>

#include "tests/support/folder_state.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

/// Same bytes, and other times.
void Touch(const std::string& path) { fs::last_write_time(path, fs::last_write_time(path) + std::chrono::seconds(5)); }

TEST(Fingerprint, TellsContentsAndNotTimes) {
  const TempDir folder;
  Put(folder / "d/a", "1");
  const Fingerprint before = FingerprintOf(folder / "d");
  Touch(folder / "d/a");
  EXPECT_TRUE(FingerprintOf(folder / "d", &before).SameAs(before));
  Put(folder / "d/a", "2");
  Touch(folder / "d/a");
  EXPECT_FALSE(FingerprintOf(folder / "d", &before).SameAs(before));
}

TEST(Fingerprint, TheNameOfAFoldersOnlyFileCounts) {
  const TempDir folder;
  Put(folder / "d/000001.png", "1");
  const Fingerprint before = FingerprintOf(folder / "d");
  fs::rename(folder / "d/000001.png", folder / "d/000002.png");
  EXPECT_FALSE(FingerprintOf(folder / "d", &before).SameAs(before));
}

TEST(Fingerprint, WhatIsBehindALinkCounts) {
  const TempDir folder;
  Put(folder / "away/a", "1");
  fs::create_directory(folder / "d");
  fs::create_symlink(folder / "away/a", folder / "d/a");
  const Fingerprint before = FingerprintOf(folder / "d");
  EXPECT_FALSE(before.links);
  Put(folder / "away/a", "2");
  Touch(folder / "away/a");
  EXPECT_FALSE(FingerprintOf(folder / "d", &before).SameAs(before));
  fs::create_directory_symlink(folder / "away", folder / "d/more");
  EXPECT_TRUE(FingerprintOf(folder / "d").links);
}

}  // namespace
}  // namespace mvstudio::stages
