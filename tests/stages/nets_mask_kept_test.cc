#include <atomic>
#include <filesystem>
#include <map>
#include <stdexcept>

#include "core/disk/files.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/mask/input.h"
#include "stages/nets/mask/kept.h"
#include "stages/nets/mask/run.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// A run of mask that was cut goes on by cameras and blocks of time.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

constexpr int kWalkWidth = 48, kWalkHeight = 32, kWalkFrames = static_cast<int>(kKeptBlock) + 20;

bool InBlock(int x, int y, int frame) { return x >= frame % 32 && x < frame % 32 + 12 && y >= 6 && y < 26; }

/// A block that walks over a wall, again and again.
void PutFootage(const std::string& folder, int frames, int shade) {
  for (int frame = 0; frame < frames; ++frame) {
    Image rgb(kWalkWidth, kWalkHeight, 3);
    for (int y = 0; y < kWalkHeight; ++y) {
      for (int x = 0; x < kWalkWidth; ++x) {
        for (int k = 0; k < 3; ++k)
          rgb.Pixel(x, y)[k] = static_cast<uint8_t>(InBlock(x, y, frame) ? 220 - 60 * k : shade + (x * 5 + y * 3) % 40);
      }
    }
    dataset::WriteImage(rgb, folder + "/" + std::to_string(1000 + frame) + ".png");
  }
}

/// Sees what is bright, and ends the run at its `fatal`th image.
class BrightNet : public detect::Segmenter {
 public:
  Image Probability(const Image& rgb, const detect::ImageBox&) const override {
    if (++runs == fatal) throw std::runtime_error("killed");
    Image belief(rgb.width, rgb.height, 1);
    for (int y = 0; y < rgb.height; ++y) {
      for (int x = 0; x < rgb.width; ++x) *belief.Pixel(x, y) = rgb.Pixel(x, y)[0] > 180 ? 255 : 0;
    }
    return belief;
  }
  mutable std::atomic<int> runs{0};
  int fatal = -1;
};

std::map<std::string, std::string> FilesBelow(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && name.rfind(".mvstudio", 0) != 0)
      files[entry.path().string().substr(folder.size())] = ReadFile(entry.path().string());
  }
  return files;
}

class KeptMasks : public ::testing::Test {
 protected:
  KeptMasks() {
    PutFootage(folder_ / "raw/a", kWalkFrames, 60), PutFootage(folder_ / "raw/b", 30, 90);
    take_.footage = {{"a", folder_ / "raw/a", ""}, {"b", folder_ / "raw/b", ""}};
    options_.cache = CacheIn(folder_ / "cache"), options_.mask.background_frames = 6;
    options_.run.sheet_tiles = 8, options_.run.soft = true;
    backend_ = {"bright", net_, "one"};
    run_.num_threads = 1;
  }

  /// Masks and sheets, as bytes.
  std::map<std::string, std::string> Make(const std::string& name) {
    InputNotes notes;
    const MaskJob job = ReadMaskJob(options_, take_, &notes, run_);
    const MaskTrial trial = TryBackend(job, backend_, false, run_);
    const MaskRunResult result = MakeMasks(job, backend_, trial.models, folder_ / name, run_);
    for (size_t c = 0; c < job.cameras.size(); ++c)
      dataset::WriteImage(result.cameras[c].sheet, folder_ / name + "/" + std::to_string(c) + ".png");
    taken_.clear();
    for (const MaskCameraResult& camera : result.cameras) taken_.push_back(camera.take);
    return FilesBelow(folder_ / name);
  }

  TempDir folder_;
  std::shared_ptr<BrightNet> net_ = std::make_shared<BrightNet>();
  MaskStageOptions options_;
  TakeInput take_;
  MaskBackend backend_;
  RunContext run_;
  std::vector<dataset::TakeMasks> taken_;
};

TEST_F(KeptMasks, ACutRunGoesOnAtTheBlockThatWasNotFinished) {
  MaskStageOptions with_cache = options_;
  options_.cache.kind = CachePlace::Kind::kOff;
  const auto whole = Make("alone");
  EXPECT_EQ(whole.size(), size_t{2 * (kWalkFrames + 30) + 2});
  const std::vector<dataset::TakeMasks> taken = taken_;
  const int all = net_->runs.exchange(0), learning = all - kWalkFrames - 30;
  options_ = with_cache;
  // While learning of the second camera, in the first block, in the second, in the second camera.
  const int ends[] = {learning - 1, learning + 100, static_cast<int>(kKeptBlock) + 5, 20 + 10};
  const int again[] = {learning / 2 - 1, 100 + learning / 2, 5, 10};
  int lost = 0;
  for (size_t i = 0; i < 4; ++i) {
    net_->fatal = ends[i], net_->runs = 0;
    EXPECT_THROW(Make("cut" + std::to_string(i)), std::runtime_error) << i;
    lost += net_->runs;
    net_->fatal = -1;
  }
  net_->runs = 0;
  EXPECT_EQ(Make("whole"), whole);
  lost += net_->runs - all;
  EXPECT_LE(lost, again[0] + again[1] + again[2] + again[3] + 4) << "what the kills cost, in images";
  for (size_t c = 0; c < taken.size(); ++c) {
    EXPECT_EQ(taken_[c].images, taken[c].images);
    EXPECT_EQ(taken_[c].area_fraction_sum, taken[c].area_fraction_sum);
    EXPECT_EQ(taken_[c].flicker.Share(), taken[c].flicker.Share());
  }
  net_->runs = 0;
  EXPECT_EQ(Make("again"), whole);
  EXPECT_EQ(net_->runs, 0);
}

TEST_F(KeptMasks, PartsInAnyOrderGiveTheWhole) {
  options_.backend = "background";
  MaskStageOptions whole = options_;
  whole.take.images = {{"a", folder_ / "raw/a"}, {"b", folder_ / "raw/b"}};
  whole.cache.kind = CachePlace::Kind::kOff, whole.out = folder_ / "alone";
  RunMask(whole);
  MaskStageOptions part = whole;
  part.cache = options_.cache;
  int number = 0;
  for (const char* text : {"frames=b", "samples=a", "choice", "frames=a:1-1", "frames=a:0-0"}) {
    part.part = text, part.out = folder_ / ("part" + std::to_string(number++));
    const PartReport report = RunMaskPart(part);
    EXPECT_EQ(report.kept.size(), part.part == "choice" ? 0u : 1u) << text << ": one backend is no choice";
    EXPECT_TRUE(fs::exists(part.out + "/part.json"));
  }
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "cache/masks")) number += entry.is_regular_file();
  EXPECT_GE(number, 5 + 3);
  part.part.clear(), part.out = folder_ / "whole";
  const MaskStageReport report = RunMask(part);
  EXPECT_EQ(FilesBelow(part.out), FilesBelow(whole.out));
  EXPECT_EQ(report.masks.cameras[0].take.images, kWalkFrames);
  for (const char* kind : {"masks", "samples", "mask-models"}) {
    const std::string kept = folder_ / "cache/" + kind;
    for (const auto& entry : fs::recursive_directory_iterator(kept))
      EXPECT_TRUE(entry.is_directory() || entry.path().filename().string()[0] == '.') << entry.path() << " is needed no more";
  }
}

TEST_F(KeptMasks, WhatDecidesTheResultIsInTheKey) {
  std::set<std::string> keys;
  const auto add = [&] {
    InputNotes notes;
    const MaskJob job = ReadMaskJob(options_, take_, &notes, run_);
    return keys.insert(MasksKey(job, job.cameras[1], backend_, "")).second;
  };
  EXPECT_TRUE(add());
  EXPECT_FALSE(add());
  backend_.weights = "two";
  EXPECT_TRUE(add());
  options_.mask.temporal = 0.5;
  EXPECT_TRUE(add());
  options_.run.soft = false;
  EXPECT_TRUE(add());
  options_.changes.frames = "1005-1010";
  EXPECT_TRUE(add());
  dataset::WriteImage(Image(kWalkWidth, kWalkHeight, 3, 9), folder_ / "raw/b/1003.png");
  EXPECT_TRUE(add());
  backend_.weights.clear();
  EXPECT_TRUE(add());
  EXPECT_EQ(keys.count(""), 1u) << "a net that nobody knows";
}

TEST_F(KeptMasks, CutBytesAreNoResult) {
  InputNotes notes;
  take_.footage.erase(take_.footage.begin());
  const MaskJob job = ReadMaskJob(options_, take_, &notes, run_);
  const std::string samples = EncodeSamples(job.cameras[0].samples);
  EXPECT_EQ(EncodeSamples(DecodeSamples(samples)), samples);
  const dataset::LearnedCamera learned{Status::kOk, TryBackend(job, backend_, false, run_).models[0]};
  const std::string model = EncodeLearned(learned);
  EXPECT_EQ(EncodeLearned(DecodeLearned(model)), model);
  MaskBlock block;
  block.frames.push_back({7, "mask", "soft", Image(2, 2, 3)});
  const std::string masks = EncodeMaskBlock(block);
  EXPECT_EQ(EncodeMaskBlock(DecodeMaskBlock(masks)), masks);
  for (size_t size = 0; size < masks.size(); ++size) EXPECT_THROW(DecodeMaskBlock(masks.substr(0, size)), DamagedBytes);
  for (const std::string* bytes : {&samples, &model}) {
    for (size_t size = 0; size < bytes->size(); size += bytes->size() / 50 + 1) {
      const std::string cut = bytes->substr(0, size);
      EXPECT_THROW(bytes == &samples ? (void)DecodeSamples(cut) : (void)DecodeLearned(cut), DamagedBytes);
    }
  }
}

}  // namespace
}  // namespace mvstudio::stages
