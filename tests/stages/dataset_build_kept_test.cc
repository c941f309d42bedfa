#include <sys/stat.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <optional>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rig/rig_io.h"
#include "stages/dataset_build/run.h"
#include "stages/dataset_verify/run.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/test.h"

/// A build of a dataset that was cut goes on by cameras and blocks of time.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

constexpr int kLong = 315;  // more than a block of 300 frames

/// Cuts the run after some images, and counts them.
class CutAfter : public ProgressSink {
 public:
  explicit CutAfter(int64_t images) : images_(images) {}
  void Advance(int64_t done, const std::string&) override { seen += done; }
  bool Cancelled() const override { return seen >= images_; }
  std::atomic<int64_t> seen{0};

 private:
  int64_t images_;
};

DatasetBuildOptions LongTake(const TempDir& folder) {
  DatasetBuildOptions options;
  geometry::Rig rig = dataset::StudioRig(2, 48, 36);
  for (int c = 0; c < 2; ++c) {
    const std::string name = c == 0 ? "cam_a" : "cam_b";
    rig.cameras[static_cast<size_t>(c)].camera.name = name;
    for (int f = 0; f < kLong; ++f)
      dataset::WriteImage(Image(48, 36, 3, static_cast<uint8_t>(f % 200 + 20 * c)), folder / (name + Format("/%04d.png", f)));
    options.take.images.push_back({name, folder / name});
  }
  geometry::WriteRig(rig, folder / "calibration.json");
  dataset::Pose3d pose;
  pose.skeleton = "coco19", pose.frame_rate_hz = 50;
  for (int f = 0; f < kLong; ++f) {
    const dataset::Coco19Pose person = dataset::StandingPerson(0.001 * f);
    for (int j = 0; j < 19; ++j) {
      dataset::JointRow row;
      row.frame = f, row.joint = geometry::Coco19().joints[static_cast<size_t>(j)];
      row.status = Status::kOk, row.x_in_world = person.x_in_world.col(j);
      row.num_views = 2, row.sigma_m = 0.001;
      pose.rows.push_back(row);
    }
  }
  dataset::WritePose3d(pose, folder / "pose3d");
  options.calib = folder / "calibration.json", options.pose3d = folder / "pose3d";
  options.build.mask.background_frames = 4;
  return options;
}

std::map<std::string, std::string> BytesBelow(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && name.rfind(".mvstudio", 0) != 0)
      files[entry.path().string().substr(folder.size())] = ReadFile(entry.path().string());
  }
  return files;
}

/// Images made until the run is cut; all where it is not.
int64_t ImagesUntil(int64_t cut, const DatasetBuildOptions& options) {
  CutAfter sink(cut);
  RunContext run;
  run.progress = &sink, run.num_threads = 1;
  try {
    RunDatasetBuild(options, run);
  } catch (const CancelledError&) {
  }
  return sink.seen;
}

/// The environment allows caches while it lives.
class CachesAllowed {
 public:
  CachesAllowed() {
    const char* before = std::getenv("MVSTUDIO_CACHE");
    if (before) before_ = before;
    unsetenv("MVSTUDIO_CACHE");
  }
  ~CachesAllowed() {
    if (before_) setenv("MVSTUDIO_CACHE", before_->c_str(), 1);
  }

 private:
  std::optional<std::string> before_;
};

TEST(KeptBuild, ACutBuildGoesOnAtTheBlockThatWasNotFinished) {
  const TempDir folder;
  const CachesAllowed allowed;
  DatasetBuildOptions options = LongTake(folder);
  options.out = folder / "alone", options.cache.kind = CachePlace::Kind::kOff;
  RunDatasetBuild(options);
  const auto whole = BytesBelow(options.out);
  EXPECT_EQ(whole.size(), size_t{5 * kLong + 2}) << "images and masks of two cameras, scenes, two files";
  for (const auto& [name, kind] :
       {std::pair("folder", CachePlace::Kind::kFolder), std::pair("beside", CachePlace::Kind::kAuto)}) {
    options.out = folder / name, options.cache = CacheIn(folder / "cache"), options.cache.kind = kind;
    // In the first block, in the second, in the second camera, at its end.
    for (const int64_t cut : {100, 310, kLong + 200, 2 * kLong - 1}) {
      EXPECT_EQ(ImagesUntil(cut, options), cut);
      EXPECT_FALSE(fs::exists(options.out));
    }
    const std::string kept = kind == CachePlace::Kind::kAuto ? folder / ".kept-beside" : folder / "cache/datasets";
    size_t blocks = 0;
    for (const auto& entry : fs::recursive_directory_iterator(kept)) blocks += entry.path().filename() == "block.json";
    EXPECT_EQ(blocks, 3u);
    std::error_code none;
    RunDatasetBuild(options);
    EXPECT_EQ(BytesBelow(options.out), whole);
    EXPECT_FALSE(fs::exists(folder / ".kept-beside"));
    EXPECT_TRUE(!fs::exists(folder / "cache/datasets", none) || fs::is_empty(folder / "cache/datasets"));
    struct stat info {};
    ASSERT_EQ(stat((options.out + "/hdImgs/00_00/00_00_00000000.jpg").c_str(), &info), 0);
    EXPECT_EQ(info.st_nlink, 1u) << "the dataset's alone";
  }
}

ino_t InodeOf(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0 ? info.st_ino : 0;
}

TEST(KeptBuild, PartsInAnyOrderAreWhatABuildMakes) {
  const TempDir folder;
  DatasetBuildOptions options = LongTake(folder);
  options.out = folder / "alone", options.cache.kind = CachePlace::Kind::kOff;
  RunDatasetBuild(options);
  const auto whole = BytesBelow(options.out);
  options.cache = CacheIn(folder / "cache");
  std::map<std::string, std::string> kept;  // by part
  for (const char* part : {"frames=cam_b", "samples=cam_a", "frames=cam_a:1-1", "frames=cam_a:0-0"}) {
    options.part = part, options.out = folder / part;
    const PartReport report = RunDatasetBuildPart(options);
    ASSERT_FALSE(report.kept.empty()) << part;
    EXPECT_TRUE(fs::exists(options.out + "/part.json"));
    kept[part] = folder / "cache/" + report.kept.back();
  }
  EXPECT_FALSE(fs::is_empty(folder / "cache/digests")) << "footage is read once for all parts";
  EXPECT_TRUE(fs::exists(kept["frames=cam_b"] + "/block.json"));
  EXPECT_THAT(kept["frames=cam_b"], ::testing::EndsWith("00_01-000001"));
  const ino_t made = InodeOf(kept["frames=cam_a:1-1"] + "/hdImgs/00_00/00_00_00000305.jpg");
  EXPECT_NE(made, ino_t{0});
  options.part.clear(), options.out = folder / "joined";
  RunDatasetBuild(options);
  EXPECT_EQ(BytesBelow(options.out), whole);
  EXPECT_EQ(InodeOf(options.out + "/hdImgs/00_00/00_00_00000305.jpg"), made) << "taken, not made again";
  for (const char* wrong : {"choice", "frames=nobody", "frames=cam_a:2-1"}) {
    options.part = wrong, options.out = folder / "wrong";
    if (options.part == "frames=nobody") {
      EXPECT_TRUE(RunDatasetBuildPart(options).notes.partial);
    } else {
      EXPECT_THROW(RunDatasetBuildPart(options), UsageError) << wrong;
    }
  }
  dataset::WriteImage(Image(48, 36, 3, 255), folder / "cam_b/0007.png");
  options.part = "frames=cam_a:0-0", options.out = folder / "changed";
  EXPECT_NE(folder / "cache/" + RunDatasetBuildPart(options).kept.back(), kept["frames=cam_a:0-0"]) << "other footage";
  options.part = "frames=cam_a", options.out = folder / "nowhere", options.cache.kind = CachePlace::Kind::kAuto;
  EXPECT_THROW(RunDatasetBuildPart(options), UsageError) << "who would find it?";
}

/// Whatever a killed process left in the hidden folder goes with the next build that ends well.
TEST(KeptBuild, NothingStaysBesideADatasetThatIsThere) {
  const TempDir folder;
  const CachesAllowed allowed;
  DatasetBuildOptions options = LongTake(folder);
  options.out = folder / "d";
  for (const bool cut : {false, true}) {
    if (cut) {
      EXPECT_EQ(ImagesUntil(kLong + 1, options), kLong + 1);
    }
    fs::create_directories(folder / ".kept-d");  // before the first block, or after the last was removed
    options.build.overwrite = true;
    RunDatasetBuild(options);
    EXPECT_FALSE(fs::exists(folder / ".kept-d")) << cut;
  }
}

TEST(KeptBuild, OtherInputsAndDamageCountAsNothing) {
  const TempDir folder;
  DatasetBuildOptions options = LongTake(folder);
  options.out = folder / "d", options.cache = CacheIn(folder / "cache");
  ASSERT_EQ(ImagesUntil(kLong + 1, options), kLong + 1);
  for (const auto& entry : fs::recursive_directory_iterator(folder / "cache/datasets")) {
    if (entry.path().extension() == ".jpg") {
      fs::remove(entry.path());
      break;
    }
  }
  options.build.jpeg_quality = 90;
  ASSERT_EQ(ImagesUntil(kLong + 1, options), kLong + 1) << "other options";
  options.build.jpeg_quality = 95;
  RunDatasetBuild(options);
  const auto again = BytesBelow(options.out);
  options.out = folder / "alone", options.cache.kind = CachePlace::Kind::kOff;
  RunDatasetBuild(options);
  EXPECT_EQ(again, BytesBelow(options.out));
}

/// As after a kill: what was kept is not looked at again, and still listed.
TEST(KeptChecks, AShareThatIsDoneAgainListsWhatItHad) {
  const TempDir folder;
  dataset::WriteStudio(folder / "data", 3, 2);
  DatasetVerifyKept kept;
  kept.cache = CacheIn(folder / "cache"), kept.part = "share=0/2", kept.folder = folder / "share";
  const auto list = [&] { return ReadFile(folder / "share/part.json"); };
  EXPECT_EQ(RunDatasetVerify(folder / "data", {}, kept, {}).metrics["kept"], 2) << "cameras 0 and 2";
  const std::string first = list();
  EXPECT_EQ(RunDatasetVerify(folder / "data", {}, kept, {}).metrics["kept"], 2);
  EXPECT_EQ(list(), first);
}

}  // namespace
}  // namespace mvstudio::stages
