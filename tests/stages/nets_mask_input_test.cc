#include <filesystem>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/mask/input.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Foreground where columns lie in [x0, x1) and rows in [y0, y1).
Image Mask(int width, int height, int x0, int x1, int y0, int y1) {
  Image mask(width, height, 1);
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) *mask.Pixel(x, y) = 255;
  }
  return mask;
}

TEST(MaskTruth, ScoresOfHandMadeMasks) {
  const TempDir folder;
  const std::string truth = folder / "truth", masks = folder / "masks";
  dataset::WriteImage(Mask(4, 4, 0, 2, 0, 4), MaskPath(masks, "a", 3));  // left half against upper half: 4 of 12
  dataset::WriteImage(Mask(4, 4, 0, 4, 0, 2), truth + "/cam_0003.png");
  dataset::WriteImage(Mask(4, 4, 0, 3, 0, 4), MaskPath(masks, "a", 4));  // 12 px against 16
  dataset::WriteImage(Mask(4, 4, 0, 4, 0, 4), truth + "/cam_0004.png");
  dataset::WriteImage(Image(4, 4, 1), MaskPath(masks, "a", 5));  // nobody on both
  dataset::WriteImage(Image(4, 4, 1), truth + "/cam_0005.png");
  dataset::WriteImage(Image(4, 4, 1), truth + "/cam_0006.png");  // without a mask of ours
  const TruthScore score = CompareWithTruth(truth, masks, "a");
  EXPECT_EQ(score.images, 3);
  EXPECT_EQ(score.missing, 1);
  EXPECT_NEAR(score.iou_sum, 4.0 / 12 + 12.0 / 16 + 1, 1e-12);
  EXPECT_NEAR(score.worst, 4.0 / 12, 1e-12);
  EXPECT_EQ(score.worst_image, masks + "/a/00000003.png");
  EXPECT_EQ(score.too_much_px, 4);
  EXPECT_EQ(score.too_little_px, 4 + 4);
}

TEST(MaskTruth, WithoutTruthOrOfOtherSizesThereIsNoScore) {
  const TempDir folder;
  EXPECT_THAT(MessageOf<IoError>([&] { CompareWithTruth(folder / "none", folder / "masks", "a"); }),
              HasSubstr(folder / "none"));
  dataset::WriteImage(Image(4, 4, 1), MaskPath(folder / "masks", "a", 1));
  dataset::WriteImage(Image(5, 4, 1), folder / "truth/1.png");
  EXPECT_THAT(MessageOf<FormatError>([&] { CompareWithTruth(folder / "truth", folder / "masks", "a"); }),
              HasSubstr("1.png: is 5x4, the footage 4x4"));
}

/// Two frames, the person left and then right; exact masks called 1 and 2.
TEST(MaskTruth, ExactMasksFromOneAreComparedWithFramesFromZero) {
  const TempDir folder;
  for (const int frame : {0, 1}) {
    const Image mask = Mask(4, 4, 2 * frame, 2 * frame + 2, 0, 4);
    dataset::WriteImage(mask, MaskPath(folder / "masks", "a", frame));
    dataset::WriteImage(mask, folder / ("truth/" + std::to_string(frame + 1) + ".png"));
  }
  const TruthScore score = CompareWithTruth(folder / "truth", folder / "masks", "a");
  EXPECT_TRUE(score.from_one);
  EXPECT_EQ(score.images, 2);
  EXPECT_EQ(score.worst, 1);
}

/// Twelve frames of a block that walks over a wall.
TEST(MaskFrames, ThoseThatWereAskedForGetMasks) {
  const TempDir folder;
  for (int frame = 0; frame < 12; ++frame) {
    Image rgb(96, 64, 3);
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 96; ++x) {
        const bool block = x >= 6 * frame && x < 6 * frame + 18 && y >= 12 && y < 52;
        for (int k = 0; k < 3; ++k) rgb.Pixel(x, y)[k] = static_cast<uint8_t>(block ? 220 - 60 * k : 60 + (x * 5 + y * 3) % 40);
      }
    }
    dataset::WriteImage(rgb, folder / ("a/" + std::to_string(frame) + ".png"));
  }
  TakeInput take;
  take.footage.push_back({"a", folder / "a", ""});
  MaskStageOptions options;
  const auto job_of = [&](const std::string& frames, InputNotes* notes) {
    options.changes.frames = frames;
    return ReadMaskJob(options, take, notes, {});
  };
  InputNotes notes;
  const MaskJob job = job_of("8-30", &notes);
  ASSERT_EQ(notes.warnings.size(), 1u);
  EXPECT_THAT(notes.warnings[0].text, HasSubstr("the footage has no frames 12 to 30; it has 12 frames from 0 to 11"));
  EXPECT_EQ(job.cameras[0].samples.numbers.size(), 12u) << "the background is learned from all";
  const MaskTrial trial = TryBackend(job, {"background", nullptr}, false, {});
  ASSERT_EQ(trial.failed_camera, "");
  const MaskRunResult masks = MakeMasks(job, {"background", nullptr}, trial.models, folder / "masks", {});
  EXPECT_EQ(masks.cameras[0].take.images, 4);
  EXPECT_FALSE(std::filesystem::exists(MaskPath(folder / "masks", "a", 7)));
  EXPECT_TRUE(std::filesystem::exists(MaskPath(folder / "masks", "a", 8)));
  EXPECT_THAT(MessageOf<NothingLeftError>([&] { job_of("50-60", &notes); }), HasSubstr("no frames 50 to 60; it has 12"));
  options.changes.rate = {{"", "25"}};
  EXPECT_THAT(MessageOf<UsageError>([&] { job_of("", &notes); }), HasSubstr("option 'rate'"));
}

/// Twelve images 0 to 11 and joints of frames 1 to 12.
TEST(MaskFrames, JointsFromOneAreTakenForTheFramesFromZero) {
  const TempDir folder;
  dataset::Pose2dTrack track{"a", {}};
  for (int frame = 0; frame < 12; ++frame) {
    dataset::WriteImage(Image(96, 64, 3), folder / ("a/" + std::to_string(frame) + ".png"));
    dataset::Person2d person;
    for (int j = 0; j < 25; ++j) person.keypoints.push_back({10.0 + frame + j, 20.0 + j, 0.9});
    track.frames[frame + 1].push_back(person);
  }
  dataset::WriteOpenPoseFolder(track, folder / "joints");
  TakeInput take;
  take.footage.push_back({"a", folder / "a", ""});
  MaskStageOptions options;
  options.pose2d = {{"a", folder / "joints"}};
  InputNotes notes;
  const MaskJob job = ReadMaskJob(options, take, &notes, {});
  ASSERT_EQ(job.cameras[0].bodies.frames.size(), 12u);
  EXPECT_EQ(job.cameras[0].bodies.frames.begin()->first, 0);
  ASSERT_EQ(notes.warnings.size(), 1u);
  EXPECT_EQ(notes.warnings[0].code, "POSE-FIRST");
}

}  // namespace
}  // namespace mvstudio::stages
