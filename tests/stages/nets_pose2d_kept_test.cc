#include <atomic>
#include <set>
#include <stdexcept>

#include "dataset/footage/image_io.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/nets/pose2d/kept.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// A run of pose2d that was cut goes on by cameras and blocks of time.
namespace mvstudio::stages {
namespace {

/// Finds its joints in the middle of every image, and ends the run at images as bright as `fatal`.
class MiddleNet : public detect::JointNet {
 public:
  const geometry::Skeleton& skeleton() const override { return geometry::SkeletonByName("coco17"); }
  int input_px() const override { return 16; }
  double person_fill() const override { return 0.8; }
  detect::JointMaps Run(const Image& crop, const std::vector<dataset::Keypoint2d>&) const override {
    ++runs;
    if (crop.pixels[crop.pixels.size() / 2] == fatal) throw std::runtime_error("killed");
    detect::JointMaps maps;
    maps.joints = static_cast<int>(skeleton().joints.size()), maps.height = maps.width = 3;
    maps.stride_px = 4, maps.origin_x_px = maps.origin_y_px = 4;
    for (int j = 0; j < maps.joints; ++j) {
      for (int cell = 0; cell < 9; ++cell) maps.score.push_back(cell == j % 9 ? 0.9F : 0.1F);
    }
    return maps;
  }
  mutable std::atomic<int> runs{0};
  int fatal = -1;
};

class KeptPoses : public ::testing::Test {
 protected:
  KeptPoses() {
    for (const auto& [camera, grey] : {std::pair("a", 50), std::pair("b", 200)}) {
      for (int i = 0; i < 3; ++i)
        dataset::WriteImage(Image(32, 24, 3, static_cast<uint8_t>(grey)),
                            folder_ / "raw" + "/" + camera + "/000" + std::to_string(i) + ".png");
      job_.footage.push_back({camera, folder_ / "raw/" + camera, ""});
    }
    job_.overlays = 1, job_.cache = CacheIn(folder_ / "cache");
    backend_.name = "middle", backend_.net = net_, backend_.plan = detect::PlanOf(detect::PoseQuality::kFast);
    backend_.weights = "one";
    run_.num_threads = 1;
  }

  TempDir folder_;
  std::shared_ptr<MiddleNet> net_ = std::make_shared<MiddleNet>();
  DetectJob job_;
  PoseBackend backend_;
  RunContext run_;
};

std::vector<std::string> Bytes(const std::vector<CameraPoses>& cameras) {
  std::vector<std::string> bytes;
  for (CameraPoses camera : cameras) {
    camera.seconds = 0;
    bytes.push_back(camera.track.camera + EncodeCameraPoses(camera));
  }
  return bytes;
}

TEST_F(KeptPoses, ACutRunGoesOnAtTheCameraThatWasNotFinished) {
  DetectJob alone = job_;
  alone.cache.kind = CachePlace::Kind::kOff;
  const std::vector<std::string> whole = Bytes(DetectPoses(alone, backend_, run_));
  const int all = net_->runs.exchange(0);
  net_->fatal = 200;
  EXPECT_THROW(DetectPoses(job_, backend_, run_), std::runtime_error);
  net_->fatal = 50, net_->runs = 0;  // camera a must not be asked for again
  EXPECT_EQ(Bytes(DetectPoses(job_, backend_, run_)), whole);
  EXPECT_EQ(net_->runs, all / 2);
  net_->runs = 0;
  EXPECT_EQ(Bytes(DetectPoses(job_, backend_, run_)), whole);
  EXPECT_EQ(net_->runs, 0);
}

TEST_F(KeptPoses, ALongCameraGoesOnByBlocks) {
  job_.footage.resize(1), job_.footage[0].path = folder_ / "raw/long";
  for (int i = 0; i < kKeptBlock + 5; ++i)
    dataset::WriteImage(Image(8, 6, 3, static_cast<uint8_t>(i < kKeptBlock ? 50 : 200)),
                        folder_ / ("raw/long/" + std::to_string(1000 + i) + ".png"));
  DetectJob alone = job_;
  alone.cache.kind = CachePlace::Kind::kOff;
  const std::vector<std::string> whole = Bytes(DetectPoses(alone, backend_, run_));
  net_->fatal = 200;
  EXPECT_THROW(DetectPoses(job_, backend_, run_), std::runtime_error);
  net_->fatal = 50;  // the first block must not be asked for again
  EXPECT_EQ(Bytes(DetectPoses(job_, backend_, run_)), whole);

  DetectJob parts = job_;  // in any order, by whoever shares the folder
  parts.cache = CacheIn(folder_ / "shared");
  parts.first_block = 1;
  EXPECT_EQ(DetectPoses(parts, backend_, run_)[0].frames, 5);
  net_->fatal = 200;
  parts.first_block = 0, parts.end_block = 1;
  EXPECT_EQ(DetectPoses(parts, backend_, run_)[0].frames, kKeptBlock);
  net_->runs = 0;
  job_.cache = parts.cache;
  EXPECT_EQ(Bytes(DetectPoses(job_, backend_, run_)), whole);
  EXPECT_EQ(net_->runs, 0);
}

TEST_F(KeptPoses, ABlockOfAnotherCameraIsNone) {
  const std::string one = BlockKey("a", 3), other = BlockKey("b", 3);
  EXPECT_EQ(one, "a/000003");
  EXPECT_NE(one, other);
  PoseBlock block;
  block.positions = 7, block.ended = true;
  const PoseBlock again = DecodePoseBlock(EncodePoseBlock(block));
  EXPECT_EQ(again.positions, 7);
  EXPECT_TRUE(again.ended);
  EXPECT_THROW(DecodePoseBlock("1234567"), DamagedBytes);
}

TEST_F(KeptPoses, WhatDecidesTheResultIsInTheKey) {
  const auto key = [&] { return CameraPosesKey(job_, job_.footage[0], backend_); };
  std::set<std::string> keys = {*key()};
  backend_.weights = "two";
  EXPECT_TRUE(keys.insert(*key()).second);
  job_.options.redetect_frames += 1;
  EXPECT_TRUE(keys.insert(*key()).second);
  job_.every = 2;
  EXPECT_TRUE(keys.insert(*key()).second);
  job_.frames = {1};
  EXPECT_TRUE(keys.insert(*key()).second);
  dataset::WriteImage(Image(32, 24, 3, 51), folder_ / "raw/a/0001.png");
  EXPECT_TRUE(keys.insert(*key()).second);
  job_.footage[0].path += "-gone";
  EXPECT_FALSE(key());
  backend_.weights.clear();
  EXPECT_FALSE(CameraPosesKey(job_, job_.footage[1], backend_)) << "a net that nobody knows";
}

TEST_F(KeptPoses, CutBytesAreNoResult) {
  const std::string whole = EncodeCameraPoses(DetectPoses(job_, backend_, run_)[0]);
  EXPECT_EQ(EncodeCameraPoses(DecodeCameraPoses(whole)), whole);
  for (size_t size = 0; size < whole.size(); size += 7) EXPECT_THROW(DecodeCameraPoses(whole.substr(0, size)), DamagedBytes);
  EXPECT_THROW(DecodeCameraPoses(whole + "x"), DamagedBytes);
}

TEST_F(KeptPoses, AFailureIsNotKept) {
  job_.footage[1].path = folder_ / "raw/none";
  EXPECT_FALSE(DetectPoses(job_, backend_, run_)[1].failure.empty());
  for (int i = 0; i < 3; ++i)
    dataset::WriteImage(Image(32, 24, 3, 9), folder_ / "raw" + "/none/000" + std::to_string(i) + ".png");
  EXPECT_EQ(DetectPoses(job_, backend_, run_)[1].failure, "");
}

}  // namespace
}  // namespace mvstudio::stages
