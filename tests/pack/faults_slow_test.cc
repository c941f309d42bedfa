#include <gmock/gmock.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <fstream>

#include "core/random.h"
#include "dataset/pack/pack_json.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/run_in_copy.h"

/// Flipped bits, cut files, killed processes, full disks: nothing is ever silently wrong, and a rerun ends with the same bytes.
namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

void Overwrite(const std::string& path, const std::string& content) { std::ofstream(path, std::ios::binary) << content; }

/// A pack of one shard, and all that a reader gets out of it.
class DamagedPack : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteStudio(folder_ / "data", 2, 6);
    PackOptions options;
    options.crop_px = 128;
    BuildPack(folder_ / "data", pack_, options);
    original_ = ReadFile(shard_);
    expected_ = EverythingOf(pack_, {});
  }

  // What comes of reading the pack with other bytes in its shard: "refused", "same", or "SILENTLY WRONG".
  std::string Outcome(const std::string& bytes) {
    Overwrite(shard_, bytes);
    try {
      return EverythingOf(pack_, {}) == expected_ ? "same" : "SILENTLY WRONG";
    } catch (const FormatError&) {
      return "refused";
    }
  }

  TempDir folder_;
  const std::string pack_ = folder_ / "pack", shard_ = pack_ + "/shard-00000.h5";
  std::string original_, expected_;
};

TEST_F(DamagedPack, NoFlippedBitIsSilentlyWrong) {
  Rng rng(20);
  std::map<std::string, int> count;
  int reported = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::string bytes = original_;
    const size_t at = rng.Index(bytes.size());
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << rng.Index(8)));
    const std::string outcome = Outcome(bytes);
    EXPECT_NE(outcome, "SILENTLY WRONG") << "byte " << at;
    ++count[outcome];
    if (trial % 10 == 0) reported += VerifyPack(pack_).num_errors() > 0;
  }
  EXPECT_EQ(reported, 30) << "verify sees every one, by the digest of the file";
  EXPECT_GT(count["refused"], 100);
  std::printf("%zu bytes, 300 flips: %d refused, %d read the same (padding), 0 silently wrong\n", original_.size(),
              count["refused"], count["same"]);
}

// The same in the part that says where everything lies, as a single file without digests beside it.
TEST_F(DamagedPack, NoFlippedBitInTheMetadataIsSilentlyWrongInASingleFile) {
  WriteSinglePack(pack_, folder_ / "one.h5");
  const std::string original = ReadFile(folder_ / "one.h5"), expected = EverythingOf(folder_ / "one.h5", {});
  Rng rng(21);
  for (int trial = 0; trial < 150; ++trial) {
    std::string bytes = original;
    const size_t at = rng.Index(std::min<size_t>(bytes.size(), 6000));
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << rng.Index(8)));
    Overwrite(folder_ / "one.h5", bytes);
    try {
      EXPECT_EQ(EverythingOf(folder_ / "one.h5", {}) == expected, true) << "byte " << at << " is silently wrong";
    } catch (const FormatError&) {
    }
  }
}

TEST_F(DamagedPack, EveryTruncationIsRefused) {
  for (int k = 0; k < 60; ++k) {
    const size_t length = k < 50 ? original_.size() * k / 50 : original_.size() - 1 - (k - 50) * (k - 50);
    EXPECT_EQ(Outcome(original_.substr(0, length)), "refused") << length << " of " << original_.size();
  }
}

// --- Killed and failing builds
// -------------------------------------------------------------------------------------------------

std::atomic<int> steps_left{0};
std::atomic<int> failure{0};  // errno, or 0 for SIGKILL

int FailAfterSomeSteps(const char*, const std::string&) {
  if (steps_left.fetch_sub(1) != 1) return 0;
  if (failure == 0) raise(SIGKILL);
  return failure;
}

/// Restores the disk's good behaviour.
struct Failing {
  Failing(int steps, int code) {
    steps_left = steps, failure = code;
    SetIoFault(FailAfterSomeSteps);
  }
  ~Failing() { SetIoFault(nullptr); }
};

RunContext OneThread() {
  RunContext run;
  run.num_threads = 1;
  return run;
}

// Builds in a child that is killed at its n-th step; true when it lived to the end.
bool BuildAndDie(const std::string& data, const std::string& pack, int step) {
  const int exit = mvstudio::testing::RunInCopy([&] {
    const Failing failing(step, 0);
    return BuildPack(data, pack, SmallPack(), {}, OneThread()).complete ? 0 : 2;
  });
  EXPECT_TRUE(exit == 0 || exit == 128 + SIGKILL) << exit;
  return exit == 0;
}

// Either finished with exactly this content, or refused.
void ExpectWholeOrRefused(const std::string& pack, const std::string& expected, int step) {
  try {
    EXPECT_EQ(EverythingOf(pack, {}) == expected, true) << "after step " << step;
  } catch (const Error&) {
  }
}

class FailingBuild : public ::testing::Test {
 protected:
  void SetUp() override {
    WriteStudio(data_, 2, 5);
    BuildPack(data_, folder_ / "whole", SmallPack(), {}, OneThread());
    expected_ = FolderContent(folder_ / "whole");
    everything_ = EverythingOf(folder_ / "whole", {});
  }
  TempDir folder_;
  const std::string data_ = folder_ / "data", pack_ = folder_ / "pack";
  std::map<std::string, std::string> expected_;
  std::string everything_;
};

TEST_F(FailingBuild, ARerunAfterAKillAtAnyStepEndsWithTheSameBytes) {
  int step = 1;
  for (bool lived = false; !lived; ++step) {
    fs::remove_all(pack_);
    lived = BuildAndDie(data_, pack_, step);
    ExpectWholeOrRefused(pack_, everything_, step);
    EXPECT_TRUE(BuildPack(data_, pack_, SmallPack(), {}, OneThread()).complete);
    EXPECT_EQ(FolderContent(pack_), expected_) << "after step " << step;
    ASSERT_LT(step, 500);
  }
  EXPECT_GT(step, 20);
  std::printf("killed at each of %d steps: the rerun ended with the same bytes every time\n", step - 2);
}

TEST_F(FailingBuild, AProcessThatIsKilledAgainAndAgainGetsThere) {
  // Each run gets one step further than the one before; what is finished is not done twice.
  int step = 1;
  for (; !BuildAndDie(data_, pack_, step); ++step) {
    ExpectWholeOrRefused(pack_, everything_, step);
    ASSERT_LT(step, 500);
  }
  EXPECT_EQ(FolderContent(pack_), expected_);
}

TEST_F(FailingBuild, AFailureAtAnyStepLeavesEachFileOldOrNew) {
  // The finished pack of an earlier state of the dataset is there; one image has changed since.
  const PanopticDataset data = OpenPanopticDataset(data_);
  WriteImage(SmoothImage(96, 72, 2), data.ImagePath("00_01", 9));
  BuildPack(data_, folder_ / "new", SmallPack(), {}, OneThread());
  const auto changed = FolderContent(folder_ / "new");
  for (const int code : {ENOSPC, EIO}) {
    bool failed = true;
    for (int step = 1; failed; ++step) {
      fs::remove_all(pack_);
      fs::copy(folder_ / "whole", pack_);
      try {
        const Failing failing(step, code);
        failed = !BuildPack(data_, pack_, SmallPack(), {}, OneThread()).complete;
      } catch (const ResourceError&) {
        EXPECT_EQ(code, ENOSPC);
      } catch (const IoError&) {
        EXPECT_EQ(code, EIO);
      }
      const auto found = FolderContent(pack_);
      for (const auto& [name, content] : found) {
        EXPECT_TRUE(expected_.count(name)) << name << " is left over after step " << step;
        EXPECT_TRUE(content == expected_.at(name) || content == changed.at(name)) << name << " after step " << step;
      }
      EXPECT_EQ(found.size(), expected_.size());
      EXPECT_TRUE(BuildPack(data_, pack_, SmallPack(), {}, OneThread()).complete);
      EXPECT_EQ(FolderContent(pack_), changed);
      ASSERT_LT(step, 500);
    }
  }
}

TEST_F(FailingBuild, TwoProcessesShareThePack) {
  const pid_t child = fork();
  if (child == 0) {
    int code = 1;
    try {
      BuildPack(data_, pack_, SmallPack(), {1, 2});
      code = 0;
    } catch (...) {
    }
    _exit(code);
  }
  BuildPack(data_, pack_, SmallPack(), {0, 2});
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  MergePack(pack_);
  EXPECT_EQ(FolderContent(pack_), expected_);
}

/// A file system of 1 MB; not there where mounting is not permitted.
class SmallDisk {
 public:
  SmallDisk() : mounted_(mount("tmpfs", folder_.path().c_str(), "tmpfs", 0, "size=1m") == 0) {}
  ~SmallDisk() {
    if (mounted_) umount(folder_.path().c_str());
  }
  bool mounted() const { return mounted_; }
  std::string operator/(const std::string& name) const { return folder_ / name; }

 private:
  TempDir folder_;
  bool mounted_;
};

TEST_F(FailingBuild, AFullDiskLeavesWhatIsFinished) {
  const SmallDisk disk;
  if (!disk.mounted()) GTEST_SKIP() << "needs the right to mount a tmpfs";
  PackOptions options;
  options.crop_px = 256, options.codec.kind = PackCodec::Kind::kRaw, options.shard_samples = 2;  // 0.4 MB a shard
  EXPECT_THAT(MessageOf<ResourceError>([&] { BuildPack(data_, disk / "pack", options); }), HasSubstr("No space left"));
  const auto after = FolderContent(disk / "pack");
  EXPECT_TRUE(after.count("shard-00000.h5") && after.count("shard-00000.done.json"));
  for (const auto& [name, content] : after) EXPECT_EQ(name.rfind("shard-", 0), 0u) << name << " is left over";
  fs::copy(disk / "pack", folder_ / "moved");
  const PackBuildReport report = BuildPack(data_, folder_ / "moved", options);
  EXPECT_EQ(report.kept.size() * 2, after.size()) << "what was finished is kept";
  BuildPack(data_, folder_ / "elsewhere", options);
  EXPECT_EQ(FolderContent(folder_ / "moved"), FolderContent(folder_ / "elsewhere"));
}

}  // namespace
}  // namespace mvstudio::dataset
