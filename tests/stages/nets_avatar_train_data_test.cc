#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "dataset/views/split.h"
#include "stages/nets/avatar_train_data.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Cameras 00_00, 00_01 ("left") and 00_02; person 0 has a pose in frames 0, 1, 3 and 4, person 7 in frame 2.
dataset::PanopticDataset Data() {
  dataset::PanopticDataset data;
  data.root = "somewhere", data.sequence = "take";
  for (const char* name : {"00_00", "00_01", "00_02"}) {
    data.rig.cameras.emplace_back();
    data.rig.cameras.back().camera = geometry::MakePinhole(name, 640, 480, 500);
  }
  data.aliases = {{"left", "00_01"}};
  data.frames = {0, 1, 2, 3, 4};
  for (const int frame : data.frames) data.poses[frame].emplace(frame == 2 ? 7 : 0, dataset::Coco19Pose());
  return data;
}

std::string Refused(const SplitArguments& arguments, int person = 0) {
  return MessageOf<UsageError>([&] { SplitOf(Data(), person, arguments); });
}

TEST(AvatarTrainData, WhatIsNotHeldOutIsTrainedOn) {
  SplitArguments arguments;
  arguments.holdout_cameras = "00_02", arguments.holdout_frames = "3-4";
  const avatar::DatasetSplit split = SplitOf(Data(), 0, arguments);
  EXPECT_THAT(split.train_cameras, ElementsAre("00_00", "00_01"));
  EXPECT_THAT(split.holdout_cameras, ElementsAre("00_02"));
  EXPECT_THAT(split.train_frames, ElementsAre(0, 1)) << "without that of the other person";
  EXPECT_THAT(split.holdout_frames, ElementsAre(3, 4));
  EXPECT_THAT(split.validation_cameras, IsEmpty());
  arguments.train_cameras = "left";
  EXPECT_THAT(SplitOf(Data(), 0, arguments).train_cameras, ElementsAre("00_01"));
}

TEST(AvatarTrainData, FramesThatWereNotAskedForAreOnNoSide) {
  SplitArguments arguments;
  arguments.holdout_cameras = "00_02", arguments.holdout_frames = "3-4", arguments.frames = "1-3";
  const avatar::DatasetSplit split = SplitOf(Data(), 0, arguments);
  EXPECT_THAT(split.train_frames, ElementsAre(1));
  EXPECT_THAT(split.holdout_frames, ElementsAre(3));
  InputNotes notes;
  arguments.frames = "1-30", arguments.holdout_frames = "3-9";
  ReportSplitFrames(Data(), arguments, &notes);
  ASSERT_EQ(notes.warnings.size(), 2u);
  EXPECT_THAT(notes.warnings[0].text,
              HasSubstr("option 'frames': somewhere has no frames 5 to 30; it has 5 frames from 0 to 4"));
  EXPECT_THAT(notes.warnings[1].text, HasSubstr("option 'holdout-frames': somewhere has no frames 5 to 9"));
  arguments.frames = "90-99";
  EXPECT_THAT(MessageOf<NothingLeftError>([&] { SplitOf(Data(), 0, arguments); }), HasSubstr("no frames 90 to 99"));
  arguments.frames = "3-4";  // all of them held out
  EXPECT_THAT(MessageOf<NothingLeftError>([&] { SplitOf(Data(), 0, arguments); }), HasSubstr("is trained on"));
}

TEST(AvatarTrainData, TheValidationCameraIsTakenOutOfTraining) {
  SplitArguments arguments;
  arguments.holdout_cameras = "00_02", arguments.validate_camera = "left";
  const avatar::DatasetSplit split = SplitOf(Data(), 0, arguments);
  EXPECT_THAT(split.train_cameras, ElementsAre("00_00"));
  EXPECT_THAT(split.validation_cameras, ElementsAre("00_01"));
  EXPECT_EQ(split.validation_frames, split.train_frames);
  arguments.validate_camera = "00_02";
  EXPECT_THAT(Refused(arguments), HasSubstr("option 'validate-camera' 00_02 is not one of the training cameras: 00_00, 00_01"));
  arguments.validate_camera = "nobody's";
  EXPECT_THAT(Refused(arguments), HasSubstr("option 'validate-camera' nobody's"));
  arguments.validate_camera = "left", arguments.train_cameras = "left";
  EXPECT_THAT(Refused(arguments), HasSubstr("leaves no camera to train on"));
}

TEST(AvatarTrainData, NamesAndFramesThatAreNotThereAreRefused) {
  SplitArguments cameras, frames, text, both;
  cameras.holdout_cameras = "00_02,00_09";
  EXPECT_THAT(Refused(cameras), HasSubstr("00_09"));
  frames.holdout_frames = "2";
  EXPECT_THAT(Refused(frames), HasSubstr("person 0 is in none of the frames that are held out"));
  text.holdout_frames = "x";
  EXPECT_THAT(Refused(text), HasSubstr("option 'holdout-frames'"));
  both.holdout_cameras = "left", both.train_cameras = "00_01";
  EXPECT_THAT(Refused(both), HasSubstr("00_01"));
  EXPECT_THAT(Refused({}, 3), HasSubstr("person 3"));
}

dataset::Split File() {
  dataset::Split file;
  file.dataset = "take", file.rule = "by hand";
  file.train.cameras = {"00_00"}, file.train.frames = {0, 2};
  file.validation.cameras = {"00_01"}, file.validation.frames = {1};
  file.test.cameras = {"00_02"}, file.test.frames = {3, 4};
  return file;
}

TEST(AvatarTrainData, ASplitFileDecidesWhereThePersonHasPoses) {
  const TempDir folder;
  SplitArguments arguments;
  arguments.split = folder / "split.json";
  dataset::WriteSplit(File(), arguments.split);
  const avatar::DatasetSplit split = SplitOf(Data(), 0, arguments);
  EXPECT_THAT(split.train_cameras, ElementsAre("00_00"));
  EXPECT_THAT(split.train_frames, ElementsAre(0));
  EXPECT_THAT(split.validation_cameras, ElementsAre("00_01"));
  EXPECT_THAT(split.validation_frames, ElementsAre(1));
  EXPECT_THAT(split.holdout_cameras, ElementsAre("00_02"));
  EXPECT_THAT(split.holdout_frames, ElementsAre(3, 4));
  EXPECT_THAT(SplitOf(Data(), 7, arguments).validation_cameras, IsEmpty()) << "nothing to validate with";
  arguments.validate_camera = "00_00";
  EXPECT_THAT(Refused(arguments), HasSubstr("validation images already"));
  arguments.validate_camera.clear(), arguments.holdout_frames = "3";
  EXPECT_THAT(Refused(arguments), HasSubstr("option 'split'"));
}

TEST(AvatarTrainData, ASplitOfOtherCamerasOrWithoutThePersonIsRefused) {
  const TempDir folder;
  SplitArguments arguments;
  arguments.split = folder / "split.json";
  const auto refused = [&](const dataset::Split& file) {
    dataset::WriteSplit(file, arguments.split);
    return MessageOf<FormatError>([&] { SplitOf(Data(), 0, arguments); });
  };
  dataset::Split other = File(), nobody = File();
  other.train.cameras = {"00_05"};
  EXPECT_THAT(refused(other), HasSubstr("00_05"));
  nobody.train.frames = {2};
  EXPECT_THAT(refused(nobody), HasSubstr("train.frames: person 0 has no pose"));
}

}  // namespace
}  // namespace mvstudio::stages
